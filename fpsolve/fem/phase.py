"""Functions of the phase φ: discontinuous elements, in each cell polynomials up to a degree of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix, diags, identity, issparse

from fpsolve.arrays import FloatArray, IntArray, Matrix, one
from fpsolve.errors import MeshError
from fpsolve.fem.axis import FEW_UNKNOWNS, DividedAxis, Rule
from fpsolve.fem.element import (
    EXTRA_POINTS,
    differentiation,
    gauss_legendre,
    legendre,
    located,
    middles,
)
from fpsolve.fem.mesh import SAME_LINE
from fpsolve.fem.terms import At, OfMoment, Term, Terms
from fpsolve.messages import Code, Message
from fpsolve.model.coordinates import Framed
from fpsolve.model.plane import (
    CoefficientMatrix,
    Harmonics,
    Impulse,
    Jump,
    LinearMotion,
    changed_exponential,
    is_driven,
    turning,
)
from fpsolve.model.problem import ParameterDerivative

PENALTY = 2.0
"""Factor η·size/(degree + 1)² of the interior penalty method."""
STRIPS = 32
"""Number of parts of the domain in each of which an impulse is integrated before and after it."""


def vertices_at(lines: FloatArray, phase: float) -> IntArray:
    """The indices of the φ-lines lines[:-1] at φ and φ + π. Raises `MeshError` where one is missing."""
    found = np.flatnonzero(np.abs(np.sin(lines[:-1] - phase)) < SAME_LINE)
    turns = round((lines[-1] - lines[0]) / math.pi)
    if found.size != turns:
        name = "pi/2" if phase == math.pi / 2 else f"{phase:.6g}"
        raise MeshError(Message(Code.NO_IMPACT_LINE, wanted=turns, place=name, found=found.size))
    return found


class Struck(NamedTuple):
    """What an impulse does at the points of a rule.

    Attributes:
        points: of the rule, shape (n,).
        logs: ln |exp(B)e|, shape (n,).
        at: the functions at the points, times the weights of the rule, shape (n, size).
        end: the functions where it takes the points, shape (n, size).
    """

    points: FloatArray
    logs: FloatArray
    at: csr_matrix
    end: csr_matrix


class Wall(NamedTuple):
    """A jump, the speed v of the phase at its ray φ_j, and δ(φ − φ_j): w(φ⁻) T(φ⁺) for v > 0, else w(φ⁺) T(φ⁻)."""

    jump: Jump
    speed: float
    delta: Matrix


class PlaneTerms(Terms):
    """L(p) of two variables. Args as those of `Terms`.

    The motion and the walls add, with the phase speed v = Σ ε^n g h, h = e′ᵀA e, the jump [T] = T(φ⁺) − T(φ⁻) and the
    mean {T} of the two traces at a φ-vertex,

        Σ over cells:                       ∫∫ P_s w (v ∂φT + p Σ ε^n g q T) dφ dξ
        Σ over vertices without a wall:     ∫ P_s (v {w} [T] − ½θ [w] [T]) dξ
        Σ over walls:                       ∫ P_s |v| w (R^p T₊ − T₋) dξ

    Upwinding is θ = |v|; where v has one sign for all ξ the first two loads are v w [T] with w of the cell that paths
    leave. Polynomials of ξ cannot follow the kink of |v|: θ is then its size for the typical ξ, |Σ ε^n h| over the
    terms that no noise drives + Σ ε^n |h| (mean of g²)^½ over the others. At a wall v is one number for all ξ. Paths go
    from the trace T₋ there, also that of w, to T₊, and T₋ = R^p T₊. The load is written as (R^p − 1)|v| δ(φ − φ_j) T₊,
    but made of R^p alone, as a tiny R^p would be rounded beside 1.

    White noise: see `PhaseAxis.diffusion`. Impulses exp(B) add their rate times |exp(B)e|^p T(ψ) − T, ψ being where
    they take φ, see `PhaseAxis.impulses`.
    """

    words = "{0}{1.h} ∂φ", "{0}{1.q}", "½ (h ∂φ + p q)² of white noise, h = {1.h}, q = {1.q}"

    def __init__(self, framed: Framed, phi: PhaseAxis, noises: Sequence[Any]) -> None:
        super().__init__(framed, phi, noises)
        system, self._vertices, (left, right) = self.system, phi.lines[:-1], phi.traces
        self._jump = right - left
        steady, driven = np.zeros(self._vertices.size), np.zeros(self._vertices.size)
        for term in system.terms:
            speed, xi = system.epsilon**term.order * term.h(self._vertices), noises[self.place(term.noise)]
            if not is_driven(term.g):
                steady += float(term.g(0.0)) * speed
            else:
                square = xi.constant @ (xi.product(term.g(xi.xi) ** 2) @ xi.constant)
                driven += abs(speed) * math.sqrt(square / (xi.constant @ (xi.matrix(one) @ xi.constant)))
        self._upwinding = abs(steady) + driven  # for the typical ξ
        after_walls = 0.0 * self._jump  # |v| T₊ is in the term of the wall
        # where θ = |v| for every ξ, and the sign of v where that is the same for all ξ, otherwise 0
        is_pointwise, direction = np.full(self._vertices.size, False), np.zeros(self._vertices.size)
        if all(axis.is_local for axis in noises):
            rates = system.matrix_at(framed.problem.valued.combined([axis.xi for axis in noises]))
            speed = turning(rates.reshape(-1, 1, 2, 2))(self._vertices)
            is_pointwise, direction = ~is_pointwise, 1.0 * np.all(speed > 0, axis=0) - np.all(speed < 0, axis=0)
        self._walls = []
        for jump, v in zip(system.jumps, framed.wall_speeds(system), strict=True):
            at = vertices_at(phi.lines, jump.phase)
            is_pointwise[at], direction[at] = True, math.copysign(1.0, v)
            before, after = (left, right) if v > 0 else (right, left)
            self._walls.append(Wall(jump, v, before[at].T @ after[at]))
            at_wall = np.where(np.isin(np.arange(self._vertices.size), at), math.copysign(1.0, v), 0.0)
            after_walls = after_walls + by_rows(at_wall, after)
        self._free_jump, self._two_way = self._jump - after_walls, np.flatnonzero(is_pointwise & (direction == 0))
        self._upwinding[is_pointwise] = 0.0
        # nothing is left of the other side: where ξ is large that would count
        self._leaving = 0.5 * (left + right) - by_rows(0.5 * direction, self._jump)

    @property
    def keeps_constants(self) -> bool:  # type: ignore[override]
        for term in (*self.system.terms, *self.system.diffusions):
            if term.order == 0 and (term.h.amplitude or not term.q.vanishes):
                return False
        return True

    def growth_bound(self, p: float, noises: Sequence[Any]) -> float:
        total = super().growth_bound(p, noises)
        for each in self.system.impulses:
            total += each.rate * math.exp(abs(p) * each.strength)
        for ray, v, _ in self._walls:
            total += abs(p * ray.log_factor * v)
        return total

    def _loads(self) -> Iterator[Term]:
        for struck in self.system.impulses:
            yield self._struck(struck)
        # −½ ∫ P_s θ [w] [T] at the φ-vertices where the phase runs both ways, or θ is not |v|
        text, jump = "upwind loads between cells", self._jump
        if np.any(self._upwinding):
            yield self._term(-0.5 * jump.T @ by_rows(self._upwinding, jump), one, text)
        yield from self._upwind(text)
        for ray, v, delta in self._walls:
            text = f"(R^p − 1) |dφ/dt| δ(φ − {ray.phase:.6g} mod π), R = {math.exp(ray.log_factor):.6g}"
            yield self._term(abs(v) * delta, one, text, OfMoment(0, ray.log_factor), order=2, is_wall=True)

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """Upwinding is held: [T] = 0 at a vertex but for the error of the elements."""
        text, moved = "∂/∂θ", LinearMotion(by.terms, epsilon=self.system.epsilon)
        for struck, moved_by in zip(self.system.impulses, by.impulses, strict=bool(by.impulses)):
            yield self._struck(struck, moved_by)
        faster = self._framed.wall_speeds(moved)
        for k, (ray, v, delta) in enumerate(self._walls):
            if by.jumps:
                yield self._term(by.jumps[k] * abs(v) * delta, one, text, OfMoment(1, ray.log_factor), order=2)
            of_p = OfMoment(0, ray.log_factor)
            yield self._term(math.copysign(1.0, v) * faster[k] * delta, one, text, of_p, order=2)

    def _matrices(self, term: CoefficientMatrix) -> tuple[Matrix, Matrix]:
        """h ∂φ with the loads at the φ-vertices, and q."""
        loads = self._leaving.T @ by_rows(term.h(self._vertices), self._free_jump)
        return self.phi.convection(term.h) + loads, self.phi.mass(term.q)

    def _struck(self, of: Impulse, by: Impulse | None = None) -> Term:
        """An impulse, or ∂/∂θ of it."""
        struck = self.phi.struck(of)

        def phase_at(p: float, derivative: int) -> Matrix:
            rate = of.rate if by is None else by.rate
            total = 0.0 if by is None else of.rate * self.phi.changed_impulses(struck, of, by, p, derivative)
            if rate:
                total = total + rate * self.phi.impulses(struck, p, derivative)
                total = total if derivative else total - rate * self.phi.matrix(one)
            return total

        stretch = ", ".join(f"{size:.3g}" for size in np.linalg.svd(of.matrix, compute_uv=False))
        text = f"{of.rate:.6g} (|Me|^p T(ψ) − T) of impulses M, which stretch by {stretch}"
        return self._term(phase_at, one, text, order=1)

    def _upwind(self, text: str) -> Iterator[Term]:
        """−½ ∫ P_s |v| [w] [T] where the phase runs both ways: of several noises, chains, for each other state."""
        first, *others = self._names
        for j in self._two_way:
            phi, phase = float(self._vertices[j]), -0.5 * self._jump[[j]].T @ self._jump[[j]]
            for values in product(*(np.unique(axis.xi) for axis in self.noises[1:])):
                held = dict(zip(others, values, strict=True))

                def of_first(xi: Any, phi: float = phi, held: dict[str, float] = held) -> Any:
                    return np.abs(self.system.phase_speed({**held, first: xi} if held else xi)(phi))

                yield Term(0, OfMoment(0), phase, (of_first, *map(At, values)), text)


@dataclass(frozen=True, eq=False)
class PhaseAxis(DividedAxis):
    """Discontinuous elements on the circle or half circle; in each cell the basis is orthonormal, by degree.

    The first and the last line are one, and degrees are from 1 on.
    """

    terms = PlaneTerms
    is_orthonormal = True

    @cached_property
    def size(self) -> int:
        return int(np.sum(self.degrees + 1))

    @property
    def facts(self) -> dict[str, Any]:
        return {"phi_cells": self.lines.size - 1, "phi_degrees": [int(degree) for degree in self.degrees]}

    @cached_property
    def _sizes(self) -> FloatArray:
        return np.diff(self.lines)

    @cached_property
    def cells(self) -> IntArray:
        return np.repeat(np.arange(self.degrees.size), self.degrees + 1)

    @cached_property
    def modes(self) -> IntArray:
        return np.arange(self.size) - np.searchsorted(self.cells, self.cells)

    @cached_property
    def points(self) -> FloatArray:
        """The points of a rule, so many in each cell, shape (n,)."""
        return self.finer_rule(1)[0]

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of the points, shape (n,)."""
        return self.finer_rule(1)[1]

    @cached_property
    def values(self) -> Matrix:
        """The functions at the points, shape (n, size)."""
        return self.at(self.points)

    @cached_property
    def _local(self) -> tuple[FloatArray, FloatArray]:
        """The polynomials of each cell and their derivatives at its points, shapes (m, n/m, largest degree + 1)."""
        degree, size = int(self.degrees.max()), self._sizes[:, None, None]
        values = legendre(degree, gauss_legendre(degree + EXTRA_POINTS)[0]) / np.sqrt(size)
        return values, values @ differentiation(degree) / size

    @cached_property
    def constant(self) -> FloatArray:
        return np.where(self.modes == 0, np.sqrt(self._sizes)[self.cells], 0.0)

    @property
    def span(self) -> float:
        """π or 2π."""
        return float(self.lines[-1] - self.lines[0])

    @cached_property
    def turns(self) -> int:  # type: ignore[override]
        return round(2 * math.pi / self.span)

    @cached_property
    def traces(self) -> tuple[Matrix, Matrix]:
        """T(φⱼ⁻) and T(φⱼ⁺) at lines[:-1], shapes (m, size); below the seam is the last cell."""
        inside = middles(self.lines)
        return self.at(np.roll(self.lines[1:], 1), np.roll(inside, 1)), self.at(self.lines[:-1], inside)

    def mass(self, f: Any = one) -> Matrix:
        """∫ f u v of `Harmonics` f, or of 1."""
        if f == one:
            return self.stored(identity(self.size, format="csr"))
        wave = self._integral(f(self.points) - f.mean, *2 * self._local[:1])
        return f.mean * self.matrix(one) + wave  # exact without a wave

    def convection(self, f: Harmonics) -> Matrix:
        """∫ f u′ v, cell by cell."""
        return self._integral(f(self.points), *self._local)

    def _integral(self, f: Any, test: FloatArray, trial: FloatArray) -> Matrix:
        """∫ f v u, cell by cell, from f at the points, and test and trial functions of each cell there."""
        weights = np.reshape(self.weights * f, trial.shape[:2])
        blocks = np.swapaxes(test, 1, 2) @ by_rows(weights, trial)
        return self._of_cells(self.cells, blocks[self.cells, self.modes])

    def diffusion(self, a: CoefficientMatrix, b: CoefficientMatrix) -> tuple[Matrix, Matrix, Matrix]:
        """∫ w D_a D_b T, D = h ∂φ + p q of two matrices: the coefficients of p⁰, p¹ and p².

        With D* w = −(h w)′ + p q w it is, cell by cell and at the vertices,

            ∫ D_a* w D_b T − Σ h_a [w] {D_b T} + Σ h_b [T] {D_a* w} − Σ η h_a h_b [w] [T],

        the interior penalty method, in which η grows like degree²/size of the smaller cell. What h and q do not change
        at a vertex, as h = 0 at the ray of a jump, is not there.
        """
        left, right = self.traces
        jump, mean, vertices = right - left, 0.5 * (left + right), self.lines[:-1]
        sharpness = (self.degrees + 1) ** 2 / self._sizes
        penalty = PENALTY * np.maximum(sharpness, np.roll(sharpness, 1))

        def both(phi: FloatArray, values: Any, slopes: Any) -> Any:
            """D_a* w and D_b T by p⁰ and p¹, from values and slopes at φ."""
            steady = by_rows(a.h(phi), slopes) + by_rows(a.h.slope(phi), values)
            return (-steady, by_rows(a.q(phi), values)), (by_rows(b.h(phi), slopes), by_rows(b.q(phi), values))

        adjoint, image = both(self.points.reshape(self._sizes.size, -1), *self._local)
        first, second, third, last = (self._integral(1.0, w, u) for w in adjoint for u in image)
        adjoint, image = both(vertices, mean, mean @ self._derivative)
        of_a, of_b = by_rows(a.h(vertices), jump), by_rows(b.h(vertices), jump)
        loads = [w.T @ of_b - of_a.T @ u for w, u in zip(adjoint, image, strict=True)]
        return first + loads[0] - of_a.T @ by_rows(penalty, of_b), second + third + loads[1], last

    def impulses(self, struck: Struck, p: float, derivative: int) -> Matrix:
        """∂ᵏ/∂pᵏ of ∫ w |exp(B)e|^p T(ψ(φ)), ψ being where an impulse takes φ."""
        return self.stored(struck.at.T @ diags(OfMoment(0, struck.logs)(p, derivative)) @ struck.end)

    def changed_impulses(self, struck: Struck, of: Impulse, by: Impulse, p: float, derivative: int) -> Matrix:
        """∂/∂θ of what `impulses` gives, where B depends on θ."""
        logs, e = struck.logs, np.stack([np.cos(struck.points), -np.sin(struck.points)])
        (x, u), (dx, du) = (matrix @ e for matrix in (of.matrix, changed_exponential(of.exponent, by.exponent)))
        size = np.exp(-2 * logs)
        longer = size * (x * dx + u * du) * OfMoment(1, logs)(p, derivative)
        turned = size * (u * dx - x * du) * OfMoment(0, logs)(p, derivative)
        slope = struck.end @ csr_matrix(self._derivative)
        return self.stored(struck.at.T @ (diags(longer) @ struck.end + diags(turned) @ slope))

    def struck(self, of: Impulse) -> Struck:
        """What an impulse does at the points of a rule between the lines and the phases that it takes to lines."""
        back = replace(of, exponent=-np.array(of.exponent))
        even = self.lines[0] + self.span * np.arange(STRIPS) / STRIPS
        _, before = back.stretched(np.concatenate([even, self.lines[:-1]]))
        cuts = np.unique(np.concatenate([even, self.lines, self.folded(before)]))
        local, weights = gauss_legendre(int(self.degrees.max()) + EXTRA_POINTS)
        sizes = np.diff(cuts)[:, None]
        points = (cuts[:-1, None] + sizes * local).ravel()
        stretch, end = of.stretched(points)
        at, end = (csr_matrix(self.at(phi)) for phi in (points, self.folded(end)))
        return Struck(points, np.log(stretch), diags((sizes * weights).ravel()) @ at, end)

    def folded(self, phi: FloatArray) -> FloatArray:
        """The points of the domain that are φ but for whole turns of it."""
        return self.lines[0] + np.mod(phi - self.lines[0], self.span)

    @cached_property
    def _derivative(self) -> Matrix:
        """The matrix to the coefficients of T′ in each cell."""
        blocks = differentiation(int(self.degrees.max()))[self.modes] / self._sizes[self.cells, None]
        return self._of_cells(self.cells, blocks)

    def at(self, phi: FloatArray, inside: FloatArray | None = None) -> Matrix:
        """Values at points of the domain, as rows of E with u(φ) = E @ coefficients, shape (len(φ), size).

        A point on a line between cells is seen from the cell that holds its entry of `inside`, without it from the
        cell above.
        """
        cell, local = located(self.lines, phi, inside)
        return self._of_cells(cell, legendre(int(self.degrees.max()), local) / np.sqrt(self._sizes[cell])[:, None])

    def finer_rule(self, parts: int) -> tuple[FloatArray, FloatArray]:
        """Points and weights of the rule where every cell is cut into so many parts, shapes (parts n,)."""
        sizes = np.repeat(self._sizes / parts, parts)
        starts = (self.lines[:-1, None] + self._sizes[:, None] * np.arange(parts) / parts).ravel()
        local, weights = gauss_legendre(int(self.degrees.max()) + EXTRA_POINTS)
        return (starts[:, None] + sizes[:, None] * local).ravel(), (sizes[:, None] * weights).ravel()

    @cached_property
    def rule(self) -> Rule:
        """At five points inside each cell."""
        points = (self.lines[:-1, None] + self._sizes[:, None] * np.linspace(0.1, 0.9, 5)).ravel()
        return Rule(points, np.repeat(self._sizes / 5, 5), self.at(points))

    def projection(self, other: PhaseAxis) -> Matrix:
        """The matrix that takes a function of another space to its projection on this one, shape (size, other.size)."""
        return self.values.T @ (diags(self.weights) @ other.at(self.points))

    def _of_cells(self, cells: IntArray, table: FloatArray) -> Matrix:
        """The matrix of which each row is that of a table, by degree, at the functions of one cell, and else 0."""
        counts = self.degrees[cells] + 1
        rows, firsts = np.repeat(np.arange(cells.size), counts), np.searchsorted(self.cells, cells)
        columns = np.arange(rows.size) + np.repeat(firsts + counts - np.cumsum(counts), counts)
        entries, shape = table[rows, self.modes[columns]], (cells.size, self.size)
        if self.size > FEW_UNKNOWNS:
            return csr_matrix((entries, (rows, columns)), shape=shape)
        matrix = np.zeros(shape)
        matrix[rows, columns] = entries
        return matrix


def by_rows(factors: FloatArray, matrix: Matrix) -> Matrix:
    """A matrix, or several, with its rows multiplied."""
    return diags(factors) @ matrix if issparse(matrix) else factors[..., None] * matrix
