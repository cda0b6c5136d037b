"""I(s) = ps − Λ(p) at s = Λ′(p), which follows from Λ(p)."""

from __future__ import annotations

from fpsolve.case.case import Case
from fpsolve.model.quantity import MOMENT, RATE_FUNCTION
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.question import Numbers, Question


def _numbers(case: Case, result: CurveResult | None) -> Numbers:
    is_asked = {MOMENT.name, RATE_FUNCTION.name} <= {*case.asked}
    return {RATE_FUNCTION: result.moments.rate_function if result else None} if is_asked else {}


QUESTION: Question = Question(RATE_FUNCTION.name, numbers=_numbers, names=r"rate_function\.(png|pdf)")
