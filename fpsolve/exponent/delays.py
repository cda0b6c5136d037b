"""Second moments of a state with delays: the σ at which shifted moments neither grow nor fall, without a mesh.

ẋ = A x + Σ B_k x(t − kτ), with white noises Σ D_k x(t − kτ) dW (Itô) and loads on functions f of a noise. For moments
that grow as e^σt those of y = e^(−σt/2) x stand still. It moves alike, with A − σ/2, e^(−σkτ/2)B_k and e^(−σkτ/2)D_k.
So S(s) = E y(u + s) y(u)ᵀ f(u + s), s ≥ 0, is linear in S(0), see `_carried` and `_collocated`, and

    Z(σ) S(0) = −(A S(0) + Σ B_k S(kτ)ᵀ) − (…)ᵀ − ΣΣ D_k E y(−kτ) y(−lτ)ᵀ D_lᵀ − Gᵀ S(0) = 0

at σ = Λ(2), the rightmost: Z⁻¹ is ∫ e^(−σt) of the moments of all paths, positive for σ > Λ (J. E. Marshall et al.,
Time-Delay Systems, 1992; V. Kharitonov, Time-Delay Systems, 2013, on the delay Lyapunov matrix S without noise).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import eig, eigvals, expm
from scipy.optimize import brentq

from fpsolve.arrays import FloatArray, dense, finite
from fpsolve.budget import charge
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.powers import Moving, PowerRates, moment_form, upper
from fpsolve.exponent.rightmost import REMEDY, ROUNDING, Eigenpair
from fpsolve.model.plane import common_delay
from fpsolve.model.problem import Problem

MOST_SIZE = 1200
"""Largest number of second moments at two times, times that multiple."""
STEP = 2.0
"""Norm of what moves S over the time from which times are doubled."""
STRIDE = 0.5
"""Logarithm of the factor between two σ − 2a, a the growth rate of E x."""
LEAST = 1e-300
"""Share of S that noise drives, from which on it counts."""
NEAREST = 1e-6
"""Share of the bounds of Λ to which σ − 2a falls: y stands still without noise at 2a, next to which Z is not known."""
NEAR = 0.03
"""Share of σ − 2a from which on Newton's method finds Λ."""
MOST_POLISHES = 10
"""Largest number of steps of Newton's method."""
SETTLED = 1e-10
"""Change of a over its size, or that of 1/τ, that is none."""
CLOSE = 0.1
"""Distance times τ at which a root is that of a number next to it."""
NEGATIVE = 1e-6
"""Share of the largest second moment by which one may be negative that should not be."""
LARGEST = 300.0
"""Largest exponent, −Λτ/2, beyond which numbers overflow."""
FEWEST, SHARE, GROWTH = 10, 0.6, 1.4
"""Degree of polynomials of the time: at least, over what moves S meanwhile, and from one to the next."""
TINY = 1e-20
"""Imaginary part of a σ that differentiates."""


def present(problem: Problem) -> int:
    """How many variables are no past values of others."""
    return problem.dimension - len(problem.system.pasts)


