"""Second moments of many variables as matrices X_k = E xxᵀ f_k(ξ): Lyapunov equations, and the rest by iteration.

In the terms of `moments`,

    dX_k/dt = A X_k + X_k Aᵀ + Σ BX_kBᵀ + Σ ν(e^C X_k e^Cᵀ − X_k) + Σ_l Ξ_lk (D X_l + X_l Dᵀ) + Σ_l G_lk X_l,

A with ½ΣB². Without what noise drives, (σ + Σν)X_k − Σ_l G_lk X_l − A X_k − X_k Aᵀ = F_k are equations of Lyapunov, one
after the other, in the Schur forms of A and of Gᵀ. By this inverse GMRES finds (σ − H)⁻¹.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import expm, get_lapack_funcs, rsf2csf, schur
from scipy.sparse.linalg import LinearOperator, gmres

from fpsolve.arrays import FloatArray, dense
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.powers import Moving, upper
from fpsolve.exponent.rightmost import EXACTLY, REMEDY, ROUGHLY, ROUNDING, Eigenpair, Solve, rightmost

MOST_VECTORS = 100
"""Largest number of vectors of GMRES, which is not restarted, as it may stall then."""
MOST_NUMBERS = 500_000
"""Largest number of second moments, of all functions of the noise."""


class Matrices:
    """Second moments of what moves a state, as matrices.

    Args:
        moving: what does.
        p: 2.
        units: of the state; None for those in which its matrices are balanced.

    Raises:
        NoHierarchy: numbers in H are beyond floating-point numbers.
    """

    most = MOST_NUMBERS

    def __init__(self, moving: Moving, p: int, units: FloatArray | None = None) -> None:
        steady = moving.steady + 0.5 * sum((each @ each for each in moving.squares), 0.0 * moving.steady)
        gains = [(1.0, each) for each in moving.squares] + [(rate, expm(each)) for rate, each in moving.impulses]
        rest = sum((rate * each * each for rate, each in gains), 0.0 * steady)
        self.units, self.largest = moving.balance([steady, *moving.loads], rest, units)
        shares = self.units / self.units[:, None]
        self._steady = shares * steady - 0.5 * sum(rate for rate, _ in moving.impulses) * np.eye(len(steady))
        self._loads = [shares * each for each in moving.loads]
        self._gains = [np.sqrt(rate) * shares * each for rate, each in gains]

    @property
    def size(self) -> int:
        """The number of second moments."""
        n = len(self._steady)
        return n * (n + 1) // 2

    @property
    def starts(self) -> tuple[FloatArray, FloatArray]:
        """Moments of some law, and a positive form."""
        unit = np.eye(len(self._steady)).ravel()
        return unit, unit

    @property
    def scales(self) -> FloatArray:
        """The units of the numbers for each function of the noise."""
        return np.outer(self.units, self.units).ravel()

    def moments(self, x: FloatArray) -> FloatArray:
        """E x_i x_j, times √2 for i ≠ j, i ≤ j, of a right vector."""
        return upper((x * self.scales).reshape(self._steady.shape))

    def polynomial(self, y: FloatArray) -> FloatArray:
        """T, as coefficients of these, of a left vector."""
        return upper((y / self.scales).reshape(self._steady.shape))

    def rates(self, generator: Any, masses: Sequence[Any]) -> MatrixRates:
        """H from Gᵀ and the Ξᵀ of each load."""
        return MatrixRates(self._steady, list(zip(self._loads, masses, strict=True)), self._gains, generator)

    def image(self, generator: Any, masses: Sequence[Any], x: FloatArray, value: float) -> FloatArray:
        """Hx."""
        return self.rates(generator, masses) @ x


@dataclass(frozen=True, eq=False)
class MatrixRates:
    """H of symmetric X_k, in one row.

    Attributes:
        steady: A − ½Σν.
        loads: D and Ξᵀ of what adds Ξᵀ(D X + X Dᵀ).
        gains: B of what adds B X Bᵀ.
        of_noise: Gᵀ, sparse.
    """

    steady: FloatArray
    loads: Sequence[tuple[FloatArray, Any]]
    gains: Sequence[FloatArray]
    of_noise: Any

    def __matmul__(self, x: FloatArray) -> FloatArray:
        given = x.reshape(-1, *self.steady.shape)
        total = _both(self.steady @ given) + _over(self.of_noise, given)
        return np.asarray(total + self._driven(given)).ravel()

    def _driven(self, given: Any) -> Any:
        """By noise."""
        total = sum((_over(xi, _both(load @ given)) for load, xi in self.loads), 0.0 * given)
        return total + sum((gain @ given @ gain.T for gain in self.gains), 0.0 * given)

    def at(self, value: float) -> MatrixRates:
        """H at an eigenvalue, on which it does not depend here."""
        return self

    @cached_property
    def T(self) -> MatrixRates:
        """The transpose."""
        loads = [(load.T, xi.T.tocsr()) for load, xi in self.loads]
        return MatrixRates(self.steady.T, loads, [each.T for each in self.gains], self.of_noise.T.tocsr())

    def on(self, functions: Any) -> MatrixRates:
        """H of some functions of the noise."""
        at = np.flatnonzero(functions)
        loads = [(load, xi[at][:, at]) for load, xi in self.loads]
        return MatrixRates(self.steady, loads, self.gains, self.of_noise[at][:, at])

    @cached_property
    def _absolute(self) -> MatrixRates:
        loads = [(abs(load), abs(xi)) for load, xi in self.loads]
        return MatrixRates(abs(self.steady), loads, [abs(each) for each in self.gains], abs(self.of_noise))

    def sizes(self, x: FloatArray, y: FloatArray) -> float:
        """|y|ᵀ|H||x|."""
        return float(np.abs(y) @ (self._absolute @ np.abs(x)))

    @property
    def bound(self) -> float:
        """By the symmetric part of A and norms, as that of G in orthonormal functions is not positive."""
        own = float(np.linalg.eigvalsh(self.steady + self.steady.T)[-1])
        of_loads = sum(2 * float(np.linalg.norm(load, 2)) * _norm(xi) for load, xi in self.loads)
        return own + of_loads + sum(float(np.linalg.norm(each, 2)) ** 2 for each in self.gains)

    @property
    def largest(self) -> float:
        """The size of its largest entry, about."""
        return 2 * float(np.max(np.abs(self.steady))) + float(abs(self.of_noise).max())

    def rightmost(self, x: FloatArray, y: FloatArray) -> Eigenpair:
        """Λ, from a positive right and a positive left vector."""
        return rightmost(self, x, y)

    @cached_property
    def _schur(self) -> tuple[Any, Any, Any, Any]:
        """T and U of A − ½Σν = UTUᴴ, S and Z of Gᵀ = ZSZᴴ: upper triangular ones, or T with blocks where S is real."""
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
        return np.ascontiguousarray(_over(z, u @ found @ u.T).real)

    def solver(self, sigma: float, tolerance: float = EXACTLY) -> Solve:
        """(σ − H)⁻¹ by GMRES. It raises `NoHierarchy` where that does not settle."""

        def solve(x: FloatArray, trans: int = 0) -> FloatArray:
            h = self.T if trans else self
            shape = (-1, *self.steady.shape)

            def image(z: FloatArray) -> FloatArray:
                return z - h._alone(sigma, h._driven(z.reshape(shape))).ravel()

            operator = LinearOperator(2 * x.shape, matvec=image, dtype=float)
            start = h._alone(sigma, x.reshape(shape)).ravel()
            moved = image(x)
            guess = (moved @ start) / (moved @ moved) * x  # next to an eigenvector little else is left
            least = ROUNDING * float(np.linalg.norm(guess))
            found, missed = gmres(operator, start, guess, rtol=tolerance, atol=least, restart=MOST_VECTORS, maxiter=1)
            if missed and np.linalg.norm(image(found) - start) > ROUGHLY * np.linalg.norm(start):
                told = f"{x.size} second moments under noise so strong are not found by iteration"
                raise NoHierarchy(f"{told}; {REMEDY}")
            found = found.reshape(shape)
            return np.asarray(0.5 * (found + found.swapaxes(1, 2))).ravel()  # H of a skew X would be another

        return solve


def _both(half: Any) -> Any:
    """The sum of matrices and their transposes."""
    return half + half.swapaxes(1, 2)


def _over(matrix: Any, given: Any) -> Any:
    """A matrix over the functions of the noise."""
    return (matrix @ given.reshape(len(given), -1)).reshape(given.shape)


def _norm(matrix: Any) -> float:
    """A bound of ‖Ξ‖₂."""
    absolute = abs(matrix)
    return float(np.sqrt(absolute.sum(axis=0).max() * absolute.sum(axis=1).max()))
