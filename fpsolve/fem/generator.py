"""The tilted generator L(p) = L₀ + ε L₁ + ε² L₂ of Eq. (19), in weak form.

For trial T and test w, every integral weighted by P_s(ξ):

    ⟨w, L₀T⟩ = −½σ² ∫ P_s w_ξ T_ξ + transport(ω)      L₁: transport(h₁ξ) + p ∫ P_s q₁ξ w T
    L₂: transport(h₂) + p ∫ P_s q₂ w T                impact: (R^p − 1) ω ∫ P_s w(φ⁻) T(φ⁺) at φ = π/2, 3π/2

transport(v) = ∫ P_s v w T_φ, plus at each φ-vertex the point load ∫ P_s v (T(φ⁺) − T(φ⁻)) w on the trace of w
from which the whole phase speed ω + ε h₁ξ + ε² h₂ points away (upwinding): w(φ⁻) where it is positive, w(φ⁺)
where it is negative. With the impact the load is that of R^p T(φ⁺) − T(φ⁻). At the ends of the ξ-interval the
condition is natural: no probability flux.
"""

from __future__ import annotations

import math
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_matrix, csr_matrix, kron

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.fem.kronecker import KroneckerPattern, KroneckerSum
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.space import CylinderSpace
from fpsolve.model.noise import ColouredNoise
from fpsolve.model.vibro_impact import VibroImpactOscillator, h1, q1


