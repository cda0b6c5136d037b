"""The tensor-product space: discontinuous in φ, times functions of ξ, in the inner product weighted by P_s(ξ).

A function has one coefficient for each pair (φ-unknown, ξ-unknown), φ slowest; a product operator
f(φ)·g(ξ) is the Kronecker product of a φ-matrix and a ξ-matrix.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import csr_matrix

from fpsolve.arrays import FloatArray
from fpsolve.fem.line import LineSpace
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_space import noise_space
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.problem import AnyNoise


def fitted(mesh: CylinderMesh, noise: AnyNoise) -> CylinderMesh:
    """A mesh cut off at the end of the noise's support."""
    return mesh if isinstance(noise, MarkovChain) else mesh.within(noise.half_width / noise.standard_deviation)


def unknowns(mesh: CylinderMesh, noise: AnyNoise) -> int:
    """How many the space of a mesh has."""
    mesh = fitted(mesh, noise)
    across = len(noise.states) if isinstance(noise, MarkovChain) else (mesh.z_lines.size - 1) * mesh.xi_degree + 1
    return (mesh.phi_lines.size - 1) * (mesh.phi_degree + 1) * across


class CylinderSpace:
    """The spaces of functions of φ and of ξ whose products span the trial and test functions.

    Args:
        mesh: the mesh; it is cut off at the end of the noise's support.
        noise: the noise.
        tilt: s of the factor exp(s z) in all functions, see `DiffusionSpace`.

    Attributes:
        mesh: the mesh, cut off at the end of the noise's support.
        phi: discontinuous elements in φ.
        xi: the functions of ξ, a `NoiseSpace`.
        left_trace, right_trace: T(φⱼ⁻) and T(φⱼ⁺) at the vertices phi_lines[:-1], shape (m, phi.size); the
            left trace at the seam comes from the last cell.

    Raises:
        MeshError: a cell's polynomials in the noise cannot be told apart under the weight.
    """

    def __init__(self, mesh: CylinderMesh, noise: AnyNoise, tilt: float = 0.0) -> None:
        self.mesh = fitted(mesh, noise)
        self.phi = LineSpace(self.mesh.phi_lines, self.mesh.phi_degree, discontinuous=True)
        self.xi = noise_space(noise, self.mesh, tilt)
        self._carriers: WeakKeyDictionary[CylinderSpace, tuple[FloatArray, FloatArray]] = WeakKeyDictionary()
        self.right_trace, upper = self.phi.traces
        self.left_trace = np.roll(upper, 1, axis=0)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.phi.size * self.xi.size

    @property
    def axes(self) -> tuple[LineSpace, ...]:
        """The elements that refinement may refine: in φ, and in ξ if that is a line."""
        return self.phi, *self.xi.axes

    def table(self, coefficients: FloatArray) -> FloatArray:
        """Coefficients of a function as a matrix, shape (phi.size, xi.size)."""
        return coefficients.reshape(self.phi.size, self.xi.size)

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor where there is a tilt, shape (size,)."""
        return np.asarray(np.kron(self.phi.constant(), self.xi.constant()), dtype=float)

    def carry(self, coefficients: FloatArray, old: CylinderSpace) -> FloatArray:
        """A function of another space, factor and all, projected on this one."""
        if old not in self._carriers:
            self._carriers[old] = self.phi.projection(old.phi), self.xi.projection(old.xi)
        phase, noise = self._carriers[old]
        return np.ravel(phase @ old.table(coefficients) @ noise.T)

    def evaluate(self, coefficients: FloatArray, at_phi: csr_matrix, at_xi: csr_matrix) -> FloatArray:
        """A function without its factor, from the values of the elements at points of φ and of ξ, shape (φ, ξ)."""
        return at_phi @ (at_xi @ self.table(coefficients).T).T
