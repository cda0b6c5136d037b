"""Λ(p) and λ of linear systems in the plane by Fourier series in φ: white, OU and bounded noise, chains, impulses.

With x = a (cos φ, −sin φ) a matrix A moves functions a^p T(φ) by X = h ∂φ + p q, h = e′ᵀA e, q = eᵀA e. Then Λ(p) is
the rightmost eigenvalue of X₀ + ½ Σ X_k² for dx = A₀x dt + Σ A_k x∘dW_k, of X_i in state i plus the rates of a chain,
and of X₀ + ξX₁ + L_ξ. A wall at x = 0, that is φ = π/2, multiplies ‖x‖ by R: T = R^{ps} u, s rising from 0 to 1 around
the half circle, which turns ∂φ into ∂φ + p ln R/π; u is smooth where the noise does not move the phase at the wall.
"""

import math

import numpy as np
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import splu

MOST_DENSE = 700


def white(drift, noises=(), interpretation="stratonovich"):
    """A function of p, modes and ln R that makes L(p), dL/dp and the constant function."""
    noises = [np.asarray(matrix, dtype=float) for matrix in noises]
    drift = np.asarray(drift, dtype=float)
    if interpretation == "ito":
        drift = drift - 0.5 * sum(matrix @ matrix for matrix in noises)

    def made(p, modes, log_factor):
        total, slope = _moved(drift, p, modes, log_factor)
        for matrix in noises:
            x, dx = _moved(matrix, p, modes, log_factor)
            total, slope = total + 0.5 * x @ x, slope + 0.5 * (x @ dx + dx @ x)
        return total, slope, _constant(modes)

    return made


def chain(matrices, rates):
    """The same for a chain: A_i in state i, left for j at rates[i][j]."""
    rates = np.asarray(rates, dtype=float)

    def made(p, modes, log_factor):
        blocks = [_moved(matrix, p, modes, log_factor) for matrix in matrices]
        jumps = sparse.kron(rates, sparse.eye_array(2 * modes + 1))
        total, slope = (sparse.block_diag(parts) for parts in zip(*blocks, strict=True))
        return total + jumps, slope, np.tile(_constant(modes), len(matrices))

    return made


def ornstein_uhlenbeck(steady, driven, alpha, deviation, polynomials):
    """The same for ẋ = (A₀ + ξA₁)x, dξ = −αξ dt + √(2α) deviation dW, in normalised Hermite polynomials of ξ."""
    root = deviation * np.sqrt(np.arange(1.0, polynomials))
    xi, one = sparse.diags_array([root, root], offsets=[1, -1]), sparse.eye_array(polynomials)
    resting = sparse.diags_array(-alpha * np.arange(float(polynomials)))

    def made(p, modes, log_factor):
        (x0, dx0), (x1, dx1) = (_moved(matrix, p, modes, log_factor) for matrix in (steady, driven))
        total = sparse.kron(one, x0) + sparse.kron(xi, x1) + sparse.kron(resting, sparse.eye_array(2 * modes + 1))
        constant = np.kron(np.eye(1, polynomials)[0], _constant(modes))
        return total, sparse.kron(one, dx0) + sparse.kron(xi, dx1), constant

    return made


def impulses(drift, driven, rate, sizes, shares):
    """The same where x is multiplied by M = exp(w A₁) at random times: rate (|Me|^p u(ψ) − u) at even points of φ.

    A wall at φ = π/2 stays where it is, so that s(ψ) − s(φ) is smooth.
    """

    def made(p, modes, log_factor):
        total, slope = _moved(drift, p, modes, log_factor)
        waves = 2 * np.arange(-modes, modes + 1)
        phi = math.pi / 2 + math.pi * (np.arange(waves.size) + 0.5) / waves.size
        back = np.exp(-1j * np.outer(waves, phi)) / waves.size
        for size, share in zip(sizes, shares, strict=True):
            x, y = expm(size * np.asarray(driven, dtype=float)) @ [np.cos(phi), -np.sin(phi)]
            psi = np.arctan2(-y, x)
            rise = (np.mod(psi - math.pi / 2, math.pi) - (phi - math.pi / 2)) / math.pi
            logs = np.log(np.hypot(x, y)) + (log_factor * rise if log_factor else 0.0)
            struck = back @ (np.exp(p * logs)[:, None] * np.exp(1j * np.outer(psi, waves)))
            longer = back @ ((logs * np.exp(p * logs))[:, None] * np.exp(1j * np.outer(psi, waves)))
            total = total + rate * share * (sparse.csr_array(struck) - sparse.eye_array(waves.size))
            slope = slope + rate * share * sparse.csr_array(longer)
        return total.tocsr(), slope.tocsr(), _constant(modes)

    return made


