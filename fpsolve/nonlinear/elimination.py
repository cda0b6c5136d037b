"""The stationary density on an interval of u, by elimination of one element after the other.

Below the interval the density is small and the motion nearly linear. There

    ρ = Σ_k e^{(κ + 2k) u} Ψ_k(φ, ξ),    κ = −δ_p > 0,

Ψ₀ being T* at p = δ_p in the gauge, and the others what e^{2u} makes of the one before. What flows from there into the
interval is known up to one factor, which the normalisation gives. Above the interval there is nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve

from fpsolve.arrays import FloatArray, one
from fpsolve.nonlinear.operator import Height, Plane

TAIL_TERMS = 8
"""Of the series in e^{2u}."""
STEPS = 30
"""Of the iteration for κ."""


@dataclass(frozen=True, eq=False)
class Tail:
    """The density below the interval.

    Attributes:
        exponent: κ.
        terms: Ψ_k, shape (TAIL_TERMS, size).
    """

    exponent: float
    terms: FloatArray

    @cached_property
    def sizes(self) -> FloatArray:
        """‖Ψ_k‖."""
        return np.asarray(np.linalg.norm(self.terms, axis=1))

    @property
    def powers(self) -> FloatArray:
        return np.asarray(self.exponent + 2 * np.arange(len(self.terms)))

    def reach(self, tolerance: float) -> float:
        """The u up to which the last two terms of the series are below a share of the first."""
        k = np.arange(len(self.terms))[-2:]
        return float(np.min(np.log(tolerance * self.sizes[0] / np.maximum(self.sizes[-2:], 1e-300)) / (2 * k)))

    def at(self, u: float) -> FloatArray:
        """Coefficients of the density at one u, but for a factor, shape (size,)."""
        return np.asarray(np.exp(self.powers * u) @ self.terms)

    def moments(self, n: float, u: float) -> FloatArray:
        """∫ e^{n u} ρ du from −∞ to u, shape (size,)."""
        return np.asarray((np.exp((self.powers + n) * u) / (self.powers + n)) @ self.terms)


def solved_tail(plane: Plane, guess: float) -> Tail:
    """The tail whose exponent is closest to a guess, −δ_p."""
    factors = lu_factor(plane.turn - guess * plane.rise)
    psi, kappa = plane.constant.copy(), guess
    for _ in range(STEPS):  # turn Ψ = κ rise Ψ
        new = lu_solve(factors, plane.rise @ psi)
        change = float(psi @ psi / (psi @ new))
        psi = new / np.linalg.norm(new)
        if abs(change - (kappa - guess)) < 1e-13 * abs(guess):
            kappa = guess + change
            break
        kappa = guess + change
    psi /= plane.constant @ (plane.unit @ psi)
    terms = [psi]
    for k in range(1, TAIL_TERMS):
        power = kappa + 2 * k
        right = power * (plane.steep @ terms[-1]) - plane.bend @ terms[-1]
        terms.append(np.linalg.solve(plane.turn - power * plane.rise, right))
    return Tail(kappa, np.array(terms))


@dataclass(frozen=True, eq=False)
class Solution:
    """A density, normalised.

    Attributes:
        plane, height, tail: what it is made of; `tail` has its factor.
        values: coefficients, shape (height.size, plane.size).
    """

    plane: Plane
    height: Height
    tail: Tail
    values: FloatArray

    @property
    def left(self) -> float:
        return float(self.height.lines[0])

    def moments(self, n: float) -> FloatArray:
        """∫ e^{n u} ρ du over all u, shape (plane.size,)."""
        height = self.height
        inside = (height.weights * np.exp(n * height.points)) @ (height.line.values @ self.values)
        return np.asarray(inside + self.tail.moments(n, self.left))

    def mean(self, n: float, f: FloatArray, g: Any) -> float:
        """E e^{n u} f(φ) g(ξ), f at the points of φ."""
        return float(self.plane.integrals(f, g) @ self.moments(n))

    def at(self, u: FloatArray) -> FloatArray:
        """Coefficients of the density at some u, shape (len(u), plane.size)."""
        inside = np.asarray(self.height.line.at(u) @ self.values)
        inside[u > self.height.lines[-1]] = 0
        below = np.flatnonzero(u < self.left)
        inside[below] = np.exp(np.multiply.outer(u[below], self.tail.powers)) @ self.tail.terms
        return inside


def solved(plane: Plane, height: Height, tail: Tail) -> Solution:
    """The density on an interval, from below to above.

    A vertex and the bubbles above it are coupled to the next vertex only. They are eliminated together, which changes
    what couples that vertex with itself; the columns of the latter are kept.
    """
    flat, square = np.ones_like(height.points), np.exp(2 * height.points)
    parts: list[tuple[Any, Any]] = [
        (height.convection(flat), plane.rise),
        (height.convection(square), plane.steep),
        (height.mass(flat), plane.turn),
        (height.mass(square), plane.bend),
    ]
    size, (first, last), (below, above) = plane.size, height.end_values[[0, -1]], np.exp(2 * height.lines[[0, -1]])
    front = -(first**2) * plane.outflow(below, -1)
    right = -first * (plane.outflow(below, 1) @ tail.at(height.lines[0]))
    kept: list[tuple[Any, FloatArray]] = []
    for j, bubbles in enumerate(height.bubbles):
        own, following = np.append(height.vertices[j], bubbles), height.vertices[[j + 1]]
        inner = _block(parts, own, own)
        inner[:size, :size] += front
        columns = np.zeros((len(inner), size + 1))
        columns[:, :-1] = _block(parts, own, following)
        columns[:size, -1] = right
        columns = solve(inner, columns, overwrite_a=True, overwrite_b=True, check_finite=False)
        change = _block(parts, following, own) @ columns
        front, right = -change[:, :-1], -change[:, -1]
        kept.append((own, columns))
    front += _block(parts, height.vertices[[-1]], height.vertices[[-1]]) - last**2 * plane.outflow(above, 1)
    values = np.zeros((height.size, size))
    found = values[height.vertices[-1]] = np.linalg.solve(front, right)
    for own, columns in reversed(kept):
        values[own] = (columns[:, -1] - columns[:, :-1] @ found).reshape(own.size, size)
        found = values[own[0]]
    mass = Solution(plane, height, tail, values).mean(0, np.ones_like(plane.circle.points), one)
    return Solution(plane, height, Tail(tail.exponent, tail.terms / mass), values / mass)


def _block(parts: Sequence[tuple[Any, Any]], rows: Any, columns: Any) -> FloatArray:
    """Σ U ⊗ V at some of the functions of u."""
    return np.asarray(sum(np.kron(matrix[rows][:, columns].toarray(), plane) for matrix, plane in parts))