class TiltedGenerator:
    """L(p) of Eq. (19) on a mesh: matrices for any p, from parts assembled once.

    Args:
        oscillator: the vibro-impact oscillator.
        noise: `OrnsteinUhlenbeck`, or `NonGaussianNoise` for Eq. (7) as it stands.
        mesh: half circle (its principal eigenvalue is that of the full circle) or full circle.
        tilt: s of the factor exp(s z) in the trial and test functions, see `CylinderSpace`.
    """

    def __init__(
        self, oscillator: VibroImpactOscillator, noise: ColouredNoise, mesh: CylinderMesh, tilt: float = 0.0
    ) -> None:
        self.oscillator, self.noise = oscillator, noise
        self.space = CylinderSpace(mesh, noise, tilt)
        self._omega: Coefficient = partial(np.full_like, fill_value=oscillator.omega)
        self._xi: Coefficient = partial(np.multiply, noise.standard_deviation)

    def __reduce__(self) -> tuple[Any, ...]:
        """What it is made of; the matrices are assembled again when they are needed."""
        return type(self), (self.oscillator, self.noise, self.space.mesh, self.space.tilt)

    def L0(self) -> KroneckerSum:
        """L₀ = ½σ²∂ξξ + b(ξ)∂ξ + ω∂φ."""
        rate = 0.5 * (self.noise.diffusion / self.noise.standard_deviation) ** 2
        diffusion = KroneckerSum.of(self.space.phase.mass(), self.space.noise.stiffness(self.space.tilt))
        return -rate * diffusion + self._transport(self._omega, one)

    def L1(self, p: float) -> KroneckerSum:
        """L₁ = ξ(h₁∂φ + p q₁)."""
        return self._transport(h1, self._xi) + p * self._reaction(q1, self._xi)

    def L2(self, p: float) -> KroneckerSum:
        """L₂ = h₂∂φ + p q₂ between impacts."""
        return self._transport(self.oscillator.h2, one) + p * self._reaction(self.oscillator.q2, one)

    def impact(self, p: float) -> KroneckerSum:
        """The impacts' point load beyond continuity, (R^p − 1) ω w(φ⁻) T(φ⁺)."""
        return math.expm1(p * self.oscillator.log_impact_factor) * self._impact_load()

    @cached_property
    def mass(self) -> csc_matrix:
        """∫ P_s w T."""
        return csc_matrix(kron(self.space.phase.mass(), self.space.noise.mass()))

    def at(self, p: float) -> csc_matrix:
        """The matrix of L(p)."""
        return self.shifted(p, 0.0)

    def shifted(self, p: float, shift: float) -> csc_matrix:
        """The matrix of L(p) − shift."""
        return self._matrix(1.0, p, math.expm1(p * self.oscillator.log_impact_factor), 1.0, -shift)

    def forcing(self, p: float) -> csc_matrix:
        """The matrix of ε L₁ + ε² L₂ and the impacts: L(p) without L₀."""
        return self._matrix(1.0, p, math.expm1(p * self.oscillator.log_impact_factor))

    def derivative(self, p: float) -> csc_matrix:
        """The matrix of dL/dp = ε q₁ξ + ε² q₂ + ln R · R^p · (impact load)."""
        return self._matrix(0.0, 1.0, self.oscillator.log_impact_factor * self.oscillator.impact_factor(p))

    def second_derivative(self, p: float) -> csc_matrix:
        """The matrix of d²L/dp², all of it from the impacts."""
        return self._matrix(0.0, 0.0, self.oscillator.log_impact_factor**2 * self.oscillator.impact_factor(p))

    def release(self) -> None:
        """Give the memory of the assembled parts free; they are assembled again when they are needed."""
        for name in ("_parts", "mass"):
            self.__dict__.pop(name, None)

    def upper_bound(self, p: float) -> float:
        """A number right of Λ(p): the supremum of p(ε q₁ξ + ε² q₂), and of the impacts spread evenly over φ."""
        eps, c1 = self.oscillator.epsilon, self.oscillator.c1
        xi = self.noise.standard_deviation * self.space.mesh.z_lines[[0, -1]]
        growth = max(0.0, *(p * (eps * xi + eps**2 * c1)))
        speed = self.oscillator.omega + 0.5 * np.max(np.abs(eps * xi + eps**2 * c1))
        return growth + max(0.0, p * self.oscillator.log_impact_factor) * speed / math.pi

    def _matrix(self, *coefficients: float) -> csc_matrix:
        """ε L₁(0) + ε² L₂(0), what is linear in p, the impacts, L₀ and the mass, each with its coefficient."""
        pattern, parts = self._parts
        return pattern.matrix(np.array(coefficients) @ parts[: len(coefficients)])

    @cached_property
    def _parts(self) -> tuple[KroneckerPattern, FloatArray]:
        eps = self.oscillator.epsilon
        linear = eps * self._reaction(q1, self._xi) + eps**2 * self._reaction(self.oscillator.q2, one)
        mass = KroneckerSum.of(self.space.phase.mass(), self.space.noise.mass())
        turning = eps * self.L1(0.0) + eps**2 * self.L2(0.0)
        sums = (turning, linear, self._impact_load(), self.L0(), mass)
        pattern = KroneckerPattern(sums)
        return pattern, np.stack([pattern.entries(total) for total in sums])

    def _impact_load(self) -> KroneckerSum:
        at = self.space.mesh.impact_vertices
        load = self.oscillator.omega * self.space.left_trace[at].T @ self.space.right_trace[at]
        return KroneckerSum.of(load, self.space.noise.mass())

    def _reaction(self, f: Coefficient, g: Coefficient) -> KroneckerSum:
        """∫ P_s f(φ) g(z) w T."""
        return KroneckerSum.of(self.space.phase.mass(f), self.space.noise.mass(g))

    def _transport(self, f: Coefficient, g: Coefficient) -> KroneckerSum:
        """∫ P_s f(φ) g(z) w T_φ and its upwind point loads at the φ-vertices."""
        phase, noise, vertices = self.space.phase, self.space.noise, self.space.mesh.phi_lines[:-1]
        jumps = f(vertices)[:, None] * (self.space.right_trace - self.space.left_trace)
        forward = ~self._reversals
        along = phase.convection(f) + csr_matrix(self.space.left_trace[forward].T @ jumps[forward])
        total = KroneckerSum.of(along, noise.mass(g))
        for j in np.flatnonzero(self._reversals):
            for trace, direction in ((self.space.left_trace[j], 1), (self.space.right_trace[j], -1)):
                load = np.outer(trace, jumps[j])
                total += KroneckerSum.of(load, noise.mass(self._upwind(g, vertices[j], direction)))
        return total

    @cached_property
    def _reversals(self) -> Any:
        """At which φ-vertices the phase speed is negative for some ξ of the interval, boolean."""
        xi = self._xi(self.space.mesh.z_lines[[0, -1], None])
        return np.any(_phase_speed(self.oscillator, self.space.mesh.phi_lines[:-1], xi) < 0, axis=0)

    def _upwind(self, g: Coefficient, phi: float, direction: int) -> Coefficient:
        """g(z) where the phase speed at φ has the asked direction, 1 or −1; 0 elsewhere."""
        oscillator, to_xi = self.oscillator, self._xi
        return lambda z: g(z) * ((_phase_speed(oscillator, phi, to_xi(z)) >= 0) == (direction > 0))


def _phase_speed(oscillator: VibroImpactOscillator, phi: ArrayLike, xi: FloatArray) -> FloatArray:
    """ω + ε h₁ξ + ε² h₂."""
    return oscillator.omega + oscillator.epsilon * h1(phi) * xi + oscillator.epsilon**2 * oscillator.h2(phi)
