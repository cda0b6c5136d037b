"""Harmonics of the sphere of directions: all polynomials in e up to a degree, for systems in strong noise.

With e = (cos η e₁, sin η e₂), see `sphere`, the harmonics of degree l are, for waves w of the degrees m₁ of e₁ and m₂
of e₂ and Jacobi polynomials P of the degree k = (l − m₁ − m₂)/2,

    Y = cos^m₁η sin^m₂η P_k^(α, β)(cos 2η) w(e₁, e₂),    α = m₂ + n₂/2 − 1,    β = m₁ + n₁/2 − 1,

and −l(l + n − 2) is the eigenvalue of Laplace's operator Δ on the sphere. All that a generator needs comes from it and
from multiplication by the components e_i, which has few entries for each harmonic. Of a symmetric matrix S and
q = eᵀSe the flow is half the gradient of q, and of an antisymmetric one it is made of rotations:

    h·∇u = ¼(Δ(qu) − qΔu + 2n qu − 2 tr S u),    (e_j∂_i − e_i∂_j)u = ½(e_jΔ(e_iu) − e_iΔ(e_ju)).

Polynomials in e know no coordinates: rotations change nothing. They fail where T has a layer, as in weak noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations, combinations_with_replacement
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity
from scipy.special import betaln, eval_jacobi, gammaln, roots_jacobi

from fpsolve.arrays import FloatArray, IntArray, Mask, Matrix
from fpsolve.fem.sphere import DirectionAxis, group, group_dimensions, waves_at


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Those up to two degrees more than functions have, by degree, orthonormal in the mean over the sphere.

    Attributes:
        degrees: l of each, even; shape (all,).
        own: whether a function may have it; the first is constant.
        products: for each pair i ≤ j the matrix of multiplication by e_i e_j.
        rotations: for each pair i < j that of e_j∂_i − e_i∂_j.
        values: factors of the values at some directions, of waves and in η, and the degree of each.
    """

    degrees: IntArray
    own: Mask
    products: dict[tuple[int, int], csr_matrix]
    rotations: dict[tuple[int, int], csr_matrix]
    values: list[tuple[FloatArray, FloatArray, IntArray]]

    @staticmethod
    @lru_cache(maxsize=16)
    def of(n: int, most: int) -> Harmonics:
        """The harmonics of functions up to an even degree."""
        degrees, factors, values = _components(n, most + 2)
        laplace = diags(-degrees * (degrees + n - 2.0))
        even = np.flatnonzero(degrees % 2 == 0)

        def on_even(matrix: csr_matrix) -> csr_matrix:
            return csr_matrix(matrix)[even][:, even]

        turns = {
            (i, j): 0.5 * (factors[j] @ laplace @ factors[i] - factors[i] @ laplace @ factors[j])
            for i, j in combinations(range(n), 2)
        }
        return Harmonics(
            degrees[even],
            degrees[even] <= most,
            {(i, j): on_even(factors[i] @ factors[j]) for i, j in combinations_with_replacement(range(n), 2)},
            {pair: on_even(turn) for pair, turn in turns.items()},
            [each for each in values if each[2][0] % 2 == 0],
        )

    @cached_property
    def samples(self) -> FloatArray:
        """Values of the own ones at some directions, shape (points, own)."""
        by_degree = np.argsort(np.concatenate([degrees for *_, degrees in self.values]), kind="stable")
        table = np.concatenate([np.kron(of_waves, of_eta) for of_waves, of_eta, _ in self.values], axis=1)
        return table[:, by_degree[self.own]]


