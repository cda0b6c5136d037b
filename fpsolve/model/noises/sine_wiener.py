"""Bounded sine-Wiener noise: the sine of a Brownian motion on a circle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic.dataclasses import dataclass

from fpsolve.arrays import FloatArray
from fpsolve.model.exact import ExactLaw
from fpsolve.model.faults import with_plain_errors
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.model.parameters import SIZE, STRICT, parameter


class CircleStep(NamedTuple):
    """θ₁ = θ₀ + kick ζ₁ and, of weak order 2, ξ̄ = A fade sin θ̄, ζ normal.

    θ̄ = ½(θ₀ + θ₁) + spread ζ₂ is the mean of θ over the step, and fade that of cos(θ − θ̄).
    """

    amplitude: float
    kick: float
    spread: float
    fade: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
        """One step, see `Noise.step`; of the two θ with sin θ = ξ/A either will do, as ξ is Markov by itself."""
        for i in range(xi.size):
            start = math.asin(min(max(xi[i] / step.amplitude, -1.0), 1.0))
            end = start + step.kick * rng.standard_normal()
            xi_end[i] = step.amplitude * math.sin(end)
            middle = 0.5 * (start + end) + step.spread * rng.standard_normal()
            xi_mean[i] = step.amplitude * step.fade * math.sin(middle)


@with_plain_errors
@dataclass(frozen=True, config=STRICT)
class SineWiener(Noise):
    """Bounded noise ξ = A sin(σ W(t) + θ₀), θ₀ uniform: dξ = −½σ²ξ dt + σ√(A² − ξ²) dW.

    Its stationary density is 1/(π√(A² − ξ²)), its correlation ½A² exp(−½σ²|t|); the Chebyshev polynomials T_k(ξ/A) are
    the eigenfunctions of its generator, with −½σ²k² (R. V. Bobryk and A. Chrzeszczyk, Physica A 358, 2005).

    Args:
        amplitude: A, 1e-15 to 1e15, in the unit of ξ.
        sigma: σ, 1e-15 to 1e15, in time^(-1/2).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    amplitude: Annotated[float, parameter("amplitude", "amplitude = 1.0", "$A$", "1/time", **SIZE)]
    sigma: Annotated[
        float, parameter("intensity of the noise in the phase", "sigma = 1.0", r"$\sigma$", "1/time^(1/2)", **SIZE)
    ]

    kind: ClassVar[str] = "sine-wiener"
    of_xi: ClassVar[Sequence[str]] = ("amplitude",)
    may_tilt: ClassVar[bool] = False

    @property
    def half_width(self) -> float:
        return self.amplitude

    @property
    def end_exponent(self) -> float:
        return -0.5

    @property
    def standard_deviation(self) -> float:
        """A/√2."""
        return self.amplitude / math.sqrt(2)

    @property
    def correlation_time(self) -> float:
        """2/σ²."""
        return 2 / self.sigma**2

    relaxation_time = correlation_time

    def spectral_density(self, omega: float) -> float:
        """S(ω) = ½A² σ²/(¼σ⁴ + ω²)."""
        return 0.5 * (self.amplitude * self.sigma) ** 2 / (0.25 * self.sigma**4 + omega**2)

    @property
    def diffusion(self) -> float:
        return self.sigma * self.amplitude

    def squared_diffusion(self, xi: ArrayLike) -> FloatArray:
        """σ²(A² − ξ²)."""
        return np.asarray(self.sigma**2 * (self.amplitude**2 - np.asarray(xi, dtype=float) ** 2))

    def log_density(self, xi: ArrayLike) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = -0.5 * np.log1p(-((np.asarray(xi, dtype=float) / self.amplitude) ** 2))
        return np.nan_to_num(logs, nan=-math.inf, posinf=math.inf) - math.log(math.pi * self.amplitude)

    def holding_cost(self, xi: FloatArray) -> FloatArray:
        """0: θ has no drift."""
        return np.zeros_like(xi)

    def sample(self, size: int, rng: np.random.Generator) -> FloatArray:
        return self.amplitude * np.sin(rng.uniform(0, 2 * math.pi, size))

    def step(self, h: float, bias: float = 0.0) -> CircleStep:
        kick = self.sigma * math.sqrt(h)
        return CircleStep(self.amplitude, kick, kick / math.sqrt(12), math.exp(-(kick**2) / 12))

    @property
    def largest_step(self) -> float:
        return 0.1 / self.sigma**2

    @classmethod
    def exact_law(cls, decimals: Mapping[str, str]) -> ExactLaw:
        return ExactLaw(("circle",), Fraction(decimals["amplitude"]) ** 2, Fraction(decimals["sigma"]) ** 2)

    def derivative(self, name: str) -> NoiseDerivative:
        """∂/∂A stretches ξ, and ∂/∂σ is that of σ alone."""
        a = 1 / self.amplitude
        return NoiseDerivative(a, log_scale=a) if name == "amplitude" else NoiseDerivative(1 / self.sigma)
