"""The numbers of a curve that are no function of p: λ, δ_p, Λ″(0) and those of impacts, each a part of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fpsolve.case.case import Case, Curve
from fpsolve.errors import NoSuchExponent
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES, STABILITY_INDEX, Index
from fpsolve.messages import Code, Message, Remedy
from fpsolve.solve.curve import CurveResult, estimated
from fpsolve.solve.question import Job, Numbers, Numerics, Question, Reason, Settings


def question_of(index: Index) -> Question:
    """The question for an index."""
    by_theory = index.perturbation

    def asked(case: Case, number: int) -> Settings | None:
        return {} if index.name in case.asked else None

    def solve(job: Job, settings: Settings) -> Estimate | Reason:
        try:
            found = index.solve(job.solver)
        except NoSuchExponent as failure:
            return Reason("impossible", failure.message, index.symbol)
        if found:
            return found
        if index.name == STABILITY_INDEX.name:  # Λ(p) may have a root far out
            return Reason("impossible", found.reason, "stability index")
        return Reason("absent", found.reason, index.symbol)

    def said(found: Estimate, curve: Curve, numerics: Numerics) -> Iterator[Message]:
        if found.relative_error > numerics.rtol:
            yield Message(
                Code.INDEX_RTOL_MISSED,
                symbol=index.symbol,
                value=found.value,
                error=found.error_estimate,
                size=found.relative_error,
                rtol=numerics.rtol,
                remedy=None if numerics.solver(curve.problem).method.adapts else Remedy.MESH,
            )

    def numbers(case: Case, result: CurveResult | None) -> Numbers:
        if index.name not in case.asked:
            return {}
        found = result.estimates[index.name] if result else None
        theory: Mapping[str, float] = result.parts.get(THEORY.name, {}) if result and found else {}
        return {**estimated(index, found), by_theory: theory.get(index.name)}

    return Question(index.name, asked, solve, Estimate, index.symbol, said=said, numbers=numbers)


INDEX_QUESTIONS: tuple[Question, ...] = tuple(map(question_of, INDICES.values()))
"""One for each index."""


def _solve_theory(job: Job, settings: Settings) -> dict[str, float]:
    return {name: index.theory(job.curve.problem) for name, index in INDICES.items()}


THEORY: Question = Question(
    "theory", lambda case, _: None if INDICES.keys().isdisjoint(case.asked) else {}, _solve_theory, dict[str, float]
)
"""The indices by perturbation theory, which a record has so that tables need not make the problem of each curve."""
