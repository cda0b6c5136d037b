"""Functions on the sphere of directions of linear systems of dimension 3 and 4, and the terms of their generators.

With x = r e and T = r^p u(e), ẋ = Xx gives ẇ = h·∂ and d ln r/dt = q. A direction is written by one angle between two
groups of coordinates and by a unit vector of each, e = (cos η e₁, sin η e₂), 0 ≤ η ≤ π/2, of the dimensions (2, 2) for
n = 4, Hopf's coordinates with e_i = (cos θ_i, sin θ_i), and (1, 2) for n = 3, where e₁ = ±1. With the blocks X_ij of a
matrix, t_i = de_i/dθ_i, a_ij = e_iᵀX_ij e_j, b_ij = t_iᵀX_ij e_j, c = cos η and s = sin η,

    h·∇ = (c² a₂₁ + cs (a₂₂ − a₁₁) − s² a₁₂) ∂η + (b₁₁ + b₁₂ tan η) ∂θ₁ + (b₂₂ + b₂₁ cot η) ∂θ₂
    q = c² a₁₁ + cs (a₁₂ + a₂₁) + s² a₂₂,      measure c^(n₁ − 1) s^(n₂ − 1) dη dθ₁ dθ₂,      div h = tr X − n q.

u is even, as x and −x are one direction: continuous elements in η times waves of θ₁ and θ₂ of even total degree; waves
of θ₂ vanish at η = 0, where e₂ has no say, those of θ₁ at η = π/2. Without upwinding pairs that no path has may lie on
the right: jumps of ∂u/∂η between elements are penalised by γ h² N⁻³ β (cs)², β the norm of the growth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import LinearOperator

from fpsolve.arrays import Coefficient, FloatArray, IntArray, Matrix, one
from fpsolve.fem.axis import Axis, along, on_one_pattern, product_pattern
from fpsolve.fem.line import LineSpace
from fpsolve.fem.mesh import halved
from fpsolve.fem.space import Space
from fpsolve.fem.terms import NoiseTerms, OfMoment, Term
from fpsolve.model.plane import CoefficientMatrix, written_coefficient
from fpsolve.model.problem import Problem

PENALTY = 0.02
"""Factor γ of the penalty on jumps of ∂u/∂η."""
MOST_DEGREE = 10
"""Highest degree of an element in η: beyond, elements are halved."""
SIDE = 16
"""Least number of points along each angle at which signs are looked at."""
Coordinates = tuple[tuple[float, ...], ...]
Parts = list[tuple[FloatArray, csr_matrix]]
"""Σ f(η) ⊗ g: values at points of η, shape (points, nodes), and waves, shape (all, own)."""


def group_dimensions(n: int) -> tuple[int, int]:
    """Of the two groups of coordinates."""
    return n // 2, (n + 1) // 2


@dataclass(frozen=True, eq=False)
class Waves:
    """Real waves of the angles of both groups, orthonormal in the mean, with all to which two factors of e_i lead.

    Attributes:
        first, second: for each the degree in θ₁ and in θ₂.
        own: which of them a function may have, of total degrees up to the largest; the first is constant.
        along: for each pair (i, j) the matrices of multiplication by the products of the components of e_i and e_j.
        across: the same for t_i and e_j; nothing for i of dimension 1.
        slopes: for each group ∂/∂θ_i; None for one of dimension 1.
        samples: their values at some angles, shape (points, waves).
    """

    first: IntArray
    second: IntArray
    own: IntArray
    along: dict[tuple[int, int], list[list[csr_matrix]]]
    across: dict[tuple[int, int], list[list[csr_matrix]]]
    slopes: tuple[csr_matrix | None, csr_matrix | None]
    samples: FloatArray

    @staticmethod
    @lru_cache(maxsize=16)
    def of(dimensions: tuple[int, int], most: int) -> Waves:
        """Those up to a total degree."""
        reach = most + 2
        groups = [group(dimension, reach) for dimension in dimensions]
        first, second = (np.ravel(each) for each in np.meshgrid(*(each.degrees for each in groups), indexing="ij"))
        kept = np.flatnonzero(((first + second) % 2 == 0) & (first + second <= reach))

        def product(*factors: Matrix) -> csr_matrix:
            return csr_matrix(scipy.sparse.kron(*map(csr_matrix, factors)))[kept][:, kept]

        ones = [np.eye(each.degrees.size) for each in groups]

        def products(i: int, lefts: Sequence[FloatArray], j: int) -> list[list[csr_matrix]]:
            def of_pair(left: FloatArray, right: FloatArray) -> csr_matrix:
                factors = [*ones]
                factors[i] = left
                factors[j] = factors[j] @ right if i == j else right
                return product(*factors)

            return [[of_pair(left, right) for right in groups[j].unit] for left in lefts]

        pairs = [(i, j) for i in (0, 1) for j in (0, 1)]
        slopes = [each.slope for each in groups]
        first, second = first[kept], second[kept]
        return Waves(
            first,
            second,
            np.flatnonzero(first + second <= most),
            {(i, j): products(i, groups[i].unit, j) for i, j in pairs},
            {(i, j): products(i, groups[i].tangent, j) for i, j in pairs if groups[i].tangent},
            (
                None if slopes[0] is None else product(slopes[0], ones[1]),
                None if slopes[1] is None else product(ones[0], slopes[1]),
            ),
            np.asarray(np.kron(groups[0].samples, groups[1].samples)[:, kept], dtype=float),
        )


@dataclass(frozen=True, eq=False)
class Group:
    """Waves of one unit vector: of their degrees, multiplication by components of it and of its tangent, and ∂θ."""

    degrees: IntArray
    unit: list[FloatArray]
    tangent: list[FloatArray]
    slope: FloatArray | None
    samples: FloatArray


def group(dimension: int, most: int) -> Group:
    """Those up to a degree."""
    if dimension == 1:  # functions of ±1
        signs = np.array([[1.0, 1.0], [1.0, -1.0]])
        return Group(np.arange(2), [np.array([[0.0, 1.0], [1.0, 0.0]])], [], None, signs)
    k = np.arange(1, most + 1)
    degrees = np.concatenate([[0], np.repeat(k, 2)])

    def values(count: int) -> tuple[FloatArray, FloatArray]:
        theta = 2 * np.pi * np.arange(count) / count
        waves = math.sqrt(2) * np.stack([np.cos(np.outer(theta, k)), np.sin(np.outer(theta, k))], axis=2)
        return theta, np.column_stack([np.ones(count), waves.reshape(count, -1)])

    theta, table = values(2 * most + 4)

    def multiplied(f: FloatArray) -> FloatArray:
        product = table.T @ (f[:, None] * table) / theta.size
        return np.where(np.abs(product) > 1e-14, product, 0.0)

    slope = np.zeros((degrees.size, degrees.size))
    cosines, sines = 2 * k - 1, 2 * k
    slope[sines, cosines], slope[cosines, sines] = -k, k
    unit = [multiplied(np.cos(theta)), multiplied(np.sin(theta))]
    return Group(degrees, unit, [-unit[1], unit[0]], slope, values(max(SIDE, most))[1])


@dataclass(frozen=True, eq=False)
class DirectionAxis(Axis):
    """Functions of directions, and what a matrix X does to them: h·∇u and q u of ẋ = Xx.

    Attributes:
        coordinates: S of y = S⁻¹x, whose directions they are of, n rows; the first group of coordinates first.
    """

    coordinates: Coordinates
    most_unknowns = 20_000

    @property
    def n(self) -> int:
        """The dimension."""
        return len(self.coordinates)

    @property
    def dimensions(self) -> tuple[int, int]:
        """Of the two groups of coordinates."""
        return group_dimensions(self.n)

    @property
    def degrees(self) -> IntArray:
        """The total degree of the wave, or of the harmonic, of each unknown, shape (size,)."""
        raise NotImplementedError

    @property
    def identity(self) -> Matrix:
        """∫ u v, shape (size, size)."""
        raise NotImplementedError

    def mass(self, g: Coefficient = one) -> Matrix:
        return self.identity

    def _moved(self, matrix: FloatArray) -> tuple[Any, Any]:
        """h·∇u and q u of a matrix."""
        raise NotImplementedError

    @property
    def _itself(self) -> Any:
        """u."""
        raise NotImplementedError

    def _sum(self, parts: Sequence[tuple[float, Any]]) -> Any:
        """Of multiples of what `_moved` gives."""
        return [(size * first, *others) for size, each in parts for first, *others in each]

    def _product(self, left: Any, right: Any) -> tuple[Matrix, Matrix, Matrix]:
        """Of a part of v and one of u: the matrices in each direction."""
        raise NotImplementedError

    @property
    def _kept(self) -> IntArray:
        """Which products of functions of each direction there are."""
        raise NotImplementedError

    def _forms(self, forms: Sequence[Sequence[tuple[Any, Any]]]) -> Sequence[Matrix]:
        """For each form ∫ Σ v̂ û of functions of v and of u."""
        pairs = [[(a, b) for left, right in form for a in left for b in right] for form in forms]
        return assembled([[self._product(a, b) for a, b in form] for form in pairs], self._kept)

    def driven(self, matrix: FloatArray) -> tuple[Matrix, Matrix]:
        """∫ v h·∇u and ∫ v q u."""
        moved, growth = self._moved(matrix)
        found, stretched = self._forms([[(self._itself, moved)], [(self._itself, growth)]])
        return found, stretched

    def diffusion(self, a: FloatArray, b: FloatArray) -> tuple[Matrix, Matrix, Matrix]:
        """∫ v D_a D_b u, D = h·∇ + p q of two matrices, D* v = −h·∇v − tr v + (p + n) q v: by p⁰, p¹ and p²."""
        (moved, growth), (right, grown) = self._moved(a), self._moved(b)
        adjoint = self._sum([(self.n, growth), (-1.0, moved), (-float(np.trace(a)), self._itself)])
        free, linear, square = self._forms([[(adjoint, right)], [(growth, right), (adjoint, grown)], [(growth, grown)]])
        return free, linear, square

    def penalty(self) -> Matrix:
        """What is added against pairs that no path has."""
        return 0.0 * self.identity

    @property
    def area(self) -> float:
        """dσ/dμ of the surface of the sphere and the measure of the inner products."""
        raise NotImplementedError

    def at(self, points: FloatArray) -> Matrix:
        """Values at any directions y, shape (n, m), as rows of E with u(y) = E @ coefficients, shape (m, size)."""
        raise NotImplementedError


def assembled(forms: Sequence[Sequence[tuple[Matrix, Matrix, Matrix]]], kept: IntArray) -> list[csr_matrix]:
    """For each form Σ A_k ⊗ B_k ⊗ C_k on the products that are kept, sparse, on one pattern."""
    factors = zip(*(term for form in forms for term in form), strict=True)
    (first, firsts), (middle, middles), (last, lasts) = (on_one_pattern([each.T for each in own]) for own in factors)
    inner_order, rows, starts = product_pattern(first, middle)
    size = first.shape[0] * middle.shape[0]
    order, rows, starts = product_pattern(csc_matrix((np.ones(rows.size), rows, starts), shape=(size, size)), last)
    place = np.full(starts.size - 1, -1)
    place[kept] = np.arange(kept.size)
    is_kept = np.repeat(place >= 0, np.diff(starts)) & (place[rows] >= 0)
    order, rows, starts = order[is_kept], place[rows[is_kept]], np.append(0, np.cumsum(is_kept))[starts]
    starts = np.append(starts[:-1][kept], starts[-1])
    found, ends = list[csr_matrix](), np.cumsum([0, *map(len, forms)])
    for own in map(slice, ends[:-1], ends[1:]):
        before = (firsts[own, :, None] * middles[own, None, :]).reshape(len(firsts[own]), -1)
        data = (before[:, inner_order].T @ lasts[own]).ravel()[order]
        found.append(csr_matrix((data, rows, starts), shape=(kept.size, kept.size), copy=True))
        found[-1].eliminate_zeros()
    return found


@dataclass(frozen=True, eq=False)
class SphereAxis(DirectionAxis):
    """Continuous elements in η times waves of the other angles, see the module.

    Attributes:
        lines: the vertices in η, shape (m + 1,).
        degree: of the elements.
        waves: the largest total degree of a wave, even.
    """

    lines: FloatArray = field()
    degree: int
    waves: int

    @cached_property
    def size(self) -> int:
        nodes = (self.lines.size - 1) * self.degree + 1
        return nodes * self._waves.own.size - sum(int(np.count_nonzero(each)) for each in self._wave_degrees)

    @property
    def elements(self) -> int:
        """How many there are in η."""
        return self.lines.size - 1

    @property
    def facts(self) -> dict[str, Any]:
        return {"eta_cells": self.elements, "eta_degree": self.degree, "waves": self.waves}

    def enriched(self) -> SphereAxis:
        """Two degrees more in every direction."""
        return replace(self, waves=self.waves + 2).finer_elements()

    def finer_elements(self) -> SphereAxis:
        """Two degrees more in η, where there are none left elements of half the size."""
        if self.degree + 2 <= MOST_DEGREE:
            return replace(self, degree=self.degree + 2)
        return replace(self, lines=halved(self.lines), degree=MOST_DEGREE // 2 + 2)

    @cached_property
    def line(self) -> LineSpace:
        """The elements in η."""
        first, second = self.dimensions

        def weight(eta: FloatArray) -> FloatArray:
            return np.cos(eta) ** (first - 1) * np.sin(eta) ** (second - 1)

        return LineSpace(self.lines, self.degree, weight, end_exponents=(second - 1, first - 1), is_flat=True)

    @cached_property
    def _waves(self) -> Waves:
        return Waves.of(self.dimensions, self.waves)

    @property
    def _wave_degrees(self) -> tuple[IntArray, IntArray]:
        """Degrees in θ₁ and in θ₂ of the own waves."""
        return self._waves.first[self._waves.own], self._waves.second[self._waves.own]

    @cached_property
    def _kept(self) -> IntArray:
        """Which products of a function of η and a wave there are: waves vanish where their vector has no say."""
        first, second = self._wave_degrees
        kept = np.ones((self.line.size, first.size), dtype=bool)
        kept[self.line.ends[0], second > 0] = kept[self.line.ends[1], first > 0] = False
        return np.flatnonzero(kept)

    @cached_property
    def _node(self) -> IntArray:
        """The function of η of each unknown."""
        return self._kept // self._waves.own.size

    @cached_property
    def degrees(self) -> IntArray:
        first, second = self._wave_degrees
        return (first + second)[self._kept % self._waves.own.size]

    @cached_property
    def cells(self) -> IntArray:
        """Elements in η: of the waves what two degrees more change tells."""
        return np.where(self.modes == 1, -1, self.line.cells[self._node])

    @cached_property
    def modes(self) -> IntArray:
        return self.line.modes[self._node]

    @cached_property
    def nested(self) -> csr_matrix:
        return self._on_kept(self.line.nested)

    @cached_property
    def constant(self) -> FloatArray:
        constant = np.zeros((self.line.size, self._waves.own.size))
        constant[:, 0] = self.line.constant()
        return constant.ravel()[self._kept]

    @cached_property
    def identity(self) -> Matrix:
        return self._forms([[(self._itself, self._itself)]])[0]

    @property
    def unit(self) -> Matrix:
        return self.identity

    @property
    def _slices(self) -> tuple[slice, slice]:
        """The two groups of coordinates."""
        return slice(0, self.dimensions[0]), slice(self.dimensions[0], None)

    def _on_kept(self, of_line: csr_matrix) -> csr_matrix:
        whole = scipy.sparse.kron(of_line, scipy.sparse.identity(self._waves.own.size), format="csr")
        return whole[self._kept][:, self._kept]

    @property
    def inner_values(self) -> LinearOperator:
        samples, points = self._waves.samples[:, self._waves.own], self.line.values[:: max(1, self.degree // 4)]

        def of_columns(columns: FloatArray) -> FloatArray:
            table = np.zeros((self.line.size * self._waves.own.size, columns.shape[1]))
            table[self._kept] = columns
            found = along((points, samples, None), table.reshape(self.line.size, self._waves.own.size, -1))
            return found.reshape(-1, columns.shape[1])

        shape = points.shape[0] * len(samples), self.size
        return LinearOperator(shape, matvec=lambda v: of_columns(v.reshape(-1, 1)), matmat=of_columns, dtype=float)

    def projection(self, other: SphereAxis) -> Matrix:
        """In η by the inner product, of waves those that both have."""
        of_line = self.line.values.T @ diags(self.line.measure) @ other.line.at(self.line.points)
        nodes = scipy.sparse.linalg.spsolve(self.line.mass().tocsc(), csr_matrix(of_line).tocsc())
        own = {each: k for k, each in enumerate(self._labels)}
        pairs = np.array([(own[each], k) for k, each in enumerate(other._labels) if each in own])
        shape = self._waves.own.size, other._waves.own.size
        shared = csr_matrix((np.ones(len(pairs)), pairs.T), shape=shape)
        return scipy.sparse.kron(nodes, shared, format="csr")[self._kept][:, other._kept]

    @cached_property
    def _labels(self) -> list[tuple[int, ...]]:
        """For each wave its degrees, and which of those with the same it is."""
        counts: dict[tuple[int, int], int] = {}
        found = []
        for pair in zip(
            *(each[self._waves.own].tolist() for each in (self._waves.first, self._waves.second)), strict=True
        ):
            counts[pair] = counts.get(pair, -1) + 1
            found.append((*pair, counts[pair]))
        return found

    def _moved(self, matrix: FloatArray) -> tuple[Parts, Parts]:
        """h·∇u and q u of a matrix."""
        eta, slices = self.line.points, self._slices
        c, s = np.cos(eta)[:, None], np.sin(eta)[:, None]

        def form(table: dict[tuple[int, int], list[list[csr_matrix]]], i: int, j: int) -> Matrix:
            block = matrix[slices[i], slices[j]]
            return sum(size * table[i, j][k][m] for (k, m), size in np.ndenumerate(block))

        a = {pair: form(self._waves.along, *pair) for pair in self._waves.along}
        b = {pair: form(self._waves.across, *pair) for pair in self._waves.across}
        values, slopes, own = self.line.values.toarray(), self.line.slopes.toarray(), self._waves.own
        moved = [(c * c * slopes, a[1, 0]), (c * s * slopes, a[1, 1] - a[0, 0]), (-s * s * slopes, a[0, 1])]
        for i, ratio in ((0, s / c), (1, c / s)):
            if (turn := self._waves.slopes[i]) is not None:
                moved += [(values, b[i, i] @ turn), (ratio * values, b[i, 1 - i] @ turn)]
        growth = [(c * c * values, a[0, 0]), (c * s * values, a[0, 1] + a[1, 0]), (s * s * values, a[1, 1])]
        return [(of_eta, of[:, own]) for of_eta, of in moved], [(of_eta, of[:, own]) for of_eta, of in growth]

    def _product(self, left: Any, right: Any) -> tuple[Matrix, Matrix, Matrix]:
        return left[0].T @ (self.line.measure[:, None] * right[0]), np.ones((1, 1)), left[1].T @ right[1]

    @property
    def _itself(self) -> Parts:
        """u."""
        every = scipy.sparse.identity(self._waves.first.size, format="csc")
        return [(self.line.values.toarray(), every[:, self._waves.own])]

    def penalty(self) -> Matrix:
        """−Σ γ h² N⁻³ (cs)² w [∂u/∂η] [∂v/∂η] over the inner vertices."""
        inner, sizes, degree = self.line.lines[1:-1], np.diff(self.line.lines), self.degree
        first, second = self.dimensions
        weights = PENALTY * (0.5 * (sizes[1:] + sizes[:-1])) ** 2 / degree**3
        weights = weights * np.cos(inner) ** (first + 1) * np.sin(inner) ** (second + 1)
        jump = self.line.jumps_of_slope().toarray()
        of_line = -(jump.T @ (weights[:, None] * jump))
        return assembled([[(of_line, np.ones((1, 1)), np.eye(self._waves.own.size))]], self._kept)[0]

    @property
    def area(self) -> float:
        """|S^(n₁ − 1)| |S^(n₂ − 1)|, as waves are orthonormal in the mean over both groups."""
        return math.prod(2 * math.pi ** (k / 2) / math.gamma(k / 2) for k in self.dimensions)

    def at(self, points: FloatArray) -> csr_matrix:
        first, second = (points[each] for each in self._slices)
        on_line = self.line.at(np.arctan2(np.linalg.norm(second, axis=0), np.linalg.norm(first, axis=0)))
        first_waves, second_waves = waves_at(self.dimensions, self.waves + 2, points)
        of_first, of_second = np.divmod(self._of_product, len(second_waves))
        of_waves = (first_waves[of_first] * second_waves[of_second]).T
        shape = len(of_waves), self.degree + 1
        nodes, values = (each.reshape(shape) for each in (on_line.indices, on_line.data))
        place = np.full(self.line.size * self._waves.own.size, -1)
        place[self._kept] = np.arange(self.size)
        columns = place[nodes[:, :, None] * self._waves.own.size + np.arange(self._waves.own.size)]
        entries = np.where(columns >= 0, values[:, :, None] * of_waves[:, None, :], 0.0)
        starts = np.arange(len(entries) + 1) * math.prod(entries.shape[1:])
        return csr_matrix((entries.ravel(), np.maximum(columns, 0).ravel(), starts), shape=(len(entries), self.size))

    @cached_property
    def _of_product(self) -> IntArray:
        """Where the waves that functions have are among all products of one of `waves_at` of each group."""
        reach = self.waves + 2
        first, second = (group(k, reach).degrees for k in self.dimensions)
        sums = np.add.outer(first, second).ravel()
        return np.flatnonzero((sums % 2 == 0) & (sums <= reach))[self._waves.own]


def waves_at(dimensions: tuple[int, int], most: int, points: FloatArray) -> list[FloatArray]:
    """The waves of each of both groups up to a degree, at directions; shape (waves, m)."""
    tables, start = list[FloatArray](), 0
    for dimension in dimensions:
        own, start = points[start : start + dimension], start + dimension
        if dimension == 1:
            tables.append(np.stack([np.ones(own.shape[1]), np.where(own[0] < 0, -1.0, 1.0)]))
            continue
        turns = np.outer(np.arange(1, most + 1), np.arctan2(own[1], own[0]))
        waves = math.sqrt(2) * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        tables.append(np.vstack([np.ones(turns.shape[1]), waves.reshape(-1, turns.shape[1])]))
    return tables


class SphereTerms(NoiseTerms):
    """L(p) of three and four variables. Args as those of `NoiseTerms`."""

    def __init__(self, problem: Problem, space: Space) -> None:
        super().__init__(problem, space)
        coordinates = np.array(self.phi.coordinates)
        self._coordinates, self._inverse = coordinates, np.linalg.inv(coordinates)

    def _own(self, term: CoefficientMatrix) -> FloatArray:
        """S⁻¹AS."""
        return np.asarray(self._inverse @ np.array(term.matrix) @ self._coordinates)

    def matrix(self, term: CoefficientMatrix) -> FloatArray:
        """ε^n S⁻¹AS."""
        return self.system.epsilon**term.order * self._own(term)

    def _loads(self) -> Iterator[Term]:
        """The penalty, as ∂u/∂η jumps by the error of the elements alone."""
        free = sum((self._own(term) for term in self.system.terms if term.order == 0), 0.0 * self._inverse)
        size = float(np.linalg.norm(free + free.T, 2)) / 2
        yield self._term(size * self.phi.penalty(), one, "penalty on jumps of ∂u/∂η")

    def _driven(self, term: CoefficientMatrix) -> Iterator[Term]:
        """h·∇ + p q."""
        moved, growth = self.phi.driven(self.matrix(term))
        text = written_coefficient(term.g)
        yield self._term(moved, term.g, f"{text}h·∇", order=term.order, of=term.noise)
        yield self._term(growth, term.g, f"p {text}q", OfMoment(1), term.order, term.noise)
