"""The curves F(u, v) = 0 in the unit square, by pseudo-arclength continuation with exact gradients.

From a point on a curve the next one is predicted by the cubic through the last two points and their tangents, and
corrected by Newton's method on F = 0 and the distance along the tangent (H. B. Keller, 1977). A step follows from the
angle by which the curve turns, and from what Newton's method needs. Curves are found by a scan: on each edge of a
grid, and inside each square, F is interpolated from values and gradients, and where that changes its sign a curve
begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError

LONGEST, SHORTEST = 0.02, 1e-5
"""Steps, in sides of the square."""
MOST_TURN = 0.15
"""Of the tangent in one step, in radians."""
MOST_CORRECTIONS = 5
MOST_POINTS = 20_000
FINE = 7
"""Points along a cell of a scan where its interpolation is looked at."""
SAME = 1e-3
"""Distance, in sides of the square, in which a curve is taken for one that is known."""
TOLERANCE = 1e-10
"""|F| over its scale on a curve; a tenth of what the solves of F leave."""


FRAME = "leaves the frame"
"""The label of a point where a curve leaves the frame."""


class Sample(NamedTuple):
    """F at a point.

    Attributes:
        at: (u, v).
        value: F.
        gradient: ∂F/∂(u, v), shape (2,).
        error: estimate of |error of F|.
        scale: the size of the terms of F before they cancel.
    """

    at: FloatArray
    value: float
    gradient: FloatArray
    error: float
    scale: float

    @property
    def is_zero(self) -> bool:
        return abs(self.value) <= max(TOLERANCE * self.scale, 0.1 * self.error)

    @property
    def tangent(self) -> FloatArray:
        """Along the curve, F > 0 on its left, of length 1."""
        along = np.array([self.gradient[1], -self.gradient[0]])
        return np.asarray(along / np.linalg.norm(along))

    @property
    def width(self) -> float:
        """|error of F|/|∇F|: how far the curve may be off."""
        return (self.error + abs(self.value)) / float(np.linalg.norm(self.gradient))


Field = Callable[[FloatArray], Sample]
"""F; raises `FpsolveError` where there is none."""


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a curve.

    Attributes:
        sample: F there.
        label: what is special about it; empty for an ordinary one.
    """

    sample: Sample
    label: str = ""


@dataclass(frozen=True, eq=False)
class Trace:
    """One branch of a curve.

    Attributes:
        points: along it.
        closed: whether the last is followed by the first.
        obstacles: why it ends inside of the square, if it does.
    """

    points: tuple[Point, ...]
    closed: bool = False
    obstacles: tuple[str, ...] = ()

    @property
    def at(self) -> FloatArray:
        """(u, v), shape (n, 2); of a closed one the first again at the end."""
        places = [point.sample.at for point in self.points]
        return np.array(places + places[:1] * self.closed)

    def holds(self, at: FloatArray, within: float = SAME) -> bool:
        """Whether a point lies on it, or near to it."""
        return bool(_distance(self.at, at) < within)


