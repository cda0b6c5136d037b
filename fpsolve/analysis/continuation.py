"""The curves F(u, v) = 0 in the unit square, by pseudo-arclength continuation with exact gradients.

From a point on a curve the next one is predicted by the cubic through the last two points and their tangents, and
corrected by Newton's method on F = 0 and the distance along the tangent (H. B. Keller, 1977). A step follows from the
angle by which the curve turns, and from what Newton's method needs; a correction that is not small beside the step is
refused, as it may lead to another curve. Curves are found by a scan: inside each square of a grid F is interpolated
from values and gradients, and where that changes its sign a curve begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.curve import Field, Point, Sample, Trace, cubic
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError

LONGEST, SHORTEST = 0.02, 1e-5
"""Steps, in sides of the square."""
MOST_TURN = 0.15
"""Of the tangent in one step, in radians."""
MOST_CORRECTIONS = 5
FARTHEST = 0.1
"""Way of Newton's method to a first point, in sides of the square."""
MOST_AWAY = 0.2
"""Of a point from where it was predicted, in steps."""
MOST_POINTS = 20_000
FINE = 13
"""Points along a cell of a scan where its interpolation is looked at."""
BESIDE = 1e-8
"""A point that is outside by less is on the frame."""

FRAME = "leaves the frame"
"""The label of a point where a curve leaves the frame."""
UNSETTLED = "Newton's method does not settle on it"
TOO_SHARP = "it turns too sharply, as where it meets another branch"


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
        """F in the cell of the nodes (i, j) to (i + 1, j + 1), s and t in [0, 1], by bicubic interpolation.

        The mixed derivatives are those by which it is exact for all cubic F (A. Adini, 1960).
        """
        size = self.nodes[i + 1] - self.nodes[i], self.nodes[j + 1] - self.nodes[j]
        values, slopes = self.values[i : i + 2, j : j + 2], self.gradients[i : i + 2, j : j + 2] * size
        flat = values[1, 1] - values[1, 0] - values[0, 1] + values[0, 0]
        total = np.zeros(np.broadcast_shapes(s.shape, t.shape))
        for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
            (hold_s, rise_s), (hold_t, rise_t) = _hermite(s, a), _hermite(t, b)
            twist = slopes[a, 1, 0] - slopes[a, 0, 0] + slopes[1, b, 1] - slopes[0, b, 1] - flat
            total = total + values[a, b] * hold_s * hold_t + twist * rise_s * rise_t
            total = total + slopes[a, b, 0] * rise_s * hold_t + slopes[a, b, 1] * hold_s * rise_t
        return total

    def __call__(self, at: FloatArray) -> Sample:
        """Interpolated F."""
        cell = np.clip(np.searchsorted(self.nodes, at, side="right") - 1, 0, self.nodes.size - 2)
        size, step = self.nodes[cell + 1] - self.nodes[cell], 1e-5
        s, t = ((at - self.nodes[cell]) / size)[:, None] + step * np.array([[0, 1, -1, 0, 0], [0, 0, 0, 1, -1]])
        value, right, left, up, down = self.between(int(cell[0]), int(cell[1]), s, t)
        gradient = np.array([right - left, up - down]) / (2 * step * size)
        return Sample(at, float(value), gradient, 0.0, float(np.nanmax(np.abs(self.values))))

    def seeds(self) -> Iterator[FloatArray]:
        """Points near which F changes its sign: inside the cells, or beside missing nodes on their edges."""
        fine = np.linspace(0, 1, FINE)
        s, t, half = fine[:, None], fine[None, :], 0.5 * fine[1]
        for i in range(self.nodes.size - 1):
            for j in range(self.nodes.size - 1):
                corner, size = self.nodes[[i, j]], self.nodes[[i + 1, j + 1]] - self.nodes[[i, j]]
                inside = self.between(i, j, s, t)
                if np.isnan(inside).any():
                    inside, middle = self.values[i : i + 2, j : j + 2], (np.array([0.0, 1.0]), 0.5)
                else:
                    middle = fine, half
                yield from (corner + size * place for place in _changes(inside, *middle))


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
    """Every branch that a scan shows, one after the other.

    A closed one is seen for certain if a circle inside it is wider than the diagonal of a cell of the finer grid, 1/100
    of the square for 13 nodes, and its cell misses no node.
    """
    known: list[Trace] = []
    near = 0.25 / ((scan.nodes.size - 1) * (FINE - 1))
    for seed in scan.seeds():
        rough = begun(scan, seed)
        if rough is not None and any(trace.holds(rough, near) for trace in known):
            continue
        start = begun(field, seed if rough is None else rough.at)
        if start is None or any(trace.holds(start) for trace in known):
            continue
        known.append(traced(field, start, longest))
        yield known[-1]


