"""What a field accepts, and what is wrong with parameters: sentences read off types and ranges, not pydantic's."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from fractions import Fraction
from functools import wraps
from itertools import chain
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, cast, dataclass_transform, get_args, get_origin

from pydantic import Field, ValidationError
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo

from fpsolve.arrays import shown
from fpsolve.model.parameters import STRICT, meaning_of, without_unit

Kind = TypeVar("Kind")
_BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
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

    def __reduce__(self) -> tuple[Any, ...]:
        return TableError, (self.text, *self.path)


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


def _sentence(detail: Mapping[str, Any], fields: Mapping[str, Any]) -> str:
    if detail["type"] == "value_error":
        return str(detail["ctx"]["error"])
    place = detail["loc"][0]
    name = dict(enumerate(fields)).get(place, place)
    if name not in fields:
        what = f"argument {name + 1}" if isinstance(name, int) else name
        return f"{what}: unknown; the parameters are {', '.join(fields)}"
    meaning = meaning_of(fields[name])
    must = f"must be {accepted(fields[name])}" + (f" ({meaning})" if meaning else "")
    found = "missing" if detail["type"] == "missing" else f"got {shown(detail['input'])}"
    return f"{name}: {found}; {must}{without_unit(detail['input'])}"


def accepted(field: FieldInfo) -> str:
    """The range of a key, read off its field: "a finite number > 0 and <= 1"."""
    texts = choices(field.annotation)
    if texts:
        return "one of " + ", ".join(f'"{text}"' for text in texts)
    bounds = (
        f"{sign} {_number(getattr(constraint, name))}"
        for constraint in field.metadata
        for name, sign in _BOUNDS.items()
        if hasattr(constraint, name)
    )
    return f"{_with_article(_not_empty(field.metadata) + _noun(field.annotation))} {' and '.join(bounds)}".rstrip()


def _not_empty(metadata: Iterable[Any]) -> str:
    return "non-empty " if any(hasattr(constraint, "min_length") for constraint in metadata) else ""


def _number(bound: float) -> str:
    """5/3, and the float below it, as 5/3, not as 1.6666666666666667; 1e15 as it stands here."""
    fraction = Fraction(bound).limit_denominator(99)
    is_simple = fraction.denominator > 1 and math.isclose(fraction, bound, rel_tol=1e-15)
    return str(fraction) if is_simple or isinstance(bound, int) else re.sub(r"e\+?(-?)0*", r"e\1", f"{bound:g}")


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


def choices(annotation: Any) -> list[str]:
    """The texts that an annotation takes, if these are all."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    return [member.value for member in getattr(annotation, "__members__", {}).values()]


def fields_of(annotation: Any) -> Mapping[str, FieldInfo]:
    """The fields of a model, or of a kind of system or noise, as in a table of a case file; of others nothing."""
    return {**getattr(annotation, "__pydantic_fields__", {}), **getattr(annotation, "stated", {})}


def table_of(value: Any) -> Mapping[str, Any]:
    """A value of a case file that is a table; an empty one where it is none."""
    return value if isinstance(value, dict) else {}


def written_path(path: Iterable[str | int]) -> str:
    """("expect", 0, "p") as expect[0].p."""
    text = ""
    for part in path:
        key = str(part) if re.fullmatch(r"[\w-]+", str(part)) else json.dumps(part, ensure_ascii=False)
        text += f"[{part}]" if isinstance(part, int) else f".{key}" if text else key
    return text


def _with_article(noun: str) -> str:
    return noun if noun.startswith(('"', "one of")) else f"a {noun}"


def _noun(annotation: Any, plural: str = "") -> str:
    """An annotation in words: tuple[float, ...] as "list of finite numbers"."""
    if fields := fields_of(annotation):
        return f"table{plural} with the keys {', '.join(fields)}"
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        inner = chain.from_iterable(getattr(extra, "metadata", ()) for extra in arguments[1:])
        return _not_empty(inner) + _noun(arguments[0], plural)
    if origin in (Union, UnionType):
        first, *others = (_noun(argument, plural) for argument in arguments if argument is not NoneType)
        return " or ".join([first, *(others if plural else map(_with_article, others))])
    if texts := choices(annotation):
        names = ", ".join(f'"{text}"' for text in texts)
        return f"{'some' if plural else 'one'} of {names}" if len(texts) > 1 else names
    if origin is tuple:
        return f"list{plural} of {_noun(arguments[0], 's')}"
    if origin is dict:
        return f"table{plural} of {_noun(arguments[1], 's')}"
    return _NOUNS.get(annotation, "value") + plural