@dataclass(frozen=True, eq=False)
class Scan:
    """F on a grid of the square.

    Attributes:
        nodes: of each direction, shape (n,).
        values: F, shape (n, n), u first; NaN where it does not exist.
        gradients: ∂F/∂(u, v), shape (n, n, 2).
        reasons: why F does not exist at some nodes, each once.
    """

    nodes: FloatArray
    values: FloatArray
    gradients: FloatArray
    reasons: tuple[str, ...] = ()

    def between(self, i: int, j: int, s: FloatArray, t: FloatArray) -> FloatArray:
        """F in the cell of the nodes (i, j) to (i + 1, j + 1), s and t in [0, 1], by bicubic interpolation."""
        size = self.nodes[i + 1] - self.nodes[i], self.nodes[j + 1] - self.nodes[j]
        total = np.zeros(np.broadcast_shapes(s.shape, t.shape))
        for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
            slope = self.gradients[i + a, j + b]
            (hold_s, rise_s), (hold_t, rise_t) = _hermite(s, a), _hermite(t, b)
            total = total + self.values[i + a, j + b] * hold_s * hold_t
            total = total + size[0] * slope[0] * rise_s * hold_t + size[1] * slope[1] * hold_s * rise_t
        return total

    def seeds(self) -> Iterator[FloatArray]:
        """Points near which F changes its sign: on the edges of the cells, or inside."""
        fine = np.linspace(0, 1, FINE)
        s, t, half = fine[:, None], fine[None, :], 0.5 * fine[1]
        for i in range(self.nodes.size - 1):
            for j in range(self.nodes.size - 1):
                inside = self.between(i, j, s, t)
                places = [(fine[k] + half, fine[m]) for k, m in np.argwhere(inside[1:] * inside[:-1] <= 0)]
                places += [(fine[k], fine[m] + half) for k, m in np.argwhere(inside[:, 1:] * inside[:, :-1] <= 0)]
                corner, size = self.nodes[[i, j]], self.nodes[[i + 1, j + 1]] - self.nodes[[i, j]]
                yield from (corner + size * np.array(place) for place in places)


def scanned(field: Field, count: int, progress: Callable[[], None] = lambda: None) -> Scan:
    """F on a grid of count × count nodes, row after row to and fro, so that each is close to the one before."""
    nodes = np.linspace(0, 1, count)
    values, gradients, reasons = np.full((count, count), np.nan), np.full((count, count, 2), np.nan), dict[str, None]()
    for i in range(count):
        for j in range(count) if i % 2 == 0 else reversed(range(count)):
            try:
                sample = field(nodes[[i, j]])
                values[i, j], gradients[i, j] = sample.value, sample.gradient
            except FpsolveError as failure:
                reasons.setdefault(str(failure))
            progress()
    return Scan(nodes, values, gradients, tuple(reasons))


def found(field: Field, scan: Scan, longest: float = LONGEST) -> Iterator[Trace]:
    """Every branch that a scan shows, one after the other."""
    known: list[Trace] = []
    for seed in scan.seeds():
        if any(trace.holds(seed, 2 * longest) for trace in known):
            continue
        try:
            start = corrected(field, seed)
        except FpsolveError:
            continue
        if start is None or not _inside(start.at) or any(trace.holds(start.at) for trace in known):
            continue
        known.append(traced(field, start, longest))
        yield known[-1]


def corrected(field: Field, at: FloatArray, along: FloatArray | None = None) -> Sample | None:
    """The point F = 0 near a point, on the normal to `along`, or without it on the gradient; None where there is none.

    Raises:
        FpsolveError: F does not exist on the way.
    """
    start = at
    for _ in range(MOST_CORRECTIONS):
        if not _inside(at) or np.linalg.norm(at - start) > 5 * LONGEST:
            return None
        sample = field(at)
        if sample.is_zero:
            return sample
        direction = sample.gradient if along is None else np.array([-along[1], along[0]])
        slope = float(sample.gradient @ direction)
        if slope == 0:
            return None
        at = at - sample.value / slope * direction
    return None


def on_line(field: Field, axis: int, value: float, guess: FloatArray) -> Sample | None:
    """The point F = 0 where u, or v, has a value; None where there is none near the guess."""
    at = guess.copy()
    at[axis] = value
    along = np.zeros(2)
    along[axis] = 1.0
    return corrected(field, at, along)


def traced(field: Field, start: Sample, longest: float = LONGEST) -> Trace:
    """The whole branch through a point, within the square."""
    forward, closed, obstacle = _half(field, start, 1.0, longest)
    if closed:
        return Trace(tuple(forward), closed=True)
    backward, _, other = _half(field, start, -1.0, longest)
    obstacles = tuple(each for each in (other, obstacle) if each)
    return Trace((*reversed(backward[1:]), *forward), obstacles=obstacles)


