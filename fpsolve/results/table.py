"""The numbers of a case as one table: a column for each quantity, over the curves, or over these and p.

A row is what one curve adds: a number for each column by its name, or several, one for each p of its own under "p".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.data import Quantity

Row = Mapping[str, Any]
NO_P = np.zeros(0)
"""The p of curves that have no numbers over p."""


@dataclass(frozen=True, eq=False)
class Column:
    """The values of a quantity.

    Attributes:
        quantity: with its unit, and "p" among its `dims` where it is a function of p.
        values: shape (curves,), or (curves, p); NaN where there is none.
    """

    quantity: Quantity
    values: FloatArray


class Table(dict[str, Column]):
    """Columns by the names of their quantities.

    Args:
        quantities: of the columns, in order.
        count: how many curves there are.
        p: all that a curve may have.
    """

    def __init__(self, quantities: Sequence[Quantity], count: int, p: FloatArray) -> None:
        self._places = {each: place for place, each in enumerate(p.tolist())}
        for each in quantities:
            self[each.name] = Column(each, np.full((count, p.size) if each.dims else count, math.nan))

    def put(self, curve: int, row: Row) -> None:
        """Fill in what a curve adds, counted from 0."""
        places = [self._places[p] for p in row["p"].tolist()] if self._places else []
        for name, column in self.items():
            if (found := row.get(name)) is not None:
                column.values[(curve, places) if column.quantity.dims else curve] = found


def plain(number: Any) -> Any:
    """A number as JSON and CSV have it: None where there is none."""
    return None if isinstance(number, float) and not math.isfinite(number) else number


def pair(name: str, estimate: Any) -> dict[str, float | None]:
    """A number and its error by their names; None where there is none."""
    return {name: estimate and estimate.value, f"{name}_error": estimate and estimate.error_estimate}
