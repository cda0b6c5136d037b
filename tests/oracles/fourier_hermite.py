"""Reference values of Λ(p): Fourier series in the phase, orthogonal polynomials in the noise.

The eigenproblem is L(p) T = Λ T, Eq. (19), with the impact as a jump: T(φ⁻) = Rᵖ T(φ⁺) at φ = π/2 and 3π/2.
Write T = R^(p s) T̃, where the sawtooth s(φ) rises linearly from 0 to 1 between two impacts.  Then T̃ is
continuous, the jump turns into the substitution ∂φ → ∂φ + p ln(R)/π, and all coefficients are smooth:

    L̃(p) = L_ξ + ω D + ε ξ (h₁ D + p q₁) + ε² (h₂ D + p q₂),        D = ∂φ + p ln(R)/π,
    h₁ = ½ sin 2φ,   q₁ = ½ (1 − cos 2φ),   h₂ = c₁ h₁,   q₂ = c₁ q₁.

In the phase the basis is 1, √2 cos kφ, √2 sin kφ; in the noise it is the polynomials orthonormal with respect
to its stationary density P_s, and L_ξ u = (½σ²/P_s) ∂ξ(P_s ∂ξ u) has the matrix −½σ² ∫ P_s u' v' dξ.
Both bases are orthonormal, so Λ(p) is the rightmost eigenvalue of one real matrix.
"""

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

_DENSE_SIZE = 400  # below it, all eigenvalues at once cost little


def moment_lyapunov(
    *,
    alpha: float,
    sigma: float,
    harmonics: int,
    hermite: int,
    **oscillator: float,
) -> float:
    """Λ(p) for the Ornstein-Uhlenbeck noise dξ = −α ξ dt + σ dW, Eq. (15).

    `oscillator` is omega, epsilon, c1, log_R, p; ln R is the jump of the log-amplitude at each impact.  The basis
    holds the waves 2nφ, n ≤ `harmonics`, times `hermite` functions He_m(z)/√m!, z = ξ/std, std² = σ²/2α.
    """
    noise = _gaussian_noise(alpha, sigma, hermite)
    return _principal(noise, harmonics, **oscillator)


def moment_lyapunov_bounded_noise(
    *,
    D0: float,
    tau0: float,
    r0: float,
    harmonics: int,
    gegenbauer: int,
    **oscillator: float,
) -> float:
    """Λ(p) for the non-Gaussian noise of Eqs. (7)-(9) itself, r0 < 1.

    It is bounded, |ξ| < ξ_s = √(2 D0/(τ0 (1 − r0))).  The drift is −V'/τ0, the diffusion coefficient
    σ = √(2 D0)/τ0, and P_s ∝ (1 − ξ²/ξ_s²)^(1/(1−r0)), so the basis holds `gegenbauer` polynomials in ξ/ξ_s.
    """
    if not r0 < 1:
        raise ValueError(f"r0 = {r0}: the support is bounded for r0 < 1 only")
    noise = bounded_noise(D0, tau0, r0, gegenbauer)
    return _principal(noise, harmonics, **oscillator)


def spectrum(
    *,
    alpha: float,
    sigma: float,
    harmonics: int,
    hermite: int,
    **oscillator: float,
) -> np.ndarray:
    """All eigenvalues on the full circle, rightmost first; shape ((2 `harmonics` + 1) · `hermite`,), complex.

    As `moment_lyapunov`, but with the waves kφ, even and odd, |k| ≤ `harmonics`.  The even and the odd ones
    decouple, as the coefficients are π-periodic.  The outer eigenvalues are not converged.
    """
    noise = _gaussian_noise(alpha, sigma, hermite)
    k = np.arange(-harmonics, harmonics + 1)
    parts = [_generator(noise, k[k % 2 == parity], **oscillator) for parity in (0, 1)]
    values = np.concatenate([la.eigvals(part.toarray()) for part in parts])
    return values[np.lexsort((values.imag, -values.real))]


def _gaussian_noise(alpha: float, sigma: float, size: int) -> tuple[sp.csr_array, sp.csr_array]:
    """L_ξ and multiplication by ξ in P_m = He_m(ξ/std)/√m!, m < `size`.

    L_ξ P_m = −α m P_m and ξ P_m = std (√(m+1) P_(m+1) + √m P_(m−1)).
    """
    m = np.arange(size, dtype=float)
    beta = sigma / np.sqrt(2 * alpha) * np.sqrt(m[1:])
    return sp.diags_array(-alpha * m).tocsr(), sp.diags_array([beta, beta], offsets=[-1, 1]).tocsr()


def bounded_noise(D0: float, tau0: float, r0: float, size: int) -> tuple[sp.csr_array, sp.csr_array]:
    """The same in the polynomials P_m orthonormal under (1 − ξ²/ξ_s²)^a, a = 1/(1 − r0).

    They are Gegenbauer's, of index a + ½, with the recurrence ξ P_m = β_(m+1) P_(m+1) + β_m P_(m−1).
    Column m of G expands P_m' in them, by the recurrence β_(m+1) P'_(m+1) = P_m + ξ P'_m − β_m P'_(m−1).
    Then L_ξ = −½σ² GᵀG, with ½σ² = D0/τ0².
    """
    m, a = np.arange(1, size), 1 / (1 - r0)
    xi_s = np.sqrt(2 * D0 * a / tau0)
    beta = xi_s * np.sqrt(m * (m + 2 * a) / ((2 * m + 2 * a + 1) * (2 * m + 2 * a - 1)))
    xi = np.diag(beta, 1) + np.diag(beta, -1)
    G = np.zeros((size, size))
    for m in range(size - 1):
        column = xi @ G[:, m]
        column[m] += 1
        if m > 0:
            column -= beta[m - 1] * G[:, m - 1]
        G[: m + 1, m + 1] = column[: m + 1] / beta[m]
    return sp.csr_array(-D0 / tau0**2 * G.T @ G), sp.csr_array(xi)


