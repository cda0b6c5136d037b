"""Second moments of a state with delays: the σ at which shifted moments neither grow nor fall, without a mesh.

ẋ = A x + Σ B_k x(t − kτ), with white noises Σ D_k x(t − kτ) dW (Itô) and loads on functions f of a noise. For moments
that grow as e^σt those of y = e^(−σt/2) x stand still. It moves alike, with A − σ/2, e^(−σkτ/2)B_k and e^(−σkτ/2)D_k.
So S(s) = E y(u + s) y(u)ᵀ f(u + s), s ≥ 0, is linear in S(0), see `_later`, and

    Z(σ) S(0) = −(A S(0) + Σ B_k S(kτ)ᵀ) − (…)ᵀ − ΣΣ D_k E y(−kτ) y(−lτ)ᵀ D_lᵀ − Gᵀ S(0) = 0

at σ = Λ(2), the rightmost: Z⁻¹ is ∫ e^(−σt) of the moments of all paths, positive for σ > Λ (J. E. Marshall et al.,
Time-Delay Systems, 1992; V. Kharitonov, Time-Delay Systems, 2013, on the delay Lyapunov matrix S without noise).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebpts2, chebval, chebvander
from scipy import sparse
from scipy.linalg import eig, expm

from fpsolve.arrays import FloatArray, IntArray, dense, finite
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.powers import Moving, PowerRates, moment_form
from fpsolve.exponent.rightmost import REMEDY, ROUNDING, Eigenpair
from fpsolve.model.plane import common_unit

MOST_SIZE = 4000
"""Largest number of values of moments at all times of a polynomial."""
MOST_ROOTS = 1200
"""Largest number of values of means at these."""
STRIDE = 0.5
"""Logarithm of the factor between two σ − 2a, a the growth rate of E x."""
NEAREST = 1e-6
"""Share of the bounds of Λ to which σ − 2a falls: y stands still without noise at 2a, next to which Z is not known."""
NEAR = 0.03
"""Share of σ − 2a from which on Newton's method finds Λ."""
MOST_POLISHES = 10
"""Largest number of steps of Newton's method."""
SAME_ROOT = 1e-10
"""Change of a over its size, or that of 1/τ, that is none."""
NEGATIVE = 1e-6
"""Share of the largest second moment by which one may be negative that should not be."""
ROUNDED = 10 * ROUNDING
"""Error of Z by rounding, over its terms."""
LARGEST = 300.0
"""Largest exponent, −Λτ/2, beyond which numbers overflow."""
FEWEST, SHARE, GROWTH = 10, 0.6, 1.2
"""Degree of polynomials of the time: at least, over what moves S meanwhile, and from one to the next."""
TINY = 1e-20
"""Imaginary part of a σ that differentiates."""


