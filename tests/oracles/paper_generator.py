"""Eq. (19) for the paper's oscillator as it is printed: L₀ + ε L₁ + ε² L₂ and the impact, from h₁, q₁, h₂, q₂.

Dense Kronecker products of the elements' matrices; upwind by the sign of ω + ε h₁ξ + ε² h₂ at every φ-vertex.
"""

import math

import numpy as np

from fpsolve.arrays import one


def h1(phi):
    return 0.5 * np.sin(2 * phi)


def q1(phi):
    return 0.5 * (1 - np.cos(2 * phi))


class PaperGenerator:
    """The matrices of L(p) on the space of a generator."""

    def __init__(self, oscillator, noise, space):
        self.oscillator, self.noise, self.space, self.line = oscillator, noise, space, space.xi.line
        self.unit = noise.standard_deviation

    def L0(self):
        rate = 0.5 * (self.noise.diffusion / self.unit) ** 2
        diffusion = np.kron(self.space.phi.mass().toarray(), self.line.stiffness(self.space.xi.tilt).toarray())
        return -rate * diffusion + self.transport(lambda phi: np.full_like(phi, self.oscillator.omega), one)

    def L1(self, p):
        return self.transport(h1, self.xi) + p * self.reaction(q1, self.xi)

    def L2(self, p):
        c1 = self.oscillator.c1
        return self.transport(lambda phi: c1 * h1(phi), one) + p * self.reaction(lambda phi: c1 * q1(phi), one)

    def impact(self, p):
        at = np.abs(np.cos(self.space.mesh.phi_lines[:-1])) < 1e-9
        load = self.space.left_trace[at].T @ self.space.right_trace[at]
        factor = math.expm1(p * self.oscillator.log_impact_factor)
        return factor * self.oscillator.omega * np.kron(load, self.line.mass().toarray())

    def matrix(self, p):
        eps = self.oscillator.epsilon
        return self.L0() + eps * self.L1(p) + eps**2 * self.L2(p) + self.impact(p)

    def xi(self, z):
        return self.unit * z

    def reaction(self, f, g):
        return np.kron(self.space.phi.mass(f).toarray(), self.line.mass(g).toarray())

    def transport(self, f, g):
        """∫ P_s f g w T_φ, and at each vertex the jump on the trace from which the phase speed points away."""
        total = np.kron(self.space.phi.convection(f).toarray(), self.line.mass(g).toarray())
        eps, c1, omega = self.oscillator.epsilon, self.oscillator.c1, self.oscillator.omega
        for j, phi in enumerate(self.space.mesh.phi_lines[:-1]):

            def forward(z, phi=phi):
                return omega + eps * h1(phi) * self.xi(z) + eps**2 * c1 * h1(phi) >= 0

            jump = f(np.array([phi]))[0] * (self.space.right_trace[j] - self.space.left_trace[j])
            for trace, sign in ((self.space.left_trace[j], True), (self.space.right_trace[j], False)):
                weight = self.line.mass(lambda z, sign=sign, forward=forward: g(z) * (forward(z) == sign))
                total += np.kron(np.outer(trace, jump), weight.toarray())
        return total