def _phase_matrices(k: np.ndarray) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """∂φ and multiplication by cos 2φ and sin 2φ, in a real basis.

    For k < 0, k = 0 and k > 0 it holds √2 sin |k|φ, 1 and √2 cos kφ.
    """
    size = len(k)
    up = sp.csr_array(k[:, None] == k[None, :] + 2, dtype=float)  # multiplication by e^(2iφ)
    derivative, cos2, sin2 = 1j * sp.diags_array(k.astype(float)), (up + up.T) / 2, (up - up.T) / 2j

    root = np.sqrt(0.5)
    j = np.arange(size)  # column j of the real basis: its function j in the e^(ikφ)
    own = np.select([k > 0, k < 0], [root, 1j * root], 1.0)
    mirrored = np.where(k == 0, 0.0, own.conj())
    real = sp.csr_array((np.append(own, mirrored), (np.append(j, size - 1 - j), np.append(j, j))), shape=(size, size))
    return tuple((real.conj().T @ matrix @ real).real.tocsr() for matrix in (derivative, cos2, sin2))


def _generator(
    noise: tuple[sp.csr_array, sp.csr_array],
    k: np.ndarray,
    omega: float,
    epsilon: float,
    c1: float,
    log_R: float,
    p: float,
) -> sp.csc_array:
    """The matrix of L̃(p), noise index slow and phase index fast."""
    L_xi, xi = noise
    derivative, cos2, sin2 = _phase_matrices(k)
    identity, one = sp.eye_array(len(k)), sp.eye_array(L_xi.shape[0])

    D = derivative + p * log_R / np.pi * identity
    L1 = sin2 @ D / 2 + p * (identity - cos2) / 2  # h₁ D + p q₁
    L2 = c1 * L1
    L0 = sp.kron(L_xi, identity) + omega * sp.kron(one, D)
    return (L0 + epsilon * sp.kron(xi, L1) + epsilon**2 * sp.kron(one, L2)).tocsc()


def _principal(
    noise: tuple[sp.csr_array, sp.csr_array],
    harmonics: int,
    omega: float,
    epsilon: float,
    c1: float,
    log_R: float,
    p: float,
) -> float:
    """The rightmost eigenvalue Λ of L̃(p), which must be real.

    The symmetric part of L̃ is p ω ln(R)/π + L_ξ + (ε ξ + ε² c₁) f(φ), f = p q₁ − ½ cos 2φ + p ln(R)/π h₁, and
    |f| ≤ F; its largest eigenvalue bounds Λ from above.  To a real shift there Λ is the nearest eigenvalue,
    as the disc about the shift that touches Λ lies to the right of Λ.  The shifted matrix has a definite
    symmetric part: elimination is stable without pivoting, which would fill the factors and cost digits.

    In the end Λ is read off the row of the constant function, Λ x₀ = Σ L̃_0j x_j: the noise and the derivative in φ
    have no part in that row, so no large numbers cancel.
    """
    matrix = _generator(noise, 2 * np.arange(-harmonics, harmonics + 1), omega, epsilon, c1, log_R, p)
    size = matrix.shape[0]
    L_xi, xi = (part.toarray() for part in noise)
    F = abs(p) / 2 + np.hypot((p + 1) / 2, p * log_R / (2 * np.pi))
    noisy = la.eigvalsh(L_xi + epsilon * F * xi)[-1]
    shift = p * omega * log_R / np.pi + noisy + epsilon**2 * abs(c1) * F + 0.01 * omega
    if size <= _DENSE_SIZE:
        values, vectors = la.eig(matrix.toarray())
        nearest = np.abs(values - shift).argmin()
        value, vector = values[nearest], vectors[:, nearest]
    else:
        shifted = (matrix - shift * sp.eye_array(size)).tocsc()
        no_pivoting = {"diag_pivot_thresh": 0, "options": {"SymmetricMode": True}}
        factors = spla.splu(shifted, permc_spec="MMD_AT_PLUS_A", **no_pivoting)
        inverse = spla.LinearOperator(matrix.shape, factors.solve, dtype=float)
        start = np.random.default_rng(0).standard_normal(size)
        values, vectors = spla.eigs(matrix, 1, sigma=shift, OPinv=inverse, v0=start)
        value, vector = values[0], vectors[:, 0]
    if abs(value.imag) > 1e-8 * (omega + abs(value)):
        raise ValueError(f"the rightmost eigenvalue {value} is not real: raise the number of basis functions")
    constant = harmonics  # of the noise the first, of the phases k = −2·harmonics … 2·harmonics the middle one
    x = (vector / vector[np.abs(vector).argmax()]).real
    if abs(x[constant]) < 0.1:  # a strong tilt leaves little of the constant function
        return float(value.real)
    return float((matrix[[constant]] @ x)[0] / x[constant])
