"""What a curve is solved on: the discretisation of the p of the largest size."""

from __future__ import annotations

from functools import partial
from typing import Any

from fpsolve.case.case import Case
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, MOMENT
from fpsolve.parts.part import Job, Part, Settings, attempt


def _settings(case: Case, number: int) -> Settings:
    """The p of the largest size that a case states, whether Λ(p) is asked for or not."""
    return {"p": max(case.p.tolist(), key=abs, default=0.0)}


def _solve(job: Job, settings: Settings) -> dict[str, Any]:
    """z in noise units; nothing where no p was solved. One is solved where all numbers are from an earlier run."""
    if job.curve.problem.is_closed_only:
        return {}
    known = job.solver.whole.known
    if not known:
        has_moment = settings["p"] in job.found(MOMENT.name).columns.p
        if has_moment or job.found(LYAPUNOV_EXPONENT.name):
            attempt(partial(job.solver.solution, settings["p"] if has_moment else 0.0), "")
    p = max(known, key=abs, default=None)
    if p is None:
        return {}
    space = known[p].pair.space
    return {**space.phi.facts, **space.xi.facts, "unknowns": space.size}


PART: Part = Part("discretisation", _settings, _solve, dict[str, Any])