@dataclass(frozen=True, eq=False)
class DelayRates:
    """−Z(σ) of moments S(0) with some functions of the noise.

    Attributes:
        unit: τ.
        drift, loads, squares: A and B_k, of each load and D_k of each white noise, shape (count + 1, n, n).
        generator: Gᵀ.
        masses: Ξᵀ of each load.
        finer: how many times degrees of polynomials are multiplied beyond what is usual.
    """

    unit: float
    drift: FloatArray
    loads: Sequence[FloatArray]
    squares: Sequence[FloatArray]
    generator: FloatArray
    masses: Sequence[FloatArray]
    finer: int

    @classmethod
    def of(
        cls, moving: Moving, pasts: Sequence[tuple[int, float]], generator: Any, masses: Sequence[Any], finer: int
    ) -> DelayRates:
        """That of a state and its past values, as one vector with rates of the state alone.

        Args:
            moving: what moves it.
            pasts: of each of the last variables which one it is, and how long ago.
            generator: Gᵀ.
            masses: Ξᵀ of each load.
            finer: how many times degrees of polynomials are multiplied.

        Raises:
            NoHierarchy: the delays are no multiples of one.
        """
        try:
            unit, count = common_unit([delay for _, delay in pasts], "delays")
        except ValueError as failure:
            raise NoHierarchy(str(failure)) from failure
        drift, squares = moving.of_squares()
        n = len(drift) - len(pasts)

        def split(matrix: FloatArray) -> FloatArray:
            found = np.zeros((count + 1, n, n))
            found[0] = matrix[:n, :n]
            for column, (variable, delay) in enumerate(pasts, n):
                found[round(delay / unit), :, variable] += matrix[:n, column]
            return found

        loads, squares = ([split(each) for each in of] for of in (moving.loads, squares))
        return cls(unit, split(drift), loads, squares, dense(generator), [*map(dense, masses)], finer)

    def on(self, functions: Any) -> DelayRates:
        """That of some functions of the noise."""
        at = np.ix_(*2 * [np.flatnonzero(functions)])
        return replace(self, generator=self.generator[at], masses=[each[at] for each in self.masses])

    def at(self, sigma: float) -> PowerRates:
        """σ − Z(σ), whose eigenvalue Λ is for σ = Λ."""
        z = self.matrix(sigma)
        return PowerRates(sparse.csc_array(sigma * np.eye(len(z)) - z), len(z) // len(self.generator))

    @property
    def is_still(self) -> bool:
        """Whether no noise multiplies the state: then Λ(2) is twice the growth rate of E x."""
        return not np.any([*self.loads, *self.squares])

    def matrix(self, sigma: Any) -> Any:
        """Z(σ); where Λ is always 2a that is known, σ − 2a without functions of the noise."""
        if self.is_still:
            size = self._even.shape[1]
            own = np.eye(size // len(self.generator))
            return (sigma - 2 * self._slowest.real) * np.eye(size) - np.kron(self.generator, own)
        return -self._even.T @ sum(self._terms(sigma)) @ self._even

    def sizes(self, sigma: float) -> FloatArray:
        """Σ |terms| that Z(σ) is the sum of."""
        even = np.abs(self._even)
        return even.T @ sum(map(np.abs, self._terms(sigma))) @ even

    @property
    def _count(self) -> int:
        """How many parts the largest delay has."""
        return len(self.drift) - 1

    @property
    def _last(self) -> float:
        """The largest delay."""
        return self.unit * self._count

    @cached_property
    def _even(self) -> Any:
        """Symmetric matrices S(0), row by row, of their upper halves, for each function."""
        n = len(self.drift[0])
        one = np.eye(n * (n + 1) // 2)
        return np.kron(np.eye(len(self.generator)), moment_form(one, n, 2).reshape(len(one), -1).T)

    @cached_property
    def _turned(self) -> IntArray:
        """Where the numbers of all matrices are that of their transposes."""
        n = len(self.drift[0])
        return np.arange(len(self.generator) * n * n).reshape(-1, n, n).swapaxes(1, 2).ravel()

    def _acting(self, one: FloatArray) -> Any:
        """What multiplies x(t − kτ), with functions of the noise and for all columns of a matrix, by k."""
        terms = [(np.eye(len(self.generator)), self.drift), *zip(self.masses, self.loads, strict=True)]
        return np.array([sum(np.kron(xi, np.kron(by[k], one)) for xi, by in terms) for k in range(self._count + 1)])

    def _terms(self, sigma: Any) -> list[Any]:
        """What −Z(σ) is the sum of, on all matrices S(0) for each function."""
        one = np.eye(len(self.drift[0]))
        fall = _exp(-0.5 * sigma * self.unit * np.arange(self._count + 1))[:, None, None]
        moving, own = self._acting(one) * fall, np.kron(self.generator, np.kron(one, one))
        shift = sigma * np.eye(len(own))
        moving[0] -= 0.5 * shift
        later = self._later(moving, own)
        terms = [2 * moving[0] + shift, -shift, own]
        terms += [2 * each[:, self._turned] @ s for each, s in zip(moving[1:], later[1:], strict=True)]
        for square in self.squares:
            parts = square * fall
            reached = [k for k, each in enumerate(square) if each.any()]
            for k, j in combinations_with_replacement(reached, 2):
                relaxed = np.kron(expm(self.generator * self.unit * k), np.kron(parts[k], parts[j]))
                terms.append((1 if k == j else 2) * relaxed @ later[j - k])
        return terms

    def _later(self, moving: Any, own: FloatArray) -> Any:
        """S(kτ) of S(0) for each k, by polynomials of the time within each part of the largest delay.

        As functions of the noise relax meanwhile, S(s) is driven by S(kτ − s)ᵀ with coefficients that depend on s.

        Args:
            moving: what multiplies y(t − kτ).
            own: Gᵀ for all matrices.

        Raises:
            NoHierarchy: there are too many values.
        """
        count, width = self._count, len(own)
        slow = SHARE * np.linalg.norm(sum(map(np.abs, moving)), 2) * self.unit
        slow += math.sqrt(np.max(np.abs(own)) * self.unit)
        x, slopes, _ = _polynomials(math.ceil((FEWEST + slow) * GROWTH**self.finer))
        if (size := count * x.size * width) > MOST_SIZE:
            raise NoHierarchy(f"{size} second moments over a delay are more than {MOST_SIZE}; {REMEDY}")
        whole = np.zeros(2 * (count, x.size, width), dtype=moving.dtype)
        starts, one, every = np.zeros((count, x.size, width, width)), np.eye(width), np.arange(x.size)
        for j in range(count):
            whole[j, :, :, j] = np.multiply.outer((2 / self.unit) * slopes, one).swapaxes(1, 2)
            whole[j, every, :, j, every] -= own
            for k, each in enumerate(moving):
                if k <= j:
                    whole[j, every, :, j - k, every] -= each @ self._relaxed(self.unit * k)
                else:
                    past = each @ self._relaxed(self.unit * (j + 0.5 * (1 + x)))
                    whole[j, every, :, k - j - 1, -1 - every] -= past[..., self._turned]
            whole[j, 0] = 0.0  # each part begins where one ends
            whole[j, 0, :, j, 0] = one
            whole[j, 0, :, j - 1, -1] -= one * (j > 0)
        starts[0, 0] = one
        found = np.linalg.solve(whole.reshape(size, size), starts.reshape(size, width)).reshape(starts.shape)
        return [one, *found[:, -1]]

    def _relaxed(self, time: Any) -> Any:
        """What functions of the noise become, for all matrices, after a time, or several."""
        return np.kron(expm(np.multiply.outer(time, self.generator)), np.eye(self.drift[0].size))

    @cached_property
    def _slowest(self) -> complex:
        """The rightmost root s of det(s − A − Σ B_k e^(−skτ)), by polynomials of the time: E x f grows so.

        They are times e^at of the last a. Of waves with a frequency ν, roots repeat at multiples of iν; these do not
        count where there are too few nodes for them.
        """
        moving, found = self._acting(np.eye(1)), 0j
        size, one, last = len(moving[0]), np.eye(len(self.drift[0])), self._last
        degree = FEWEST + last * np.linalg.norm(sum(map(np.abs, moving)), 2)
        moving = moving @ np.kron(expm(np.multiply.outer(self.unit * np.arange(len(moving)), self.generator)), one)
        moving[0] += np.kron(self.generator, one)
        while size * degree <= MOST_ROOTS:
            _, slopes, through = _polynomials(math.ceil(degree))
            whole = np.kron((2 / last) * slopes, np.eye(size))
            fall = _exp(-found.real * self.unit * np.arange(len(moving)))[:, None, None]
            at = chebval(1 - 2 * np.arange(len(moving)) / self._count, through).T
            now = [np.kron(row[None], each) for row, each in zip(at, fall * moving, strict=True)]
            whole[-size:] = sum(now) - found.real * np.eye(size, whole.shape[1], k=len(whole) - size)
            roots = np.linalg.eigvals(whole) + found.real
            before, found = found, max(roots[abs(roots.imag) * last <= degree], key=lambda root: root.real)
            if abs(found.real - before.real) <= SAME_ROOT * (abs(found) + 1 / last):
                return complex(found)
            degree *= GROWTH
        raise NoHierarchy(f"the largest growth rate without noise is not found for a delay so long; {REMEDY}")

    def rightmost(self, x: FloatArray, bound: float) -> Eigenpair:
        """Λ, sought from the right, and its vectors, yᵀZ′x = 1: E‖x‖² ≥ ‖E x‖² bounds it from the left.

        Args:
            x: positive moments of some law.
            bound: what Λ would not exceed if past values were variables of their own.
        """
        low = 2 * self._slowest.real
        size = abs(low) + 1 / self._last
        if self.is_still:
            return Eigenpair(low, x, x / (x @ x), 2 * SAME_ROOT * size, size)
        gap = (1 + self._count) * max(bound, 0.0) + NEAR * size - low
        least, stride = NEAREST * (abs(low) + gap), STRIDE
        while gap > least and stride > NEAR:
            if self._is_right(low + math.exp(-stride) * gap, x):
                gap *= math.exp(-stride)
            else:
                stride *= 0.5
        if gap > least:
            return self._settled(low + gap)
        if abs(self._slowest.imag) * self._last <= SAME_ROOT:  # else Z is 0/0 next to there
            found = self._settled(low + gap)
            if abs(found.value - low) <= gap and found.change < gap:
                return found
        _, x, y = self._near(low + gap)  # the noise does not reach what grows the fastest
        return Eigenpair(low + gap, x, y, gap, size)

    def _is_right(self, sigma: float, x: FloatArray) -> bool:
        """Whether σ > Λ: whether y, driven for ever, stands still with positive second moments."""
        driven = np.linalg.solve(self.matrix(sigma), x)
        mean, *_ = x.reshape(len(self.generator), -1).T
        form = moment_form(mean @ driven.reshape(mean.size, -1), len(self.drift[0]), 2)
        values = np.linalg.eigvalsh(form)
        return bool(values[0] >= -NEGATIVE * values[-1])

    def _near(self, sigma: float) -> tuple[float, FloatArray, FloatArray]:
        """σ − Λ by a step of Newton's method for the smallest eigenvalue of Z(σ), and the vectors, yᵀZ′x = 1."""
        both = self.matrix(sigma + 1j * TINY)
        values, left, right = eig(finite(both.real), left=True)
        at = int(np.argmin(np.abs(values)))
        x, y = right[:, at].real, left[:, at].real
        share = float(y @ (both.imag / TINY) @ x)
        return float(values[at].real) * float(y @ x) / share, x, y / share

    def _settled(self, sigma: float) -> Eigenpair:
        """Λ next to σ, and what polynomials of higher degrees change: these rise until it is rounding."""
        at, last = self, math.inf
        while True:
            away, x, y = at._near(sigma)
            size = float(np.abs(y) @ at.sizes(sigma) @ np.abs(x))  # of all terms
            for _ in range(MOST_POLISHES):
                sigma -= away
                if abs(away) <= ROUNDED * size:
                    break
                away, x, y = at._near(sigma)
            if -0.5 * sigma * self._last > LARGEST:
                raise NoHierarchy(
                    f"second moments fall by more than e^(-{2 * LARGEST:g}) in a delay; use a shorter one"
                )
            finer = replace(at, finer=at.finer + 1)
            change = abs(y @ finer.matrix(sigma) @ x)
            if change <= ROUNDED * size or not change < 0.5 * last:
                return Eigenpair(sigma, x, y, max(change, ROUNDED * size), size, at.finer)
            at, last = finer, change


def _exp(of: Any) -> Any:
    """e^x, for large x no more than can be squared."""
    return np.exp(of - np.maximum(np.real(of) - LARGEST, 0.0))


@lru_cache(maxsize=64)
def _polynomials(degree: int) -> tuple[Any, Any, Any]:
    """Nodes of Chebyshev, the slopes there of polynomials by their values, and the coefficients of these."""
    x = chebpts2(degree + 1)
    through = np.linalg.inv(chebvander(x, degree))
    slopes = chebval(x, chebder(through)).T
    return x, slopes - np.diag(slopes.sum(axis=1)), through
