"""Ornstein-Uhlenbeck noise, Eqs. (15)-(16): the Gaussian process with an exponential correlation."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noise import Gaussian, Noise, NoiseDerivative
from fpsolve.model.noises.steps import LinearStep, linear_step
from fpsolve.model.parameters import DERIVED, SIZE, parameter

Intensity = Annotated[float, parameter("noise intensity", "D0 = 0.1", "$D_0$", "1/time", **SIZE)]
Memory = Annotated[float, parameter("correlation time", "tau0 = 0.5", r"$\tau_0$", "time", **SIZE)]


class GaussianNoise(Gaussian):
    """A process with the law of Eq. (15), dξ = −α₀ ξ dt + σ₀ dW, whatever its parameters are."""

    of_xi: ClassVar[Mapping[str, str]] = {"D0": "{0}{0}time", "sigma": "{}time^(-1/2)", "standard_deviation": "{}"}

    if TYPE_CHECKING:  # a field or a property

        @property
        @abstractmethod
        def alpha(self) -> float: ...
        @property
        @abstractmethod
        def sigma(self) -> float: ...

    @property
    def diffusion(self) -> float:
        return self.sigma

    @property
    def standard_deviation(self) -> float:
        """σ₀/√(2α₀)."""
        return self.sigma / math.sqrt(2 * self.alpha)

    @property
    def correlation_time(self) -> float:
        """1/α₀."""
        return 1 / self.alpha

    def drift(self, xi: ArrayLike) -> FloatArray:
        """−α₀ ξ."""
        return -self.alpha * np.asarray(xi, dtype=float)

    def spectral_density(self, omega: float) -> float:
        """S(ω) = σ₀²/(α₀² + ω²), Eq. (16)."""
        return self.sigma**2 / (self.alpha**2 + omega**2)

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        return self.standard_deviation * rng.standard_normal(size)

    def step(self, h: float, bias: float = 0.0) -> LinearStep:
        return linear_step(self.alpha, self.sigma, h, bias)

    @property
    def largest_step(self) -> float:
        return 0.5 / self.alpha

    def by_logarithms(self, log_sigma: float, log_alpha: float) -> NoiseDerivative:
        """∂/∂θ from ∂ ln σ₀/∂θ and ∂ ln α₀/∂θ: ln P_s = −z²/2 and z ~ ξ√α₀/σ₀."""
        factor, unit = log_sigma - 0.5 * log_alpha, self.standard_deviation
        return NoiseDerivative(log_sigma, lambda xi: factor * (xi / unit) ** 2)


@strict_dataclass
class OrnsteinUhlenbeckByIntensity(GaussianNoise):
    """Ornstein-Uhlenbeck noise of the intensity D₀ and the correlation time τ₀: α₀ = 1/τ₀, σ₀ = √(2D₀)/τ₀.

    Args:
        D0: D₀ = S(0)/2, 1e-15 to 1e15, in 1/time.
        tau0: τ₀, 1e-15 to 1e15, in time.

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    D0: Intensity
    tau0: Memory

    kind: ClassVar[str] = "ornstein-uhlenbeck"

    @property
    def alpha(self) -> float:
        return 1 / self.tau0

    @property
    def sigma(self) -> float:
        return math.sqrt(2 * self.D0) / self.tau0

    def derivative(self, name: str) -> NoiseDerivative:
        return self.by_logarithms(0.5 / self.D0, 0.0) if name == "D0" else self.by_logarithms(*2 * (-1 / self.tau0,))


@strict_dataclass
class OrnsteinUhlenbeckByDeviation(GaussianNoise):
    """Ornstein-Uhlenbeck noise of the relaxation rate α and a standard deviation s: σ₀ = s√(2α).

    Args:
        alpha: α, 1e-15 to 1e15, in 1/time.
        standard_deviation: s, 1e-15 to 1e15, in the unit of ξ.

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    alpha: Annotated[float, parameter("relaxation rate", "alpha = 1.0", r"$\alpha$", "1/time", **SIZE)]
    standard_deviation: float = cast(
        "float",
        parameter(
            "standard deviation of the noise",
            "standard_deviation = 0.7",
            r"$\sigma_\xi$",
            "1/time",
            ge=SIZE["ge"],
            le=SIZE["le"],
        ),
    )

    kind: ClassVar[str] = "ornstein-uhlenbeck"

    @property
    def sigma(self) -> float:
        return self.standard_deviation * math.sqrt(2 * self.alpha)

    def derivative(self, name: str) -> NoiseDerivative:
        """σ₀ ~ s√α."""
        if name == "alpha":
            return self.by_logarithms(0.5 / self.alpha, 1 / self.alpha)
        return self.by_logarithms(1 / self.standard_deviation, 0.0)


@strict_dataclass
class OrnsteinUhlenbeck(GaussianNoise):
    """Ornstein-Uhlenbeck noise dξ = −α₀ ξ dt + σ₀ dW, Eq. (15).

    A case file may state it by other numbers too, see `variants`.

    >>> OrnsteinUhlenbeck(alpha=2.0, sigma=1.0).spectral_density(0.0)
    0.25

    Args:
        alpha: relaxation rate α₀, 1e-32 to 1e32, in 1/time.
        sigma: coefficient of the Wiener process, σ₀, 1e-32 to 1e32, in time^(-3/2).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    alpha: Annotated[float, parameter("relaxation rate", "alpha = 1.0", r"$\alpha_0$", "1/time", **DERIVED)]
    sigma: Annotated[
        float,
        parameter("intensity of the driving white noise", "sigma = 0.5", r"$\sigma_0$", "1/time^(3/2)", **DERIVED),
    ]

    kind: ClassVar[str] = "ornstein-uhlenbeck"
    variants: ClassVar[Sequence[type[Noise]]] = (OrnsteinUhlenbeckByIntensity, OrnsteinUhlenbeckByDeviation)

    def derivative(self, name: str) -> NoiseDerivative:
        return self.by_logarithms(1 / self.sigma, 0.0) if name == "sigma" else self.by_logarithms(0.0, 1 / self.alpha)