def begun(field: Field, at: FloatArray) -> Sample | None:
    """A point F = 0 near a point: on the gradient, or where that leads out of the square, beside it or above it."""
    for along in (None, np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        try:
            if (sample := corrected(field, at, along)) is not None:
                return sample
        except FpsolveError:
            continue
    return None


def corrected(field: Field, at: FloatArray, along: FloatArray | None = None) -> Sample | None:
    """The point F = 0 near a point, on the normal to `along`, or without it on the gradient; None where there is none.

    Raises:
        FpsolveError: F does not exist on the way.
    """
    start = at
    for _ in range(MOST_CORRECTIONS):
        if not _inside(at) or np.linalg.norm(at - start) > FARTHEST:
            return None
        sample = field(np.clip(at, 0, 1))
        if sample.is_zero:
            return sample if np.any(sample.gradient) else None
        direction = sample.gradient if along is None else np.array([-along[1], along[0]])
        slope = float(sample.gradient @ direction)
        if slope == 0:
            return None
        at = sample.at - sample.value / slope * direction
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
    middle = forward[0] if forward[0].label else backward[0]
    obstacles = tuple(each for each in (other, obstacle) if each)
    return Trace((*reversed(backward[1:]), middle, *forward[1:]), obstacles=obstacles)


def _half(field: Field, start: Sample, sign: float, longest: float) -> tuple[list[Point], bool, str]:
    """Points from a start on in one direction, whether they come back to it, and why they end inside of the square."""
    points, step = [Point(start)], 0.25 * longest
    last, before = start, None
    while len(points) < MOST_POINTS:
        at, reason = _predicted(last, before, sign * step), UNSETTLED
        try:
            sample = _near(field, last, at)
            is_leaving = sample is None and bool(np.any((at < 0) | (at > 1)))
            sample = _landed(field, last, at) if is_leaving else sample
        except FpsolveError as failure:
            sample, reason = None, str(failure)
        turn = 0.0 if sample is None else _angle(last.tangent, sample.tangent)
        if sample is None or turn > 2 * MOST_TURN:
            step /= 3
            if step < SHORTEST:
                return points, False, TOO_SHARP if sample is not None else reason
            continue
        if len(points) > 2 and _passes(last.at, sample, start):
            return points, True, ""
        if is_leaving:
            if np.linalg.norm(sample.at - last.at) < BESIDE:
                points.pop()
            points.append(Point(sample, FRAME))
            return points, False, ""
        points.append(Point(sample))
        before, last = last, sample
        step = min(longest, step * min(2.0, MOST_TURN / max(turn, 1e-3)))
    return points, False, f"it has more than {MOST_POINTS} points"


def _predicted(last: Sample, before: Sample | None, step: float) -> FloatArray:
    """A step further, on the cubic through the last two points with their tangents."""
    sign = math.copysign(1.0, step)
    if before is None:
        return last.at + step * last.tangent
    share = 1 + abs(step) / float(np.linalg.norm(last.at - before.at))
    return cubic(before.at, last.at, sign * before.tangent, sign * last.tangent, share)


def _near(field: Field, last: Sample, at: FloatArray) -> Sample | None:
    """The point of the curve beside a predicted one; None where it is not close to that."""
    sample = corrected(field, at, last.tangent)
    if sample is None or np.linalg.norm(sample.at - at) > MOST_AWAY * np.linalg.norm(at - last.at):
        return None
    return sample


def _landed(field: Field, last: Sample, beyond: FloatArray) -> Sample | None:
    """The point where a curve leaves the square on its way to a point beyond; None where that is not clear."""
    way = beyond - last.at
    least = 0.0 if _inside(beyond) else 0.5 * BESIDE
    sides = [(k, float(side)) for k in (0, 1) for side in (0, 1) if (beyond[k] - side) * (side - 0.5) > least]
    for share, axis, side in sorted(((side - last.at[axis]) / way[axis], axis, side) for axis, side in sides):
        guess = np.clip(last.at + share * way, 0, 1)
        sample = on_line(field, axis, side, guess)
        if sample is not None and np.linalg.norm(sample.at - guess) <= 0.5 * np.linalg.norm(way):
            return sample
    return None


def _changes(values: FloatArray, shares: FloatArray, half: float) -> Iterator[FloatArray]:
    """Half-way between neighbours in a table of F over shares of a cell that differ in sign, or of which one is 0."""
    signs = np.sign(values)
    for k, m in np.argwhere(abs(signs[1:] - signs[:-1]) > 0):
        yield np.array([shares[k] + half, shares[m]])
    for k, m in np.argwhere(abs(signs[:, 1:] - signs[:, :-1]) > 0):
        yield np.array([shares[k], shares[m] + half])


def _hermite(x: FloatArray, end: int) -> tuple[FloatArray, FloatArray]:
    """The cubics on [0, 1] that have the value, or the slope, 1 at one end, and 0 else."""
    y = 1 - x if end else x
    hold, rise = (1 + 2 * y) * (1 - y) ** 2, y * (1 - y) ** 2
    return hold, -rise if end else rise


def _inside(at: FloatArray) -> bool:
    """Whether a point is in the square, but for rounding."""
    return bool(np.all((at >= -BESIDE) & (at <= 1 + BESIDE)))


def _angle(one: FloatArray, other: FloatArray) -> float:
    return math.acos(float(np.clip(one @ other, -1, 1)))


def _passes(last: FloatArray, sample: Sample, start: Sample) -> bool:
    """Whether the way from a point to a sample passes a start in the direction in which the curve left it."""
    way = sample.at - last
    along, size = float((start.at - last) @ way), float(way @ way)
    is_near = np.linalg.norm(size * (start.at - last) - along * way) < 0.1 * size**1.5
    return 0 <= along <= size and bool(is_near) and _angle(sample.tangent, start.tangent) < 2 * MOST_TURN
