"""Eq. (19) for the paper's oscillator as it is printed: L₀ + ε L₁ + ε² L₂ and the impact, from h₁, q₁, h₂, q₂.

Dense Kronecker products of the elements' matrices. Where the functions of ξ can follow a kink, the load at a φ-vertex
is on the trace from which ω + ε h₁ξ + ε² h₂ points away; for polynomials it is that of the mean trace, and a penalty.
"""

import math

import numpy as np

from fpsolve.arrays import one
from fpsolve.model.plane import Harmonics

H1, Q1, ONE = Harmonics(0.0, 0.0, 0.5), Harmonics(0.5, -0.5, 0.0), Harmonics(1.0, 0.0, 0.0)


class PaperGenerator:
    """The matrices of L(p) on a space of a generator."""

    def __init__(self, oscillator, noise, space):
        self.oscillator, self.noise, self.space, self.phi = oscillator, noise, space, space.phi
        self.vertices = space.phi.lines[:-1]
        self.jump = space.phi.right_trace - space.phi.left_trace

    def L0(self):
        diffusion = np.kron(np.eye(self.phi.size), dense(self.space.xi.generator()))
        return diffusion + self.transport(ONE, self.oscillator.omega, one) + self.penalty()

    def L1(self, p):
        return self.transport(H1, 1.0, lambda xi: xi) + p * self.reaction(Q1, lambda xi: xi)

    def L2(self, p):
        c1 = self.oscillator.c1
        return self.transport(H1, c1, one) + p * c1 * self.reaction(Q1, one)

    def impact(self, p):
        at = np.abs(np.cos(self.vertices)) < 1e-9
        load = self.phi.left_trace[at].T @ self.phi.right_trace[at]
        factor = math.expm1(p * self.oscillator.log_impact_factor)
        return factor * self.oscillator.omega * np.kron(load, self.mass(one))

    def matrix(self, p):
        eps = self.oscillator.epsilon
        return self.L0() + eps * self.L1(p) + eps**2 * self.L2(p) + self.impact(p)

    def mass(self, g):
        return dense(self.space.xi.mass(g))

    def reaction(self, f, g):
        return np.kron(self.phi.mass(f), self.mass(g))

    def speed(self, j, xi):
        oscillator = self.oscillator
        return oscillator.omega + float(H1(self.vertices[j])) * (
            oscillator.epsilon * xi + oscillator.epsilon**2 * oscillator.c1
        )

    def transport(self, f, size, g):
        """∫ P_s f g w T_φ, and at each vertex the jump of T on the trace, or the mean of both traces, of w."""
        total = np.kron(self.phi.convection(f), self.mass(g))
        for j, phi in enumerate(self.vertices):
            load = float(f(phi)) * self.jump[j]
            if not self.space.xi.is_local:
                total += np.kron(np.outer(0.5 * (self.phi.left_trace[j] + self.phi.right_trace[j]), load), self.mass(g))
                continue
            for trace, sign in ((self.phi.left_trace[j], True), (self.phi.right_trace[j], False)):

                def directed(xi, j=j, sign=sign):
                    return g(xi) * ((self.speed(j, xi) >= 0) == sign)

                total += np.kron(np.outer(trace, load), self.mass(directed))
        return size * total

    def penalty(self):
        """−½ θ [w] [T] of polynomials, θ = |ω + ε² h₂| + ε |h₁| std, and |ω| at the impact, where h₁ = h₂ = 0."""
        total = np.zeros(2 * (self.space.size,))
        if not self.space.xi.is_local:
            for j in range(self.vertices.size):
                driven = self.oscillator.epsilon * abs(float(H1(self.vertices[j]))) * self.noise.standard_deviation
                theta = abs(self.speed(j, 0.0)) + driven
                total -= 0.5 * theta * np.kron(np.outer(self.jump[j], self.jump[j]), self.mass(one))
        return total


def dense(matrix):
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
