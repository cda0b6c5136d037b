"""Bounded noise that is a wave of an angle which turns and diffuses; sine-Wiener noise, whose angle does not turn."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.model.noises.steps import AngleStep
from fpsolve.model.parameters import SIZE, parameter


class NoiseOfAngle(Noise):
    """Bounded noise ξ = A cos θ, dθ = ν dt + σ dW, θ₀ uniform: its correlation is ½A² exp(−½σ²|t|) cos νt.

    Its stationary density is 1/(π√(A² − ξ²)). For ν = 0 it obeys dξ = −½σ²ξ dt + σ√(A² − ξ²) dW. For ν > 0 it is no
    Markov process by itself, so that functions of the noise are functions of θ.
    Coefficients have waves up to `harmonics` θ.
    """

    may_tilt: ClassVar[bool] = False
    harmonics = 1

    if TYPE_CHECKING:  # a field, a constant or a property

        @property
        @abstractmethod
        def amplitude(self) -> float: ...
        @property
        @abstractmethod
        def sigma(self) -> float: ...
        @property
        @abstractmethod
        def nu(self) -> float: ...

    @property
    def basis(self) -> Literal["polynomials", "waves"]:
        return "waves" if self.nu else "polynomials"

    @property
    def has_peak(self) -> bool:
        """Whether ν > 0, so that the spectral density has peaks at ±ν."""
        return self.nu > 0

    @property
    def period(self) -> float:
        """2π/ν for a harmonic load, σ = 0; else 0."""
        return 0.0 if self.sigma else 2 * math.pi / self.nu

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
        """2/σ², the time in which the angle is forgotten; ∞ for a harmonic load."""
        return 2 / self.sigma**2 if self.sigma else math.inf

    relaxation_time = correlation_time

    def spectral_density(self, omega: float) -> float:
        """S(ω) = ½A²σ²(ω² + ν² + ¼σ⁴)/((ω² − ν² − ¼σ⁴)² + σ⁴ω²), the sum of a peak at ν and one at −ν.

        For a harmonic load it is ∞ at |ω| = ν and 0 at all other frequencies.
        """
        half = 0.5 * self.sigma**2
        if not half:
            return math.inf if abs(omega) == self.nu else 0.0
        sizes = [math.hypot(half, omega - side * self.nu) for side in (1, -1)]
        return 0.5 * self.amplitude**2 * sum(half / size / size for size in sizes)

    @property
    def diffusion(self) -> float:
        """σA."""
        return self.sigma * self.amplitude

    def squared_diffusion(self, xi: ArrayLike) -> FloatArray:
        """σ²(A² − ξ²)."""
        return np.asarray(self.sigma**2 * (self.amplitude**2 - np.asarray(xi, dtype=float) ** 2))

    def log_density(self, xi: ArrayLike) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = -0.5 * np.log1p(-((np.asarray(xi, dtype=float) / self.amplitude) ** 2))
        return np.nan_to_num(logs, nan=-math.inf, posinf=math.inf) - math.log(math.pi * self.amplitude)

    def holding_cost(self, xi: FloatArray) -> FloatArray:
        """0: θ has no drift but ν."""
        return np.zeros_like(xi)

    def of_angle(self, theta: FloatArray) -> FloatArray:
        """ξ = A cos θ, in the shape of θ."""
        return np.asarray(self.amplitude * np.cos(theta))

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """ξ and θ, shape (2, size)."""
        theta = rng.uniform(0, 2 * math.pi, size)
        return np.array([self.of_angle(theta), theta])

    def step(self, h: float, bias: float = 0.0) -> AngleStep:
        """One step of length h for the simulation, see `Noise.step`; this noise takes no bias."""
        kick = self.sigma * math.sqrt(h)
        fade = math.exp(-(kick**2) / 12) * float(np.sinc(0.5 * self.nu * h / math.pi))
        return AngleStep(self.amplitude, self.nu * h, kick, kick / math.sqrt(12), fade)

    @property
    def largest_step(self) -> float:
        """The smaller of 0.1/σ² and 0.1π/ν, a tenth of the times in which the angle diffuses by 1 or turns by π."""
        return min(0.1 / self.sigma**2 if self.sigma else math.inf, 0.1 * math.pi / self.nu if self.nu else math.inf)

    def derivative(self, name: str) -> NoiseDerivative:
        """The amplitude scales ξ, ν changes the speed of the phase, σ its diffusion. Λ is even in ν and in σ."""
        if name == "nu":
            return NoiseDerivative(turning=1.0)
        if name == "sigma":
            return NoiseDerivative(1 / self.sigma if self.sigma else 0.0)
        return NoiseDerivative(1 / self.amplitude, log_scale=1 / self.amplitude)


@strict_dataclass
class SineWiener(NoiseOfAngle):
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
    nu: ClassVar[float] = 0.0
    of_xi: ClassVar[Mapping[str, str]] = {"amplitude": "{}"}


@strict_dataclass
class Bounded(NoiseOfAngle):
    """Bounded noise ξ = μ cos θ, dθ = ν dt + σ dW, θ₀ uniform: its correlation is ½μ² exp(−½σ²|t|) cos νt.

    See W.-C. Xie, J. Sound Vib. 263, 2003. ξ has the stationary density of sine-Wiener noise, but is no Markov process
    by itself, so that functions of the noise are functions of θ. With ν = 0 the noise is sine-Wiener noise, and is
    solved as such. With σ = 0 it is a harmonic load, ξ = μ cos(νt + θ₀).

    >>> Bounded(mu=0.4, nu=2.0, sigma=0.5).standard_deviation ** 2  # ½μ²
    0.08

    Args:
        mu: μ, 1e-15 to 1e15, in the unit of ξ.
        nu: ν, 0 to 1e15, in rad/time.
        sigma: σ, 0 to 1e15, in time^(-1/2).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
        ValueError: ν and σ are both 0.
    """

    mu: Annotated[float, parameter("amplitude", "mu = 0.4", r"$\mu$", "1/time", **SIZE)]
    nu: Annotated[float, parameter("mean frequency", "nu = 2.0", r"$\nu$", "rad/time", ge=0.0, le=SIZE["le"])]
    sigma: Annotated[
        float,
        parameter(
            "intensity of the noise in the phase", "sigma = 0.3", r"$\sigma$", "1/time^(1/2)", ge=0.0, le=SIZE["le"]
        ),
    ]

    kind: ClassVar[str] = "bounded"
    of_xi: ClassVar[Mapping[str, str]] = {"mu": "{}"}

    def __post_init__(self) -> None:
        if not (self.nu or self.sigma):
            raise ValueError("got nu = 0 and sigma = 0; ξ would be constant; let nu or sigma be positive")

    @property
    def amplitude(self) -> float:
        """μ."""
        return self.mu
