"""The tensor-product space: discontinuous in φ, continuous in ξ, in the inner product weighted by P_s(ξ).

A function has one coefficient for each pair (φ-unknown, ξ-unknown), φ slowest; a product operator
f(φ)·g(ξ) is the Kronecker product of a φ-matrix and a ξ-matrix. The 1-D bases are scaled to a unit diagonal
of their mass matrices, as P_s spans thirty orders of magnitude.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from scipy.sparse import csr_matrix, diags, identity, vstack
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
    """Rule for integrands that behave like x^left (1 − x)^right times a polynomial: Gauss-Jacobi, or Gauss-Legendre."""
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
        self._weight = weight
        self._evaluations: dict[bytes, tuple[FloatArray, csr_matrix]] = {}
        self._parts = [self._basis(rule) for rule in self._rules(end_exponents)]
        self._scale = identity(self.size, format="csr")
        self._scale = diags(1 / np.sqrt(self.mass().diagonal()), format="csr")

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._parts[0].N)

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, shape (size,): 1 at nodes, 0 for the bubbles of degree 3 and more."""
        if self.degree <= 2:
            return 1 / self._scale.diagonal()
        index = np.arange(self.size)
        nodal = index % (self.degree + 1) < 2 if self._discontinuous else index < self.lines.size
        return nodal / self._scale.diagonal()

    def mass(self, f: Coefficient = one) -> csr_matrix:
        """∫ w f u v."""
        return self._assemble(f, lambda u, v: u * v)

    def convection(self, f: Coefficient = one) -> csr_matrix:
        """∫ w f u′ v, cell by cell."""
        return self._assemble(f, lambda u, v: u.grad[0] * v)

    def stiffness(self) -> csr_matrix:
        """∫ w u′ v′."""
        return self._assemble(one, lambda u, v: u.grad[0] * v.grad[0])

    def evaluation(self, local: FloatArray) -> tuple[FloatArray, csr_matrix]:
        """Points and values in every cell at local coordinates in [0, 1]: x, and E with u(x) = E @ coefficients.

        Both run over cells, then local points: shapes (m·len(local),) and (m·len(local), size). At 0 and 1 the
        values are the traces from inside each cell.
        """
        key = np.asarray(local, dtype=float).tobytes()
        if key not in self._evaluations:
            points = np.frombuffer(key)
            rule = _Rule(range(self.lines.size - 1), points, np.zeros_like(points))
            self._evaluations[key] = self._table(self._basis(rule))
        return self._evaluations[key]

    def quadrature(self) -> tuple[FloatArray, FloatArray, csr_matrix]:
        """Points of the rules in order of x, their weights (without w), and the matrix E of values there."""
        tables = [self._table(basis) for basis in self._parts]
        points, values = np.concatenate([t[0] for t in tables]), vstack([t[1] for t in tables], format="csr")
        weights = np.concatenate([np.ravel(basis.dx) for basis in self._parts])
        order = np.argsort(points)
        return points[order], weights[order], values[order]

    def _table(self, basis: Any) -> tuple[FloatArray, csr_matrix]:
        """Points of a basis and the matrix that evaluates there."""
        points = np.asarray(basis.global_coordinates())[0]
        rows = np.arange(points.size).reshape(points.shape)
        columns = [np.broadcast_to(dofs[:, None], rows.shape) for dofs in basis.element_dofs]
        entries = np.concatenate([np.ravel(np.asarray(function[0])) for function in basis.basis])
        index = np.tile(rows.ravel(), basis.Nbfun), np.concatenate([c.ravel() for c in columns])
        matrix = csr_matrix((entries, index), shape=(points.size, self.size))
        return points.ravel(), matrix @ self._scale

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
        return skfem.CellBasis(
            self._mesh, self._element(), elements=np.array(rule.cells), quadrature=(rule.points[None], rule.weights)
        )

    def _assemble(self, f: Coefficient, form: Callable[..., FloatArray]) -> csr_matrix:
        total = 0
        for basis in self._parts:
            x = np.asarray(basis.global_coordinates())[0]
            factor = self._weight(x) * f(x)
            total += skfem.BilinearForm(lambda u, v, _, k=factor: k * form(u, v)).assemble(basis)
        return csr_matrix(self._scale @ total @ self._scale)


class CylinderSpace:
    """The 1-D spaces on φ and on z = ξ/std that span the trial and test functions.

    Attributes:
        mesh: the mesh, cut off at the end of the noise's support.
        phase: discontinuous elements in φ.
        noise: continuous elements in z, weighted by the stationary density of z.
        density: the stationary density of z, P_s(ξ)·std.
        left_trace, right_trace: T(φⱼ⁻) and T(φⱼ⁺) at the vertices phi_lines[:-1], shape (m, phase.size); the
            left trace at the seam comes from the last cell.
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
        self._check_independence()
        traces = self.phase.evaluation(np.array([0.0, 1.0]))[1].toarray()
        self.right_trace, self.left_trace = traces[0::2], np.roll(traces[1::2], 1, axis=0)

    def _check_independence(self) -> None:
        try:
            np.linalg.cholesky(self.noise.mass().toarray())
        except np.linalg.LinAlgError as failure:
            raise MeshError(
                f"the noise elements of degree {self.mesh.xi_degree} on [{self.mesh.z_lines[0]:g}, "
                f"{self.mesh.z_lines[-1]:g}] are linearly dependent to rounding, as P_s falls too far within a cell; "
                "use more or lower-degree cells in the noise, or a narrower interval"
            ) from failure

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
