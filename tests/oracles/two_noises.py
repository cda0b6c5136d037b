"""E‖x‖^p of even p for ẋ = (A₀ + ξ₁A₁ + ξ₂A₂) x with two independent Ornstein-Uhlenbeck noises, without a phase.

The monomials x^k y^(p−k) times normalised Hermite polynomials of both noises obey a closed system but for its
truncation: dξ = −α ξ dt + … takes α i from the i-th, and ξ = std·(a + a⁺) couples it to its neighbours. Its rightmost
eigenvalue is Λ(p).
"""

import numpy as np

from tests.oracles.moment_hierarchy import rates_of_monomials


def moment_lyapunov(matrices, alphas, deviations, p, count):
    """Λ(p) from A₀, A₁, A₂, both α and standard deviations, and so many polynomials of each noise."""
    ladder = np.diag(np.sqrt(np.arange(1.0, count)), 1)
    xi, number, one = ladder + ladder.T, np.diag(np.arange(float(count))), np.eye(count)
    steady, first, second = (rates_of_monomials(matrix, p) for matrix in matrices)
    total = np.kron(np.kron(steady, one), one)
    total += deviations[0] * np.kron(np.kron(first, xi), one) + deviations[1] * np.kron(np.kron(second, one), xi)
    resting = alphas[0] * np.kron(number, one) + alphas[1] * np.kron(one, number)
    return float(np.max(np.linalg.eigvals(total - np.kron(np.eye(p + 1), resting)).real))
