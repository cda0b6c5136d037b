"""Fourier-Hermite Galerkin: waves in the phase, Hermite polynomials in the noise.

With u(φ, y) and the coefficients of `problem`,

    L̃(p) u = α (∂yy − y ∂y) u + (v₀ + p v₁) ∂φu + (p r₁ + p² r₂) u.

The basis is 1, √2 cos 2nφ, √2 sin 2nφ, n ≤ `harmonics`, times `hermite` functions He_m(y)/√m!. It is orthonormal under
P_s(y) = exp(−y²/2), so M = 1. u is periodic in φ by the basis, and square integrable with P_s on the whole line.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sp

from tests.benchmarks.pencil import Pencil
from tests.benchmarks.problem import FloatArray, Problem

TUNED = {"weak": (4, 5), "strong": (38, 22)}
"""Sizes of each case, found with the answer known: the smallest that are as accurate as it demands."""


class FourierHermite:
    """Args: problem; size (harmonics, hermite)."""

    def __init__(self, problem: Problem, size: tuple[int, int]) -> None:
        harmonics, hermite = size
        m = np.arange(hermite, dtype=float)
        y = sp.diags_array([np.sqrt(m[1:]), np.sqrt(m[1:])], offsets=[-1, 1])
        one = sp.eye_array(hermite)
        D, cos2, sin2 = _waves(harmonics)
        identity = sp.eye_array(2 * harmonics + 1)

        # The terms of v ∂φ + p g in front of ε ξ + ε² c₁, and the others, each for p⁰ and p¹.
        gauge = problem.log_R / math.pi
        strong = (sin2 @ D / 2, gauge * sin2 / 2 + (identity - cos2) / 2)
        plain = (problem.omega * D, problem.omega * gauge * identity)
        eps, std, alpha = problem.epsilon, problem.std, problem.alpha
        b = problem.tilt
        strength, moved = eps * std * y + eps**2 * problem.c1 * one, 2 * eps * std * b
        A0 = sp.kron(sp.diags_array(-alpha * m), identity) + sp.kron(one, plain[0]) + sp.kron(strength, strong[0])
        A1 = (
            sp.kron(one, plain[1] + moved * strong[0]) + sp.kron(strength, strong[1]) - alpha * b * sp.kron(y, identity)
        )
        A2 = sp.kron(one, moved * strong[1] - alpha * b**2 * identity)
        constant = np.zeros(A0.shape[0])
        constant[0] = 1
        self.pencil = Pencil((A0, A1, A2), sp.eye_array(A0.shape[0]), constant, problem.bound, 1e-13)

    def moment(self, p: float) -> float:
        """Λ(p), for one p by itself."""
        return self.pencil.moment(p)

    def moments(self, p: FloatArray) -> FloatArray:
        """Λ at every p of a curve, each from those before: faster."""
        return self.pencil.moments(p)


def _waves(harmonics: int) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """∂φ and multiplication by cos 2φ and sin 2φ, in 1, √2 cos 2φ, √2 sin 2φ, √2 cos 4φ, ..."""
    size = 2 * harmonics + 1
    n = np.arange(1, harmonics + 1)
    cosine, sine = 2 * n - 1, 2 * n
    D = sp.coo_array((np.r_[2.0 * n, -2.0 * n], (np.r_[cosine, sine], np.r_[sine, cosine])), shape=(size, size))

    half = np.full(harmonics - 1, 0.5)
    root = [math.sqrt(0.5)]
    c, s, up_c, up_s = cosine[:-1], sine[:-1], cosine[1:], sine[1:]
    cos2 = sp.coo_array((np.r_[root, half, half], (np.r_[1, up_c, up_s], np.r_[0, c, s])), shape=(size, size))
    sin2 = sp.coo_array((np.r_[root, half, -half], (np.r_[2, up_s, up_c], np.r_[0, c, s])), shape=(size, size))
    return D.tocsr(), (cos2 + cos2.T).tocsr(), (sin2 + sin2.T).tocsr()
