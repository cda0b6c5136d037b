"""Moments of order p of a state as vectors: the functions √(p!/α!) x^α, |α| = p, and what moves them.

ẋ = Ax moves them with a matrix K(A), the symmetric power of A, linear in A and skew-symmetric for a rotation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import expm as dense_exponential
from scipy.linalg import matrix_balance
from scipy.sparse.linalg import expm
from scipy.special import gammaln

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.exponent.rightmost import EXACTLY, Rates, Solve
from fpsolve.fem.factors import sparse_lu


@lru_cache(maxsize=32)
def multi_indices(n: int, p: int) -> IntArray:
    """All α, shape (N, n)."""
    return np.array([np.bincount(each, minlength=n) for each in combinations_with_replacement(range(n), p)])


@lru_cache(maxsize=32)
def _lowering(n: int, p: int) -> Any:
    """∂/∂x_i of all functions for one x_i after the other, over √p in functions of order p − 1, sparse."""
    alphas = multi_indices(n, p)
    places = {tuple(each): k for k, each in enumerate(multi_indices(n, p - 1).tolist())}
    columns, i = np.nonzero(alphas)
    lower = [places[tuple(each)] for each in (alphas[columns] - np.eye(n, dtype=int)[i]).tolist()]
    rows = i * len(places) + lower
    return sparse.csc_array((np.sqrt(alphas[columns, i]), (rows, columns)), shape=(n * len(places), len(alphas)))


def symmetric_power(matrix: FloatArray, p: int) -> Any:
    """K(A), sparse: Σ A_ij times the transpose of ∂/∂x_i times ∂/∂x_j."""
    lower = _lowering(len(matrix), p)
    whole = lower.T @ sparse.kron(matrix, sparse.eye_array(lower.shape[0] // len(matrix))) @ lower
    return whole.tocsc()


def multinomials(alphas: IntArray) -> FloatArray:
    """p!/α!."""
    return np.exp(gammaln(alphas.sum(axis=1) + 1) - gammaln(alphas + 1).sum(axis=1))


def of_signs(n: int, p: int) -> FloatArray:
    """The moments of n independent signs, which are the coefficients of a positive polynomial, too."""
    alphas = multi_indices(n, p)
    is_even = np.all(alphas % 2 == 0, axis=1)
    found = np.zeros(len(alphas))
    found[is_even] = np.sqrt(multinomials(alphas[is_even]))
    return found


@lru_cache(maxsize=32)
def _half(n: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows and columns of the upper half of a form, and its entries as moments over those as numbers."""
    i, j = np.triu_indices(n)
    return i, j, np.where(i == j, 1.0, math.sqrt(2))


def upper(forms: FloatArray) -> FloatArray:
    """The moments of order 2 of forms E xxᵀ, as vectors."""
    i, j, sizes = _half(forms.shape[-1])
    return forms[..., i, j] * sizes


