"""What a trial function leaves over on cells of z, bounded in balls: the numbers that (*) of `verify` needs.

f = Σ c_km e^{2ikφ} B_m(z) is bounded over cells of z and φ with the rounding of floats. A sum of n products of floats,
however ordered and whether or not multiplications and additions are fused, is off by at most γ_n Σ|a||b| with
γ_n = n u/(1 − n u), u = 2⁻⁵³ (N. J. Higham, Accuracy and stability of numerical algorithms, SIAM 2002, section 3.1).
That products of matrices are such sums, and not by a fast algorithm, is taken for granted. Cosines and sines are
floats within u of their values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial, pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import Balls, above, ball, balls, below, complex_ball, each, magnitudes, raised, rounded
from fpsolve.proofs.basis import Basis, added, padded, turned
from fpsolve.proofs.statement import Cylinder

if TYPE_CHECKING:
    from flint import arb

UPPER, LOWER = 1, -1
"""q of `verify`: of the upper and of the lower bound."""
Pair = tuple[float, float]
NARROWEST = 1e-30
"""Half a cell at least, so that none of its powers that are needed is below the smallest float."""
FOLLOWED = 3
"""Of how many terms of Taylor's formula in z the dependence on φ is followed."""
UNIT = 2.0**-53
Range = tuple[FloatArray, FloatArray]
"""Arrays below and above."""


@dataclass(frozen=True)
class Modes:
    """f on cells of z by its modes in φ, f = Σ e^{2ikφ} (c_0k + s c_1k + s² c_2k + …), |s| ≤ 1.

    Attributes:
        terms: floats near c_ik = f_k^(i)(middle) hⁱ/i!, complex, k = 0 … K, each of shape (K + 1, cells).
        stray: how much f may differ from that anywhere in a cell, shape (cells,).
    """

    terms: tuple[NDArray[np.complex128], ...]
    stray: FloatArray

    def minus(self, factors: Balls, other: Modes) -> Modes:
        """f − factor · g at single points, where the terms after the first are 0; with a factor for each."""
        near, off = rounded(factors)
        share = near * other.terms[0]
        rounding = 2.0**-50 * (np.abs(self.terms[0]) + np.abs(share)) + off * np.abs(other.terms[0])
        stray = self.stray + (np.abs(near) + off) * other.stray + 2 * rounding.sum(0)
        return Modes((self.terms[0] - share,), raised(stray, 4 * len(share) + 8))


