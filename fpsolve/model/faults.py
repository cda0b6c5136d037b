"""What is wrong with the parameters of a dataclass, in a sentence for each fault instead of pydantic's text."""

from __future__ import annotations

from collections.abc import Mapping
from functools import wraps
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import InitErrorDetails

from fpsolve.model.parameters import meaning_of
from fpsolve.model.words import accepted

Kind = TypeVar("Kind")


class ParameterError(ValidationError):
    """Parameters out of their range, of a wrong type, missing or unknown: pydantic's error with a text of our own."""

    text: str

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__

    def __reduce__(self) -> tuple[Any, ...]:
        return ValueError, (self.text,)  # what pydantic keeps of the arguments does not pickle


def told_in_words(kind: type[Kind]) -> type[Kind]:
    """A pydantic dataclass that raises `ParameterError`."""
    changed: Any = kind
    made = changed.__init__

    @wraps(made)
    def __init__(self: Any, *arguments: Any, **named: Any) -> None:
        try:
            made(self, *arguments, **named)
            return
        except ValidationError as error:
            told = _in_words(error, kind)
        raise told  # out here, where it has no context: that does not pickle, and Dask pickles it

    changed.__init__ = __init__
    return kind


def _in_words(error: ValidationError, kind: Any) -> ParameterError:
    """The same faults, with our text."""
    details = error.errors(include_url=False)
    faults = [
        InitErrorDetails(type=each["type"], loc=each["loc"], input=each["input"], ctx=each.get("ctx", {}))
        for each in details
    ]
    told = ParameterError.from_exception_data(error.title, faults)
    assert isinstance(told, ParameterError)
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
    return (
        f"{name}: missing; {must}" if detail["type"] == "missing" else f"{name}: got {_shown(detail['input'])}; {must}"
    )


def _shown(value: Any) -> str:
    """A value as Python writes it, in one line of a readable length."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # of a whole number with thousands of digits
        return "a number too long to show"
    return text if len(text) <= 60 else f"{text[:57]}..."