def _components(n: int, most: int) -> tuple[IntArray, list[csr_matrix], list[tuple[FloatArray, FloatArray, IntArray]]]:
    """Of the harmonics of all degrees these, multiplication by e_1, …, e_n, and factors of their values."""
    dimensions = group_dimensions(n)
    groups = [group(dimension, most) for dimension in dimensions]
    x, weights = roots_jacobi(most + 2, dimensions[1] / 2 - 1, dimensions[0] / 2 - 1)
    sides, weights = (np.sqrt((1 + x) / 2), np.sqrt((1 - x) / 2)), weights / weights.sum()
    waves = [{int(m): np.flatnonzero(each.degrees == m) for m in set(each.degrees.tolist())} for each in groups]
    pairs = [(m, k) for m in waves[0] for k in waves[1] if m + k <= most]
    radial: dict[tuple[int, int], FloatArray] = {}
    values: list[tuple[FloatArray, FloatArray, IntArray]] = []
    ends = [0]
    for m, k in pairs:
        orders = np.arange((most - m - k) // 2 + 1)
        jacobi = eval_jacobi(orders, k + dimensions[1] / 2 - 1, m + dimensions[0] / 2 - 1, x[:, None])
        own = (sides[0] ** m * sides[1] ** k)[:, None] * jacobi
        radial[m, k] = np.asarray(own / np.sqrt(weights @ own**2), dtype=float)
        tables = groups[0].samples[:, waves[0][m]], groups[1].samples[:, waves[1][k]]
        of_waves = np.asarray(np.kron(*tables), dtype=float)
        values.append((of_waves, radial[m, k][::2], np.tile(m + k + 2 * orders, of_waves.shape[1])))
        ends.append(ends[-1] + values[-1][2].size)
    starts, degrees = dict(zip(pairs, ends, strict=False)), np.concatenate([each for *_, each in values])
    by_degree = np.argsort(degrees, kind="stable")
    place = np.argsort(by_degree)

    def component(side: int, unit: FloatArray) -> csr_matrix:
        """Multiplication by one of e_1 or of e_2: it takes a wave of its group one degree up or down."""
        entries, rows, columns = [], [], []
        for m, k in pairs:
            if (to := (m + 1 - side, k + side)) in starts:
                of_waves = [np.eye(waves[0][m].size), np.eye(waves[1][k].size)]
                of_waves[side] = unit[np.ix_(waves[side][to[side]], waves[side][(m, k)[side]])]
                of_eta = radial[to].T @ ((weights * sides[side])[:, None] * radial[m, k])
                block = coo_matrix(np.kron(np.kron(*of_waves), np.where(np.abs(of_eta) > 1e-14, of_eta, 0.0)))
                entries.append(block.data)
                rows.append(place[starts[to] + block.row])
                columns.append(place[starts[m, k] + block.col])
        where = np.concatenate(rows), np.concatenate(columns)
        up = csr_matrix((np.concatenate(entries), where), shape=(place.size, place.size))
        return up + up.T

    factors = [component(side, unit) for side in (0, 1) for unit in groups[side].unit]
    return degrees[by_degree], factors, values


@dataclass(frozen=True, eq=False)
class HarmonicAxis(DirectionAxis):
    """Harmonics up to a degree, see the module; what two degrees more change tells their error.

    Attributes:
        waves: the largest degree, even.
    """

    waves: int

    elements = 1

    @property
    def size(self) -> int:
        return self.degrees.size

    @property
    def facts(self) -> dict[str, Any]:
        return {"harmonics": self.waves}

    def enriched(self) -> HarmonicAxis:
        return replace(self, waves=self.waves + 2)

    @cached_property
    def _harmonics(self) -> Harmonics:
        return Harmonics.of(self.n, self.waves)

    @property
    def degrees(self) -> IntArray:
        return self._harmonics.degrees[self._harmonics.own]

    @cached_property
    def identity(self) -> FloatArray:
        return np.eye(self.size)

    @property
    def inner_values(self) -> FloatArray:
        return self._harmonics.samples

    def projection(self, other: HarmonicAxis) -> Matrix:
        """Those that both have."""
        return np.eye(self.size, other.size)

    def _moved(self, matrix: FloatArray) -> tuple[csr_matrix, csr_matrix]:
        """With the symmetric part of the matrix, q, and with the antisymmetric one, rotations."""
        products, rotations, n = self._harmonics.products, self._harmonics.rotations, self.n
        growth = sum((matrix[i, j] + (i < j) * matrix[j, i]) * each for (i, j), each in products.items())
        laplace = diags(-self._harmonics.degrees * (self._harmonics.degrees + n - 2.0))
        moved = 0.25 * (laplace @ growth - growth @ laplace) + 0.5 * n * growth
        moved = moved - 0.5 * float(np.trace(matrix)) * identity(laplace.shape[0])
        for (i, j), each in rotations.items():
            moved = moved + 0.5 * (matrix[i, j] - matrix[j, i]) * each
        return csr_matrix(moved)[:, self._harmonics.own], csr_matrix(growth)[:, self._harmonics.own]

    @property
    def _itself(self) -> csr_matrix:
        return identity(self._harmonics.degrees.size, format="csr")[:, self._harmonics.own]

    def _sum(self, parts: Sequence[tuple[float, csr_matrix]]) -> csr_matrix:
        return sum(size * each for size, each in parts)

    def _forms(self, forms: Sequence[Sequence[tuple[csr_matrix, csr_matrix]]]) -> list[FloatArray]:
        return [sum((left.T @ right).toarray() for left, right in form) for form in forms]

    @property
    def area(self) -> float:
        """The area of the sphere, as harmonics are orthonormal in the mean."""
        return 2 * math.pi ** (self.n / 2) / math.gamma(self.n / 2)

    def at(self, points: FloatArray) -> FloatArray:
        dimensions, most = self.dimensions, self.waves + 2
        sides = np.linalg.norm(points[: dimensions[0]], axis=0), np.linalg.norm(points[dimensions[0] :], axis=0)
        x = (sides[0] - sides[1]) * (sides[0] + sides[1])
        degrees = [group(k, most).degrees for k in dimensions]
        first, second = waves_at(dimensions, most, points)
        values, own_degrees = list[FloatArray](), list[IntArray]()
        for m, k in ((m, k) for m in np.unique(degrees[0]) for k in np.unique(degrees[1])):
            if (m + k) % 2 or m + k > most:
                continue
            rows = np.arange((most - m - k) // 2 + 1)
            alpha, beta = k + dimensions[1] / 2 - 1, m + dimensions[0] / 2 - 1
            own = sides[0] ** m * sides[1] ** k * eval_jacobi(rows[:, None], alpha, beta, x)
            own = own / np.sqrt(_mean_squares(rows, alpha, beta, dimensions))[:, None]
            of_pair = (first[degrees[0] == m][:, None] * second[degrees[1] == k]).reshape(-1, 1, x.size)
            values.append((of_pair * own).reshape(-1, x.size))
            own_degrees.append(np.tile(m + k + 2 * rows, len(of_pair)))
        by_degree = np.argsort(np.concatenate(own_degrees), kind="stable")
        return np.concatenate(values)[by_degree[self._harmonics.own]].T


def _mean_squares(degrees: IntArray, alpha: float, beta: float, dimensions: tuple[int, int]) -> FloatArray:
    """The means of cos^2m η sin^2k η P² over the sphere, of Jacobi polynomials P of some degrees."""
    low, high = (0.5 * each for each in dimensions)
    logs = gammaln(degrees + alpha + 1) + gammaln(degrees + beta + 1) - gammaln(degrees + 1)
    logs -= gammaln(degrees + alpha + beta + 1) + betaln(low, high)
    return np.asarray(np.exp(logs) / (2 * degrees + alpha + beta + 1))
