"""I(s) = ps − Λ(p) at s = Λ′(p), which follows from Λ(p)."""

from __future__ import annotations

from collections.abc import Sequence

from fpsolve.case.case import Case
from fpsolve.data import Quantity
from fpsolve.model.quantity import MOMENT, RATE_FUNCTION
from fpsolve.parts.part import Part
from fpsolve.results.curve import CurveResult
from fpsolve.results.table import Row


def _columns(case: Case) -> Sequence[Quantity]:
    return (RATE_FUNCTION,) if {MOMENT.name, RATE_FUNCTION.name} <= {*case.asked} else ()


def _row(case: Case, result: CurveResult) -> Row:
    return {RATE_FUNCTION.name: result.moments.rate_function}


PART: Part = Part(RATE_FUNCTION.name, columns=_columns, row=_row)
