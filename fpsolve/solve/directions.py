"""Densities of the directions of three and four variables, in the place of eigenfunctions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

from fpsolve.exponent.density import MOST_NEGATIVE, RESOLVED, Densities, densities
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.solve.eigenfunctions import question_of_pictures, without_failed
from fpsolve.solve.question import Job, Question, Reason, Settings, attempt

ROUGH = 0.05
"""Total variation by which finer functions may move a density that a picture shows."""


def _solve(job: Job, settings: Settings) -> tuple[Message, ...]:
    """The densities at the p that converge, at p = 0 with the stationary one; what is said of them."""
    found, said, shown = list[Densities](), list[Message](), without_failed(job, settings["p"])
    for p in sorted({*shown, 0.0} if settings["density"] else shown):
        each = attempt(partial(_at, job.solver, p), DIRECTIONS.part)
        if isinstance(each, Reason):
            said.append(Message(Code.INDEX_MISSING, symbols=["density of directions"], reason=each.message))
        else:
            found.append(each)
    job.pictures[DIRECTIONS.part] = tuple(found)
    return (*said, *(message for each in found for message in _unclear(each)))


def _at(solver: ExponentSolver, p: float) -> Densities:
    pair = solver.pair(p)
    with solver.meter.running():
        return densities(pair)


def _unclear(found: Densities) -> Iterator[Message]:
    """Which densities mislead."""
    p = found.pair.p
    for name in ("T_adjoint", "tilted_density"):
        defect = found.grid.negative_share(getattr(found.fields, name))
        if defect > MOST_NEGATIVE:
            yield Message(Code.UNREADABLE, name=name, p=p, size=defect)
    if not found.missing <= RESOLVED:
        yield Message(Code.FINE_DENSITY, p=p, size=found.missing)
    if not found.error <= ROUGH:
        yield Message(Code.ROUGH_DENSITY, p=p, size=None if math.isnan(found.error) else found.error)


QUESTION: Question = question_of_pictures(DIRECTIONS, "density of directions", _solve)
