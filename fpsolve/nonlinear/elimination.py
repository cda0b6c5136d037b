"""The stationary density on an interval of u, by elimination of one element after the other.

Below the interval the density is small and the motion nearly linear. There

    ρ = Σ_k e^{(κ + 2k) u} Ψ_k(φ, ξ),    κ = −δ_p > 0,

Ψ₀ being T* at p = δ_p in the gauge, and the others what e^{2u} makes of the one before. What flows from there into the
interval is known up to one factor, which the normalisation gives. Above the interval there is nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve

from fpsolve.arrays import FloatArray, one
from fpsolve.budget import charge
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import LevelFactors
from fpsolve.nonlinear.operator import Elements, Plane

TAIL_TERMS = 8
"""Number of terms of the series in e^{2u}."""
STEPS = 30
"""Largest number of steps of the iteration for κ."""
Tables = Sequence[FloatArray]


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
    charge(plane.size)
    rise, turn, steep, bend = map(plane.whole, (plane.rise, plane.turn, plane.steep, plane.bend))
    factors = lu_factor(turn - guess * rise)
    psi, kappa = plane.constant.copy(), guess
    for _ in range(STEPS):  # turn Ψ = κ rise Ψ
        new = lu_solve(factors, rise @ psi)
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
        right = power * (steep @ terms[-1]) - bend @ terms[-1]
        terms.append(np.linalg.solve(turn - power * rise, right))
    return Tail(kappa, np.array(terms))


def mean_damping(plane: Plane) -> float:
    """κ: the mean of −u̇ over e^{2u} by the cubic terms, under the stationary law of φ and ξ near rest."""
    turn, steep, mass = plane.whole(plane.turn), plane.whole(plane.steep), plane.unit @ plane.constant
    law = np.linalg.solve(turn + np.outer(mass, mass), mass)  # turn Ψ = 0 and ∫P_sΨ = 1, as no flow is into 1
    return -float(plane.constant @ (steep @ law)) / float(mass @ law)


@dataclass(frozen=True, eq=False)
class Solution:
    """A density, normalised.

    Attributes:
        plane, height, tail: what it is made of; `tail` has its factor.
        values: coefficients, shape (height.size, plane.size).
    """

    plane: Plane
    height: Elements
    tail: Tail
    values: FloatArray

    @property
    def left(self) -> float:
        return float(self.height.lines[0])

    def moments(self, n: float) -> FloatArray:
        """∫ e^{n u} ρ du over all u, shape (plane.size,)."""
        height = self.height
        inside = (height.weights * np.exp(n * height.points)) @ (height.values @ self.values)
        return np.asarray(inside + self.tail.moments(n, self.left))

    def shares(self, n: float) -> FloatArray:
        """E aⁿ by elements of u."""
        phi = self.plane.circle.points
        vector = self.plane.integrals(np.exp(n * self.plane.flow.gauge(phi)), one)
        density = self.height.values @ (self.values @ vector)
        inside = self.height.weights * np.exp(n * self.height.points) * density
        return np.asarray(inside.reshape(self.height.lines.size - 1, -1).sum(axis=1))

    def mean(self, n: float, f: FloatArray, g: Any) -> float:
        """E e^{n u} f(φ) g(ξ), f at the points of φ."""
        return float(self.plane.integrals(f, g) @ self.moments(n))

    def at(self, u: FloatArray, of: Callable[[FloatArray], FloatArray] = np.asarray) -> FloatArray:
        """Coefficients of the density at some u, shape (len(u), plane.size), or what a linear map makes of them."""
        found = np.asarray(self.height.at(u) @ of(self.values))
        found[u > self.height.lines[-1]] = 0
        below = np.flatnonzero(u < self.left)
        found[below] = np.exp(np.multiply.outer(u[below], self.tail.powers)) @ of(self.tail.terms)
        return found


class Cell:
    """The functions that live in one cell of u and φ, eliminated over the functions of ξ in turn.

    A matrix between functions is Σ_g W_g ⊗ N_g, W_g that of u and φ, N_g that of ξ, which couples neighbours only.

    Args:
        own: W_g between the functions of the cell.
        into, out: W_g of what others do to them, and they to others.
        noise: N_g.
    """

    def __init__(self, own: Tables, into: Tables, out: Tables, noise: Tables) -> None:
        self._into, self._out, self._noise = into, out, noise
        operator = KroneckerSum(list(zip(own, noise, strict=True)))
        self._factors = LevelFactors(operator, 1)

    def values(self, others: FloatArray) -> FloatArray:
        """The values of these functions, shape (n, n_ξ), from those of the others, shape (m, n_ξ)."""
        right = _sum(table @ others @ each.T for table, each in zip(self._into, self._noise, strict=True))
        return -self._factors.solve(right.ravel()).reshape(right.shape)

    def correction(self) -> FloatArray:
        """What eliminating them adds to the matrix between the others, shape (m, n_ξ, m, n_ξ)."""
        m, count = self._into[0].shape[1], len(self._noise[0])
        right = _sum(np.kron(table, each) for table, each in zip(self._into, self._noise, strict=True))
        values = self._factors.solve(right).reshape(-1, count * m * count)
        pushed = [(table @ values).reshape(m, count, -1) for table in self._out]
        return -_sum(each @ rows for each, rows in zip(self._noise, pushed, strict=True)).reshape(m, count, m, count)


class Element:
    """An element in u, of whose functions those that live in one cell are eliminated.

    Args:
        tables: W_g between the functions of u and φ, those of u slowest: of the vertex below, inner ones, and above.
        noise: N_g.
        circle: the functions of φ.

    Attributes:
        between: the matrix between the functions that are left, in the same order, those of ξ fastest.
    """

    def __init__(self, tables: Tables, noise: Tables, circle: Elements) -> None:
        pairs = np.arange(len(tables[0])).reshape(-1, circle.size)
        self._shape = *pairs.shape, len(noise[0])
        inside = [pairs[1:-1][:, bubbles].ravel() for bubbles in circle.bubbles]
        self._kept = np.setdiff1d(pairs, np.concatenate(inside))
        kept = [table[np.ix_(self._kept, self._kept)] for table in tables]
        self.between = _sum(np.kron(table, each) for table, each in zip(kept, noise, strict=True))
        together = self.between.reshape(self._kept.size, len(noise[0]), self._kept.size, len(noise[0]))
        self._cells: list[tuple[Any, Any, Cell]] = []
        is_coupled = np.any([(table != 0) | (table != 0).T for table in tables], axis=0)
        for inner in inside:
            beside = np.flatnonzero(is_coupled[np.ix_(inner, self._kept)].any(axis=0))
            others = self._kept[beside]
            own, into, out = (
                [table[np.ix_(rows, columns)] for table in tables]
                for rows, columns in ((inner, inner), (inner, others), (others, inner))
            )
            cell = Cell(own, into, out, noise)
            together[beside[:, None], :, beside] += cell.correction().transpose(0, 2, 1, 3)
            self._cells.append((inner, beside, cell))

    def values(self, kept: FloatArray) -> FloatArray:
        """The values of all functions from those that are left, shape (functions of u, those of φ and ξ)."""
        levels, phases, count = self._shape
        kept = kept.reshape(-1, count)
        values = np.zeros((levels * phases, count))
        values[self._kept] = kept
        for inner, beside, cell in self._cells:
            values[inner] = cell.values(kept[beside])
        return values.reshape(levels, phases * count)


def solved(plane: Plane, height: Elements, tail: Tail) -> Solution:
    """The density on an interval, from below to above.

    A vertex of u and what is left of the element above it are coupled to the next vertex only. They are eliminated
    together, which changes what couples that vertex with itself; the columns of the latter are kept.
    """
    flat, square = np.ones_like(height.points), np.exp(2 * height.points)
    parts = [
        (height.convection(flat), plane.rise),
        (height.convection(square), plane.steep),
        (height.mass(flat), plane.turn),
        (height.mass(square), plane.bend),
    ]

    def tables(functions: Any) -> Tables:
        """W_g between some functions of u and all of φ."""
        some = [(matrix[np.ix_(functions, functions)], factors) for matrix, factors in parts]
        return [_sum(np.kron(matrix, each[g]) for matrix, each in some if g in each) for g in plane.noise]

    noise, size = list(plane.noise.values()), plane.size
    (first, last), (below, above) = 1 / height.constant[height.vertices[[0, -1]]], np.exp(2 * height.lines[[0, -1]])
    front = -(first**2) * plane.outflow(below, -1)
    right = -first * (plane.outflow(below, 1) @ tail.at(height.lines[0]))
    stack: list[tuple[Any, Element, FloatArray]] = []
    for j, bubbles in enumerate(height.bubbles):
        functions = np.concatenate([height.vertices[[j]], bubbles, height.vertices[[j + 1]]])
        own = tables(functions)
        for table in own:
            table[-plane.circle.size :, -plane.circle.size :] = 0  # they are the next element's
        element = Element(own, noise, plane.circle)
        matrix = element.between
        matrix[:size, :size] += front
        inner = len(matrix) - size
        charge(height.size * size)
        columns = np.zeros((inner, size + 1))
        columns[:, :-1] = matrix[:-size, -size:]
        columns[:size, -1] = right
        columns = solve(matrix[:-size, :-size], columns, overwrite_b=True, check_finite=False)
        change = matrix[-size:, :-size] @ columns
        front, right = matrix[-size:, -size:] - change[:, :-1], -change[:, -1]
        stack.append((functions, element, columns))
    front = front - last**2 * plane.outflow(above, 1)
    front += _sum(np.kron(table, each) for table, each in zip(tables(height.vertices[[-1]]), noise, strict=True))
    values = np.zeros((height.size, size))
    found = np.linalg.solve(front, right)
    for functions, element, columns in reversed(stack):
        kept = np.append(columns[:, -1] - columns[:, :-1] @ found, found)
        values[functions] = element.values(kept)
        found = kept[:size]
    mass = Solution(plane, height, tail, values).mean(0, np.ones_like(plane.circle.points), one)
    return Solution(plane, height, Tail(tail.exponent, tail.terms / mass), values / mass)


def _sum(tables: Iterable[Any]) -> FloatArray:
    return np.asarray(reduce(np.add, tables))
