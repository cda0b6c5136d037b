"""Functions of two Gaussian numbers u₁, u₂ of the covariance 1, of which a noise ξ = std u₁ is made, in their law.

Where du = −Mu dt + N dW with M + Mᵀ = NNᵀ, the generator is L = −Σ M_ij a_j† a_i, with a_i = ∂_i that lowers a degree,
a_i† He_k = √(k + 1) He_(k+1): it keeps the total degree, and ξ = std (a₁ + a₁†) changes it by one.

Where T ~ exp(r·u) and T*/P_s ~ exp(l·u) the functions carry these factors, trial and test ones each their own. Then the
weight is that of u with the mean r + l, and L = −Σ M_ij (a_j† + l_j)(a_i + r_i). They are those of L + g u₁ for
r = g M⁻ᵀ(1, 0) and l = g M⁻¹(1, 0).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.fem.axis import Rule
from fpsolve.fem.noise_axes import MORE_POINTS, CountedAxis, Samples, form
from fpsolve.model.noise import NoiseDerivative
from fpsolve.polynomials import hermite


@dataclass(frozen=True, eq=False)
class PairAxis(CountedAxis):
    """The products He_j He_k of normalised Hermite polynomials of u₁ and u₂ less their means, j + k < n, by j + k.

    Attributes:
        noise: it states M as `drift_matrix`.
        count: n.
        slope: g/p.
    """

    slope: float = 0.0
    p: float = 1.0

    word, dimension = "pairs", 2

    @property
    def size(self) -> int:
        return self.count * (self.count + 1) // 2

    @cached_property
    def _degrees(self) -> IntArray:
        """The total degree, and those in u₁ and u₂, of each product, shape (3, size)."""
        total, second = np.tril_indices(self.count)
        return np.stack([total, total - second, second])

    @property
    def modes(self) -> IntArray:
        return self._degrees[0]

    @cached_property
    def _factors(self) -> FloatArray:
        """r and l."""
        drift, first = self.noise.drift_matrix, np.array([self.tilt, 0.0])
        return np.stack([np.linalg.solve(drift.T, first), np.linalg.solve(drift, first)])

    @property
    def center(self) -> float:  # type: ignore[override]
        return float(self._factors[0, 0] + self._factors[1, 0])

    @cached_property
    def rule(self) -> Rule:
        x, weights = hermite(self.count).rule
        table, (_, first, second) = hermite(self.count).at(x)[0], self._degrees
        points = np.array([np.repeat(x, x.size), np.tile(x, x.size)])
        values = (table[:, None, first] * table[None, :, second]).reshape(-1, self.size)
        return Rule(points, np.outer(weights, weights).ravel(), values)

    @cached_property
    def _fine(self) -> Rule:
        """The polynomials at the points ξ of a rule for u₁."""
        x, weights = hermite(self.count + MORE_POINTS).rule
        unit = self.noise.standard_deviation
        return Rule(unit * (x + self.center), weights, hermite(self.count).at(x)[0])

    @property
    def xi(self) -> FloatArray:
        return self._fine.points

    def product(self, f: FloatArray) -> FloatArray:
        matrix, (_, first, second) = form(self._fine.values, self._fine.measure * f), self._degrees
        return np.where(np.equal.outer(second, second), matrix[np.ix_(first, first)], 0.0)

    def generator(self) -> FloatArray:
        return self._drifting(self.noise.drift_matrix)

    def _changed_generator(self, change: NoiseDerivative) -> FloatArray:
        return self._drifting(np.array(change.drift or np.zeros((2, 2))))

    def samples(self) -> Samples:
        """At the points of a rule for (u₁, u₂); the weight is in the measure."""
        factor = np.exp(np.clip(self._factors[0] @ self.rule.points, -600, 600))
        xi = self.noise.standard_deviation * (self.rule.points[0] + self.center)
        return Samples(xi, np.ones(factor.size), self.rule.measure, self.rule.values, factor)

    def law(self) -> FloatArray:
        weights = self.rule.measure * np.exp(-self._factors.sum(axis=0) @ self.rule.points)
        return weights / weights.sum()

    def _drifting(self, drift: FloatArray) -> FloatArray:
        """−Σ M_ij ∫ v (a_j† + l_j)(a_i + r_i) u."""
        identity, found = scipy.sparse.eye_array(self.size), np.zeros((self.size, self.size))
        lower = []  # a₁ and a₂
        right, left = self._factors
        for power, less in ((self._degrees[1], self.modes), (self._degrees[2], self.modes + 1)):
            at = np.flatnonzero(power)
            entries = np.sqrt(power[at]), (at - less[at], at)
            lower.append(scipy.sparse.csr_array(entries, shape=found.shape))
        for i, j in np.ndindex(2, 2):
            first, last = lower[i] + right[i] * identity, lower[j].T + left[j] * identity
            found -= drift[i, j] * (last @ first)
        return found
