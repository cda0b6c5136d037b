"""Where slow noise carries the p-th moment: the growth rate of paths that hold the noise at one value."""

from __future__ import annotations

import math

import numpy as np

from fpsolve.eigen import PrincipalPair
from fpsolve.estimate import noise_marginal
from fpsolve.noise import AnyNoise, FloatArray
from fpsolve.oscillator import VibroImpactOscillator
from fpsolve.perturbation import reduced

SAMPLES = 1001
RIVAL = 0.6
"""Paths that hold the noise elsewhere are looked at if they grow at this share of Λ (less by the rest, for Λ < 0)."""


def rate_of_frozen_noise(oscillator: VibroImpactOscillator, noise: AnyNoise, p: float) -> tuple[FloatArray, FloatArray]:
    """z on the side to which p tilts, and the growth rate of ‖x‖^p on paths that hold the noise there.

    F = p G(ξ) − ⅛σ²((ln P_s)′)². G is the growth rate of ln ‖x‖ with ξ frozen: εξ/2 while the oscillator oscillates,
    |εξ| < 2ω, the rate of the faster of the two real modes beyond. For p < −1 the paths that stay on the other real
    mode carry more: (p + 1)·fast − slow. The second term is what holding ξ costs. Slow noise has its tilted density
    where F is largest, and more than one such place.
    """
    unit, eps = noise.standard_deviation, oscillator.epsilon
    furthest = 2.5 * abs(p) * 2 * unit * eps / reduced(noise).alpha
    z = math.copysign(min(max(furthest, 1e-3), 0.999 * noise.half_width / unit), p) * np.linspace(0, 1, SAMPLES)
    push = eps * unit * z + eps**2 * oscillator.c1
    root = np.sqrt(np.maximum(push**2 - 4 * oscillator.omega**2, 0))
    faster, slower = 0.5 * (push + root), 0.5 * (push - root)
    growth = p * faster
    if p < -1:
        growth = np.where(root > 0, np.maximum(growth, (p + 1) * slower - faster), growth)
    holding = 0.125 * (noise.diffusion / unit * np.gradient(noise.log_density(unit * z), z)) ** 2
    return z, growth - holding


def likely_center(oscillator: VibroImpactOscillator, noise: AnyNoise, p: float) -> float:
    """About the mean z of the tilted density."""
    z, rate = rate_of_frozen_noise(oscillator, noise, p)
    return float(z[np.argmax(rate)])


def growth_without_turning(oscillator: VibroImpactOscillator, noise: AnyNoise, p: float, center: float) -> float | None:
    """About Λ(p), where the noise stays so far out that the oscillator does not turn; else None."""
    z, rate = rate_of_frozen_noise(oscillator, noise, p)
    turns = abs(oscillator.epsilon * noise.standard_deviation * center) <= 2 * oscillator.omega
    return None if turns else float(rate[np.argmin(np.abs(z - center))])


def rival(oscillator: VibroImpactOscillator, noise: AnyNoise, pair: PrincipalPair) -> float | None:
    """Another z, far from the tilted density of a pair, where paths that hold the noise grow about as fast, or None.

    Between two such places slow noise hardly ever passes: each has its own pair with T > 0 as far as that can be
    told, and only the larger eigenvalue is Λ.
    """
    z, rate = rate_of_frozen_noise(oscillator, noise, pair.p)
    at, density = noise_marginal(pair)
    mean = float(at @ density / density.sum())
    spread = math.sqrt(float((at - mean) ** 2 @ density / density.sum()))
    peaks = np.flatnonzero((rate[1:-1] > rate[:-2]) & (rate[1:-1] >= rate[2:])) + 1
    enough = pair.value - (1 - RIVAL) * abs(pair.value)
    peaks = peaks[(np.abs(z[peaks] - mean) > 3 * spread + 2) & (rate[peaks] > enough)]
    return float(z[peaks[np.argmax(rate[peaks])]]) if peaks.size else None
