"""(μ − δ)u ≤ Lu ≤ (μ + δ)u where T is a trial function u itself: waves of the phase, on a circle or in a few states.

N = δu − q(Lu − μu), q = ±1, has coefficients in intervals. For the states of a chain it is a wave of the phase each.
On a circle it is Σ (a_km cos 2kφ + b_km sin 2kφ) cos mθ; over |φ − φ_i| ≤ h, |θ − θ_j| ≤ g it is at least

    N(φ_i, θ_j) − h|∂φN| − g|∂θN| − ½ Σ (2kh + mg)² (|a_km| + |b_km|),

with derivatives at (φ_i, θ_j). Sums are products of three matrices, K + M terms long, off as in `certificate_series`.
"""

import math

import numpy as np

from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as cf

FINER = (1, 2, 4, 8)
THIRDS = 5
"""How often cells of a circle may be cut into thirds, those that leave it open."""
TOGETHER = 1 << 16
"""Cells at which sums are taken at once."""


def check(model, trial, certificate, name):
    """Refuse unless the "upper" or the "lower" bound holds."""
    side, sign = certificate[name], {"upper": 1, "lower": -1}[name]
    cf.require(side["nodes"] == [] and side["values"] == [] and side["tails"] is None, "There is no W.")
    delta = cs.exact(float(cf.binary(side["delta"])))
    slack = trial.divisor * delta - trial.residual * sign
    is_positive = _on_circle if model.noise.kind == "circle" else _in_states
    for a, reason in ((trial.divisor, "u is not positive."), (slack, f"The {name} condition fails.")):
        cf.require(is_positive(a), reason)


def _in_states(a):
    """Whether a wave of each state is positive for certain."""
    for finer in FINER:
        found = []
        for state in range(a.shape[-1]):
            wave = cs.waves(a[..., state])
            bounds, values = cs.Phases(finer * max(512, 16 * a.shape[1]), a.shape[1]).bounds(wave)
            found.append((bounds.min(), values.min()))
        bound, value = (min(each) for each in zip(*found, strict=True))
        if bound > 0 or value < 0:
            break
    return bound > 0


def _on_circle(a):
    """Whether a function on a circle is."""
    coefficients, sizes = cs.series(a)
    harmonics, degrees = sizes.shape
    gamma = (4 * harmonics + 4 * degrees + 64) * cs.ROUNDOFF
    number, count = 12 * harmonics, 12 * degrees
    rows, columns = (np.ravel(each) for each in np.indices((number, count + 1)))
    for _ in range(THIRDS + 1):
        cells = Cells(coefficients, sizes, number, count, gamma)
        parts = [slice(start, start + TOGETHER) for start in range(0, rows.size, TOGETHER)]
        found = [cells.bounds(rows[part], columns[part]) for part in parts]
        bound, value = (np.concatenate(each) for each in zip(*found, strict=True))
        if value.min() < 0:
            return False
        is_open = bound <= 0
        if not is_open.any():
            return True
        across, along = (np.ravel(each) - 1 for each in np.indices((3, 3)))
        rows, columns = np.ravel(3 * rows[is_open, None] + across), np.ravel(3 * columns[is_open, None] + along)
        number, count = 3 * number, 3 * count
    return False


class Cells:
    """Cells around φ = πi/N, θ = πj/n."""

    def __init__(self, coefficients, sizes, number, count, gamma):
        self._coefficients, self._sizes, self._number, self._count = coefficients, sizes, number, count
        harmonics, degrees = sizes.shape
        h, g = (math.pi / (2 * each) * (1 + 2.0**-50) for each in (number, count))
        self._k, self._m = 2 * np.arange(harmonics)[:, None], np.arange(degrees)
        self._h, self._g, reach = h, g, self._k * h + self._m * g
        self._loose = gamma * (sizes * (1 + reach)).sum() * (1 + 64 * gamma) + 1e-200
        self._bent = (sizes * reach**2).sum() / 2 * (1 + 1e-9)
        self._phases, self._turns = cs._circle(number), cs._circle(2 * count)

    def bounds(self, rows, columns):
        """Lower bounds in some cells, and upper bounds in their middles."""
        i, at = np.unique(rows % self._number, return_inverse=True)
        j, beside = np.unique(columns % (2 * self._count), return_inverse=True)
        phase = self._phases[:, np.outer(i, self._k[:, 0] // 2) % self._number]
        turn = self._turns[:, np.outer(j, self._m) % (2 * self._count)]

        def sums(cosines, sines, functions):
            first = phase[0] @ cosines + phase[1] @ sines
            return np.einsum("nm,nm->n", first[at], functions[beside])

        a, b = self._coefficients
        value = sums(a, b, turn[0])
        along = sums(self._k * b, -self._k * a, turn[0]) * self._h
        across = sums(a * self._m, b * self._m, turn[1]) * self._g
        return value - np.abs(along) - np.abs(across) - self._bent - self._loose, value + self._loose
