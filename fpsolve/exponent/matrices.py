"""Second moments of many variables as matrices X_k = E xxᵀ f_k(ξ): Lyapunov equations, and the rest by iteration.

In the terms of `moments`,

    dX_k/dt = A X_k + X_k Aᵀ + Σ BX_kBᵀ + Σ_l Ξ_lk (D X_l + X_l Dᵀ) + Σ_l G_lk X_l,

A with ½ΣB², impulses among the B. Without what noise drives, σX_k − Σ_l G_lk X_l − A X_k − X_k Aᵀ = F_k are equations
of Lyapunov, one after the other, in the Schur forms of A and of Gᵀ. By this inverse GMRES finds (σ − H)⁻¹.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs, rsf2csf, schur
from scipy.sparse.linalg import LinearOperator, gmres

from fpsolve.arrays import FloatArray, dense
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.powers import Moving, moment_form, upper
from fpsolve.exponent.rightmost import EXACTLY, REMEDY, ROUGHLY, ROUNDING, Rates, Solve

MOST_VECTORS = 100
"""Largest number of vectors of GMRES, which is not restarted, as it may stall then."""


@dataclass(frozen=True, eq=False)
class MatrixRates(Rates):
    """H of the upper halves of X_k, one after the other.

    Attributes:
        steady: A.
        loads: D and Ξᵀ of what adds Ξᵀ(D X + X Dᵀ).
        gains: B of what adds B X Bᵀ.
        of_noise: Gᵀ, sparse.
    """

    steady: FloatArray
    loads: Sequence[tuple[FloatArray, Any]]
    gains: Sequence[FloatArray]
    of_noise: Any

    @classmethod
    def of(cls, moving: Moving, generator: Any, masses: Sequence[Any]) -> MatrixRates:
        """H from Gᵀ and the Ξᵀ of each load."""
        steady, gains = moving.of_squares()
        return cls(steady, list(zip(moving.loads, masses, strict=True)), gains, generator)

    def _forms(self, x: FloatArray) -> FloatArray:
        """X_k, shape (functions, n, n)."""
        return moment_form(x.reshape(self.of_noise.shape[0], -1), len(self.steady), 2)

    def __matmul__(self, x: FloatArray) -> FloatArray:
        given = self._forms(x)
        total = _both(self.steady @ given) + _over(self.of_noise, given)
        return upper(total + self._driven(given)).ravel()

    def _driven(self, given: Any) -> Any:
        """By noise."""
        of_loads = sum(_over(xi, _both(load @ given)) for load, xi in self.loads)
        return 0.0 * given + of_loads + sum(gain @ given @ gain.T for gain in self.gains)

    def _mapped(self, of_state: Callable[[Any], Any], of_noise: Callable[[Any], Any]) -> MatrixRates:
        """That with a function of each matrix of the state, and one of each of the noise."""
        loads = [(of_state(load), of_noise(xi)) for load, xi in self.loads]
        return MatrixRates(of_state(self.steady), loads, [*map(of_state, self.gains)], of_noise(self.of_noise))

    @cached_property
    def T(self) -> MatrixRates:
        return self._mapped(np.transpose, lambda xi: xi.T.tocsr())

    def on(self, functions: Any) -> MatrixRates:
        at = np.flatnonzero(functions)
        return self._mapped(np.asarray, lambda xi: xi[at][:, at])

    def sizes(self, x: FloatArray, y: FloatArray) -> float:
        return float(np.abs(y) @ (self._mapped(abs, abs) @ np.abs(x)))

    @cached_property
    def _schur(self) -> tuple[Any, Any, Any, Any]:
        """T and U of A = UTUᴴ, S and Z of Gᵀ = ZSZᴴ: upper triangular ones, or T with blocks where S is real."""
        of_noise, state = schur(dense(self.of_noise)), schur(self.steady)
        if np.any(np.diag(of_noise[0], -1)):
            of_noise, state = rsf2csf(*of_noise), rsf2csf(*state)
        return *state, *of_noise

    def _alone(self, sigma: float, given: Any) -> FloatArray:
        """Without what noise drives, (σ − Gᵀ)X − A X − X Aᵀ = F for X, from the last function to the first."""
        t, u, s, z = self._schur
        given = u.conj().T @ _over(z.conj().T, given) @ u.conj()
        found, one = np.empty_like(given), np.eye(len(t))
        [trsyl] = get_lapack_funcs(("trsyl",), (given,))
        for k in reversed(range(len(s))):
            moved = t - 0.5 * (sigma - s[k, k]) * one
            rest = k + 1 + np.flatnonzero(s[k, k + 1 :])
            right = given[k] + np.tensordot(s[k, rest], found[rest], 1)
            x, scale, _ = trsyl(moved, moved.conj(), -right, tranb="C")
            found[k] = x / scale
        return upper(_over(z, u @ found @ u.T).real).ravel()

    def solver(self, sigma: float, tolerance: float = EXACTLY) -> Solve:
        """By GMRES. It raises `NoHierarchy` where that does not settle."""

        def solve(x: FloatArray, trans: int = 0) -> FloatArray:
            h = self.T if trans else self

            def image(z: FloatArray) -> FloatArray:
                return z - h._alone(sigma, h._driven(h._forms(z)))

            operator = LinearOperator(2 * x.shape, matvec=image, dtype=float)
            start = h._alone(sigma, h._forms(x))
            moved = image(x)
            guess = (moved @ start) / (moved @ moved) * x  # next to an eigenvector little else is left
            least = ROUNDING * np.linalg.norm(guess)
            found, missed = gmres(operator, start, guess, rtol=tolerance, atol=least, restart=MOST_VECTORS, maxiter=1)
            if missed and np.linalg.norm(image(found) - start) > ROUGHLY * np.linalg.norm(start):
                told = f"{x.size} second moments under noise so strong are not found by iteration"
                raise NoHierarchy(f"{told}; {REMEDY}")
            return found

        return solve


def _both(half: Any) -> Any:
    """The sum of matrices and their transposes."""
    return half + half.swapaxes(1, 2)


def _over(matrix: Any, given: Any) -> Any:
    """A matrix over the functions of the noise."""
    return (matrix @ given.reshape(len(given), -1)).reshape(given.shape)
