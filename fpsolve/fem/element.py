"""Polynomials on the cell [0, 1] and their numbers in all cells, by scikit-fem.

`skfem.ElementLinePp` has the two functions of the vertices and bubbles, the integrals of Legendre polynomials, which
vanish at both. Continuous elements are made of these, discontinuous ones of their slopes, the Legendre polynomials.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from fpsolve.arrays import FloatArray, IntArray, Mask

EXTRA_POINTS = 12
"""Quadrature points beyond what the product of two functions needs: for sin 2φ, cos 2φ and P_s."""


@lru_cache(maxsize=64)
def gauss_legendre(count: int) -> tuple[FloatArray, FloatArray]:
    """Points and weights of the Gauss-Legendre rule on [0, 1] of so many points."""
    points, weights = get_quadrature(skfem.MeshLine.elem.refdom, 2 * count - 1)
    return points[0], weights


@lru_cache(maxsize=512)
def functions(degree: int, points: bytes) -> tuple[FloatArray, FloatArray]:
    """Values and slopes of both functions of vertices and of bubbles up to a degree, shape (n, degree + 1)."""
    x, of = np.frombuffer(points), skfem.ElementLinePp(max(degree, 3))  # lower ones warn that others are faster
    basis = skfem.CellBasis(skfem.MeshLine([0.0, 1.0]), of, quadrature=(x[None], np.zeros_like(x)))
    found = [function[0] for function in basis.basis[: degree + 1]]
    values = np.stack([np.ravel(np.asarray(function)) for function in found], axis=-1)
    return values, np.stack([np.ravel(function.grad[0]) for function in found], axis=-1)


def numbered(lines: FloatArray, degrees: IntArray) -> tuple[Mask, IntArray]:
    """Which continuous functions each cell has, of a degree of its own, and their numbers; 0 for those it has not.

    Args:
        lines: the vertices, shape (m + 1,).
        degrees: in each cell, shape (m,).

    Returns:
        Arrays of shape (m, degree + 1).
    """
    degree = int(np.max(degrees))
    dofs = skfem.Dofs(skfem.MeshLine(lines), skfem.ElementLinePp(max(degree, 3)))  # lower ones warn, see `functions`
    numbers = dofs.element_dofs.T[:, : degree + 1]
    own = np.arange(degree + 1) <= degrees[:, None]
    kept = np.zeros(int(dofs.N), dtype=bool)
    kept[numbers[own]] = True
    return own, np.where(own, (np.cumsum(kept) - 1)[numbers], 0)


def middles(lines: FloatArray) -> FloatArray:
    """The middle of each cell."""
    return 0.5 * (lines[:-1] + lines[1:])


def halved(lines: FloatArray) -> FloatArray:
    """The lines, and the middles."""
    return np.sort(np.concatenate([lines, middles(lines)]))


def located(lines: FloatArray, x: FloatArray, inside: FloatArray | None) -> tuple[IntArray, FloatArray]:
    """For each point the cell that holds it, and its place in that cell, from 0 to 1.

    A point on a line between two cells is in the one that holds its entry of `inside`, without it in the one above.
    """
    cell = np.clip(np.searchsorted(lines, x if inside is None else inside, side="right") - 1, 0, lines.size - 2)
    return cell, np.clip((x - lines[cell]) / np.diff(lines)[cell], 0, 1)


def legendre(degree: int, points: FloatArray) -> FloatArray:
    """The orthonormal polynomials up to a degree at points of the cell, shape (n, degree + 1): slopes of `functions`.

    The bubbles of `skfem.ElementLinePp` are integrals of Legendre polynomials, with slopes of the norm √2.
    """
    _, slopes = functions(degree + 1, points.tobytes())
    return slopes[:, 1:] / np.sqrt([1.0, *[2.0] * degree])


@lru_cache(maxsize=64)
def differentiation(degree: int) -> FloatArray:
    """The matrix to the coefficients of their slopes: ∫ P_j P_k′ is P_j P_k at 1 less that at 0 for j < k, else 0."""
    below, above = legendre(degree, np.array([0.0, 1.0]))
    return np.triu(np.outer(above, above) - np.outer(below, below), 1)
