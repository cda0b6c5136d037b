"""LU factors of a Kronecker sum of waves of the phase, which takes each wave to its neighbours.

As multiples of e^{2ikφ}, z_k = a_k − ib_k for a_k cos 2kφ + b_k sin 2kφ, the waves k ≥ 1 are multiplied by complex
numbers: their matrix C is half as large as the real one, and as its k are a chain of half the width, it fills in far
less. The functions that are constant in φ are left, with S = D − U C⁻¹ W. For p = 0, where T = 1, nothing goes from
them to the waves: W = 0. For other p a few steps of GMRES solve with S, as the first wave tells nearly all of it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce

import numpy as np
from scipy.sparse import csr_matrix, kron

from fpsolve.arrays import FloatArray
from fpsolve.fem.axis import KroneckerSum
from fpsolve.superlu import sparse_lu

UNKNOWN_OPERATIONS = 2.0
"""Number of operations over the power 7/3 of complex unknowns, as fronts of three directions are as wide as n^⅔."""
SOLVE_OPERATIONS = 700.0
"""Number of operations of four solutions, of five steps each, over the power 5/3, as there are so many entries."""
CALL_OPERATIONS = 2e8
"""Number of operations that take the time of the calls of these solutions, 10 ms."""
UNKNOWN_BYTES = 12.0
"""Bytes over the power 5/3 of complex unknowns."""
LOW = 3
"""Number of functions, the constant one and the first wave, whose own inverse prepares these steps."""
STEPS = 60
"""Largest number of steps of GMRES for what is constant in φ."""
LEFT = 1e-11
"""Share of a load and of its solution that these steps leave."""
EXCHANGED = 1e-12
"""Share of a matrix of φ up to which e^{2ikφ} is said not to be taken to e^{−2ikφ}."""


class WaveFactors:
    """Factors of a sum whose first axis is of waves, see `WaveAxis`."""

    def __init__(self, operator: KroneckerSum) -> None:
        self._operator, self._count = operator, operator.size // operator.shape[0]
        size = self._count * (operator.shape[0] // 2)
        entries = size ** (5 / 3)
        self.operations = UNKNOWN_OPERATIONS * size ** (7 / 3) + SOLVE_OPERATIONS * entries + CALL_OPERATIONS
        self.gigabytes = 1e-9 * UNKNOWN_BYTES * entries

    @staticmethod
    def may_take(operator: KroneckerSum) -> bool:
        """Whether no term takes e^{2ikφ} to e^{−2ilφ}, k and l ≥ 1, as white noise does."""
        for phase, *_ in operator.terms:
            waves = phase[1:, 1:]
            exchanged = abs(waves[::2, ::2] - waves[1::2, 1::2]) + abs(waves[::2, 1::2] + waves[1::2, ::2])
            if np.max(exchanged, initial=0.0) > EXCHANGED * np.max(abs(waves), initial=0.0):
                return False
        return True

    def make(self) -> None:
        """Eliminate the waves."""
        sums = []
        for phase, *noises in self._operator.terms:
            of_noises, waves = reduce(kron, [csr_matrix(each) for each in noises]), phase[1:, 1:]
            parts = waves[::2, ::2] + 1j * waves[::2, 1::2], phase[:LOW, :LOW], phase[:1, 1:], phase[1:, :1]
            sums.append([kron(csr_matrix(each), of_noises, format="csc") for each in parts])
        c, low, self._u, self._w = (sum(each) for each in zip(*sums, strict=True))
        self._d = low[: self._count, : self._count]
        symmetric = {"SymmetricMode": True}  # of the elimination tree: else it takes ten times as long
        self._waves, self._low = (sparse_lu(each, diag_pivot_thresh=0.01, options=symmetric) for each in (c, low))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b."""
        d, up, down = (self._d.T, self._w.T, self._u.T) if transposed else (self._d, self._u, self._w)
        count = self._count

        def of_constant(v: FloatArray) -> FloatArray:
            load = np.concatenate([v, np.zeros((LOW - 1) * count)])
            return np.asarray(self._low.solve(load, trans="T" if transposed else "N")[:count])

        def of_waves(v: FloatArray) -> FloatArray:
            table = v.reshape(-1, 2, count)
            z = self._waves.solve((table[:, 0] - 1j * table[:, 1]).ravel(), trans="H" if transposed else "N")
            return np.stack([z.real.reshape(-1, count), -z.imag.reshape(-1, count)], axis=1).ravel()

        waves = of_waves(b[count:])
        first = of_constant(b[:count] - up @ waves)
        if self._w.nnz:
            first = smallest_residual(lambda v: of_constant(d @ v - up @ of_waves(down @ v)), first)
        return np.concatenate([first, waves - of_waves(down @ first)])


def smallest_residual(image: Callable[[FloatArray], FloatArray], b: FloatArray) -> FloatArray:
    """x whose image is b, of those in the space of b, its image, and so on (GMRES), to a share of b and of x."""
    size = float(np.linalg.norm(b))
    vectors, images = np.zeros((STEPS + 1, b.size)), np.zeros((STEPS + 1, STEPS))
    vectors[0] = b / (size or 1.0)
    for k in range(STEPS):
        new, known = image(vectors[k]), vectors[: k + 1]
        for _ in range(2):
            parts = known @ new
            images[: k + 1, k] += parts
            new = new - parts @ known
        images[k + 1, k] = np.linalg.norm(new)
        vectors[k + 1] = new / (images[k + 1, k] or 1.0)
        own, target = images[: k + 2, : k + 1], np.eye(1, k + 2)[0]
        x = np.linalg.lstsq(own, target, rcond=None)[0]
        if np.linalg.norm(own @ x - target) <= LEFT * (1 + np.linalg.norm(x)):
            break
    return np.asarray(size * (x @ known))
