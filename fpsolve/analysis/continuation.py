"""The curves F(u, v) = 0 in the unit square, by pseudo-arclength continuation with exact gradients.

From a point on a curve the next one is predicted by the cubic through the last two points and their tangents, and
corrected by Newton's method on F = 0 and the distance along the tangent (H. B. Keller, 1977). A step follows from the
angle by which the curve turns, and from what Newton's method needs; a correction that is not small beside the step is
refused, as it may lead to another curve. Curves begin where a scan changes its sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fpsolve.analysis.scan import Field, Sample, Scan
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message

LONGEST = 0.02
"""Longest step unless another is asked for, in sides of the square."""
SHORTEST = 1e-5
"""Step, in sides of the square, below which a branch ends."""
MOST_TURN = 0.15
"""Largest turn of the tangent in one step, in radians."""
MOST_CORRECTIONS = 6
"""Largest number of corrections; at a zero without a gradient each leaves a quarter of F."""
FARTHEST = 0.1
"""Longest way of Newton's method to a first point, in sides of the square."""
CLOSED = 0.1
"""Distance from the first point at which a curve has come back to it, in steps."""
MOST_AWAY = 0.2
"""Largest distance of a point from where it was predicted, in steps, beyond what both points may be off."""
EXTRAPOLATED = 28
"""How many times a cubic by two points has the error of the first one at twice their distance beyond."""
MOST_POINTS = 20_000
"""Largest number of points of half a branch."""
BESIDE = 1e-8
"""Distance outside of the frame, in sides of the square, up to which a point is on it."""
SAME = 1e-3
"""Distance, in sides of the square, in which a curve that runs the same way is taken for one that is known."""
DOUBT = 10.0
"""What the second derivatives of F are, over those along a curve, at most."""
NEGLIGIBLE = 0.01
"""Share of |F| up to which it is 0 that may be left without being solved."""
PIECES = 8
"""Number of pieces into which the cubic between two points of a branch is divided."""

