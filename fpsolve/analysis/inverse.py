"""Design: the values of parameters at which λ, Λ(p) or δ_p has a wanted value, by its exact derivatives.

One parameter: Newton's iteration on F(θ) = 0 of `Distance`, within a bracket as soon as F has both signs. Where it
leads out of the range, or F cannot be solved on its way, F is scanned over the range, and where it turns between two
points the least |F| is sought, at which the slope is 0. If F has one sign everywhere, the target cannot be reached.

Several parameters: of all θ with F(θ) = 0 the one that is nearest to the θ⁰ of the problem,

    minimise ½ Σ xᵢ²,  xᵢ = (θᵢ − θᵢ⁰)/sᵢ,  with F(θ) = 0 and each θᵢ within its range,

where sᵢ is what a change of θᵢ is measured by, |θᵢ⁰| where nothing else is stated. x + μ ∇F = 0 holds there but for the
parameters at an end of their range, μ being the multiplier of Lagrange. It is found by sequential quadratic programming
(SLSQP, D. Kraft, DFVLR-FB 88-28, 1988) with the exact gradients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq, minimize

from fpsolve.analysis.scan import TOLERANCE, Sample
from fpsolve.analysis.target import Distance, Target, start_and_stop, target_of
from fpsolve.analysis.zero import Axis, is_none, said
from fpsolve.arrays import FloatArray, real_number, shown
from fpsolve.data import Result, dataset, written
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.model.quantity import Quantity
from fpsolve.roots import Missing, Value, increasing_root

if TYPE_CHECKING:
    import xarray

EXACT = 1e-13
"""|F| over its scale at which a point is taken at once."""
NODES = 17
"""Number of points of a scan over one parameter."""
POINTS = 24
"""Number of points of a scan over several parameters, for each of them."""
MOST_STEPS = 60
"""Largest number of quadratic problems."""
MOST_REFINEMENTS = 12
"""Largest number of points between two of a scan where |F| is least."""
TURN = 1e-4
"""Error of the place of the least |F|, over the distance of these two points."""
MOST_PARAMETERS = 6
"""Largest number of parameters, as all corners of their ranges are points of a scan."""
SAME = 1e-8
"""Distance of x from the nearest point that no longer counts, relative to the larger of 1 and |x|."""
BEYOND = 0.1
"""Rise of |F| with the distance from the last point, over |∇F|, that is assumed where F has no value."""
NEAREST = 1e-6
"""Largest component of x + μ ∇F, but for what leads out of a range, at the nearest point."""
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
        units: what a change of each parameter is measured by.
        solves: how many solves it took.
    """

    target: Target
    problem: Problem
    start: Problem
    by: tuple[Axis, ...]
    values: Mapping[str, Estimate]
    found: Estimate
    units: Mapping[str, float]
    solves: int

    @property
    def distance(self) -> float:
        """√(Σ xᵢ²), x the changes of the parameters in their units."""
        changes = (each.value - float(self.start.values[key]) for key, each in self.values.items())
        return math.hypot(*(change / unit for change, unit in zip(changes, self.units.values(), strict=True)))

    def to_xarray(self) -> xarray.Dataset:
        """The values of the parameters, with their errors, and the quantity."""
        numbers: dict[Quantity, Any] = {
            quantity: number
            for each in (*self.values.values(), self.found)
            for quantity, number in ((each.quantity, each.value), (each.quantity.error(), each.error_estimate))
        }
        return dataset(f"design with {self.target}", "finite elements", numbers, {}, self.problem.values)

    def _said(self) -> str:
        return f"{self.target} at {', '.join(f'{key} = {each}' for key, each in self.values.items())}"


