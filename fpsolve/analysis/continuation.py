"""The curves F(u, v) = 0 in the unit square, by pseudo-arclength continuation with exact gradients.

From a point on a curve the next one is predicted by the cubic through the last two points and their tangents, and
corrected by Newton's method on F = 0 and the distance along the tangent (H. B. Keller, 1977). A step follows from the
angle by which the curve turns, and from what Newton's method needs; a correction that is not small beside the step is
refused, as it may lead to another curve. Curves begin where a scan changes its sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from fpsolve.analysis.curve import Field, Point, Sample, Trace, cubic
from fpsolve.analysis.scan import FINE, Scan
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message

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
BESIDE = 1e-8
"""A point that is outside by less is on the frame."""

FRAME = "leaves the frame"
"""The label of a point where a curve leaves the frame."""


def found(
    field: Field, scan: Scan, longest: float = LONGEST, stepped: Callable[[], None] = lambda: None
) -> Iterator[Trace]:
    """Every branch that a scan shows, one after the other; each of its points is told as it is found.

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
        known.append(traced(field, start, longest, stepped))
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


def traced(field: Field, start: Sample, longest: float = LONGEST, stepped: Callable[[], None] = lambda: None) -> Trace:
    """The whole branch through a point, within the square; `stepped` is called for each of its points."""
    stepped()
    forward, closed, obstacle = _half(field, start, 1.0, longest, stepped)
    if closed:
        return Trace(tuple(forward), closed=True)
    backward, _, other = _half(field, start, -1.0, longest, stepped)
    middle = forward[0] if forward[0].label else backward[0]
    obstacles = tuple(each for each in (other, obstacle) if each)
    return Trace((*reversed(backward[1:]), middle, *forward[1:]), obstacles=obstacles)


def _half(
    field: Field, start: Sample, sign: float, longest: float, stepped: Callable[[], None]
) -> tuple[list[Point], bool, Message | None]:
    """Points from a start on in one direction, whether they come back to it, and why they end inside of the square."""
    points, step = [Point(start)], 0.25 * longest
    last, before = start, None
    while len(points) < MOST_POINTS:
        at, reason = _predicted(last, before, sign * step), Message(Code.NEWTON_UNSETTLED)
        try:
            sample = _near(field, last, at)
            is_leaving = sample is None and bool(np.any((at < 0) | (at > 1)))
            sample = _landed(field, last, at) if is_leaving else sample
        except FpsolveError as failure:
            sample, reason = None, failure.message
        turn = 0.0 if sample is None else _angle(last.tangent, sample.tangent)
        if sample is None or turn > 2 * MOST_TURN:
            step /= 3
            if step < SHORTEST:
                return points, False, reason if sample is None else Message(Code.TOO_SHARP)
            continue
        if len(points) > 2 and _passes(last.at, sample, start):
            return points, True, None
        if is_leaving:
            if np.linalg.norm(sample.at - last.at) < BESIDE:
                points.pop()
            else:
                stepped()
            points.append(Point(sample, FRAME))
            return points, False, None
        points.append(Point(sample))
        stepped()
        before, last = last, sample
        step = min(longest, step * min(2.0, MOST_TURN / max(turn, 1e-3)))
    return points, False, Message(Code.TOO_LONG, count=MOST_POINTS)


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
