"""Λ(p) for even p and a state of any dimension, from the moments of order p: monomials of the state.

E x^a, |a| = p, obey a linear equation, as d/dt x^a = Σ aᵢ x^(a − eᵢ) Aᵢⱼ xⱼ; white noise by B adds half the
square of the matrix of B, a chain and Ornstein-Uhlenbeck noise have such moments for each state or Hermite polynomial.
"""

from itertools import combinations_with_replacement

import numpy as np


def power(matrix, p):
    """d/dt of the monomials of degree p by those."""
    matrix = np.asarray(matrix, dtype=float)
    monomials = {factors: k for k, factors in enumerate(combinations_with_replacement(range(len(matrix)), p))}
    found = np.zeros((len(monomials), len(monomials)))
    for factors, row in monomials.items():
        for k, i in enumerate(factors):
            for j, rate in enumerate(matrix[i]):
                found[row, monomials[tuple(sorted([*factors[:k], j, *factors[k + 1 :]]))]] += rate
    return found


def white(steady, driven, p):
    """Stratonovich, S = 1."""
    return _largest(power(steady, p) + 0.5 * power(driven, p) @ power(driven, p))


def chain(steady, driven, states, rates, p):
    """A₀ + ξA₁ for a chain; rates[i][j] from i to j, whatever the diagonal is."""
    rates = np.array(rates, dtype=float)
    np.fill_diagonal(rates, 0.0)
    rates -= np.diag(rates.sum(axis=1))
    still, moved = power(steady, p), power(driven, p)
    return _largest(
        np.kron(rates.T, np.eye(len(still))) + np.kron(np.eye(len(states)), still) + np.kron(np.diag(states), moved)
    )


def ornstein_uhlenbeck(steady, driven, alpha, deviation, p, count):
    """A₀ + ξA₁, ξ = deviation He₁: ξ He_k = deviation (He_{k+1} + k He_{k−1})."""
    k = np.arange(count)
    ladder = np.diag(np.sqrt(k[1:]), 1) + np.diag(np.sqrt(k[1:]), -1)
    still, moved = power(steady, p), power(driven, p)
    return _largest(
        np.kron(np.diag(-alpha * k), np.eye(len(still)))
        + np.kron(np.eye(count), still)
        + deviation * np.kron(ladder, moved)
    )


def _largest(matrix):
    return float(np.max(np.linalg.eigvals(matrix).real))
