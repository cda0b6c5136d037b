"""Λ(p) of ẍ + 2ζẋ + (1 + μ cos νt + ξ) x = 0 with a wall at x = 0, dξ = −αξ dt + σ dW, by waves and polynomials."""

import math

import numpy as np

from tests.oracles import planar


def moment_lyapunov(p, zeta, mu, nu, alpha, sigma, restitution, first, waves=16, size=12):
    """Λ(p), next to `first`: so many waves in φ, Hermite polynomials of ξ, and waves in νt."""
    load = np.array([[0.0, 0.0], [-1.0, 0.0]])
    coloured = (
        (load, planar.circle(mu, nu, 0.0)),
        (load, planar.ornstein_uhlenbeck(alpha, sigma / math.sqrt(2 * alpha))),
    )
    drift = np.array([[0.0, 1.0], [-1.0, -2 * zeta]])
    matrix, *_ = planar.Planar(drift, coloured, log_factor=math.log(restitution)).generator(p, waves, size)
    found = planar.nearest(matrix, first)
    return float(np.max(found[np.abs(found.imag) < 1e-8].real))
