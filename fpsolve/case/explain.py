"""From pydantic's errors to sentences that name the value, the accepted range and the remedy."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, get_args

from pydantic import Discriminator, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from fpsolve.arrays import shortened
from fpsolve.messages import is_control
from fpsolve.model.faults import accepted, choices, entry_of, fields_of, written_path
from fpsolve.model.parameters import Section, example_of, meaning_of, parameter, without_unit

_OWN, _RANGE = "own sentence", "range"
LIST = "<list>"
"""Tag of a list, in a union that is told apart by what TOML has there."""
TABLE = "<table>"
"""Tag of a table."""
WORD = "<word>"
"""Tag of a text."""
NUMBER = "<number>"
"""Tag of a number."""
TAGS = (LIST, TABLE, WORD, NUMBER)
"""Parts of pydantic's error locations that are no keys."""
_TAGS: Mapping[type, str] = {list: LIST, tuple: LIST, dict: TABLE, str: WORD, int: NUMBER, float: NUMBER}
BY_KIND = Discriminator(lambda value: _TAGS.get(type(value), TABLE if isinstance(value, Section) else None))
"""How a union is told apart: by what TOML has there."""
DEPENDENT = "cannot be judged, as the kinds of the system and the noise are not known; correct these"
"""Of a section; which kinds are wrong is another fault."""
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_KINDS = {bool: "a boolean", str: "a string", list: "a list", dict: "a table", int: "a number", float: "a number"}

UNBOUNDED = parameter("a parameter", "")
UNBOUNDED.annotation = float
"""The range of a parameter of which no more is known than that it is one."""

Path = tuple[str | int, ...]
Refusal = tuple[Path, Any, str]
"""Where, which value, and why; an empty sentence stands for "not what this key accepts"."""


def refuse(refusals: Iterable[Refusal], others: Iterable[InitErrorDetails] = ()) -> None:
    """Raise all refusals of a validator, and other errors, at once; without any, do nothing."""
    details = [
        InitErrorDetails(type=PydanticCustomError(_OWN if text else _RANGE, text), loc=path, input=value)
        for path, value, text in refusals
    ]
    if details := [*others, *details]:
        raise ValidationError.from_exception_data("case", details)


def details_of(error: ValidationError, *place: str) -> list[InitErrorDetails]:
    """The faults of an error, at a place around its own, to be raised again."""
    return [
        InitErrorDetails(
            type=PydanticCustomError(each["type"], each["msg"]) if each["type"] in (_OWN, _RANGE) else each["type"],
            loc=(*place, *each["loc"]),
            input=each["input"],
            ctx=each.get("ctx", {}),
        )
        for each in error.errors(include_url=False)
    ]


def is_number(value: Any) -> bool:
    """Whether a value of TOML is a finite number."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def is_list(value: Any) -> bool:
    """Whether a value is a list of TOML, or a tuple of Python."""
    return isinstance(value, list | tuple)


def quoted(names: Iterable[str]) -> str:
    """Names as TOML lists them."""
    return ", ".join(f'"{name}"' for name in names)


def nearest(name: Any, known: Iterable[str]) -> str:
    """' did you mean "omega"?' or nothing."""
    guess = _guess(name, known) if type(name) is str else None
    return f' did you mean "{guess}"?' if guess else ""


def _guess(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like another; a key without its section finds the key with it."""
    keys = {key.lower(): key for key in known}
    name = name.lower()[:60]
    found = [key for key in keys if key.endswith(f".{name}")] or get_close_matches(name, keys, n=1)
    return keys[found[0]] if found else None


def shown(value: Any) -> str:
    """A value as TOML writes it, cut to a readable length."""
    try:
        return shortened(_toml(value))
    except (ValueError, RecursionError):
        return "a value too long to show"


def shown_with_kind(value: Any, *, but: type | None = None) -> str:
    """A value as TOML writes it with what it is, but for one kind: "3 (a number)"."""
    return shown(value) if type(value) is but else f"{shown(value)} ({_KINDS.get(type(value), 'a date or time')})"


def _toml(value: Any) -> str:
    if is_list(value):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if type(value) not in (bool, str):
        return str(value)
    return "".join(
        json.dumps(each)[1:-1] if is_control(each) else each for each in json.dumps(value, ensure_ascii=False)
    )


def faults_in(error: ValidationError) -> Iterator[ErrorDetails]:
    """What pydantic found, without calling a list too short only because its entries are wrong."""
    return (
        each
        for each in error.errors(include_url=False)
        if each["type"] != "too_short" or len(each["input"]) < each["ctx"]["min_length"]
    )


