"""Fourier-Hermite that finds its own size and certifies it at every p: what a careful user of that method would write.

The curve is followed from p = 0 outwards. At every p the pair is computed with a number of harmonics and of Hermite
functions, and again with more of both; if the two differ by more than the tolerance, the directions in which the new
functions take part grow. Vectors go on to larger truncations with zeros for these. As for the tuned code, the first and
the last p are computed again from a shift on the right.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tests.benchmarks.fourier_hermite import FourierHermite
from tests.benchmarks.problem import FloatArray, Problem

START, GROWTH = (3, 4), 1.3
TAKES_PART = 0.1
"""The share of the larger of the two tails from which on a direction grows too."""
Size = tuple[int, int]


class CertifiedFourierHermite:
    """Λ(p) within a tolerance, a function of p and Λ.

    Attributes:
        size: harmonics and Hermite functions that sufficed last; the values are from `larger` ones.
    """

    def __init__(self, problem: Problem, tolerance: Callable[[float, float], float]) -> None:
        self.problem, self.tolerance, self.size = problem, tolerance, START
        self._codes: dict[Size, FourierHermite] = {}
        self._solved: set[tuple[Size, float]] = set()

    def moments(self, p: FloatArray) -> FloatArray:
        """Λ at every p."""
        found = {0.0: 0.0}
        for side in (p[p > 0], p[p < 0]):
            for point in sorted(map(float, side), key=abs):
                found[point] = self._certified(point)
            if side.size:
                self._code(larger(self.size)).pencil.confirm(point)
        return np.array([found[float(point)] for point in p])

    def _certified(self, p: float) -> float:
        """Λ(p) with the larger truncation, once the smaller one agrees with it."""
        while True:
            size, finer = self.size, larger(self.size)
            value, (best, u) = self._pair(size, p)[0], self._pair(finer, p)
            if abs(value - best) <= self.tolerance(p, best):
                return best
            table = u.reshape(finer[1], 2 * finer[0] + 1)
            tails = np.array([np.linalg.norm(table[:, 2 * size[0] + 1 :]), np.linalg.norm(table[size[1] :])])
            grows = tails > TAKES_PART * tails.max()
            self.size = tuple(int(each) for each in np.where(grows, finer, size))

    def _pair(self, size: Size, p: float) -> tuple[float, FloatArray]:
        """Λ(p) and u with a truncation, from what is known of the nearest p with any."""
        pencil = self._code(size).pencil
        if (size, p) not in self._solved:
            self._solved.add((size, p))
            pencil.known[p] = pencil.follow(p)
        return pencil.known[p]

    def _code(self, size: Size) -> FourierHermite:
        """The code of a size; a new one knows what the others do, with zeros for what they lack."""
        if size not in self._codes:
            code = FourierHermite(self.problem, size)
            for other, old in self._codes.items():
                known = {p: (value, padded(u, other, size)) for p, (value, u) in old.pencil.known.items() if p}
                code.pencil.known |= known
            self._codes[size] = code
        return self._codes[size]


def larger(size: Size) -> Size:
    """The next truncation."""
    return math.ceil(GROWTH * size[0]), math.ceil(GROWTH * size[1])


def padded(u: FloatArray, old: Size, new: Size) -> FloatArray:
    """The same function with other truncations: 1, cos 2φ, sin 2φ, … fast, Hermite functions slow."""
    table, found = u.reshape(old[1], 2 * old[0] + 1), np.zeros((new[1], 2 * new[0] + 1))
    rows, columns = (min(sizes) for sizes in zip(table.shape, found.shape, strict=True))
    found[:rows, :columns] = table[:rows, :columns]
    return found.ravel()
