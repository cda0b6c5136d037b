"""Bounds of f = Σ c_km e^{2ikφ} B_m(z) over cells of z and φ, with the rounding of floats.

A sum of n products of floats, however ordered and whether or not multiplications and additions are fused, is off by
at most γ_n Σ|a||b| with γ_n = n u/(1 − n u), u = 2⁻⁵³ (N. J. Higham, Accuracy and stability of numerical algorithms,
SIAM 2002, section 3.1). That products of matrices are such sums, and not by a fast algorithm, is taken for granted.
Cosines and sines are floats within u of their values.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, pi

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import Balls, above, ball, each, magnitudes, raised, rounded
from fpsolve.proofs.basis import Basis

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
    """

    def __init__(self, basis: Basis, low: FloatArray, high: FloatArray) -> None:
        self.basis = basis
        left, right = basis.places(low, high)
        self._middle = (left + right) / 2
        self._half = np.array([max(above(half), NARROWEST) for half in (right - left) / 2])

    def modes(self, u: Balls) -> Modes:
        """Those of a sum with coefficients u of the polynomials; u_{−k} is the conjugate of u_k."""
        half = u[u.shape[0] // 2 :]
        parts = np.concatenate([each(lambda c: c.real, half), each(lambda c: c.imag, half)])
        derivatives, stray = self.basis.taylor(parts, self._middle, self._half)
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
        cosines, sines = (np.array([float(getattr(turn, name)()) for turn in circle]) for name in ("cos_pi", "sin_pi"))
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
