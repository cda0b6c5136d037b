"""What a curve is solved on: the discretisation of the p of the largest size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fpsolve.parts.part import Job, Part, Settings

if TYPE_CHECKING:
    from fpsolve.case.case import Case


def _settings(case: Case, number: int) -> Settings:
    return {}


def _solve(job: Job, settings: Settings) -> dict[str, Any]:
    """z in noise units; nothing where no p was solved."""
    known = job.solver.whole.known
    p = max(known, key=abs, default=None)
    if p is None:
        return {}
    space = known[p].pair.space
    return {**space.phi.facts, **space.xi.facts, "unknowns": space.size}


PART: Part = Part("discretisation", _settings, _solve, dict[str, Any], is_quantity=False)
