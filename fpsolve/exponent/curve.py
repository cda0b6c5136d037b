"""Λ(p) on an interval from solves at few p, by a polynomial of Λ(p)/p.

It has the values and the slopes at points of Chebyshev with both ends. In weak noise Λ(p)/p is a
polynomial to 1e-11 of four. At p = 0 it is λ, and its tolerance does not fall there. The last coefficients tell what is
left, also where they fall as n⁻², as at a corner, which a convex Λ does not hide between two points. In strong noise Λ
has branch points beside the real axis, and there is none: the interval is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebder, chebvander

from fpsolve.arrays import FloatArray

COUNTS = 4, 7, 13
"""Numbers of points of a polynomial, each tried where the one before is not enough."""
MISSED = 60.0
"""Largest error over the last quarter of the coefficients, of random functions with a corner, or with a branch point or
a pole beside the interval."""
BESIDE_ZERO = 0.25
"""Least |p| of a point over the least distance of two: λ, and the slope of Λ(p)/p at p = 0, take more solves."""
Solve = Callable[[float], tuple[float, float, float]]
"""Λ(p)/p at one p, at p = 0 λ, its slope, and the estimate of its error."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Λ on an interval by a polynomial of Λ(p)/p.

    Attributes:
        nodes: the p that were solved, increasing, with both ends.
        ratio: the polynomial.
        by_data: its coefficients by the values and slopes at the nodes, shape (2n, 2n).
        errors: of Λ(p)/p at these.
        left: what it is off between them.
    """

    nodes: FloatArray
    ratio: Chebyshev
    by_data: FloatArray
    errors: FloatArray
    left: float

    @property
    def steepness(self) -> float:
        """Markov's bound on the slope of a polynomial over its size, of the degree that so many values tell."""
        return 2 * (COUNTS[0] - 1) ** 2 / float(np.ptp(self.nodes))

    def ratio_error(self, p: FloatArray) -> FloatArray:
        """What is left, and the errors at the nodes, of values and slopes, as much as they may grow between these."""
        both = np.concatenate([self.errors, self.steepness * self.errors])
        off, scale = self.ratio.mapparms()
        at_p = chebvander(off + scale * p, both.size - 1)
        return self.left + np.abs(at_p @ self.by_data) @ both

    def values(self, p: FloatArray) -> Values:
        """Λ and its derivatives; the error of Λ′ is that of Markov's bound on the slope of a polynomial."""
        value, slope, second = (self.ratio.deriv(k)(p) for k in range(3))
        of_slope = (np.max(self.errors) + self.left) * (1 + self.steepness * np.abs(p))
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
    half = 0.5 * (high - low)
    for count in COUNTS:
        points = low + half - half * np.cos(np.pi * np.arange(count) / (count - 1))
        points[[0, -1]] = low, high
        room, inner = BESIDE_ZERO * np.min(np.diff(points)), points[1:-1]
        inner[:] = np.where(np.abs(inner) < room, np.copysign(room, inner), inner)
        solved = {p: solve(p) for p in sorted(points.tolist(), key=abs)}
        ratios, slopes, errors = np.array([solved[p] for p in points.tolist()]).T
        by_data: Any = np.linalg.inv(_conditions(points))
        coefficients = by_data @ np.concatenate([ratios, slopes])
        most = np.maximum([allowed(p) for p in points.tolist()], 2 * errors)
        left = MISSED * float(np.sum(np.abs(coefficients[-(count // 2) :])))
        if np.all(errors + left <= most):
            return Curve(points, Chebyshev(coefficients, domain=(low, high)), by_data, errors, left)
        size = np.max(np.abs([ratios, most]))
        if size * (left / size) ** (COUNTS[-1] // count) > np.min(most):  # about what the most points leave
            return None
    return None


def _conditions(nodes: FloatArray) -> FloatArray:
    """Values and slopes at the nodes of all Chebyshev polynomials with two for each, shape (2n, 2n)."""
    count, to_unit = 2 * nodes.size, 2 / np.ptp(nodes)
    values = chebvander(to_unit * (nodes - nodes[0]) - 1, count - 1)
    return np.concatenate([values, to_unit * values[:, :-1] @ chebder(np.eye(count))])
