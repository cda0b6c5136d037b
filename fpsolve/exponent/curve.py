"""Λ(p) on an interval from solves at few p, by a polynomial of Λ(p)/p.

In weak noise that is a polynomial to rounding at nine points of Chebyshev, with both ends. At p = 0 it is λ, and its
tolerance does not fall there. Every second point is one of the polynomial before. Where coefficients fall slowly, as
n⁻² at a corner, which a convex Λ does not hide between two points, n times the last ones are left; where they fall
fast, the square of what the polynomial before is off at the other points, over the values. In strong noise Λ has
branch points beside the real axis, and there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebvander

from fpsolve.arrays import FloatArray

NEXT_TO_ZERO = 1e-3
"""Share of the interval; a point nearer to 0 is put there."""


class Node(NamedTuple):
    """What is solved at one p: Λ(p)/p, which is λ at p = 0, the estimate of its error, and Λ′(p)."""

    ratio: float
    error: float
    slope: float


class Curve(NamedTuple):
    """Λ on an interval.

    Attributes:
        nodes: the p that were solved, increasing.
        derivative: the k-th derivative of Λ, by p and k.
        errors: estimates of |error| of Λ and of Λ′, by p.
    """

    nodes: FloatArray
    derivative: Callable[[FloatArray, int], FloatArray]
    errors: Callable[[FloatArray], tuple[FloatArray, FloatArray]]


class Values(NamedTuple):
    """Λ, Λ′, Λ″ at some p, and estimates of |error| of the first two."""

    value: FloatArray
    derivative: FloatArray
    second: FloatArray
    error: FloatArray
    derivative_error: FloatArray


def values(curves: Sequence[Curve], p: FloatArray) -> Values:
    """What one or more curves, of intervals next to each other, are at p, shape (n,); but for rounding Λ(0) = 0."""
    found, place = np.zeros((5, p.size)), np.searchsorted([curve.nodes[0] for curve in curves[1:]], p, side="right")
    for number, curve in enumerate(curves):
        own = p[place == number]
        found[:, place == number] = *(curve.derivative(own, k) for k in range(3)), *curve.errors(own)
    found[np.ix_([0, 3], p == 0)] = 0.0
    return Values(*found)


def polynomial(
    solve: Callable[[float], Node], low: float, high: float, allowed: Callable[[float], float]
) -> Curve | None:
    """Λ by a polynomial, if at all points the error of Λ(p)/p is allowed, or twice that of the point at most."""
    known, half, last = dict[float, Node](), 0.5 * (high - low), None
    for count in (5, 9, 17):
        points = low + half - half * np.cos(np.pi * np.arange(count) / (count - 1))
        points[-1] = high
        points[np.abs(points) < 2 * half * NEXT_TO_ZERO] = 0.0
        places = points.tolist()
        known |= {p: solve(p) for p in sorted(places, key=abs, reverse=True) if p not in known}
        ratios, errors, _ = np.array([known[p] for p in places]).T
        ratio = Chebyshev.fit(points, ratios, count - 1, domain=(low, high))
        most = np.maximum([allowed(p) for p in places], 2 * errors)
        size = np.max(np.abs([ratios, most]))
        beyond = ratio.coef[-1] ** 4 / size**3
        if last is not None:
            off = np.max(np.abs(last(points) - ratios))
            left = count * np.sum(np.abs(ratio.coef[-3:])) + off**2 / size
            error = partial(_error, points, errors, left)
            if np.all(error(points) <= most):
                return _of_ratio(points, ratio, error)
            beyond = left**2 / size
        if beyond > np.min(most):  # what 17 points leave, about
            return None
        last = ratio
    return None


def _error(points: FloatArray, errors: FloatArray, left: float, p: FloatArray) -> FloatArray:
    """What is left, and the errors of all points as much as they may grow between these."""
    own, table = (chebvander(2 * (x - points[0]) / np.ptp(points) - 1, points.size - 1) for x in (points, p))
    return left + np.abs(table @ np.linalg.inv(own)) @ errors


def _of_ratio(points: FloatArray, ratio: Chebyshev, error: Callable[[FloatArray], FloatArray]) -> Curve:
    """Λ by Λ(p)/p with its error, and that of Λ′ by Markov's bound on the slope of a polynomial."""
    steepness = 2 * (points.size - 1) ** 2 / np.ptp(points)
    return Curve(points, partial(_derivative, ratio), partial(_errors, error, np.max(error(points)), steepness))


def _derivative(ratio: Chebyshev, p: FloatArray, k: int) -> FloatArray:
    return p * ratio.deriv(k)(p) + (k * ratio.deriv(k - 1)(p) if k else 0.0)


def _errors(
    error: Callable[[FloatArray], FloatArray], most: float, steepness: float, p: FloatArray
) -> tuple[FloatArray, FloatArray]:
    return error(p) * np.abs(p), most * (1 + steepness * np.abs(p))
