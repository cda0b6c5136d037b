"""Design: the values of parameters at which λ, Λ(p) or δ_p has a wanted value, by its exact derivatives.

One parameter: Newton's iteration on F(θ) = 0 of `Distance`, within a bracket as soon as F has both signs. Where it
leads out of the range, or F cannot be solved on its way, F is scanned over the range, and where it turns between two
points the least |F| is sought by the cubic that has their values and slopes. If F has one sign everywhere, the target
cannot be reached.

Several parameters: of all θ with F(θ) = 0 the one that is nearest to the θ⁰ of the problem,

    minimise ½ Σ xᵢ²,  xᵢ = (θᵢ − θᵢ⁰)/sᵢ,  with F(θ) = 0 and each θᵢ within its range,

where sᵢ is what a change of θᵢ is measured by, |θᵢ⁰| where nothing else is stated. x + μ ∇F = 0 holds there but for the
parameters at an end of their range, μ being the multiplier of Lagrange. Each step solves the quadratic problem

    minimise ½ dᵀB d + xᵀd  with F + ∇F·d = 0,

with an approximation B of the Hessian of ½x² + μF by the gradients (BFGS).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Polynomial

from fpsolve.analysis.scan import TOLERANCE, Sample
from fpsolve.analysis.target import Distance, Target, start_and_stop, target_of
from fpsolve.analysis.zero import Axis, said
from fpsolve.arrays import FloatArray, real_number, shown
from fpsolve.data import Result, dataset, written
from fpsolve.errors import FpsolveError, NoSuchExponent, NotConverged
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
MOST_HALVINGS = 8
"""Largest number of halvings of a step."""
MOST_PARAMETERS = 6
"""Largest number of parameters, as the quadratic problem is solved for each set of them at the ends of their ranges."""
SAME = 1e-8
"""Step of x that no longer counts, relative to the larger of 1 and |x|."""
SMALL = 1e-3
"""Step of x after which less |F| is progress, relative to the larger of 1 and |x|."""
PENALTY = 5.0
"""Weight of F² over the square of its first gradient, beside half the square of the distance."""


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
        reasons: why there is none.
    """

    def __init__(
        self, distance: Distance, value: Callable[[float], FloatArray], slope: Callable[[float], FloatArray]
    ) -> None:
        self._distance, self._value, self._slope = distance, value, slope
        self.known, self.reasons = dict[float, Sample | None](), list[Message]()

    def at(self, u: float) -> Sample | None:
        """F at u; None where there is none."""
        if u not in self.known:
            try:
                self.known[u] = self._distance(self._value(u))
            except FpsolveError as failure:
                self.known[u] = None
                self.reasons.append(failure.message)
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
        """Look for the value of F next to 0 between two neighbours, until F changes its sign."""
        for _ in range(MOST_REFINEMENTS):
            one, other = self._size(a), self._size(b)
            sign = math.copysign(1.0, one)
            if not (sign * self.rise(a) < 0 < sign * self.rise(b)):
                return
            u = a + (b - a) * _turn(one, other, self.rise(a) * (b - a), self.rise(b) * (b - a))
            last = min(abs(one), abs(other))
            if not a < u < b or self.at(u) is None:
                return
            now = self._size(u)
            if now * sign <= 0 or abs(abs(now) - last) <= 1e-6 * last:
                return
            a, b = (u, b) if sign * self.rise(u) < 0 else (a, u)


def _turn(one: float, other: float, rise: float, fall: float) -> float:
    """Where on [0, 1] the cubic with two values and two slopes at the ends turns."""
    second, third = 3 * (other - one) - 2 * rise - fall, 2 * (one - other) + rise + fall
    cubic = Polynomial([one, rise, second, third])
    roots = [complex(root) for root in Polynomial([rise, 2 * second, 3 * third]).roots()]
    turns = [root.real for root in roots if abs(root.imag) < 1e-9 and 0 < root.real < 1]
    return min(turns, key=lambda u: abs(float(cubic(u))), default=0.5)


