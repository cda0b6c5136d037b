"""Whether slow noise may carry a moment in another place than the one that was found."""

from __future__ import annotations

import math

import numpy as np

from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import noise_marginal
from fpsolve.theory.frozen import frozen_rate

RIVAL = 0.6
"""Paths that hold the noise elsewhere are looked at if they grow at this share of Λ (less by the rest, for Λ < 0)."""


def rival(pair: PrincipalPair) -> float | None:
    """Another z, far from the tilted density of a pair, where paths that hold the noise grow about as fast, or None.

    Between two such places slow noise hardly ever passes: each has its own pair with T > 0 as far as that can be
    told, and only the larger eigenvalue is Λ.
    """
    found = frozen_rate(pair.generator.problem, pair.p)
    if found is None:
        return None
    z, rate = found
    at, density = noise_marginal(pair)
    mean = float(at @ density / density.sum())
    width = math.sqrt(float((at - mean) ** 2 @ density / density.sum()))
    peaks = np.flatnonzero((rate[1:-1] > rate[:-2]) & (rate[1:-1] >= rate[2:])) + 1
    enough = pair.value - (1 - RIVAL) * abs(pair.value)
    peaks = peaks[(np.abs(z[peaks] - mean) > 3 * width + 2) & (rate[peaks] > enough)]
    return float(z[peaks[np.argmax(rate[peaks])]]) if peaks.size else None
