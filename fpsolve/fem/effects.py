"""How much of Λ each cell owes to its highest modes, and the cells that should be enough.

How fast the effect of a cell's modes falls with their degree is how fast the cell converges, and decides between a
higher degree and smaller cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray, IntArray

HALVING = 2 * math.log(2)
"""Rate per degree by which the logarithm of an effect falls faster in half a cell."""
LEAST_DEGREE = 4
"""Lowest degree to which a cell is made coarser."""
SPLIT_DEGREE = 6
"""Lowest degree at which the highest modes tell whether halves of a cell take fewer functions."""
MOST_DEGREE = 14
"""Highest degree of a cell: beyond, it is halved."""
LEAST_FALL = 0.3
"""Least fall of the logarithm of an effect with each degree."""
STILL = 3 / 7
"""Ratio of the effects of two and of four modes where no fall is seen: then thrice the first may be left."""
SPARE = 1.0
"""Number of degrees beyond what seems to be enough that a cell keeps where none should be made coarser."""


@dataclass(frozen=True, eq=False)
class ModeEffects:
    """How much of Λ each cell of one axis owes to its highest modes.

    Attributes:
        degrees: of the cells, shape (cells,).
        highest: the effects of the highest mode, of the two highest and so on up to four, shape (4, cells).
        slowest: the least share of the effect of two modes that is thought to be left.
    """

    degrees: IntArray
    highest: FloatArray
    slowest: float = 0.0

    @property
    def two(self) -> FloatArray:
        """Effects of the two highest modes, shape (cells,)."""
        return self.highest[1]

    @property
    def of_cells(self) -> FloatArray:
        """Estimate of what each cell lacks, half way from the effect of two modes to what its slower fall predicts.

        Where e falls slowly, by r with two degrees, effects are its differences, (1/r − 1)e and (1/r² − 1)e of two and
        four modes: of their ratio q is r = q/(1 − q), and e is q/(1 − 2q) times the effect of two.
        """
        of_two = np.minimum(self.two / np.maximum(self.highest[3], 1e-300), STILL)
        left = np.maximum(np.clip(np.sqrt(self._left_by_two), self.slowest, 1.0), of_two / (1 - 2 * of_two))
        return self.two * left

    @property
    def error(self) -> float:
        return float(np.sum(self.of_cells))

    @property
    def fall(self) -> FloatArray:
        """By how much the logarithm of the effect falls with each degree, shape (cells,)."""
        return np.maximum(-0.5 * np.log(np.maximum(self._left_by_two, 1e-300)), LEAST_FALL)

    @property
    def _left_by_two(self) -> FloatArray:
        """What two degrees leave of the effect, as it has fallen to that of two modes and, if more slowly, of one.

        In cells of few modes the effect of one tells nothing.
        """
        of_one, of_two = self.highest[:2] / np.maximum(self.highest[2:], 1e-300)
        return np.where(self.degrees >= SPLIT_DEGREE, np.maximum(of_one, of_two), of_two)

    def needed(self, tolerance: float) -> FloatArray:
        """The degree at which each cell would lack `tolerance`, shape (cells,)."""
        return self.degrees + np.log(np.maximum(self.of_cells, 1e-300) / tolerance) / self.fall


def split(lines: FloatArray, effects: ModeEffects, share: float, may_coarsen: bool) -> tuple[FloatArray, IntArray]:
    """Lines and a degree for each cell with which all together should lack no more than a share.

    A cell is halved where halves take fewer unknowns: in them the effects fall faster.
    """
    rate, needed = effects.fall, effects.needed(max(share, 1e-290) / math.sqrt(effects.degrees.size))
    if not may_coarsen:  # but for what is far more than enough
        needed = np.maximum(needed, np.minimum(effects.degrees, needed + SPARE))
    in_half = needed * rate / (rate + HALVING)
    is_split = (2 * in_half + 2 < needed + 1) & (effects.degrees >= SPLIT_DEGREE) & (needed > effects.degrees)
    is_split |= needed > MOST_DEGREE
    degrees = np.ceil(np.where(is_split, in_half, needed) + 0.2)
    degrees = np.clip(degrees, np.maximum(LEAST_DEGREE, effects.degrees - 4), effects.degrees + 4)
    middles = 0.5 * (lines[:-1] + lines[1:])
    degrees = np.repeat(np.minimum(degrees, MOST_DEGREE).astype(int), np.where(is_split, 2, 1))
    return np.sort(np.concatenate([lines, middles[is_split]])), degrees
