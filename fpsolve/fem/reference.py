"""The orthonormal (Legendre) polynomials on the cell [0, 1]."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legval, legvander

from fpsolve.arrays import FloatArray

EXTRA_POINTS = 12
"""Quadrature points beyond what the product of two functions needs: for sin 2φ, cos 2φ and P_s."""


class Rule(NamedTuple):
    """A quadrature rule on [0, 1]."""

    points: FloatArray
    weights: FloatArray


class Orthonormal(NamedTuple):
    """The polynomials up to some degree at the points of a rule and at both ends.

    Attributes:
        rule: of n points.
        products: values of all pairs of functions, shape (n, (degree + 1)²), the first function slowest.
        convections: values of a function times the slope of another, in the same order.
        ends: values at 0 and at 1, shape (2, degree + 1).
    """

    rule: Rule
    products: FloatArray
    convections: FloatArray
    ends: FloatArray


@lru_cache(maxsize=64)
def gauss_legendre(count: int) -> Rule:
    """The Gauss-Legendre rule of so many points."""
    x, w = leggauss(count)
    return Rule(0.5 * (1 + x), 0.5 * w)


def legendre(x: FloatArray, degree: int) -> FloatArray:
    """Values at points of [0, 1], shape (len(x), degree + 1)."""
    return np.asarray(legvander(2 * x - 1, degree) * np.sqrt(2 * np.arange(degree + 1) + 1), dtype=float)


@lru_cache(maxsize=64)
def orthonormal(degree: int) -> Orthonormal:
    """The polynomials up to a degree, 1 at least."""
    rule = gauss_legendre(degree + EXTRA_POINTS)
    values, sizes = legendre(rule.points, degree), np.sqrt(2 * np.arange(degree + 1) + 1)
    slopes = 2 * sizes * legval(2 * rule.points - 1, np.polynomial.legendre.legder(np.eye(degree + 1))).T
    ends = legendre(np.array([0.0, 1.0]), degree)
    pairs = [(values[:, :, None] * each[:, None, :]).reshape(len(values), -1) for each in (values, slopes)]
    return Orthonormal(rule, pairs[0], pairs[1], ends)
