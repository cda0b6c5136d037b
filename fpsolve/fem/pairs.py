"""Functions of two Gaussian numbers u₁, u₂ of the covariance 1, of which a noise ξ = std u₁ is made, in their law.

Where du = −Mu dt + N dW with M + Mᵀ = NNᵀ, the generator is L = −Σ M_ij a_j† a_i, with a_i = ∂_i that lowers a degree,
a_i† He_k = √(k + 1) He_(k+1): it keeps the total degree, and ξ = std (a₁ + a₁†) changes it by one.

Where T ~ exp(r·u) and T*/P_s ~ exp(l·u) the functions carry these factors, trial and test ones each their own. Then the
weight is that of u with the mean r + l, and L = −Σ M_ij (a_j† + l_j)(a_i + r_i). They are those of L + g u₁ for
r = g M⁻ᵀ(1, 0) and l = g M⁻¹(1, 0).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.fem.noise_axes import MORE_POINTS, STEP, NoiseAxis, Samples, form
from fpsolve.model.noise import NoiseDerivative
from fpsolve.polynomials import hermite


class PairAxis(NoiseAxis):
    """The products He_j He_k of normalised Hermite polynomials of u₁ and u₂ less their means, j + k < n, by j + k.

    Args:
        noise: it states M as `drift_matrix`.
        count: n.
        pull: g.
    """

    is_local, levels = False, ()

    def __init__(self, noise: Any, count: int, pull: float = 0.0) -> None:
        super().__init__()
        self.noise, self.unit = noise, noise.standard_deviation
        drift, first = noise.drift_matrix, np.array([pull, 0.0])
        self._right, self._left = np.linalg.solve(drift.T, first), np.linalg.solve(drift, first)
        means = self._right + self._left
        self.center = float(means[0])
        degree, second = np.tril_indices(count)
        self._first, self._second, self.modes = degree - second, second, degree
        self.size, self.cells = degree.size, np.zeros(degree.size, dtype=int)
        self.constant = np.eye(1, self.size)[0]
        x, weights = hermite(count).rule()
        table = hermite(count).at(x)[0]
        self._u, self.measure = np.array([np.repeat(x, x.size), np.tile(x, x.size)]), np.outer(weights, weights).ravel()
        self._xi = self.unit * (self._u[0] + means[0])
        self.values = (table[:, None, self._first] * table[None, :, self._second]).reshape(-1, self.size)
        fine, self._weights = hermite(count + MORE_POINTS).rule()
        self._points, self._table = self.unit * (fine + means[0]), hermite(count).at(fine)[0]

    def mass(self, g: Coefficient = one) -> FloatArray:
        return self._weighed(g(self._points)) if g != one else np.eye(self.size)

    def generator(self) -> FloatArray:
        return self._moved(self.noise.drift_matrix)

    def generator_of_one(self) -> FloatArray:
        return np.asarray(self.matrix(None)[0])

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> FloatArray:
        if g is None:
            return self._moved(np.array(change.drift)) if change.drift else np.zeros((self.size, self.size))
        slope = (g(self._points * (1 + STEP)) - g(self._points * (1 - STEP))) / (2 * STEP)
        return self._weighed(change.log_scale * slope)

    def samples(self) -> Samples:
        """At the points of a rule for (u₁, u₂); the weight is in the measure."""
        factor = np.exp(np.clip(self._right @ self._u, -600, 600))
        return Samples(self._xi, np.ones(factor.size), self.measure, self.values, factor)

    def law(self) -> FloatArray:
        weights = self.measure * np.exp(-(self._right + self._left) @ self._u)
        return np.asarray(weights / weights.sum())

    def projection(self, other: PairAxis) -> FloatArray:
        return np.eye(self.size, other.size)

    def _weighed(self, values: FloatArray) -> FloatArray:
        """∫ g u v from g at the points of the rule for u₁."""
        matrix = form(self._table, self._weights * values)
        return np.where(np.equal.outer(self._second, self._second), matrix[np.ix_(self._first, self._first)], 0.0)

    def _moved(self, drift: FloatArray) -> FloatArray:
        """−Σ M_ij ∫ v (a_j† + l_j)(a_i + r_i) u."""
        identity, found = scipy.sparse.eye_array(self.size), np.zeros((self.size, self.size))
        lower = []  # a₁ and a₂
        for power, less in ((self._first, self.modes), (self._second, self.modes + 1)):
            at = np.flatnonzero(power)
            entries = np.sqrt(power[at]), (at - less[at], at)
            lower.append(scipy.sparse.csr_array(entries, shape=found.shape))
        for i, j in np.ndindex(2, 2):
            first, last = lower[i] + self._right[i] * identity, lower[j].T + self._left[j] * identity
            found -= drift[i, j] * (last @ first)
        return found
