"""[system] and [noise] of a case: objects of the kinds that they name, and their parameters.

[oscillator] is [system] with kind = "vibro-impact", [system] without a kind one of equations where it states some;
[noise] without a kind is that of Eqs. (7)-(8). [noise.axial] is a noise that [system] calls so; there
may be several.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError, ValidationInfo
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from fpsolve.case.explain import UNBOUNDED, Refusal, refuse, told, validated
from fpsolve.case.matrices import OF_MATRICES, with_matrices
from fpsolve.model.faults import TableError, fields_of, nearest, shown, table_of
from fpsolve.model.kinds import KINDS, Half, kind_of
from fpsolve.model.noises.several import noises_of
from fpsolve.model.parameters import Parametrised, Words
from fpsolve.model.problem import Problem

USUAL: Mapping[Half, str] = {"system": "vibro-impact", "noise": "non-gaussian"}
"""The kinds of sections that name none."""
REDUCED = "ou-reduction"
"""The kind of a noise (7) whose treatment is this."""
EQUATIONS, STATING = "equations", ("variables", "drift")
"""The kind of a [system] that names none, but states one of these."""


def half_of(half: Half, table: Any, info: ValidationInfo) -> Any:
    """The system or the noise that a table describes; one that is made already is left.

    Raises:
        ValidationError: with all that is wrong with it.
    """
    if not isinstance(table, dict):
        return table
    if half == "system":
        folder = (info.context or {}).get("folder", Path())
        return made_of(half, with_matrices(table, folder) if table.get("kind") in OF_MATRICES else table)
    names, system = names_of(table), info.data.get("system")
    if system is not None:
        refuse(_misnamed(names, system.noise_sections))
    if not names:
        return made_of(half, table)
    made, faults = dict[str, Any](), list[Refusal]()
    for name in names:
        try:
            made[name] = made_of(half, table[name])
        except ValidationError as error:
            faults += (((name, *each["loc"]), each["msg"]) for each in error.errors())
    refuse(faults)
    return noises_of(made)


def names_of(table: Any) -> list[str]:
    """The names of the noises of a [noise], as of [noise.axial]; none where it is a noise itself."""
    tables = table_of(table)
    return [*tables] if all(isinstance(each, dict) for each in tables.values()) else []


def _misnamed(names: list[str], sections: Sequence[str]) -> Iterator[Refusal]:
    """Noises that are not those of the system, of which one has the section "noise" and no name."""
    wanted = {section.partition(".")[2] for section in sections} - {""}
    if {*names} != wanted:
        stated = " and ".join(f"[{section}]" for section in sections)
        found = " and ".join(f"[noise.{name}]" for name in names) or "[noise] alone"
        text = f"must be {stated} for this system, but is {found}; rename it, or name others in noises of [system]"
        yield tuple(name for name in names if name not in wanted)[:1], text


def made_of(half: Half, table: Mapping[str, object]) -> Parametrised:
    """What a table describes. Raises `ValidationError` with all that is wrong with it, in our words."""
    kind, faults = _kind(half, table), list[ErrorDetails]()
    known = {**dict.fromkeys(table_of(table.get("parameters")), UNBOUNDED), **fields_of(kind)}
    given = {key: value for key, value in table.items() if key != "kind"}
    named = {key: given.pop(key) for key in kind.naming if key in given}
    own = {key: given.pop(key) for key in kind.__pydantic_fields__ if key in given}
    about = Words()
    try:
        about = Words(**named)
        stated = validated(kind.stated, given)
    except ValidationError as error:
        faults, stated = error.errors(), {}
    if not (faults and any(field.is_required() for field in kind.stated.values())):
        try:
            made = kind.from_table(own | stated).called(about)
        except ValidationError as error:
            faults += error.errors()
        except (ValueError, TypeError) as error:
            if not faults:
                path, text = (error.path, error.text) if isinstance(error, TableError) else ((), str(error))
                refuse([(path, text)])
    refuse(told(faults, known, [each.__pydantic_fields__ for each in kind.variants]))
    return made


def _kind(half: Half, table: Mapping[str, Any]) -> type[Parametrised]:
    """The class that a table names by its kind and, of those of one kind, by the keys that only one of them has."""
    name = table.get("kind")
    if name is None and half == "system" and any(key in table for key in STATING):
        name = EQUATIONS
    if half == "noise" and name in (None, USUAL[half]) and table.get("treatment") == REDUCED:
        name = REDUCED
    names = [*KINDS[half]]
    if name is not None and name not in names:
        text = f"got {shown(name)}; must be one of {', '.join(names)};{nearest(name, names)}"
        refuse([(("kind",), f'{text} write, for example, kind = "{names[0]}"')])
    kind = kind_of(half, name or USUAL[half])
    return max((kind, *kind.variants), key=lambda each: len(table.keys() & fields_of(each).keys()))


def kinds_of(data: Mapping[str, object]) -> dict[str, type[Parametrised]]:
    """The kinds of the system and of an only noise, by their sections, as far as there are such."""
    halves: dict[str, Half] = {system_of(data): "system", "noise": "noise"}
    found = dict[str, type[Parametrised]]()
    for section, half in halves.items():
        with suppress(ValidationError):
            found[section] = _kind(half, table_of(data.get(section)))
    return found


def system_of(data: Mapping[str, object]) -> str:
    """What a case calls its system."""
    return "system" if "system" in data else "oscillator"


def parameters_of(problem: Problem) -> dict[str, FieldInfo]:
    """The parameters of a problem by their keys, each with its range."""
    known = problem.parameters.items()
    return {key: fields_of(each.kind).get(key.rpartition(".")[2], UNBOUNDED) for key, each in known}


def problem_of(valid: Mapping[str, Any]) -> Problem | None:
    """The problem of the sections that are valid, if both halves are."""
    return Problem(valid["system"], valid["noise"]) if {"system", "noise"} <= valid.keys() else None
