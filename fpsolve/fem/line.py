"""Finite elements on an interval, in an inner product with a weight.

The bubbles of every cell are orthonormalised in the weighted energy ∫ w u′v′: polynomials that differ without a weight
hardly do so where it falls steeply, and P_s spans thirty orders of magnitude. The functions then have unit norms,
constants lie in the vertex functions alone, and the mass matrix is well conditioned.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import skfem
from numpy.polynomial.legendre import legvander
from scipy.linalg import solve
from scipy.sparse import csr_matrix, diags
from scipy.special import beta, roots_jacobi, roots_legendre

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.errors import MeshError

_EXTRA_POINTS = 12
"""Quadrature points beyond what the mass matrix without its weight needs: for sin 2φ, cos 2φ and P_s."""


@dataclass(frozen=True)
class _Rule:
    """A quadrature rule on [0, 1]."""

    points: FloatArray
    weights: FloatArray


@lru_cache(maxsize=512)
def _gauss_rule(count: int, left: float = 0.0, right: float = 0.0) -> _Rule:
    """Gauss-Jacobi rule for integrands like x^left (1 − x)^right times a polynomial; Gauss-Legendre without powers."""
    y, w = roots_jacobi(count, right, left) if left or right else roots_legendre(count)
    x = 0.5 * (1 + y)
    return _Rule(x, w / w.sum() * beta(left + 1, right + 1) / (x**left * (1 - x) ** right))


class LineSpace:
    """Finite elements on an interval, with a weight in the inner product.

    Args:
        lines: the vertices, shape (m + 1,).
        degree: polynomial degree.
        weight: the weight w(x) > 0 of every integral.
        discontinuous: cut the continuity between cells.
        end_exponents: powers with which the weight vanishes at the two ends, honoured by Gauss-Jacobi rules.

    Attributes:
        size: number of unknowns.
        points: points of the quadrature rules, increasing, shape (n,).
        weights: their weights, without w.
        cells: for each unknown the cell that it belongs to, -1 for one shared by two, shape (size,).
        modes: for each unknown the degree of its polynomial, 1 for vertex functions, shape (size,).

    Raises:
        MeshError: a cell's polynomials cannot be told apart under the weight.
    """

    def __init__(
        self,
        lines: FloatArray,
        degree: int,
        weight: Coefficient = one,
        *,
        discontinuous: bool = False,
        end_exponents: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.lines, self.degree, self._sizes = lines, degree, np.diff(lines)
        element = _element(degree)
        dofs = skfem.Dofs(skfem.MeshLine(lines), skfem.ElementDG(element) if discontinuous else element)
        self._dofs, self.size = dofs.element_dofs.T, int(dofs.N)
        self.cells, self.modes = _hierarchy(self._dofs, self.size)
        rules = self._rules(end_exponents)
        local = np.stack([rule.points for rule in rules])
        points, weights = self._global(local), np.stack([rule.weights for rule in rules]) * self._sizes[:, None]
        self.points, self.weights = points.ravel(), weights.ravel()
        self._measure = weights * weight(points)
        tables = [_reference(degree, rule.points.tobytes()) for rule in rules]
        values = np.stack([table[0] for table in tables])
        slopes = np.stack([table[1] for table in tables]) / self._sizes[:, None, None]
        self._transform = _orthogonalised(slopes, self._measure)
        squares = np.einsum("cq,cqi->ci", self._measure, (values @ self._transform) ** 2)
        self._norms = np.sqrt(np.bincount(self._dofs.ravel(), squares.ravel(), minlength=self.size))
        self._transform /= self._norms[self._dofs][:, None, :]
        self._values, self._slopes = values @ self._transform, slopes @ self._transform
        self._evaluations: dict[bytes, tuple[FloatArray, csr_matrix]] = {}

    @cached_property
    def values(self) -> csr_matrix:
        """The basis functions at the points, shape (n, size)."""
        return self._scattered(self._values)

    @cached_property
    def traces(self) -> tuple[FloatArray, FloatArray]:
        """The basis functions at the lower and at the upper end of each cell, from inside it: twice (m, size)."""
        lower, upper = np.zeros((2, self.lines.size - 1, self.size))
        for end, dofs in ((lower, self._dofs[:, 0]), (upper, self._dofs[:, 1])):
            end[np.arange(dofs.size), dofs] = 1 / self._norms[dofs]
        return lower, upper

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, shape (size,): the vertex functions add up to it."""
        return np.where(self.modes == 1, self._norms, 0.0)

    def mass(self, f: Coefficient = one) -> csr_matrix:
        """∫ w f u v."""
        return self._mass if f is one else self._form(self._values, f, self._values)

    @cached_property
    def _mass(self) -> csr_matrix:
        return self._form(self._values, one, self._values)

    def convection(self, f: Coefficient = one) -> csr_matrix:
        """∫ w f u′ v, cell by cell."""
        return self._form(self._values, f, self._slopes)

    def stiffness(self, tilt: float = 0.0) -> csr_matrix:
        """∫ w (u′ + s u)(v′ + s v), s being the tilt."""
        slopes = self._slopes + tilt * self._values
        return self._form(slopes, one, slopes)

    def evaluation(self, local: FloatArray) -> tuple[FloatArray, csr_matrix]:
        """Points and values in every cell at local coordinates in [0, 1]: x, and E with u(x) = E @ coefficients.

        Both run over cells, then local points: shapes (m·len(local),) and (m·len(local), size). At 0 and 1 the
        values are the traces from inside each cell.
        """
        key = np.asarray(local, dtype=float).tobytes()
        if key not in self._evaluations:
            values = _reference(self.degree, key)[0] @ self._transform
            self._evaluations[key] = self._global(np.frombuffer(key)[None]).ravel(), self._scattered(values)
        return self._evaluations[key]

    def _global(self, local: FloatArray) -> FloatArray:
        """Points of the cells at local coordinates, shape (m, n)."""
        return self.lines[:-1, None] + self._sizes[:, None] * local

    def at(self, x: FloatArray, inside: FloatArray | None = None) -> csr_matrix:
        """Values at any points, as rows of E with u(x) = E @ coefficients, shape (len(x), size).

        Beyond the ends the values there are taken. A point on a line between cells is seen from the cell that holds
        its entry of `inside`, without it from the cell above.
        """
        count = self.lines.size - 1
        cell = np.clip(np.searchsorted(self.lines, x if inside is None else inside, side="right") - 1, 0, count - 1)
        local = np.clip((x - self.lines[cell]) / self._sizes[cell], 0, 1)
        nodes = _gauss_rule(self.degree + 1).points
        known, wanted = (legvander(2 * t - 1, self.degree).T for t in (nodes, local))
        column = cell[:, None] * nodes.size + np.arange(nodes.size)
        rows = np.repeat(np.arange(x.size), nodes.size)
        interpolation = np.linalg.solve(known, wanted).T.ravel()
        matrix = csr_matrix((interpolation, (rows, column.ravel())), shape=(x.size, count * nodes.size))
        return matrix @ self.evaluation(nodes)[1]

    def projection(self, other: LineSpace, factor: Coefficient = one) -> FloatArray:
        """The matrix that takes a function u of another space to the projection of factor·u, shape (size, other.size).

        Orthogonal in the weight of this space.
        """
        scaled = diags(self._measure.ravel() * factor(self.points)) @ other.at(self.points)
        return np.asarray(solve(self.mass().toarray(), (self.values.T @ scaled).toarray(), assume_a="pos"), dtype=float)

    def _form(self, left: FloatArray, f: Coefficient, right: FloatArray) -> csr_matrix:
        """∫ w f (right) (left), without what is zero but for rounding."""
        measure = self._measure * f(self.points).reshape(self._measure.shape)
        blocks = (left * measure[..., None]).transpose(0, 2, 1) @ right
        blocks[np.abs(blocks) < 1e-16 * np.max(np.abs(blocks))] = 0
        rows, columns = np.broadcast_arrays(self._dofs[:, :, None], self._dofs[:, None, :])
        entries = (blocks.ravel(), (rows.ravel(), columns.ravel()))
        matrix = csr_matrix(entries, shape=(self.size, self.size))
        matrix.eliminate_zeros()
        return matrix

    def _scattered(self, values: FloatArray) -> csr_matrix:
        """Values of each cell's functions, shape (m, n, k + 1), as a matrix of shape (m·n, size)."""
        m, n, k = values.shape
        columns = np.broadcast_to(self._dofs[:, None, :], values.shape)
        return csr_matrix((values.ravel(), columns.ravel(), np.arange(0, m * n * k + 1, k)), shape=(m * n, self.size))

    def _rules(self, end_exponents: tuple[float, float]) -> list[_Rule]:
        """The quadrature rule of each cell."""
        count, last, (left, right) = self.degree + _EXTRA_POINTS, self.lines.size - 2, end_exponents
        return [_gauss_rule(count, left * (j == 0), right * (j == last)) for j in range(last + 1)]


