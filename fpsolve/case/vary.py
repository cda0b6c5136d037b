"""The parameter sets of a case, and how they are named."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, product
from typing import Any, Literal, TypeGuard

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.case.sections import MOST_NAMED, SAME, FigureSection, Value
from fpsolve.data import written
from fpsolve.model.quantity import Quantity

WHOLLY_CHECKED = 1000
"""Sets of a case whose problems are all made and checked when it is loaded."""
SPREAD = 250
"""Sets of a case with more whose problems are, evenly spread, beside those at the ends of the keys."""
BLOCK = 4096
"""Sets that are read or made at a time."""
Column = FloatArray | tuple[str, ...]
"""The values of a varied key: numbers, or texts."""
Columns = dict[str, Column]


@dataclass(frozen=True, eq=False)
class Vary:
    """The parameter sets of a case: all combinations of some values, or values side by side.

    Attributes:
        columns: the values of each varied key; of a product its distinct values, else one for each set. Numbers become
            an array, 8 bytes each.
        mode: "product" for all combinations, the last key varying fastest, or "zip" for values side by side.
        file: where they were read, for messages; empty for those of the case itself.
        lines: where each set stands in this file, integers of shape (sets,).
        faults: what is wrong in other rows, with their lines.
    """

    columns: Mapping[str, Column] = field(default_factory=dict)
    mode: Literal["product", "zip"] = "product"
    file: str = ""
    lines: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=int))
    faults: tuple[tuple[int, str], ...] = ()

    def __post_init__(self) -> None:
        columns = {key: values if holds_texts(values) else np.asarray(values) for key, values in self.columns.items()}
        object.__setattr__(self, "columns", columns)

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys."""
        return tuple(self.columns)

    def __len__(self) -> int:
        """How many parameter sets there are; one where nothing is varied."""
        lengths = map(len, self.columns.values())
        return math.prod(lengths) if self.mode == "product" else next(lengths, 1)

    def __bool__(self) -> bool:
        """Whether anything is varied."""
        return bool(self.columns)

    def values(self, key: str) -> tuple[Value, ...]:
        """The distinct values of a key in the order in which they appear."""
        return tuple(dict.fromkeys(_plain(self.columns[key])))

    def is_text(self, key: str) -> bool:
        """Whether the values of a varied key are texts."""
        return holds_texts(self.columns[key])

    def sets(self, start: int = 0, stop: int | None = None) -> Iterator[dict[str, Value]]:
        """The varied values of each set from one place to another, any place reached at once."""
        places = range(len(self))[start:stop]
        for begin in range(places.start, places.stop, BLOCK):
            yield from self.sets_at(np.arange(begin, min(begin + BLOCK, places.stop)))

    def sets_at(self, places: NDArray[np.int64]) -> Iterator[dict[str, Value]]:
        """The varied values of the sets at some places."""
        if not self.columns:
            yield from ({} for _ in places)
            return
        sizes = [len(values) for values in self.columns.values()]
        at = [places] * len(sizes) if self.mode == "zip" else np.unravel_index(places, sizes)
        columns = [_plain(picked(values, each)) for values, each in zip(self.columns.values(), at, strict=True)]
        for row in zip(*columns, strict=True):
            yield dict(zip(self.columns, row, strict=True))

    @property
    def checked(self) -> NDArray[np.int64]:
        """The places of the sets whose problems are made and checked: all of them, or of many some.

        These are the sets in which a key has its smallest or its largest value, of a product their combinations, with
        each combination of texts, and others that are evenly spread.
        """
        count = len(self)
        if count <= WHOLLY_CHECKED:
            return np.arange(count)
        numbers = [values for values in self.columns.values() if not holds_texts(values)]
        if self.mode == "product":
            sizes = [len(values) for values in self.columns.values()]
            ends = [
                range(len(values)) if holds_texts(values) else {int(np.argmin(values)), int(np.argmax(values))}
                for values in self.columns.values()
            ]
            extreme = [int(np.ravel_multi_index(each, sizes)) for each in islice(product(*ends), WHOLLY_CHECKED)]
        else:
            first = first_places([values for values in self.columns.values() if holds_texts(values)], count)
            alike = [np.flatnonzero(first == place) for place in np.unique(first)]
            extreme = [at[end(values[at])] for at in alike for values in numbers for end in (np.argmin, np.argmax)]
        spread = np.linspace(0, count - 1, SPREAD).astype(int)
        return np.union1d(np.array(extreme, dtype=int), spread)

    def among(self, keys: Iterable[str]) -> Iterator[dict[str, Value]]:
        """The distinct sets of some of the keys."""
        chosen = {key: _plain(values) for key, values in self.columns.items() if key in set(keys)}
        rows = zip(*chosen.values(), strict=True) if chosen and self.mode == "zip" else product(*chosen.values())
        return (dict(zip(chosen, row, strict=True)) for row in dict.fromkeys(rows))

    def membership(self) -> Callable[[Mapping[str, Value]], bool]:
        """Tells whether values of all keys are those of a set."""
        if self.mode == "product":
            known = {key: set(_plain(values)) for key, values in self.columns.items()}
            return lambda varied: all(varied[key] in values for key, values in known.items())
        sets = set(zip(*map(_plain, self.columns.values()), strict=True)) if self.columns else {()}
        return lambda varied: tuple(varied[key] for key in self.columns) in sets

    def line_of(self, number: int) -> str:
        """The line of its file on which the set of a curve stands, as "sets.csv:12: "; empty where there is no file."""
        return f"{self.file}:{self.lines[number - 1]}: " if self.file else ""

    def crossing(self, key: str) -> str | None:
        """The second key of a map over a key: of a product over two keys of numbers the other one."""
        several = [each for each in self.keys if len(self.values(each)) > 1]
        is_plane = self.mode == "product" and len(several) == 2 and key in several
        return None if not is_plane or any(map(self.is_text, several)) else next(k for k in several if k != key)


