"""What tables have of each curve of a case: the quantities of the columns, and the row of a curve."""

from __future__ import annotations

from collections.abc import Iterable

from fpsolve.case.case import Case
from fpsolve.model.quantity import MOMENT, SECONDS, STATUS, Quantity
from fpsolve.results.table import NO_P, Row, Table
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.questions import QUESTIONS

COUNTS = (
    Quantity("p_solved", "p solved", "number of p that are solved"),
    Quantity("p_failed", "p failed", "number of p that failed"),
)
"""The numbers of p of a curve."""


def columns_of(case: Case) -> tuple[Quantity, ...]:
    """The columns of all questions, those over p first; those of perturbation theory have no error."""
    found = [each for question in QUESTIONS for each in question.numbers(case, None)]
    return *sorted(found, key=lambda each: not each.dims), *COUNTS, STATUS, SECONDS


def row_of(case: Case, result: CurveResult) -> Row:
    """The numbers of a curve by the names of the columns, and its p.

    Args:
        case: which tells what is asked for.
        result: of the curve.
    """
    row = {about.name: each for question in QUESTIONS for about, each in question.numbers(case, result).items()}
    count, solved = case.p.size if MOMENT.name in case.asked else 0, result.moments.p.size
    counts = {"p_solved": solved, "p_failed": count - solved}
    return {**row, "p": result.moments.p, **counts, STATUS.name: result.status, SECONDS.name: round(result.seconds, 6)}


def table_of(case: Case, results: Iterable[CurveResult] = ()) -> Table:
    """The numbers of some curves of a case, with room for all."""
    table = Table(columns_of(case), case.planned, case.p if MOMENT.name in case.asked else NO_P)
    for result in results:
        table.put(result.curve.number - 1, row_of(case, result))
    return table
