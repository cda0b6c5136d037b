"""The Fokker-Planck operator of the nonlinear oscillator, in log-amplitude, phase and noise.

With a = √(x² + ẋ²/ω²) and x = a cos φ, ẋ = −aω sin φ, every term of Eq. (3) gives dφ = h dt and d ln a = q dt:

    h = Σ εⁿ g(ξ) h_n(φ) + a² h₃(φ),    q = Σ εⁿ g(ξ) q_n(φ) + a² q₃(φ),
    h₃ = −N sin φ cos φ,    q₃ = −N sin²φ,    N = ε²(c₂ cos²φ + c₃ ω² sin²φ),

and ln a jumps by ln R at an impact, φ = π/2. The gauge ln a = u + γ(φ), γ = −(ln R/π) φ on (−π/2, π/2), makes u
continuous there, and a² = e^{2u} e^{2γ}, so that with du/dt = q − γ′h every term is a product of functions of u, φ
and ξ. A density ρ = P_s(ξ) Σ c w over (u, φ, ξ) is stationary where

    ∫ ρ (u̇ ∂w/∂u + φ̇ ∂w/∂φ + L_ξ w) = what flows over the ends of the interval of u,    for every test function w.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix, diags

from fpsolve.arrays import Coefficient, FloatArray, dense, identity, one
from fpsolve.fem.discretisation import NoisePart
from fpsolve.fem.line import LineSpace
from fpsolve.model.plane import CoefficientMatrix
from fpsolve.model.problem import Problem

HALF_TURN = np.array([-0.5, 0.5]) * math.pi
"""The phases between two impacts; x is not negative there."""


class Rate(NamedTuple):
    """h and q of a term, functions of φ, and its function of ξ."""

    h: Callable[[FloatArray], FloatArray]
    q: Callable[[FloatArray], FloatArray]
    g: Coefficient


def _scaled(term: CoefficientMatrix, size: float) -> Rate:
    return Rate(lambda phi: size * term.h(phi), lambda phi: size * term.q(phi), term.g)


@dataclass(frozen=True, eq=False)
class Flow:
    """The terms of the motion in the gauge u.

    Attributes:
        problem: with c₂ or c₃ > 0, and one noise with a density.
    """

    problem: Problem

    @cached_property
    def log_factor(self) -> float:
        """ln R."""
        return float(sum(jump.log_factor for jump in self.problem.motion.jumps))

    def gauge(self, phi: FloatArray) -> FloatArray:
        """γ(φ), for φ from −π/2 to π/2."""
        return -self.log_factor / math.pi * phi

    @cached_property
    def linear(self) -> Sequence[Rate]:
        """Of the terms that do not depend on a."""
        system = self.problem.motion
        return [_scaled(term, system.epsilon**term.order) for term in system.terms]

    @cached_property
    def cubic(self) -> Rate:
        """h₃ and q₃ with e^{2γ}: what e^{2u} multiplies."""
        motion: Any = self.problem.system.motion()

        def damping(phi: FloatArray) -> FloatArray:
            squares = motion.cubic * np.cos(phi) ** 2 + motion.rayleigh * np.sin(phi) ** 2
            return np.asarray(squares * np.exp(2 * self.gauge(phi)))

        return Rate(
            lambda phi: -damping(phi) * np.sin(phi) * np.cos(phi), lambda phi: -damping(phi) * np.sin(phi) ** 2, one
        )

    def rise(self, rate: Rate, phi: FloatArray) -> FloatArray:
        """What a term gives to du/dt: q − γ′h."""
        return np.asarray(rate.q(phi) + self.log_factor / math.pi * rate.h(phi))


class Circle:
    """Continuous elements in φ from impact to impact, whose ends are one.

    Args:
        cells: their number.
        degree: of the elements.

    Attributes:
        size: number of unknowns.
        points, weights: a quadrature rule.
        values, slopes: the functions there, shape (n, size).
        seam: their values at φ = ±π/2, shape (size,).
        constant: coefficients of 1.
    """

    def __init__(self, cells: int, degree: int) -> None:
        self._line = LineSpace(np.linspace(HALF_TURN[0], HALF_TURN[1], cells + 1), degree)
        first, last = self._line.ends
        kept = np.delete(np.arange(self._line.size), last)
        columns = np.where(np.arange(self._line.size) == last, first, np.arange(self._line.size))
        columns = np.searchsorted(kept, columns)  # equal cells, so that both functions at the seam have one norm
        self._merge = csr_matrix((np.ones(columns.size), (np.arange(columns.size), columns)))
        self.size, self.points, self.weights = kept.size, self._line.points, self._line.measure
        self.values, self.slopes = dense(self._line.values @ self._merge), dense(self._line.slopes @ self._merge)
        self.constant = self._line.constant()[kept]
        self.seam = self.at(HALF_TURN[:1])[0]

    def at(self, phi: FloatArray) -> FloatArray:
        """The functions at any φ, shape (len(phi), size)."""
        return dense(self._line.at(phi) @ self._merge)

    def mass(self, f: FloatArray) -> FloatArray:
        """∫ f w ρ, f at the points."""
        return np.asarray((self.values * (self.weights * f)[:, None]).T @ self.values)

    def convection(self, f: FloatArray) -> FloatArray:
        """∫ f w′ ρ."""
        return np.asarray((self.slopes * (self.weights * f)[:, None]).T @ self.values)


class Height:
    """Continuous elements in u.

    Args:
        lines: the vertices, shape (m + 1,).
        degree: of the elements.

    Attributes:
        size: number of unknowns.
        vertices: the unknowns of the vertices, in order.
        bubbles: those of each cell.
    """

    def __init__(self, lines: FloatArray, degree: int) -> None:
        self.line, self.lines = LineSpace(lines, degree), lines
        self.size, self.points, self.weights = self.line.size, self.line.points, self.line.measure
        self.vertices = np.flatnonzero(self.line.modes == 1)
        inner = self.line.modes > 1
        self.bubbles = [np.flatnonzero(inner & (self.line.cells == j)) for j in range(lines.size - 1)]
        self.constant = self.line.constant()
        self.end_values = 1 / self.constant[self.vertices]

    def mass(self, f: FloatArray) -> csr_matrix:
        """∫ f w ρ, f at the points."""
        return csr_matrix(self.line.values.T @ diags(self.weights * f) @ self.line.values)

    def convection(self, f: FloatArray) -> csr_matrix:
        """∫ f w′ ρ."""
        return csr_matrix(self.line.slopes.T @ diags(self.weights * f) @ self.line.values)


class Plane:
    """Functions of φ and ξ, and what L is between them, for one term of u each.

    Args:
        flow: the motion.
        circle: the functions of φ.
        part: those of ξ.

    Attributes:
        size: number of unknowns, that of φ slowest.
        unit: ∫P_s w ρ.
        rise, turn: ∫P_s u̇ w ρ, and ∫P_s (φ̇ ∂w/∂φ + L_ξ w) ρ, of what does not depend on u.
        steep, bend: the same of what e^{2u} multiplies.
    """

    def __init__(self, flow: Flow, circle: Circle, part: NoisePart) -> None:
        self.flow, self.circle = flow, circle
        self.axis = axis = part.axis(flow.problem.coloured, 0.0)
        phi = circle.points
        self.shape = circle.size, axis.size
        self.size = circle.size * axis.size
        of_one, generator = dense(axis.matrix(one)), dense(axis.matrix(None))
        still = circle.mass(np.ones_like(phi))
        self.unit = np.kron(still, of_one)
        self.rise = np.zeros((self.size, self.size))
        self.turn = np.kron(still, generator.T)
        for rate in flow.linear:
            noise = dense(axis.matrix(rate.g))
            self.rise += np.kron(circle.mass(flow.rise(rate, phi)), noise)
            self.turn += np.kron(circle.convection(rate.h(phi)), noise)
        cubic = flow.cubic
        self.steep = np.kron(circle.mass(flow.rise(cubic, phi)), of_one)
        self.bend = np.kron(circle.convection(cubic.h(phi)), of_one)
        self.constant = np.kron(circle.constant, axis.constant)
        self.xi_mean = of_one @ axis.constant
        """∫P_s of each function of ξ."""

    def outflow(self, square: float, sign: int) -> FloatArray:
        """∫P_s max(±u̇, 0) w ρ at e^{2u} = `square`, by a rule with as many points as there are."""
        at, phi = self.axis.samples(), self.circle.points
        speed = self.speed(square, phi, at.xi)
        weights = self.circle.weights[:, None] * self.axis.measure * np.maximum(sign * speed, 0)
        values, noise = self.circle.values, dense(at.values)
        of_noise = np.einsum("an,ni,nj->aij", weights, noise, noise, optimize=True)
        blocks = np.einsum("ak,al,aij->kilj", values, values, of_noise, optimize=True)
        return np.asarray(blocks.reshape(self.size, self.size))

    def speed(self, square: float, phi: FloatArray, xi: FloatArray) -> FloatArray:
        """u̇ at points of φ and ξ, shape (len(phi), len(xi))."""
        flow = self.flow
        speed = square * flow.rise(flow.cubic, phi)[:, None] * np.ones_like(xi)
        for rate in flow.linear:
            speed = speed + flow.rise(rate, phi)[:, None] * np.asarray(rate.g(xi))
        return np.asarray(speed)

    def integrals(self, f: FloatArray, g: Coefficient = identity) -> FloatArray:
        """∫ f(φ) P_s g(ξ) ρ as a vector over the functions, f at the points of φ."""
        noise = self.xi_mean if g == one else dense(self.axis.matrix(g)).T @ self.axis.constant
        return np.asarray(np.kron((self.circle.weights * f) @ self.circle.values, noise))
