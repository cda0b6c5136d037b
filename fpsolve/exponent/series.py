"""The perturbation series Λ(p) = Σ εⁿ Λₙ(p) to any order, by the recursion (21)-(23), as an asymptotic series.

In coordinates in which the order 0 rotates, x = a e, and with every jump gauged away, T = e^{pγ(φ)} T̃, where γ rises
by Σ ln R along half a turn and falls by ln R at each ray, the terms of order n are

    Lₙ = Σ gₙ(ξ) (hₙ ∂φ + p (qₙ + Σ cₘ hₙ₋ₘ)),    c = γ′ = ± Σ ln R/π = Σ εᵐ cₘ,

R^p being e^{p ln R}: what is expanded is ln R, −ε²(1 − r) for the delta law, ln(1 − ε²(1 − r)) for that of restitution.
All coefficients are waves in 2φ. So T̃ₙ has the waves up to 2nφ alone, and L₀ couples none of them:

    (L_ξ + 2iωk) Tₙₖ = Σⱼ (Λⱼ − Lⱼ) Tₙ₋ⱼ |ₖ,    Λₙ = ⟨P_s, Σⱼ Lⱼ Tₙ₋ⱼ⟩,    ⟨P_s, Tₙ⟩ = 0 for n > 0.

L₀ is factorised once for all n and p, bordered at k = 0, where it is singular. The functions of ξ are those of the
finite elements, without a tilt: with Gaussian noise, a chain or an angle the recursion is exact, but for rounding. The
elements in φ do not serve here: their penalties and loads at vertices, and R^p, mix the orders of ε.

A second solve has more functions of ξ, and follows the adjoint recursion. So its difference from the first tells both
errors, of the functions of ξ and of rounding.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
import scipy.sparse
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, dense, is_whole, one, real_number, real_numbers, shown
from fpsolve.data import Quantity, Result, dataset
from fpsolve.errors import NoPerturbationTheory
from fpsolve.fem.space import first_axis
from fpsolve.model.frame import is_free
from fpsolve.model.plane import CoefficientMatrix, Harmonics, matrix_at, rotating_coordinates, stretching, turning
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.model.quantity import COEFFICIENT, ORDER, P

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

MOST_ORDERS = 40
"""Largest order of a series."""
GROWN = 2.0
"""From this multiple of the smallest term on, terms are those that grow."""
MOST_FUNCTIONS = 300
"""Of all noises together."""
_EPS = sys.float_info.epsilon


@dataclass(frozen=True, eq=False, repr=False)
class PerturbationSeries(Result):
    """Λ(p) = Σ εⁿ Λₙ(p) up to an order, at several p.

    Attributes:
        p: the moments, shape (n,).
        coefficients: Λ₀, Λ₁, … up to the highest order N, shape (N + 1, n); Λₙ is what εⁿ multiplies.
        error_estimate: their errors, shape (N + 1, n).
        epsilon: ε of the problem, at which sums are taken if no other is given.
        parameters: of the problem, by keys such as "noise.D0".
    """

    p: FloatArray
    coefficients: FloatArray
    error_estimate: FloatArray
    epsilon: float
    parameters: Mapping[str, float | str]

    def terms(self, epsilon: float | None = None) -> FloatArray:
        """εⁿ Λₙ(p), shape (N + 1, n); 0 where Λₙ cannot be told from it."""
        powers = self._epsilon(epsilon) ** np.arange(len(self.coefficients))
        return np.asarray(powers[:, None] * self._sure)

    @property
    def _sure(self) -> FloatArray:
        """The coefficients, 0 in place of those that are within their error of it."""
        return np.where(np.abs(self.coefficients) > self.error_estimate, self.coefficients, 0.0)

    def partial_sums(self, epsilon: float | None = None) -> FloatArray:
        """Σ εᵏ Λₖ(p) over k ≤ n, shape (N + 1, n)."""
        return np.cumsum(self.terms(epsilon), axis=0)

    def best_order(self, epsilon: float | None = None) -> Any:
        """The order up to which the sum has the smallest error, shape (n,).

        The terms first fall, and then they grow, as the series is asymptotic. What a sum leaves out is about what the
        terms after it add until they grow. Where they still fall at the highest order, the rest is that of a geometric
        series.
        """
        return np.array([_best(column)[0] for column in self._sizes(epsilon).T])

    def value(self, epsilon: float | None = None) -> FloatArray:
        """The sum up to the `best_order`, shape (n,)."""
        return self.partial_sums(epsilon)[self.best_order(epsilon), np.arange(self.p.size)]

    def value_error(self, epsilon: float | None = None) -> FloatArray:
        """About what that leaves out, shape (n,), with the errors of the coefficients."""
        orders, epsilon = self.best_order(epsilon), self._epsilon(epsilon)
        rounding = np.cumsum(epsilon ** np.arange(len(self.coefficients))[:, None] * self.error_estimate, axis=0)
        left = np.array([_best(column)[1] for column in self._sizes(epsilon).T])
        return np.asarray(left + rounding[orders, np.arange(self.p.size)])

    def pade(self, epsilon: float | None = None) -> FloatArray:
        """The diagonal Padé approximants of Λ/ε², or of Λ where Λ₀ or Λ₁ is not 0, times that, shape (n,).

        They are in ε² where the odd orders vanish, else in ε, and use all orders; for an odd number of coefficients
        both degrees are the same, else that of the denominator is one more.
        """
        epsilon = self._epsilon(epsilon)
        sure = self._sure
        first = 0 if np.any(sure[:2]) else 2
        step = 1 if np.any(sure[1::2]) else 2
        columns = sure[first::step]
        powers = epsilon ** (step * np.arange(len(columns)))
        return np.array([epsilon**first * _pade(column) for column in (powers[:, None] * columns).T])

    def second_order_range(self, share: float = 0.01) -> FloatArray:
        """The ε up to which the orders above the second change its sum by no more than a share, shape (n,).

        It is the smallest ε > 0 with |Σ_{n>2} εⁿ Λₙ| = share |Σ_{n≤2} εⁿ Λₙ|; ∞ where there is none.
        """
        return np.array([_reach(column, real_number(share, "share")) for column in self._sure.T])

    def to_xarray(self) -> xarray.Dataset:
        """Λₙ(p) over n and p, with the errors."""
        numbers = {COEFFICIENT: self.coefficients, COEFFICIENT.error(): self.error_estimate}
        places: dict[Quantity, Any] = {ORDER: np.arange(len(self.coefficients)), P: self.p}
        return dataset(COEFFICIENT.words, "perturbation theory", numbers, places, self.parameters)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        sizes = np.where(self._sure, np.abs(self.terms()), math.nan)
        for p, column in zip(self.p, sizes.T, strict=True):
            seen = np.isfinite(column)
            axes.semilogy(np.flatnonzero(seen), column[seen], "o-", **{"label": f"p = {p:g}", **kwargs})
        axes.set(
            xlabel="order $n$ of the term", ylabel=rf"$|\varepsilon^n\Lambda_n|$ at $\varepsilon$ = {self.epsilon:g}"
        )
        if 1 < self.p.size <= 8:
            axes.legend(frameon=False)

    def __str__(self) -> str:
        """For each p the best order at ε of the problem, the sum and its error, and how far the second order goes."""
        lines = [f"Λ(p) to the order {len(self.coefficients) - 1}, at epsilon = {self.epsilon:g}"]
        columns = self.p, self.value(), self.value_error(), self.best_order(), self.second_order_range()
        for p, value, error, order, reach in zip(*columns, strict=True):
            lines.append(
                f"p = {p:g}: {value:.10g} ± {error:.0e}, the smallest error, at order {order}; second order serves to "
                f"1 % up to epsilon = {reach:.3g}"
            )
        return "\n".join(lines)

    def _said(self) -> str:
        return f"to the order {len(self.coefficients) - 1}, {self.p.size} p, at epsilon = {self.epsilon:g}"

    def _epsilon(self, given: float | None) -> float:
        return self.epsilon if given is None else real_number(given, "epsilon")

    def _sizes(self, epsilon: float | None) -> FloatArray:
        return np.abs(self.terms(epsilon))


def perturbation_series(problem: Problem, p: ArrayLike, *, order: int = 6, rtol: float = 1e-8) -> PerturbationSeries:
    """Λₙ(p) of Λ(p) = Σ εⁿ Λₙ(p), from the terms of the problem keyed by the order of ε, n = 0 to `order`.

    ε²Λ₂ is that of `second_order`, but for noise of Eq. (7) that is not reduced: there Λ₂ is that of the noise itself.
    The series is asymptotic: it has a best order for each ε, see `PerturbationSeries`.

    Args:
        problem: a motion and its noise.
        p: one moment, or an array of shape (n,).
        order: the highest one, 1 to `MOST_ORDERS`.
        rtol: what the error of a coefficient may be, relative to the largest one at some p of the same order; where
            the functions of the noise do not suffice, `error_estimate` tells what is left.

    Raises:
        ValueError: p is not finite, or empty, or the order is out of its range.
        NoPerturbationTheory: the order 0 does not rotate, or is driven by noise; or the noise consists of impulses, or
            has algebraic tails, by which all but the first orders are infinite.
    """
    points = real_numbers(p, "p")
    if not is_whole(order, 1, MOST_ORDERS):
        raise ValueError(f"got order = {shown(order)}; must be a whole number from 1 to {MOST_ORDERS}")
    _refuse(problem)
    count, found = order, _Recursion(problem, order, order)
    while True:
        count += max(count // 2, 4)
        finer = _Recursion(problem, order, count)
        (right, _), (left, rounding) = (
            np.array([solve(each) for each in points.tolist()]).transpose(1, 2, 0)
            for solve in (found.right, finer.left)
        )
        size = np.max(np.abs(left), axis=1, keepdims=True)
        change = np.abs(left - right)
        if found.is_complete or np.all(change <= np.maximum(rtol * size, rounding)) or 2 * finer.size > MOST_FUNCTIONS:
            break
        found = finer
    return PerturbationSeries(points, left, change + rounding, problem.system.epsilon, problem.values)


def _refuse(problem: Problem) -> None:
    """Raises `NoPerturbationTheory`."""
    if checked_problem(problem).dimension > 2:
        raise NoPerturbationTheory("perturbation theory is for two variables only")
    if problem.impulses:
        raise NoPerturbationTheory("perturbation theory is for weak noise, not for impulses")
    if problem.has_algebraic_tails:
        raise NoPerturbationTheory(
            "for r0 > 1 the noise has algebraic tails, so that all but the first orders of Λ(p) are infinite; choose "
            "r0 <= 1, or the Ornstein-Uhlenbeck reduction of the noise"
        )
    steady = matrix_at(problem.motion, 0.0, slice(0, 1))
    driven = [term for term in problem.motion.terms if term.order == 0 and not is_free(term)]
    if driven or any(each.order == 0 for each in problem.diffusions):
        raise NoPerturbationTheory("a term of order 0 is driven by noise; give it the order 1, and epsilon its size")
    if rotating_coordinates(steady) is None:
        raise NoPerturbationTheory(
            "perturbation theory is for motions that rotate without noise, which this one does not"
        )


class _Recursion:
    """The recursion with some functions of the noises, and its adjoint.

    Args:
        problem: whose order 0 rotates.
        order: the highest one.
        count: so many functions of a noise at least.
    """

    def __init__(self, problem: Problem, order: int, count: int) -> None:
        self.order, system = order, problem.motion
        steady = matrix_at(system, 0.0, slice(0, 1))
        frame = rotating_coordinates(steady)
        assert frame is not None
        self._axes = [first_axis(noise, 2 * count) for noise in problem.coloured.parts.values()]
        self._names = [*problem.coloured.parts]
        self.size = math.prod(axis.size for axis in self._axes)
        self.is_complete = all(noise.has_states for noise in problem.coloured.parts.values())
        waves = order + 1
        self._waves = 2j * np.arange(-waves, waves + 1)
        self._start = reduce(np.multiply.outer, [axis.constant for axis in self._axes]).ravel()
        self._mass = self._product({})
        generator = sum(self._product({k: None}) for k in range(len(self._axes)))
        free = np.linalg.inv(frame) @ steady @ frame
        self._growth, speed = float(stretching(free).mean), float(turning(free).mean)
        self._size = float(np.abs(free).sum())
        self._slopes = math.copysign(1.0, speed) / math.pi * problem.system.log_factors_by_order(order)
        self._factors = [
            scipy.linalg.lu_factor(self._bordered(generator) if wave == 0 else generator + speed * wave * self._mass)
            for wave in self._waves
        ]

        def turned(term: CoefficientMatrix) -> tuple[Harmonics, Harmonics]:
            matrix = np.linalg.inv(frame) @ np.array(term.matrix) @ frame
            return turning(matrix), stretching(matrix)

        self._free = Harmonics(speed, 0.0, 0.0)
        terms = [term for term in system.terms if 0 < term.order <= order]
        self._noises = [self._mass, *(self._product({self._at(term.noise): term.g}) for term in terms)]
        self._driven = [(term.order, *turned(term), 1 + k) for k, term in enumerate(terms)]
        self._diffused = [(each.order, *turned(each)) for each in problem.diffusions if 2 * each.order <= order]

    def right(self, p: float) -> FloatArray:
        """Λₙ from the recursion for T, and the rounding of their last sum, shape (2, order + 1)."""
        return self._solve(self._terms(p), self._noises, p, 0)

    def left(self, p: float) -> FloatArray:
        """The same from that for T*."""
        adjoint = [(order, k, phase.T.tocsr()) for order, k, phase in self._terms(p)]
        return self._solve(adjoint, [noise.T for noise in self._noises], p, 1)

    def _solve(
        self, terms: Sequence[tuple[int, int, Any]], noises: Sequence[Any], p: float, transposed: int
    ) -> FloatArray:
        """Functions are tables of waves × functions of ξ."""
        middle = self._waves.size // 2
        start = np.zeros((self._waves.size, self.size), dtype=complex)
        start[middle] = self._start
        norm = float(self._start @ self._mass @ self._start)
        seen = [np.abs(noise.T) @ np.abs(self._start) / norm for noise in noises]
        rows = [np.abs(phase.toarray()[middle]) for *_, phase in terms]
        functions, images = [start], [[start @ noise.T for noise in noises]]
        values, sizes = np.zeros(self.order + 1), np.zeros(self.order + 1)
        values[0], sizes[0] = p * self._growth, p * self._size
        for n in range(1, self.order + 1):
            load = np.zeros_like(start)
            for (j, k, phase), row in zip(terms, rows, strict=True):
                if j <= n:
                    load -= phase @ images[n - j][k]
                    sizes[n] += row @ (np.abs(functions[n - j]) @ seen[k])
            # of Λⱼ Tₙ₋ⱼ those with j < n have no mean
            values[n] = -float((load[middle] @ self._start).real) / norm
            for j in range(1, n + 1):
                load += values[j] * images[n - j][0]
            new = np.empty_like(start)
            for k, (factor, row) in enumerate(zip(self._factors, load, strict=True)):
                row = np.append(row, 0.0) if k == middle else row
                new[k] = scipy.linalg.lu_solve(factor, row, trans=transposed)[: self.size]
            functions.append(new)
            images.append([new @ noise.T for noise in noises])
        return np.array([values, 16 * _EPS * np.abs(sizes)])

    def _terms(self, p: float) -> list[tuple[int, int, Any]]:
        """L less L₀: the order of ε, the place of the matrix of the noises, and that of the waves."""
        found: dict[tuple[int, int], Any] = {}

        def add(order: int, phase: Any, noise: int) -> None:
            if order <= self.order:
                found[order, noise] = phase + found[order, noise] if (order, noise) in found else phase

        slopes = [(m, slope) for m, slope in enumerate(self._slopes.tolist()) if slope]
        for m, slope in slopes:
            add(m, p * slope * self._wave_matrix(self._free), 0)
        for order, h, q, noise in self._driven:
            along, stretch = self._wave_matrix(h), self._wave_matrix(q)
            add(order, along @ self._along + p * stretch, noise)
            for m, slope in slopes:
                add(order + m, p * slope * along, noise)
        for order, h, q in self._diffused:
            along, stretch = self._wave_matrix(h), self._wave_matrix(q)
            parts = [(0, along @ self._along + p * stretch), *((m, p * slope * along) for m, slope in slopes)]
            for i, first in parts:
                for j, last in parts:
                    add(2 * order + i + j, 0.5 * first @ last, 0)
        return [(*key, phase.tocsr()) for key, phase in found.items()]

    @property
    def _along(self) -> Any:
        """∂φ."""
        return scipy.sparse.diags_array(self._waves)

    def _wave_matrix(self, f: Harmonics) -> Any:
        """f(φ) times waves e^{2ikφ}."""
        count = self._waves.size
        up = 0.5 * (f.cosine - 1j * f.sine)
        diagonals = [np.full(count - 1, up), np.full(count, f.mean), np.full(count - 1, np.conj(up))]
        return scipy.sparse.diags_array(diagonals, offsets=[-1, 0, 1])

    def _bordered(self, generator: Any) -> Any:
        """L_ξ with the condition that the mean is 0."""
        weight = (self._mass @ self._start)[:, None]
        return np.block([[generator, weight], [weight.T, np.zeros((1, 1))]])

    def _at(self, name: str) -> int:
        return self._names.index(name) if name in self._names else 0

    def _product(self, of: Mapping[int, Any]) -> Any:
        """The matrix of the noises with functions of some of them, None for the generator."""
        matrices: list[Any] = [dense(axis.matrix(of.get(k, one))) for k, axis in enumerate(self._axes)]
        return reduce(np.kron, matrices)


def _best(sizes: FloatArray) -> tuple[int, float]:
    """The order of the sum with the smallest error, and about that error, from the sizes of the terms."""
    orders = np.flatnonzero(sizes)
    if orders.size < 3:
        return len(sizes) - 1, float(sizes[orders[-1]]) if orders.size else 0.0
    own = sizes[orders]
    for k in (1, 2):  # a term is small by chance where the terms change their sign
        own[k:-k] = np.maximum(own[k:-k], np.sqrt(own[2 * k :] * own[: -2 * k]))
    ratio = max(own[-1] / own[-2], own[-2] / own[-3])
    beyond = own[-1] * ratio / (1 - ratio) if ratio < 1 else math.inf  # as of a geometric series
    left = [beyond]
    for j in range(own.size - 2, 0, -1):
        rest = own[j + 1 :]
        count = int(np.flatnonzero(rest <= GROWN * rest.min())[-1]) + 1
        left.append(float(rest[:count].sum()) + (beyond if count == rest.size and ratio < 1 else 0.0))
    left.reverse()
    best = int(np.argmin(left))
    return int(orders[1 + best]), left[best]


def _pade(terms: FloatArray) -> float:
    """The diagonal Padé approximant of a sum of terms, those of a power series at 1."""
    m = terms.size // 2
    n = terms.size - 1 - m
    known = np.concatenate([np.zeros(m), terms])  # from the order −m on
    rows = np.array([known[n + k : n + k + m] for k in range(1, m + 1)])[:, ::-1]
    below = np.append(1.0, np.linalg.lstsq(rows, -terms[n + 1 :], rcond=1e-14)[0] if m else [])
    above = np.convolve(below, terms)[: n + 1]
    return float(above.sum() / below.sum())


def _reach(column: FloatArray, share: float) -> float:
    """See `second_order_range`."""
    low, high = column.copy(), column.copy()
    low[3:], high[:3] = 0.0, 0.0
    roots = np.concatenate([np.roots((high - side * share * low)[::-1]) for side in (-1, 1)])
    real = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(real.min()) if real.size else math.inf
