"""I(s) = ps − Λ(p) at s = Λ′(p), which follows from Λ(p)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fpsolve.case.case import Case
from fpsolve.data import Quantity
from fpsolve.model.quantity import MOMENT, RATE_FUNCTION
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.question import Question


def _numbers(case: Case, result: CurveResult | None) -> Mapping[Quantity, Any]:
    is_asked = {MOMENT.name, RATE_FUNCTION.name} <= {*case.asked}
    return {RATE_FUNCTION: result and result.moments.rate_function} if is_asked else {}


QUESTION: Question = Question(RATE_FUNCTION.name, numbers=_numbers)
