"""Functions of two Gaussian numbers u₁, u₂ of the covariance 1, of which a noise ξ = std u₁ is made, in their law.

Where du = −Mu dt + N dW with M + Mᵀ = NNᵀ, the generator is L = −Σ M_ij a_j† a_i, with a_i = ∂_i that lowers a degree,
a_i† He_k = √(k + 1) He_(k+1): it keeps the total degree, and ξ = std (a₁ + a₁†) changes it by one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.fem.noise_axes import FAR, MORE_POINTS, STEP, NoiseAxis, Samples, form
from fpsolve.fem.polynomials import hermite
from fpsolve.model.noise import NoiseDerivative


class PairAxis(NoiseAxis):
    """The products He_j(u₁) He_k(u₂) of normalised Hermite polynomials with j + k < n, by j + k.

    Args:
        noise: it states M as `drift_matrix`.
        count: n.
    """

    is_local = False

    def __init__(self, noise: Any, count: int) -> None:
        super().__init__()
        self.noise, self.unit = noise, noise.standard_deviation
        degree, second = np.tril_indices(count)
        self._first, self._second, self.modes = degree - second, second, degree
        self.size, self.cells = degree.size, np.zeros(degree.size, dtype=int)
        self.constant = np.eye(1, self.size)[0]
        x, weights = hermite(count).rule()
        table = hermite(count).at(x)[0]
        self._u, self.measure = np.repeat(x, x.size), np.outer(weights, weights).ravel()
        self.values = (table[:, None, self._first] * table[None, :, self._second]).reshape(-1, self.size)
        fine, self._weights = hermite(count + MORE_POINTS).rule()
        self._points, self._table = self.unit * fine, hermite(count).at(fine)[0]
        self.support = self.unit * FAR * np.array([-1.0, 1.0])

    def mass(self, g: Coefficient = one) -> FloatArray:
        return self._weighed(g(self._points)) if g != one else np.eye(self.size)

    def generator(self) -> FloatArray:
        return self._moved(self.noise.drift_matrix)

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> FloatArray:
        if g is None:
            return self._moved(np.array(change.drift)) if change.drift else np.zeros((self.size, self.size))
        slope = (g(self._points * (1 + STEP)) - g(self._points * (1 - STEP))) / (2 * STEP)
        return self._weighed(change.log_scale * slope)

    def samples(self) -> Samples:
        """At the points of a rule for (u₁, u₂); the weight is in the measure."""
        ones = np.ones(self.measure.size)
        return Samples(self.unit * self._u, ones, self.measure, self.values, ones)

    def projection(self, other: PairAxis) -> FloatArray:
        return np.eye(self.size, other.size)

    def _weighed(self, values: FloatArray) -> FloatArray:
        """∫ g u v from g at the points of the rule for u₁."""
        matrix = form(self._table, self._weights * values)
        return np.where(np.equal.outer(self._second, self._second), matrix[np.ix_(self._first, self._first)], 0.0)

    def _moved(self, drift: FloatArray) -> FloatArray:
        """−Σ M_ij ∫ v a_j† a_i u."""
        first, second, found = (
            self._first,
            self._second,
            -np.diag(drift[0, 0] * self._first + drift[1, 1] * self._second),
        )
        upper, lower = np.flatnonzero(first), np.flatnonzero(second)  # where a₁, and a₂, leave something
        found[upper + 1, upper] = -drift[0, 1] * np.sqrt(first[upper] * (second[upper] + 1.0))
        found[lower - 1, lower] = -drift[1, 0] * np.sqrt(second[lower] * (first[lower] + 1.0))
        return found
