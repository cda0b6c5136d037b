"""Bounds of f = Σ c_km e^{2ikφ} B_m(z) over cells of z, by Taylor's formula about their middles.

For |t| ≤ h, |f − f(middle)| ≤ |f′(middle)| h + |f″(middle)| h²/2 + … up to a remainder of order `ORDER`. For Hermite
polynomials this is bounded with the mean value theorem, sup|He_m| ≤ |He_m(middle)| + h m sup|He_{m−1}|; for Chebyshev
polynomials, T_m(cos θ) = cos mθ, the variable is θ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import (
    Balls,
    above,
    ball,
    balls,
    field,
    magnitudes,
    mapped,
    matrix_product,
    raised,
    rounded,
)
from fpsolve.proofs.basis import Basis, Core

NARROWEST = 1e-30
"""Half a cell at least, so that none of its powers that are needed is below the smallest float."""
ORDER, FOLLOWED = 8, 3
"""Of Taylor's formula; and of how many of its terms the dependence on φ is followed."""


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
        left, right = balls(low), balls(high)
        if isinstance(basis, Core):
            left, right = ((each - ball(basis.centre)) / ball(basis.scale) for each in (left, right))
        else:
            left, right = mapped("acos", right), mapped("acos", left)
        self._middle = (left + right) / 2
        self._half = np.array([max(above(each), NARROWEST) for each in (right - left) / 2])

    def modes(self, u: Balls) -> Modes:
        """Those of a sum with coefficients u of the polynomials; u_{−k} is the conjugate of u_k."""
        half = u[u.shape[0] // 2 :]
        parts = np.concatenate([field("real", half), field("imag", half)])
        taylor = self._hermite if isinstance(self.basis, Core) else self._chebyshev
        derivatives, stray = taylor(parts)
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

    def _hermite(self, parts: Balls) -> tuple[Iterator[Balls], FloatArray]:
        """Derivatives at the middles from the zeroth on, and a bound of what comes after."""
        degrees = parts.shape[1]
        table = hermite_table(self._middle, degrees, lambda m: ball(m).sqrt())
        bound = magnitudes(table)
        for m in range(1, degrees):
            bound[m] = raised(bound[m] + self._half * np.sqrt(m) * bound[m - 1], 8)
        derived = [parts]
        for _ in range(min(ORDER, degrees - 1)):
            roots = np.array([ball(m).sqrt() for m in range(1, derived[-1].shape[1])], dtype=object)
            derived.append(derived[-1][:, 1:] * roots)
        last = derived[-1] if len(derived) > ORDER else derived[-1][:, :0]
        rest = magnitudes(last) @ bound[: last.shape[1]] * self._half**ORDER / factorial(ORDER)
        return (matrix_product(each, table[: each.shape[1]]) for each in derived[:ORDER]), raised(rest, 2 * degrees)

    def _chebyshev(self, parts: Balls) -> tuple[Iterator[Balls], FloatArray]:
        """The same in θ, up to signs."""
        degrees = np.arange(parts.shape[1])
        angles = np.outer(degrees, self._middle)
        waves = [mapped("cos", angles), mapped("sin", angles)]
        powers = [np.array([ball(int(m) ** i) for m in degrees], dtype=object) for i in range(ORDER)]
        rest = magnitudes(parts) @ (degrees.astype(float)[:, None] * self._half) ** ORDER / factorial(ORDER)
        derivatives = (matrix_product(parts * powers[i], waves[i % 2]) for i in range(ORDER))
        return derivatives, raised(rest, 16 + 2 * len(degrees))


def hermite_table(y: Any, degrees: int, root: Callable[[Any], Any]) -> Any:
    """He_m(y)/√m!, shape (degrees, *y.shape), from y He_m = He_{m+1} + m He_{m−1}."""
    table = [0 * y + 1, y]
    for m in range(1, degrees - 1):
        table.append((y * table[m] - root(m) * table[m - 1]) / root(m + 1))
    return np.array(table[:degrees])
