"""E‖x‖^p of even p without walls: the moments of order p obey a closed system of linear equations.

For ẋ = A(ξ) x with ξ a Markov chain, the monomials x^k y^(p−k) in each state make (p + 1)·states equations, whose
rightmost eigenvalue is Λ(p).
"""

import numpy as np


def rates_of_monomials(matrix, p):
    """K with d/dt (x^k y^(p−k))_k = K (x^k y^(p−k))_k for ẋ = A x."""
    (a, b), (c, d) = np.asarray(matrix, dtype=float)
    rates = np.zeros((p + 1, p + 1))
    for k in range(p + 1):
        rates[k, k] += k * a + (p - k) * d
        if k:
            rates[k, k - 1] += k * b
        if k < p:
            rates[k, k + 1] += (p - k) * c
    return rates


def moment_lyapunov(matrices, rates, p):
    """Λ(p) of ẋ = A_i x in the states i of a chain with these rates from state to state."""
    count = len(matrices)
    total = np.kron(np.asarray(rates, dtype=float).T, np.eye(p + 1))
    for i, matrix in enumerate(matrices):
        block = slice(i * (p + 1), (i + 1) * (p + 1))
        total[block, block] += rates_of_monomials(matrix, p)
    assert total.shape == 2 * (count * (p + 1),)
    return float(np.max(np.linalg.eigvals(total).real))
