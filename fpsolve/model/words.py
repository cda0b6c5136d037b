"""What a field accepts, in words read off its type and its range."""

from __future__ import annotations

import enum
import math
import re
from collections.abc import Iterable, Mapping
from fractions import Fraction
from itertools import chain
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

_BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_NOUNS: dict[Any, str] = {float: "finite number", int: "whole number", str: "string"}


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
    return f"a {_not_empty(field.metadata)}{_noun(field.annotation)} {' and '.join(bounds)}".rstrip()


def _not_empty(metadata: Iterable[Any]) -> str:
    return "non-empty " if any(hasattr(constraint, "min_length") for constraint in metadata) else ""


def _number(bound: float) -> str:
    """5/3, and the float below it, as 5/3, not as 1.6666666666666667; 1e15 as it stands here."""
    fraction = Fraction(bound).limit_denominator(99)
    is_simple = fraction.denominator > 1 and math.isclose(fraction, bound, rel_tol=1e-15)
    return str(fraction) if is_simple or isinstance(bound, int) else re.sub(r"e\+?(-?)0*", r"e\1", f"{bound:g}")


def choices(annotation: Any) -> list[str]:
    """The texts that an annotation takes, if these are all."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    is_enum = isinstance(annotation, type) and issubclass(annotation, enum.Enum)
    return [member.value for member in annotation] if is_enum else []


def fields_of(annotation: Any) -> Mapping[str, FieldInfo]:
    """The fields of a model, or of a kind of system or noise, as in a table of a case file; of others nothing."""
    return {**getattr(annotation, "__pydantic_fields__", {}), **getattr(annotation, "stated", {})}


def _noun(annotation: Any, plural: str = "") -> str:
    """An annotation in words: tuple[float, ...] as "list of finite numbers"."""
    if fields := fields_of(annotation):
        return f"table{plural} with the keys {', '.join(fields)}"
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        inner = chain.from_iterable(getattr(extra, "metadata", ()) for extra in arguments[1:])
        return _not_empty(inner) + _noun(arguments[0], plural)
    if origin in (Union, UnionType):
        return " or a ".join(_noun(argument, plural) for argument in arguments if argument is not NoneType)
    if origin is tuple:
        return f"list{plural} of {_noun(arguments[0], 's')}"
    if origin is dict:
        return f"table{plural} of {_noun(arguments[1], 's')}"
    return _NOUNS.get(annotation, "value") + plural
