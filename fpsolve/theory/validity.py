"""Where the theories that fpsolve compares stop being valid, each with its criterion and the numbers."""

from __future__ import annotations

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem
from fpsolve.theory.far import grows_far_out
from fpsolve.theory.perturbation import second_order_or_none

WEAK = 0.05


def heavy_tail_note(problem: Problem, exponent: float | None) -> Message | None:
    """What λ, Λ(p) and δ_p mean for noise with algebraic tails, see `far_places`."""
    is_no_slope = exponent is not None and exponent > 0
    return Message(Code.HEAVY_TAILS, is_no_slope=is_no_slope) if grows_far_out(problem) else None


def simulated_tail_note(problem: Problem) -> Message | None:
    """What a simulation cannot see."""
    return Message(Code.UNSEEN_TAILS) if grows_far_out(problem) else None


def weak_noise_note(problem: Problem, p: FloatArray, value: FloatArray) -> Message | None:
    """On Eq. (37) where the orders ε⁴ and above, Λ − ε²Λ₂, are not small against its terms before they cancel.

    Eq. (37) is a parabola, convex for every p; what limits it is the p from which on this criterion is broken.
    """
    theory = second_order_or_none(problem)
    if theory is None:
        return None
    rest = value - theory.moment_exponent(p)
    scale = theory.scale.moment(p)
    shares = np.divide(np.abs(rest), scale, out=np.zeros_like(scale), where=scale > 0)
    beyond = shares > WEAK
    if not np.any(beyond):
        return None
    worst, first = int(np.argmax(shares)), np.min(np.abs(p[beyond]))
    found = {"first": first, "p": p[worst], "rest": rest[worst], "size": shares[worst]}
    return Message(Code.STRONG_NOISE, is_reduced=problem.noise.approximates_spectrum, most=WEAK, **found)
