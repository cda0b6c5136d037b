"""How the numbers of a parameter set change with every parameter."""

from __future__ import annotations

import numpy as np

from fpsolve.analysis.sensitivity import RECORDS, Sensitivities, solve_sensitivities
from fpsolve.case.case import Case
from fpsolve.case.sections import SENSITIVITIES
from fpsolve.messages import Message
from fpsolve.model.quantity import MOMENT
from fpsolve.solve.question import UNFINISHED, Job, Question, Settings


def _settings(case: Case, number: int) -> Settings | None:
    """At which p, and of which summary numbers; intervals follow from them, too."""
    if SENSITIVITIES not in case.asked and not case.uncertain:
        return None
    p = case.differentiated.tolist() if MOMENT.name in case.asked else []
    return {"p": p, "summary_numbers": [name for name in RECORDS if name in case.asked]}


def _solve(job: Job, settings: Settings) -> Sensitivities:
    solved = job.columns.p
    p = np.array([p for p in settings["p"] if np.any(solved == p)])
    names = [name for name in settings["summary_numbers"] if job.found(name) is not None]
    return solve_sensitivities(job.solver, p, job.parameter_set.problem.derivatives(), summary_numbers=names)


def _lacks(found: Sensitivities, settings: Settings) -> list[Message]:
    is_there = {*found.p.tolist()} == {*settings["p"]} and found.summary_numbers.keys() == {
        *settings["summary_numbers"]
    }
    return [] if is_there and all(found.moments) else [UNFINISHED]


QUESTION: Question = Question(
    SENSITIVITIES,
    _settings,
    _solve,
    Sensitivities,
    SENSITIVITIES,
    said=lambda found, *_: found.notes,
    lacks=_lacks,
)
