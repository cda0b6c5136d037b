"""Second moments of many variables as matrices: H by products of n × n matrices, and its inverse by iteration.

X_k = E f_k(ξ) xxᵀ obeys, in the terms of `moments`,

    dX_k/dt = A X_k + X_k Aᵀ + Σ BX_kBᵀ + Σ ν(e^C X_k e^Cᵀ − X_k) + Σ_l Ξ_lk (D X_l + X_l Dᵀ) + Σ_l G_lk X_l,

A with ½ΣB². In the eigenvectors of A and of G what couples no numbers is the diagonal g_k + a_i + a_j. The division by
σ less that is nearly (σ − H)⁻¹, by which GMRES finds it. Where A or G has too few eigenvectors, those of a matrix next
to it do: what is left beside the diagonal is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.csgraph import connected_components

from fpsolve.arrays import FloatArray
from fpsolve.budget import charge
from fpsolve.errors import NoHierarchy
from fpsolve.theory.powers import Moving, upper
from fpsolve.theory.rightmost import REMEDY, Eigenpair, Solve, orthogonal, polished, rightmost

LOW_RANK = 3
"""Number of columns, over the rank, from which on a matrix is held as a product of two thin ones."""
NO_RANK = 1e-13
"""Share of the largest singular value that is rounding."""
CLEAN = 1e-14
"""Share of the largest entry of a matrix in other coordinates that is rounding."""
WORST_CONDITION = 1e4
"""Condition of eigenvectors up to which they are taken."""
NEAR = (0.0, 1e-8, 1e-6, 1e-4)
"""Distances, over the norm, of the matrices whose eigenvectors are tried."""
MOST_VECTORS = 150
"""Largest number of vectors of GMRES, which is not restarted, as it may stall then."""
MOST_HELD = 3e7
"""Number of numbers in all of these from which on there are fewer."""
ROUGHLY, EXACTLY = 1e-4, 1e-10
"""Tolerances of GMRES for the search and for the eigenvectors."""
SETTLED, NEAREST, KRYLOV = 1e-3, 0.1, 8
"""As in `Rates`: GMRES takes longer for a nearer σ, and long for each vector."""
MOST_NUMBERS = 1_000_000
"""Largest number of second moments, of all functions of the noise."""

Factors = tuple[Any, ...]
"""A matrix, or two thin ones of which it is the product."""


def factors_of(matrix: FloatArray) -> Factors:
    """A matrix, as a product of two thin ones where its rank is low."""
    left, sizes, right = np.linalg.svd(matrix)
    rank = int(np.count_nonzero(sizes > NO_RANK * max(sizes[0], 1e-300)))
    return (left[:, :rank] * sizes[:rank], right[:rank]) if LOW_RANK * rank < len(matrix) else (matrix,)


def _times(factors: Factors, x: Any) -> Any:
    for each in reversed(factors):
        x = each @ x
    return x


def _whole(factors: Factors) -> Any:
    return factors[0] if len(factors) == 1 else factors[0] @ factors[1]


class Products:
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
        self._steady = shares * steady
        self._loads = [factors_of(shares * each) for each in moving.loads]
        self._squares = [(rate, factors_of(shares * each)) for rate, each in gains]
        self._rate = -sum(rate for rate, _ in moving.impulses)

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

    def is_dense(self, functions: int) -> bool:
        """Matrices of the noise are sparse."""
        return False

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

    def rates(self, generator: Any, masses: Sequence[Any]) -> ProductRates:
        """H from Gᵀ and the Ξᵀ of each load."""
        loads = [((self._steady,), None), *zip(self._loads, masses, strict=True)]
        return ProductRates(len(self._steady), self._rate, loads, self._squares, generator)

    def image(self, generator: Any, masses: Sequence[Any], x: FloatArray, value: float) -> FloatArray:
        """Hx."""
        return np.asarray(self.rates(generator, masses) @ x)


@dataclass(frozen=True, eq=False)
class ProductRates:
    """H of numbers X_kij, symmetric in i and j, in one row.

    Attributes:
        n: number of variables.
        rates: of each number by itself, of a shape that broadcasts to that of X.
        loads: D and Ξᵀ, None for 1, of what adds D X + X Dᵀ.
        squares: r and B of what adds r B X Bᵀ.
        of_noise: Gᵀ, or what is left of it beside the diagonal.
    """

    n: int
    rates: Any
    loads: Sequence[tuple[Factors, Any]]
    squares: Sequence[tuple[float, Factors]]
    of_noise: Any

    nearest = NEAREST

    @property
    def count(self) -> int:
        """The number of functions of the noise."""
        return int(self.of_noise.shape[0])

    def __matmul__(self, x: Any) -> Any:
        given = x.reshape(self.count, self.n, self.n)
        charge(self.n * self.n * self.count)
        total = self.rates * given + self._over_noise(self.of_noise, given)
        for load, xi in self.loads:
            half = _times(load, given if xi is None else self._over_noise(xi, given))
            total = total + half + half.swapaxes(1, 2)
        for rate, square in self.squares:
            total = total + rate * _times(square, _times(square, given).swapaxes(1, 2))
        return total.ravel()

    def _over_noise(self, matrix: Any, x: Any) -> Any:
        return (matrix @ x.reshape(self.count, -1)).reshape(x.shape)

    def at(self, value: float) -> ProductRates:
        """H at an eigenvalue, on which it does not depend here."""
        return self

    @cached_property
    def T(self) -> ProductRates:
        """The transpose."""

        def turned(factors: Factors) -> Factors:
            return tuple(each.T for each in reversed(factors))

        loads = [(turned(load), None if xi is None else xi.T.tocsr()) for load, xi in self.loads]
        squares = [(rate, turned(square)) for rate, square in self.squares]
        return ProductRates(self.n, self.rates, loads, squares, self.of_noise.T.tocsr())

    def on(self, functions: Any) -> ProductRates:
        """H of some functions of the noise."""
        at = np.flatnonzero(functions)
        loads = [(load, None if xi is None else xi[at][:, at]) for load, xi in self.loads]
        return ProductRates(self.n, self.rates, loads, self.squares, self.of_noise[at][:, at])

    @cached_property
    def _absolute(self) -> ProductRates:
        loads = [((abs(_whole(load)),), None if xi is None else abs(xi)) for load, xi in self.loads]
        squares = [(rate, (abs(_whole(square)),)) for rate, square in self.squares]
        return ProductRates(self.n, np.abs(self.rates), loads, squares, abs(self.of_noise))

    def sizes(self, x: Any, y: Any) -> float:
        return float(np.abs(y) @ (self._absolute @ np.abs(x)))

    @cached_property
    def norms(self) -> list[float]:
        """Bounds of the norms of all but the rates."""

        def norm(matrix: Any) -> float:
            absolute = abs(matrix)
            return float(np.sqrt(absolute.sum(axis=0).max() * absolute.sum(axis=1).max()))

        of_loads = [2 * np.linalg.norm(_whole(load), 2) * (1.0 if xi is None else norm(xi)) for load, xi in self.loads]
        of_squares = [rate * np.linalg.norm(_whole(square), 2) ** 2 for rate, square in self.squares]
        return [*map(float, of_loads), *map(float, of_squares), norm(self.of_noise)]

    @property
    def largest(self) -> float:
        return max(float(np.max(np.abs(self.rates))), *self.norms)

    @cached_property
    def _own(self) -> Own:
        return Own.of(self)

    def rightmost(self, x: Any, y: Any, near: float | None) -> Eigenpair:
        """Λ, from a positive right and a positive left vector, and a σ that may be next to it."""
        own = self._own
        value, sigma, found = rightmost(own, own.right(x), near)
        back = own.right_back(found)
        return polished(self, value, sigma, (back / back[np.argmax(np.abs(back))]).real, y)

    def solver(self, sigma: float) -> Solve:
        own = self._own
        solve = own.solver(sigma, EXACTLY)
        return lambda x, trans=0: (
            (own.left_back(solve(own.left(x), 1)) if trans else own.right_back(solve(own.right(x)))).real
        )


@dataclass(frozen=True, eq=False)
class Own:
    """H in the eigenvectors of A, the columns of v, and of Gᵀ, those of u."""

    rates: ProductRates
    v: Any
    v_inverse: Any
    u: Any
    u_inverse: Any

    settled, krylov = SETTLED, KRYLOV

    @classmethod
    def of(cls, h: ProductRates) -> Own:
        (first, _), *others = h.loads
        a, v, v_inverse = eigenvectors(sparse.csr_array(_whole(first)))
        g, u, u_inverse = eigenvectors(h.of_noise)
        v, v_inverse = v.toarray(), v_inverse.toarray()

        def turned(factors: Factors) -> Factors:
            if len(factors) == 1:
                return (v_inverse @ factors[0] @ v,)
            return v_inverse @ factors[0], factors[1] @ v

        rest = _cleaned(v_inverse @ _whole(first) @ v, np.diag(a))
        loads = [((rest,), None)] if np.any(rest) else []
        loads += [(turned(load), None if xi is None else _cleaned(u_inverse @ xi @ u)) for load, xi in others]
        rates = h.rates + g[:, None, None] + a[:, None] + a
        left = _cleaned(u_inverse @ h.of_noise @ u, sparse.diags_array(g))
        squares = [(rate, turned(square)) for rate, square in h.squares]
        return cls(ProductRates(h.n, rates, loads, squares, left), v, v_inverse, u, u_inverse)

    @property
    def bound(self) -> float:
        """By norms of what stands beside the diagonal."""
        return float(np.max(self.rates.rates.real)) + sum(self.rates.norms)

    @property
    def largest(self) -> float:
        return self.rates.largest

    def solver(self, sigma: float, tolerance: float = ROUGHLY) -> Solve:
        divisor = (sigma - self.rates.rates).ravel()

        def solve(x: Any, trans: int = 0) -> Any:
            h = self.rates.T if trans else self.rates

            def image(z: Any) -> Any:
                return (sigma * z - h @ z) / divisor

            b, moved = x / divisor, image(x)
            share = np.vdot(moved, b) / np.vdot(moved, moved)  # next to an eigenvector little else is left
            rest = gmres(image, b - share * moved, tolerance * float(np.linalg.norm(b)))
            found = (share * x + rest).reshape(-1, h.n, h.n)
            return (0.5 * (found + found.swapaxes(1, 2))).ravel()  # H of a skew X would be another

        return solve

    def right(self, x: Any) -> Any:
        """A right vector in these coordinates."""
        return self._turned(x, self.v_inverse, self.u_inverse)

    def left(self, y: Any) -> Any:
        return self._turned(y, self.v.T, self.u.T)

    def right_back(self, x: Any) -> Any:
        """A right vector in those of H."""
        return self._turned(x, self.v, self.u)

    def left_back(self, y: Any) -> Any:
        return self._turned(y, self.v_inverse.T, self.u_inverse.T)

    def _turned(self, x: Any, of_state: Any, of_noise: Any) -> Any:
        n = len(of_state)
        turned = of_state @ x.reshape(-1, n, n).astype(complex) @ of_state.T
        return (of_noise @ turned.reshape(-1, n * n)).ravel()


def gmres(image: Callable[[Any], Any], b: Any, tolerance: float) -> Any:
    """x whose image is b but for the tolerance, by the smallest residual in the space of b, its image, and so on.

    Raises:
        NoHierarchy: the largest number of these does not suffice.
    """
    most, size = max(10, min(MOST_VECTORS, int(MOST_HELD / b.size))), float(np.linalg.norm(b))
    vectors, images = np.empty((most + 1, b.size), complex), np.zeros((most + 1, most), complex)
    if size <= tolerance:
        return 0.0 * b
    vectors[0] = b / size
    for k in range(most):
        images[: k + 2, k], vectors[k + 1] = orthogonal(vectors[: k + 1], image(vectors[k]))
        target = np.eye(1, k + 2)[0]
        x = np.linalg.lstsq(images[: k + 2, : k + 1], target, rcond=None)[0]
        if size * np.linalg.norm(images[: k + 2, : k + 1] @ x - target) <= tolerance:
            return size * (x @ vectors[: k + 1])
    raise NoHierarchy(f"{b.size} second moments under noise so strong are not found by iteration; {REMEDY}")


def _cleaned(matrix: Any, without: Any = None) -> Any:
    """A matrix less another one, and less what is rounding beside it."""
    rest = matrix if without is None else matrix - without
    most = CLEAN * float(np.max(np.abs(matrix.data if sparse.issparse(matrix) else matrix), initial=0.0))
    if sparse.issparse(rest):
        rest = rest.tocsr()
        rest.data[np.abs(rest.data) <= most] = 0.0
        rest.eliminate_zeros()
        return rest
    return np.where(np.abs(rest) <= most, 0.0, rest)


def eigenvectors(matrix: Any) -> tuple[Any, Any, Any]:
    """Eigenvalues, eigenvectors and the inverse of these, of each block of a sparse matrix, or of one next to it."""
    size, rng = matrix.shape[0], np.random.default_rng(0)
    _, labels = connected_components(matrix, directed=False)
    values, v, inverse = np.zeros(size, complex), *(sparse.lil_array((size, size), dtype=complex) for _ in range(2))
    for label in np.unique(labels):
        at = np.flatnonzero(labels == label)
        block = matrix[at][:, at].toarray()
        for share in NEAR:
            near = block + share * np.linalg.norm(block) * rng.standard_normal(block.shape) / len(at)
            own, vectors = np.linalg.eig(near)
            if np.linalg.cond(vectors) <= WORST_CONDITION:
                break
        values[at] = own
        v[np.ix_(at, at)], inverse[np.ix_(at, at)] = vectors, np.linalg.inv(vectors)
    return values, v.tocsr(), inverse.tocsr()
