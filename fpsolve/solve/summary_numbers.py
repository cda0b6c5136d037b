"""The numbers of a set that are no function of p: λ, δ_p, Λ″(0) and those of impacts, each a part of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from fpsolve.case.case import Case, ParameterSet
from fpsolve.errors import NoSuchExponent
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import STABILITY_INDEX, SUMMARY_NUMBERS, SummaryNumber
from fpsolve.messages import Code, Message, Remedy
from fpsolve.solve.question import Job, Numbers, Numerics, Question, Reason, Settings
from fpsolve.solve.set_result import SetResult, estimated


def question_of(summary_number: SummaryNumber) -> Question:
    """The question for a summary number."""

    def asked(case: Case, number: int) -> Settings | None:
        return {} if summary_number.name in case.asked else None

    def solve(job: Job, settings: Settings) -> Estimate | Reason:
        try:
            found = summary_number.solve(job.solver)
        except NoSuchExponent as failure:
            return Reason("impossible", failure.message, summary_number.symbol)
        if found:
            return found
        if summary_number.name == STABILITY_INDEX.name:  # Λ(p) may have a root far out
            return Reason("impossible", found.reason, "stability index")
        return Reason("absent", found.reason, summary_number.symbol)

    def said(found: Estimate, parameter_set: ParameterSet, numerics: Numerics) -> Iterator[Message]:
        if summary_number.name == STABILITY_INDEX.name and found.value < -1:  # where a start may matter
            at, method = np.array([found.value]), numerics.solver(parameter_set.problem).method
            yield from method.bounds(at, 0 * at, 0 * at)  # of Λ(δ_p) = 0
        if found.relative_error > numerics.rtol:
            yield Message(
                Code.NUMBER_RTOL_MISSED,
                symbol=summary_number.symbol,
                value=found.value,
                error=found.error_estimate,
                size=found.relative_error,
                rtol=numerics.rtol,
                remedy=None if numerics.solver(parameter_set.problem).method.adapts else Remedy.MESH,
            )

    def numbers(case: Case, result: SetResult | None) -> Numbers:
        if summary_number.name not in case.asked:
            return {}
        found = result.estimates[summary_number.name] if result else None
        theory: Mapping[str, float] = result.parts.get(THEORY.name, {}) if result and found else {}
        return {**estimated(summary_number, found), summary_number.perturbation: theory.get(summary_number.name)}

    return Question(summary_number.name, asked, solve, Estimate, summary_number.symbol, said=said, numbers=numbers)


SUMMARY_NUMBER_QUESTIONS: tuple[Question, ...] = tuple(map(question_of, SUMMARY_NUMBERS.values()))
"""One for each summary number."""


def _solve_theory(job: Job, settings: Settings) -> dict[str, float]:
    return {name: summary_number.theory(job.parameter_set.problem) for name, summary_number in SUMMARY_NUMBERS.items()}


THEORY: Question = Question(
    "theory",
    lambda case, _: None if SUMMARY_NUMBERS.keys().isdisjoint(case.asked) else {},
    _solve_theory,
    dict[str, float],
)
"""By perturbation theory: a record has them so that tables need not make the problem of each parameter set."""
