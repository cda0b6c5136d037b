"""Bounds of trigonometric polynomials over cells of φ, with the rounding of floats.

A sum of n products of floats, however ordered and whether or not multiplications and additions are fused, is off by
at most γ_n Σ|a||b| with γ_n = n u/(1 − n u), u = 2⁻⁵³ (N. J. Higham, Accuracy and stability of numerical algorithms,
SIAM 2002, section 3.1). That products of matrices are such sums, and not by a fast algorithm, is taken for granted.
Cosines and sines are floats within u of their values.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import ball, raised
from fpsolve.proofs.cells import FOLLOWED, Modes

UNIT = 2.0**-53


class Phases:
    """Equal cells of [0, π).

    Args:
        count: how many.
        waves: the highest k of e^{2ikφ}.
    """

    def __init__(self, count: int, waves: int) -> None:
        self._half = raised(math.pi / (2 * count))
        circle = [ball(i) / count for i in range(2 * count)]  # of π
        cosines, sines = (np.array([float(getattr(each, name)()) for each in circle]) for name in ("cos_pi", "sin_pi"))
        turns = np.outer(2 * np.arange(count) + 1, np.arange(waves + 1)) % (2 * count)
        self._cosines, self._sines = cosines[turns], sines[turns]

    def bounds(self, modes: Modes) -> tuple[FloatArray, FloatArray]:
        """The least and the largest value, shape (cells of φ, cells of z), each."""
        value, off = self._about(modes.terms[0], FOLLOWED)
        for i, term in enumerate(modes.terms[1:], start=1):
            other, more = self._about(term, FOLLOWED - i)
            off += np.abs(other) + more
        off = raised(off + modes.stray, 4 * FOLLOWED)
        return value - off, value + off

    def _about(self, modes: NDArray[np.complex128], order: int) -> tuple[FloatArray, FloatArray]:
        """Σ c_k e^{2ikφ} at the middles, and how much it may differ from that in a cell, by Taylor's formula in φ."""
        k = np.arange(len(modes))[:, None]
        weighted = np.where(k > 0, 2.0, 1.0) * modes
        sizes = np.abs(weighted.real) + np.abs(weighted.imag)
        rounding = (2 * len(k) + 16) * UNIT
        value = self._sum(weighted)
        totals = [((2.0 * k) ** i * sizes).sum(0) for i in range(order + 1)]
        off = rounding * totals[0]
        for i in range(1, order):
            share = self._half**i / math.factorial(i)
            off = off + share * (np.abs(self._sum((2j * k) ** i * weighted)) + rounding * totals[i])
        off = off + self._half**order / math.factorial(order) * totals[order]
        return value, raised(np.broadcast_to(off, value.shape), 4 * len(k) + 16 * order)

    def _sum(self, weighted: NDArray[np.complex128]) -> FloatArray:
        """Σ Re c_k e^{2ikφ} at the middles of the cells."""
        waves = len(weighted)
        return self._cosines[:, :waves] @ weighted.real - self._sines[:, :waves] @ weighted.imag
