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


def check(model, trial, certificate, name):
    """Refuse unless the "upper" or the "lower" bound holds."""
    side, sign = certificate[name], {"upper": 1, "lower": -1}[name]
    cf.require(side["nodes"] == [] and side["values"] == [] and side["tails"] is None, "There is no W.")
    delta = cs.exact(float(cf.binary(side["delta"])))
    slack = trial.divisor * delta - trial.residual * sign
    least = _on_circle if model.noise.kind == "circle" else _in_states
    for a, reason in ((trial.divisor, "u is not positive."), (slack, f"The {name} condition fails.")):
        for finer in FINER:
            bound, value = least(a, finer)
            if bound > 0:
                break
            cf.require(value >= 0, reason)
        cf.require(bound > 0, reason)


def _in_states(a, finer):
    """A lower bound of the least value, and an upper bound of it at points."""
    found = []
    for state in range(a.shape[-1]):
        wave = cs.waves(a[..., state])
        bounds, values = cs.Phases(finer * max(512, 16 * a.shape[1]), a.shape[1]).bounds(wave)
        found.append((bounds.min(), values.min()))
    return tuple(min(each) for each in zip(*found, strict=True))


def _on_circle(a, finer):
    """The same on a circle."""
    coefficients, sizes = cs.series(a)
    harmonics, degrees = sizes.shape
    gamma = (4 * harmonics + 4 * degrees + 64) * cs.ROUNDOFF
    grid, count = cs.Phases(finer * 12 * harmonics, harmonics), finer * 12 * degrees
    m, g = np.arange(degrees), math.pi / (2 * count) * (1 + 2.0**-50)
    turn = cs._circle(2 * count)[:, np.outer(m, np.arange(count + 1)) % (2 * count)]
    twice = 2 * np.arange(harmonics)[:, None]

    def sums(cosines, sines, functions):
        return grid.cos.T @ (cosines @ functions) + grid.sin.T @ (sines @ functions)

    value = sums(*coefficients, turn[0])
    along = sums(twice * coefficients[1], -twice * coefficients[0], turn[0]) * grid.half_width
    across = sums(*(coefficients * m), turn[1]) * g
    reach = twice * grid.half_width + m * g
    loose = gamma * (sizes * (1 + reach)).sum() * (1 + 64 * gamma) + 1e-200
    bent = (sizes * reach**2).sum() / 2 * (1 + 1e-9)
    return (value - np.abs(along) - np.abs(across)).min() - bent - loose, value.min() + loose
