"""λ and N for noise with algebraic tails: finite differences on a grid even in φ and in asinh ξ.

At p = 0 T = 1, and T*, the stationary density of (φ, ξ), is the left null vector of

    v(φ, ξ) T_φ + D (P_s T_ξ)_ξ / P_s,

so that λ = ⟨T*, q⟩ + N ln R and N = ⟨T*, v⟩ at φ = π/2, with v and q of Eqs. (17)-(18), D = D₀/τ₀² and P_s of Eq. (9).
Differences in φ are biased towards where the phase comes to next, of the third order; those in ξ are central,
conservative, of the second. Nothing flows through the ends of ξ. The unknowns are T √(P_s dξ).
"""

import math

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

SHIFT = 1e-10
"""Of the matrix, as its null vectors are sought by inverse iteration."""


def exponents(oscillator, noise, *, phases, steps, lower, upper):
    """λ and N.

    Args:
        oscillator, noise: the problem; its noise is that of Eq. (7) with r₀ > 1.
        phases: number of points in φ on half a circle.
        steps: number of points in ξ.
        lower, upper: the ends of ξ.
    """
    h = math.pi / phases
    phi = math.pi / 2 + h * (0.5 + np.arange(phases))
    xi, mass, couplings, losses = _noise(noise, steps, lower, upper)
    force = oscillator.epsilon * xi + oscillator.epsilon**2 * oscillator.c1
    speed = oscillator.omega + np.outer(force, 0.5 * np.sin(2 * phi))
    growth = np.outer(force, np.sin(phi) ** 2)
    matrix = sp.kron(sp.diags([couplings, losses, couplings], [-1, 0, 1]), sp.identity(phases))
    passages = 0.0
    for step, weight in ((-1, -2.0), (0, -3.0), (1, 6.0), (2, -1.0)):
        for sign in (1, -1):
            at = np.arange(phases) + sign * step
            flow = sp.diags(np.maximum(sign * speed, 0).ravel() * weight / (6 * h))
            shift, turns = (
                sp.kron(sp.identity(steps), sp.csr_array((values, (np.arange(phases), at % phases)), (phases, phases)))
                for values in (np.ones(phases), at // phases)
            )
            matrix, passages = matrix + flow @ shift, passages + flow @ turns
    constant = np.repeat(np.sqrt(mass), phases)
    lu, density = splu((matrix.T - SHIFT * sp.identity(matrix.shape[0])).tocsc()), constant
    for _ in range(4):
        density = lu.solve(density)
        density = density / (density @ constant)
    rate = float(density @ (passages @ constant))
    return float(density @ (growth.ravel() * constant)) + rate * oscillator.log_impact_factor, rate


def _noise(noise, steps, lower, upper):
    """ξ, P_s dξ, and the symmetric form of D (P_s T_ξ)_ξ / P_s: what couples neighbours, and the diagonal."""
    unit, diffusion = noise.standard_deviation, 0.5 * noise.diffusion**2
    s = np.linspace(math.asinh(lower / unit), math.asinh(upper / unit), 2 * steps + 1)
    xi, slope = unit * np.sinh(s), unit * np.cosh(s)
    logs, step = noise.log_density(xi), s[2] - s[0]
    mass = (logs + np.log(slope))[1::2]
    flux = (logs - np.log(slope))[2:-1:2] + math.log(diffusion / step**2)
    losses = np.zeros(steps)
    losses[:-1] -= np.exp(flux - mass[:-1])
    losses[1:] -= np.exp(flux - mass[1:])
    return xi[1::2], step * np.exp(mass), np.exp(flux - 0.5 * (mass[:-1] + mass[1:])), losses