class Cells:
    """Cells [low, high] of z.

    Args:
        low, high: floats, low ≤ high, in [−1, 1] for `Whole`.
        rest: what Taylor's formula may leave over of the highest function; 0 for as many terms as there may be.
    """

    def __init__(self, basis: Basis, low: FloatArray, high: FloatArray, rest: float = 0.0) -> None:
        self.basis, self._rest = basis, rest
        left, right = basis.places(low, high)
        self._middle = (left + right) / 2
        self._half = np.array([max(above(half), NARROWEST) for half in (right - left) / 2])

    def modes(self, u: Balls) -> Modes:
        """Those of a sum with coefficients u of the polynomials; u_{−k} is the conjugate of u_k."""
        half = u[u.shape[0] // 2 :]
        parts = np.concatenate([each(lambda c: c.real, half), each(lambda c: c.imag, half)])
        derivatives, stray = self.basis.taylor(parts, self._middle, self._half, self._rest)
        terms = []
        for i, derivative in enumerate(derivatives):
            size = self._half**i / factorial(i)
            if i < FOLLOWED:
                near, off = rounded(derivative)
                near, off = near * size, off * size + np.abs(near * size) * 2.0**-48
                terms.append(near[: len(half)] + 1j * near[len(half) :])
            else:
                off = magnitudes(derivative) * size
            stray = raised(stray + raised(off, 8), 1)
        both = stray[: len(half)] + stray[len(half) :]
        return Modes(tuple(terms), raised(both[0] + 2 * both[1:].sum(0), 3 * len(half)))


class Phases:
    """Equal cells of [0, π).

    Args:
        count: how many.
        waves: the highest k of e^{2ikφ}.
    """

    def __init__(self, count: int, waves: int) -> None:
        self._half = raised(pi / (2 * count))
        circle = [ball(i) / count for i in range(2 * count)]  # of π
        cosines, sines = np.array([[float(turn.cos_pi()), float(turn.sin_pi())] for turn in circle]).T
        turns = np.outer(2 * np.arange(count) + 1, np.arange(waves + 1)) % (2 * count)
        self._cosines, self._sines = cosines[turns], sines[turns]

    def bounds(self, modes: Modes) -> Range:
        """The least and the largest value, shape (cells of φ, cells of z), each."""
        value, off = self._about(modes.terms[0], FOLLOWED)
        for i, term in enumerate(modes.terms[1:], start=1):
            other, more = self._about(term, FOLLOWED - i)
            off += np.abs(other) + more
        off = raised(off + modes.stray, 4 * FOLLOWED)
        return value - off, value + off

    def _about(self, modes: NDArray[np.complex128], order: int) -> Range:
        """Σ c_k e^{2ikφ} at the middles, and how much it may differ from that in a cell, by Taylor's formula in φ."""
        k = np.arange(len(modes))[:, None]
        weighted = np.where(k > 0, 2.0, 1.0) * modes
        sizes = np.abs(weighted.real) + np.abs(weighted.imag)
        rounding = (2 * len(k) + 16) * UNIT
        value = self._sum(weighted)
        totals = [((2.0 * k) ** i * sizes).sum(0) for i in range(order + 1)]
        off = rounding * totals[0]
        for i in range(1, order):
            share = self._half**i / factorial(i)
            off = off + share * (np.abs(self._sum((2j * k) ** i * weighted)) + rounding * totals[i])
        off = off + self._half**order / factorial(order) * totals[order]
        return value, raised(np.broadcast_to(off, value.shape), 4 * len(k) + 16 * order)

    def _sum(self, weighted: NDArray[np.complex128]) -> FloatArray:
        """Σ Re c_k e^{2ikφ} at the middles of the cells."""
        waves = len(weighted)
        return self._cosines[:, :waves] @ weighted.real - self._sines[:, :waves] @ weighted.imag


@dataclass(frozen=True)
class Trial:
    """A function on the cylinder, and the number near which Λ(p), or λ, is to be proven.

    Attributes:
        noise: Eq. (19).
        p: the moment; None where f of λ is tried.
        mu: μ.
        cosine, sine: u = Σ (cosine_km cos 2kφ + sine_km sin 2kφ) B_m(z), floats that are taken as exact, k = 0 … K.
    """

    noise: Cylinder
    p: arb | None
    mu: float
    basis: Basis
    cosine: FloatArray
    sine: FloatArray

    @cached_property
    def _u(self) -> Balls:
        """Coefficients of e^{2ikφ}."""
        real, imag = balls(self.cosine), balls(-self.sine)
        half, mirrored = ((real + sign * complex_ball(0, 1) * imag) / 2 for sign in (1, -1))
        return np.concatenate([mirrored[:0:-1], half[:1] + mirrored[:1], half[1:]])

    @cached_property
    def values(self) -> Balls:
        """u."""
        return self.basis.values(self._u)

    @cached_property
    def slope(self) -> Balls:
        """u_z."""
        return self.basis.slope(self._u)

    @cached_property
    def _turned(self) -> tuple[Balls, Balls]:
        """(F₀ + z F₁ − μ) u and F₁ u; for λ what is left of q + κh + F f − μ, and what multiplies z in it.

        White noise has ½ F₁² in the place of z F₁, and for λ ½ F₁ (q₁ + κh₁ + F₁ f).
        """
        waves, mu, exponent = len(self.cosine) - 1, ball(self.mu), 0 * self.noise.nu if self.p is None else self.p
        still, driven = (turned(self.noise.bands(i, exponent, waves), self.values) for i in (0, 1))
        if self.p is None:
            one = self.basis.one(self.cosine.shape[1])
            source = [np.outer(self.noise.growth(i), one) for i in (0, 1)]
            source[0][1] -= mu * one
            still, driven = added(still, source[0]), added(driven, source[1])
        else:
            still = added(still, -mu * self.values)
        if self.noise.is_white:
            return added(still, turned(self.noise.bands(1, exponent, waves + 1), driven) / 2), driven
        return added(still, self.basis.times_z(driven, self.noise)), driven

    @cached_property
    def mismatch(self) -> Balls:
        """D (Lu − μu), or D (q + κh + L(0) f − μ): how far the drift of ln‖x‖ + f is from μ."""
        return added(self.basis.diffused(self._u, self.noise), self.basis.cleared(self._turned[0], self.noise))

    @cached_property
    def frozen(self) -> tuple[Balls, Balls]:
        """(F₀ + z F₁ + ½ νβ² − μ) u and F₁ u, of which n u and n_z u of `verify` are made; or the same of λ."""
        beta, (rest, driven) = ball(self.basis.gauge), self._turned
        return added(rest, self.noise.nu * beta * beta / 2 * self.values), driven


@dataclass(frozen=True)
class Bounds:
    """Of a trial on cells of z, a pair of arrays of shape (cells,) below and above each.

    Attributes:
        mismatch: around Lu/u − μ; infinite where u > 0 is not certain.
        inward: around B of `verify`; for λ around b. It is not asked for where T = u.
    """

    mismatch: Range
    inward: Range

    @property
    def is_positive(self) -> NDArray[np.bool_]:
        """Where u > 0 is certain."""
        return np.isfinite(self.mismatch[0]) & np.isfinite(self.mismatch[1])

    def above(self, sense: int) -> FloatArray:
        """Above e of `verify`, of the upper (1) or the lower bound (−1)."""
        return self.mismatch[1] if sense > 0 else -self.mismatch[0]


@dataclass(frozen=True)
class FrozenBounds:
    """Beyond which T may be frozen, each below and above, on the right or mirrored onto it.

    Attributes:
        steep: around u_z/u; for λ around f_z.
        mismatch, growth: around n and n_z of `verify`.
        drift, slope: below b and b′.
    """

    steep: Pair
    mismatch: Pair
    growth: Pair
    drift: float
    slope: float

    def above(self, sense: int) -> tuple[float, float, float]:
        """Above what W must drop by, q n and q n_z, of the upper (1) or the lower bound (−1)."""
        if sense > 0:
            return -self.steep[0], self.mismatch[1], self.growth[1]
        return self.steep[1], -self.mismatch[0], -self.growth[0]


class Bounder:
    """Bounds a trial on cells.

    Args:
        phases: how many cells of φ.
        rest: as for `Cells`; where it is not 0, bounds are wider, and come sooner.
    """

    def __init__(self, trial: Trial, phases: int, rest: float = 0.0) -> None:
        self.trial, self._rest = trial, rest
        self._phases = Phases(phases, len(trial.cosine) + trial.noise.is_white)

    def bounds(self, low: FloatArray, high: FloatArray) -> Bounds:
        """On cells [low, high]."""
        trial = self.trial
        cells = Cells(trial.basis, low, high, self._rest)
        divisor = self._divisor(cells)
        mismatch = self._range(cells.modes(trial.mismatch), divisor)
        if trial.basis.cover(1) is not None:
            return Bounds(mismatch, mismatch)
        if trial.noise.is_bounded and trial.basis.is_core:
            mismatch = _divided(mismatch, low, high)
        bend = np.zeros((2, 1))
        if trial.p is not None:
            bend = trial.basis.gauge + np.array(self._range(cells.modes(trial.slope), divisor))
        drift = [
            [bound(each) for each in trial.noise.drift(balls(end))] for bound, end in ((below, low), (above, high))
        ]
        slack = 8 * 2.0**-53 * (np.abs(np.array(drift)) + np.abs(bend[::-1]))
        inward = np.array(drift) - bend[::-1]
        return Bounds(mismatch, (inward[0] - slack[0], inward[1] + slack[1]))

    def frozen(self, z: FloatArray, sign: int) -> list[FrozenBounds]:
        """Beyond which T may be frozen, on the right or, with sign −1, on the left."""
        trial, cells, at = self.trial, Cells(self.trial.basis, z, z, self._rest), balls(z)
        divisor = self._divisor(cells)
        drifts = (trial.noise.drift(at), trial.noise.drift_slope(at))
        ranges = [self._range(cells.modes(trial.slope), divisor)]
        for part, drift in zip(trial.frozen, drifts, strict=True):
            modes = cells.modes(part)
            if trial.p is not None:
                values = cells.modes(padded(trial.values, waves=1))
                modes = modes.minus(trial.noise.nu * ball(trial.basis.gauge) * drift, values)
            ranges.append(self._range(modes, divisor))
        steep, mismatch, growth = (list(zip(*(end.tolist() for end in pair), strict=True)) for pair in ranges)
        if sign < 0:
            steep, growth = ([(-high, -low) for low, high in pairs] for pairs in (steep, growth))
        least = ([below(number) for number in numbers] for numbers in (sign * drifts[0], drifts[1]))
        return [FrozenBounds(*bounds) for bounds in zip(steep, mismatch, growth, *least, strict=True)]

    def _divisor(self, cells: Cells) -> Range:
        """Around u on every cell of φ and z; 1 for λ, where nothing is divided by f."""
        if self.trial.p is None:
            return np.ones((1, 1)), np.ones((1, 1))
        return self._phases.bounds(cells.modes(self.trial.values))

    def _range(self, part: Modes, divisor: Range) -> Range:
        """Around part/u on every cell of z."""
        (low, high), (least, most) = self._phases.bounds(part), divisor
        with np.errstate(divide="ignore", invalid="ignore"):
            lows, highs = (
                np.where(least > 0, end / np.where(sign * end > 0, least, most), sign * np.inf)
                for end, sign in ((low, -1), (high, 1))
            )
        return _widened(lows.min(0), highs.max(0))


def _divided(bounds: Range, left: FloatArray, right: FloatArray) -> Range:
    """Bounds of D times a mismatch on cells as those of the mismatch, D = 1 − z² > 0."""
    farthest = np.maximum(np.abs(left), np.abs(right))
    nearest = np.where(left * right > 0, np.minimum(np.abs(left), np.abs(right)), 0.0)
    least, most = (
        np.array([bound(1 - z**2) for z in balls(place)]) for bound, place in ((below, farthest), (above, nearest))
    )
    low, high = (end / np.where(sign * end > 0, least, most) for end, sign in zip(bounds, (-1, 1), strict=True))
    return _widened(low, high)


def _widened(low: FloatArray, high: FloatArray) -> Range:
    """Bounds after one division more."""
    return low - raised(np.abs(low)) * 2.0**-51, high + raised(np.abs(high)) * 2.0**-51
