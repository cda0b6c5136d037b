"""Special points of a curve F(u, v) = 0: folds, values of a coordinate that are asked for, crossings of two curves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.optimize import brentq

from fpsolve.analysis.continuation import PIECES, Trace, correct, correct_on_line
from fpsolve.analysis.scan import Field, Sample
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.messages import Code, Message

EQUAL = 1e-9
"""Distance of two points that are one, in sides of the square, and in ways between two points of a curve."""
FLAT = 1e-6
"""Largest component of a tangent that has no sign: along a straight line it is rounding."""
MOST_STEPS = 12
"""Largest number of steps of Newton's method to a crossing."""
BY_A_HAIR = 0.01
"""How far two pieces may miss each other, over their lengths."""
Found = TypeVar("Found")
Placed = tuple[float, Sample]
"""A point, and its place: 2.5 is half way between the points 2 and 3 of a branch."""


def with_folds(field: Field, trace: Trace, names: tuple[str, str]) -> Trace:
    """A branch with the points at which it turns back in u, or in v, for which it has names."""
    new = []
    for axis in (0, 1):
        tangents = np.array([point.tangent[axis] for point in trace.points])
        tangents[np.abs(tangents) < FLAT] = 0
        for place in _roots(trace, tangents, lambda place: _on(field, trace, place).tangent, axis):
            if (sample := _or_none(_on, field, trace, place)) is not None:
                new.append((place, sample._replace(label=f"fold in {names[axis]}")))
    return with_points(trace, new)


def with_values(field: Field, trace: Trace, axis: int, values: Sequence[tuple[float, str]]) -> Trace:
    """A branch with its points where u, or v, has certain values, each with its label."""
    new = []
    for value, label in values:
        beyond = np.array([point.at[axis] for point in trace.points]) - value
        beyond[np.abs(beyond) < EQUAL] = 0
        new += [(float(i), trace.points[i]._replace(label=label)) for i in np.flatnonzero(beyond == 0)]
        for place in _roots(trace, beyond, trace.between, axis, value):
            guess = trace.between(place)
            sample = _or_none(correct_on_line, field, axis, value, guess)
            if sample is not None and np.linalg.norm(sample.at - guess) < 0.1 * trace.step(place):
                new.append((place, sample._replace(label=label)))
    return with_points(trace, new)


def crossings(one: Trace, other: Trace, fields: tuple[Field, Field]) -> Iterator[tuple[Placed, Placed]]:
    """The points that two branches have in common: the place and F on each of them, without labels."""
    known = list[FloatArray]()
    for i, j in _meetings(one.fine, other.fine):
        guess = one.between(i)
        samples = _or_none(_crossing, fields, guess)
        if samples is None or np.linalg.norm(samples[0].at - guess) > 0.5 * one.step(i):
            continue
        if all(np.linalg.norm(samples[0].at - at) > 10 * EQUAL for at in known):
            known.append(samples[0].at)
            yield (i, samples[0]), (j, samples[1])


def with_points(trace: Trace, new: Sequence[Placed]) -> Trace:
    """A branch with further points; one that is there already only gets its label."""
    placed = [(float(i), point) for i, point in enumerate(trace.points)]
    for place, point in new:
        k = int(np.argmin([np.linalg.norm(each.at - point.at) for _, each in placed]))
        if np.linalg.norm(placed[k][1].at - point.at) < EQUAL:
            at, known = placed[k]
            labels = dict.fromkeys(filter(None, (*known.label.split("; "), point.label)))
            placed[k] = at, (known if known.label else point)._replace(label="; ".join(labels))
        else:
            placed.append((place, point))
    return replace(trace, points=tuple(point for _, point in sorted(placed, key=lambda each: each[0])))


def _on(field: Field, trace: Trace, place: float) -> Sample:
    """F at a place of a branch. Raises `FpsolveError`."""
    tangent = trace.points[int(place) % len(trace.points)].tangent
    if (sample := correct(field, trace.between(place), tangent)) is None:
        raise NotConverged(Message(Code.NEWTON_UNSETTLED))
    return sample


def _crossing(fields: tuple[Field, Field], at: FloatArray) -> tuple[Sample, Sample] | None:
    """F = G = 0 near a point, by Newton's method; None where there is none, or the curves only touch."""
    for _ in range(MOST_STEPS):
        first, second = (field(at) for field in fields)
        if first.is_zero and second.is_zero:
            return None if abs(np.linalg.det([first.tangent, second.tangent])) < FLAT else (first, second)
        step = np.linalg.solve(np.stack([first.gradient, second.gradient]), [first.value, second.value])
        at = np.clip(at - step, 0, 1)
    return None


def _or_none(search: Callable[..., Found | None], *arguments: object) -> Found | None:
    """What a search finds; None where F does not exist on its way."""
    try:
        return search(*arguments)
    except (FpsolveError, ValueError):  # no value, one sign at both ends, or lines that are parallel
        return None


def _roots(
    trace: Trace, values: FloatArray, at: Callable[[float], FloatArray], axis: int, level: float = 0.0
) -> Iterator[float]:
    """The places of a branch where a component passes a level, from what it is above that at the points, or 0."""

    def value(place: float) -> float:
        return at(place)[axis] - level

    signed = np.flatnonzero(values)
    ahead = [*signed[1:], *(signed[:1] + values.size)] if trace.closed else signed[1:]
    for i, j in zip(signed, ahead, strict=False):
        if values[i] * values[j % values.size] < 0:
            place = _or_none(brentq, value, i, j, (), EQUAL)
            if place is not None:
                yield place % values.size


def _meetings(one: FloatArray, other: FloatArray) -> Iterator[tuple[float, float]]:
    """The places on both where pieces of two polylines cross, or hardly miss each other; (u, v) as u + iv."""
    (start, way), (begin, ways) = ((z[:-1], np.diff(z)) for z in (one @ (1, 1j), other @ (1, 1j)))
    gap, way = begin - start[:, None], way[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.stack([np.imag(gap.conj() * each) / np.imag(way.conj() * ways) for each in (ways, way)])
    for at in np.argwhere(np.all(np.abs(shares - 0.5) <= 0.5 + BY_A_HAIR, axis=0)):
        first, second = (at + np.clip(shares[:, *at], 0, 1)) / PIECES
        yield first, second