def _along_axis(distance: Distance, axis: Axis) -> Sample | Absent:
    """F = 0 over one parameter."""
    path = _Path(distance, lambda u: np.array([axis.value(u)]), lambda u: np.array([axis.slope(u)]))
    here = min(max(axis.share(float(distance.problem.values[axis.key])), 0.0), 1.0)
    found = path.root(here) or path.scan(here)
    if found is not None:
        return found
    return _unreached(distance, (axis,), [sample for _, sample in path.samples], path.reasons, path.crossing(here))


def _unreached(
    distance: Distance,
    axes: Sequence[Axis],
    samples: Sequence[Sample],
    reasons: Sequence[Message],
    crossing: tuple[float, float] | None = None,
) -> Absent:
    """That F is nowhere 0. Raises `FpsolveError` where that is not known, as F is missing at some points."""
    target = distance.target
    if not samples:
        raise NoSuchExponent(reasons[0]) if all(map(_is_none, reasons)) else NotConverged(reasons[0])
    missing = [reason for reason in reasons if not _is_none(reason)]
    if missing or crossing is not None:
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
    return Absent(Message(Code.UNREACHED if "side" not in about else Code.INDEX_UNREACHED, **about))


def _is_none(reason: Message) -> bool:
    """Whether there is no F for a reason, and it is not only not resolved."""
    return reason.tells_of(Code.NO_PROBLEM) or reason.code in _INFINITE


_INFINITE = (Code.TAILS, Code.INFINITE_VARIANCE)


def _nearest(distance: Distance, axes: Sequence[Axis], units: FloatArray) -> Sample | Absent:
    """The point F = 0 that is nearest to the problem."""
    low, high = np.array([axis.start for axis in axes]), np.array([axis.stop for axis in axes])
    here = np.array([float(distance.problem.values[axis.key]) for axis in axes])
    search = Search(distance, here, units, (low, high))
    start = np.clip(here, low, high)
    if (found := search.from_point(start)) is not None:
        return found
    from scipy.stats import qmc  # not before it is needed, as it takes a while

    corners, inner = product((0.0, 1.0), repeat=len(axes)), qmc.LatinHypercube(len(axes), seed=0)
    shares = [*map(np.array, corners), *inner.random(POINTS * len(axes))]
    places = [start, *(np.array([axis.value(u) for axis, u in zip(axes, each, strict=True)]) for each in shares)]
    samples = [sample for sample in map(search.at, places) if sample is not None]
    if samples:
        best = min(samples, key=lambda each: abs(each.value))
        others = [each for each in samples if (each.value < 0) != (best.value < 0)]
        if others:
            step = min((each.at - best.at for each in others), key=lambda step: float(np.linalg.norm(step / units)))
            path = _Path(distance, lambda u: best.at + u * step, lambda u: step)
            path.at(1.0)
            on_path = path.root(0.0)
            best = best if on_path is None else on_path
        if (found := search.from_point(best.at)) is not None:
            return found
        if others:
            raise NotConverged(
                Message(Code.DESIGN_GAPS, target=str(distance.target), reason=Message(Code.NEWTON_UNSETTLED))
            )
    return _unreached(distance, axes, samples, search.reasons)


