"""Moments of order p of a state as vectors: the functions √(p!/α!) x^α, |α| = p, and what moves them.

ẋ = Ax moves them with a matrix K(A), the symmetric power of A, linear in A and skew-symmetric for a rotation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import matrix_balance
from scipy.sparse.linalg import expm, norm

from fpsolve.arrays import FloatArray, dense
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.rightmost import EXACTLY, Eigenpair, Solve, rightmost
from fpsolve.superlu import sparse_lu


@lru_cache(maxsize=32)
def ladder(n: int, p: int) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """All α, shape (N, n), and row, column, i, j and √(α_i(α_j + 1)) of what A_ij adds to K(A)."""
    alphas = np.array([np.bincount(each, minlength=n) for each in combinations_with_replacement(range(n), p)])
    places = {tuple(each): k for k, each in enumerate(alphas.tolist())}
    found = []
    for k, alpha in enumerate(alphas.tolist()):
        for i, j in np.ndindex(n, n):
            if alpha[i]:
                to = list(alpha)
                to[i] -= 1
                found.append((k, places[(*to[:j], to[j] + 1, *to[j + 1 :])], i, j, math.sqrt(alpha[i] * (to[j] + 1))))
    return alphas, tuple(np.array(each) for each in zip(*found, strict=True))


def moved(matrix: Any, p: int) -> Any:
    """K(A), sparse."""
    a = np.asarray(matrix, dtype=float)
    alphas, (rows, columns, i, j, sizes) = ladder(len(a), p)
    return sparse.csr_array((sizes * a[i, j], (rows, columns)), shape=2 * (len(alphas),))


def multinomials(alphas: Any) -> FloatArray:
    """p!/α!."""
    from scipy.special import gammaln

    return np.asarray(np.exp(gammaln(alphas.sum(axis=1) + 1) - gammaln(alphas + 1).sum(axis=1)))


def upper(form: FloatArray) -> FloatArray:
    """The moments of order 2 of a form E xxᵀ, as a vector."""
    i, j = np.triu_indices(len(form))
    return np.asarray(form[i, j] * np.where(i == j, 1.0, math.sqrt(2)))


def moment_form(moments: FloatArray, n: int, p: int) -> FloatArray:
    """E x^(α + β), |α| = |β| = p/2, in the units of the functions of order p/2; E xxᵀ for p = 2."""
    if p == 2:
        form = np.zeros((n, n))
        form[np.triu_indices(n)] = moments
        return np.asarray((form + form.T) / np.where(np.eye(n, dtype=bool), 2.0, math.sqrt(2)))
    alphas, _ = ladder(n, p)
    halves, _ = ladder(n, p // 2)
    places = {tuple(each): k for k, each in enumerate(alphas.tolist())}
    at = np.array([[places[tuple(each)] for each in (half + halves).tolist()] for half in halves])
    sizes = np.sqrt(multinomials(halves))
    return np.asarray((moments / np.sqrt(multinomials(alphas)))[at] * np.outer(sizes, sizes))


@lru_cache(maxsize=32)
def gaussian(n: int, p: int) -> FloatArray:
    """The moments of a vector of independent Gaussian numbers."""
    alphas, _ = ladder(n, p)
    from scipy.special import gammaln

    logs = np.sum(gammaln(alphas + 1) - gammaln(alphas / 2 + 1) - 0.5 * alphas * math.log(2), axis=1)
    found = np.where(np.all(alphas % 2 == 0, axis=1), np.exp(logs) * np.sqrt(multinomials(alphas)), 0.0)
    return np.asarray(found / np.linalg.norm(found))


class Moving(NamedTuple):
    """What moves a state, as matrices.

    Attributes:
        steady: A, that no noise changes.
        loads: D, each times a function of a noise.
        strengths: sizes of these functions.
        squares: B of each Bx ∘ dW.
        impulses: rates and exponents of impulses.
    """

    steady: FloatArray
    loads: Sequence[FloatArray]
    strengths: Sequence[float]
    squares: Sequence[FloatArray]
    impulses: Sequence[tuple[float, FloatArray]]

    def balance(self, linear: Sequence[Any], rest: Any, units: FloatArray | None) -> tuple[FloatArray, float]:
        """Units of the state, the given ones or else those in which all sizes are balanced, and the largest size there.

        Raises:
            NoHierarchy: a size is not finite.
        """
        sizes = abs(dense(rest))
        for strength, each in zip((1.0, *self.strengths), linear, strict=True):
            sizes = sizes + strength * abs(dense(each))
        if not np.isfinite(sizes).all():
            raise NoHierarchy("the equations of the moments are beyond floating-point numbers; use a smaller p")
        with np.errstate(invalid="ignore"):  # of units beyond an integer, which none are taken for here
            balanced, (own, _) = matrix_balance(sizes, permute=False, separate=True)
        return own if units is None else units, float(np.max(balanced))


class Powers:
    """Moments of the order p of what moves a state, as vectors.

    Args:
        moving: what does.
        p: even.
        units: of the functions of the state; None for those in which H is balanced.

    Raises:
        NoHierarchy: numbers in H are beyond floating-point numbers.
    """

    most = 0

    def __init__(self, moving: Moving, p: int, units: FloatArray | None = None) -> None:
        linear = [moved(each, p) for each in (moving.steady, *moving.loads)]
        rest, lost = 0.0 * linear[0], 0.0
        for k in (moved(each, p) for each in moving.squares):
            rest = rest + 0.5 * k @ k
        for rate, exponent in moving.impulses:
            gain = expm(power := moved(exponent, p).tocsc())  # the dense one of SciPy lost four digits of some
            lost += rate * float(norm(power) * norm(gain))
            rest = rest + rate * (gain - sparse.eye_array(rest.shape[0]))
        self.units, largest = moving.balance(linear, rest, units)
        self.largest = largest + lost
        for each in (own := [(linear[0] + rest).tocsr(), *linear[1:]]):
            each.data *= self.units[each.indices] / np.repeat(self.units, np.diff(each.indptr))
        self._steady, *self._loads = own
        self._start = gaussian(len(moving.steady), p)

    @property
    def size(self) -> int:
        """The number of functions of the state."""
        return int(self.units.size)

    @property
    def starts(self) -> tuple[FloatArray, FloatArray]:
        """Moments of some law, and a positive polynomial."""
        return self._start / self.units, self._start * self.units

    @property
    def scales(self) -> FloatArray:
        """The units of the numbers for each function of the noise."""
        return self.units

    def moments(self, x: FloatArray) -> FloatArray:
        """E √(p!/α!) x^α of a right vector."""
        return x * self.units

    def polynomial(self, y: FloatArray) -> FloatArray:
        """T, as coefficients of these functions, of a left vector."""
        return y / self.units

    def rates(self, generator: Any, masses: Sequence[Any]) -> PowerRates:
        """H from Gᵀ and the Ξᵀ of each load."""
        one = sparse.eye_array(generator.shape[0])
        h = sparse.kron(generator, sparse.eye_array(self.size)) + sparse.kron(one, self._steady)
        h = h + sum(sparse.kron(xi, k) for k, xi in zip(self._loads, masses, strict=True))
        return PowerRates(h.tocsc(), self.size)

    def image(self, generator: Any, masses: Sequence[Any], x: FloatArray, value: float) -> FloatArray:
        """Hx, without H."""
        parts = x.reshape(-1, self.size)
        total = generator @ parts + (self._steady @ parts.T).T
        for k, xi in zip(self._loads, masses, strict=True):
            total = total + (k @ (xi @ parts).T).T
        return np.asarray(total.ravel())


@dataclass(frozen=True, eq=False)
class PowerRates:
    """H as a sparse matrix, whose rows are functions of the noise times functions of the state.

    Attributes:
        matrix: H, by columns.
        of_state: number of functions of the state.
    """

    matrix: Any
    of_state: int

    def __matmul__(self, x: FloatArray) -> FloatArray:
        return np.asarray(self.matrix @ x)

    def at(self, value: float) -> PowerRates:
        """H at an eigenvalue, on which it does not depend here."""
        return self

    @property
    def T(self) -> PowerRates:
        """The transpose."""
        return PowerRates(self.matrix.T.tocsc(), self.of_state)

    def on(self, functions: Any) -> PowerRates:
        """H of some functions of the noise."""
        rows = np.flatnonzero(np.repeat(functions, self.of_state))
        return PowerRates(self.matrix[rows][:, rows], self.of_state)

    @cached_property
    def _absolute(self) -> Any:
        return abs(self.matrix)

    @cached_property
    def _one(self) -> Any:
        return sparse.eye_array(self.matrix.shape[0], format="csc")

    def sizes(self, x: FloatArray, y: FloatArray) -> float:
        return float(np.abs(y) @ (self._absolute @ np.abs(x)))

    @property
    def bound(self) -> float:
        """By the rows of H, or its columns."""
        diagonal = self.matrix.diagonal()
        return min(float(np.max(diagonal - np.abs(diagonal) + self._absolute.sum(axis=axis))) for axis in (0, 1))

    @property
    def largest(self) -> float:
        return float(self._absolute.max())

    def rightmost(self, x: FloatArray, y: FloatArray) -> Eigenpair:
        """Λ, from a positive right and a positive left vector."""
        return rightmost(self, x, y)

    def solver(self, sigma: float, tolerance: float = EXACTLY) -> Solve:
        """(σ − H)⁻¹. Raises `SingularMatrix`."""
        factors = sparse_lu(sigma * self._one - self.matrix, permc_spec="COLAMD")
        return lambda x, trans=0: np.asarray(factors.solve(x, "T" if trans else "N"))
