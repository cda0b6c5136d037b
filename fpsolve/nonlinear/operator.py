"""The Fokker-Planck operator of a system with cubic terms, in log-amplitude, phase and noise.

With a = √(x₁² + x₂²/s²), s the system's `aspect`, and x₁ = a cos φ, x₂ = −s a sin φ, all terms together give dφ = h dt
and d ln a = q dt with

    h = Σ εⁿ g(ξ) h_n(φ) + a² h₃(φ),    q = Σ εⁿ g(ξ) q_n(φ) + a² q₃(φ);

for the oscillator of Eq. (3) h₃ = −N sin φ cos φ, q₃ = −N sin²φ, N = ε²(c₂ cos²φ + c₃ ω² sin²φ). At a wall, on the ray
φ_w, ln a jumps by ln R. The gauge ln a = u + γ(φ), γ = ∓(ln R/π)(φ − φ_w + π/2) on the half-turn that ends at φ_w, with
the upper sign where φ grows there, makes u continuous, and a² = e^{2u} e^{2γ}, so that with du/dt = q − γ′h every term
is a product of functions of u, φ and ξ. γ has the logarithm of a unit of a besides, so that u is of the order of 1
where the cubic terms are as large as the linear ones. A density ρ = P_s(ξ) Σ c w over (u, φ, ξ) is stationary where

    ∫ ρ (u̇ ∂w/∂u + φ̇ ∂w/∂φ + L_ξ w) = what flows over the ends of the interval of u,    for every test function w.

Without a wall (x₁, x₂) and (−x₁, −x₂) are one state here; both have half of the density, as every term is odd.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from fpsolve.arrays import Coefficient, FloatArray, dense, one
from fpsolve.fem.line import LineSpace
from fpsolve.fem.noise_axes import NoiseAxis
from fpsolve.model.confinement import amplitude_frame, mean_terms
from fpsolve.model.coordinates import framed
from fpsolve.model.plane import CoefficientMatrix
from fpsolve.model.problem import Problem

HALF_TURN = np.array([-0.5, 0.5]) * math.pi
"""The phases where x₁ is not negative."""


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
        problem: of a system with cubic terms and at most one wall, and one noise with a density.
    """

    problem: Problem

    @cached_property
    def half_turn(self) -> FloatArray:
        """The first and last φ of the half-turn that is solved for; it ends at the wall, if there is one."""
        system = self.problem.linear
        if not system.jumps:
            return HALF_TURN
        return amplitude_frame(system).phase(np.array(system.jumps[0].phase)) + np.array([-math.pi, 0.0])

    def phases(self, count: int) -> FloatArray:
        """So many from the first to the last."""
        return np.linspace(self.half_turn[0], self.half_turn[1], count)

    @property
    def has_wall(self) -> bool:
        return bool(self.problem.linear.jumps)

    def is_positive(self, k: int) -> bool:
        """Whether a variable is nowhere negative, as the wall is where it is 0."""
        first, last = self.half_turn
        ends = np.abs([math.cos(first), math.sin(first)])
        middle = (math.cos, lambda phi: -math.sin(phi))[k](0.5 * (first + last))
        return self.has_wall and ends[k] < 1e-12 and middle > 0

    @cached_property
    def sense(self) -> float:
        """1 where the phase grows at the wall, −1 where it falls; 1 without a wall."""
        moved = framed(self.problem)
        return math.copysign(1.0, math.fsum(moved.wall_speeds(moved.motion)))

    @cached_property
    def log_factor(self) -> float:
        """The jump of ln a at the wall from below φ_w to above: ±ln R."""
        return self.sense * float(sum(jump.log_factor for jump in self.problem.linear.jumps))

    def gauge(self, phi: FloatArray) -> FloatArray:
        """γ(φ), for φ in the half-turn."""
        return self.log_unit - self.log_factor / math.pi * (phi - self.half_turn.mean())

    @cached_property
    def log_unit(self) -> float:
        """The mean of γ: ln a where the cubic terms are as large as the linear ones, a unit of a."""
        rates = [float(np.linalg.norm(each)) for each in mean_terms(self.problem)]
        return 0.5 * math.log((rates[0] or 1 / self.problem.valued.correlation_time) / rates[1])

    @cached_property
    def linear(self) -> Sequence[Rate]:
        """The rates by the terms that do not depend on a."""
        system, frame = self.problem.linear, amplitude_frame(self.problem.linear)
        return [_scaled(frame.term(term), system.epsilon**term.order) for term in system.terms]

    @cached_property
    def cubic(self) -> Rate:
        """h₃ and q₃ with e^{2γ}: what e^{2u} multiplies."""
        cubic = self.problem.linear.cubic
        assert cubic is not None
        terms = amplitude_frame(self.problem.linear).cubic(cubic)

        def size(phi: FloatArray) -> FloatArray:
            return np.asarray(np.exp(2 * self.gauge(phi)))

        return Rate(lambda phi: terms.h(phi) * size(phi), lambda phi: terms.q(phi) * size(phi), one)

    def rise(self, rate: Rate, phi: FloatArray) -> FloatArray:
        """What a term gives to du/dt: q − γ′h."""
        return np.asarray(rate.q(phi) + self.log_factor / math.pi * rate.h(phi))


Factors = dict[Coefficient | None, Any]
"""Matrices of functions of φ, for functions of ξ."""


