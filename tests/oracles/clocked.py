"""Λ(p) of ẍ + 2ζẋ + (1 + μ cos θ + ξ) x = 0 with a wall at x = 0, θ = νt, dξ = −αξ dt + σ dW, by waves and polynomials.

With x = a cos φ and ẋ = −a sin φ the phase has φ̇ = 1 + g cos²φ − 2ζ sin φ cos φ, g = μ cos θ + ξ, and ln a grows as
g sin φ cos φ − 2ζ sin²φ, and by ln R at the wall. The gauge a = e^γ b, γ′ = ln R/π, spreads the wall over all φ.
"""

import math

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigs


def moment_lyapunov(p, zeta, mu, nu, alpha, sigma, restitution, first, waves=16, polynomials=12, harmonics=5):
    """Λ(p), next to `first`: waves e^{2ikφ}, |k| ≤ waves, Hermite polynomials of ξ, and e^{ilθ}, |l| ≤ harmonics."""
    k, n, steps = np.arange(-waves, waves + 1), np.arange(polynomials), np.arange(-harmonics, harmonics + 1)
    up = sparse.csr_array(sparse.eye_array(k.size, k=-1, dtype=complex))  # times e^{2iφ}
    down, one = up.T, sparse.csr_array(sparse.eye_array(k.size, dtype=complex))
    cosine, sine, slope = 0.5 * (up + down), -0.5j * (up - down), sparse.csr_array(sparse.diags_array(2j * k))
    ladder = sparse.diags_array(np.sqrt(n[1:]), offsets=1, shape=(n.size, n.size))
    xi = sigma / math.sqrt(2 * alpha) * (ladder + ladder.T)
    clock = 0.5 * mu * (sparse.eye_array(steps.size, k=1) + sparse.eye_array(steps.size, k=-1))
    c = math.log(restitution) / math.pi
    square, product = 0.5 * (one + cosine), 0.5 * sine  # cos²φ, sin φ cos φ
    steady_speed, driven_speed = one - 2 * zeta * product, square
    steady_rate, driven_rate = -2 * zeta * (one - square), product
    steady = steady_speed @ slope + p * (steady_rate + c * steady_speed)
    driven = driven_speed @ slope + p * (driven_rate + c * driven_speed)
    of_xi, of_clock = sparse.eye_array(n.size), sparse.eye_array(steps.size)
    total = sparse.kron(sparse.kron(steady, of_xi), of_clock)
    total += sparse.kron(sparse.kron(driven, xi), of_clock) + sparse.kron(sparse.kron(driven, of_xi), clock)
    total += sparse.kron(sparse.kron(one, sparse.diags_array(-alpha * n)), of_clock)
    total += sparse.kron(sparse.kron(one, of_xi), sparse.diags_array(1j * nu * steps))
    found = eigs(sparse.csc_array(total), 3, sigma=first, v0=np.ones(total.shape[0]), return_eigenvectors=False)
    real = found[np.abs(found.imag) < 1e-8]
    return float(np.max(real.real))