class Delayed:
    """The second moments of what moves a state with delays.

    Args:
        moving: what does, for the state and its past values as one vector, with rates of the state alone.
        problem: tells which variable each of the last ones is, and how long ago.
        units: of the state; None for those in which what moves it is balanced.

    Raises:
        NoHierarchy: the delays are no multiples of one, or there are too many moments.
    """

    most = MOST_SIZE

    def __init__(self, moving: Moving, problem: Problem, units: FloatArray | None = None) -> None:
        self._pasts, self.n = problem.system.pasts, present(problem)
        try:
            self.unit, self.count = common_delay(self._pasts)
        except ValueError as failure:
            raise NoHierarchy(str(failure)) from failure
        if (size := self.n**2 * self.count) > MOST_SIZE:
            raise NoHierarchy(f"{size} second moments at two times are more than {MOST_SIZE}; {REMEDY}")
        squares, drift = [*moving.squares], moving.steady + sum(0.5 * each @ each for each in moving.squares)
        for rate, exponent in moving.impulses:  # whose second moments are those of white noise
            jump = expm(exponent) - np.eye(len(exponent))
            drift, squares = drift + rate * jump, [*squares, math.sqrt(rate) * jump]
        parts = [self._split(each) for each in (drift, *moving.loads, *squares)]
        sizes, first = [np.sum(np.abs(each), axis=0) for each in parts], 1 + len(moving.loads)
        rest = sum((each @ each for each in sizes[first:]), np.zeros_like(sizes[0]))
        self.units, self.largest = moving.balance(sizes[:first], rest, units)
        self.drift, *others = (each * self.units / self.units[:, None] for each in parts)
        self.loads, self.squares = others[: len(moving.loads)], others[len(moving.loads) :]
        one = np.eye(self.n * (self.n + 1) // 2)
        self.symmetric = np.array([moment_form(each, self.n, 2).ravel() for each in one]).T

    @property
    def last(self) -> float:
        """The largest delay."""
        return self.unit * self.count

    def _split(self, matrix: FloatArray) -> FloatArray:
        """What multiplies x(t − kτ), shape (count + 1, n, n)."""
        found = np.zeros((self.count + 1, self.n, self.n))
        found[0] = matrix[: self.n, : self.n]
        for column, (variable, delay) in enumerate(self._pasts, self.n):
            found[round(delay / self.unit), :, variable] += matrix[: self.n, column]
        return found

    @property
    def size(self) -> int:
        """The number of second moments."""
        return self.symmetric.shape[1]

    @property
    def starts(self) -> tuple[FloatArray, FloatArray]:
        """Moments of some law, and a positive polynomial."""
        return upper(np.eye(self.n)), upper(np.eye(self.n))

    def moments(self, x: FloatArray) -> FloatArray:
        """E √(p!/α!) x^α of a right vector."""
        return x * self.scales

    def polynomial(self, y: FloatArray) -> FloatArray:
        """T, as coefficients of these functions, of a left vector."""
        return y / self.scales

    @property
    def scales(self) -> FloatArray:
        """The units of the numbers for each function of the noise."""
        i, j = np.triu_indices(self.n)
        return self.units[i] * self.units[j]

    @property
    def is_still(self) -> bool:
        """Whether no noise multiplies the state: then Λ(2) is twice the growth rate of E x."""
        return not self.loads and not any(each.any() for each in self.squares)

    def image(self, generator: Any, masses: Sequence[Any], x: FloatArray, value: float) -> FloatArray:
        """−Z(Λ)x; 2a − Λ in place of −Z(Λ) where Λ is always 2a."""
        rates = self.rates(generator, masses)
        return (2 * rates.abscissa - value) * x if self.is_still else np.asarray(-rates.matrix(value) @ x)

    def rates(self, generator: Any, masses: Sequence[Any]) -> DelayRates:
        """−Z(σ), from Gᵀ and the Ξᵀ of each load."""
        return DelayRates(self, dense(generator), [*map(dense, masses)])


@dataclass(frozen=True, eq=False)
class DelayRates:
    """−Z(σ) of moments S(0) with some functions of the noise.

    Attributes:
        state: what moves it.
        generator: Gᵀ.
        masses: Ξᵀ of each load.
        finer: how many times steps are halved, or degrees multiplied, beyond what is usual.
    """

    state: Delayed
    generator: FloatArray
    masses: Sequence[FloatArray]
    finer: int = 0

    def on(self, functions: Any) -> DelayRates:
        """That of some functions of the noise."""
        at = np.ix_(*2 * [np.flatnonzero(functions)])
        return replace(self, generator=self.generator[at], masses=[each[at] for each in self.masses])

    def at(self, sigma: float) -> PowerRates:
        """σ − Z(σ), whose eigenvalue Λ is for σ = Λ."""
        z = np.eye(self._even.shape[1]) if self.state.is_still else self.matrix(sigma)
        return PowerRates(sparse.csc_array(sigma * np.eye(len(z)) - z), self.state.size)

    def matrix(self, sigma: Any) -> Any:
        """Z(σ)."""
        even = self._even
        _, steady, noisy = self._parts(sigma)
        return -even.T @ sum([*steady, *noisy]) @ even

    @cached_property
    def _even(self) -> FloatArray:
        return _kron(np.eye(len(self.generator)), self.state.symmetric)

    @cached_property
    def _turn(self) -> FloatArray:
        """The transposition of all n × n matrices in a vector."""
        at = np.arange(self.state.n**2).reshape(self.state.n, -1)
        return np.asarray(_kron(np.eye(len(self.generator)), np.eye(at.size)[at.T.ravel()]))

    def _parts(self, sigma: Any) -> _Parts:
        """What −Z(σ) is the sum of, on all matrices S(0) for each function."""
        own, count, n = self.state, self.state.count, self.state.n
        fall = _exp(-0.5 * sigma * own.unit * np.arange(count + 1))[:, None, None]
        one, functions = np.eye(n), np.eye(len(self.generator))
        drift = own.drift * fall
        drift[0] -= 0.5 * sigma * one
        moving = _outer([(functions, drift), *zip(self.masses, (load * fall for load in own.loads), strict=True)], one)
        generator = _kron(self.generator, np.eye(n * n))
        charge(2 * count * len(generator))
        ends = self._collocated(moving, generator) if generator.any() else self._carried(moving)
        same, size = np.eye(len(ends)), len(generator)
        starts = np.linalg.solve(same - np.eye(len(ends), k=-size) @ ends, same[:, :size])  # each is where one ends
        later = [*np.split(starts, count), (ends @ starts)[-size:]]
        shift, noisy = sigma * np.eye(size), list[Any]()
        steady = [2 * moving[0] + shift, -shift, generator]
        steady += [2 * each @ self._turn @ s for each, s in zip(moving[1:], later[1:], strict=True)]
        for square in own.squares:
            parts = square * fall
            reached = [k for k in range(count + 1) if square[k].any()]
            for k, j in combinations_with_replacement(reached, 2):
                relaxed = _kron(self._power(own.unit * k), _kron(parts[k], parts[j]))
                noisy.append((1 if k == j else 2) * relaxed @ later[j - k])
        return _Parts(later, steady, noisy)

    def _carried(self, moving: Sequence[Any]) -> Any:
        """S at the ends of the parts of time, of S at their beginnings, where functions of the noise stand still.

        S on the parts of time and R(s) = S(τ − s)ᵀ obey S′ = F S + K R, and the same backwards in time. Over a time h
        S(h) = T S(0) + U R(h), and over 2h it is so again: nothing grows where S falls.
        """
        count, turn = len(moving) - 1, _kron(np.eye(len(moving) - 1), self._turn)
        ahead: Any = sum(_kron(np.eye(count, k=-lag), moving[lag]) for lag in range(count))
        back: Any = sum(_kron(np.eye(count, k=count - lag)[:, ::-1], moving[lag]) for lag in range(1, count + 1))
        whole = np.block([[ahead, back], [-turn @ back @ turn, -turn @ ahead @ turn]]) * self.state.unit
        size, doublings = len(ahead), math.ceil(math.log2(max(1.0, float(np.linalg.norm(whole, 1)) / STEP)))
        doublings += self.finer
        parts = expm(whole / 2**doublings)
        u = np.linalg.solve(parts[size:, size:].T, parts[:size, size:].T).T
        t = parts[:size, :size] - u @ parts[size:, :size]
        for _ in range(doublings):
            middle = t @ np.linalg.solve(np.eye(size) - u @ turn @ u @ turn, np.hstack([t, u @ turn @ t @ turn]))
            t, u = middle[:, :size], u + middle[:, size:]
        return t + u @ turn

    def _collocated(self, moving: Sequence[Any], generator: Any) -> Any:
        """S at the ends of the parts of time, of S at their beginnings, by polynomials of the time within a part.

        As functions of the noise relax meanwhile, S(s) is driven by R(s) with coefficients that depend on s.
        """
        count, width, unit = len(moving) - 1, len(generator), self.state.unit
        slow = float(np.linalg.norm(sum(map(np.abs, moving)), 2)) * unit
        slow = SHARE * slow + math.sqrt(float(np.max(np.abs(generator))) * unit)
        degree = math.ceil((FEWEST + slow) * GROWTH**self.finer)
        x = np.cos(np.pi * np.arange(degree, -1, -1) / degree)
        slopes = _differentiating(x)
        whole = np.zeros((count, degree + 1, width, count, degree + 1, width), dtype=np.result_type(*moving))
        for j, i in np.ndindex(count, degree + 1):
            rows, time = whole[j, i], 0.5 * (1 + x[i]) * unit
            if i == 0:
                rows[:, j, 0] = np.eye(width)
                continue
            rows[:, j] += (2 / unit) * np.multiply.outer(slopes[i], np.eye(width)).swapaxes(0, 1)
            for k, each in enumerate(moving):
                if k <= j:
                    rows[:, j - k, i] -= each @ self._relaxed(unit * k)
                else:
                    rows[:, k - j - 1, degree - i] -= each @ self._relaxed(j * unit + time) @ self._turn
            rows[:, j, i] -= generator
        starts = np.zeros((count, degree + 1, width, count, width))
        starts[np.arange(count), 0, :, np.arange(count)] = np.eye(width)
        size = count * (degree + 1) * width
        found = np.linalg.solve(whole.reshape(size, size), starts.reshape(size, -1))
        return found.reshape(count, degree + 1, width, -1)[:, -1].reshape(count * width, -1)

    def _relaxed(self, time: float) -> Any:
        """What functions of the noise become, for all matrices."""
        return _kron(self._power(time), np.eye(self.state.n**2))

    def _power(self, time: float) -> Any:
        """e^(Gᵀt), once for each time."""
        if time not in self._powers:
            self._powers[time] = expm(self.generator * time)
        return self._powers[time]

    @cached_property
    def _powers(self) -> dict[float, Any]:
        return {}

    @cached_property
    def _bound(self) -> float:
        """A number above Λ, by norms."""
        own = self.state
        first = 2 * float(np.linalg.eigvalsh(0.5 * (own.drift[0] + own.drift[0].T))[-1])
        linear = np.linalg.norm(own.drift, 2, axis=(1, 2))
        linear[0] = 0.0
        for load, xi in zip(own.loads, self.masses, strict=True):
            linear += np.linalg.norm(xi, 2) * np.linalg.norm(load, 2, axis=(1, 2))
        squares = np.array([np.linalg.norm(each, 2, axis=(1, 2)) for each in own.squares]).reshape(-1, own.count + 1)

        def left(sigma: float) -> float:
            fall = _exp(-0.5 * sigma * own.unit * np.arange(own.count + 1))
            return sigma - first - 2 * float(linear @ fall) - float(np.sum((squares @ fall) ** 2))

        low, high = min(first, 0.0), max(-left(0.0), 0.0)
        margin = NEAR * (high - low + 1 / own.last)
        return margin + (float(brentq(left, low, high, xtol=margin)) if left(low) < 0 < left(high) else high)

    def _near(self, sigma: float) -> _Near:
        """What the smallest eigenvalue of Z(σ) says of Λ."""
        both = self.matrix(sigma + 1j * TINY)
        values, left, right = eig(finite(both.real), left=True)
        at = int(np.argmin(np.abs(values)))
        x, y = right[:, at].real, left[:, at].real
        share = float(y @ (both.imag / TINY) @ x)
        return _Near(float(values[at].real) * float(y @ x) / share, x, y / share)

    def rightmost(self, x: FloatArray, y: FloatArray) -> Eigenpair:
        """Λ from the right, and its vectors, yᵀZ′x = 1: E‖x‖² ≥ ‖E x‖² bounds it from the left."""
        low, high = 2 * self.abscissa, self._bound
        if self.state.is_still:
            size = abs(low) + 1 / self.state.last
            return Eigenpair(low, x, y / (y @ x), 2 * SETTLED * size, size)
        gap, factor, least = high - low, math.exp(-STRIDE), NEAREST * (abs(low) + high - low)
        if not self.state.loads and self._log_radius(low + least) > 0:
            ends = math.log(least), math.log(gap)
            share = float(brentq(lambda log: self._log_radius(low + math.exp(log)), *ends, xtol=NEAR))
            return self._settled(low + math.exp(share))
        while self.state.loads and gap > least and self._is_right(low + factor * gap, x, y):
            gap *= factor
        if gap <= least or not self.state.loads:  # the noise does not reach what grows the fastest
            gap = min(gap, least)
            if abs(self._slowest.imag) * self.state.last <= SETTLED:  # else Z is 0/0 next to there
                found = self._settled(low + gap)
                if 0 <= found.value - low <= gap and found.change < gap:
                    return found
            last = self._near(low + gap)
            return Eigenpair(low + gap, last.x, last.y, gap, self._size(low + gap, last))
        least = factor * gap
        while gap > (1 + NEAR) * least:
            middle = math.sqrt(gap * least)
            gap, least = (middle, least) if self._is_right(low + middle, x, y) else (gap, middle)
        return self._settled(low + least)

    def _is_right(self, sigma: float, x: FloatArray, y: FloatArray) -> bool:
        """Whether σ > Λ: whether y, driven for ever, stands still with positive moments at times kτ."""
        later, steady, noisy = self._sums(sigma)
        n, mean = self.state.n, y.reshape(len(self.generator), -1)[:, 0]
        driven = self._even @ np.linalg.solve(-steady - noisy, x)
        moments = [np.tensordot(mean, (each @ driven).reshape(-1, n, n), 1) for each in later]
        rows = range(len(moments))
        values = np.linalg.eigvalsh(np.block([[moments[max(i - j, 0)] for j in rows] for i in rows]))  # its lower half
        return bool(values[0] >= -NEGATIVE * values[-1])

    def _log_radius(self, sigma: float) -> float:
        """ln of how much of S drives S that is without white noise; 0 at Λ, and below it for σ > Λ."""
        _, steady, noisy = self._sums(sigma)
        radius = float(np.max(np.abs(np.linalg.eigvals(np.linalg.solve(-steady, noisy)))))
        return math.log(max(radius, LEAST))

    def _sums(self, sigma: float) -> tuple[list[Any], Any, Any]:
        """S(kτ) of S(0), and −Z(σ) without white noise and by it."""
        later, *parts = self._parts(sigma)
        return later, *(self._even.T @ sum(each, 0.0 * parts[0][0]) @ self._even for each in parts)

    @property
    def abscissa(self) -> float:
        """a, the growth rate of E x f."""
        return self._slowest.real

    @cached_property
    def _slowest(self) -> complex:
        """The rightmost s of det(s − A − Σ B_k e^(−skτ)) = 0, by polynomials and by it."""
        own, count = self.state, self.state.count
        moving = _outer(
            [(np.eye(len(self.generator)), own.drift), *zip(self.masses, own.loads, strict=True)], np.eye(1)
        )
        size, last = len(moving[0]), complex(math.nan)
        degree = FEWEST + SHARE * own.last * float(np.linalg.norm(sum(map(np.abs, moving)), 2))
        for k, each in enumerate(moving):
            moving[k] = each @ _kron(self._power(own.unit * k), np.eye(own.n))
        moving[0] = moving[0] + _kron(self.generator, np.eye(own.n))
        while size * degree <= MOST_SIZE:
            nodes = math.ceil(degree)
            x = np.cos(np.pi * np.arange(nodes + 1) / nodes)
            whole = _kron(_differentiating(x) * 2 / own.last, np.eye(size))
            whole[:size] = 0.0
            for k, each in enumerate(moving):
                whole[:size] += _kron(_interpolating(x, 1 - 2 * k / count), each)
            found = self._root(moving, np.linalg.eigvals(whole))
            if abs(found - last) <= SETTLED * (abs(found) + 1 / own.last):
                return found
            degree, last = GROWTH * degree, found
        raise NoHierarchy(f"the largest growth rate without noise is not found for a delay so long; {REMEDY}")

    def _root(self, moving: Sequence[Any], roots: Any) -> complex:
        """The root on the right of those that some numbers are next to, of several the one that turns the least."""
        lags, one = self.state.unit * np.arange(len(moving))[:, None, None], np.eye(len(moving[0]))
        found = complex(math.nan)
        for root in sorted(roots[roots.imag >= 0], key=lambda each: -each.real):
            if (found.real - root.real) * self.state.last > CLOSE:
                break
            s, step = complex(root), math.inf
            for _ in range(MOST_POLISHES):
                parts = _exp(-s * lags) * moving
                values = eigvals(s * one - parts.sum(axis=0), one + (lags * parts).sum(axis=0))
                step = values[np.argmin(np.abs(values))]
                s -= step
                if abs(step) <= SETTLED * (abs(s) + 1 / self.state.last):
                    break
            if abs(s - root) * self.state.last < CLOSE and abs(step) * self.state.last < CLOSE**2:
                same = SETTLED * (abs(s) + 1 / self.state.last)  # waves repeat roots beside their multiples of iν
                is_first = math.isnan(found.real) or s.real > found.real + same
                if is_first or (s.real > found.real - same and abs(s.imag) < abs(found.imag)):
                    found = complex(s)
        return found

    def _settled(self, sigma: float) -> Eigenpair:
        """Λ next to σ, and what finer steps or polynomials change: they are made finer until it is rounding."""
        at, last = self, math.inf
        while True:
            near = at._near(sigma)
            size = at._size(sigma, near)
            for _ in range(MOST_POLISHES):
                sigma -= near.away
                if abs(near.away) <= ROUNDING * size:
                    break
                near = at._near(sigma)
            finer = replace(at, finer=at.finer + 1)
            change = abs(float(near.y @ finer.matrix(sigma) @ near.x))
            if -0.5 * sigma * self.state.last > LARGEST:
                raise NoHierarchy(
                    f"second moments fall by more than e^(-{2 * LARGEST:g}) in a delay; use a shorter one"
                )
            if change <= ROUNDING * size or not change < 0.5 * last:
                return Eigenpair(sigma, near.x, near.y, change, size)
            at, last = finer, change

    def _size(self, sigma: float, near: _Near) -> float:
        """Σ |terms| of yᵀZx."""
        return float(np.abs(near.y) @ self.sizes(sigma) @ np.abs(near.x))

    def sizes(self, sigma: float) -> FloatArray:
        """Σ |terms| that Z(σ) is the sum of."""
        even, (_, steady, noisy) = np.abs(self._even), self._parts(sigma)
        return np.asarray(even.T @ sum(map(np.abs, [*steady, *noisy])) @ even)


def _kron(a: Any, b: Any) -> Any:
    """a ⊗ b; numpy's takes ten times as long for small matrices."""
    return np.reshape(a[:, None, :, None] * b[None, :, None, :], (len(a) * len(b), -1))


def _outer(terms: Sequence[tuple[Any, Any]], one: Any) -> list[Any]:
    """Σ Ξ ⊗ C_k ⊗ 1 over pairs of a Ξ and all C_k."""
    return [sum(_kron(xi, _kron(each[k], one)) for xi, each in terms) for k in range(len(terms[0][1]))]


class _Parts(NamedTuple):
    """S(kτ) of S(0), and what −Z(σ) is the sum of, without white noise and by it."""

    later: list[Any]
    steady: list[Any]
    noisy: list[Any]


class _Near(NamedTuple):
    """σ − Λ by a step of Newton's method, and the vectors, yᵀZ′x = 1."""

    away: float
    x: FloatArray
    y: FloatArray


def _exp(of: Any) -> Any:
    """e^x, for large x no more than can be squared."""
    return np.exp(of - np.maximum(np.real(of) - LARGEST, 0.0))


def _differentiating(x: FloatArray) -> FloatArray:
    """The slopes at nodes of Chebyshev of polynomials by their values there."""
    ends = np.where(np.arange(x.size) % (x.size - 1) == 0, 2.0, 1.0) * (-1.0) ** np.arange(x.size)
    gaps = np.subtract.outer(x, x) + np.eye(x.size)
    found = np.outer(ends, 1 / ends) / gaps
    return found - np.diag(found.sum(axis=1))


def _interpolating(x: FloatArray, at: float) -> FloatArray:
    """What gives at a place of [−1, 1] the polynomial through values at nodes of Chebyshev."""
    degrees = np.arange(x.size)
    values = np.cos(np.outer(degrees, np.arccos(x)))
    return np.linalg.solve(values, np.cos(degrees * math.acos(min(max(at, -1.0), 1.0))))[None]
