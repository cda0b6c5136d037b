"""[system] and [noise] of a case: objects of the kinds that they name, and their parameters.

[oscillator] is [system] with kind = "vibro-impact"; [noise] without a kind is that of Eqs. (7)-(8), reduced or not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from functools import lru_cache
from typing import Any, Literal

from pydantic import ValidationError, create_model
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails

from fpsolve.case.messages import nearest, refuse, shown_with_kind
from fpsolve.model.faults import fields_of
from fpsolve.model.kinds import kind_names, noise_kind, system_kind
from fpsolve.model.parameters import STRICT, Parametrised, parameter
from fpsolve.model.problem import Problem

Half = Literal["system", "noise"]
USUAL: Mapping[Half, str] = {"system": "vibro-impact", "noise": "ou-reduction"}
"""The kinds of sections that name none."""


def half_of(half: Half, table: Any) -> Any:
    """The system or the noise that a table describes; one that is made already is left.

    Raises:
        ValidationError: with all that is wrong with it.
    """
    if not isinstance(table, dict):
        return table
    name, known = table.get("kind"), {key: value for key, value in table.items() if key != "kind"}
    kind = _kind(half, table)
    foreign = set(known) - (set(known) if kind.takes_any else set(fields_of(kind)))
    foreign |= set(kind.words) & set(kind.stated) & set(known) if name is not None else set()
    faults = [
        InitErrorDetails(type="unexpected_keyword_argument", loc=(key,), input=known.pop(key))
        for key in table
        if key in foreign
    ]
    given = {word: known.pop(word) for word in kind.stated if word in known}
    fields: Any = {word: (field.annotation, field) for word, field in kind.stated.items()}
    try:
        said = create_model(half, __config__=STRICT, **fields).model_validate(given)
        known |= {word: getattr(said, word) for word in given}
    except ValidationError as error:
        faults += _details(error)
    if not (faults and any(field.is_required() for field in kind.stated.values())):
        try:
            made = kind.from_table(known)
        except ValidationError as error:
            faults += _details(error)
        except (ValueError, TypeError) as error:
            if not faults:
                raise ValueError(str(error)) from None
    refuse([], faults)
    return made


def _details(error: ValidationError) -> list[InitErrorDetails]:
    return [
        InitErrorDetails(type=each["type"], loc=each["loc"], input=each["input"], ctx=each.get("ctx", {}))
        for each in error.errors(include_url=False)
    ]


def _kind(half: Half, table: Any) -> type[Parametrised]:
    """The class that a table names by its kind and, of those of one kind, by the keys that only one of them has."""
    name = table.get("kind") if isinstance(table, dict) else None
    if name is not None and name not in (names := kind_names("systems" if half == "system" else "noises")):
        text = f"got {shown_with_kind(name, but=str)}; must be one of {', '.join(names)};{nearest(name, names)}"
        refuse([(("kind",), name, f'{text} write, for example, kind = "{names[0]}"')])
    try:
        kind = (system_kind if half == "system" else noise_kind)(name or USUAL[half])
    except ValueError as error:
        refuse([(("kind",), name, f"{error}; mend its package, or write another kind")])
        raise
    known = set(table) if isinstance(table, dict) else set()
    return max((kind, *kind.variants), key=lambda each: len(known & set(fields_of(each))))


def kinds_of(data: Mapping[str, Any]) -> dict[Half, type[Parametrised]]:
    """The kinds that the tables of a case name, as far as there are such."""
    found = dict[Half, type[Parametrised]]()
    for half in USUAL:
        table = data.get(half, data.get("oscillator") if half == "system" else None)
        try:
            found[half] = _kind(half, table)
        except ValidationError:
            continue
    return found


def sections_of(fields: Mapping[str, FieldInfo], data: Mapping[str, Any]) -> dict[str, FieldInfo]:
    """The fields of a case with the kinds that its tables name, and [system] by its name in the file."""
    found = dict[str, FieldInfo]()
    kinds: Mapping[str, type[Parametrised]] = kinds_of(data)  # type: ignore[assignment]
    for name, field in fields.items():
        section = "oscillator" if name == "system" and "system" not in data else name
        found[section] = field
        if name in kinds:
            found[section] = described = copy(field)
            described.annotation = kinds[name]
            if section == "system" or (isinstance(data.get(section), dict) and "kind" in data[section]):
                described.description, described.examples = f"{name} of a kind", [f"[{section}]"]
    return found


def parameters_of(valid: Mapping[str, Any], context: Mapping[str, Any]) -> dict[str, FieldInfo] | None:
    """The parameters of a case by their keys, each with its range; None where not all are known.

    Args:
        valid: the sections that are.
        context: with the kinds that the tables name.
    """
    found = dict[str, FieldInfo]()
    unbounded = parameter("a parameter", "")
    unbounded.annotation = float
    for half in USUAL:
        made = valid.get(half)
        kind = context.get("kinds", {}).get(half) or (None if made is None else type(made))
        if kind is None or (made is None and not kind.fields()):
            return None
        names = made.values if made is not None else {**kind.fields(), **kind.words}
        found |= {f"{kind.section}.{name}": fields_of(kind).get(name, unbounded) for name in names}
    return found


def problem_of(valid: Mapping[str, Any]) -> Problem | None:
    """The problem of the sections that are valid, if both halves are."""
    return Problem(valid["system"], valid["noise"]) if {"system", "noise"} <= valid.keys() else None


def varying(problem: Problem) -> Callable[[Mapping[str, float | str]], Problem]:
    """Gives the problem with other values of some parameters, as `Problem.at`; halves that are the same are shared."""

    @lru_cache(maxsize=1024)
    def half(section: str, values: tuple[tuple[str, float | str], ...]) -> Any:
        return next(each for each in problem.at(dict(values)).halves if each.section == section)

    def at(varied: Mapping[str, float | str]) -> Problem:
        of_half = {each.section: list[tuple[str, float | str]]() for each in problem.halves}
        for key, value in varied.items():
            of_half[key.partition(".")[0]].append((key, value))
        system, noise = (half(section, tuple(values)) for section, values in of_half.items())
        return Problem(system, noise)

    return at
