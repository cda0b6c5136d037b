"""The tensor-product space: discontinuous in φ, continuous in ξ, in the inner product weighted by P_s(ξ).

A function has one coefficient for each pair (φ-unknown, ξ-unknown), φ slowest; a product operator
f(φ)·g(ξ) is the Kronecker product of a φ-matrix and a ξ-matrix. The bubbles of every cell are orthonormalised in
the weighted energy ∫ P_s u′v′: polynomials that differ without a weight hardly do so where it falls steeply, and
P_s spans thirty orders of magnitude. The functions then have unit norms, constants lie in the vertex functions
alone, and the mass matrix is well conditioned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csr_matrix, diags
from scipy.special import beta, roots_jacobi, roots_legendre

from fpsolve.errors import MeshError
from fpsolve.mesh import CylinderMesh
from fpsolve.noise import FloatArray, Noise

Coefficient = Callable[[FloatArray], FloatArray]
_EXTRA_POINTS = 12
"""Quadrature points beyond what the mass matrix without its weight needs: for sin 2φ, cos 2φ and P_s."""


def one(x: FloatArray) -> FloatArray:
    """The constant coefficient."""
    return np.ones_like(x)


@dataclass(frozen=True)
class _Rule:
    """A quadrature rule on [0, 1] for some cells of a line."""

    cells: Sequence[int]
    points: FloatArray
    weights: FloatArray


def _gauss_rule(cells: Sequence[int], count: int, left: float = 0.0, right: float = 0.0) -> _Rule:
    """Gauss-Jacobi rule for integrands like x^left (1 − x)^right times a polynomial; Gauss-Legendre without powers."""
    y, w = roots_jacobi(count, right, left) if left or right else roots_legendre(count)
    x = 0.5 * (1 + y)
    return _Rule(cells, x, w / w.sum() * beta(left + 1, right + 1) / (x**left * (1 - x) ** right))


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
        values: matrix of the basis functions at the points, shape (n, size).

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
        self.lines, self.degree, self._discontinuous = lines, degree, discontinuous
        self._mesh = skfem.MeshLine(lines)
        bases = [self._basis(rule) for rule in self._rules(end_exponents)]
        self.size = int(bases[0].N)
        self.points = np.concatenate([_points(basis) for basis in bases])
        self.weights = np.concatenate([np.ravel(basis.dx) for basis in bases])
        self._measure = self.weights * weight(self.points)
        self._vertices = np.unique(np.concatenate([basis.element_dofs[:2] for basis in bases], axis=None))
        self._transform = self._orthogonalise(bases)
        values = self._matrix(bases, np.asarray)
        self._norms = np.sqrt(values.power(2).T @ self._measure)
        self._transform = self._transform @ diags(1 / self._norms)
        self.values = values @ diags(1 / self._norms)
        self._slopes = self._matrix(bases, lambda function: function.grad[0])
        self._evaluations: dict[bytes, tuple[FloatArray, csr_matrix]] = {}

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, shape (size,): the vertex functions add up to it."""
        coefficients = np.zeros(self.size)
        coefficients[self._vertices] = self._norms[self._vertices]
        return coefficients

    def mass(self, f: Coefficient = one) -> csr_matrix:
        """∫ w f u v."""
        return self._form(self.values, f, self.values)

    def convection(self, f: Coefficient = one) -> csr_matrix:
        """∫ w f u′ v, cell by cell."""
        return self._form(self.values, f, self._slopes)

    def stiffness(self) -> csr_matrix:
        """∫ w u′ v′."""
        return self._form(self._slopes, one, self._slopes)

    def evaluation(self, local: FloatArray) -> tuple[FloatArray, csr_matrix]:
        """Points and values in every cell at local coordinates in [0, 1]: x, and E with u(x) = E @ coefficients.

        Both run over cells, then local points: shapes (m·len(local),) and (m·len(local), size). At 0 and 1 the
        values are the traces from inside each cell.
        """
        key = np.asarray(local, dtype=float).tobytes()
        if key not in self._evaluations:
            points = np.frombuffer(key)
            basis = self._basis(_Rule(range(self.lines.size - 1), points, np.zeros_like(points)))
            self._evaluations[key] = _points(basis), self._matrix([basis], np.asarray)
        return self._evaluations[key]

    def _form(self, left: csr_matrix, f: Coefficient, right: csr_matrix) -> csr_matrix:
        """∫ w f (right) (left), without what is zero but for rounding."""
        matrix = (left.T @ diags(self._measure * f(self.points)) @ right).tocsr()
        matrix.data[np.abs(matrix.data) < 1e-16 * np.max(np.abs(matrix.data), initial=0.0)] = 0
        matrix.eliminate_zeros()
        return matrix

    def _orthogonalise(self, bases: Sequence[Any]) -> csr_matrix:
        """Coefficients of new functions in the elements' own, so that in every cell ∫ w u′v′ is diagonal.

        The bubbles are orthonormalised by QR, and the vertex functions are made orthogonal to them. All functions
        keep their values at the vertices: bubbles have no trace.
        """
        entries = [(np.ones(self._vertices.size), self._vertices, self._vertices)]
        for dofs, slopes in self._weighted_slopes(bases):
            scale = np.linalg.norm(slopes, axis=0)
            if not np.all(scale > 1e-150):
                raise MeshError("P_s underflows in a cell of the noise; use a narrower interval")
            q, r = qr(slopes[:, 2:] / scale[2:], mode="economic")
            if np.min(np.abs(np.diag(r)), initial=1.0) < 1e-14:
                raise MeshError(
                    f"elements of degree {self.degree} are linearly dependent to rounding, as P_s falls too far within "
                    "a cell of the noise; use more or lower-degree cells, or a narrower interval"
                )
            inverse = solve_triangular(r, np.eye(len(r))) / scale[2:, None]
            entries.append(_block(dofs[2:], dofs[2:], inverse))
            entries.append(_block(dofs[2:], dofs[:2], -inverse @ (q.T @ slopes[:, :2])))
        data, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
        return csr_matrix((data, (row, column)), shape=(self.size, self.size))

    def _weighted_slopes(self, bases: Sequence[Any]) -> Iterator[tuple[Any, FloatArray]]:
        """For each cell its unknowns and √w u′ of the elements' own functions, shape (points, unknowns)."""
        measures = np.split(self._measure, np.cumsum([basis.dx.size for basis in bases])[:-1])
        for basis, measure in zip(bases, measures, strict=True):
            slopes = np.stack([function[0].grad[0] for function in basis.basis], axis=-1)
            yield from zip(
                basis.element_dofs.T, np.sqrt(measure.reshape(basis.dx.shape))[..., None] * slopes, strict=True
            )

    def _matrix(self, bases: Sequence[Any], take: Callable[[Any], FloatArray]) -> csr_matrix:
        """Values or derivatives of the orthonormal functions at the points of some bases."""
        entries, start = [], 0
        for basis in bases:
            rows = start + np.arange(basis.dx.size).reshape(basis.dx.shape)
            for function, dofs in zip(basis.basis, basis.element_dofs, strict=True):
                entries.append((take(function[0]), rows, np.broadcast_to(dofs[:, None], rows.shape)))
            start += basis.dx.size
        data, row, column = (np.concatenate([np.ravel(part) for part in parts]) for parts in zip(*entries, strict=True))
        return csr_matrix((data, (row, column)), shape=(start, self.size)) @ self._transform

    def _element(self) -> Any:
        """Hierarchical (integrated Legendre) element; a new one each time, as `ElementLinePp` remembers its points."""
        fixed = {1: skfem.ElementLineP1, 2: skfem.ElementLineP2}
        element = fixed[self.degree]() if self.degree in fixed else skfem.ElementLinePp(self.degree)
        return skfem.ElementDG(element) if self._discontinuous else element

    def _rules(self, end_exponents: tuple[float, float]) -> list[_Rule]:
        cells, count, (left, right) = range(self.lines.size - 1), self.degree + _EXTRA_POINTS, end_exponents
        if len(cells) == 1 or not (left or right):
            return [_gauss_rule(cells, count, left, right)]
        inner = [_gauss_rule(cells[1:-1], count)] if len(cells) > 2 else []
        return [_gauss_rule(cells[:1], count, left=left), *inner, _gauss_rule(cells[-1:], count, right=right)]

    def _basis(self, rule: _Rule) -> Any:
        cells, quadrature = np.array(rule.cells), (rule.points[None], rule.weights)
        return skfem.CellBasis(self._mesh, self._element(), elements=cells, quadrature=quadrature)


