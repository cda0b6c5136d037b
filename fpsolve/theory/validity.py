"""Where the theories that fpsolve compares stop being valid: sentences, each with its criterion and the numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.messages import ALMOST_EVERY, Remedy
from fpsolve.model.noise import Noise
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.theory.far import grows_far_out
from fpsolve.theory.perturbation import second_order

NEAR_GAUSSIAN = 0.1
WEAK = 0.05


def reduction_note(noise: Noise) -> str | None:
    """On the reduction (12)-(14), made for r₀ near 1: the variance that it gives, against Eq. (10)."""
    replaced: Any = noise.replaces
    if replaced is None or abs(replaced.r0 - 1) <= NEAR_GAUSSIAN * (1 + 1e-9):  # to rounding
        return None
    reduced = noise.standard_deviation**2
    return (
        f"the Ornstein-Uhlenbeck reduction is made for r0 near 1, but |r0 - 1| = {abs(replaced.r0 - 1):.3g} > "
        f"{NEAR_GAUSSIAN:g}: it gives the noise the variance {reduced:.4g} instead of {replaced.variance:.4g}, "
        f"Eq. (10); {Remedy.NO_REDUCTION}"
    )


def impact_note(oscillator: VibroImpactOscillator) -> str | None:
    """On the delta law where the bounce of Eq. (3) cannot be: 1 − ε²(1 − r) ≤ 0."""
    left = 1 - oscillator.epsilon**2 * (1 - oscillator.restitution)
    if left > 0:
        return None
    return (
        f"1 - epsilon^2 (1 - r) = {left:.3g} <= 0: no bounce of Eq. (3) loses so much; R = "
        f"{oscillator.impact_factor():.3g} belongs to the delta law alone"
    )


NO_INDEX = "Λ(p) > 0 for every p ≠ 0, as rare paths that hold the noise far out carry the moments in the end"
"""Why noise with algebraic tails leaves no stability index, see `far_places`."""


def heavy_tail_note(problem: Problem, exponent: float | None) -> str | None:
    """What λ, Λ(p) and δ_p mean for noise with algebraic tails, see `far_places`."""
    if not grows_far_out(problem):
        return None
    slope = "" if exponent is None or exponent <= 0 else ", not Λ′(0)"
    return f"algebraic tails: {NO_INDEX}; there is no stability index, and λ is the {ALMOST_EVERY}{slope}"


def simulated_tail_note(problem: Problem) -> str | None:
    """What a simulation cannot see."""
    if not grows_far_out(problem):
        return None
    return f"algebraic tails: {NO_INDEX}; a simulation shows Λ(p) without these paths, and λ is the {ALMOST_EVERY}"


def weak_noise_note(problem: Problem, p: FloatArray, value: FloatArray) -> str | None:
    """On Eq. (37) where the orders ε⁴ and above, Λ − ε²Λ₂, are not small against its terms before they cancel.

    Eq. (37) is a parabola, convex for every p; what limits it is the p from which on this criterion is broken.
    """
    theory = second_order(problem)
    rest = value - theory.moment_exponent(p)
    scale = theory.scale.moment(p)
    shares = np.divide(np.abs(rest), scale, out=np.zeros_like(scale), where=scale > 0)
    beyond = shares > WEAK
    if not np.any(beyond):
        return None
    reduced = ", and here for the reduced one" if problem.noise.approximates_spectrum else ""
    worst, first = int(np.argmax(shares)), float(p[beyond][np.argmin(np.abs(p[beyond]))])
    most = f"at p = {p[worst]:.3g}, where it is {rest[worst]:.3g}, {shares[worst]:.0%}"
    return (
        f"Eq. (37) is for weak noise{reduced}: from |p| = {abs(first):.3g} on, what it leaves out, epsilon^4 and "
        f"higher, exceeds {WEAK:.0%} of its terms, most {most}"
    )