def design(
    problem: Problem,
    target: str,
    by: str | Axis | Sequence[str | Axis],
    *,
    units: Mapping[str, float] | None = None,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Design | Absent:
    """The values of parameters with which λ, Λ(p) or δ_p has a wanted value, or that it cannot be reached.

    With several parameters it is the nearest point to the values of the problem: that with the least √(Σ xᵢ²), x the
    changes of the parameters in their units. Where several points serve it is one that Newton's iteration finds from
    the values of the problem.

    >>> design(problem, "moment(2) = -0.008", "oscillator.c1")
    Design(...)

    Args:
        problem: a motion and its noise, where the search starts.
        target: such as "stability_index = 1", "lyapunov_exponent = -0.01" or "moment(2) = 0".
        by: the parameters by their keys, each with its range as an `Axis`; of a key alone that is from half to twice
            its value.
        units: what a change of a parameter is measured by, for some keys; if not stated, the absolute value of the
            parameter, or where that is 0 the width of its range.
        budget: for a solve.
        progress: called after each solve.

    Raises:
        ValueError: the target cannot be read, or a parameter or its range is none.
        NotConverged: some values on the way were not resolved.
        NoSuchExponent: Λ(p) exists nowhere in the range.
    """
    wanted, axes = target_of(target), axes_of(problem, by)
    measures = units_of(problem, axes, units or {})
    distance = Distance(problem, wanted, [axis.key for axis in axes], budget or Budget(), progress)
    found = (
        _along_axis(distance, axes[0]) if len(axes) == 1 else _nearest(distance, axes, np.array([*measures.values()]))
    )
    if isinstance(found, Absent):
        return found
    unit = np.array([*measures.values()])
    scaled = found.gradient * unit
    errors = (abs(found.value) + found.error) * np.abs(scaled) / float(scaled @ scaled) * unit
    if len(axes) > 1:  # how near to the nearest point of F = 0
        errors += SAME * np.maximum(unit, np.abs(found.at))
    parameters, solved = problem.parameters, distance.ratio.at(found.at)
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
        units=measures,
        solves=distance.solves,
    )


def axes_of(problem: Problem, by: str | Axis | Sequence[str | Axis]) -> tuple[Axis, ...]:
    """The parameters of a design with their ranges. Raises `ValueError`."""
    stated = [by] if isinstance(by, str | Axis) else list(by)
    known, found = checked_problem(problem).differentiable, list[Axis]()
    if not 0 < len(stated) <= MOST_PARAMETERS:
        raise ValueError(f"got {len(stated)} parameters; must be 1 to {MOST_PARAMETERS}")
    for each in stated:
        key = each.key if isinstance(each, Axis) else each
        if key not in known:
            raise ValueError(f"got {shown(key)} as a parameter; must be one of {', '.join(known) or 'none'}")
        if key in [axis.key for axis in found]:
            raise ValueError(f"got {key} twice; remove one of them")
        axis = each if isinstance(each, Axis) else start_and_stop(problem, key)
        if axis is None:
            raise ValueError(f'{key} is 0, which leaves its range open; state it, as in Axis("{key}", -1.0, 1.0)')
        for name, value in (("start", axis.start), ("stop", axis.stop)):
            try:
                problem.at({key: value})
            except ValueError as failure:
                raise ValueError(f"got {key} with {name} = {value:g}: {said(failure)}") from failure
        found.append(axis)
    return tuple(found)


def units_of(problem: Problem, axes: Sequence[Axis], stated: Mapping[str, float]) -> dict[str, float]:
    """What a change of each parameter is measured by. Raises `ValueError`."""
    found = dict[str, float]()
    for axis in axes:
        unit = real_number(stated.get(axis.key, abs(float(problem.values[axis.key])) or axis.stop - axis.start), "unit")
        if not unit > 0:
            raise ValueError(f"got the unit {unit:g} of {axis.key}; must be > 0")
        found[axis.key] = unit
    if unknown := [key for key in stated if key not in found]:
        raise ValueError(f"got a unit of {unknown[0]}, which is no parameter of the design; remove it")
    return found


def _limits(sample: Sample) -> tuple[float, float]:
    """|F| at which a point is taken at once, and at which it is if the next one is no better."""
    return max(EXACT * sample.scale, 0.1 * sample.error), max(TOLERANCE * sample.scale, sample.error)


def _is_met(sample: Sample) -> bool:
    return abs(sample.value) <= _limits(sample)[0]


def _is_close(sample: Sample) -> bool:
    return abs(sample.value) <= _limits(sample)[1]


