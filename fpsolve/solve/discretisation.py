"""What a curve is solved on: the discretisation of the p of the largest size."""

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
    """z in noise units; nothing where no p is by elements. The p is solved again where an earlier run had done that."""
    found, spaces = job.columns, job.solver.method.spaces
    has_pair = settings["p"] in found.p[np.isfinite(found.residual)]  # by elements
    p = settings["p"] if has_pair else 0.0
    if (has_pair or job.found(LYAPUNOV_EXPONENT.name)) and not any(abs(each) >= abs(p) for each in spaces):
        attempt(partial(job.solver.solution, p), "")
    if not spaces:
        return {}
    space = spaces[max(spaces, key=abs)].pair.space
    return {**space.phi.facts, **space.xi.facts, "unknowns": space.size}


QUESTION: Question = Question("discretisation", _settings, _solve, dict[str, object])
