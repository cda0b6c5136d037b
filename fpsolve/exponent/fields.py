"""The functions that a pair of eigenvectors stands for: T, T* and their product."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.fem.noise_space import Samples


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


def fields(pair: PrincipalPair, at_phi: csr_matrix, at_xi: Samples) -> Fields:
    """T, T* and T T* from the values of the φ-elements at points and samples of the functions of ξ."""
    space = pair.generator.space
    right, left = (space.evaluate(v, at_phi, at_xi.values) for v in (pair.right, pair.left))
    return Fields(right * at_xi.factor, left * at_xi.weight / at_xi.factor, right * left * at_xi.weight)


def xi_marginal(pair: PrincipalPair, at_xi: Samples) -> FloatArray:
    """∫ T T* dφ over the mesh at points of ξ, shape (n,)."""
    space = pair.generator.space
    right, left = (at_xi.values @ space.table(v).T for v in (pair.right, pair.left))
    return np.einsum("zi,zi->z", right, left @ space.phi.mass()) * at_xi.weight
