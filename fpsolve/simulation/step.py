"""What the compiled loops need: the numbers of one step of motion and noise, and the stationary law of the noise."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.noise import Noise
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator


class Motion(NamedTuple):
    """The numbers of Eq. (3): ω, ε, ε²c₁, ε²c₂, ε²c₃ω², and the factor of u at an impact.

    The factor is −R for the mass at its wall, Eq. (3), and R for the smooth coordinate y of Eq. (6).
    """

    omega: float
    strength: float
    linear: float
    cubic: float
    rayleigh: float
    bounce: float


class NoiseStep(NamedTuple):
    """One step of the noise dξ = (f(ξ) + σ² b) dt + σ dW, b the bias: its end ξ₁ and mean ξ̄ from normal variables ζ.

    Ornstein-Uhlenbeck, by the exact transition of both: ξ₁ = decay ξ₀ + kick ζ₁ + end₀ and
    ξ̄ = mean ξ₀ + mean₁ ζ₁ + mean₂ ζ₂ + mean₀.
    Eq. (7), where `pull` > 0, by the implicit trapezoidal rule, of weak order 2, which never leaves the support:
    ξ₁ + pull ξ₁/(1 + cξ₁²) = ξ₀ − pull ξ₀/(1 + cξ₀²) + kick ζ₁ + end₀ with pull = h/2τ₀, and ξ̄ = (ξ₀ + ξ₁)/2.
    """

    rate: float
    decay: float
    kick: float
    end0: float
    mean: float
    mean1: float
    mean2: float
    mean0: float
    pull: float
    curvature: float


def motion(oscillator: VibroImpactOscillator, *, smooth: bool = False) -> Motion:
    """The coefficients of the system (3), or with `smooth` of Eq. (6) in y, whose modulus is x by Eq. (4)."""
    square, R = oscillator.epsilon**2, oscillator.impact_factor()
    return Motion(
        omega=oscillator.omega,
        strength=oscillator.epsilon,
        linear=square * oscillator.c1,
        cubic=square * oscillator.c2,
        rayleigh=square * oscillator.c3 * oscillator.omega**2,
        bounce=R if smooth else -R,
    )


def noise_step(noise: Noise, h: float, bias: float = 0.0) -> NoiseStep:
    """The coefficients of one step of length h; `bias` is b, which adds σ² b to the drift."""
    force = noise.diffusion**2 * bias
    if isinstance(noise, NonGaussianNoise) and noise.r0 != 1:
        kick = noise.diffusion * math.sqrt(h)
        return NoiseStep(0.0, 0.0, kick, force * h, 0.0, 0.0, 0.0, 0.0, h / (2 * noise.tau0), noise.curvature)
    alpha = 1 / noise.tau0 if isinstance(noise, NonGaussianNoise) else noise.alpha  # type: ignore[attr-defined]
    std, a = noise.standard_deviation, alpha * h
    decay, mean = math.exp(-a), -math.expm1(-a) / a
    # Variances of ξ₁ and ξ̄ and their covariance, in units of std²; the series avoids cancellation.
    var_end, covariance = -math.expm1(-2 * a), a * mean**2
    if a > 0.02:
        var_mean = (2 * a + 4 * math.expm1(-a) - math.expm1(-2 * a)) / a**2
    else:
        var_mean = a * (2 / 3 - a / 2 + 7 * a**2 / 30 - a**3 / 12 + 31 * a**4 / 1260)
    kick = math.sqrt(var_end)
    mean1 = covariance / kick
    return NoiseStep(
        rate=a,
        decay=decay,
        kick=std * kick,
        end0=force / alpha * (1 - decay),
        mean=mean,
        mean1=std * mean1,
        mean2=std * math.sqrt(var_mean - mean1**2),
        mean0=force / alpha * (1 - mean),
        pull=0.0,
        curvature=0.0,
    )


def starting_state(
    noise: Noise, paths: int, rng: np.random.Generator, amplitude: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, u and ξ of paths of one amplitude, with uniform phases in front of the wall and stationary noise."""
    phase = rng.uniform(0, math.pi, paths)
    return amplitude * np.sin(phase), amplitude * np.cos(phase), stationary_noise(noise, paths, rng)


def stationary_noise(noise: Noise, size: int, rng: np.random.Generator) -> FloatArray:
    """Independent values of ξ from the stationary density: Gaussian, or Eq. (9) as a beta or a Student variable."""
    if not isinstance(noise, NonGaussianNoise) or noise.r0 == 1:
        return noise.standard_deviation * rng.standard_normal(size)
    a = 1 / abs(noise.r0 - 1)
    if noise.r0 < 1:
        return noise.half_width * (2 * rng.beta(a + 1, a + 1, size) - 1)
    nu = 2 * a - 1
    return math.sqrt(2 * noise.D0 * a / (noise.tau0 * nu)) * rng.standard_t(nu, size)
