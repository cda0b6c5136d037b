"""What the rounding of matrix entries may change in Λ(p)."""

from __future__ import annotations

import sys

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.fem.axis import TensorSpace
from fpsolve.fem.generator import Generator


def rounding_of_entries(generator: Generator, p: float, x: FloatArray, y: FloatArray) -> float:
    """Bound on the effect of the rounding of matrix entries: far out the mean and the wave of q cancel in them.

    In each cell of φ the entries of ∫ q u v and ∫ h u′ v are right to about eps, also those that are much smaller.
    """
    space, p = generator.space(p), abs(p)
    right, left = (_summed(space, v) for v in (x, y))
    steepness = space.phi.modes**2 / np.diff(space.phi.lines)[space.phi.cells]
    slopes = _summed(space, x * np.repeat(steepness, space.xi.size))
    total = 0.0
    for drive in generator.problem.system.drives:
        size = generator.problem.system.epsilon**drive.order
        q, h = (size * (abs(each.mean) + each.amplitude) for each in (drive.q, drive.h))
        total += float(np.sum(left * ((p * q * right + h * slopes) @ abs(space.xi.matrix(drive.g)))))
    return sys.float_info.epsilon * total


def _summed(space: TensorSpace, coefficients: FloatArray) -> FloatArray:
    """Sums of absolute values over the functions of each cell of φ, shape (cells, xi.size)."""
    starts = np.flatnonzero(np.diff(space.phi.cells, prepend=-1))
    return np.add.reduceat(np.abs(space.table(coefficients)), starts, axis=0)