class Search:
    """The quadratic problems one after the other.

    Args:
        distance: F.
        origin: θ⁰.
        units: s.
        limits: the least and the largest θ.
    """

    def __init__(
        self, distance: Distance, origin: FloatArray, units: FloatArray, limits: tuple[FloatArray, FloatArray]
    ) -> None:
        self._distance, self._origin, self._units = distance, origin, units
        self._limits, self._known = limits, dict[tuple[float, ...], Sample | None]()
        self._low, self._high = ((limit - origin) / units for limit in limits)
        self.reasons, self._norm = list[Message](), 1.0

    def at(self, theta: FloatArray) -> Sample | None:
        """F at θ; None where there is none."""
        key = tuple(theta.tolist())
        if key not in self._known:
            try:
                self._known[key] = self._distance(theta)
            except FpsolveError as failure:
                self._known[key] = None
                self.reasons.append(failure.message)
        return self._known[key]

    def from_point(self, theta: FloatArray) -> Sample | None:
        """The nearest point by steps from θ; None where they lead nowhere."""
        if (sample := self.at(theta)) is None:
            return None
        hessian, self._norm = np.eye(theta.size), float(np.linalg.norm(self._reduced(sample)[1])) or 1.0
        for _ in range(MOST_STEPS):
            x, slope = self._reduced(sample)
            room = self._low - x, self._high - x
            step, multiplier = _quadratic(hessian, x, slope, -sample.value, room)
            share = float(np.max(np.abs(step))) / max(1.0, float(np.max(np.abs(x))))
            if share <= SAME and _is_close(sample):
                return sample
            new = self._shorter(sample, step, is_small=share <= SMALL)
            if new is None:
                return sample if _is_close(sample) else None
            moved, other = self._reduced(new)
            hessian = _updated(hessian, moved - x, moved - x + multiplier * (other - slope))
            sample = new
        return None

    def _reduced(self, sample: Sample) -> tuple[FloatArray, FloatArray]:
        """x and ∂F/∂x."""
        return (sample.at - self._origin) / self._units, sample.gradient * self._units

    def _shorter(self, sample: Sample, step: FloatArray, *, is_small: bool) -> Sample | None:
        """The end of a step, halved until it is better than its start; None where no share of it is.

        That of a small step is better, too, where |F| is by far less.
        """
        for _ in range(MOST_HALVINGS):
            new = self.at(np.clip(sample.at + step * self._units, *self._limits))
            is_better = new is not None and new is not sample and self._merit(new) < self._merit(sample)
            if new is not None and (is_better or (is_small and abs(new.value) < 0.25 * abs(sample.value))):
                return new
            step = 0.5 * step
        return None

    def _merit(self, sample: Sample) -> float:
        """½|x|² where the linear F is 0, and the square of F, over that of the first gradient.

        Newton's step to there leaves alone what is at an end of its range.
        """
        x, slope = self._reduced(sample)
        is_free = (sample.at > self._limits[0]) & (sample.at < self._limits[1])
        slope = np.where(is_free, slope, 0.0) if np.any(is_free) else slope
        norm = float(slope @ slope)
        if not norm > 0:
            return math.inf
        back = sample.value / norm * slope
        return 0.5 * float((x - back) @ (x - back)) + PENALTY * (sample.value / self._norm) ** 2


def _quadratic(
    hessian: FloatArray, x: FloatArray, slope: FloatArray, wanted: float, room: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, float]:
    """The d with the least ½dᵀBd + xᵀd of those with slope·d = wanted in a box, and the multiplier.

    Where no d in the box has that slope·d, it is the one that comes nearest to it.
    """
    low, high = room
    farthest = np.where(slope * wanted > 0, high, np.where(slope * wanted < 0, low, 0.0))
    if abs(float(slope @ farthest)) <= abs(wanted):
        return farthest, 0.0
    n, best = x.size, (math.inf, farthest, 0.0)
    for ends in product((None, low, high), repeat=n):
        free = [i for i in range(n) if ends[i] is None]
        if not free:
            continue
        d = np.array([0.0 if end is None else end[i] for i, end in enumerate(ends)])
        size = len(free)
        matrix = np.zeros((size + 1, size + 1))
        matrix[:size, :size] = hessian[np.ix_(free, free)]
        matrix[:size, size] = matrix[size, :size] = slope[free]
        right = np.append(-x[free] - (hessian @ d)[free], wanted - slope @ d)
        try:
            *inner, multiplier = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            continue
        d[free] = inner
        slack = 1e-12 * (high - low)
        value = float(0.5 * d @ hessian @ d + x @ d)
        if np.all((d >= low - slack) & (d <= high + slack)) and value < best[0]:
            best = value, np.clip(d, low, high), float(multiplier)
    return best[1], best[2]


def _updated(hessian: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """BFGS, damped so that it stays positive (Powell)."""
    image = hessian @ step
    curvature, known = float(step @ change), float(step @ image)
    if not known > 0:
        return hessian
    if curvature < 0.2 * known:
        share = 0.8 * known / (known - curvature)
        change = share * change + (1 - share) * image
    return hessian - np.outer(image, image) / known + np.outer(change, change) / float(step @ change)
