"""[system] and [noise] of a case: objects of the kinds that they name, and their parameters.

[oscillator] is [system] with kind = "vibro-impact"; [noise] without a kind is that of Eqs. (7)-(8), reduced or not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails

from fpsolve.case.messages import nearest, refuse, shown, shown_with_kind
from fpsolve.model.faults import fields_of
from fpsolve.model.kinds import kind_names, noise_kind, system_kind
from fpsolve.model.parameters import STRICT, Parametrised, parameter
from fpsolve.model.problem import Problem

Half = Literal["system", "noise"]
USUAL: Mapping[Half, str] = {"system": "vibro-impact", "noise": "ou-reduction"}
"""The kinds of sections that name none."""
_ROOMS: Mapping[Half, Literal["systems", "noises"]] = {"system": "systems", "noise": "noises"}
_CLASSES: Mapping[Half, Callable[[str], type[Parametrised]]] = {"system": system_kind, "noise": noise_kind}


def with_system(data: Any) -> Any:
    """The tables of a case, [oscillator] under its other name."""
    if not isinstance(data, dict) or "oscillator" not in data:
        return data
    if "system" in data:
        text = "stands beside [system], but a case has one system; remove one of the two"
        refuse([(("oscillator",), data["oscillator"], text)])
    return {"system" if name == "oscillator" else name: table for name, table in data.items()}


def half_of(half: Half, table: Any) -> Any:
    """The system or the noise that a table describes; one that is made already is left.

    Raises:
        ValidationError: with all that is wrong with it.
    """
    if isinstance(table, Parametrised):
        return table
    if not isinstance(table, dict):
        fault = InitErrorDetails(type="dataclass_type", loc=(), input=table, ctx={"class_name": half})
        raise ValidationError.from_exception_data(half, [fault])
    name = table.get("kind")
    kind, known = _kind(half, name), {key: value for key, value in table.items() if key != "kind"}
    kind_fields, faults = fields_of(kind), list[InitErrorDetails]()
    for key in [] if kind.takes_any else [key for key in known if key not in kind_fields]:
        faults.append(InitErrorDetails(type="unexpected_keyword_argument", loc=(key,), input=known.pop(key)))
    for word, field in kind.stated.items():
        if word in known and word in kind.words and name is not None:
            faults.append(InitErrorDetails(type="unexpected_keyword_argument", loc=(word,), input=known.pop(word)))
        elif word in known:
            try:
                accepted: Any = Annotated[field.annotation, Field(), *field.metadata]
                known[word] = TypeAdapter[Any](accepted, config=STRICT).validate_python(known[word])
            except ValidationError as error:
                faults += _details(error, (word,))
                del known[word]
        elif field.is_required():
            faults.append(InitErrorDetails(type="missing", loc=(word,), input=table))
    if faults and any(field.is_required() for field in kind.stated.values()):
        raise ValidationError.from_exception_data(half, faults)
    try:
        made = kind.from_table(known)
    except ValidationError as error:
        raise ValidationError.from_exception_data(half, [*faults, *_details(error)]) from None
    except (ValueError, TypeError) as error:
        if not faults:
            refuse([((), table, str(error))])
    if faults:
        raise ValidationError.from_exception_data(half, faults)
    return made


def _details(error: ValidationError, place: tuple[str, ...] = ()) -> list[InitErrorDetails]:
    """The faults of an error as those at a place."""
    return [
        InitErrorDetails(type=each["type"], loc=(*place, *each["loc"]), input=each["input"], ctx=each.get("ctx", {}))
        for each in error.errors(include_url=False)
    ]


def _kind(half: Half, name: Any) -> type[Parametrised]:
    """The class of a kind; without a name the usual one."""
    names = kind_names(_ROOMS[half]) if name is not None else ()
    if name is not None and name not in names:
        guess = nearest(name, names) if isinstance(name, str) else ""
        got = shown(name) if isinstance(name, str) else shown_with_kind(name)
        text = f"got {got}; must be one of {', '.join(names)};{guess} write, for example, kind = "
        refuse([(("kind",), name, f'{text}"{names[0]}"')])
    try:
        return _CLASSES[half](name or USUAL[half])
    except ValueError as error:
        refuse([(("kind",), name, f"{error}; mend its package, or write another kind")])
        raise


def kinds_of(data: Mapping[str, Any]) -> dict[Half, type[Parametrised]]:
    """The kinds that the tables of a case name, as far as there are such."""
    found = dict[Half, type[Parametrised]]()
    for half in USUAL:
        table = data.get(half, data.get("oscillator") if half == "system" else None)
        try:
            found[half] = _kind(half, table.get("kind") if isinstance(table, dict) else None)
        except ValidationError:
            continue
    return found


def sections_of(fields: Mapping[str, FieldInfo], data: Mapping[str, Any]) -> dict[str, FieldInfo]:
    """The fields of a case with the kinds that its tables name, and [system] by its name in the file."""
    found = dict[str, FieldInfo]()
    kinds = kinds_of(data)
    for name, field in fields.items():
        if name not in kinds:
            found[name] = field
            continue
        half: Half = "system" if name == "system" else "noise"
        section = "oscillator" if half == "system" and "system" not in data else name
        is_named = isinstance(data.get(section), dict) and "kind" in data[section]
        found[section] = described = copy(field)
        described.annotation = kinds[half]
        if section == "system" or is_named:
            described.description, described.examples = f"{half} of a kind", [f"[{section}]"]
    return found


def parameters_of(valid: Mapping[str, Any], context: Mapping[str, Any]) -> dict[str, FieldInfo] | None:
    """The parameters of a case by their keys, each with its range; None where not all are known.

    Args:
        valid: the sections that are.
        context: with the kinds that the tables name.
    """
    found = dict[str, FieldInfo]()
    for half in USUAL:
        made = valid.get(half)
        kind = context.get("kinds", {}).get(half) or (None if made is None else type(made))
        if kind is None or (made is None and not kind.fields()):
            return None
        fields = fields_of(kind)
        names = made.values if made is not None else {**kind.fields(), **kind.words}
        found |= {f"{kind.section}.{name}": fields.get(name) or _unbounded() for name in names}
    return found


def _unbounded() -> FieldInfo:
    """A parameter of which no range is stated."""
    field = parameter("a parameter", "")
    field.annotation = float
    return field


def problem_of(valid: Mapping[str, Any]) -> Problem | None:
    """The problem of the sections that are valid, if both halves are."""
    halves = valid.get("system"), valid.get("noise")
    return None if None in halves else Problem(*halves)  # type: ignore[arg-type]


def varying(problem: Problem) -> Callable[[Mapping[str, float | str]], Problem]:
    """Gives the problem with other values of some parameters, as `Problem.at`; halves that are the same are shared."""

    @lru_cache(maxsize=1024)
    def half(section: str, values: tuple[tuple[str, float | str], ...]) -> Any:
        changed = problem.at(dict(values)) if values else problem
        return changed.system if section == problem.system.section else changed.noise

    def at(varied: Mapping[str, float | str]) -> Problem:
        sections = (each.section for each in problem.halves)
        return Problem(
            *(
                half(section, tuple(item for item in varied.items() if item[0].partition(".")[0] == section))
                for section in sections
            )
        )

    return at