def moment_form(moments: FloatArray, n: int, p: int) -> FloatArray:
    """E x^(α + β), |α| = |β| = p/2, in the units of the functions of order p/2; for p = 2 E xxᵀ, also of several."""
    if p == 2:
        i, j, sizes = _half(n)
        form = np.zeros((*moments.shape[:-1], n, n))
        form[..., i, j] = form[..., j, i] = moments / sizes
        return form
    alphas, halves = multi_indices(n, p), multi_indices(n, p // 2)
    places = {tuple(each): k for k, each in enumerate(alphas.tolist())}
    at = np.array([[places[tuple(each)] for each in (half + halves).tolist()] for half in halves])
    sizes = np.sqrt(multinomials(halves))
    return (moments / np.sqrt(multinomials(alphas)))[at] * np.outer(sizes, sizes)


class Moving(NamedTuple):
    """What moves a state, as matrices.

    Attributes:
        steady: A, that no noise changes.
        loads: D, each times a function of a noise.
        squares: B of each Bx ∘ dW.
        impulses: rates and exponents of impulses.
    """

    steady: FloatArray
    loads: Sequence[FloatArray]
    squares: Sequence[FloatArray]
    impulses: Sequence[tuple[float, FloatArray]]

    def balance(self, sizes: Sequence[float], same: Sequence[int]) -> FloatArray:
        """Units of the variables in which what moves their squares is balanced.

        Args:
            sizes: of the functions of noise.
            same: for the last ones which variables have the same units; these alone are balanced.
        """
        slow = (1.0, self.steady), *zip(sizes, self.loads, strict=True), *self.impulses
        linear: Any = sum(size * abs(each) for size, each in slow)
        rate = np.max(np.abs(np.linalg.eigvals(linear))) or 1.0
        squares = linear**2 / rate + sum(each**2 for each in self.squares)
        squares = squares + sum(often * each**2 for often, each in self.impulses)
        now = len(squares) - len(same)
        for column, variable in enumerate(same, now):
            squares[:, variable] += squares[:, column]
        _, (units, _) = matrix_balance(squares[:now, :now], permute=False, separate=True)
        return np.sqrt(np.append(units, units[list(same)]))

    def of_squares(self) -> tuple[FloatArray, list[FloatArray]]:
        """A and G of what moves E xxᵀ besides loads, A E xxᵀ + E xxᵀ Aᵀ + Σ G E xxᵀ Gᵀ.

        Those of an impulse are those of a white noise, as e^C X e^Cᵀ − X = JX + XJᵀ + JXJᵀ with J = e^C − 1.
        """
        jumps = [(rate, dense_exponential(exponent) - np.eye(len(exponent))) for rate, exponent in self.impulses]
        drift = self.steady + sum(0.5 * each @ each for each in self.squares) + sum(rate * jump for rate, jump in jumps)
        return drift, [*self.squares, *(math.sqrt(rate) * jump for rate, jump in jumps)]

    def over(self, units: FloatArray) -> Moving:
        """The same of a state in some units."""

        def turned(matrix: FloatArray) -> FloatArray:
            return matrix * units / units[:, None]

        loads, squares = ([turned(each) for each in of] for of in (self.loads, self.squares))
        impulses = [(rate, turned(exponent)) for rate, exponent in self.impulses]
        return Moving(turned(self.steady), loads, squares, impulses)

    def bounds(self, p: int, sizes: Sequence[float]) -> tuple[float, float]:
        """What no real part of an eigenvalue exceeds, and about no number in H, with sizes of functions of noise."""

        def size(matrix: FloatArray) -> float:
            return p * float(np.linalg.norm(matrix, 2))

        driven = 0.5 * sum(size(each) ** 2 for each in self.squares)
        driven += sum(rate * size(each) * np.exp(size(each)) for rate, each in self.impulses)
        loads = [*zip(sizes, self.loads, strict=True)]
        most = 0.5 * p * float(np.linalg.eigvalsh(self.steady + self.steady.T)[-1])
        most += sum(each * size(load) for each, load in loads)
        largest = p * float(np.max(abs(self.steady) + sum(each * abs(load) for each, load in loads)))
        return most + driven, largest + driven


def moves(moving: Moving, p: int) -> list[Any]:
    """K(A) with ½K(B)² and ν(exp K(C) − 1), and K(D) of each load."""
    steady = symmetric_power(moving.steady, p)
    for k in (symmetric_power(each, p) for each in moving.squares):
        steady = steady + 0.5 * k @ k
    for rate, exponent in moving.impulses:  # the dense exponential of SciPy lost four digits of some
        steady = steady + rate * (expm(symmetric_power(exponent, p)) - sparse.eye_array(steady.shape[0]))
    return [steady, *(symmetric_power(each, p) for each in moving.loads)]


@dataclass(frozen=True, eq=False)
class PowerRates(Rates):
    """H as a sparse matrix, whose rows are functions of the noise times functions of the state.

    Attributes:
        matrix: H, by columns.
        of_state: number of functions of the state.
    """

    matrix: Any
    of_state: int

    @classmethod
    def of(cls, moves: Sequence[Any], generator: Any, masses: Sequence[Any]) -> PowerRates:
        """H from what `moves` gives, Gᵀ and the Ξᵀ of each load."""
        unit = moves[0].shape[0]
        factors = (sparse.eye_array(generator.shape[0]), *masses)
        driven = sum(sparse.kron(xi, k) for xi, k in zip(factors, moves, strict=True))
        return cls((sparse.kron(generator, sparse.eye_array(unit)) + driven).tocsc(), unit)

    def __matmul__(self, x: FloatArray) -> FloatArray:
        return self.matrix @ x

    @property
    def T(self) -> PowerRates:
        return PowerRates(self.matrix.T.tocsc(), self.of_state)

    def on(self, functions: Any) -> PowerRates:
        rows = np.flatnonzero(np.repeat(functions, self.of_state))
        return PowerRates(self.matrix[rows][:, rows], self.of_state)

    def sizes(self, x: FloatArray, y: FloatArray) -> float:
        return float(np.abs(y) @ (abs(self.matrix) @ np.abs(x)))

    def solver(self, sigma: float, tolerance: float = EXACTLY) -> Solve:
        one = sparse.eye_array(self.matrix.shape[0], format="csc")
        factors = sparse_lu(sigma * one - self.matrix, permc_spec="COLAMD")
        return lambda x, trans=0: factors.solve(x, "T" if trans else "N")
