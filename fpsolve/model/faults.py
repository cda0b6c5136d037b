"""What a field accepts, and what is wrong with a value: sentences read off types and ranges, not pydantic's."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, is_dataclass
from difflib import get_close_matches
from enum import Enum
from functools import wraps
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, cast, dataclass_transform, get_args, get_origin

from pydantic import BaseModel, Field, ValidationError
from pydantic.dataclasses import dataclass, is_pydantic_dataclass
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from fpsolve.arrays import bound_in_words, shortened
from fpsolve.model.parameters import STRICT, Parametrised, example_of, meaning_of, without_unit

Kind = TypeVar("Kind")
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_NOUNS: dict[Any, str] = {float: "finite number", int: "whole number", str: "string", bool: "boolean"}


class ParameterError(ValidationError):
    """Parameters out of their range, of a wrong type, missing or unknown: pydantic's error with a text of our own."""

    text: str

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__

    def __reduce__(self) -> tuple[Any, ...]:
        return ValueError, (self.text,)  # what pydantic keeps of the arguments does not pickle


class TableError(ValueError):
    """What is wrong with the table of a system or a noise, and where in it.

    Attributes:
        text: what is wrong.
        path: keys and places, such as ("drift", 1).
    """

    def __init__(self, text: str, *path: str | int) -> None:
        place = written_path(path)
        super().__init__(f"{place}: {text}" if place else text)
        self.text, self.path = text, path


@dataclass_transform(frozen_default=True, kw_only_default=False, field_specifiers=(Field,))
def strict_dataclass(kind: type[Kind]) -> type[Kind]:
    """A frozen pydantic dataclass of `STRICT` parameters that raises `ParameterError`."""
    changed: Any = dataclass(frozen=True, config=STRICT)(kind)
    made = changed.__init__

    @wraps(made)
    def __init__(self: Any, /, *arguments: Any, **named: Any) -> None:
        try:
            made(self, *arguments, **named)
            return
        except ValidationError as error:
            told = _in_words(error, changed)
        raise told  # out here, where it has no context: that does not pickle, and Dask pickles it

    changed.__init__ = __init__
    return cast("type[Kind]", changed)


def _in_words(error: ValidationError, kind: Any) -> ParameterError:
    """Faults that pydantic found, in our words."""
    details: list[Any] = error.errors(include_url=False)
    told: Any = ParameterError.from_exception_data(error.title, details)
    told.text = "\n".join(f"{kind.__name__}: {_sentence(each, kind.__pydantic_fields__)}" for each in details)
    return told


def _sentence(detail: ErrorDetails, fields: Mapping[str, FieldInfo]) -> str:
    if detail["type"] == "value_error":
        return str(detail["ctx"]["error"])
    place = detail["loc"][0]
    name = list(fields)[place] if isinstance(place, int) and place < len(fields) else place
    if name not in fields:
        what = f"argument {name + 1}" if isinstance(name, int) else name
        return f"{what}: unknown; the parameters are {', '.join(fields)}"
    return f"{name}: {sentence(detail, fields[str(name)])}"


def sentence(detail: ErrorDetails, field: FieldInfo) -> str:
    """What is wrong with a value: "got 0; must be a whole number >= 2 (how many); write, for example, num = 3".

    Args:
        detail: what pydantic says of it.
        field: what it must be.
    """
    kind, value, meaning, example = detail["type"], detail["input"], meaning_of(field), example_of(field)
    if kind.endswith("too_long"):
        return f"has the length {len(value)}; must be at most {detail['ctx']['max_length']}; shorten it"
    must = "must not be empty" if kind.endswith("too_short") else f"must be {accepted(field)}"
    must += f" ({meaning})" if meaning else ""
    if kind == "missing":
        return f"missing; {must}" + (f"; add it, for example {example}" if example else "")
    hint = nearest(value, choices(field.annotation)) + (f" write, for example, {example}" if example else "")
    remedy = without_unit(value) or (f";{hint}" if hint else "")
    foreign = "" if isinstance(value, int | float | str | list | tuple | dict) else f" ({type(value).__name__})"
    return f"got {shown(value)}{foreign}; {must}{remedy}"


