"""The even moments of a case beside those of the moment hierarchy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import Expectation
from fpsolve.errors import FpsolveError, NoHierarchy
from fpsolve.parts.moments import PART as MOMENTS
from fpsolve.study.results import Comparison, CurveResult
from fpsolve.study.solve import Asked
from fpsolve.theory.moments import hierarchy_exponent, refuse_open_hierarchy

SOURCE = "moment hierarchy; ± the stated error"


def even_moments(case: Case) -> FloatArray:
    """The even p > 0 of a case, shape (n,)."""
    return case.p[(case.p > 0) & (case.p % 2 == 0)]


def even_moments_asked(case: Case) -> Asked:
    """What is asked of a curve for these p."""
    return {MOMENTS.name: {"p": even_moments(case).tolist(), "slopes": True}}


def refuse_no_hierarchy(case: Case) -> None:
    """Refuse a case without an even p, or some curve of which has no hierarchy. Raises `FpsolveError`."""
    orders = even_moments(case)
    if not orders.size:
        raise FpsolveError(f"{case.path}: moments.p: has no even p > 0, and the hierarchy is for these; add 2.0")
    for curve in case.curves():
        try:
            refuse_open_hierarchy(curve.problem, float(orders.max()))
        except NoHierarchy as failure:
            place = f"{case.path}: with {curve.label}" if curve.varied else str(case.path)
            raise FpsolveError(f"{place}: {failure}") from None


def compare_with_hierarchy(case: Case, results: Sequence[CurveResult]) -> list[Comparison]:
    """Λ of the even p of every curve beside the hierarchy; they agree within the stated error and rounding."""
    found = []
    for result in results:
        moments, varied = result.moments, dict(result.curve.varied)
        for p in even_moments(case):
            expected, rounding = hierarchy_exponent(result.curve.problem, float(p))
            at = np.flatnonzero(moments.p == p)
            value = float(moments.value[at[0]]) if at.size else None
            tolerance = float(moments.error_estimate[at[0]]) + rounding if at.size else rounding
            met = value is not None and abs(value - expected) <= tolerance
            wanted = Expectation(quantity="moment", p=float(p), value=expected, atol=tolerance, source=SOURCE)
            found.append(Comparison(wanted, varied, value, tolerance, met))
    return found
