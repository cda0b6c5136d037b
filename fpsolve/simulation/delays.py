"""Linear motions with delays, compiled: ẋ = Σ_k (A₀k + Σ_j ξ_j A_jk) x(t − τ_k), in steps that divide every delay.

Over a step past values are those at its beginning or those at its end, each as likely, and the same for all: the means
of their products are those of the trapezoidal rule. With I_j = ∫ξ_j dt x then follows the flow of what is linear in it,
and constant beside it, by the method of Runge and Kutta of order 4.

State: as in `spaces`, the variables, then those a step ago, and so on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.simulation.compiled import compiled
from fpsolve.simulation.several import integrate_all


class DelayedSpace(NamedTuple):
    """A₀ and the matrix of each noise, shapes (n, N) and (noises, n, N), and the row of each past value."""

    steady: FloatArray
    driven: FloatArray
    rows: FloatArray

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """One step as that of a `DrivenMotion`."""
        integrals = np.empty((m.driven.shape[0], x.size))
        integrate_all(noise, xi, h, integrals, 0, room, push, rng)
        return step_delayed(m, h, x, u, integrals, rng)


@compiled
def step_delayed(m, h, x, u, integrals, rng):  # type: ignore[no-untyped-def]
    """Move paths by one step of length h, in place; returns 0, as there are no lines to cross.

    Args:
        m: a `DelayedSpace`.
        x, u: the state.
        integrals: ∫ξ dt of every noise over the step, shape (noises, paths).
        rng: a `numpy.random.Generator`.
    """
    n, columns = m.steady.shape
    matrix, constant, begun = np.empty((n, columns)), np.empty(n), np.empty(n)
    now, slope, total, reached = np.empty(n), np.empty(n), np.empty(n), np.empty((n, x.size))
    for i in range(x.size):
        for r in range(n):
            begun[r] = x[i] if r == 0 else u[r - 1, i]
            for c in range(columns):
                matrix[r, c] = h * m.steady[r, c]
                for k in range(integrals.shape[0]):
                    matrix[r, c] += integrals[k, i] * m.driven[k, r, c]
        later = n if rng.random() < 0.5 else 0  # rows by which values at the end of the step are nearer
        for r in range(n):
            constant[r] = 0.0
            for c in range(n, columns):
                row = m.rows[c - n] - later
                constant[r] += matrix[r, c] * (x[i] if row == 0 else u[row - 1, i])
            now[r], total[r] = begun[r], 0.0
        for stage in range(4):
            for r in range(n):
                slope[r] = constant[r]
                for c in range(n):
                    slope[r] += matrix[r, c] * now[c]
            for r in range(n):
                total[r] += slope[r] / (3.0 if 0 < stage < 3 else 6.0)
                now[r] = begun[r] + slope[r] * (1.0 if stage == 2 else 0.5)
        for r in range(n):
            reached[r, i] = begun[r] + total[r]
    for row in range(u.shape[0] - 1, -1, -1):
        for i in range(x.size):
            u[row, i] = reached[1 + row, i] if row < n - 1 else x[i] if row == n - 1 else u[row - n, i]
    for i in range(x.size):
        x[i] = reached[0, i]
    return 0
