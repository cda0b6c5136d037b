"""What a parameter set is solved on: the discretisation of the p of the largest size."""

from __future__ import annotations

from functools import partial

import numpy as np

from fpsolve.case.case import Case
from fpsolve.model.quantity import LYAPUNOV_EXPONENT
from fpsolve.solve.question import Job, Question, Settings, attempt


def _settings(case: Case, number: int) -> Settings:
    """The p of the largest size that a case states, whether Λ(p) is asked for or not."""
    return {"p": max(case.p.tolist(), key=abs, default=0.0)}


def _solve(job: Job, settings: Settings) -> dict[str, object]:
    """z in noise units; nothing where no p is by elements. One is solved where all numbers are from an earlier run."""
    if not largest_of(job):
        found = job.columns
        has_pair = settings["p"] in found.p[np.isfinite(found.residual)]  # by elements
        if has_pair or job.found(LYAPUNOV_EXPONENT.name):
            attempt(partial(job.solver.solution, settings["p"] if has_pair else 0.0), "")
    largest = largest_of(job)
    return dict(largest[1]) if largest else {}


def largest_of(job: Job) -> tuple[float, dict[str, object]] | None:
    """The p of the largest size that was solved by elements, by an earlier run, too, and what it was solved on."""
    found = [job.largest] if job.largest else []
    for p, solution in job.solver.method.spaces.items():
        space = solution.pair.space
        found.append((p, {**space.phi.facts, **space.xi.facts, "unknowns": space.size}))
    return max(found, key=lambda each: abs(each[0]), default=None)


QUESTION: Question = Question("discretisation", _settings, _solve, dict[str, object])
