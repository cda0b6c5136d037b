"""From pydantic's errors to sentences that name the value, the accepted range and the remedy."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from fpsolve.model.faults import accepted, choices, fields_of
from fpsolve.model.parameters import example_of, meaning_of

_OWN, _RANGE = "own sentence", "range"
LIST, TABLE = "<list>", "<table>"
"""Tags of a discriminated union: parts of pydantic's error locations that are no keys."""
DEPENDENT = "cannot be judged, as the kinds of the system and the noise are not known; mend these"
"""Of a section; which kinds are wrong is another fault."""
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_KINDS = {bool: "a boolean", str: "a string", list: "a list", dict: "a table", int: "a number", float: "a number"}

Path = tuple[str | int, ...]
Refusal = tuple[Path, Any, str]
"""Where, which value, and why; an empty sentence stands for "not what this key accepts"."""


def refuse(refusals: Iterable[Refusal]) -> None:
    """Raise all refusals of a validator at once; without any, do nothing."""
    details = [
        InitErrorDetails(type=PydanticCustomError(_OWN if text else _RANGE, text), loc=path, input=value)
        for path, value, text in refusals
    ]
    if details:
        raise ValidationError.from_exception_data("case", details)


def repeated_or_unknown(
    names: Sequence[Any], known: Sequence[str], unknown: Callable[[str, str], str]
) -> Iterator[Refusal]:
    """Each name of a list that is not known, or stands there already.

    Args:
        unknown: makes the sentence on an unknown name, from how that is shown and from the guess what was meant.
    """
    for i, name in enumerate(names):
        if name not in known:
            guess = nearest(name, known) if isinstance(name, str) else ""
            yield (i,), name, unknown(shown_with_kind(name), guess)
        elif name in names[:i]:
            yield (i,), name, f"got {shown(name)} twice; names must be distinct; remove one"


def nearest(name: str, known: Iterable[str]) -> str:
    """' did you mean "omega"?' or nothing."""
    guess = _guess(name, known)
    return f' did you mean "{guess}"?' if guess else ""


def _guess(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like another; a key without its section finds the key with it."""
    keys = {key.lower(): key for key in known}
    name = name.lower()
    found = [key for key in keys if key.endswith(f".{name}")] or get_close_matches(name, keys, n=1)
    return keys[found[0]] if found else None


def shown(value: Any) -> str:
    """A value as TOML writes it, cut to a readable length."""
    try:
        text = _toml(value)
    except (ValueError, RecursionError):
        text = "a value too long to show"
    return shortened(text)


def shown_with_kind(value: Any) -> str:
    """The same with what it is: "3 (a number)"."""
    return f"{shown(value)} ({_KINDS.get(type(value), 'a date or time')})"


def shortened(text: str) -> str:
    """A text cut to a readable length."""
    return text if len(text) <= 60 else f"{text[:57]}..."


def _toml(value: Any) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    return str(value)


def own_faults(error: ValidationError) -> Iterator[ErrorDetails]:
    """What pydantic found, without calling a list too short only because its entries are wrong."""
    for detail in error.errors(include_url=False):
        if detail["type"] != "too_short" or not detail["input"]:
            yield detail


def too_long(detail: Mapping[str, Any]) -> str:
    """What to say of a list with too many entries; nothing of other faults."""
    if detail["type"] != "too_long":
        return ""
    return f"lists {len(detail['input'])} numbers; must be at most {detail['ctx']['max_length']}; list fewer"


def explain(
    error: ValidationError, fields: Mapping[str, FieldInfo], varied: Mapping[str, FieldInfo] = MappingProxyType({})
) -> Iterator[tuple[Path, str, str]]:
    """Each fault that pydantic found: its path in the file, its key for the eye, and our sentence.

    What is missing where a key is misspelt is not another fault.

    Args:
        error: with paths from a model.
        fields: of that model.
        varied: the ranges of the values of [vary].
    """
    faults = [(tuple(part for part in each["loc"] if part not in (LIST, TABLE)), each) for each in own_faults(error)]
    if "system" not in fields:  # the file calls it otherwise
        faults = [(("oscillator", *path[1:]) if path[:1] == ("system",) else path, each) for path, each in faults]
    misspelt = {_meant(path, fields) for path, detail in faults if detail["type"] in _UNKNOWN}
    for path, detail in faults:
        if (detail["type"] != "missing" or path not in misspelt) and detail["msg"] != DEPENDENT:
            yield path, _key(path), _sentence(path, dict(detail), fields, varied)


def _meant(path: Path, fields: Mapping[str, FieldInfo]) -> Path | None:
    """The path of the known key that an unknown one is most like."""
    guess = _guess(str(path[-1]), _known_keys(path, fields))
    return (*path[:-1], *guess.split(".")) if guess else None


def _known_keys(path: Path, fields: Mapping[str, FieldInfo]) -> list[str]:
    """The keys beside a path, and those of the tables among them."""
    beside = _beside(path[:-1], fields)[0]
    return [*beside, *(f"{name}.{key}" for name, field in beside.items() for key in fields_of(field.annotation))]


def _key(path: Path) -> str:
    """("expect", 0, "p") as expect[0].p."""
    text = ""
    for part in path:
        quoted = str(part) if re.fullmatch(r"[\w-]+", str(part)) else json.dumps(part, ensure_ascii=False)
        text += f"[{part}]" if isinstance(part, int) else f".{quoted}" if text else quoted
    return text


def _sentence(
    path: Path, detail: Mapping[str, Any], fields: Mapping[str, FieldInfo], varied: Mapping[str, FieldInfo]
) -> str:
    if detail["type"] == _OWN:
        return str(detail["msg"])
    if detail["type"] == "value_error":
        return str(detail["ctx"]["error"])
    if detail["type"] == "too_long":
        return too_long(detail)
    if detail["type"] in _UNKNOWN:
        known = _known_keys(path, fields)
        beside = ", ".join(key for key in known if "." not in key)
        return f"unknown key;{nearest(str(path[-1]), known)} known keys: {beside}; rename or remove it"
    is_varied = path[0] == "vary" and len(path) > 1
    field = varied.get(str(path[1]), FieldInfo()) if is_varied else _beside(path, fields)[1]
    must, example = f"must be {accepted(field)} ({meaning_of(field)})", example_of(field)
    if is_varied:
        example = example_of(fields["vary"])
        must = must.replace("be", "be a non-empty list, each entry", 1) if len(path) == 2 else must
    if detail["type"] == "missing":
        return f"missing; {must}; add it, for example {example}"
    value = detail["input"]
    guess = nearest(value, choices(field.annotation)) if isinstance(value, str) else ""
    return f"got {shown(value)}{_kind(value, detail['type'])}; {must};{guess} write, for example, {example}"


def _kind(value: Any, error_type: str) -> str:
    is_range = error_type == _RANGE and type(value) in (int, float)
    if is_range or not error_type.endswith((_RANGE, "_type", "_not_found")):
        return ""
    return f" ({_KINDS.get(type(value), 'a date or time')})"


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