FRAME = "leaves the frame"
"""The label of a point where a curve leaves the frame."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One branch of a curve.

    Attributes:
        points: along it, F > 0 on its left.
        closed: whether the last is followed by the first.
        obstacles: why it ends inside of the square, if it does.
    """

    points: tuple[Sample, ...]
    closed: bool = False
    obstacles: tuple[Message, ...] = ()

    @cached_property
    def fine(self) -> FloatArray:
        """(u, v) on the cubics through the points with their tangents, `PIECES` from one to the next."""
        count = max(len(self.points) - 1 + self.closed, 1)
        return np.array([self.between(k / PIECES) for k in range(count * PIECES + 1)])

    def between(self, place: float) -> FloatArray:
        """About the point at a place: 2.5 is half way between the points 2 and 3."""
        i = int(place)
        one, other = (self.points[k % len(self.points)] for k in (i, i + 1))
        return cubic(one.at, other.at, one.tangent, other.tangent, place - i)

    def step(self, place: float) -> float:
        """The distance of the points before and after a place."""
        return float(np.linalg.norm(self.between(int(place) + 1) - self.between(int(place))))

    def holds(self, sample: Sample, within: float = SAME) -> bool:
        """Whether it runs through a point of a curve, or near to it the same way; F > 0 left of both."""
        start, way = self.fine[:-1], np.diff(self.fine, axis=0)
        share = np.sum((sample.at - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-300)
        gaps = np.linalg.norm(start + np.clip(share, 0, 1)[:, None] * way - sample.at, axis=1)
        return bool(np.any((gaps < within) & (way @ sample.tangent >= 0)))


def cubic(start: FloatArray, end: FloatArray, out: FloatArray, into: FloatArray, share: float) -> FloatArray:
    """On the cubic from a point to another with unit tangents there; shares beyond 1 continue it."""
    rise = end - start
    length = np.linalg.norm(rise)
    quadratic, third = 3 * rise - length * (2 * out + into), length * (out + into) - 2 * rise
    return start + share * (length * out + share * (quadratic + share * third))


def find_branches(
    field: Field, scan: Scan, longest: float = LONGEST, stepped: Callable[[], None] = lambda: None
) -> Iterator[Trace]:
    """Every branch that a scan shows, one after the other; each of its points is told as it is found.

    A closed one is seen for certain if a circle inside it is wider than the diagonal of a cell of the finer grid, 1/100
    of the square for 13 nodes, and its cell misses no node.
    """
    known, tried = list[Trace](), list[Sample]()
    near = 0.25 / (scan.nodes.size - 1)
    for seed in scan.seeds():
        if any(trace.holds(seed, 0.5 * near) for trace in known):
            continue
        if any(np.linalg.norm(each.at - seed.at) < near and each.gradient @ seed.gradient > 0 for each in tried):
            continue
        tried.append(seed)
        start = find_zero(field, seed.at)
        if start is not None and not any(trace.holds(start) for trace in known):
            known.append(trace_branch(field, start, longest, stepped))
            yield known[-1]


def with_branch(known: tuple[Trace, ...], trace: Trace) -> tuple[Trace, ...]:
    """A branch more, without those that broke off somewhere on it."""
    left = (each for each in known if not each.obstacles or not all(map(trace.holds, each.points)))
    return (*left, trace)


def find_zero(field: Field, at: FloatArray) -> Sample | None:
    """A point F = 0 near a point: on the gradient, or where that leads out of the square, beside it or above it."""
    for along in (None, *np.eye(2)):
        with suppress(FpsolveError):
            if (sample := correct(field, at, along)) is not None:
                return sample
    return None


def correct(field: Field, at: FloatArray, along: FloatArray | None, last: Sample | None = None) -> Sample | None:
    """The point F = 0 near a point, on the normal to `along`, or without it on the gradient; None where there is none.

    A step of Newton's method is the last one where F is 0 to its error before it; or where hardly anything is left
    after it, by the second derivatives of F that its change of gradient from the last point of the curve shows.

    Raises:
        FpsolveError: F does not exist on the way.
    """
    start = at
    for _ in range(MOST_CORRECTIONS):
        if not _inside(at) or np.linalg.norm(at - start) > FARTHEST:
            return None
        sample = field(np.clip(at, 0, 1))
        direction = sample.gradient if along is None else np.array([-along[1], along[0]])
        if (slope := float(sample.gradient @ direction)) == 0:
            return sample if sample.is_zero and np.any(sample.gradient) else None
        step = sample.value / slope
        at, left = sample.at - step * direction, 0.0
        if not sample.is_zero:  # beyond that F is linear
            left = _bend(last, sample) * step**2
        if left <= NEGLIGIBLE * sample.nothing and _inside(at):
            return sample._replace(at=np.clip(at, 0, 1), value=0.0, error=sample.error + left)
    return None


def correct_on_line(field: Field, axis: int, value: float, guess: FloatArray) -> Sample | None:
    """The point F = 0 where u, or v, has a value; None where there is none near the guess."""
    at = guess.copy()
    at[axis] = value
    return correct(field, at, np.eye(2)[axis])


def trace_branch(field: Field, start: Sample, longest: float, stepped: Callable[[], None]) -> Trace:
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
) -> tuple[list[Sample], bool, Message | None]:
    """Points from a start on in one direction, whether they come back to it, and why they end inside of the square."""
    points, step = [start], 0.25 * longest
    last, before = start, None
    while len(points) < MOST_POINTS:
        if before is None or EXTRAPOLATED * last.width > MOST_AWAY * step:
            at = last.at + sign * step * last.tangent
        else:
            share = 1 + step / float(np.linalg.norm(last.at - before.at))
            at = cubic(before.at, last.at, sign * before.tangent, sign * last.tangent, share)
        is_leaving, reason = not _inside(at), Message(Code.NEWTON_UNSETTLED)
        try:
            sample = _exit(field, last, at) if is_leaving else _next(field, last, at)
        except FpsolveError as failure:
            sample, reason = None, failure.message
        turn = 0.0 if sample is None else math.acos(np.clip(last.tangent @ sample.tangent, -1.0, 1.0))
        if sample is None or turn > 2 * MOST_TURN:
            step /= 3
            if step < SHORTEST:
                return points, False, reason if sample is None else Message(Code.TOO_SHARP)
            continue
        way = float(np.linalg.norm(sample.at - last.at))
        if len(points) > 2 and Trace((last, sample)).holds(start, CLOSED * way):
            return points, True, None
        if is_leaving:
            if way < BESIDE:
                points.pop()
            else:
                stepped()
            points.append(sample._replace(label=FRAME))
            return points, False, None
        points.append(sample)
        stepped()
        before, last = last, sample
        step = min(longest, step * min(2.0, MOST_TURN / max(turn, 1e-3)))
    return points, False, Message(Code.TOO_LONG, count=MOST_POINTS)


def _next(field: Field, last: Sample, at: FloatArray) -> Sample | None:
    """The point that is predicted at a place; None where it is so far that it may be one of another curve."""
    sample = correct(field, at, last.tangent, last)
    if sample is None:
        return None
    most = MOST_AWAY * np.linalg.norm(at - last.at) + last.width + sample.width
    return sample if np.linalg.norm(sample.at - at) <= most else None


def _bend(last: Sample | None, sample: Sample) -> float:
    """More than half of the second derivatives of F is likely to be, by two points near a curve; infinite for one."""
    if last is None:
        return math.inf
    change = np.linalg.norm(sample.gradient - last.gradient) / np.linalg.norm(sample.at - last.at)
    return DOUBT * max(float(change), float(np.linalg.norm(sample.gradient)))


def _exit(field: Field, last: Sample, beyond: FloatArray) -> Sample | None:
    """The point where a curve leaves the square on its way to a point beyond; None where that is not clear."""
    way = beyond - last.at
    sides = [(k, float(side)) for k in (0, 1) for side in (0, 1) if (beyond[k] - side) * (2 * side - 1) > BESIDE]
    for share, axis, side in sorted(((side - last.at[axis]) / way[axis], axis, side) for axis, side in sides):
        guess = np.clip(last.at + share * way, 0, 1)
        sample = correct_on_line(field, axis, side, guess)
        if sample is not None and np.linalg.norm(sample.at - guess) <= 0.5 * np.linalg.norm(way):
            return sample
    return None


def _inside(at: FloatArray) -> bool:
    """Whether a point is in the square, but for rounding."""
    return bool(np.all((at >= -BESIDE) & (at <= 1 + BESIDE)))
