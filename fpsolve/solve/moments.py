"""Λ(p) of a parameter set at the p of its case, and of each of its blocks or rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.sections import OF_MOMENTS
from fpsolve.exponent.error import Failure, InvariantClass, Moment
from fpsolve.exponent.solver import solve_moments
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import MOMENT, OVER_P, RATE_FUNCTION
from fpsolve.solve.question import UNFINISHED, Job, Numbers, Numerics, Question, Settings
from fpsolve.solve.set_result import SetResult
from fpsolve.theory.perturbation import perturbed_moments, weak_noise_note


@dataclass(frozen=True, eq=False)
class Moments:
    """What is found of Λ(p), beside the rows of the p at which it did not fail.

    Attributes:
        failures: why some p are missing.
        messages: what limits the numbers, and where the theories compared with are not valid.
    """

    failures: tuple[Failure, ...] = ()
    messages: tuple[Message, ...] = ()


def _settings(case: Case, number: int) -> Settings:
    p = case.p.tolist() if MOMENT.name in case.asked else []
    every = not case.method.is_function and not {*OF_MOMENTS}.isdisjoint(case.asked)
    return {"p": p, "slopes": True, "every_slope": every}


def _solve(job: Job, settings: Settings) -> Moments:
    """Λ(p), with errors of Λ′(p) if `slopes` says so, and with Λ′ that take a solve of their own if `every_slope`."""
    problem, has_slopes = job.parameter_set.problem, settings["slopes"]
    known = {p: Moment(*row[:-1]) for p, row in job.rows.items()}

    def advance() -> None:
        for p in known.keys() - job.rows.keys():
            job.rows[p] = (*known[p], float(perturbed_moments(problem, np.array(p))))
        job.advance()

    refused = {p: told for p in settings["p"] if (told := job.solver.method.reason(p))}
    for _ in refused:
        job.advance()
    computed = [p for p in settings["p"] if p not in refused]
    found = solve_moments(job.solver, computed, progress=advance, known=known if has_slopes else None)
    p, slopes = found.p, found.derivative if settings.get("every_slope") else found.slope
    errors = found.errors_of(slopes) if has_slopes else np.full(p.shape, np.nan)
    closed = perturbed_moments(problem, p)  # Eq. (37)
    rows = np.column_stack([p, found.value, slopes, errors, found.error_estimate, found.residual, closed])
    job.rows |= {p: row for p, *row in rows.tolist()}
    notes = *found.notes, *problem.remarks, weak_noise_note(problem, p, found.value)
    failures = *(Failure(p, reason) for p, reason in refused.items()), *found.failures
    return Moments(failures, (*found.warnings, *filter(None, notes)))


def _numbers(case: Case, result: SetResult | None) -> Numbers:
    known = vars(result.moments) if result else {}
    return {each: known.get(name) for name, each in OVER_P.items()} if MOMENT.name in case.asked else {}


QUESTION: Question = Question(
    MOMENT.name,
    _settings,
    _solve,
    Moments,
    said=lambda found, *_: found.messages,
    lacks=lambda found, _: (each.reason for each in found.failures),
    numbers=_numbers,
)


def _rates(case: Case, result: SetResult | None) -> Numbers:
    is_asked = {MOMENT.name, RATE_FUNCTION.name} <= {*case.asked}
    return {RATE_FUNCTION: result.moments.rate_function if result else None} if is_asked else {}


RATES: Question = Question(RATE_FUNCTION.name, numbers=_rates)
"""I(s) = ps − Λ(p) at s = Λ′(p), which follows from Λ(p)."""


def _solve_classes(job: Job, settings: Settings) -> tuple[InvariantClass, ...]:
    return job.solver.by_class(job.columns.p) if QUESTION.name in job.entries else ()


def _said_of_classes(
    classes: Sequence[InvariantClass], parameter_set: ParameterSet, numerics: Numerics
) -> Iterator[Message]:
    """That there are such classes, and their λ."""
    if len(classes) < 2:
        return
    problem, rates = parameter_set.problem, [each.lyapunov_exponent.value for each in classes]
    if classes[0].phase is None:
        is_hidden = not set(classes[0].variables) <= set(problem.linear.states)
        yield Message(
            Code.BLOCKS, blocks=[f"({', '.join(each.variables)})" for each in classes], is_hidden=is_hidden, rates=rates
        )
    else:
        along, across = rates
        yield Message(Code.INVARIANT_CLASSES, phase=classes[0].phase, along=along, across=across)


CLASSES: Question = Question(
    "classes",
    _settings,
    _solve_classes,
    tuple[InvariantClass, ...],
    said=_said_of_classes,
    lacks=lambda found, settings: [UNFINISHED for each in found if {*each.p.tolist()} != {*settings["p"]}],
)
"""λ and Λ(p) of blocks of variables, or on a ray that the phase never leaves and across it."""
