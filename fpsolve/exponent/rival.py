"""Whether slow noise may carry a moment in another place than the one that was found."""

from __future__ import annotations

import math

import numpy as np

from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import noise_marginal
from fpsolve.theory.frozen import frozen_noise

RIVAL = 0.6
"""Paths that hold the noise elsewhere are looked at if they grow at this share of Λ (less by the rest, for Λ < 0)."""


def rival(pair: PrincipalPair) -> float | None:
    """Another z, far from the tilted density of a pair, where paths that hold the noise grow about as fast, or None.

    Between two such places slow noise hardly ever passes: each has its own pair with T > 0 as far as that can be
    told, and only the larger eigenvalue is Λ.
    """
    frozen = frozen_noise(pair.generator.problem)
    if frozen is None:
        return None
    z, rate = frozen.peaks(pair.p)
    if z.size < 2:
        return None
    at, density = noise_marginal(pair)
    mean = float(at @ density / density.sum())
    width = math.sqrt(float((at - mean) ** 2 @ density / density.sum()))
    enough = pair.value - (1 - RIVAL) * abs(pair.value)
    far = (np.abs(z - mean) > 3 * width + 2) & (rate > enough)
    return float(z[far][np.argmax(rate[far])]) if np.any(far) else None
