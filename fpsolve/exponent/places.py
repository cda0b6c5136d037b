"""Whether noise may carry a moment in another place than the one that was found."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import noise_marginal
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy
from fpsolve.theory.far import Place, far_places
from fpsolve.theory.frozen import frozen_noise

COMPARABLE = 0.6
"""Paths that hold the noise elsewhere are looked at if they grow at this share of Λ (less by the rest, for Λ < 0)."""


def other_center(pair: PrincipalPair) -> float | None:
    """Another z, far from the tilted density of a pair, where paths that hold the noise grow about as fast, or None.

    Between two such places slow noise hardly ever passes: each has its own pair with T > 0 as far as that can be
    told, and only the larger eigenvalue is Λ. For algebraic tails see `other_places`.
    """
    frozen = frozen_noise(pair.generator.problem)
    if frozen is None or pair.generator.problem.noise.has_algebraic_tails:
        return None
    z, rate = frozen.peaks(pair.p)
    if z.size < 2:
        return None
    at, density = noise_marginal(pair)
    mean = _mean(at, density)
    width = math.sqrt(float((at - mean) ** 2 @ density / density.sum()))
    far = (np.abs(z - mean) > 3 * width + 2) & (rate > comparable(pair.value))
    return float(z[far][np.argmax(rate[far])]) if np.any(far) else None


def other_places(pair: PrincipalPair) -> list[Place]:
    """The other places of algebraic tails where paths that hold the noise grow about as fast as that of a pair."""
    return [each for each, holds in _places(pair) if not holds and each.rate > comparable(pair.value)]


def is_far_out(pair: PrincipalPair) -> bool:
    """Whether a pair is that of a place far out in algebraic tails, whatever found it."""
    return any(holds for _, holds in _places(pair))


def _places(pair: PrincipalPair) -> list[tuple[Place, bool]]:
    """The places of algebraic tails, and whether the tilted density of a pair lies there."""
    places = far_places(pair.generator.problem, pair.p)
    mean = _mean(*noise_marginal(pair)) if places else 0.0
    return [(place, place.lower <= mean <= place.upper) for place in places]


def _mean(at: FloatArray, density: FloatArray) -> float:
    return float(at @ density / density.sum())


def misplaced(mesh: CylinderMesh | None, pairs: Sequence[PrincipalPair]) -> tuple[Message, ...]:
    """A warning about a pair on a given mesh whose moment slow noise may carry elsewhere, or nothing."""
    if mesh is None:  # then both places have been looked at
        return ()
    for pair in pairs:
        places, z = other_places(pair), other_center(pair)
        if places:
            z = math.sqrt(places[0].lower * places[0].upper) * math.copysign(1, places[0].lower)
        if z is not None:
            has_tails = pair.generator.problem.noise.has_algebraic_tails
            return (Message(Code.CARRIED_ELSEWHERE, p=pair.p, has_tails=has_tails, z=z, remedy=Remedy.REACH),)
    return ()


def comparable(value: float) -> float:
    """The growth rate from which on a place may outdo one with a value."""
    return value - (1 - COMPARABLE) * abs(value)