def too_long(detail: Mapping[str, Any]) -> str:
    """What to say of a list with too many entries; nothing of other faults."""
    if detail["type"] != "too_long":
        return ""
    noun = "entries" if any(type(each) is str for each in detail["input"]) else "numbers"
    return f"lists {len(detail['input'])} {noun}; must be at most {detail['ctx']['max_length']}; list fewer"


def explain(
    error: ValidationError, fields: Mapping[str, FieldInfo], varied: Mapping[str, FieldInfo] = MappingProxyType({})
) -> Iterator[tuple[Path, str, str]]:
    """Each fault that pydantic found: its path in the file, its key for the eye, and our sentence.

    What is missing where a key is misspelt is not another fault.

    Args:
        error: with paths from a model.
        fields: of that model.
        varied: the ranges of the values of keys that are varied.
    """
    faults = [
        (
            tuple(
                part
                for part in (*each["loc"], *getattr(each.get("ctx", {}).get("error"), "path", ()))
                if part not in TAGS
            ),
            each,
        )
        for each in faults_in(error)
    ]
    misspelt = set[Path]()
    for path, detail in faults:
        if detail["type"] in _UNKNOWN and (guess := _guess(str(path[-1]), _known_keys(path, fields))):
            misspelt.add((*path[:-1], *guess.split(".")))
    for path, detail in faults:
        if (detail["type"] != "missing" or path not in misspelt) and detail["msg"] != DEPENDENT:
            yield path, written_path(path), _sentence(path, dict(detail), fields, varied)


def _known_keys(path: Path, fields: Mapping[str, FieldInfo]) -> list[str]:
    """The keys beside a path, and those of the tables among them."""
    beside = _beside(path[:-1], fields)[0]
    return [*beside, *(f"{name}.{key}" for name, field in beside.items() for key in fields_of(field.annotation))]


def _sentence(
    path: Path, detail: Mapping[str, Any], fields: Mapping[str, FieldInfo], varied: Mapping[str, FieldInfo]
) -> str:
    kind, value = detail["type"], detail["input"]
    if kind in (_OWN, "value_error"):
        error = detail.get("ctx", {}).get("error")
        return getattr(error, "text", str(error or detail["msg"]))
    if kind == "too_long":
        return too_long(detail)
    if kind in _UNKNOWN:
        known = _known_keys(path, fields)
        beside = ", ".join(key for key in known if "." not in key)
        return f"unknown key;{nearest(str(path[-1]), known)} known keys: {beside}; rename or remove it"
    is_varied = path[0] == "vary" and len(path) > 1
    field = varied.get(str(path[1]), UNBOUNDED) if is_varied else _beside(path, fields)[1]
    if type(path[-1]) is int and not is_varied:
        field = entry_of(field)
    must, example = f"must be {accepted(field)} ({meaning_of(field)})", example_of(field)
    if is_varied:
        example = example_of(fields["vary"])
        must = must.replace("be", "be a non-empty list, each entry", 1) if len(path) == 2 else must
    if kind == "missing":
        return f"missing; {must}; add it, for example {example}"
    is_number = kind == _RANGE and type(value) in (int, float)  # of the right type, and out of range
    has_kind = kind.endswith((_RANGE, "_type", "_not_found", "_tag_invalid", "_instance_of")) and not is_number
    has_kind |= kind == "literal_error" and type(value) is not str
    got = shown_with_kind(value) if has_kind else shown(value)
    guess = nearest(value, _texts(field.annotation))
    return f"got {got}; {must}{without_unit(value) or f';{guess} write, for example, {example}'}"


def _texts(annotation: Any) -> list[str]:
    """The texts in an annotation such as `DrawnName | MomentAt`."""
    return choices(annotation) or [text for each in get_args(annotation) for text in _texts(each)]


def _beside(path: Path, fields: Mapping[str, FieldInfo]) -> tuple[Mapping[str, FieldInfo], FieldInfo]:
    """The fields of the deepest table on a path, and the deepest field on it."""
    field = FieldInfo()
    for name in path:
        if name in fields:
            field = fields[str(name)]
            fields = _nested(field.annotation)
    return fields, field


def _nested(annotation: Any) -> Mapping[str, FieldInfo]:
    """The fields of the table inside an annotation such as `tuple[Expectation, ...] | None`."""
    return fields_of(annotation) or next(filter(None, map(_nested, get_args(annotation))), {})
