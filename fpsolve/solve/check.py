"""What a case expects, or the moment hierarchy says, beside what is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.target import said
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import RESPONSE, Expectation, Varied
from fpsolve.errors import FpsolveError, NoHierarchy
from fpsolve.exponent.moments import even_moment, refuse_open_hierarchy
from fpsolve.exponent.quantities import SUMMARY_NUMBERS
from fpsolve.messages import Message
from fpsolve.solve.moments import QUESTION as MOMENTS
from fpsolve.solve.question import Asked, Job, Settings
from fpsolve.solve.set_result import SetResult
from fpsolve.solve.sets import attempt_set, result_of

SOURCE = "moment hierarchy; ± the stated error"
"""The source of values by the hierarchy."""


@dataclass(frozen=True)
class Comparison:
    """One expectation of a case and what was computed; `met` says whether they agree."""

    expectation: Expectation
    varied: Varied
    value: float | None
    tolerance: float
    met: bool

    @classmethod
    def of(cls, wanted: Expectation, result: SetResult) -> Comparison:
        """An expectation beside a parameter set."""
        response = result.response.numbers if result.response else {}
        known = response if wanted.of_response else result.estimates
        found = known.get(wanted.of_response or wanted.quantity) if wanted.p is None else result.moment(wanted.p)
        value, tolerance = found and found.value, max(wanted.atol or 0.0, (wanted.rtol or 0.0) * abs(wanted.value))
        met = value is not None and abs(value - wanted.value) <= tolerance
        return cls(wanted, dict(result.parameter_set.varied), value, tolerance, met)


@dataclass(frozen=True, eq=False)
class Checked:
    """What a check found.

    Attributes:
        results: the parameter sets, with what was compared alone; what did not converge is in their `failures`.
        comparisons: what was expected beside what was computed.
    """

    results: Sequence[SetResult]
    comparisons: Sequence[Comparison]

    @property
    def failures(self) -> tuple[Message, ...]:
        """Why some p or summary numbers of some parameter sets are missing."""
        return tuple(failure.reason for result in self.results for failure in result.failures)


def expected(case: Case, varied: Varied) -> Asked:
    """What the expectations of a case compare, of the parameter set with these values."""
    chosen = [each for each in case.expect if each.selects(varied)]
    p = np.unique([each.p for each in chosen if each.p is not None])
    asked: dict[str, Settings] = {MOMENTS.name: {"p": p.tolist(), "slopes": False}}
    asked |= {name: {} for name in SUMMARY_NUMBERS if any(each.quantity == name for each in chosen)}
    if any(each.of_response for each in chosen):
        asked[RESPONSE] = {"rtol": case.response.rtol, "grid": None}
    return asked


def compare(case: Case, results: Sequence[SetResult]) -> list[Comparison]:
    """Every expectation of a case against every parameter set that it selects."""
    return [
        Comparison.of(wanted, result)
        for wanted in case.expect
        for result in results
        if wanted.selects(result.parameter_set.varied)
    ]


def even_moments(case: Case) -> FloatArray:
    """The even p > 0 of a case, shape (n,)."""
    return case.p[(case.p > 0) & (case.p % 2 == 0)]


def refuse_no_hierarchy(case: Case) -> None:
    """Refuse a case without an even p, or some parameter set of which has no hierarchy. Raises `FpsolveError`."""
    orders = even_moments(case)
    if case.method.by_moments:
        raise FpsolveError(
            f"{case.path}: has more than two variables, of which Λ(p) of even p is by the hierarchy anyway"
        )
    if not orders.size:
        raise FpsolveError(f"{case.path}: moments.p: has no even p > 0, and the hierarchy is for these; add 2.0")
    for parameter_set in case.sets():
        try:
            refuse_open_hierarchy(parameter_set.problem, float(orders.max()))
        except (NoHierarchy, ValueError) as failure:
            place = f"{case.path}: with {parameter_set.label}" if parameter_set.varied else str(case.path)
            raise FpsolveError(f"{place}: {said(failure)}") from None


def compare_with_hierarchy(case: Case, results: Sequence[SetResult]) -> list[Comparison]:
    """Λ of the even p of every parameter set beside the hierarchy; they agree within the stated error and rounding."""

    def comparison(result: SetResult, p: float) -> Comparison:
        known, found = even_moment(result.parameter_set.problem, p), result.moment(p)
        error = known.error + (found.error_estimate if found else 0.0)
        wanted = Expectation(quantity="moment", p=p, value=known.value, atol=error, source=SOURCE)
        return Comparison.of(wanted, result)

    return [comparison(result, p) for result in results for p in even_moments(case).tolist()]


def compared(job: Job) -> SetResult:
    """The task: solves a set, of which the result is small enough to send."""
    return result_of(attempt_set(job))