def map_key(figure: FigureSection, vary: Vary) -> str | None:
    """The second key of the map that is drawn; None where curves are."""
    key = vary.crossing(figure.x)
    is_map = key is not None and (len(vary.values(key)) > MOST_NAMED if figure.map is None else figure.map)
    return key if is_map else None


def assignments(varied: Mapping[str, Value], style: str = "") -> str:
    """Keys with their values, these in a format: "noise.D0 = 0.1, noise.r0 = 0.9"."""
    return ", ".join(f"{key} = {written(value, style)}" for key, value in varied.items())


def legend(varied: Mapping[str, Value], about: Callable[[str], Quantity]) -> str:
    r"""Keys with their values for a figure, by what the keys are: "$D_0$ = 0.1/time, treatment = exact"."""
    return ", ".join(about(key).stated(value) for key, value in varied.items())


def groups(values: Column) -> NDArray[np.int64]:
    """For each value the place of the first one that is the same."""
    if holds_texts(values):
        seen = dict[Any, int]()
        return np.array([seen.setdefault(each, place) for place, each in enumerate(values)], dtype=int)
    numbers = np.asarray(values)
    order = np.argsort(numbers, kind="stable")
    ranked = numbers[order]
    with np.errstate(over="ignore"):
        is_other = np.diff(ranked) > SAME * np.maximum(abs(ranked[1:]), abs(ranked[:-1]))
    starts = np.flatnonzero(np.concatenate([[True], is_other])[: numbers.size])
    first = np.empty(numbers.size, dtype=int)
    first[order] = np.repeat(np.minimum.reduceat(order, starts), np.diff([*starts, numbers.size]))
    return first


def first_places(columns: Iterable[Column], count: int) -> NDArray[np.int64]:
    """For each of so many sets side by side the place of the first one that is the same."""
    rows = np.array([np.zeros(count, dtype=int), *map(groups, columns)])
    order = np.lexsort(rows)
    is_other = np.any(np.diff(rows[:, order]) != 0, axis=0)
    starts = np.flatnonzero(np.concatenate([[True], is_other])[:count])
    first = np.empty(count, dtype=int)
    first[order] = np.repeat(order[starts], np.diff([*starts, count]))
    return first


def repeats(columns: Columns, count: int) -> list[tuple[int, int]]:
    """The places of sets side by side that stand there already, each with the first place."""
    first = first_places(columns.values(), count)
    again = np.flatnonzero(first != np.arange(count))
    return list(zip(again.tolist(), first[again].tolist(), strict=True))


def holds_texts(values: Column) -> TypeGuard[tuple[str, ...]]:
    """Whether the values of a key are texts."""
    return isinstance(values, tuple) and type(next(iter(values), 0.0)) is str


def _plain(values: Column) -> Sequence[Value]:
    """The values of a key as Python has them."""
    return values if isinstance(values, tuple) else values.tolist()


def picked(values: Column, places: NDArray[np.int64]) -> Column:
    """The values of a key at some places."""
    return tuple(values[i] for i in places.tolist()) if isinstance(values, tuple) else values[places]