def _hierarchy(dofs_of_cells: Any, size: int) -> tuple[Any, Any]:
    """Cell and degree of each unknown: in each cell skfem numbers two vertex functions, then bubbles by degree."""
    cells, modes = np.full(size, -2), np.ones(size, dtype=int)
    for j, dofs in enumerate(dofs_of_cells):
        cells[dofs] = np.where(cells[dofs] == -2, j, -1)
        modes[dofs[2:]] = np.arange(2, dofs.size)
    return cells, modes


def _orthogonalised(slopes: FloatArray, measure: FloatArray) -> FloatArray:
    """New functions in the elements' own, shape (m, k + 1, k + 1), so that in every cell ∫ w u′v′ is diagonal.

    `slopes` are those of the elements' own at points with the weights `measure`, shapes (m, n, k + 1) and (m, n). The
    bubbles are orthonormalised by QR, and the vertex functions are made orthogonal to them. All functions
    keep their values at the vertices: bubbles have no trace.
    """
    slopes = np.sqrt(measure)[..., None] * slopes
    scale = np.linalg.norm(slopes, axis=1)
    if not np.all(scale > 1e-150):
        raise MeshError("P_s underflows in a cell of the noise; use a narrower interval")
    q, r = np.linalg.qr(slopes[:, :, 2:] / scale[:, None, 2:])
    if np.min(np.abs(np.diagonal(r, axis1=1, axis2=2)), initial=1.0) < 1e-14:
        raise MeshError(
            f"elements of degree {slopes.shape[2] - 1} are linearly dependent to rounding, as P_s falls too far within "
            "a cell of the noise; use more or lower-degree cells, or a narrower interval"
        )
    inverse = np.linalg.solve(r, np.broadcast_to(np.eye(r.shape[1]), r.shape)) / scale[:, 2:, None]
    transform = np.broadcast_to(np.eye(slopes.shape[2]), (len(slopes), *2 * slopes.shape[2:])).copy()
    transform[:, 2:, 2:] = inverse
    transform[:, 2:, :2] = -inverse @ (q.transpose(0, 2, 1) @ slopes[:, :, :2])
    return transform


def _element(degree: int) -> Any:
    """Hierarchical (integrated Legendre) element."""
    fixed = {1: skfem.ElementLineP1, 2: skfem.ElementLineP2}
    return fixed[degree]() if degree in fixed else skfem.ElementLinePp(degree)


@lru_cache(maxsize=512)
def _reference(degree: int, points: bytes) -> tuple[FloatArray, FloatArray]:
    """Values and slopes of the elements' own functions on the cell [0, 1] at some points, shape (n, degree + 1)."""
    x = np.frombuffer(points)
    basis = skfem.CellBasis(skfem.MeshLine([0.0, 1.0]), _element(degree), quadrature=(x[None], np.zeros_like(x)))
    functions = [function[0] for function in basis.basis]
    values = np.stack([np.ravel(np.asarray(function)) for function in functions], axis=-1)
    return values, np.stack([np.ravel(function.grad[0]) for function in functions], axis=-1)