def bounded(steady, driven, mu, nu, sigma, harmonics, white=None):
    """The same for dx = (A₀ + μ cos θ A₁)x dt + Bx∘dW₂, dθ = ν dt + σ dW, in exp(ikθ), |k| ≤ harmonics."""
    k = np.arange(-harmonics, harmonics + 1.0)
    half = np.full(k.size - 1, 0.5 * mu)
    cosine, one = sparse.diags_array([half, half], offsets=[1, -1]), sparse.eye_array(k.size)
    turning = sparse.diags_array(1j * nu * k - 0.5 * sigma**2 * k**2)

    def made(p, modes, log_factor):
        (x0, dx0), (x1, dx1) = (_moved(matrix, p, modes, log_factor) for matrix in (steady, driven))
        total = sparse.kron(one, x0) + sparse.kron(cosine, x1) + sparse.kron(turning, sparse.eye_array(2 * modes + 1))
        slope = sparse.kron(one, dx0) + sparse.kron(cosine, dx1)
        if white is not None:
            x, dx = _moved(np.asarray(white, dtype=float), p, modes, log_factor)
            total, slope = total + 0.5 * sparse.kron(one, x @ x), slope + 0.5 * sparse.kron(one, x @ dx + dx @ x)
        return total, slope, np.kron(np.eye(1, k.size, harmonics)[0], _constant(modes))

    return made


def moment_exponent(made, p, modes, restitution=1.0, start=None):
    """Λ(p): the rightmost eigenvalue, of large matrices the one that inverse iteration finds from a value near it."""
    total, _, vector = made(p, modes, math.log(restitution))
    if total.shape[0] <= MOST_DENSE:
        return float(np.max(np.linalg.eigvals(total.toarray()).real))
    value, unit = start, sparse.eye_array(total.shape[0])
    for _ in range(30):
        new = splu((total - value * unit).tocsc()).solve(vector)
        step = (vector.conj() @ vector / (vector.conj() @ new)).real
        value, vector = value + step, new / np.linalg.norm(new)
        if abs(step) < 1e-14 * (1 + abs(value)):
            break
    return float(value)


def lyapunov_exponent(made, modes, restitution=1.0):
    """λ = Λ′(0) = ⟨u*, (dL/dp) 1⟩ with u*L = 0 and ⟨u*, 1⟩ = 1, one of whose equations follows from the others."""
    total, slope, one = made(0.0, modes, math.log(restitution))
    rows, at = total.T.tolil(), int(np.argmax(np.abs(one)))
    rows[at] = one[None, :]
    right = np.zeros(one.size, dtype=complex)
    right[at] = 1.0
    return float((splu(rows.tocsc()).solve(right) @ (slope @ one)).real)


def _constant(modes):
    return np.eye(1, 2 * modes + 1, modes, dtype=complex)[0]


def _moved(matrix, p, modes, log_factor):
    """X of A and its derivative by p, on exp(2inφ), |n| ≤ modes."""
    (a, b), (c, d) = np.asarray(matrix, dtype=float)
    up = sparse.csr_array(sparse.diags_array(np.ones(2 * modes, dtype=complex), offsets=-1))  # times exp(2iφ)
    one, cosine, sine = sparse.eye_array(2 * modes + 1, format="csr"), (up + up.T) / 2, (up - up.T) / 2j
    # A e = (a cos φ − b sin φ, c cos φ − d sin φ), e′ = (−sin φ, −cos φ)
    h = 0.5 * ((b - c) * one - (b + c) * cosine + (d - a) * sine)
    q = 0.5 * ((a + d) * one + (a - d) * cosine - (b + c) * sine)
    derivative = sparse.diags_array(2j * np.arange(-modes, modes + 1))
    growth = h * (log_factor / math.pi) + q
    return (h @ derivative + p * growth).tocsr(), growth.tocsr()
