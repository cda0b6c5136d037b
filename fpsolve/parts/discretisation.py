"""What a curve is solved on: the discretisation of the p of the largest size."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from fpsolve.case.case import Case
from fpsolve.model.quantity import LYAPUNOV_EXPONENT
from fpsolve.parts.question import Job, Question, Settings, attempt


def _settings(case: Case, number: int) -> Settings:
    """The p of the largest size that a case states, whether Λ(p) is asked for or not."""
    return {"p": max(case.p.tolist(), key=abs, default=0.0)}


def _solve(job: Job, settings: Settings) -> dict[str, Any]:
    """z in noise units; nothing where no p is by elements. One is solved where all numbers are from an earlier run."""
    solved, found = job.solver.method.spaces, job.columns
    if not solved:
        has_pair = settings["p"] in found.p[np.isfinite(found.residual)]  # by elements
        if has_pair or job.found(LYAPUNOV_EXPONENT.name):
            attempt(partial(job.solver.solution, settings["p"] if has_pair else 0.0), "")
    if not solved:
        return {}
    space = solved[max(solved, key=abs)].pair.space
    return {**space.phi.facts, **space.xi.facts, "unknowns": space.size}


QUESTION: Question = Question("discretisation", _settings, _solve, dict[str, Any])
