"""Λ(p) and λ of linear systems in the plane by Fourier series in φ of a stated size, with a wall at x = 0.

Each kind of noise gives a function of p, modes and ln R that makes L(p), dL/dp and the constant function, see `planar`;
`chain` takes any matrix in each state.
"""

import math

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from tests.oracles import planar

MOST_DENSE = 700


def white(drift, noises=(), interpretation="stratonovich"):
    """dx = A x dt + Σ A_k x∘dW_k, or with "ito" of A x dt + Σ A_k x dW_k."""
    noises = [np.asarray(matrix, dtype=float) for matrix in noises]
    drift = np.asarray(drift, dtype=float)
    if interpretation == "ito":
        drift = drift - 0.5 * sum(matrix @ matrix for matrix in noises)
    return _made(1, drift, white=noises)


def chain(matrices, rates):
    """A_i in state i, left for j at rates[i][j]."""

    def made(p, modes, log_factor):
        blocks = [planar.phases(matrix, p, modes, log_factor) for matrix in matrices]
        jumps = sparse.kron(np.asarray(rates, dtype=float), sparse.eye_array(2 * modes + 1))
        total, slope = (sparse.block_diag(parts) for parts in zip(*blocks, strict=True))
        return total + jumps, slope, np.tile(np.eye(1, 2 * modes + 1)[0], len(matrices))

    return made


def ornstein_uhlenbeck(steady, driven, alpha, deviation, polynomials):
    """ẋ = (A₀ + ξA₁)x, dξ = −αξ dt + √(2α) deviation dW, in normalised Hermite polynomials of ξ."""
    return _made(polynomials, steady, ((driven, planar.ornstein_uhlenbeck(alpha, deviation)),))


def impulses(drift, driven, rate, sizes, shares):
    """x is multiplied by exp(w A₁) at random times."""
    return _made(1, drift, impulses=((driven, rate, sizes, shares),))


def bounded(steady, driven, mu, nu, sigma, harmonics, white=None):
    """dx = (A₀ + μ cos θ A₁)x dt + Bx∘dW₂, dθ = ν dt + σ dW, in cos kθ and sin kθ, k ≤ harmonics."""
    law = planar.Law(lambda size: planar.waves(mu, nu, sigma, size))
    return _made(harmonics, steady, ((driven, law),), () if white is None else (np.asarray(white, dtype=float),))


def _made(size, drift, coloured=(), white=(), impulses=()):
    def made(p, modes, log_factor):
        return planar.Planar(drift, coloured, white, impulses, log_factor).generator(p, modes, size)

    return made


def moment_exponent(made, p, modes, restitution=1.0, start=None):
    """Λ(p): the rightmost eigenvalue, of large matrices the one that inverse iteration finds from a value near it."""
    total, _, vector = made(p, modes, math.log(restitution))
    if total.shape[0] <= MOST_DENSE:
        return float(np.max(np.linalg.eigvals(total.toarray()).real))
    value, unit = start, sparse.eye_array(total.shape[0])
    for _ in range(30):
        new = splu((total - value * unit).tocsc()).solve(vector)
        step = vector @ vector / (vector @ new)
        value, vector = value + step, new / np.linalg.norm(new)
        if abs(step) < 1e-14 * (1 + abs(value)):
            break
    return float(value)


def lyapunov_exponent(made, modes, restitution=1.0):
    """λ of so many modes."""
    return planar.slope_at_zero(*made(0.0, modes, math.log(restitution)))
