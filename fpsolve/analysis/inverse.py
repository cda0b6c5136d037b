"""Design: the values of parameters at which λ, Λ(p) or δ_p has a wanted value, by its exact derivatives.

Of all θ with F(θ) = 0, F of `Distance`, it is the one that is nearest to the θ⁰ of the problem,

    minimise ½ Σ xᵢ²,  xᵢ = (θᵢ − θᵢ⁰)/sᵢ,  with F(θ) = 0 and each θᵢ within its range,

where sᵢ is what a change of θᵢ is measured by, |θᵢ⁰| where nothing else is stated. x + μ ∇F = 0 holds there but for the
parameters at an end of their range, μ being the multiplier of Lagrange. It is found by sequential quadratic programming
(SLSQP, D. Kraft, DFVLR-FB 88-28, 1988) with the exact gradients, for one parameter Newton's method. Where that leads
nowhere, F is solved at the corners and at points of a Latin hypercube; if it has one sign there, then on the way to
where |F| is least. Between two points at which it has both signs Brent's method finds F = 0, from where the steps begin
anew. If F has one sign everywhere, the target cannot be reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq, minimize

from fpsolve.analysis.axis import Axis, bounds_of, check_ends, check_key
from fpsolve.analysis.scan import TOLERANCE, Sample
from fpsolve.analysis.spreads import cube
from fpsolve.analysis.target import Distance, Target, is_none, target_of
from fpsolve.arrays import FloatArray, require
from fpsolve.data import Result, dataset, written
from fpsolve.errors import FpsolveError, NoSuchExponent, NotConverged
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem

if TYPE_CHECKING:
    import xarray

EXACT = 1e-13
"""|F| over its scale at which a point is taken at once."""
POINTS = 16
"""Number of points of a scan over several parameters, for each of them."""
MOST_SOLVES = 30
"""Largest number of points on the steps from one start."""
MOST_REFINEMENTS = 40
"""Largest number of points on the way to where |F| is least."""
MOST_PARAMETERS = 6
"""Largest number of parameters, as all corners of their ranges are points of a scan."""
SAME = 1e-8
"""How far x may be off the nearest point, relative to the larger of 1 and |x|."""
BEYOND = 0.1
"""Rise of |F| with the distance from the last point, over |∇F|, that is assumed where F has no value."""
NEAREST = 1e-6
"""Largest component of x + μ ∇F at the nearest point, where the steps end before it is `SAME`."""
FALL = 1e-15
"""Change of ½|x|² with which the quadratic problems end."""


@dataclass(frozen=True, eq=False, repr=False)
class Design(Result):
    """The values of parameters with which a quantity has a wanted value.

    Attributes:
        target: what was wanted.
        problem: with these values.
        start: the problem that was given.
        by: the ranges of the parameters.
        values: of the parameters by their keys; the error is by how much the nearest exact value may be off.
        found: the quantity there.
        solves: how many solves it took.
    """

    target: Target
    problem: Problem
    start: Problem
    by: tuple[Axis, ...]
    values: Mapping[str, Estimate]
    found: Estimate
    solves: int

    @property
    def distance(self) -> float:
        """√(Σ xᵢ²), x the changes of the parameters over their values."""
        units, start = units_of(self.start, self.by), self.start.values
        return math.hypot(*((self.values[key].value - float(start[key])) / unit for key, unit in units.items()))

    def to_xarray(self) -> xarray.Dataset:
        """The values of the parameters, with their errors, and the quantity."""
        numbers = {
            quantity: number
            for each in (*self.values.values(), self.found)
            for quantity, number in ((each.quantity, each.value), (each.quantity.error(), each.error_estimate))
        }
        return dataset(f"design with {self.target.equation}", "finite elements", numbers, {}, self.problem.values)

    def _said(self) -> str:
        return f"{self.target.equation} at {', '.join(f'{key} = {each}' for key, each in self.values.items())}"


def design(
    problem: Problem,
    target: str,
    by: str | Axis | Sequence[str | Axis],
    *,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Design | Absent:
    """The values of parameters with which λ, Λ(p) or δ_p has a wanted value, or that it cannot be reached.

    With several parameters it is the nearest point: the least √(Σ xᵢ²), x the
    changes of the parameters over their values. Where several points serve it is one that the steps find from the
    values of the problem.

    >>> design(problem, "moment(2) = -0.008", "oscillator.c1")
    Design(...)

    Args:
        problem: a motion and its noise, where the search starts.
        target: such as "stability_index = 1", "lyapunov_exponent = -0.01" or "moment(2) = 0".
        by: the parameters by their keys, each with its range as an `Axis`; of a key alone that is from half to twice
            its value.
        budget: for a solve.
        progress: called after each solve.

    Raises:
        ValueError: the target cannot be read, or a parameter or its range is none.
        NotConverged: some values on the way were not resolved.
        NoSuchExponent: Λ(p) exists nowhere in the range.
    """
    require(by, Axis | Sequence, "by", 'a parameter such as "noise.D0", an Axis, or a list of these')
    wanted, axes = target_of(target), axes_of(problem, by)
    rtol, keys = choose(problem).line_rtol(wanted.order), [axis.key for axis in axes]
    distance = Distance(problem, wanted, keys, rtol=rtol, budget=budget or Budget())
    tried, here = _Tried(distance, progress), np.array([float(problem.values[axis.key]) for axis in axes])
    unit = np.array([*units_of(problem, axes).values()])
    found = _nearest(tried, wanted, axes, here, unit)
    if isinstance(found, Absent):
        return found
    scaled = found.gradient * unit
    errors = (abs(found.value) + found.error) * np.abs(scaled) / (scaled @ scaled) * unit
    if len(axes) > 1:  # how near to the nearest point of F = 0
        errors += SAME * np.maximum(unit, np.abs(found.at))
    parameters, solved = problem.parameters, distance.at(found.at)
    return Design(
        target=wanted,
        problem=solved,
        start=problem,
        by=axes,
        values={
            axis.key: Estimate(float(value), float(error), abs(float(value)), quantity=parameters[axis.key].quantity)
            for axis, value, error in zip(axes, found.at, errors, strict=True)
        },
        found=distance.found(found),
        solves=tried.solves,
    )


def axes_of(problem: Problem, by: str | Axis | Sequence[str | Axis]) -> tuple[Axis, ...]:
    """The parameters of a design with their ranges. Raises `ValueError`."""
    stated = [by] if isinstance(by, str | Axis) else list(by)
    found = list[Axis]()
    if not 0 < len(stated) <= MOST_PARAMETERS:
        raise ValueError(f"got {len(stated)} parameters; must be 1 to {MOST_PARAMETERS}")
    for each in stated:
        key = each.key if isinstance(each, Axis) else each
        check_key(problem, key)
        if key in [axis.key for axis in found]:
            raise ValueError(f"got {key} twice; remove one of them")
        axis = each if isinstance(each, Axis) else start_and_stop(problem, key)
        if axis is None:
            raise ValueError(f"{key} is 0, which leaves its range open; state both of its ends")
        check_ends(problem, axis)
        found.append(axis)
    return tuple(found)


def units_of(problem: Problem, axes: Sequence[Axis]) -> dict[str, float]:
    """What a change of each parameter is measured by: its absolute value, or for 0 the width of its range."""
    return {axis.key: abs(float(problem.values[axis.key])) or axis.stop - axis.start for axis in axes}


def start_and_stop(problem: Problem, key: str) -> Axis | None:
    """The range from half to twice the value of a parameter, within its range; None where the value is 0."""
    value, (low, high) = float(problem.values[key]), bounds_of(problem, key)
    if value == 0:
        return None
    start, stop = sorted((0.5 * value, 2.0 * value))
    return Axis(key, max(start, low), min(stop, high))


class _Tried:
    """F, solved once at each θ.

    Attributes:
        samples: where it has a value.
        reasons: why it has none elsewhere.
        solves: how many there were.
    """

    def __init__(self, distance: Distance, progress: Callable[[], None]) -> None:
        self._distance, self._progress, self.reasons = distance, progress, list[Message]()
        self._known = dict[tuple[float, ...], Sample | None]()

    @property
    def samples(self) -> list[Sample]:
        return [each for each in self._known.values() if each is not None]

    @property
    def solves(self) -> int:
        return len(self._known)

    def beyond(self, sample: Sample) -> list[Sample]:
        """Those of the other sign."""
        return [each for each in self.samples if (each.value < 0) != (sample.value < 0)]

    def __call__(self, theta: FloatArray) -> Sample | None:
        """F at θ; None where there is none."""
        key = tuple(theta.tolist())
        if key not in self._known:
            self._known[key] = None
            try:
                self._known[key] = self._distance(theta)._replace(rtol=EXACT)
            except FpsolveError as failure:
                self.reasons.append(failure.message)
            self._progress()
        return self._known[key]


def _unreached(tried: _Tried, target: Target, axes: Sequence[Axis], is_crossed: bool) -> Absent:
    """That F is nowhere 0. Raises `FpsolveError` where that is not known, as F is missing, or changes its sign."""
    samples, reasons = tried.samples, tried.reasons
    if not samples:
        raise NoSuchExponent(reasons[0]) if all(map(is_none, reasons)) else NotConverged(reasons[0])
    missing = [reason for reason in reasons if not is_none(reason)]
    if missing or is_crossed:
        reason = missing[0] if missing else Message(Code.NEWTON_UNSETTLED)
        raise NotConverged(Message(Code.DESIGN_GAPS, target=target.equation, count=len(missing) or None, reason=reason))
    nearest = min(samples, key=lambda each: abs(each.value))
    place = ", ".join(f"{axis.key} = {written(float(value))}" for axis, value in zip(axes, nearest.at, strict=True))
    frame = ", ".join(f"{axis.key} from {axis.start:g} to {axis.stop:g}" for axis in axes)
    about: dict[str, object] = {"target": target.equation, "frame": frame, "place": place}
    if target.kind == "stability_index":
        about["side"] = target.side(nearest.value)
    else:
        values = [target.at(each.value) for each in samples]
        about |= {"symbol": target.quantity.symbol, "least": min(values), "most": max(values)}
    return Absent(Message(Code.UNREACHED, **about))


def _nearest(
    tried: _Tried, target: Target, axes: Sequence[Axis], here: FloatArray, units: FloatArray
) -> Sample | Absent:
    """The point F = 0 that is nearest to the problem."""
    start = np.clip(here, *np.array([(axis.start, axis.stop) for axis in axes]).T)
    if (found := _nearest_from(tried, start, axes, here, units)) is not None:
        return found
    corners, inner = product((0.0, 1.0), repeat=len(axes)), cube(len(axes), POINTS * len(axes), seed=0)
    for each in (*corners, *inner.tolist()):
        tried(np.array([axis.value(u) for axis, u in zip(axes, each, strict=True)]))
    if (best := min(tried.samples, key=lambda each: abs(each.value), default=None)) is None:
        return _unreached(tried, target, axes, False)
    if not (others := tried.beyond(best)):
        _approach(tried, best, axes, units)
        others = tried.beyond(best)
    if others:
        other = min(others, key=lambda each: np.linalg.norm((each.at - best.at) / units))
        if (found := _nearest_from(tried, _root(tried, best.at, other.at), axes, here, units)) is not None:
            return found
    return _unreached(tried, target, axes, bool(others))


def _approach(tried: _Tried, first: Sample, axes: Sequence[Axis], units: FloatArray) -> None:
    """Solve on the way from a point to where |F| is least, until F changes its sign."""
    sign = math.copysign(1.0, first.value)

    def size(x: FloatArray) -> tuple[float, FloatArray]:
        if (here := tried(x * units)) is None or sign * here.value <= 0:
            raise StopIteration
        return sign * here.value, sign * here.gradient * units

    bounds = [(axis.start / unit, axis.stop / unit) for axis, unit in zip(axes, units, strict=True)]
    with suppress(StopIteration):
        minimize(
            size, first.at / units, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxfun": MOST_REFINEMENTS}
        )


def _root(tried: _Tried, one: FloatArray, other: FloatArray) -> FloatArray:
    """Where F = 0 between two points at which it has both signs; the first where it has no value on the way."""

    def value(share: float) -> float:
        if (sample := tried(one + share * (other - one))) is None:
            raise StopIteration
        return 0.0 if sample.is_zero else sample.value

    with suppress(StopIteration):
        return one + brentq(value, 0.0, 1.0, xtol=EXACT) * (other - one)
    return one


def _nearest_from(
    tried: _Tried, start: FloatArray, axes: Sequence[Axis], origin: FloatArray, units: FloatArray
) -> Sample | None:
    """The nearest point to θ⁰, the origin, by steps from θ; None where they lead nowhere."""
    if (first := tried(start)) is None:
        return None
    low, high = (
        (np.array(ends) - origin) / units for ends in zip(*((axis.start, axis.stop) for axis in axes), strict=True)
    )
    size, taken, most = float(np.linalg.norm(first.gradient * units)) or 1.0, [first], tried.solves + MOST_SOLVES

    def x_of(sample: Sample) -> FloatArray:
        return (sample.at - origin) / units

    def at(x: FloatArray) -> Sample | None:
        return tried(origin + np.clip(x, low, high) * units)

    def off(sample: Sample) -> float:
        """The largest component of x + μ ∇F, but for what leads out of a range."""
        x, gradient = x_of(sample), sample.gradient * units
        free = gradient * ((x > low) & (x < high))
        if not free.any():
            return 0.0
        return float(np.max(np.abs(x - np.clip((x @ free) / (free @ free) * gradient, low, high))))

    def value(x: FloatArray) -> float:
        """F; where there is none more than at the last point, so that a step to there is made shorter.

        Raises:
            StopIteration: it is the nearest point, or the steps take too many.
        """
        if (here := at(x)) is None:
            return abs(taken[-1].value) / size + BEYOND * float(np.linalg.norm(x - x_of(taken[-1])))
        if tried.solves >= most or (here.is_zero and off(here) <= SAME):
            taken.append(here)
            raise StopIteration
        return 0.0 if here.is_zero else here.value / size

    def slope(x: FloatArray) -> FloatArray:
        """∇F at a point that is taken. Raises `StopIteration` where there is none."""
        if (here := at(x)) is None:
            raise StopIteration
        taken.append(here)
        return here.gradient * units / size

    with suppress(StopIteration):
        minimize(
            lambda x: 0.5 * x @ x,
            x_of(first),
            jac=lambda x: x,
            method="SLSQP",
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "eq", "fun": value, "jac": slope},
            options={"ftol": FALL, "maxiter": MOST_SOLVES},
        )
    is_zero = abs(taken[-1].value) <= max(TOLERANCE * taken[-1].scale, taken[-1].error)
    return taken[-1] if is_zero and off(taken[-1]) <= NEAREST else None
