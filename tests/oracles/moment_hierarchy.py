"""E‖x‖^p of even p without walls: the moments of order p obey a closed system of linear equations.

For ẋ = A(ξ) x with ξ a Markov chain, the monomials x^k y^(p−k) in each state make (p + 1)·states equations, whose
rightmost eigenvalue is Λ(p).
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.sparse import csc_matrix, identity, kron
from scipy.sparse.linalg import eigs


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


def white_noise_exponent(drift, noises, p, interpretation="stratonovich"):
    """Λ(p) of dx = A x dt + Σ A_k x∘dW_k, or with "ito" of A x dt + Σ A_k x dW_k.

    The monomials of degree p are moved by x → A x with the matrix K(A), so that E K obeys K(A) + ½ Σ K(A_k)²; that of
    Itô has the drift A − ½ Σ A_k² of Stratonovich.
    """
    drift, noises = np.asarray(drift, dtype=float), [np.asarray(matrix, dtype=float) for matrix in noises]
    if interpretation == "ito":
        drift = drift - 0.5 * sum(matrix @ matrix for matrix in noises)
    moved = [rates_of_monomials(matrix, p) for matrix in noises]
    total = rates_of_monomials(drift, p) + 0.5 * sum(each @ each for each in moved)
    return float(np.max(np.linalg.eigvals(total).real))


def impulses_exponent(drift, driven, rate, sizes, shares, p):
    """Λ(p) where x is multiplied by M = exp(w A₁) at a rate."""
    return float(np.max(np.linalg.eigvals(struck_rates(drift, driven, rate, sizes, shares, p)).real))


def struck_rates(drift, driven, rate, sizes, shares, p):
    """What moves the monomials of degree p then, with (ax + by)^k (cx + dy)^(p−k) written out."""
    total = rates_of_monomials(drift, p)
    for size, share in zip(sizes, shares, strict=True):
        (a, b), (c, d) = expm(size * np.asarray(driven, dtype=float))
        struck = [
            np.convolve(_powers([b, a], k), _powers([d, c], p - k))  # coefficients by the power of x
            for k in range(p + 1)
        ]
        total += rate * share * (np.array(struck) - np.eye(p + 1))
    return total


def _powers(line, n):
    """(line[0] y + line[1] x)ⁿ, by the power of x."""
    found = np.ones(1)
    for _ in range(n):
        found = np.convolve(found, line)
    return found


def ornstein_uhlenbeck_exponent(steady, driven, alpha, deviation, p, polynomials):
    """Λ(p) of ẋ = (A₀ + ξA₁) x, dξ = −αξ dt + …: monomials times so many normalised Hermite polynomials of ξ."""
    ladder = np.diag(np.sqrt(np.arange(1.0, polynomials)), 1)
    total = np.kron(rates_of_monomials(steady, p), np.eye(polynomials))
    total += deviation * np.kron(rates_of_monomials(driven, p), ladder + ladder.T)
    total -= np.kron(np.eye(p + 1), alpha * np.diag(np.arange(float(polynomials))))
    return float(np.max(np.linalg.eigvals(total).real))


def sine_wiener_exponent(steady, driven, amplitude, sigma, p, harmonics):
    """Λ(p) of ẋ = (A₀ + a sin θ A₁) x, dθ = σ dW: monomials times exp(ikθ), |k| ≤ harmonics."""
    k = np.arange(-harmonics, harmonics + 1)
    sine = (np.eye(k.size, k=-1) - np.eye(k.size, k=1)) / 2j
    total = np.kron(rates_of_monomials(steady, p), np.eye(k.size)).astype(complex)
    total += amplitude * np.kron(rates_of_monomials(driven, p), sine)
    total -= np.kron(np.eye(p + 1), 0.5 * sigma**2 * np.diag(k.astype(float) ** 2))
    return float(np.max(np.linalg.eigvals(total).real))


def bounded_exponent(steady, driven, mu, nu, sigma, p, harmonics, white=None):
    """Λ(p) of dx = (A₀ + μ cos θ A₁) x dt + Bx∘dW₂, dθ = ν dt + σ dW: monomials times exp(ikθ), |k| ≤ harmonics.

    Of eigenvalues that are multiples of iν apart, as for σ = 0, the largest real one is meant: cut off, others of them
    come to lie a little to its right.
    """
    k = np.arange(-harmonics, harmonics + 1)
    one, cosine = np.eye(k.size), 0.5 * (np.eye(k.size, k=1) + np.eye(k.size, k=-1))
    total = np.kron(rates_of_monomials(steady, p), one) + mu * np.kron(rates_of_monomials(driven, p), cosine)
    if white is not None:
        moved = rates_of_monomials(white, p)
        total += 0.5 * np.kron(moved @ moved, one)
    values = np.linalg.eigvals(total + np.kron(np.eye(p + 1), np.diag(1j * nu * k - 0.5 * sigma**2 * k**2)))
    return float(np.max(values[np.abs(values.imag) < 1e-6 * (nu + sigma**2)].real))


def harmonic_exponent(steady, driven, mu, nu, p, white=None):
    """The same for σ = 0, by the multipliers of the periodic linear equations of the monomials."""
    fixed, moving = rates_of_monomials(steady, p), mu * rates_of_monomials(driven, p)
    if white is not None:
        moved = rates_of_monomials(white, p)
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
    ladder = np.diag(np.sqrt(np.arange(1.0, polynomials)), 1)
    return matrix, -alpha * np.diag(np.arange(float(polynomials))), deviation * (ladder + ladder.T)


def several_exponent(steady, coloured, white, p, first):
    """Λ(p) of ẋ = (A₀ + Σ ξ_k A_k) x, with white noises as pairs (A, "stratonovich" or "ito") of A x dW.

    Args:
        steady, coloured, white: A₀; noises by `chain` and `gaussian`; white noises.
        p: even.
        first: about Λ(p), or somewhat larger; the eigenvalues around it are looked at.
    """
    total = csc_matrix(rates_of_monomials(steady, p))
    for matrix, sense in white:
        moved = rates_of_monomials(matrix, p)
        total = total + 0.5 * moved @ moved
        if sense == "ito":
            total = total - 0.5 * rates_of_monomials(np.asarray(matrix) @ np.asarray(matrix), p)
    driven = []
    for matrix, own, xi in coloured:
        size = own.shape[0]
        driven = [kron(each, identity(size)) for each in driven]
        driven.append(kron(kron(rates_of_monomials(matrix, p), identity(total.shape[0] // (p + 1))), xi))
        total = kron(total, identity(size)) + kron(identity(total.shape[0]), own)
    total = csc_matrix(sum(driven, total))
    if total.shape[0] <= 400:
        return float(np.max(np.linalg.eigvals(total.toarray()).real))
    return float(np.max(eigs(total, 8, sigma=first, v0=np.ones(total.shape[0]))[0].real))