class _Path:
    """F along a path θ(u), 0 ≤ u ≤ 1.

    Args:
        distance: F.
        value: gives θ, shape (n,).
        slope: gives dθ/du, shape (n,).

    Attributes:
        known: the samples by u; None where there is none.
    """

    def __init__(
        self, distance: Distance, value: Callable[[float], FloatArray], slope: Callable[[float], FloatArray]
    ) -> None:
        self._distance, self._value, self._slope = distance, value, slope
        self.known = dict[float, Sample | None]()

    def at(self, u: float) -> Sample | None:
        """F at u; None where there is none."""
        if u not in self.known:
            self.known[u] = self._distance.tried(self._value(u))
        return self.known[u]

    def rise(self, u: float) -> float:
        """dF/du at a point that is known."""
        sample = self.known[u]
        return math.nan if sample is None else float(sample.gradient @ self._slope(u))

    @property
    def samples(self) -> list[tuple[float, Sample]]:
        """The samples in the order of u."""
        return [(u, sample) for u, sample in sorted(self.known.items()) if sample is not None]

    def crossing(self, near: float) -> tuple[float, float] | None:
        """Two neighbours at which F has both signs, those nearest to some u; None where there are none."""
        pairs = [(a, b) for (a, one), (b, other) in pairwise(self.samples) if (one.value < 0) != (other.value < 0)]
        return min(pairs, key=lambda pair: max(pair[0] - near, near - pair[1]), default=None)

    def root(self, u: float) -> Sample | None:
        """F = 0 by Newton's iteration from u, in a bracket as soon as there is one; None where it leads nowhere."""
        start = u
        while (bracket := self.crossing(start)) is None:
            if (sample := self.at(u)) is None or _is_met(sample):
                return sample
            if self.crossing(start) is None:
                rise = self.rise(u)
                u = min(max(u - sample.value / rise, 0.0), 1.0) if rise else math.nan
                if math.isnan(u) or u in self.known:
                    return sample if _is_close(sample) else None
        sign = -math.copysign(1.0, self._size(bracket[0]))  # so that it increases

        def signed(u: float) -> Value:
            if (sample := self.at(u)) is None:
                raise Missing(u)
            exact, close = _limits(sample)
            return Value(sign * sample.value, sign * self.rise(u), exact, close)

        with suppress(Missing):
            better = min(bracket, key=lambda end: abs(self._size(end)))
            sample = self.known[increasing_root(signed, better, bracket, bracket)]
            return sample if sample is not None and _is_close(sample) else None
        return None

    def _size(self, u: float) -> float:
        sample = self.known[u]
        return math.inf if sample is None else sample.value

    def scan(self, near: float) -> Sample | None:
        """F = 0 from a scan of the whole path; None where F has one sign on it."""
        for u in np.linspace(0, 1, NODES).tolist():
            self.at(u)
        if (pair := self.crossing(near)) is not None:
            return self.root(pair[0])
        for (a, _), (b, _) in list(pairwise(self.samples)):
            self._refine(a, b)
            if (pair := self.crossing(near)) is not None:
                return self.root(pair[0])
        return None

    def _refine(self, a: float, b: float) -> None:
        """Look for the value of F next to 0 between two neighbours, where its slope is 0, until F changes its sign."""
        sign = math.copysign(1.0, self._size(a))

        def rise(u: float) -> float:
            sample = self.at(u)
            if sample is None or sign * sample.value <= 0:
                raise StopIteration
            return sign * self.rise(u)

        with suppress(StopIteration):
            if rise(a) < 0 < rise(b):
                brentq(rise, a, b, xtol=TURN * (b - a), maxiter=MOST_REFINEMENTS, disp=False)


def _along_axis(distance: Distance, axis: Axis) -> Sample | Absent:
    """F = 0 over one parameter."""
    path = _Path(distance, lambda u: np.array([axis.value(u)]), lambda u: np.array([axis.slope(u)]))
    here = min(max(axis.share(float(distance.ratio.problem.values[axis.key])), 0.0), 1.0)
    found = path.root(here) or path.scan(here)
    if found is not None:
        return found
    return _unreached(distance, (axis,), path.crossing(here) is not None)


