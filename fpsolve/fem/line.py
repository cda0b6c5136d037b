"""Continuous finite elements on an interval, in an inner product with a weight.

The bubbles of every cell are orthonormalised in the weighted energy ∫ w u′v′: polynomials that differ without a weight
hardly do so where it falls steeply, and P_s spans thirty orders of magnitude. The functions then have unit norms,
constants lie in the vertex functions alone, and the mass matrix is well conditioned.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import csr_matrix, diags, identity
from scipy.special import beta, roots_jacobi

from fpsolve.arrays import Coefficient, FloatArray, IntArray, Mask, one
from fpsolve.errors import MeshError
from fpsolve.fem.element import EXTRA_POINTS, functions, located, numbered
from fpsolve.messages import Code, Message


@lru_cache(maxsize=512)
def _gauss_rule(count: int, left: float, right: float) -> tuple[FloatArray, FloatArray]:
    """Gauss-Jacobi rule for integrands like x^left (1 − x)^right times a polynomial; Gauss-Legendre without powers."""
    y, w = roots_jacobi(count, right, left)
    x = 0.5 * (1 + y)
    return x, w / w.sum() * beta(left + 1, right + 1) / (x**left * (1 - x) ** right)


class LineSpace:
    """Finite elements on an interval, with a weight in the inner product.

    Args:
        lines: the vertices, shape (m + 1,).
        degree: polynomial degree, or that in each cell, shape (m,).
        weight: the weight w(x) > 0 of every integral.
        end_exponents: powers with which the weight vanishes at the two ends, honoured by Gauss-Jacobi rules.

    Attributes:
        degree: the highest one.
        size: number of functions.
        points: points of the quadrature rules, increasing, shape (n,).
        measure: their weights times w, shape (n,).
        cells: for each unknown the cell that it belongs to, -1 for one shared by two, shape (size,).
        modes: for each unknown the degree of its polynomial, 1 for vertex functions, shape (size,).
        ends: the two unknowns whose functions do not vanish at the ends.

    Raises:
        MeshError: a cell's polynomials cannot be told apart under the weight.
    """

    def __init__(
        self,
        lines: FloatArray,
        degree: int | IntArray,
        weight: Coefficient = one,
        *,
        end_exponents: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.lines, self._sizes, degrees = lines, np.diff(lines), np.broadcast_to(degree, lines.size - 1)
        self.degree = degree = int(np.max(degrees))
        self._own, self._dofs = numbered(lines, degrees)  # in each cell two of vertices, then bubbles
        cell, function = np.nonzero(self._own)
        number = self._dofs[self._own]
        shared = np.bincount(number) > 1
        self.size = shared.size
        self.modes, self.cells = np.ones(self.size, dtype=int), np.zeros(self.size, dtype=int)
        self.modes[number], self.cells[number] = np.maximum(function, 1), cell
        self.cells[shared] = -1
        self.ends = self._dofs[[0, -1], [0, 1]]
        count, (left, right), last = degree + EXTRA_POINTS, end_exponents, lines.size - 2
        rules = [_gauss_rule(count, left * (j == 0), right * (j == last)) for j in range(last + 1)]
        local, weights = (np.stack(each) for each in zip(*rules, strict=True))
        points, weights = self.lines[:-1, None] + self._sizes[:, None] * local, weights * self._sizes[:, None]
        self.points = points.ravel()
        self._measure = weights * weight(points)
        tables = [functions(degree, each.tobytes()) for each in local]
        values = np.stack([table[0] for table in tables])
        slopes = np.stack([table[1] for table in tables]) / self._sizes[:, None, None]
        self._transform, shares = _orthogonalised(slopes, self._measure, self._own[:, 2:])
        self._transform *= self._own[:, None, :]
        squares = np.einsum("cq,cqi->ci", self._measure, (values @ self._transform) ** 2)
        self._norms = np.sqrt(np.bincount(self._dofs.ravel(), squares.ravel(), minlength=self.size))
        self._transform /= self._norms[self._dofs][:, None, :]
        norms = self._norms[self._dofs]
        self._shares = shares * norms[:, 2:, None] / norms[:, None, :2]
        self._values, self._slopes = values @ self._transform, slopes @ self._transform

    @cached_property
    def values(self) -> csr_matrix:
        """The basis functions at the points, shape (n, size)."""
        m, n, k = self._values.shape
        columns = np.broadcast_to(self._dofs[:, None, :], self._values.shape).ravel()
        starts = np.arange(0, m * n * k + 1, k)
        return csr_matrix((self._values.ravel(), columns, starts), shape=(m * n, self.size))

    @cached_property
    def slopes(self) -> csr_matrix:
        """Their derivatives at the points, shape (n, size)."""
        return csr_matrix((self._slopes.ravel(), self.values.indices, self.values.indptr), shape=self.values.shape)

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, shape (size,): the vertex functions add up to it."""
        return np.where(self.modes == 1, self._norms, 0.0)

    @cached_property
    def nested(self) -> csr_matrix:
        """The matrix to the coefficients of linear vertex functions and bubbles, shape (size, size).

        What a vertex function holds of the bubbles is added to their coefficients: the sum up to a degree is then the
        function of that degree.
        """
        bubbles, vertices = np.broadcast_arrays(self._dofs[:, 2:, None], self._dofs[:, None, :2])
        shape = (self.size, self.size)
        return identity(self.size, format="csr") + csr_matrix(
            (self._shares.ravel(), (bubbles.ravel(), vertices.ravel())), shape=shape
        )

    def mass(self, f: FloatArray | float = 1.0) -> csr_matrix:
        """∫ w f u v, from f at the points."""
        return self._form(self.values, f)

    def stiffness(self, f: FloatArray) -> csr_matrix:
        """∫ w f u′v′, from f at the points."""
        return self._form(self.slopes, f)

    @property
    def measure(self) -> FloatArray:
        return self._measure.ravel()

    def at(self, x: FloatArray, derivative: int = 0, inside: FloatArray | None = None) -> csr_matrix:
        """Values, or slopes, at any points, as rows of E with u(x) = E @ coefficients, shape (len(x), size).

        Beyond the ends those there are taken. On a line between cells `inside` tells the cell, see `located`.
        """
        cell, local = located(self.lines, x, inside)
        table = functions(self.degree, local.tobytes())[derivative] / self._sizes[cell, None] ** derivative
        values = table[:, None, :] @ self._transform[cell]
        rows = np.repeat(np.arange(x.size), self.degree + 1)
        return csr_matrix((values.ravel(), (rows, self._dofs[cell].ravel())), shape=(x.size, self.size))

    def _form(self, values: csr_matrix, f: FloatArray | float) -> csr_matrix:
        """∫ w f of the products of functions, without what is zero but for rounding."""
        matrix = csr_matrix(values.T @ diags(self.measure * f) @ values)
        matrix.data[np.abs(matrix.data) < 1e-16 * np.max(np.abs(matrix.data), initial=0.0)] = 0
        matrix.eliminate_zeros()
        return matrix