class Elements:
    """Continuous elements in φ or in u.

    Args:
        lines: the vertices, shape (m + 1,).
        degree: of the elements.
        is_closed: whether both ends are one point, as those of a half-turn are; the elements then have one length.

    Attributes:
        size: number of unknowns.
        points, weights: a quadrature rule.
        values, slopes: the functions there, shape (n, size).
        vertices: the unknowns of the vertices, in order.
        bubbles: those of each cell that vanish at its ends.
        constant: coefficients of 1.
    """

    def __init__(self, lines: FloatArray, degree: int, *, is_closed: bool = False) -> None:
        self.lines, self._line = lines, LineSpace(lines, degree)
        line, (first, last) = self._line, self._line.ends
        number = np.arange(line.size)
        kept = np.delete(number, last) if is_closed else number
        columns = np.searchsorted(kept, np.where(number == last, first, number)) if is_closed else number
        self._merge = csr_matrix((np.ones(number.size), (number, columns)))
        self.size, self.points, self.weights = kept.size, line.points, line.measure
        self.values, self.slopes = dense(line.values @ self._merge), dense(line.slopes @ self._merge)
        self.constant, is_vertex = line.constant()[kept], line.modes[kept] == 1
        self.vertices = np.flatnonzero(is_vertex)
        self.bubbles = [np.flatnonzero(~is_vertex & (line.cells[kept] == j)) for j in range(lines.size - 1)]

    def at(self, x: FloatArray) -> FloatArray:
        """The functions at any places, shape (len(x), size)."""
        return dense(self._line.at(x) @ self._merge)

    def mass(self, f: FloatArray) -> FloatArray:
        """∫ f w ρ, f at the points."""
        return np.asarray((self.values * (self.weights * f)[:, None]).T @ self.values)

    def convection(self, f: FloatArray) -> FloatArray:
        """∫ f w′ ρ."""
        return np.asarray((self.slopes * (self.weights * f)[:, None]).T @ self.values)


class Plane:
    """Functions of φ and ξ, and what L is between them, for one term of u each.

    Args:
        flow: the motion.
        circle: the functions of φ.
        axis: those of ξ.

    Attributes:
        size: number of unknowns, that of φ slowest.
        noise: for each function of ξ in L its matrix ∫P_s g w ρ, and that of L_ξ for None.
        rise, turn: for these the matrices of φ in ∫P_s u̇ w ρ and ∫P_s (φ̇ ∂w/∂φ + L_ξ w) ρ, of what does not depend
            on u.
        steep, bend: the same of what e^{2u} multiplies.
        unit: ∫P_s w ρ.
    """

    def __init__(self, flow: Flow, circle: Elements, axis: NoiseAxis) -> None:
        self.flow, self.circle, self.axis = flow, circle, axis
        phi = circle.points
        self.shape = circle.size, axis.size
        self.size = circle.size * axis.size
        still, cubic = circle.mass(np.ones_like(phi)), flow.cubic
        self.rise: Factors = {}
        self.turn: Factors = {None: still}
        for rate in flow.linear:
            self.rise[rate.g] = self.rise.get(rate.g, 0) + circle.mass(flow.rise(rate, phi))
            self.turn[rate.g] = self.turn.get(rate.g, 0) + circle.convection(rate.h(phi))
        self.steep: Factors = {one: circle.mass(flow.rise(cubic, phi))}
        self.bend: Factors = {one: circle.convection(cubic.h(phi))}
        self.noise = {g: dense(axis.matrix(g)) for g in {one, *self.rise}} | {None: dense(axis.matrix(None)).T}
        self.unit = np.kron(still, self.noise[one])
        self.constant = np.kron(circle.constant, axis.constant)
        self.xi_mean = self.noise[one] @ axis.constant
        """∫P_s of each function of ξ."""

    def whole(self, factors: Factors) -> FloatArray:
        """A matrix between all functions, shape (size, size)."""
        return np.asarray(sum(np.kron(matrix, self.noise[g]) for g, matrix in factors.items()))

    def outflow(self, square: float, sign: int) -> FloatArray:
        """∫P_s max(±u̇, 0) w ρ at e^{2u} = `square`, by a rule with as many points as there are."""
        at, circle = self.axis.samples(), self.circle
        speed = self.speed(square, circle.points, at.xi)
        weights = circle.weights[:, None] * self.axis.rule.measure * np.maximum(sign * speed, 0)
        values, noise = circle.values, dense(at.values)
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

    def flux(self, values: FloatArray) -> float:
        """∫P_s φ̇ρ at the wall, where no noise changes φ̇, of coefficients of φ and ξ."""
        end, mean = self.flow.half_turn[1:], self.flow.problem.valued.mean
        speed = sum(float(rate.g(mean)) * float(rate.h(end)[0]) for rate in self.flow.linear)
        return float(speed * (np.kron(self.circle.at(end)[0], self.xi_mean) @ values))

    def integrals(self, f: FloatArray, g: Coefficient) -> FloatArray:
        """∫ f(φ) P_s g(ξ) ρ as a vector over the functions, f at the points of φ."""
        noise = self.xi_mean if g == one else dense(self.axis.matrix(g)).T @ self.axis.constant
        return np.asarray(np.kron((self.circle.weights * f) @ self.circle.values, noise))
