"""Λ(p) on an interval from solves at few p, by a polynomial of Λ(p)/p.

In weak noise that is a polynomial to rounding at nine points of Chebyshev, with both ends. At p = 0 it is λ, and its
tolerance does not fall there. Every second point is one of the polynomial before. Where coefficients fall slowly, as
n⁻² at a corner, which a convex Λ does not hide between two points, n times the last ones are left; where they fall
fast, the square of what the polynomial before is off at the other points, over the values. In strong noise Λ has
branch points beside the real axis, and there is none: the interval is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebvander

from fpsolve.arrays import FloatArray

NEXT_TO_ZERO = 1e-3
"""Share of the interval; a point within it that is nearer to 0 is put there."""
COUNTS = 5, 9, 17, 33
"""Numbers of points of a polynomial, each tried where the one before is not enough."""
Solve = Callable[[float], tuple[float, float]]
"""Λ(p)/p at one p, at p = 0 λ, and the estimate of its error."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Λ on an interval by a polynomial of Λ(p)/p.

    Attributes:
        nodes: the p that were solved, increasing, with both ends.
        ratio: the polynomial.
        errors: of Λ(p)/p at these.
        left: what it is off between them.
    """

    nodes: FloatArray
    ratio: Chebyshev
    errors: FloatArray
    left: float

    def ratio_error(self, p: FloatArray) -> FloatArray:
        """What is left, and the errors at all nodes as much as they may grow between these."""
        to_unit, degree = 2 / np.ptp(self.nodes), self.nodes.size - 1
        own, table = (chebvander(to_unit * (x - self.nodes[0]) - 1, degree) for x in (self.nodes, p))
        return self.left + np.abs(table @ np.linalg.inv(own)) @ self.errors

    def values(self, p: FloatArray) -> Values:
        """Λ and its derivatives; the error of Λ′ is that of Markov's bound on the slope of a polynomial."""
        value, slope, second = (self.ratio.deriv(k)(p) for k in range(3))
        steepness = 2 * (self.nodes.size - 1) ** 2 / np.ptp(self.nodes)
        of_slope = np.max(self.ratio_error(self.nodes)) * (1 + steepness * np.abs(p))
        return Values(p * value, p * slope + value, p * second + 2 * slope, self.ratio_error(p) * np.abs(p), of_slope)


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
        found[:, place == number] = curve.values(own)
    found[np.ix_([0, 3], p == 0)] = 0.0
    return Values(*found)


def polynomials(
    solve: Solve, intervals: Sequence[tuple[float, float]], allowed: Callable[[float], float], most: int
) -> list[Curve]:
    """Λ by one polynomial on each interval, or by some on halves of these; none where more are needed than most."""
    rest, found = [*reversed(intervals)], list[Curve]()
    while rest and len(found) + len(rest) <= most:
        start, end = rest.pop()
        if curve := polynomial(solve, start, end, allowed):
            found.append(curve)
        else:
            middle = 0.5 * (start + end)
            rest += (middle, end), (start, middle)
    return [] if rest else found


def polynomial(solve: Solve, low: float, high: float, allowed: Callable[[float], float]) -> Curve | None:
    """Λ by a polynomial, if at all points the error of Λ(p)/p is allowed, or twice that of the point at most."""
    half, last = 0.5 * (high - low), None
    for count in COUNTS:
        points = low + half - half * np.cos(np.pi * np.arange(count) / (count - 1))
        points[[0, -1]] = low, high
        inner = points[1:-1]
        inner[np.abs(inner) < 2 * half * NEXT_TO_ZERO] = 0.0
        places = points.tolist()
        known = {p: solve(p) for p in sorted(places, key=abs, reverse=True)}
        ratios, errors = np.array([known[p] for p in places]).T
        ratio = Chebyshev.fit(points, ratios, count - 1, domain=(low, high))
        most = np.maximum([allowed(p) for p in places], 2 * errors)
        size = np.max(np.abs([ratios, most]))
        left = abs(ratio.coef[-1])
        if last is not None:
            off = np.max(np.abs(last(points) - ratios))
            left = count * np.sum(np.abs(ratio.coef[-3:])) + off**2 / size
            curve = Curve(points, ratio, errors, left)
            if np.all(curve.ratio_error(points) <= most):
                return curve
        if size * (left / size) ** ((COUNTS[-1] - 1) // (count - 1)) > np.min(
            most
        ):  # what the most points leave, about
            return None
        last = ratio
    return None
