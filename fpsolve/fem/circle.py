"""Functions of the angle θ of a noise ξ(θ), dθ = ν dt + σ dW, on its circle, in its uniform law."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fpsolve.arrays import FloatArray, IntArray, Matrix
from fpsolve.fem.axis import Rule
from fpsolve.fem.noise_axes import CountedAxis, Samples, form
from fpsolve.model.noise import NoiseDerivative

MOST_HARMONICS = 64
"""Number of equidistant points beyond four for each wave: a rule of them is exact for g(ξ(θ)) of so many harmonics."""


@dataclass(frozen=True, eq=False)
class CircleAxis(CountedAxis):
    """The waves 1, √2 cos kθ, √2 sin kθ, k ≤ n, in this order: ½σ²∂² is diagonal, ν∂ couples the two of each k.

    Where ξ = μ cos θ, that of ξ has two diagonals on each side. The two of each k are eliminated together: for
    σ = 0 the pivot of one alone would be as singular as the problem with ξ = 0. Where coefficients have waves up to m,
    those up to n m are taken, m to each degree.

    Attributes:
        noise: it states ν as `nu`, σ as `sigma`, and ξ(θ) as `of_angle`.
        count: n.
    """

    word = "waves"

    @property
    def band(self) -> int:  # type: ignore[override]
        return 2 * self.noise.harmonics

    @property
    def size(self) -> int:
        return 2 * self.count * self.noise.harmonics + 1

    @cached_property
    def _waves(self) -> IntArray:
        return (np.arange(self.size) + 1) // 2

    @cached_property
    def modes(self) -> IntArray:
        return -(-self._waves // self.noise.harmonics)

    @cached_property
    def rule(self) -> Rule:
        count = 2 * (self.size - 1) + MOST_HARMONICS
        theta = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return Rule(theta, np.full(count, 1 / count), self.values_at(theta))

    @cached_property
    def xi(self) -> FloatArray:
        return self.noise.of_angle(self.rule.points)

    def values_at(self, theta: FloatArray) -> FloatArray:
        """The waves at any θ, shape (len(θ), size)."""
        waves = np.sqrt(2) * np.exp(1j * np.outer(theta, self._waves))
        values = np.where(np.arange(self.size) % 2, waves.real, waves.imag)
        values[:, 0] = 1.0
        return values

    def product(self, f: FloatArray) -> FloatArray:
        return form(self.rule.values, self.rule.measure * f)

    def generator(self) -> FloatArray:
        """∫ v (ν∂ + ½σ²∂²) u."""
        return self.noise.nu * self._turning() + self._diffusing()

    def _changed_generator(self, change: NoiseDerivative) -> FloatArray:
        return 2 * (change.log_diffusion - change.log_scale) * self._diffusing() + change.turning * self._turning()

    def samples(self) -> Samples:
        """At equidistant θ; weight and measure are those of θ."""
        ones = np.ones(self.rule.measure.size)
        return Samples(self.xi, 0.5 / np.pi * ones, 2 * np.pi * self.rule.measure, self.rule.values, ones)

    def everywhere(self, count: int) -> tuple[FloatArray, Matrix]:
        """At equidistant θ of the whole circle, the first one twice."""
        theta = np.linspace(0, 2 * np.pi, 2 * count + 1)
        return self.noise.of_angle(theta), self.values_at(theta)

    def _turning(self) -> FloatArray:
        """∫ v ∂u."""
        beside = np.where(np.arange(self.size - 1) % 2, self._waves[1:], 0.0)
        return np.diag(beside, 1) - np.diag(beside, -1)

    def _diffusing(self) -> FloatArray:
        return np.diag(-0.5 * self.noise.sigma**2 * self._waves**2)
