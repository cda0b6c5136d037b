"""From pydantic's errors to sentences about keys of a file: which, where, what it must be, and what to write."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import Any, TypeGuard, get_args, get_origin

from pydantic import BaseModel, Discriminator, ValidationError, create_model
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from fpsolve.model.faults import TableError, fields_of, guess, sentence, written_path
from fpsolve.model.parameters import STRICT, Section, parameter

MOST_FAULTS = 1000
"""Of so many at most it is sought what was meant, which takes long."""
_OWN = "own sentence"
LIST, TABLE, WORD, NUMBER = "<list>", "<table>", "<word>", "<number>"
"""Tags of what TOML has there, in a union that is told apart by that; parts of pydantic's places that are no keys."""
_TAGS: Mapping[type, str] = {list: LIST, tuple: LIST, dict: TABLE, str: WORD, int: NUMBER, float: NUMBER}
BY_KIND = Discriminator(lambda value: _TAGS.get(type(value), TABLE if isinstance(value, Section) else None))
"""How such a union is told apart."""
DEPENDENT = "cannot be judged, as the kinds of the system and the noise are not known; correct these"
"""Of a section; which kinds are wrong is another fault."""
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")

UNBOUNDED = parameter("a parameter", "zeta = 0.1")
UNBOUNDED.annotation = float
"""The range of a parameter of which no more is known than that it is one."""

Path = tuple[str | int, ...]
Refusal = tuple[Path, str]
"""Where, and why."""
Fields = Mapping[str, FieldInfo]


def refuse(refusals: Iterable[Refusal]) -> None:
    """Raise all refusals of a validator at once; without any, do nothing."""
    details = [InitErrorDetails(type=PydanticCustomError(_OWN, text), loc=path, input=None) for path, text in refusals]
    if details:
        raise ValidationError.from_exception_data("case", details)


def validated(fields: Fields, table: Mapping[str, object]) -> dict[str, Any]:
    """What a table says of some fields. Raises `ValidationError`."""
    known: dict[str, Any] = {name: (field.annotation, field) for name, field in fields.items()}
    model: type[BaseModel] = create_model("table", __config__=STRICT, **known)
    made = model.model_validate(table)
    return {name: vars(made)[name] for name in table}


def checked(fields: Fields, table: Mapping[str, object]) -> dict[str, Any]:
    """The same; what is wrong is in our words."""
    try:
        return validated(fields, table)
    except ValidationError as error:
        refuse(told(error.errors(), fields))
        raise


def told(details: Iterable[ErrorDetails], fields: Fields, others: Sequence[Fields] = ()) -> Iterator[Refusal]:
    """What pydantic found, in our words; `others` are those of tables of the same kind with other keys."""
    return ((path, text) for path, _, text in explain(details, fields, others))


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value of TOML is a finite number."""
    return isinstance(value, int | float) and type(value) is not bool and abs(value) <= sys.float_info.max


def explain(
    details: Iterable[ErrorDetails], fields: Fields, others: Sequence[Fields] = ()
) -> Iterator[tuple[Path, str, str]]:
    """Each fault that pydantic found: its path in the file, its key for the eye, and our sentence.

    What is missing where a key is misspelt is not another fault, nor is a list too short whose entries are wrong.

    Args:
        details: with paths from a model.
        fields: of that model.
        others: in place of these; what is missing beside an unknown key may then be stated by others.
    """
    faults = list[tuple[Path, ErrorDetails]]()
    for each in islice(details, MOST_FAULTS):
        reason = each.get("ctx", {}).get("error")
        inside = reason.path if isinstance(reason, TableError) else ()
        if each["type"] != "too_short" or len(each["input"]) < each["ctx"]["min_length"]:
            faults.append((tuple(part for part in (*each["loc"], *inside) if part not in _TAGS.values()), each))
    misspelt = set[Path]()
    for path, detail in faults:
        if detail["type"] in _UNKNOWN and (known := _meant(str(path[-1]), _known_keys(path, fields, others))):
            misspelt.add((*path[:-1], *known.split(".")))
    for path, detail in faults:
        is_missing = detail["type"] == "missing" or detail["msg"].startswith("missing")
        if not (is_missing and (path in misspelt or (others and misspelt))) and detail["msg"] != DEPENDENT:
            yield path, written_path(path), _sentence(path, detail, fields, others)


def _known_keys(path: Path, fields: Fields, others: Sequence[Fields]) -> list[str]:
    """The keys beside a path, those of the tables among them, and others in their place."""
    beside = _beside(path[:-1], fields)[0]
    inner = (f"{name}.{key}" for name, field in beside.items() for key in fields_of(field.annotation))
    return [*beside, *inner, *chain.from_iterable(others)]


def _meant(name: str, known: Sequence[str]) -> str | None:
    """The known key that is most like a name, or that has its letters in their order, as in std."""
    letters = ".*".join(map(re.escape, name))
    return guess(name, known) or next((key for key in known if len(name) > 2 and re.match(letters, key)), None)


def _sentence(path: Path, detail: ErrorDetails, fields: Fields, others: Sequence[Fields]) -> str:
    if detail["type"] == _OWN:
        return detail["msg"]
    if detail["type"] == "value_error":
        error = detail["ctx"]["error"]
        return error.text if isinstance(error, TableError) else str(error)
    if detail["type"] in _UNKNOWN:
        beside = "; or ".join(", ".join(each) for each in (_beside(path[:-1], fields)[0], *others))
        meant = _meant(str(path[-1]), _known_keys(path, fields, others))
        hint = f' did you mean "{meant}"?' if meant else ""
        return f"unknown key;{hint} known keys: {beside}; rename or remove it"
    field = _beside(path, fields)[1]
    if type(path[-1]) is int:
        field = entry_of(field)
    return sentence(detail, field)


def entry_of(field: FieldInfo) -> FieldInfo:
    """The field of an entry of a list, with the words of the list; of what is none the field itself."""
    inner: list[Any] = [field.annotation]
    for kind in inner:
        if get_origin(kind) is tuple:
            entry = FieldInfo.from_annotation(get_args(kind)[0])
            entry.description, entry.examples = field.description, field.examples
            return entry
        inner += get_args(kind)
    return field


def _beside(path: Path, fields: Fields) -> tuple[Fields, FieldInfo]:
    """The fields of the deepest table on a path, and the deepest field on it."""
    field = FieldInfo()
    for name in path:
        if name in fields:
            field = fields[str(name)]
            fields = _nested(field.annotation)
    return fields, field


def _nested(annotation: object) -> Fields:
    """The fields of the table inside an annotation such as `tuple[Expectation, ...] | None`."""
    return fields_of(annotation) or next(filter(None, map(_nested, get_args(annotation))), {})