def shown(value: object) -> str:
    """A value as TOML writes it, cut to a readable length."""
    try:
        return shortened(_toml(value))
    except (ValueError, RecursionError):
        return "a value too long to show"


def _toml(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if not isinstance(value, bool | str):
        return " ".join(str(value).split())
    return json.dumps(value, ensure_ascii=False)


def nearest(name: object, known: Iterable[str]) -> str:
    """' did you mean "omega"?' or nothing."""
    found = guess(name, known) if type(name) is str else None
    return f' did you mean "{found}"?' if found else ""


def guess(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like another; a key without its section finds the key with it."""
    keys = {key.lower(): key for key in known}
    name = name.lower()[:60]
    found = [key for key in keys if key.endswith(f".{name}")] or get_close_matches(name, keys, n=1)
    return keys[found[0]] if found else None


def accepted(field: FieldInfo) -> str:
    """The range of a key, read off its field: "a finite number > 0 and <= 1"."""
    bounds = " and ".join(f"{_SIGNS[name]} {bound_in_words(bound)}" for name, bound in bounds_in(field).items())
    return f"{_noun(field.annotation)} {bounds}".rstrip()


def bounds_in(field: FieldInfo) -> dict[str, float]:
    """The ends of the range of a number, by "ge", "gt", "le" or "lt"."""
    rules = dict[str, float]()
    for each in field.metadata:
        rules |= asdict(each) if is_dataclass(each) and not isinstance(each, type) else {}
    return {name: rules[name] for name in _SIGNS if name in rules}


def choices(annotation: object) -> list[str]:
    """The texts in an annotation such as `DrawnName | MomentAt`."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return [member.value for member in annotation]
    return [text for each in get_args(annotation) for text in choices(each)]


def fields_of(annotation: object) -> Mapping[str, FieldInfo]:
    """The fields of a model, or of a kind of system or noise, as in a table of a case file; of others nothing."""
    if not isinstance(annotation, type):
        return {}
    if issubclass(annotation, Parametrised):
        return {**annotation.__pydantic_fields__, **annotation.stated, **annotation.naming}
    if issubclass(annotation, BaseModel) or is_pydantic_dataclass(annotation):
        return annotation.__pydantic_fields__
    return {}


def table_of(value: object) -> Mapping[str, object]:
    """A value of a case file that is a table; an empty one where it is none."""
    return value if isinstance(value, dict) else {}


def written_path(path: Iterable[str | int]) -> str:
    """("expect", 0, "p") as expect[0].p."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if re.fullmatch(r"[\w-]+", part) else f".{_toml(part)}"
    return text.removeprefix(".")


def quoted(names: Iterable[str]) -> str:
    """Names as TOML lists them."""
    return ", ".join(map(_toml, names))


def _noun(annotation: Any, plural: str = "") -> str:
    """An annotation in words: tuple[float, ...] as "a list of finite numbers"."""
    article = "" if plural else "a "
    if fields := fields_of(annotation):
        return f"{article}table{plural} with the keys {', '.join(fields)}"
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _noun(arguments[0], plural)
    if origin in (Union, UnionType):
        return " or ".join(_noun(argument, plural) for argument in arguments if argument is not NoneType)
    if origin is tuple:
        return f"{article}list{plural} of {_noun(arguments[0], 's')}"
    if origin is dict:
        return f"{article}table{plural} of {_noun(arguments[1], 's')}"
    if texts := choices(annotation):
        return f"{'some' if plural else 'one'} of {quoted(texts)}" if len(texts) > 1 else quoted(texts)
    return f"{article}{_NOUNS.get(annotation, 'value')}{plural}"