def _half(field: Field, start: Sample, sign: float, longest: float) -> tuple[list[Point], bool, str]:
    """Points from a start on in one direction, whether they come back to it, and why they end inside of the square."""
    points, step = [Point(start)], 0.25 * longest
    last, before = start, None
    while len(points) < MOST_POINTS:
        at, reason = _predicted(last, before, sign * step), "Newton's method does not settle on it"
        try:
            sample = corrected(field, at, last.tangent) if _inside(at) else _landed(field, last, at)
        except FpsolveError as failure:
            sample, reason = None, str(failure)
        turn = math.inf if sample is None else _angle(last.tangent, sample.tangent)
        if sample is None or turn > 2 * MOST_TURN:
            step /= 3
            if step < SHORTEST:
                return points, False, reason
            continue
        if len(points) > 2 and _passes(last.at, sample.at, start.at):
            return points, True, ""
        points.append(Point(sample, "" if _inside(at) else FRAME))
        if not _inside(at):
            return points, False, ""
        before, last = last, sample
        step = min(longest, step * min(2.0, MOST_TURN / max(turn, 1e-3)))
    return points, False, f"it has more than {MOST_POINTS} points"


def _predicted(last: Sample, before: Sample | None, step: float) -> FloatArray:
    """A step further, on the cubic through the last two points with their tangents."""
    if before is None:
        return last.at + step * last.tangent
    length = float(np.linalg.norm(last.at - before.at))
    t, sign = step / length * math.copysign(1, step), math.copysign(1, step)
    slopes = sign * length * before.tangent, sign * length * last.tangent
    rise = last.at - before.at
    quadratic, cubic = 3 * rise - 2 * slopes[0] - slopes[1], slopes[0] + slopes[1] - 2 * rise
    x = 1 + abs(t)
    return np.asarray(before.at + slopes[0] * x + quadratic * x**2 + cubic * x**3)


def _landed(field: Field, last: Sample, beyond: FloatArray) -> Sample | None:
    """The point where a curve leaves the square on its way to a point beyond; None where that is not clear."""
    way = beyond - last.at
    sides = [(axis, float(side)) for axis in (0, 1) for side in (0, 1) if (beyond[axis] - side) * (side - 0.5) > 0]
    share, axis, side = min(((side - last.at[axis]) / way[axis], axis, side) for axis, side in sides)
    guess = np.clip(last.at + share * way, 0, 1)
    sample = on_line(field, axis, side, guess)
    if sample is None or np.linalg.norm(sample.at - last.at) > 2 * np.linalg.norm(way) + 1e-9:
        return None
    return sample


def _hermite(x: FloatArray, end: int) -> tuple[FloatArray, FloatArray]:
    """The cubics on [0, 1] that have the value, or the slope, 1 at one end, and 0 else."""
    y = 1 - x if end else x
    hold, rise = (1 + 2 * y) * (1 - y) ** 2, y * (1 - y) ** 2
    return hold, -rise if end else rise


def _inside(at: FloatArray) -> bool:
    return bool(np.all((at >= 0) & (at <= 1)))


def _angle(one: FloatArray, other: FloatArray) -> float:
    return math.acos(float(np.clip(one @ other, -1, 1)))


def _passes(start: FloatArray, end: FloatArray, at: FloatArray) -> bool:
    """Whether the way from start to end passes a point."""
    way = end - start
    share = float((at - start) @ way / (way @ way))
    return 0 <= share <= 1 and bool(np.linalg.norm(start + share * way - at) < 0.2 * np.linalg.norm(way))


def _distance(line: FloatArray, at: FloatArray) -> float:
    """Of a point from a polyline."""
    if len(line) == 1:
        return float(np.linalg.norm(line[0] - at))
    start, way = line[:-1], np.diff(line, axis=0)
    share = np.clip(np.sum((at - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-300), 0, 1)
    return float(np.min(np.linalg.norm(start + share[:, None] * way - at, axis=1)))
