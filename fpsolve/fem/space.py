"""The tensor-product space: discontinuous in φ, times functions of ξ, in the inner product weighted by P_s(ξ).

A function has one coefficient for each pair (φ-unknown, ξ-unknown), φ slowest; a product operator
f(φ)·g(ξ) is the Kronecker product of a φ-matrix and a ξ-matrix.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.errors import MeshError
from fpsolve.fem.mesh import MAX_DEGREE, CylinderMesh, halved
from fpsolve.fem.noise_space import CellSpace, ChainSpace, NoiseSpace, PolynomialSpace
from fpsolve.fem.phase_space import PhaseSpace
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.problem import AnyNoise


@dataclass(frozen=True, eq=False)
class Discretisation:
    """How many functions of φ and of ξ there are, and which.

    Attributes:
        phi_lines: the vertices in φ, shape (m + 1,).
        phi_degrees: the degree in each cell, shape (m,).
        polynomials: the number of orthogonal polynomials of the noise; 0 for cells or states.
        slope: s/p of the factor exp(s z) that goes with polynomials.
        z_lines: the vertices in z; none for polynomials or states.
        xi_degree: the degree of the elements in ξ; 0 for polynomials or states.
        is_killed: whether T = 0 at the ends of the z_lines, as paths that leave are killed.
    """

    phi_lines: FloatArray
    phi_degrees: Any
    polynomials: int = 0
    slope: float = 0.0
    z_lines: FloatArray = field(default_factory=lambda: np.zeros(0))
    xi_degree: int = 0
    is_killed: bool = False

    @classmethod
    def on(cls, mesh: CylinderMesh, noise: AnyNoise) -> Discretisation:
        """The elements of a mesh, which is cut off at the end of the noise's support.

        Raises:
            MeshError: the mesh has lines where the noise has states, or none where it has a line.
        """
        if isinstance(noise, MarkovChain) == bool(mesh.z_lines.size):
            raise MeshError("noise with states needs a mesh without z_lines, and noise on a line one with them")
        degrees = np.full(mesh.phi_lines.size - 1, mesh.phi_degree)
        if isinstance(noise, MarkovChain):
            return cls(mesh.phi_lines, degrees)
        mesh = mesh.within(noise.half_width / noise.standard_deviation)
        return cls(mesh.phi_lines, degrees, z_lines=mesh.z_lines, xi_degree=mesh.xi_degree)

    @property
    def xi_kind(self) -> Literal["polynomials", "cells", "states"]:
        """What the functions of ξ are."""
        return "polynomials" if self.polynomials else "cells" if self.z_lines.size else "states"

    def xi_size(self, noise: AnyNoise) -> int:
        """The number of functions of ξ."""
        if isinstance(noise, MarkovChain):
            return len(noise.states)
        return self.polynomials or (self.z_lines.size - 1) * self.xi_degree + 1 - 2 * self.is_killed

    def unknowns(self, noise: AnyNoise) -> int:
        """The size of the space."""
        return int(np.sum(self.phi_degrees + 1)) * self.xi_size(noise)

    def enriched(self) -> Discretisation:
        """A finer one: two degrees more each way; where there are none left, cells are halved."""
        fine = replace(self, phi_degrees=self.phi_degrees + 2)
        if np.max(fine.phi_degrees) > MAX_DEGREE:
            fine = replace(self, phi_lines=halved(self.phi_lines), phi_degrees=np.repeat(self.phi_degrees, 2))
        if self.polynomials:
            return replace(fine, polynomials=self.polynomials + max(3, self.polynomials // 8))
        if self.xi_degree + 2 > MAX_DEGREE:
            return replace(fine, z_lines=halved(self.z_lines))
        return replace(fine, xi_degree=self.xi_degree + 2 * (self.xi_degree > 0))


def noise_space(noise: AnyNoise, chosen: Discretisation, p: float) -> NoiseSpace:
    """The functions of a noise for one p."""
    if isinstance(noise, MarkovChain):
        return ChainSpace(noise)
    if chosen.polynomials:
        return PolynomialSpace(noise, chosen.polynomials, chosen.slope * p)
    return CellSpace(noise, chosen.z_lines, chosen.xi_degree, chosen.is_killed)


@dataclass(frozen=True, eq=False)
class CylinderSpace:
    """The spaces of functions of φ and of ξ whose products span the trial and test functions."""

    phi: PhaseSpace
    xi: NoiseSpace
    _xi_matrices: dict[Coefficient | None, Any] = field(init=False, repr=False, default_factory=dict)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.phi.size * self.xi.size

    @property
    def turns(self) -> int:
        """How often the domain fits on the full circle."""
        return round(2 * math.pi / self.phi.span)

    def table(self, coefficients: FloatArray) -> FloatArray:
        """Coefficients of a function as a matrix, shape (phi.size, xi.size)."""
        return coefficients.reshape(self.phi.size, self.xi.size)

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor where there is a tilt, shape (size,)."""
        return np.outer(self.phi.constant, self.xi.constant()).ravel()

    def weighed(self, coefficients: FloatArray) -> FloatArray:
        """∫ P_s w T for every test function w, T a function of the space."""
        return np.ravel(self.table(coefficients) @ self.xi_matrix(one))

    def xi_matrix(self, g: Coefficient | None) -> Any:
        """∫ P_s g u v of the functions of ξ; for None ∫ P_s v L_ξ u."""
        if g not in self._xi_matrices:
            self._xi_matrices[g] = self.xi.generator() if g is None else self.xi.mass(g)
        return self._xi_matrices[g]

    def carry(self, coefficients: FloatArray, old: CylinderSpace) -> FloatArray:
        """A function of another space, factor and all, projected on this one."""
        table = old.table(coefficients)
        if self.phi is not old.phi:
            table = self.phi.projection(old.phi) @ table
        if self.xi is not old.xi:
            table = table @ self.xi.projection(old.xi).T
        return np.ravel(table)

    def evaluate(self, coefficients: FloatArray, at_phi: Any, at_xi: Any) -> FloatArray:
        """A function without its factor, from the values of the elements at points of φ and of ξ, shape (φ, ξ)."""
        return at_phi @ (at_xi @ self.table(coefficients).T).T
