"""The functions that a pair of eigenvectors stands for, T, T* and their product, and their marginals over the noise."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import OutputError
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.fem.noise_axes import Samples
from fpsolve.model.problem import Problem

MOST_TILT = 1.5
"""Slope of the tilt in z beyond which rounding leaves nothing of T around the mean of the noise."""
UNRESOLVED = 0.1
"""Share of an eigenfunction with the wrong sign from which on it misleads."""
MOST_NEGATIVE = 0.02
"""Share of a density with the wrong sign from which on it misleads."""


class Fields(NamedTuple):
    """Functions of (φ, ξ) at points, each of shape (φ-points, ξ-points).

    Attributes:
        right: T; NaN beyond an arc of φ on which a pair is known, where T* is 0.
        adjoint: T*, per radian and unit of ξ; at p = 0 the stationary density.
        product: T T*, the tilted density.
    """

    right: FloatArray
    adjoint: FloatArray
    product: FloatArray


def fields(pair: PrincipalPair, phi: FloatArray, at_phi: Any, at_xi: Samples) -> Fields:
    """T, T* and T T* at φ from the values of the φ-elements there and samples of the functions of ξ.

    T has mean 1 over P_s(ξ)/2π; with a tilt beyond `MOST_TILT`, which leaves T there to rounding, over P_s exp(2s z).
    Raises `OutputError` where it depends on more than φ and ξ.
    """
    refuse_more(pair)
    space, xi, frame = pair.space, pair.space.xi, pair.generator.problem.frame
    mean, stretch, density = 1.0, np.ones(1), np.ones(1)
    if frame is not None or 0 < abs(xi.tilt) <= MOST_TILT:
        own = xi.samples().factor if 0 < abs(xi.tilt) <= MOST_TILT else np.ones(xi.measure.size)
        over_phi = space.phi.constant @ space.table(pair.right) / space.phi.span
        if frame is not None:  # the mean over φ of |y|^p T_y
            psi, weights = space.phi.finer_rule(frame.parts)
            at = frame.own_phase(psi)
            weights = weights / frame.density(at) * frame.length(at) ** pair.p
            over_phi = weights @ (space.phi.at(psi) @ space.table(pair.right)) / space.phi.span
            stretch, density = frame.length(phi) ** pair.p, frame.density(phi)
        mean = float(xi.measure / own @ (xi.values @ over_phi) / np.sum(xi.measure / own**2))
    right, left = (space.evaluate(v, at_phi, at_xi.values) for v in (pair.right, pair.left))
    factor = at_xi.factor / mean * stretch[:, None]
    of_phi = at_xi.weight * density[:, None]
    return Fields(right * factor, left * of_phi / factor, right * left * of_phi)


def xi_marginal(pair: PrincipalPair, at_xi: Samples) -> FloatArray:
    """∫ T T* dφ over the mesh at points of ξ, shape (n,)."""
    right, left = (at_xi.values @ pair.space.table(v).T for v in (pair.right, pair.left))
    return np.asarray(np.einsum("zi,zi->z", right, left) * at_xi.weight)


def noise_marginal(pair: PrincipalPair) -> tuple[FloatArray, FloatArray]:
    """z and the ξ-marginal of the tilted density at the points of a rule, times their measure."""
    at = pair.space.xi.samples()
    return at.xi / pair.generator.problem.coloured.standard_deviation, np.abs(xi_marginal(pair, at)) * at.measure


def refuse_more(pair: PrincipalPair) -> None:
    """Raises `OutputError` where T depends on more than φ and ξ."""
    problem = pair.generator.problem
    if problem.dimension > 2:
        why = f"T of {problem.dimension} variables is no function of phase and noise"
        remedy = "use `draw_eigenfunction`, `tilted_density`, or a case, whose run writes files for ParaView"
        raise OutputError(f"{why}; {remedy}")
    if why := no_picture_of(problem):
        raise OutputError(why)


def no_picture_of(problem: Problem) -> str:
    """Why T of two variables cannot be drawn over phase and noise; empty where it can."""
    noise = problem.coloured
    if len(noise.parts) > 1:
        several = "an eigenfunction of the phase and of several noises that are not white cannot be drawn"
        return f"{several}; make all of these noises white but one"
    if noise.is_drawn:
        return ""
    return (
        f"{noise.kind} noise is no Markov process by itself, so that an eigenfunction is not a function of phase and "
        "noise, which could be drawn; look at Λ(p), or at densities of a simulation"
    )
