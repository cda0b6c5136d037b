"""What every method computes, and how its error is measured.

Λ(p) is the principal eigenvalue of Eq. (19). All peers gauge the impact away: T = R^(p s) T̃ with the sawtooth s(φ) that
rises from 0 to 1 between two impacts, so that T̃ is continuous, π-periodic in φ, and

    L̃(p) = α (∂zz − z ∂z) + v ∂φ + p g,      v = ω + (ε ξ + ε² c₁) h₁,      g = v ln(R)/π + (ε ξ + ε² c₁) q₁,
    h₁ = ½ sin 2φ,    q₁ = ½ (1 − cos 2φ),    ξ = std z,    std² = σ²/2α.

The tilt moves the tilted density, by 2b in z. The weight P_s follows it with T̃ = exp(b z) u, b = p β, β = ε std/2α, by
which the mean ½ p ε ξ of p ε q₁ ξ drops out. In y = z − 2b, ε ξ = m (y/2β + p), m = 2β ε std,

    L̃(p) u = α (∂yy − y ∂y) u + (v₀ + p v₁) ∂φu + (p r₁ + p² r₂) u,      v₀ = v(φ, ξ = std y),      v₁ = m h₁,
    r₁ = g(φ, ξ = std y) − α β y,    r₂ = m (h₁ ln(R)/π + q₁) − α β².

So L̃(p) = A₀ + p A₁ + p² A₂, and L̃(0) 1 = 0. The eigenvalues are the same with any β, 0 among them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, VibroImpactOscillator
from tests.oracles.perturbation import moment_scale

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """The parameters of L̃(p): noise dξ = −α ξ dt + σ dW, oscillator, and ln R of one impact."""

    alpha: float
    sigma: float
    omega: float
    epsilon: float
    c1: float
    log_R: float

    @property
    def std(self) -> float:
        """Standard deviation of ξ."""
        return self.sigma / math.sqrt(2 * self.alpha)

    @property
    def tilt(self) -> float:
        """β = ε std/2α."""
        return self.epsilon * self.std / (2 * self.alpha)

    def bound(self, p: float) -> float:
        """A number right of Λ(p), and of the numerical range of L̃(p) in the inner product weighted by P_s(y).

        The symmetric part of L̃ is p ω ln(R)/π + α (∂zz − z ∂z) + (ε ξ + ε² c₁) f(φ), |f| ≤ F, and the largest
        eigenvalue of α (∂zz − z ∂z) + c z is c²/α.
        """
        F = abs(p) / 2 + math.hypot((p + 1) / 2, p * self.log_R / (2 * math.pi))
        noisy = (self.epsilon * F * self.std) ** 2 / self.alpha
        return p * self.omega * self.log_R / math.pi + noisy + self.epsilon**2 * abs(self.c1) * F + 0.01 * self.omega


@dataclass(frozen=True)
class Case:
    """A curve Λ(p) with the accuracy that is demanded of it: |error| ≤ rtol · max(|Λ|, scale) at every p.

    The scale is `perturbation.moment_scale`, the terms of Eq. (37) before they cancel; at p = 0, where all
    vanish, it is that of the smallest other |p|.
    """

    name: str
    oscillator: VibroImpactOscillator
    noise: OrnsteinUhlenbeck
    p: FloatArray
    rtol: float

    @property
    def problem(self) -> Problem:
        """The numbers alone, as the peers take them."""
        oscillator, noise = self.oscillator, self.noise
        return Problem(
            alpha=noise.alpha,
            sigma=noise.sigma,
            omega=oscillator.omega,
            epsilon=oscillator.epsilon,
            c1=oscillator.c1,
            log_R=oscillator.log_impact_factor,
        )

    def relative_error(self, value: FloatArray, reference: FloatArray) -> float:
        """The largest |error|/max(|Λ|, scale)."""
        smallest = np.min(np.abs(self.p[self.p != 0]))
        scale = moment_scale(self.oscillator, self.noise, np.maximum(np.abs(self.p), smallest))
        return float(np.max(np.abs(value - reference) / np.maximum(np.abs(reference), scale)))


def _case(name: str, epsilon: float, interval: tuple[float, float], rtol: float) -> Case:
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=epsilon)
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
    return Case(name, oscillator, noise, np.linspace(*interval, 33), rtol)


CASES = {
    "weak": _case("weak", 0.1, (-2.0, 6.0), 1e-8),  # Fig. 1 of the paper
    "strong": _case("strong", 1.0, (-3.0, 3.0), 1e-6),  # the phase speed changes its sign
}
