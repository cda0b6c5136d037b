"""Eigenfunctions over phase and noise, and the stationary density, which are files for ParaView."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from fpsolve.analysis.density import negative_share, stationary_density
from fpsolve.errors import NotConverged
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import MOST_NEGATIVE, UNRESOLVED
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import MOMENT
from fpsolve.parts.part import Job, Numerics, Part, Reason, Settings, attempt

if TYPE_CHECKING:
    from fpsolve.case.case import Case, Curve

NAME = "eigenfunctions"


@dataclass(frozen=True, eq=False)
class Eigenfunctions:
    """What is written of a curve.

    Attributes:
        pairs: those at the p that are shown.
        stationary: that at p = 0; None where it is not to be trusted.
        has_density: whether the stationary density is wanted for itself.
    """

    pairs: tuple[PrincipalPair, ...]
    stationary: PrincipalPair | None
    has_density: bool


def shown_of(case: Case, number: int) -> Settings | None:
    """The p that are shown of a curve, of the first also unasked, and whether its stationary density goes with them."""
    is_named = case.output.asks_for_eigenfunctions
    p = case.shown.tolist() if is_named or number == 1 else []
    has_density = is_named and not case.problem.no_picture and (number == 1 or bool(p))
    return {"p": p, "density": has_density} if p or has_density else None


def without_failed(job: Job, p: Sequence[float]) -> list[float]:
    """Those of some p at which Λ(p) did not fail."""
    moments = job.found(MOMENT.name)
    failed = {failure.p for failure in moments.failures} if moments else ()
    return [each for each in p if each not in failed]


def _settings(case: Case, number: int) -> Settings | None:
    return shown_of(case, number) if case.problem.dimension == 2 else None


def _solve(job: Job, settings: Settings) -> tuple[Message, ...]:
    """The pairs that converge, that at p = 0 if it is to be trusted; what is said of them."""
    found = [attempt(partial(job.solver.pair, p), NAME) for p in (*without_failed(job, settings["p"]), 0.0)]
    *pairs, stationary = (None if isinstance(each, Reason) else each for each in found)
    known = tuple(each for each in pairs if each is not None)
    said = list[Message]()
    try:
        if stationary is not None:
            stationary_density(stationary)
    except NotConverged as failure:
        stationary = None
        said.append(Message(Code.NOTHING_DRAWN, reason=failure.reason, remedy=job.solver.refinement))
    for pair in () if said else known:
        limits = {
            "T": (pair.sign_defects[0], UNRESOLVED),
            "T_adjoint": (pair.sign_defects[1], UNRESOLVED),
            "tilted_density": (negative_share(pair), MOST_NEGATIVE),
        }
        for name, (defect, most) in limits.items():
            said += [Message(Code.UNREADABLE, name=name, p=pair.p, size=defect)] * (defect > most)
    job.pictures[NAME] = Eigenfunctions(known, stationary, settings["density"])
    return tuple(said)


def said_of_pictures(found: Any, curve: Curve, numerics: Numerics) -> Sequence[Message]:
    """What was said when they were solved."""
    return tuple(found)


def _is_usual(case: Case) -> bool:
    """One is drawn unasked, of two variables."""
    is_drawn = case.output.eigenfunctions is None and case.problem.dimension == 2
    return is_drawn or case.output.asks_for_eigenfunctions


PART: Part = Part(
    NAME,
    _settings,
    _solve,
    tuple[Message, ...],
    NAME,
    is_usual=_is_usual,
    said=said_of_pictures,
    is_drawn=True,
)
