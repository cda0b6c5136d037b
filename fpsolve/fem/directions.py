"""Functions of the directions of three and four variables, with a stop or without, and what a motion does to them.

With x = r e and T = r^p u(e), ẋ = Xx gives ė = h and d ln r/dt = q. A direction is written by one angle between two
groups of coordinates and by a unit vector of each, e = (cos η e₁, sin η e₂), 0 ≤ η ≤ π/2, of the dimensions (2, 2) for
n = 4, Hopf's coordinates with e_i = (cos θ_i, sin θ_i), and (1, 2) for n = 3, where e₁ = ±1. With the blocks X_ij of a
matrix, t_i = de_i/dθ_i, a_ij = e_iᵀX_ij e_j, b_ij = t_iᵀX_ij e_j, c = cos η and s = sin η,

    h·∇ = (c² a₂₁ + cs (a₂₂ − a₁₁) − s² a₁₂) ∂η + (b₁₁ + b₁₂ tan η) ∂θ₁ + (b₂₂ + b₂₁ cot η) ∂θ₂
    q = c² a₁₁ + cs (a₁₂ + a₂₁) + s² a₂₂,      measure c^(n₁ − 1) s^(n₂ − 1) dη dθ₁ dθ₂,      div h = tr X − n q.

The functions are continuous elements in η times functions of e₁ times functions of e₂. Those of e₂ that are not
constant vanish at η = 0, where e₂ has no say, those of e₁ at η = π/2. There is no upwinding. A penalty on the jumps of
slopes between elements keeps spurious eigenvalues from the right of Λ: in the measure, with N the degree, h the mean
size of two elements, M the mean of the matrix over the noise and β = ½‖M + Mᵀ‖,

    −γ β Σ h² N⁻³ ∫ (cs)² [∂ηv] [∂ηu]      over the vertices in η, γ chosen.

On the whole sphere u is even, as x and −x are one direction: waves of θ₁ and θ₂ of even total degree.

With a stop, in its coordinates (q₁, v₁, q₂, v₂), q₁ ≥ 0, and v₁ becomes −R v₁ where q₁ falls to 0. With
−π/2 ≤ θ₁ ≤ π/2, q̇₁ = ω v₁ whatever the noise is, so that dθ₁/dt = −ω at both ends: paths leave at −π/2, where they
hit the wall, and come back at π/2,

    u(η, −π/2, θ₂) = ρ^p u(η′, π/2, θ₂),      ρ² = R² cos² η + sin² η,      tan η′ = tan η/R.

The functions of e₁ are continuous elements in θ₁, both of whose ends have values of their own. The wall is the point
load ω δ(θ₁ + π/2) (ρ^p u(η′, π/2, θ₂) − u): as the noise moves no path over it, one flux. Where the first mass is at
rest at the stop, η = π/2, impacts come ever faster, and T is a root of the distance. The penalty has s² in place of
(cs)², so that it holds there, too, and jumps of ∂u/∂θ₁ have one with 1/cos η.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csc_matrix, csr_matrix, diags, identity, kron
from scipy.sparse.linalg import LinearOperator

from fpsolve.arrays import Coefficient, FloatArray, IntArray, Mask, Matrix, one
from fpsolve.fem.axis import FunctionAxis, KroneckerSum, Rule, along
from fpsolve.fem.element import EXTRA_POINTS, gauss_legendre, halved, middles
from fpsolve.fem.line import LineSpace
from fpsolve.fem.terms import OfMoment, Term, Terms
from fpsolve.model.coordinates import mean_matrix
from fpsolve.model.plane import CoefficientMatrix
from fpsolve.model.problem import ParameterDerivative

SLOPE_PENALTY = 0.02
"""Factor γ of the penalty on jumps of slopes."""
HALVED_DEGREE = 10
"""Highest degree of an element: beyond, elements are halved."""
LEAST_POINTS = 32
"""Least number of points of a rule on a circle; every second one is looked at for signs."""
Parts = list[tuple[FloatArray, csr_matrix]]
"""Σ f(η) g(θ₁, θ₂): values at points of η, shape (points, nodes), and images of functions of both angles."""


@dataclass(frozen=True, eq=False)
class Angle:
    """Functions of a unit vector e, and their images in a space in which integrals are products.

    The space holds two factors of the components of e beside a function, too.

    Attributes:
        degrees: of each function; the first one is the constant 1, shape (size,).
        at: gives values at vectors along e, shape (m, size), from these, shape (dimension, m).
        points: unit vectors at which values tell the coefficients, shape (dimension, m).
        values, slopes: the images of the functions and of their ∂θ, shape (images, size).
        unit: what multiplies images by each component of e, shape (images, images).
        length: of all angles.
        jumps: the penalty on jumps of slopes, shape (size, size), of elements.
    """

    degrees: IntArray
    at: Callable[[FloatArray], FloatArray]
    points: FloatArray
    values: FloatArray
    slopes: FloatArray
    unit: Sequence[Matrix]
    length: float
    jumps: FloatArray | None = None

    @property
    def size(self) -> int:
        return self.degrees.size

    @property
    def tangent(self) -> Sequence[Matrix]:
        """What multiplies images by each component of de/dθ; functions of e = ±1 have no slopes."""
        return [-self.unit[-1], self.unit[0]][: len(self.unit)]


def signs(_: int) -> Angle:
    """The constant and the sign of e = ±1."""
    return Angle(
        degrees=np.arange(2),
        at=lambda e: np.stack([np.ones(e.shape[1]), np.copysign(1.0, e[0])], axis=1),
        points=np.array([[1.0, -1.0]]),
        values=np.eye(2),
        slopes=np.zeros((2, 2)),
        unit=[np.eye(2)[::-1]],
        length=2.0,
    )


def circle(most: int) -> Angle:
    """Waves up to a degree, orthonormal in the mean."""
    k = np.arange(1, most + 3)
    theta = np.linspace(0, 2 * math.pi, max(LEAST_POINTS, 2 * most + 8), endpoint=False)
    points, degrees = np.stack([np.cos(theta), np.sin(theta)]), np.append(0, np.repeat(k, 2))
    slope = block_diag(0.0, np.kron(np.diag(k), [[0.0, 1.0], [-1.0, 0.0]]))

    def every(e: FloatArray) -> FloatArray:
        waves = np.exp(1j * np.outer(np.arctan2(e[1], e[0]), k))
        return np.column_stack([np.ones(e.shape[1]), math.sqrt(2) * waves.view(float)])

    def multiplied(f: FloatArray) -> FloatArray:
        product = table.T @ (f[:, None] * table)
        return np.where(np.abs(product) > 1e-14, product, 0.0)

    table, size = every(points) / math.sqrt(points.shape[1]), 2 * most + 1
    return Angle(
        degrees=degrees[:size],
        at=lambda e: every(e)[:, :size],
        points=points,
        values=np.eye(degrees.size, size),
        slopes=slope[:, :size],
        unit=[multiplied(each) for each in points],
        length=2 * math.pi,
    )


ANGLES = {1: signs, 2: circle}
"""Functions of a unit vector on the whole circle, or of ±1, by its number of coordinates."""


def arc(lines: FloatArray, degree: int) -> Angle:
    """Elements on a part of a circle, with the constant in place of the function of the last vertex."""
    line, length = LineSpace(lines, degree), lines[-1] - lines[0]
    own = np.column_stack([line.constant(), np.delete(np.eye(line.size), line.ends[1], axis=1)])
    root = np.sqrt(line.measure / length)[:, None]
    unit = np.stack([np.cos(line.points), np.sin(line.points)])
    return Angle(
        degrees=np.append(0, np.delete(line.modes, line.ends[1])),
        at=lambda e: line.at(np.arctan2(e[1], e[0])) @ own,
        points=unit,
        values=root * (line.values @ own),
        slopes=root * (line.slopes @ own),
        unit=[diags(each) for each in unit],
        length=length,
        jumps=own.T @ _jumps(line, np.ones(lines.size - 2)) @ own / length,
    )


def _jumps(line: LineSpace, speeds: FloatArray) -> FloatArray:
    """Σ γ h² N⁻³ speed [u′] [v′] over the inner vertices."""
    inside = middles(line.lines)
    above, below = (line.at(ends, 1, inside).toarray() for ends in (line.lines[:-1], line.lines[1:]))
    jump, weights = above[1:] - below[:-1], SLOPE_PENALTY * np.diff(inside) ** 2 / line.degree**3 * speeds
    return jump.T @ (weights[:, None] * jump)


class DirectionTerms(Terms):
    """L(p) of three and four variables. Args as those of `Terms`."""

    words = "{0}h·∇", "{0}q", "½ (h·∇ + p q)² of white noise"

    @cached_property
    def _mean(self) -> FloatArray:
        """The matrix of the motion of y in the mean over the noise."""
        return self.phi.inside(mean_matrix(self._framed.problem, self.system))

    def _loads(self) -> Iterator[Term]:
        """The penalty, as slopes jump by the error of the elements alone."""
        size = np.linalg.norm(self._mean + self._mean.T, 2) / 2
        yield self._term(size * self.phi.penalty(), one, "penalty on jumps of ∂u/∂η")


class StopTerms(DirectionTerms):
    """L(p) of four variables with a stop. Args as those of `Terms`."""

    def growth_bound(self, p: float, noises: Sequence[Any]) -> float:
        stop: Any = self._framed.problem.linear.stop
        return super().growth_bound(p, noises) + abs(p * math.log(stop.restitution) * self._mean[0, 1])

    def _loads(self) -> Iterator[Term]:
        yield from super()._loads()
        yield self._stop(self.phi.struck, "ω (ρ^p T(η′, π/2, θ₂) − T) δ(θ₁ + π/2)")

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """ω is held, as it is that of the coordinates."""
        for log_factor in by.jumps:
            yield self._stop(self.phi.changed_impacts, "∂/∂θ", log_factor)

    def _stop(self, struck: Callable[[float, float, int], Matrix], text: str, size: float = 1.0) -> Term:
        stop: Any = self._framed.problem.linear.stop
        omega = self._mean[0, 1]
        words = f"{text}, ω = {omega:.6g}, R = {stop.restitution:.6g}"
        return self._term(lambda p, k: size * omega * struck(math.log(stop.restitution), p, k), one, words)


@dataclass(frozen=True, eq=False)
class DirectionAxis(FunctionAxis):
    """Elements in η times functions of e₁ and of e₂, see the module.

    Attributes:
        coordinates: S of y = S⁻¹x, whose directions they are of, n rows; the first group of coordinates first.
        lines: the vertices in η, shape (m + 1,).
        degree: of the elements in η.
        waves: the largest degree of a wave.
        ways: the names of the degrees by which functions are made finer.
    """

    coordinates: FloatArray
    lines: FloatArray = field()
    degree: int
    waves: int
    terms = DirectionTerms
    ways: ClassVar[tuple[str, ...]] = "degree", "waves"
    is_followed = True

    @cached_property
    def angles(self) -> tuple[Angle, Angle]:
        """The functions of e₁ and of e₂."""
        raise NotImplementedError

    @cached_property
    def _own(self) -> IntArray:
        """Which products of these there are."""
        raise NotImplementedError

    @property
    def levels(self) -> Sequence[IntArray]:
        """The degree of each function in each of the ways."""
        raise NotImplementedError

    @property
    def most_unknowns(self) -> int:  # type: ignore[override]
        """25,000 of three variables, 13,000 of four, whose LU fill in more."""
        return 13_000 + 12_000 * (len(self.coordinates) == 3)

    @property
    def dimensions(self) -> tuple[int, int]:
        """Of the two groups of coordinates."""
        return group_dimensions(len(self.coordinates))

    @property
    def size(self) -> int:
        return self._kept.size

    @property
    def facts(self) -> dict[str, Any]:
        return {"eta_cells": self.lines.size - 1, "eta_degree": self.degree, "waves": self.waves}

    def enriched(self) -> DirectionAxis:
        return self.finer(self.ways)

    def deeper(self, *ways: str) -> DirectionAxis:
        """Two degrees more in some ways."""
        return replace(self, **{way: getattr(self, way) + 2 for way in ways})

    def raised(self) -> DirectionAxis:
        return self.deeper("degree")

    def finer(self, ways: Collection[str], halved_ways: Collection[str] = ()) -> DirectionAxis:
        """The same, but elements of the highest degree, and some others, are halved."""
        found = self.deeper(*ways)
        for way, lines in (("degree", "lines"), ("first_degree", "first_lines")):
            if way in ways and (way in halved_ways or getattr(found, way) > HALVED_DEGREE):
                found = replace(found, **{way: getattr(found, way) // 2, lines: halved(getattr(self, lines))})
        return found

    def new_in(self, coarse: DirectionAxis) -> Mask:
        pairs = zip(self.ways, self.levels, strict=True)
        return np.any([level > getattr(coarse, way) for way, level in pairs], axis=0)

    @cached_property
    def line(self) -> LineSpace:
        """The elements in η."""
        first, second = (each - 1 for each in self.dimensions)

        def weight(eta: FloatArray) -> FloatArray:
            return np.cos(eta) ** first * np.sin(eta) ** second

        return LineSpace(self.lines, self.degree, weight, end_exponents=(second, first))

    @cached_property
    def _degrees(self) -> IntArray:
        """Of the functions of e₁ and of e₂ in each of their products, shape (2, products)."""
        degrees = np.meshgrid(*(each.degrees for each in self.angles), indexing="ij")
        return np.reshape(degrees, (2, -1))[:, self._own]

    @cached_property
    def _kept(self) -> IntArray:
        """Which functions of η times which of these products there are: where a vector has no say they are constant."""
        first, second = self._degrees
        kept = np.ones((self.line.size, first.size), dtype=bool)
        kept[self.line.ends[0], second > 0] = kept[self.line.ends[1], first > 0] = False
        return np.flatnonzero(kept)

    @cached_property
    def _places(self) -> tuple[IntArray, IntArray]:
        """The function of η, and the product of functions of e₁ and e₂, of each unknown."""
        node, product = np.divmod(self._kept, self._own.size)
        return node, product

    @cached_property
    def constant(self) -> FloatArray:
        constant = np.zeros((self.line.size, self._own.size))
        constant[:, 0] = self.line.constant()
        return constant.ravel()[self._kept]

    def mass(self, g: Coefficient = one) -> Matrix:
        return self._form((self._itself, self._itself))

    @cached_property
    def _images(self) -> tuple[csr_matrix, list[list[csr_matrix]], list[list[csr_matrix]]]:
        """Of u, of e_k e_m u and of t_k e_m ∂θ u, e and t with the components of both vectors."""
        first, second = self.angles
        ones = identity(len(first.values)), identity(len(second.values))

        def image(of_first: Matrix, of_second: Matrix) -> csr_matrix:
            return csr_matrix(csc_matrix(kron(of_first, of_second))[:, self._own])

        itself = image(first.values, second.values)
        unit = [kron(e, ones[1], "csr") for e in first.unit] + [kron(ones[0], e, "csr") for e in second.unit]
        turned = [kron(t, ones[1], "csr") @ image(first.slopes, second.values) for t in first.tangent]
        turned += [kron(ones[0], t, "csr") @ image(first.values, second.slopes) for t in second.tangent]
        both = [[e @ each for e in unit] for each in (itself, *turned)]
        return itself, [[e @ each for each in both[0]] for e in unit], both[1:]

    @cached_property
    def _tables(self) -> tuple[FloatArray, FloatArray]:
        """Values and slopes of the functions of η at its points."""
        return self.line.values.toarray(), self.line.slopes.toarray()

    @property
    def _itself(self) -> Parts:
        """u."""
        return [(self._tables[0], self._images[0])]

    def _moved(self, matrix: FloatArray) -> tuple[Parts, Parts]:
        """h·∇u and q u of a matrix."""
        itself, along, across = self._images
        first = self.dimensions[0]
        groups = range(first), range(first, len(matrix))

        def part(images: list[list[csr_matrix]], i: int, j: int) -> csr_matrix:
            return sum(
                (matrix[k, m] * images[k][m] for k in groups[i] for m in groups[j] if matrix[k, m]),
                csr_matrix(itself.shape),
            )

        a, b = ([[part(images, i, j) for j in (0, 1)] for i in (0, 1)] for images in (along, across))
        c, s = np.cos(self.line.points)[:, None], np.sin(self.line.points)[:, None]
        values, slopes = self._tables
        moved = [
            (c * c * slopes, a[1][0]),
            (c * s * slopes, a[1][1] - a[0][0]),
            (-s * s * slopes, a[0][1]),
            (values, b[0][0] + b[1][1]),
            (s / c * values, b[0][1]),
            (c / s * values, b[1][0]),
        ]
        return moved, [(c * c * values, a[0][0]), (c * s * values, a[0][1] + a[1][0]), (s * s * values, a[1][1])]

    def _form(self, *pairs: tuple[Parts, Parts]) -> csr_matrix:
        """∫ Σ v̂ û of functions of v and of u."""
        measure = self.line.measure[:, None]
        return self._assembled(
            [
                (of_v.T @ (measure * of_u), image_of_v.T @ image_of_u)
                for left, right in pairs
                for of_v, image_of_v in left
                for of_u, image_of_u in right
                if image_of_v.nnz and image_of_u.nnz
            ]
        )

    def _assembled(self, terms: Sequence[tuple[Matrix, Matrix]]) -> csr_matrix:
        """Σ A ⊗ B of matrices in η and in both angles, on the functions that there are."""
        return csr_matrix(KroneckerSum(terms).tocsc()[:, self._kept])[self._kept]

    def inside(self, matrix: Any) -> FloatArray:
        """S⁻¹AS."""
        return np.asarray(np.linalg.solve(self.coordinates, matrix @ self.coordinates))

    def motion(self, term: CoefficientMatrix) -> tuple[Matrix, Matrix]:
        """∫ v h·∇u and ∫ v q u."""
        moved, growth = self._moved(self.inside(term.matrix))
        return self._form((self._itself, moved)), self._form((self._itself, growth))

    def diffusion(self, a: CoefficientMatrix, b: CoefficientMatrix) -> tuple[Matrix, Matrix, Matrix]:
        """∫ v D_a D_b u, D = h·∇ + p q of two matrices, D* v = −h·∇v − tr v + (p + n) q v: by p⁰, p¹ and p²."""
        (moved, growth), (right, grown) = (self._moved(self.inside(each.matrix)) for each in (a, b))
        factors = (-1.0, moved), (len(self.coordinates), growth), (-np.trace(a.matrix), self._itself)
        adjoint = [(factor * of_eta, image) for factor, parts in factors for of_eta, image in parts]
        return (
            self._form((adjoint, right)),
            self._form((growth, right), (adjoint, grown)),
            self._form((growth, grown)),
        )

    def penalty(self) -> Matrix:
        """The penalty on jumps of slopes, over β."""
        in_eta = _jumps(self.line, self._speeds(np.cos(self.lines[1:-1]), np.sin(self.lines[1:-1])))
        return -self._assembled([(in_eta, self._images[0].T @ self._images[0])])

    def _speeds(self, c: FloatArray, s: FloatArray) -> FloatArray:
        """The measure times the weight of the penalty, (cs)²."""
        first, second = self.dimensions
        return c ** (first + 1) * s ** (second + 1)

    @property
    def area(self) -> float:
        """dσ/dμ of the surface of the sphere and the measure of the inner products, in which those of angles are 1."""
        first, second = self.angles
        return first.length * second.length

    @property
    def rule(self) -> Rule:
        """At some of the points of η, and at points of both angles, which are evenly spread."""
        inner, of_theta = (
            slice(None, None, max(1, self.degree // 4)),
            np.kron(*(each.at(each.points[:, ::2]) for each in self.angles)),
        )
        points, measure = self.line.points[inner], np.repeat(self.line.measure[inner], len(of_theta))
        return Rule(points, measure, self._along(self._tables[0][inner], of_theta[:, self._own]))

    def projection(self, other: DirectionAxis) -> LinearOperator:
        mixed = self.line.values.T @ diags(self.line.measure) @ other.line.at(self.line.points)
        of_eta = np.linalg.solve(self.line.mass().toarray(), mixed.toarray())
        of_theta = np.kron(
            *(
                np.linalg.pinv(new.at(new.points)) @ old.at(new.points)
                for new, old in zip(self.angles, other.angles, strict=True)
            )
        )
        return other._along(of_eta, of_theta[np.ix_(self._own, other._own)], self._kept)

    def _along(self, of_eta: FloatArray, of_theta: Any, kept: IntArray | slice = slice(None)) -> LinearOperator:
        """What matrices in η and in both angles make of functions, as far as it is kept."""

        def of_columns(columns: FloatArray) -> FloatArray:
            table = np.zeros((self.line.size * self._own.size, columns.shape[1]))
            table[self._kept] = columns
            table = along((of_eta, of_theta, None), table.reshape(self.line.size, self._own.size, -1))
            return table.reshape(-1, columns.shape[1])[kept]

        shape = np.arange(len(of_eta) * len(of_theta))[kept].size, self.size
        return LinearOperator(shape, matvec=lambda v: of_columns(v.reshape(-1, 1)), matmat=of_columns, dtype=float)

    def at(self, points: FloatArray) -> FloatArray:
        """Values at any directions y, shape (n, m), as rows of E with u(y) = E @ coefficients, shape (m, size)."""
        groups = np.split(points, [self.dimensions[0]])
        first, second = (np.linalg.norm(each, axis=0) for each in groups)
        of_eta = self.line.at(np.arctan2(second, first)).toarray()
        of_first, of_second = (angle.at(each) for angle, each in zip(self.angles, groups, strict=True))
        of_theta = np.einsum("xi,xj->xij", of_first, of_second).reshape(len(of_eta), -1)[:, self._own]
        return np.einsum("xi,xj->xij", of_eta, of_theta).reshape(len(of_eta), -1)[:, self._kept]


def group_dimensions(n: int) -> tuple[int, int]:
    """Of the two groups of coordinates."""
    return n // 2, (n + 1) // 2


@dataclass(frozen=True, eq=False)
class SphereAxis(DirectionAxis):
    """Those on the whole sphere, even ones."""

    @cached_property
    def angles(self) -> tuple[Angle, Angle]:
        first, second = (ANGLES[each](self.waves) for each in self.dimensions)
        return first, second

    @cached_property
    def _own(self) -> IntArray:
        sums = np.add.outer(*(each.degrees for each in self.angles)).ravel()
        return np.flatnonzero((sums % 2 == 0) & (sums <= self.waves))

    @property
    def levels(self) -> Sequence[IntArray]:
        return self.modes, self._degrees.sum(axis=0)[self._places[1]]

    @cached_property
    def cells(self) -> IntArray:
        """Elements in η: of the waves what two degrees more change tells."""
        return np.where(self.modes == 1, -1, self.line.cells[self._places[0]])

    @cached_property
    def modes(self) -> IntArray:
        return self.line.modes[self._places[0]]

    @cached_property
    def nested(self) -> csr_matrix:
        return self._assembled([(self.line.nested, identity(self._own.size))])


@dataclass(frozen=True, eq=False)
class HalfSphereAxis(DirectionAxis):
    """Those on the half sphere of a stop.

    Attributes:
        first_lines: the vertices in θ₁, from −π/2 to π/2.
        first_degree: of the elements in θ₁.
    """

    first_lines: FloatArray
    first_degree: int
    terms = StopTerms
    ways = "degree", "first_degree", "waves"
    has_adjoint = False

    @property
    def facts(self) -> dict[str, Any]:
        return super().facts | {"theta_cells": self.first_lines.size - 1, "theta_degree": self.first_degree}

    @cached_property
    def angles(self) -> tuple[Angle, Angle]:
        return arc(self.first_lines, self.first_degree), circle(self.waves)

    @cached_property
    def _own(self) -> IntArray:
        return np.arange(math.prod(each.size for each in self.angles))

    @property
    def levels(self) -> Sequence[IntArray]:
        node, product = self._places
        return self.line.modes[node], *self._degrees[:, product]

    def penalty(self) -> Matrix:
        (first, second), values = self.angles, self._tables[0]
        of_eta = values.T @ ((self.line.measure / np.cos(self.line.points))[:, None] * values)
        return super().penalty() - self._assembled([(of_eta, kron(first.jumps, identity(second.size)))])

    def _speeds(self, c: FloatArray, s: FloatArray) -> FloatArray:
        return c * s**3

    def struck(self, log_factor: float, p: float, derivative: int) -> Matrix:
        """∂ᵏ/∂pᵏ of ∫ v (ρ^p u(η′, π/2, θ₂) − u) over θ₁ = −π/2."""
        eta, weights, after, logs = self._impacts(log_factor)
        found = self._at_wall(eta, weights * OfMoment(0, logs)(p, derivative), self.line.at(after), 1)
        return found if derivative else found - self._at_wall(eta, weights, self.line.at(eta), 0)

    def changed_impacts(self, log_factor: float, p: float, derivative: int) -> Matrix:
        """The derivative by ln R of what `struck` gives."""
        eta, weights, after, logs = self._impacts(log_factor)
        longer = np.cos(after) ** 2 * OfMoment(1, logs)(p, derivative)
        turned = -np.sin(after) * np.cos(after) * OfMoment(0, logs)(p, derivative)
        moved = diags(longer) @ self.line.at(after) + diags(turned) @ self.line.at(after, 1)
        return self._at_wall(eta, weights, moved, 1)

    def _impacts(self, log_factor: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """η of a rule between the lines and what is taken to them, its weights, η′, and ln ρ."""
        r = math.exp(log_factor)
        cuts = np.unique(np.concatenate([self.lines, np.arctan2(r * np.sin(self.lines), np.cos(self.lines))]))
        cuts = cuts[np.append(True, np.diff(cuts) > 1e-12)]
        local, weights = gauss_legendre(self.degree + EXTRA_POINTS)
        sizes = np.diff(cuts)[:, None]
        eta = (cuts[:-1, None] + sizes * local).ravel()
        c, s = np.cos(eta), np.sin(eta)
        return eta, (sizes * weights).ravel() * c * s, np.arctan2(s, r * c), np.log(np.hypot(r * c, s))

    def _at_wall(self, eta: FloatArray, weights: FloatArray, of_u: csr_matrix, end: int) -> csr_matrix:
        """∫ v(η, −π/2, θ₂) u over η and θ₂, of values of u at points of η and at an end of θ₁."""
        first, second = self.angles
        ends = first.at(np.array([[0.0, 0.0], [-1.0, 1.0]])) / math.sqrt(first.length)
        of_theta = kron(np.outer(ends[0], ends[end]), identity(second.size))
        return self._assembled([(self.line.at(eta).T @ diags(weights) @ of_u, of_theta)])
