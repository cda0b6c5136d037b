"""δ_p, the non-zero root of Λ(p)."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from fpsolve.budget import unless_over_budget
from fpsolve.errors import NotConverged
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.method import Tolerance, refuse
from fpsolve.exponent.solver import ExponentSolver, contradiction, share_of
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import STABILITY_INDEX
from fpsolve.roots import Missing, NoRoot, Value, increasing_root

SEARCH_INTERVAL: tuple[float, float] = (-20.0, 20.0)
OUTWARD = 4.0
"""The first p at most; others are at most twice as far out as the one before, as Λ(p) costs more there."""
PRECISE = 0.5
"""Of what rtol allows δ_p, for the error of the last Λ(p)/p."""


def nonzero_root(solver: ExponentSolver, interval: tuple[float, float] = SEARCH_INTERVAL) -> Estimate | Absent:
    """δ_p, the non-zero root of Λ(p), or why Λ has none in the interval.

    Λ is convex, so Λ(p)/p increases and has one root at most, see `increasing_root`. The last solve is as accurate as
    δ_p is to be. Where Λ(p) is not resolved far out it is looked for as far as it is.

    Raises:
        NotConverged: no p on the way is resolved, or not one between two at which Λ(p)/p has other signs.
    """
    if not solver.problem.is_driven:
        return Absent(Message(Code.NOT_DRIVEN))
    method = solver.method
    refuse(method.reason(0.0, STABILITY_INDEX.symbol))
    if told := method.reason(1.0, STABILITY_INDEX.symbol):
        return Absent(told)
    low, high = (float(end) for end in np.clip(interval, *method.interval))
    ends = low, high
    nowhere = Absent(Message(Code.NO_ROOT, low=low, high=high, is_bounded=solver.problem.noise.is_bounded))
    of_parts = method.index_of_parts(lambda part: nonzero_root(solver.of(part), interval), nowhere)
    if of_parts is not None:
        return of_parts
    solved = dict[float, tuple[float, float, float]]()
    cause: Any

    def at(p: float, tolerance: Tolerance | None = None) -> Value:
        with unless_over_budget(None if p in solved else Missing(p)):  # what is known is enough
            solved[p] = method.ratio(p, tolerance)
        ratio, slope, error = solved[p]
        if not slope > 0:
            raise NotConverged(Message(Code.NOT_INCREASING, p=p), remedy=method.refinement)
        return Value(ratio, slope, 0.1 * error)

    signed: tuple[float, ...] = ()
    ratio, slope, error = method.ratio(0.0)
    if slope <= error:  # where Λ(p)/p is the same far out on both sides, to its errors, it has no root
        sides = [method.ratio_alone(float(np.clip(p, low, high))) for p in (-OUTWARD, OUTWARD)]
        if abs(sides[1][0] - sides[0][0]) <= sides[0][1] + sides[1][1]:
            return Absent(Message(Code.LINEAR, value=ratio if abs(ratio) > error else 0.0))
    start = -ratio / slope if slope > 0 else math.copysign(1.0, -ratio)
    if abs(ratio) > 2 * error and low < 0 < high:
        (low, high), signed = (0.0, high) if ratio < 0 else (low, 0.0), (0.0,)
    try:
        p = increasing_root(at, min(max(start, -OUTWARD), OUTWARD), (low, high), signed, OUTWARD)
        found = _index(p, *solved[p])
        if found.relative_error > solver.rtol and method.adapts:
            tolerance = partial(share_of, PRECISE * solver.rtol * solved[p][1] * max(1.0, abs(p)))
            with suppress(Missing, NoRoot):  # where that is out of reach the first one does
                p = increasing_root(partial(at, tolerance=tolerance), p, ends)
            found = _index(p, *solved[p])
    except Missing as missing:
        cause = missing.__cause__
        raise cause from None
    except NoRoot as none:
        if none.missing is None:
            return nowhere
        cause = none.missing.__cause__
        low, high = (ends[0], none.last) if none.is_negative else (none.last, ends[1])
        return Absent(Message(Code.NO_ROOT_REACHED, low=low, high=high, reason=cause.message))
    ratio, slope, error = solved[p]
    place, value, steep, off = (np.array([number]) for number in (p, p * ratio, ratio + p * slope, abs(p) * error))
    if obstacle := contradiction(solver, place, value, steep, off, lambda: np.array([solver.slope_error(p)])):
        raise NotConverged(obstacle, remedy=method.refinement)
    return method.checked(found)


def _index(p: float, ratio: float, slope: float, error: float) -> Estimate:
    """δ_p by Λ(p)/p next to it, its slope and error."""
    return Estimate(p, error / slope + abs(ratio / slope), scale=1.0, quantity=STABILITY_INDEX)
