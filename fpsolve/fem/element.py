"""Polynomials on the cell [0, 1] and their numbers in all cells, by scikit-fem.

`skfem.ElementLinePp` has the two functions of the vertices and the integrals of Legendre polynomials, which vanish at
both. Continuous elements take them as they are; discontinuous ones take what is orthonormal among them, by degree.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from fpsolve.arrays import FloatArray, IntArray, Mask

EXTRA_POINTS = 12
"""Quadrature points beyond what the product of two functions needs: for sin 2φ, cos 2φ and P_s."""


class Rule(NamedTuple):
    """A quadrature rule on [0, 1]."""

    points: FloatArray
    weights: FloatArray


@lru_cache(maxsize=64)
def gauss_legendre(count: int) -> Rule:
    """The Gauss-Legendre rule of so many points."""
    points, weights = get_quadrature(skfem.MeshLine.elem.refdom, 2 * count - 1)
    return Rule(points[0], weights)


def element(degree: int) -> Any:
    """The continuous element of a degree."""
    fixed = {1: skfem.ElementLineP1, 2: skfem.ElementLineP2}
    return fixed[degree]() if degree in fixed else skfem.ElementLinePp(degree)


@lru_cache(maxsize=512)
def functions(degree: int, points: bytes) -> tuple[FloatArray, FloatArray]:
    """Values and slopes of the functions of `element` at some points of the cell, shape (n, degree + 1)."""
    x = np.frombuffer(points)
    basis = skfem.CellBasis(skfem.MeshLine([0.0, 1.0]), element(degree), quadrature=(x[None], np.zeros_like(x)))
    found = [function[0] for function in basis.basis]
    values = np.stack([np.ravel(np.asarray(function)) for function in found], axis=-1)
    return values, np.stack([np.ravel(function.grad[0]) for function in found], axis=-1)


def numbered(lines: FloatArray, degrees: IntArray, of: Any) -> tuple[Mask, IntArray]:
    """Which functions of an element each cell has, of a degree of its own, and their numbers; 0 for those it has not.

    Args:
        lines: the vertices, shape (m + 1,).
        degrees: in each cell, shape (m,).
        of: the element of the highest degree, continuous or not.

    Returns:
        Arrays of shape (m, degree + 1).
    """
    dofs = skfem.Dofs(skfem.MeshLine(lines), of)
    numbers = dofs.element_dofs.T
    own = np.arange(numbers.shape[1]) <= degrees[:, None]
    kept = np.zeros(int(dofs.N), dtype=bool)
    kept[numbers[own]] = True
    return own, np.where(own, (np.cumsum(kept) - 1)[numbers], 0)


class Orthonormal(NamedTuple):
    """The orthonormal polynomials up to some degree at the points of a rule and at both ends.

    Attributes:
        rule: of n points.
        products: values of all pairs of functions, shape (n, (degree + 1)²), the first function slowest.
        convections: values of a function times the slope of another, in the same order.
        stiffnesses: slopes of all pairs of functions, in the same order.
        ends, end_slopes: values and slopes at 0 and at 1, shape (2, degree + 1).
        transform: the functions by those of `element`, shape (degree + 1, degree + 1).
    """

    rule: Rule
    products: FloatArray
    convections: FloatArray
    stiffnesses: FloatArray
    ends: FloatArray
    end_slopes: FloatArray
    transform: FloatArray

    def at(self, x: FloatArray) -> FloatArray:
        """Values at points of [0, 1], shape (len(x), degree + 1)."""
        return np.asarray(functions(len(self.transform) - 1, x.tobytes())[0] @ self.transform)


@lru_cache(maxsize=64)
def orthonormal(degree: int) -> Orthonormal:
    """The polynomials up to a degree, 1 at least: 1, those of the vertices, and each further one less those before."""
    rule = gauss_legendre(degree + EXTRA_POINTS)
    by_degree = np.eye(degree + 1)
    by_degree[:2, :2] = [[1.0, -1.0], [1.0, 1.0]]  # 1 and 2x − 1
    values, slopes = functions(degree, rule.points.tobytes())
    factor = np.linalg.qr(np.sqrt(rule.weights)[:, None] * (values @ by_degree), mode="r")
    transform = by_degree @ np.linalg.inv(factor * np.sign(np.diagonal(factor))[:, None])
    values, slopes = values @ transform, slopes @ transform
    pairs = ((values, values), (values, slopes), (slopes, slopes))
    tables = [(first[:, :, None] * last[:, None, :]).reshape(len(values), -1) for first, last in pairs]
    ends, end_slopes = (each @ transform for each in functions(degree, np.array([0.0, 1.0]).tobytes()))
    return Orthonormal(rule, tables[0], tables[1], tables[2], ends, end_slopes, transform)
