"""Special points of a curve F(u, v) = 0: folds, values of a coordinate that are asked for, crossings of two curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fpsolve.analysis.continuation import PIECES, Point, Trace, correct, correct_on_line
from fpsolve.analysis.scan import Field, Sample
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError, NotConverged

EQUAL = 1e-9
"""Distance of two points that are one, in sides of the square, and in ways between two points of a curve."""
FLAT = 1e-6
"""Largest component of a tangent that has no sign: along a straight line it is rounding."""
MOST_STEPS = 12
"""Largest number of steps of Newton's method to a crossing."""
Found = TypeVar("Found")
Placed = tuple[float, Point]
"""A point, and its place: 2.5 is half way between the points 2 and 3 of a branch."""


def with_folds(field: Field, trace: Trace, names: tuple[str, str]) -> Trace:
    """A branch with the points at which it turns back in u, or in v, for which it has names."""
    new: list[Placed] = []
    for axis in (0, 1):
        along = np.array([point.sample.tangent[axis] for point in trace.points])
        along[np.abs(along) < FLAT] = 0
        for span in _sign_changes(along, trace.closed):
            fold = _or_none(_sign_change, field, trace, span, lambda sample, axis=axis: float(sample.tangent[axis]))
            if fold is not None:
                new.append((fold[0], Point(fold[1], f"fold in {names[axis]}")))
    return with_points(trace, new)


def with_values(field: Field, trace: Trace, axis: int, values: Sequence[tuple[float, str]]) -> Trace:
    """A branch with its points where u, or v, has certain values, each with its label."""
    new: list[Placed] = []
    for value, label in values:
        beyond = np.array([point.sample.at[axis] for point in trace.points]) - value
        beyond[np.abs(beyond) < EQUAL] = 0
        new += [(float(i), Point(trace.points[i].sample, label)) for i in np.flatnonzero(beyond == 0)]
        for i, j in _sign_changes(beyond, trace.closed):
            share = beyond[i] / (beyond[i] - beyond[j % beyond.size])
            found = _or_none(_value_on, field, trace, i, share, axis, value) if j == i + 1 else None
            if found is not None:
                new.append((found[0], Point(found[1], label)))
    return with_points(trace, new)


def crossings(one: Trace, other: Trace, fields: tuple[Field, Field]) -> Iterator[tuple[Placed, Placed]]:
    """The points that two branches have in common: the place and F on each of them, without labels."""
    a, b = one.fine, other.fine
    known: list[FloatArray] = []
    for i in range(len(a) - 1):
        for j, shares in _meetings(a[i], a[i + 1] - a[i], b):
            guess, way = a[i] + shares[0] * (a[i + 1] - a[i]), PIECES * float(np.linalg.norm(a[i + 1] - a[i]))
            samples = _or_none(_crossing, fields, guess)
            if samples is None or np.linalg.norm(samples[0].at - guess) > 0.5 * way:
                continue
            if all(np.linalg.norm(samples[0].at - at) > 10 * EQUAL for at in known):
                known.append(samples[0].at)
                yield ((i + shares[0]) / PIECES, Point(samples[0])), ((j + shares[1]) / PIECES, Point(samples[1]))


def with_points(trace: Trace, new: Sequence[Placed]) -> Trace:
    """A branch with further points; one that is there already only gets its label."""
    placed: list[Placed] = [(float(i), point) for i, point in enumerate(trace.points)]
    for place, point in new:
        k = int(np.argmin([np.linalg.norm(each.sample.at - point.sample.at) for _, each in placed]))
        if np.linalg.norm(placed[k][1].sample.at - point.sample.at) < EQUAL:
            labels = [*placed[k][1].label.split("; "), *point.label.split("; ")]
            label = "; ".join(dict.fromkeys(each for each in labels if each))
            known = placed[k][1]
            placed[k] = placed[k][0], Point(known.sample if known.label else point.sample, label)
        else:
            placed.append((place, point))
    return replace(trace, points=tuple(point for _, point in sorted(placed, key=lambda each: each[0])))


