"""How far ‖x‖ may rise above its start: [excursions], its numbers, and what is said of them."""

from __future__ import annotations

from fpsolve.analysis.excursions import SYMBOL, Excursion, check_start, solve_excursion
from fpsolve.case.case import Case
from fpsolve.case.sections import EXCURSIONS
from fpsolve.errors import FpsolveError
from fpsolve.solve.question import Job, Question, Settings


def _settings(case: Case, number: int) -> Settings | None:
    """The start; levels are looked up in what was found."""
    return {"phi": case.excursions.phi, "xi": case.excursions.xi} if EXCURSIONS in case.asked else None


def _solve(job: Job, settings: Settings) -> Excursion:
    try:
        check_start(job.parameter_set.problem, settings["phi"], settings["xi"])
    except ValueError as error:  # of sets after the first one
        raise FpsolveError(str(error)) from None
    return solve_excursion(job.solver, phi=settings["phi"], xi=settings["xi"])


QUESTION: Question = Question(EXCURSIONS, _settings, _solve, Excursion, SYMBOL, said=lambda found, *_: found.notes)