def _unreached(distance: Distance, axes: Sequence[Axis], is_crossed: bool) -> Absent:
    """That F is nowhere 0. Raises `FpsolveError` where that is not known, as F is missing, or changes its sign."""
    samples, reasons = distance.samples, distance.reasons
    target = distance.target
    if not samples:
        raise NoSuchExponent(reasons[0]) if all(map(is_none, reasons)) else NotConverged(reasons[0])
    missing = [reason for reason in reasons if not is_none(reason)]
    if missing or is_crossed:
        reason = missing[0] if missing else Message(Code.NEWTON_UNSETTLED)
        raise NotConverged(Message(Code.DESIGN_GAPS, target=str(target), count=len(missing) or None, reason=reason))
    nearest = min(samples, key=lambda each: abs(each.value))
    place = ", ".join(f"{axis.key} = {written(float(value))}" for axis, value in zip(axes, nearest.at, strict=True))
    frame = ", ".join(f"{axis.key} from {axis.start:g} to {axis.stop:g}" for axis in axes)
    about: dict[str, Any] = {"target": str(target), "frame": frame, "place": place}
    if target.kind == "stability_index":
        about["side"] = f"{target.quantity.symbol} {'>' if nearest.value < 0 else '<'} {target.value:g}"
    else:
        values = [target.level + each.value for each in samples]
        about |= {"symbol": target.quantity.symbol, "least": min(values), "most": max(values)}
    return Absent(Message(Code.UNREACHED, **about))


def _nearest(distance: Distance, axes: Sequence[Axis], units: FloatArray) -> Sample | Absent:
    """The point F = 0 that is nearest to the problem."""
    here = np.array([float(distance.ratio.problem.values[axis.key]) for axis in axes])
    start = np.clip(here, *np.array([(axis.start, axis.stop) for axis in axes]).T)
    if (found := _nearest_from(distance, start, axes, here, units)) is not None:
        return found
    from scipy.stats import qmc  # not before it is needed, as it takes a while

    corners, inner = product((0.0, 1.0), repeat=len(axes)), qmc.LatinHypercube(len(axes), seed=0)
    for each in (*corners, *inner.random(POINTS * len(axes)).tolist()):
        distance.tried(np.array([axis.value(u) for axis, u in zip(axes, each, strict=True)]))
    samples = distance.samples
    best = min(samples, key=lambda each: abs(each.value), default=None)
    others = [each for each in samples if best is not None and (each.value < 0) != (best.value < 0)]
    if best is not None and others:
        step = min((each.at - best.at for each in others), key=lambda step: float(np.linalg.norm(step / units)))
        first = best.at
        path = _Path(distance, lambda u: first + u * step, lambda u: step)
        path.at(1.0)
        best = path.root(0.0) or best
    if best is not None and (found := _nearest_from(distance, best.at, axes, here, units)) is not None:
        return found
    return _unreached(distance, axes, bool(others))


def _nearest_from(
    distance: Distance, start: FloatArray, axes: Sequence[Axis], origin: FloatArray, units: FloatArray
) -> Sample | None:
    """The nearest point to θ⁰, the origin, by steps from θ; None where they lead nowhere."""
    if (first := distance.tried(start)) is None:
        return None
    low, high = (
        (np.array(ends) - origin) / units for ends in zip(*((axis.start, axis.stop) for axis in axes), strict=True)
    )
    size, taken = float(np.linalg.norm(first.gradient * units)) or 1.0, [first]

    def x_of(sample: Sample) -> FloatArray:
        return (sample.at - origin) / units

    def at(x: FloatArray) -> Sample | None:
        return distance.tried(origin + np.clip(x, low, high) * units)

    def value(x: FloatArray) -> float:
        """F; where there is none more than at the last point, so that a step to there is made shorter."""
        if (here := at(x)) is None:
            return abs(taken[-1].value) / size + BEYOND * float(np.linalg.norm(x - x_of(taken[-1])))
        return 0.0 if _is_met(here) else here.value / size

    def slope(x: FloatArray) -> FloatArray:
        """∇F at a point that is taken. Raises `StopIteration` where the steps end before F is 0."""
        here = at(x)
        is_rest = len(taken) > 1 and here and np.max(np.abs(x_of(here) - x_of(taken[-1]))) <= SAME
        if here is None or (is_rest and not _is_close(here)):
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
            options={"ftol": FALL, "maxiter": MOST_STEPS},
        )
    x, gradient = x_of(taken[-1]), taken[-1].gradient * units
    free = gradient * ((x > low) & (x < high))
    multiplier = -(x @ free) / ((free @ free) or 1.0)
    is_nearest = not free.any() or np.max(np.abs(x - np.clip(-multiplier * gradient, low, high))) <= NEAREST
    return taken[-1] if is_nearest and _is_close(taken[-1]) else None
