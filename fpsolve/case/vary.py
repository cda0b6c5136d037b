"""The parameter sets of a case, and how they are named."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Literal

from fpsolve.case.sections import MOST_NAMED, FigureSection, Value, digits
from fpsolve.data import written
from fpsolve.model.quantity import Quantity

Column = tuple[Value, ...]
"""The values of a varied key: numbers, or texts."""
Columns = dict[str, Column]


@dataclass(frozen=True, eq=False)
class Vary:
    """The parameter sets of a case: all combinations of some values, or values side by side.

    Attributes:
        columns: the values of each varied key; of a product its distinct values, else one for each set.
        mode: "product" for all combinations, the last key varying fastest, or "zip" for values side by side.
        file: where they were read, for messages; empty for those of the case itself.
        lines: where each set stands in this file.
    """

    columns: Mapping[str, Column] = field(default_factory=dict)
    mode: Literal["product", "zip"] = "product"
    file: str = ""
    lines: tuple[int, ...] = ()

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
        return tuple(dict.fromkeys(self.columns[key]))

    def is_text(self, key: str) -> bool:
        """Whether the values of a varied key are texts."""
        return type(self.columns[key][0]) is str

    @cached_property
    def sets(self) -> tuple[dict[str, Value], ...]:
        """The varied values of each set."""
        columns = self.columns.values()
        rows = zip(*columns, strict=True) if columns and self.mode == "zip" else product(*columns)
        return tuple(dict(zip(self.columns, row, strict=True)) for row in rows)

    def line_of(self, number: int) -> str:
        """The line of its file on which a parameter set stands, as "sets.csv:12: "; empty where there is no file."""
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


def repeats(rows: Iterable[Sequence[Value]]) -> list[tuple[int, int]]:
    """The places of rows that stand there already, to 12 digits, each with the first place."""
    first = dict[tuple[str, ...], int]()
    places = (first.setdefault(tuple(map(digits, row)), place) for place, row in enumerate(rows))
    return [(place, each) for place, each in enumerate(places) if each != place]