def _sign_change(
    field: Field, trace: Trace, span: tuple[int, int], component: Callable[[Sample], float]
) -> tuple[float, Sample] | None:
    """The place between two points of a branch where something changes its sign, and F there."""
    from scipy.optimize import brentq  # which takes long to import

    def at(place: float) -> Sample:
        i = min(int(place), span[1] - 1)
        k = i % len(trace.points)
        sample = correct(field, trace.between(k, place - i), trace.points[k].sample.tangent)
        if sample is None:
            raise NotConverged("Newton's method does not settle")
        return sample

    if component(at(span[0])) * component(at(span[1])) >= 0:
        return None
    place = float(brentq(lambda place: component(at(place)), *span, xtol=EQUAL))
    return place % len(trace.points), at(place)


def _value_on(field: Field, trace: Trace, i: int, share: float, axis: int, value: float) -> tuple[float, Sample] | None:
    """The point where u, or v, has a value, about at a share of the way from the point i to the next."""
    guess = trace.between(i, share)
    size = float(np.linalg.norm(trace.between(i, 1.0) - trace.between(i, 0.0)))
    direct = _or_none(correct_on_line, field, axis, value, guess)
    if direct is not None and np.linalg.norm(direct.at - guess) < 0.1 * size:
        return i + share, direct
    found = _sign_change(field, trace, (i, i + 1), lambda sample: float(sample.at[axis]) - value)
    if found is None:
        return None
    exact = _or_none(correct_on_line, field, axis, value, found[1].at)
    if exact is not None and np.linalg.norm(exact.at - found[1].at) < 0.1 * size:
        return found[0], exact
    return found


def _crossing(fields: tuple[Field, Field], at: FloatArray) -> tuple[Sample, Sample] | None:
    """F = G = 0 near a point, by Newton's method; None where there is none, or the curves only touch."""
    for _ in range(MOST_STEPS):
        first, second = (field(at) for field in fields)
        if first.is_zero and second.is_zero:
            return None if abs(np.linalg.det([first.tangent, second.tangent])) < FLAT else (first, second)
        step = np.linalg.solve(np.stack([first.gradient, second.gradient]), [first.value, second.value])
        at = np.clip(at - step, 0, 1)
    return None


def _or_none(search: Callable[..., Found | None], *arguments: Any) -> Found | None:
    """What a search finds; None where F does not exist on its way."""
    try:
        return search(*arguments)
    except (FpsolveError, np.linalg.LinAlgError):
        return None


def _sign_changes(values: FloatArray, closed: bool) -> Iterator[tuple[int, int]]:
    """The neighbours between which a sequence changes its sign, passing over zeros; of a closed one beyond its end."""
    signed = np.flatnonzero(values)
    ahead = [*signed[1:], *(signed[:1] + values.size)] if closed else signed[1:]
    for i, j in zip(signed, ahead, strict=False):
        if values[i] * values[j % values.size] < 0:
            yield int(i), int(j)


def _meetings(start: FloatArray, way: FloatArray, line: FloatArray) -> Iterator[tuple[int, tuple[float, float]]]:
    """The segments of a polyline that cross a segment, or hardly miss it, and where on both."""
    starts, ways = line[:-1], np.diff(line, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = way[0] * ways[:, 1] - way[1] * ways[:, 0]
        gap = starts - start
        first = (gap[:, 0] * ways[:, 1] - gap[:, 1] * ways[:, 0]) / across
        second = (gap[:, 0] * way[1] - gap[:, 1] * way[0]) / across
    low, high = -0.01, 1.01
    for j in np.flatnonzero((first >= low) & (first <= high) & (second >= low) & (second <= high)):
        yield int(j), (float(np.clip(first[j], 0, 1)), float(np.clip(second[j], 0, 1)))
