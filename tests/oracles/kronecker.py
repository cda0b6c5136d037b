"""Λ(p) for even p and a state of any dimension, from the moments of order p: monomials of the state.

E x^a, |a| = p, obey a linear equation, as d/dt x^a = Σ aᵢ x^(a − eᵢ) Aᵢⱼ xⱼ; white noise by B adds half the
square of the matrix of B, a chain and Ornstein-Uhlenbeck noise have such moments for each state or Hermite polynomial.
"""

from itertools import combinations_with_replacement

import numpy as np
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import eigs

from tests.oracles.filtered import equations


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


def gaussian(alpha, deviation, count):
    """Rates and ξ of Ornstein-Uhlenbeck noise by normalised Hermite polynomials."""
    ladder = np.diag(np.sqrt(np.arange(1.0, count)), 1)
    return -alpha * np.diag(np.arange(float(count))), deviation * (ladder + ladder.T)


def jumping(states, rates):
    """Those of a chain by its states; rates[i][j] from i to j."""
    return np.transpose(rates) - np.diag(np.sum(rates, axis=1)), np.diag(states)


def turning(amplitude, nu, sigma, count, is_sine):
    """Those of a cos θ or a sin θ, dθ = ν dt + σ dW, by exp(ikθ), |k| ≤ count."""
    k = np.arange(-count, count + 1)
    up, down = np.eye(k.size, k=1), np.eye(k.size, k=-1)  # E exp(i(k ± 1)θ)
    xi = (up - down) / 2j if is_sine else 0.5 * (up + down)
    return np.diag(1j * nu * k - 0.5 * sigma**2 * k**2), amplitude * xi


def filtering(law, count):
    """Those of a filter (ω, ζ, s, c₀, c₁), by Hermite polynomials of both of its states."""
    none, one = np.zeros((1, 1)), np.ones((1, 1))
    own = equations(none, none, law, 2, count, lambda matrix, _: np.asarray(matrix)).toarray()
    return own, equations(none, one, law, 2, count, lambda matrix, _: np.asarray(matrix)).toarray() - own


def several(steady, coloured, white, impulses, p, near):
    """Λ(p) of ẋ = (A₀ + Σ ξ A) x with A x dW and x⁺ = exp(C) x⁻.

    Args:
        steady: A₀.
        coloured: A, and the rates and ξ of a noise.
        white: A, and "stratonovich" or "ito".
        impulses: rates and C.
        p: even.
        near: about Λ(p); of more than 1500 equations the eigenvalues next to 0.01 more are looked at.
    """
    total = power(steady, p).astype(complex)
    for matrix, sense in white:
        moved = power(matrix, p)
        total += 0.5 * moved @ moved - (0.5 * power(matrix @ matrix, p) if sense == "ito" else 0.0)
    for rate, matrix in impulses:
        total += rate * (expm(power(matrix, p)) - np.eye(len(total)))
    size = len(total)
    total, driven = sparse.csc_array(total), []
    for matrix, own, xi in coloured:
        driven = [sparse.kron(sparse.eye_array(len(own)), each) for each in driven]
        one = sparse.eye_array(total.shape[0] // size)
        driven.append(sparse.kron(xi, sparse.kron(one, power(matrix, p))))
        total = sparse.kron(sparse.eye_array(len(own)), total) + sparse.kron(own, sparse.eye_array(total.shape[0]))
    total = sparse.csc_array(sum(driven, total))
    if total.shape[0] <= 1500:
        return _largest(total.toarray())
    return float(np.max(eigs(total, 4, sigma=near + 0.01, v0=np.ones(total.shape[0]))[0].real))


def _largest(matrix):
    return float(np.max(np.linalg.eigvals(matrix).real))
