"""The numbers of a case as the decimals that it states, which may have more digits than floats."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from decimal import Decimal
from typing import Any

from fpsolve.case.case import Case
from fpsolve.proofs.statement import DECIMAL

Literals = Mapping[float, str]
"""Decimals by their floats."""


def literals_of(case: Case, keys: Iterable[str]) -> Mapping[str, Literals]:
    """The decimals that the file and the command line state for dotted keys; those of [vary] for a varied one."""
    found = list(_leaves(tomllib.loads(case.text, parse_float=Decimal)))
    for override in case.overrides:
        with suppress(ValueError):  # a bare word
            new = list(_leaves(tomllib.loads(override, parse_float=Decimal)))
            ((replaced, _),) = _leaves(tomllib.loads(f"{override.partition('=')[0]} = 0"))
            found = [each for each in found if not _is_in(each[0], replaced)] + new
    places = {key: f"vary.{key}" if key in case.vary.keys else key for key in keys}
    return {
        key: {float(number) + 0.0: f"{number}" for path, number in found if _is_in(path, place)}
        for key, place in places.items()
    }


def decimal_of(value: float, literals: Literals) -> str:
    """A number as the decimal that is stated, or else, as for those of a range, the shortest that is read as it."""
    shortest = repr(float(value))
    text = literals.get(value, shortest) if value else shortest
    return text if DECIMAL.fullmatch(text) and Decimal(text) != Decimal(shortest) else shortest


def _leaves(data: Any, path: str = "") -> Iterator[tuple[str, Decimal | int]]:
    """The finite numbers in tables and lists, each after the dotted keys of the tables in which it stands."""
    if isinstance(data, dict):
        for name, inner in data.items():
            yield from _leaves(inner, f"{path}.{name}" if path else name)
    elif isinstance(data, list):
        for inner in data:
            yield from _leaves(inner, path)
    elif isinstance(data, Decimal | int) and not isinstance(data, bool) and Decimal(data).is_finite():
        yield path, data


def _is_in(path: str, place: str) -> bool:
    return f"{path}.".startswith(f"{place}.")
