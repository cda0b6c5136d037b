"""E‖x‖^p of even p for which `kronecker` does not do: any matrix in each state, harmonic loads, narrow bands."""

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
