"""E‖x‖^p of even p without walls, by kinds of noise: the moments of order p obey a closed system of linear equations.

All but `moment_lyapunov` and `harmonic_exponent` are those of `kronecker`; Λ(p) is their rightmost eigenvalue.
"""

import numpy as np
from scipy.integrate import solve_ivp

from tests.oracles import kronecker


def moment_lyapunov(matrices, rates, p):
    """Λ(p) of ẋ = A_i x in the states i of a chain with these rates from state to state."""
    moved = [kronecker.power(matrix, p) for matrix in matrices]
    total = np.kron(np.asarray(rates, dtype=float).T, np.eye(len(moved[0])))
    for i, each in enumerate(moved):
        block = slice(i * len(each), (i + 1) * len(each))
        total[block, block] += each
    return kronecker.largest(total)


def white_noise_exponent(drift, noises, p, interpretation="stratonovich"):
    """Λ(p) of dx = A x dt + Σ A_k x∘dW_k, or with "ito" of A x dt + Σ A_k x dW_k."""
    return kronecker.several(drift, [], [(matrix, interpretation) for matrix in noises], p=p)


def impulses_exponent(drift, driven, rate, sizes, shares, p):
    """Λ(p) where x is multiplied by M = exp(w A₁) at a rate."""
    return kronecker.several(drift, [], [], _jolts(driven, rate, sizes, shares), p)


def _jolts(driven, rate, sizes, shares):
    return [(rate * share, size * np.asarray(driven)) for size, share in zip(sizes, shares, strict=True)]


def ornstein_uhlenbeck_exponent(steady, driven, alpha, deviation, p, polynomials):
    """Λ(p) of ẋ = (A₀ + ξA₁) x, dξ = −αξ dt + …: monomials times so many normalised Hermite polynomials of ξ."""
    return kronecker.ornstein_uhlenbeck(steady, driven, alpha, deviation, p, polynomials)


def sine_wiener_exponent(steady, driven, amplitude, sigma, p, harmonics):
    """Λ(p) of ẋ = (A₀ + a sin θ A₁) x, dθ = σ dW: monomials times exp(ikθ), |k| ≤ harmonics."""
    return kronecker.several(steady, [(driven, *kronecker.turning(amplitude, 0.0, sigma, harmonics, True))], p=p)


def bounded_exponent(steady, driven, mu, nu, sigma, p, harmonics, white=None):
    """Λ(p) of dx = (A₀ + μ cos θ A₁) x dt + Bx∘dW₂, dθ = ν dt + σ dW: monomials times exp(ikθ), |k| ≤ harmonics.

    Of eigenvalues that are multiples of iν apart, as for σ = 0, the largest real one is meant: cut off, others of them
    come to lie a little to its right.
    """
    noise = driven, *kronecker.turning(mu, nu, sigma, harmonics, False)
    total = kronecker.equations(steady, [noise], [] if white is None else [(white, "stratonovich")], (), p)
    values = np.linalg.eigvals(total.toarray())
    return float(np.max(values[np.abs(values.imag) < 1e-6 * (nu + sigma**2)].real))


def harmonic_exponent(steady, driven, mu, nu, p, white=None):
    """The same for σ = 0, by the multipliers of the periodic linear equations of the monomials."""
    fixed, moving = kronecker.power(steady, p), mu * kronecker.power(driven, p)
    if white is not None:
        moved = kronecker.power(white, p)
        fixed = fixed + 0.5 * moved @ moved
    size, period = p + 1, 2 * np.pi / nu
    found = solve_ivp(
        lambda t, y: ((fixed + np.cos(nu * t) * moving) @ y.reshape(size, size)).ravel(),
        (0.0, period),
        np.eye(size).ravel(),
        method="DOP853",
        rtol=1e-13,
        atol=1e-15,
    )
    multipliers = np.linalg.eigvals(found.y[:, -1].reshape(size, size))
    return float(np.log(np.max(np.abs(multipliers))) / period)


def chain(matrix, states, rates):
    """A Markov chain that drives A: its matrix, its own generator on moments, and ξ."""
    return matrix, np.asarray(rates, dtype=float).T, np.diag(np.asarray(states, dtype=float))


def gaussian(matrix, alpha, deviation, polynomials):
    """Ornstein-Uhlenbeck noise that drives A, by so many normalised Hermite polynomials."""
    return matrix, *kronecker.gaussian(alpha, deviation, polynomials)