def _points(basis: Any) -> FloatArray:
    return np.ravel(np.asarray(basis.global_coordinates())[0])


def _block(rows: Any, columns: Any, block: FloatArray) -> tuple[FloatArray, Any, Any]:
    """Entries of a dense block: data, rows, columns."""
    return block.ravel(), np.repeat(rows, len(columns)), np.tile(columns, len(rows))


class CylinderSpace:
    """The 1-D spaces on φ and on z = ξ/std that span the trial and test functions.

    Attributes:
        mesh: the mesh, cut off at the end of the noise's support.
        phase: discontinuous elements in φ.
        noise: continuous elements in z, weighted by the stationary density of z.
        density: the stationary density of z, P_s(ξ)·std.
        left_trace, right_trace: T(φⱼ⁻) and T(φⱼ⁺) at the vertices phi_lines[:-1], shape (m, phase.size); the
            left trace at the seam comes from the last cell.

    Raises:
        MeshError: a cell's polynomials in the noise cannot be told apart under P_s.
    """

    def __init__(self, mesh: CylinderMesh, noise: Noise) -> None:
        unit = noise.standard_deviation
        end = noise.half_width / unit
        self.mesh = mesh.within(end)
        z = self.mesh.z_lines
        exponent = noise.end_exponent
        self.phase = LineSpace(self.mesh.phi_lines, self.mesh.phi_degree, discontinuous=True)
        self.density: Coefficient = lambda x: unit * noise.density(unit * x)
        self.noise = LineSpace(
            z,
            self.mesh.xi_degree,
            self.density,
            end_exponents=(exponent * (z[0] <= -end), exponent * (z[-1] >= end)),
        )
        traces = self.phase.evaluation(np.array([0.0, 1.0]))[1].toarray()
        self.right_trace, self.left_trace = traces[0::2], np.roll(traces[1::2], 1, axis=0)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.phase.size * self.noise.size

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, shape (size,)."""
        return np.asarray(np.kron(self.phase.constant(), self.noise.constant()), dtype=float)

    def values(self, coefficients: FloatArray, local_phi: FloatArray, local_z: FloatArray) -> FloatArray:
        """A function at local coordinates of every cell, as `LineSpace.evaluation` orders them: shape (φ, z)."""
        table = coefficients.reshape(self.phase.size, self.noise.size)
        return self.phase.evaluation(local_phi)[1] @ (self.noise.evaluation(local_z)[1] @ table.T).T
