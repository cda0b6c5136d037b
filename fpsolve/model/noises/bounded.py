"""Bounded noise: a wave whose phase turns steadily and diffuses; without the diffusion a harmonic load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

from pydantic.dataclasses import dataclass

from fpsolve.model.faults import with_plain_errors
from fpsolve.model.noise import NoiseDerivative
from fpsolve.model.noises.sine_wiener import NoiseOfAngle
from fpsolve.model.parameters import SIZE, STRICT, parameter


@with_plain_errors
@dataclass(frozen=True, config=STRICT)
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
    of_xi: ClassVar[Sequence[str]] = ("mu",)

    def __post_init__(self) -> None:
        if not (self.nu or self.sigma):
            raise ValueError("got nu = 0 and sigma = 0; ξ would be constant; let nu or sigma be positive")

    @property
    def amplitude(self) -> float:  # type: ignore[override]
        """μ."""
        return self.mu

    def derivative(self, name: str) -> NoiseDerivative:
        """The derivative by μ, ν or σ: μ scales ξ, ν changes the speed of the phase, σ its diffusion.

        Λ is even in ν and in σ.
        """
        if name == "nu":
            return NoiseDerivative(turning=1.0)
        if name == "mu":
            return NoiseDerivative(1 / self.mu, log_scale=1 / self.mu)
        return NoiseDerivative(1 / self.sigma if self.sigma else 0.0)
