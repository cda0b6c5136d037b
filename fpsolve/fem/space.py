"""The tensor-product space: discontinuous in φ, continuous in ξ, in the inner product weighted by P_s(ξ).

A function has one coefficient for each pair (φ-unknown, ξ-unknown), φ slowest; a product operator
f(φ)·g(ξ) is the Kronecker product of a φ-matrix and a ξ-matrix.
"""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.fem.line import LineSpace
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.noise import Noise

_SAMPLES = 2001


class CylinderSpace:
    """The 1-D spaces on φ and on z = ξ/std that span the trial and test functions.

    With a tilt s every function carries the factor exp(s (z − c)): where T ~ exp(s z) the polynomials stand for what
    is left of it. The products of two functions are then weighted by P_s exp(2s z), which for Ornstein-Uhlenbeck
    noise is P_s moved to 2s, however far that is.

    Args:
        mesh: the mesh; it is cut off at the end of the noise's support.
        noise: the noise.
        tilt: s.

    Attributes:
        mesh: the mesh, cut off at the end of the noise's support.
        phase: discontinuous elements in φ.
        noise: continuous elements in z, in the weight `weight`.
        tilt: s; its factor is 1 at z = c, `center`, where the weight is largest.
        left_trace, right_trace: T(φⱼ⁻) and T(φⱼ⁺) at the vertices phi_lines[:-1], shape (m, phase.size); the
            left trace at the seam comes from the last cell.

    Raises:
        MeshError: a cell's polynomials in the noise cannot be told apart under the weight.
    """

    def __init__(self, mesh: CylinderMesh, noise: Noise, tilt: float = 0.0) -> None:
        self._unit = noise.standard_deviation
        self._log_density = noise.log_density
        end = noise.half_width / self._unit
        self.mesh = mesh.within(end)
        z = self.mesh.z_lines
        self.tilt, self.center, self._log_weight = tilt, 0.0, -math.log(self._unit)
        if tilt:
            inside = np.linspace(z[0], z[-1], _SAMPLES)[1:-1]
            sizes = self._log_density(self._unit * inside) + 2 * tilt * inside
            self.center, self._log_weight = float(inside[sizes.argmax()]), float(sizes.max())
        exponent = noise.end_exponent
        self.phase = LineSpace(self.mesh.phi_lines, self.mesh.phi_degree, discontinuous=True)
        self.noise = LineSpace(
            z,
            self.mesh.xi_degree,
            self.weight,
            end_exponents=(exponent * (z[0] <= -end), exponent * (z[-1] >= end)),
        )
        self._carriers: WeakKeyDictionary[CylinderSpace, tuple[FloatArray, FloatArray]] = WeakKeyDictionary()
        self.right_trace, upper = self.phase.traces
        self.left_trace = np.roll(upper, 1, axis=0)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.phase.size * self.noise.size

    def weight(self, z: FloatArray) -> FloatArray:
        """P_s exp(2s z): without a tilt the stationary density of z, otherwise with its largest value, at c, made 1."""
        return np.exp(self._log_density(self._unit * z) + 2 * self.tilt * z - self._log_weight)

    def factor(self, z: FloatArray, other: CylinderSpace | None = None) -> FloatArray:
        """exp(s (z − c)), which every function carries, over that of another space; kept within e^±600."""
        exponent = self.tilt * (z - self.center)
        if other is not None:
            exponent = exponent - other.tilt * (z - other.center)
        return np.exp(np.clip(exponent, -600, 600))

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor where there is a tilt, shape (size,)."""
        return np.asarray(np.kron(self.phase.constant(), self.noise.constant()), dtype=float)

    def carry(self, coefficients: FloatArray, old: CylinderSpace) -> FloatArray:
        """A function of another space, factor and all, projected on this one."""
        if old not in self._carriers:
            noise = self.noise.projection(old.noise, lambda z: old.factor(z, self))
            self._carriers[old] = self.phase.projection(old.phase), noise
        phase, noise = self._carriers[old]
        return np.ravel(phase @ coefficients.reshape(old.phase.size, -1) @ noise.T)

    def values(self, coefficients: FloatArray, local_phi: FloatArray, local_z: FloatArray) -> FloatArray:
        """A function without its factor at local coordinates of every cell, as `LineSpace.evaluation` orders them."""
        table = coefficients.reshape(self.phase.size, self.noise.size)
        return self.phase.evaluation(local_phi)[1] @ (self.noise.evaluation(local_z)[1] @ table.T).T
