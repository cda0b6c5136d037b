"""The functions that a pair of eigenvectors stands for: T, T* and their product."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.fem.noise_axes import Samples

if TYPE_CHECKING:
    from fpsolve.exponent.eigen import PrincipalPair

MOST_TILT = 1.5
UNRESOLVED, MOST_NEGATIVE = 0.1, 0.02
"""The share of an eigenfunction, and of a density, with the wrong sign from which on it misleads."""


class Fields(NamedTuple):
    """Functions of (φ, ξ) at points, each of shape (φ-points, ξ-points).

    Attributes:
        right: T.
        adjoint: T*, per radian and unit of ξ; at p = 0 the stationary density.
        product: T T*, the tilted density.
    """

    right: FloatArray
    adjoint: FloatArray
    product: FloatArray


def fields(pair: PrincipalPair, at_phi: Any, at_xi: Samples) -> Fields:
    """T, T* and T T* from the values of the φ-elements at points and samples of the functions of ξ.

    T has mean 1 over P_s(ξ)/2π; with a tilt beyond `MOST_TILT`, which leaves T there to rounding, over P_s exp(2s z).
    """
    space = pair.space
    right, left = (space.evaluate(v, at_phi, at_xi.values) for v in (pair.right, pair.left))
    factor = at_xi.factor / _mean(pair)
    return Fields(right * factor, left * at_xi.weight / factor, right * left * at_xi.weight)


def _mean(pair: PrincipalPair) -> float:
    """That of T over P_s(ξ)/2π, from the coefficients."""
    space, xi = pair.space, pair.space.xi
    if xi.tilt == 0 or abs(xi.tilt) > MOST_TILT:
        return 1.0
    factor = xi.samples().factor
    over_phi = space.phi.constant @ space.table(pair.right) / space.phi.span
    return float(xi.measure / factor @ (xi.values @ over_phi) / np.sum(xi.measure / factor**2))


def xi_marginal(pair: PrincipalPair, at_xi: Samples) -> FloatArray:
    """∫ T T* dφ over the mesh at points of ξ, shape (n,)."""
    right, left = (at_xi.values @ pair.space.table(v).T for v in (pair.right, pair.left))
    return np.asarray(np.einsum("zi,zi->z", right, left) * at_xi.weight)


def noise_marginal(pair: PrincipalPair) -> tuple[FloatArray, FloatArray]:
    """z and the ξ-marginal of the tilted density at the points of a rule, times their measure."""
    at = pair.space.xi.samples()
    return at.xi / pair.generator.problem.noise.standard_deviation, np.abs(xi_marginal(pair, at)) * at.measure
