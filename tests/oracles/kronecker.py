"""Λ(p) for even p and a state of any dimension, from the moments of order p: monomials of the state.

E x^a, |a| = p, obey a linear equation, as d/dt x^a = Σ aᵢ x^(a − eᵢ) Aᵢⱼ xⱼ; white noise by B adds half the square of
the matrix of B, impulses add rate (exp(matrix of C) − 1), and coloured noises have such moments for each function of
them. Their rightmost eigenvalue is Λ(p).
"""

from itertools import combinations_with_replacement

import numpy as np
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import eigs

from tests.oracles import planar

MOST_DENSE = 700


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


def gaussian(alpha, deviation, count):
    """Rates and ξ of Ornstein-Uhlenbeck noise by normalised Hermite polynomials."""
    ladder = np.diag(np.sqrt(np.arange(1.0, count)), 1)
    return -alpha * np.diag(np.arange(float(count))), deviation * (ladder + ladder.T)


def jumping(states, rates):
    """Those of a chain by its states; rates[i][j] from i to j, 0 on the diagonal."""
    return np.transpose(rates) - np.diag(np.sum(rates, axis=1)), np.diag(states)


def turning(amplitude, nu, sigma, count, is_sine):
    """Those of a cos θ or a sin θ, dθ = ν dt + σ dW, by exp(ikθ), |k| ≤ count."""
    k = np.arange(-count, count + 1)
    up, down = np.eye(k.size, k=1), np.eye(k.size, k=-1)  # E exp(i(k ± 1)θ)
    xi = (up - down) / 2j if is_sine else 0.5 * (up + down)
    return np.diag(1j * nu * k - 0.5 * sigma**2 * k**2), amplitude * xi


def filtering(law, count):
    """Those of a filter (ω, ζ, s, c₀, c₁), by Hermite polynomials of both of its states below a degree."""
    own, xi = planar.filtered(*law).made(count)
    return own.T.toarray(), xi.T.toarray()  # of E[m h], the transpose of what moves h


def several(steady, coloured, white=(), impulses=(), p=2, near=None):
    """Λ(p) of ẋ = (A₀ + Σ ξ A) x with A x dW and x⁺ = exp(C) x⁻.

    Args:
        steady: A₀.
        coloured: A, and the rates and ξ of a noise.
        white: A, and "stratonovich" or "ito".
        impulses: rates and C.
        p: even.
        near: about Λ(p), or none; of more than `MOST_DENSE` equations the eigenvalues next to 0.01 more are looked at.
    """
    total = equations(steady, coloured, white, impulses, p)
    if near is None or total.shape[0] <= MOST_DENSE:
        return largest(total.toarray())
    return float(np.max(eigs(total, 6, sigma=near + 0.01, v0=np.ones(total.shape[0]))[0].real))


def equations(steady, coloured, white=(), impulses=(), p=2):
    """Their sparse matrix, monomials fastest."""
    total = power(steady, p).astype(complex)
    for matrix, sense in white:
        moved = power(matrix, p)
        total += 0.5 * moved @ moved
        if sense == "ito":
            total -= 0.5 * power(np.asarray(matrix) @ np.asarray(matrix), p)
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
    return total if np.any(total.data.imag) else total.real


def largest(matrix):
    """The largest real part of an eigenvalue."""
    return float(np.max(np.linalg.eigvals(matrix).real))
