"""Eigenfunctions over phase and noise, or densities of the directions of more variables, for files and pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from fpsolve.analysis.density import stationary_density
from fpsolve.case.case import Case
from fpsolve.case.sections import EIGENFUNCTIONS
from fpsolve.errors import NotConverged
from fpsolve.exponent.density import MOST_NEGATIVE, RESOLVED, UNRESOLVED, Densities, densities
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.method import DIRECTIONS, PHASE_AND_NOISE, Pictures
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import MOMENT
from fpsolve.solve.question import Job, Question, Reason, Settings, attempt

ROUGH = 0.05
"""Total variation by which finer functions may move a density that a picture shows."""


@dataclass(frozen=True, eq=False)
class Eigenfunctions:
    """What is written of a parameter set.

    Attributes:
        pairs: those at the p that are shown.
        stationary: that at p = 0; None where it is not to be trusted.
        has_density: whether the stationary density is wanted for itself.
    """

    pairs: tuple[PrincipalPair, ...]
    stationary: PrincipalPair | None
    has_density: bool


def shown_of(case: Case, number: int) -> Settings | None:
    """The p that are shown of a set, of the first also unasked, and whether its stationary density goes with them."""
    is_named = case.output.asks_for_eigenfunctions
    p = case.shown.tolist() if is_named or number == 1 else []
    has_density = is_named and not case.method.no_picture and (number == 1 or bool(p))
    return {"p": p, "density": has_density} if p or has_density else None


def without_failed(job: Job, p: Sequence[float]) -> list[float]:
    """Those of some p at which Λ(p) did not fail."""
    moments = job.found(MOMENT.name)
    failed = {failure.p for failure in moments.failures} if moments else ()
    return [each for each in p if each not in failed]


def _solve(job: Job, settings: Settings) -> tuple[Message, ...]:
    """The pairs that converge, that at p = 0 if it is to be trusted; what is said of them."""
    found = [attempt(partial(job.solver.pair, p), EIGENFUNCTIONS) for p in (*without_failed(job, settings["p"]), 0.0)]
    *pairs, stationary = (None if isinstance(each, Reason) else each for each in found)
    known, said = tuple(filter(None, pairs)), list[Message]()
    try:
        if stationary:
            stationary_density(stationary)
    except NotConverged as failure:
        stationary = None
        said.append(Message(Code.NOTHING_DRAWN, reason=failure.reason, remedy=job.solver.method.refinement))
    for pair in () if said else known:
        tilted = densities(pair)
        limits = {
            "T": (pair.sign_defects[0], UNRESOLVED),
            "T_adjoint": (pair.sign_defects[1], UNRESOLVED),
            "tilted_density": (tilted.grid.negative_share(tilted.fields.tilted_density), MOST_NEGATIVE),
        }
        for name, (defect, most) in limits.items():
            said += [Message(Code.UNREADABLE, name=name, p=pair.p, size=defect)] * (defect > most)
    job.pictures[EIGENFUNCTIONS] = Eigenfunctions(known, stationary, settings["density"])
    return tuple(said)


def _solve_directions(job: Job, settings: Settings) -> tuple[Message, ...]:
    """The densities at the p that converge, at p = 0 with the stationary one; what is said of them."""
    found, said, shown = list[Densities](), list[Message](), without_failed(job, settings["p"])
    for p in sorted({*shown, 0.0} if settings["density"] else shown):
        each = attempt(partial(_at, job.solver, p), DIRECTIONS.part)
        if isinstance(each, Reason):
            said.append(Message(Code.NUMBER_MISSING, symbols=["density of directions"], reason=each.message))
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
        defect = found.grid.negative_share(found.fields._asdict()[name])
        if defect > MOST_NEGATIVE:
            yield Message(Code.UNREADABLE, name=name, p=p, size=defect)
    if not found.missing <= RESOLVED:
        yield Message(Code.FINE_DENSITY, p=p, size=found.missing)
    if not found.error <= ROUGH:
        yield Message(Code.ROUGH_DENSITY, p=p, size=None if math.isnan(found.error) else found.error)


def question_of_pictures(
    pictures: Pictures,
    symbol: str,
    solve: Callable[[Job, Settings], tuple[Message, ...]],
) -> Question:
    """That of the cases of which there are such pictures; what it finds is what was said when they were solved.

    Args:
        pictures: what is drawn.
        symbol, solve: see `Question`.
    """
    return Question(
        pictures.part,
        lambda case, number: shown_of(case, number) if case.method.pictures == pictures else None,
        solve,
        tuple[Message, ...],
        symbol,
        said=lambda found, *_: found,
        draws=True,
    )


QUESTION: Question = question_of_pictures(PHASE_AND_NOISE, EIGENFUNCTIONS, _solve)
OF_DIRECTIONS: Question = question_of_pictures(DIRECTIONS, "density of directions", _solve_directions)
