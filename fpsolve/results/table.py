"""The numbers of a case as one table: a column for each quantity, over the parameter sets, or over these and p."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.data import Quantity
from fpsolve.model.quantity import MOMENT, SECONDS, STATUS
from fpsolve.solve.questions import QUESTIONS
from fpsolve.solve.set_result import Number, SetResult, Status

Cell = str | float | None
"""What CSV and JSON have of a number: nothing where there is none."""
COUNTS = (
    Quantity("p_solved", "p solved", "number of p that are solved"),
    Quantity("p_failed", "p failed", "number of p that failed"),
)
"""The numbers of p of a parameter set."""


@dataclass(frozen=True, eq=False)
class Column:
    """The values of a quantity.

    Attributes:
        quantity: with its unit, and "p" among its `dims` where it is a function of p.
        values: shape (sets,), or (sets, p); NaN where there is none.
    """

    quantity: Quantity
    values: FloatArray


class Table(dict[str, Column]):
    """Columns by the names of their quantities, those over p first, with a row for each parameter set of a case.

    Args:
        case: which tells what is asked for.
        results: of some of its parameter sets.

    Attributes:
        p: over which the columns over p are, shape (p,).
        messages: what is said of each parameter set, joined by "; ".
    """

    def __init__(self, case: Case, results: Iterable[SetResult] = ()) -> None:
        self._case, self.p = case, case.p if MOMENT.name in case.asked else np.zeros(0)
        self._places = {p: place for place, p in enumerate(self.p.tolist())}
        self.messages = [""] * case.planned
        found = [each for question in QUESTIONS for each in question.numbers(case, None)]
        for each in (*sorted(found, key=lambda each: not each.dims), *COUNTS, STATUS, SECONDS):
            shape = (case.planned, self.p.size) if each.dims else case.planned
            self[each.name] = Column(each, np.full(shape, math.nan))
        for result in results:
            self.put(result)

    def put(self, result: SetResult) -> None:
        """Fill in the numbers and the messages of a parameter set."""
        parameter_set, solved = result.parameter_set.number - 1, result.moments.p
        places = [self._places[p] for p in solved.tolist()] if self.p.size else []
        counts = solved.size, self.p.size - solved.size, result.status, round(result.seconds, 6)
        numbers: dict[Quantity, Number] = dict(zip((*COUNTS, STATUS, SECONDS), counts, strict=True))
        for question in QUESTIONS:
            numbers |= question.numbers(self._case, result)
        for quantity, found in numbers.items():
            if found is not None:
                self[quantity.name].values[(parameter_set, places) if quantity.dims else parameter_set] = found
        self.messages[parameter_set] = "; ".join(text for texts in result.remarks.values() for text in texts)

    def row(self, number: int) -> dict[str, Cell]:
        """The summary numbers of a set by its number, by the names of the columns."""
        return {
            name: _cell(each.quantity, each.values[number - 1].item())
            for name, each in self.items()
            if not each.quantity.dims
        }

    def over_p(self, number: int) -> list[dict[str, Cell]]:
        """The functions of p of a set by its number, at each solved p."""
        columns = {name: each.values[number - 1] for name, each in self.items() if each.quantity.dims}
        solved = np.flatnonzero(~np.isnan(columns[MOMENT.name])).tolist() if self.p.size else ()
        numbers = {"p": self.p, **columns}
        return [{name: plain(values[place].item()) for name, values in numbers.items()} for place in solved]


def plain(number: float) -> float | None:
    """A number as JSON and CSV have it: None where there is none."""
    return number if math.isfinite(number) else None


def _cell(quantity: Quantity, number: float) -> Cell:
    if quantity is STATUS:
        return Status(int(number)).word
    return int(number) if quantity in COUNTS else plain(number)
