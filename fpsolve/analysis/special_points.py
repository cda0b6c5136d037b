"""Special points of a curve F(u, v) = 0: folds, values of a coordinate that are asked for, crossings of two curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.optimize import brentq

from fpsolve.analysis.continuation import Field, Point, Sample, Trace, corrected, on_line
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError, NotConverged

CLOSE = 1e-9
"""How well a fold is found, as a share of the way between two points of a curve."""
MOST_STEPS = 12
Found = TypeVar("Found")
Placed = tuple[float, Point]
"""A point, and its place: 2.5 is half way between the points 2 and 3 of a branch."""


def with_folds(field: Field, trace: Trace, names: tuple[str, str]) -> Trace:
    """A branch with the points at which it turns back in u, or in v, for which it has names."""
    tangents = np.array([point.sample.tangent for point in trace.points])
    new: list[Placed] = []
    for axis in (0, 1):
        for i, (start, end) in enumerate(_pairs(trace, tangents[:, axis])):
            if start * end < 0 and (fold := _fold(field, trace, i, axis)) is not None:
                new.append((fold[0], Point(fold[1], f"fold in {names[axis]}")))
    return with_points(trace, new)


def with_values(field: Field, trace: Trace, axis: int, values: Sequence[tuple[float, str]]) -> Trace:
    """A branch with its points where u, or v, has certain values, each with its label."""
    new: list[Placed] = []
    at = [point.sample.at[axis] for point in trace.points]
    for value, label in values:
        for i, (start, end) in enumerate(_pairs(trace, at)):
            if not min(start, end) <= value <= max(start, end) or start == end:
                continue
            share = (value - start) / (end - start)
            found = _tried(partial(on_line, field, axis, value, _between(trace, i, share)))
            if found is not None:
                new.append((i + share, Point(found, label)))
    return with_points(trace, new)


def crossings(one: Trace, other: Trace, fields: tuple[Field, Field]) -> Iterator[tuple[Placed, Placed]]:
    """The points that two branches have in common: the place and F on each of them, without labels."""
    a, b = one.at, other.at
    for i in range(len(a) - 1):
        for j, shares in _meetings(a[i], a[i + 1] - a[i], b):
            samples = _common(fields, a[i] + shares[0] * (a[i + 1] - a[i]))
            if samples is not None:
                yield (i + shares[0], Point(samples[0])), (j + shares[1], Point(samples[1]))


def with_points(trace: Trace, new: Sequence[Placed]) -> Trace:
    """A branch with further points; one that is there already only gets its label."""
    points = list(enumerate(trace.points))
    placed: list[Placed] = [(float(i), point) for i, point in points]
    for place, point in new:
        k = int(np.argmin([np.linalg.norm(each.sample.at - point.sample.at) for _, each in placed]))
        if np.linalg.norm(placed[k][1].sample.at - point.sample.at) < 1e-9:
            label = "; ".join(dict.fromkeys(each for each in (placed[k][1].label, point.label) if each))
            placed[k] = placed[k][0], Point(point.sample, label)
        else:
            placed.append((place, point))
    return replace(trace, points=tuple(point for _, point in sorted(placed, key=lambda each: each[0])))


def _fold(field: Field, trace: Trace, i: int, axis: int) -> tuple[float, Sample] | None:
    """Where the tangent has no component along an axis, between the points i and i + 1."""

    def at(share: float) -> Sample:
        found = corrected(field, _between(trace, i, share), trace.points[i].sample.tangent)
        if found is None:
            raise NotConverged("Newton's method does not settle")
        return found

    def component(share: float) -> float:
        return float(at(share).tangent[axis])

    def solve() -> tuple[float, Sample] | None:
        if component(0.0) * component(1.0) >= 0:
            return None
        share = float(brentq(component, 0.0, 1.0, xtol=CLOSE))
        return i + share, at(share)

    return _tried(solve)


def _common(fields: tuple[Field, Field], at: FloatArray) -> tuple[Sample, Sample] | None:
    """F = G = 0 near a point, by Newton's method."""

    def solve(at: FloatArray = at) -> tuple[Sample, Sample] | None:
        for _ in range(MOST_STEPS):
            first, second = (field(at) for field in fields)
            if first.is_zero and second.is_zero:
                return first, second
            step = np.linalg.solve(np.stack([first.gradient, second.gradient]), [first.value, second.value])
            at = np.clip(at - step, 0, 1)
        return None

    return _tried(solve)


def _tried(solve: Callable[[], Found | None]) -> Found | None:
    """What a search finds; None where F does not exist on its way."""
    try:
        return solve()
    except (FpsolveError, np.linalg.LinAlgError):
        return None


def _between(trace: Trace, i: int, share: float) -> FloatArray:
    """About the point between i and i + 1."""
    at = trace.at
    return np.asarray(at[i] + share * (at[i + 1] - at[i]))


def _pairs(trace: Trace, values: Sequence[float] | FloatArray) -> Iterator[tuple[float, float]]:
    """Values at neighbouring points."""
    cycle = [*values, *list(values)[:1]] if trace.closed else list(values)
    return pairwise(cycle)


def _meetings(start: FloatArray, way: FloatArray, line: FloatArray) -> Iterator[tuple[int, tuple[float, float]]]:
    """The segments of a polyline that cross a segment, and where on both."""
    starts, ways = line[:-1], np.diff(line, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = way[0] * ways[:, 1] - way[1] * ways[:, 0]
        gap = starts - start
        first = (gap[:, 0] * ways[:, 1] - gap[:, 1] * ways[:, 0]) / across
        second = (gap[:, 0] * way[1] - gap[:, 1] * way[0]) / across
    for j in np.flatnonzero((first >= 0) & (first < 1) & (second >= 0) & (second < 1)):
        yield int(j), (float(first[j]), float(second[j]))
