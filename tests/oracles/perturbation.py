"""The paper's Eqs. (33)-(39) as they are printed, for its oscillator.

A `NonGaussianNoise` enters through its Ornstein-Uhlenbeck reduction (12)-(14), as in the paper.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, VibroImpactOscillator
from fpsolve.arrays import FloatArray
from fpsolve.model import Noise


def reduced(noise: Noise) -> OrnsteinUhlenbeck:
    """The Ornstein-Uhlenbeck process that stands for the noise in Eqs. (33)-(39)."""
    return noise.ou_reduction() if isinstance(noise, NonGaussianNoise) else noise


def first_order_eigenfunction(
    oscillator: VibroImpactOscillator, noise: Noise, p: float, phi: ArrayLike, xi: ArrayLike
) -> FloatArray:
    """T₁(φ, ξ; p) of Eq. (33) with C = 1 and K(ξ, τ) = ξ exp(−α₀τ); φ and ξ broadcast.

    T₁ = ½pξ [1/α₀ − (α₀ cos 2φ − 2ω sin 2φ)/(α₀² + 4ω²)] solves L₀T₁ = −p q₁ ξ, Eq. (32).
    """
    alpha, omega = reduced(noise).alpha, oscillator.omega
    phi, xi = np.asarray(phi, dtype=float), np.asarray(xi, dtype=float)
    wave = (alpha * np.cos(2 * phi) - 2 * omega * np.sin(2 * phi)) / (alpha**2 + 4 * omega**2)
    return 0.5 * p * xi * (1 / alpha - wave)


def _spectral_densities(oscillator: VibroImpactOscillator, noise: Noise) -> tuple[float, float]:
    """S(0) and S(2ω), Eq. (16)."""
    ou = reduced(noise)
    return ou.spectral_density(0.0), ou.spectral_density(2 * oscillator.omega)


def _mean_loss(oscillator: VibroImpactOscillator) -> float:
    """(2ω/π)(1 − r), the impacts' share of the mean damping in Eq. (36)."""
    return 2 * oscillator.omega / math.pi * (1 - oscillator.restitution)


def moment_exponent(oscillator: VibroImpactOscillator, noise: Noise, p: ArrayLike) -> Any:
    """ε²Λ₂(p), Eq. (37); an array for an array of p."""
    s0, s2 = _spectral_densities(oscillator, noise)
    p = np.asarray(p, dtype=float)
    bracket = (s2 + 2 * s0) * p + 2 * s2 + 8 * (oscillator.c1 - _mean_loss(oscillator))
    return (oscillator.epsilon**2 / 16 * p * bracket)[()]


def moment_scale(oscillator: VibroImpactOscillator, noise: Noise, p: ArrayLike) -> Any:
    """The sum of the absolute values of the terms of Eq. (37), before they cancel: the scale of an error of Λ(p)."""
    s0, s2 = _spectral_densities(oscillator, noise)
    size = np.abs(np.asarray(p, dtype=float))
    terms = (s2 + 2 * s0) * size + 2 * s2 + 8 * (abs(oscillator.c1) + _mean_loss(oscillator))
    return (oscillator.epsilon**2 / 16 * size * terms)[()]


def stability_index(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """δ_p, the non-zero root of ε²Λ₂(p), Eq. (38)."""
    s0, s2 = _spectral_densities(oscillator, noise)
    return (8 * (_mean_loss(oscillator) - oscillator.c1) - 2 * s2) / (s2 + 2 * s0)


def lyapunov_exponent(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """λ = ε²Λ₂′(0), Eq. (39)."""
    _, s2 = _spectral_densities(oscillator, noise)
    return oscillator.epsilon**2 / 8 * (s2 + 4 * (oscillator.c1 - _mean_loss(oscillator)))


def lyapunov_scale(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """The sum of the absolute values of the terms of Eq. (39): the scale of an error of λ."""
    _, s2 = _spectral_densities(oscillator, noise)
    return oscillator.epsilon**2 / 8 * (s2 + 4 * (abs(oscillator.c1) + _mean_loss(oscillator)))


def impact_rate(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """N of Eq. (36): two impacts in a turn, 2π/ω."""
    return oscillator.omega / math.pi


def _noise_and_damping(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """λ of Eq. (39) without impacts."""
    return oscillator.epsilon**2 / 8 * (_spectral_densities(oscillator, noise)[1] + 4 * oscillator.c1)


def critical_impact_factor(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """The R that makes up for noise and damping within half a turn."""
    return math.exp(-_noise_and_damping(oscillator, noise) * math.pi / oscillator.omega)


def critical_restitution(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """The r with this R, by either law."""
    factor = critical_impact_factor(oscillator, noise)
    loss = -math.log(factor) if oscillator.impact == "delta" else 1 - factor
    return 1 - loss / oscillator.epsilon**2


def variance_rate(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """ε²Λ₂″(0) = ε²(S(2ω) + 2S(0))/8, from Eq. (37): the growth rate of the variance of ln ‖x‖."""
    s0, s2 = _spectral_densities(oscillator, noise)
    return oscillator.epsilon**2 / 8 * (s2 + 2 * s0)