def _orthogonalised(slopes: FloatArray, measure: FloatArray, kept: Mask) -> tuple[FloatArray, FloatArray]:
    """New functions in the elements' own, shape (m, k + 1, k + 1), so that in every cell ∫ w u′v′ is diagonal.

    And what a vertex function holds of each bubble, shape (m, k − 1, 2).

    `slopes` are those of the elements' own at points with the weights `measure`, shapes (m, n, k + 1) and (m, n). The
    bubbles are orthonormalised by QR, and the vertex functions are made orthogonal to those that are kept, a mask of
    the shape (m, k − 1). All functions keep their values at the vertices: bubbles have no trace.
    """
    slopes = np.sqrt(measure)[..., None] * slopes
    scale = np.linalg.norm(slopes, axis=1)
    if not np.all(scale > 1e-150):
        raise MeshError(Message(Code.UNDERFLOW))
    q, r = np.linalg.qr(slopes[:, :, 2:] / scale[:, None, 2:])
    if np.min(np.abs(np.diagonal(r, axis1=1, axis2=2)), initial=1.0) < 1e-14:
        raise MeshError(Message(Code.DEPENDENT, degree=slopes.shape[2] - 1))
    inverse = np.linalg.solve(r, np.broadcast_to(np.eye(r.shape[1]), r.shape)) / scale[:, 2:, None]
    transform = np.broadcast_to(np.eye(slopes.shape[2]), (len(slopes), *2 * slopes.shape[2:])).copy()
    transform[:, 2:, 2:] = inverse
    shares = np.where(kept[:, :, None], -q.transpose(0, 2, 1) @ slopes[:, :, :2], 0.0)
    transform[:, 2:, :2] = inverse @ shares
    return transform, shares
