"""Densities of the directions of three and four variables, in the place of eigenfunctions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from fpsolve.analysis.directions import SettledDirections, negative_part, settled_directions
from fpsolve.budget import counted
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import MOST_NEGATIVE
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.parts.eigenfunctions import said_of_pictures, shown_of, without_failed
from fpsolve.parts.part import Job, Part, Reason, Settings, attempt

if TYPE_CHECKING:
    from fpsolve.case.case import Case

NAME = "directions"
ROUGH = 0.05
"""Total variation by which finer functions may move a density that a picture shows."""


def _settings(case: Case, number: int) -> Settings | None:
    return shown_of(case, number) if case.problem.dimension > 2 else None


def _solve(job: Job, settings: Settings) -> tuple[Message, ...]:
    """The densities at the p that converge, at p = 0 with the stationary one; what is said of them."""
    found, said, shown = list[SettledDirections](), list[Message](), without_failed(job, settings["p"])
    for p in sorted({*shown, 0.0} if settings["density"] else shown):
        pair = attempt(partial(job.solver.pair, p), NAME)
        if isinstance(pair, Reason):
            continue
        each = attempt(partial(_at, job.solver, pair), NAME)
        if isinstance(each, Reason):
            said.append(Message(Code.INDEX_MISSING, symbols=["density of directions"], reason=each.message))
        else:
            found.append(each)
    job.pictures[NAME] = tuple(found)
    return (*said, *(message for each in found for message in _unclear(each)))


def _at(solver: ExponentSolver, pair: PrincipalPair) -> SettledDirections:
    with counted(solver.budget.countdown(f"the density of directions at p = {pair.p:g}")):
        return settled_directions(pair)


def _unclear(found: SettledDirections) -> Iterator[Message]:
    """Which densities mislead."""
    p, fields = found.pair.p, found.fields
    for name, values in {"T_adjoint": fields.adjoint, "tilted_density": fields.product}.items():
        if (defect := negative_part(fields.grid, values)) > MOST_NEGATIVE:
            yield Message(Code.UNREADABLE, name=name, p=p, size=defect)
    if not fields.is_resolved:
        yield Message(Code.FINE_DENSITY, p=p, size=abs(fields.total - 1))
    if not found.error <= ROUGH:
        yield Message(Code.ROUGH_DENSITY, p=p, size=None if math.isnan(found.error) else found.error)


PART: Part = Part(
    NAME,
    _settings,
    _solve,
    tuple[Message, ...],
    "density of directions",
    said=said_of_pictures,
    is_quantity=False,
    is_drawn=True,
)
