"""Functions on the half sphere of directions of four variables with a stop, and the terms of their generators.

In the coordinates (q₁, v₁, q₂, v₂) of a `Stop` q₁ ≥ 0, and v₁ becomes −R v₁ where q₁ falls to 0. With the angles η, θ₁
and θ₂ of `sphere`, −π/2 ≤ θ₁ ≤ π/2, q̇₁ = ω v₁ whatever the noise is, so that dθ₁/dt = −ω at both ends: paths leave at
−π/2, where they hit the wall, and come back at π/2,

    u(η, −π/2, θ₂) = ρ^p u(η′, π/2, θ₂),      ρ² = R² cos² η + sin² η,      tan η′ = tan η/R.

The functions are continuous elements in η times those in θ₁, both of whose ends have values of their own, times waves
of θ₂. The wall is the point load ω δ(θ₁ + π/2) (ρ^p u(η′, π/2, θ₂) − u): as the noise moves no path over it, one flux.
Where the first mass is at rest at the stop, η = π/2, θ₁ has no say; there impacts come ever faster, T is a root of the
distance, and elements are smaller. Jumps of ∂u/∂η and of ∂u/∂θ₁ between elements are penalised by γ h² N⁻³ β times a
bound on the speed across them, 1 and 1/cos η, β the norm of the growth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags, identity
from scipy.sparse.linalg import LinearOperator

from fpsolve.arrays import FloatArray, IntArray, Matrix, one
from fpsolve.fem.axis import along
from fpsolve.fem.element import gauss_legendre
from fpsolve.fem.line import LineSpace
from fpsolve.fem.mesh import halved
from fpsolve.fem.sphere import MOST_DEGREE, PENALTY, DirectionAxis, Group, SphereTerms, assembled, group, waves_at
from fpsolve.fem.terms import OfMoment, Term
from fpsolve.model.plane import is_driven
from fpsolve.model.problem import ParameterDerivative

MORE_POINTS = 12
"""Number of Gauss points between two lines, or what an impact takes to these, beyond the degree."""
Parts = list[tuple[Matrix, Matrix, Matrix]]
"""Σ f(η) g(θ₁) ⊗ w: values at points of η and of θ₁, shape (points, functions), and waves, shape (all, own)."""


@dataclass(frozen=True, eq=False)
class HalfSphereAxis(DirectionAxis):
    """Elements in η and in θ₁ times waves of θ₂, see the module.

    Attributes:
        lines: the vertices in η, shape (m + 1,).
        degree: of the elements in η.
        first_lines: the vertices in θ₁.
        first_degree: of the elements in θ₁.
        waves: the largest degree of a wave.
    """

    lines: FloatArray = field()
    degree: int
    first_lines: FloatArray
    first_degree: int
    waves: int

    @property
    def size(self) -> int:
        return self._kept.size

    @property
    def facts(self) -> dict[str, Any]:
        found = {"eta_cells": self.lines.size - 1, "eta_degree": self.degree, "waves": self.waves}
        return {**found, "theta_cells": self.first_lines.size - 1, "theta_degree": self.first_degree}

    @property
    def finer(self) -> tuple[HalfSphereAxis, HalfSphereAxis, HalfSphereAxis]:
        """Two degrees more in η, in θ₁ and in θ₂."""
        return (
            replace(self, degree=self.degree + 2),
            replace(self, first_degree=self.first_degree + 2),
            replace(self, waves=self.waves + 2),
        )

    def differs(self, other: HalfSphereAxis) -> tuple[bool, bool, bool]:
        """Whether its functions of η, of θ₁ and of θ₂ are others."""
        return (
            (self.lines.size, self.degree) != (other.lines.size, other.degree),
            (self.first_lines.size, self.first_degree) != (other.first_lines.size, other.first_degree),
            self.waves != other.waves,
        )

    def new_in(self, coarse: HalfSphereAxis) -> Any:
        """Which functions a coarser axis, of lower degrees, does not have, shape (size,)."""
        nodes, firsts, waves = np.unravel_index(self._kept, self._shape)
        of_first = np.append(0, np.delete(self.first_line.modes, self.first_line.ends[1])) > coarse.first_degree
        of_second = self._second.degrees[self._own] > coarse.waves
        return (self.line.modes > coarse.degree)[nodes] | of_first[firsts] | of_second[waves]

    def enriched(self) -> HalfSphereAxis:
        """Two degrees more in every direction."""
        return self.raised_in((True, True, True))

    def raised_in(self, directions: Sequence[bool], is_halved: bool = False) -> HalfSphereAxis:
        """Two degrees more in some directions; elements of the highest degree are halved, those in η if they are to."""
        found, (eta, theta, second) = self, directions
        if eta and (is_halved or self.degree + 2 > MOST_DEGREE):
            found = replace(found, lines=halved(self.lines), degree=2 * (self.degree // 4) + 2)
        elif eta:
            found = replace(found, degree=self.degree + 2)
        if theta and (found := replace(found, first_degree=self.first_degree + 2)).first_degree > MOST_DEGREE:
            found = replace(found, first_lines=halved(self.first_lines), first_degree=MOST_DEGREE // 2 + 1)
        return replace(found, waves=self.waves + 2 * int(second))

    @cached_property
    def line(self) -> LineSpace:
        """The elements in η."""
        return LineSpace(
            self.lines, self.degree, lambda eta: np.cos(eta) * np.sin(eta), end_exponents=(1.0, 1.0), is_flat=True
        )

    @cached_property
    def first_line(self) -> LineSpace:
        """The elements in θ₁."""
        return LineSpace(self.first_lines, self.first_degree, is_flat=True)

    @cached_property
    def _first(self) -> FloatArray:
        """The functions of θ₁ in those of the elements: 1/√π, and all but that of the last vertex, shape (n₁, n₁)."""
        line = self.first_line
        others = np.delete(np.eye(line.size), line.ends[1], axis=1)
        return np.column_stack([line.constant() / math.sqrt(math.pi), others])

    @cached_property
    def _second(self) -> Group:
        """Waves of θ₂ with all to which two factors of e₂ lead."""
        return group(2, self.waves + 2)

    @cached_property
    def _own(self) -> IntArray:
        """Which of these a function may have."""
        return np.flatnonzero(self._second.degrees <= self.waves)

    @cached_property
    def _shape(self) -> tuple[int, int, int]:
        return self.line.size, self.first_line.size, self._own.size

    @cached_property
    def _kept(self) -> IntArray:
        """Which products there are: where a vector is 0 its angle has no say."""
        kept = np.ones(self._shape, dtype=bool)
        kept[self.line.ends[0], :, 1:] = kept[self.line.ends[1], 1:, :] = False
        return np.flatnonzero(kept)

    @cached_property
    def constant(self) -> FloatArray:
        constant = np.zeros(self._shape)
        constant[:, 0, 0] = math.sqrt(math.pi) * self.line.constant()
        return constant.ravel()[self._kept]

    @cached_property
    def identity(self) -> Matrix:
        return self._forms([[(self._itself, self._itself)]])[0]

    @property
    def unit(self) -> Matrix:
        return self.identity

    @cached_property
    def _tables(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Values and slopes in η, and in θ₁, at the points."""
        line, first = self.line, self.first_line
        return line.values.toarray(), line.slopes.toarray(), first.values @ self._first, first.slopes @ self._first

    def _moved(self, matrix: FloatArray) -> tuple[Parts, Parts]:
        eta, theta, second = self.line.points[:, None], self.first_line.points[:, None], self._second
        c, s, e, t = np.cos(eta), np.sin(eta), (np.cos(theta), np.sin(theta)), (-np.sin(theta), np.cos(theta))
        values, slopes, of_first, turned = self._tables
        none, turn = np.eye(second.degrees.size), np.asarray(second.slope)
        x11, x12, x21, x22 = matrix[:2, :2], matrix[:2, 2:], matrix[2:, :2], matrix[2:, 2:]
        pairs = [(k, m) for k in (0, 1) for m in (0, 1)]
        a11, b11 = (sum(x11[k, m] * each[k] * e[m] for k, m in pairs) for each in (e, t))
        a22, b22 = (
            sum(x22[k, m] * each[k] @ second.unit[m] for k, m in pairs) for each in (second.unit, second.tangent)
        )
        moved = [
            (c * s * slopes, of_first, a22),
            (-c * s * slopes, a11 * of_first, none),
            (values, b11 * turned, none),
            (values, of_first, b22 @ turn),
        ]
        growth = [(c * c * values, a11 * of_first, none), (s * s * values, of_first, a22)]
        for k in (0, 1):
            there = sum(x12[k, m] * second.unit[m] for m in (0, 1))
            back, across = (sum(x21[m, k] * each[m] for m in (0, 1)) for each in (second.unit, second.tangent))
            moved += [
                (c * c * slopes, e[k] * of_first, back),
                (-s * s * slopes, e[k] * of_first, there),
                (s / c * values, t[k] * turned, there),
                (c / s * values, e[k] * of_first, across @ turn),
            ]
            growth.append((c * s * values, e[k] * of_first, there + back))
        return self._some(moved), self._some(growth)

    def _some(self, parts: Parts) -> Parts:
        """Those that are not 0, one at least, with their waves on the own ones."""
        kept = [each for each in parts if np.any(each[1]) and np.any(each[2])] or parts[:1]
        return [(f, g, csr_matrix(w[:, self._own])) for f, g, w in kept]

    def _product(self, left: Any, right: Any) -> tuple[Matrix, Matrix, Matrix]:
        of_eta, of_theta = self.line.measure[:, None], self.first_line.measure[:, None]
        return left[0].T @ (of_eta * right[0]), left[1].T @ (of_theta * right[1]), left[2].T @ right[2]

    @property
    def _itself(self) -> Parts:
        values, _, of_first, _ = self._tables
        return self._some([(values, of_first, np.eye(self._second.degrees.size))])

    def penalty(self) -> Matrix:
        values, _, of_first, _ = self._tables
        inner, waves = self.lines[1:-1], identity(self._own.size)
        in_eta = _jumps(self.line, self.degree, np.cos(inner) * np.sin(inner) ** 3)
        in_theta = _jumps(self.first_line, self.first_degree, np.ones(self.first_lines.size - 2))
        in_theta = self._first.T @ in_theta @ self._first
        of_eta = values.T @ ((self.line.measure / np.cos(self.line.points))[:, None] * values)
        of_theta = of_first.T @ (self.first_line.measure[:, None] * of_first)
        return -assembled([[(in_eta, of_theta, waves), (of_eta, in_theta, waves)]], self._kept)[0]

    def struck(self, log_factor: float, p: float, derivative: int = 0) -> Matrix:
        """∂ᵏ/∂pᵏ of ∫ v (ρ^p u(η′, π/2, θ₂) − u) over θ₁ = −π/2."""
        eta, weights, after, logs = self._impacts(log_factor)
        terms = [(self.line.at(after), weights * np.exp(p * logs) * logs**derivative, 1)]
        if not derivative:
            terms.append((self.line.at(eta), -weights, 0))
        return self._at_wall(eta, terms)

    def changed_impacts(self, log_factor: float, p: float, derivative: int = 0) -> Matrix:
        """The derivative by ln R of what `struck` gives."""
        eta, weights, after, logs = self._impacts(log_factor)
        size, share = weights * np.exp(p * logs), np.cos(after) ** 2
        longer = share * (p * logs**derivative + derivative * logs ** max(derivative - 1, 0))
        turned = -np.sin(after) * np.cos(after) * logs**derivative
        return self._at_wall(eta, [(self.line.at(after), size * longer, 1), (self.line.at(after, 1), size * turned, 1)])

    def _impacts(self, log_factor: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """η of a rule between the lines and what is taken to them, its weights, η′, and ln ρ."""
        r = math.exp(log_factor)
        cuts = np.unique(np.concatenate([self.lines, np.arctan2(r * np.sin(self.lines), np.cos(self.lines))]))
        cuts = cuts[np.append(True, np.diff(cuts) > 1e-12)]
        local, weights = gauss_legendre(self.degree + MORE_POINTS)
        sizes = np.diff(cuts)[:, None]
        eta = (cuts[:-1, None] + sizes * local).ravel()
        c, s = np.cos(eta), np.sin(eta)
        return eta, (sizes * weights).ravel() * c * s, np.arctan2(s, r * c), np.log(np.hypot(r * c, s))

    def _at_wall(self, eta: FloatArray, terms: Sequence[tuple[csr_matrix, FloatArray, int]]) -> Matrix:
        """∫ v(η, −π/2, θ₂) Σ f u, each u at points of η and an end of θ₁."""
        test, waves = self.line.at(eta).T, identity(self._own.size)
        ends = self.first_line.at(self.first_lines[[0, -1]]) @ self._first
        found = [(test @ diags(f) @ u, np.outer(ends[0], ends[end]), waves) for u, f, end in terms]
        return assembled([found], self._kept)[0]

    @property
    def area(self) -> float:
        """2π, as waves are orthonormal in the mean over θ₂."""
        return 2 * math.pi

    @property
    def inner_values(self) -> LinearOperator:
        values, _, of_first, _ = self._tables
        return self._along((values[:: max(1, self.degree // 4)], of_first[::2], self._second.samples[:, self._own]))

    def projection(self, other: HalfSphereAxis) -> LinearOperator:
        """In η and θ₁ by the inner product, of waves those that both have."""
        of_eta, of_first = _projected(self.line, other.line), _projected(self.first_line, other.first_line)
        of_theta = np.asarray(np.linalg.solve(self._first, of_first @ other._first))
        return other._along((of_eta, of_theta, np.eye(self._own.size, other._own.size)), self._kept)

    def _along(self, factors: Sequence[FloatArray], kept: IntArray | slice = slice(None)) -> LinearOperator:
        """What matrices along η, θ₁ and θ₂ make of functions, as far as it is kept."""

        def of_columns(columns: FloatArray) -> FloatArray:
            table = np.zeros((math.prod(self._shape), columns.shape[1]))
            table[self._kept] = columns
            return along((*factors, None), table.reshape(*self._shape, -1)).reshape(-1, columns.shape[1])[kept]

        shape = np.arange(math.prod(map(len, factors)))[kept].size, self.size
        return LinearOperator(shape, matvec=lambda v: of_columns(v.reshape(-1, 1)), matmat=of_columns, dtype=float)

    def at(self, points: FloatArray) -> csr_matrix:
        first, second = np.hypot(*points[:2]), np.hypot(*points[2:])
        waves = waves_at((2, 2), self.waves, points)[1]
        factors = (
            self.line.at(np.arctan2(second, first)).toarray(),
            self.first_line.at(np.arctan2(points[1], points[0])) @ self._first,
            waves.T,
        )
        return csr_matrix(np.einsum("xi,xj,xk->xijk", *factors).reshape(len(first), -1)[:, self._kept])


def _projected(line: LineSpace, other: LineSpace) -> FloatArray:
    """The projection of functions of another line, shape (size, other.size)."""
    mixed = line.values.T @ diags(line.measure) @ other.at(line.points)
    return np.linalg.solve(line.mass().toarray(), mixed.toarray())


def _jumps(line: LineSpace, degree: int, speeds: FloatArray) -> FloatArray:
    """Σ γ h² N⁻³ speed [u′] [v′] over the inner vertices."""
    sizes, jump = np.diff(line.lines), line.jumps_of_slope().toarray()
    weights = PENALTY * (0.5 * (sizes[1:] + sizes[:-1])) ** 2 / degree**3 * speeds
    return np.asarray(jump.T @ (weights[:, None] * jump))


class HalfSphereTerms(SphereTerms):
    """L(p) of a system with a stop, and ∂L(p)/∂θ, term by term. Args as those of `SphereTerms`."""

    def _loads(self) -> Iterator[Term]:
        yield from super()._loads()
        yield self._load(self.phi.struck, "ω (ρ^p T(η′, π/2, θ₂) − T) δ(θ₁ + π/2)")

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """ω is held, as it is that of the coordinates."""
        for log_factor in by.jumps:
            yield self._load(self.phi.changed_impacts, "∂/∂θ", log_factor)

    def _load(self, struck: Callable[[float, float, int], Matrix], text: str, size: float = 1.0) -> Term:
        stop = self._problem.system.stop
        assert stop is not None
        free = [self.matrix(term)[0, 1] * float(term.g(0.0)) for term in self.system.terms if not is_driven(term.g)]
        log_factor = math.log(stop.restitution)
        words = f"{text}, ω = {sum(free):.6g}, R = {stop.restitution:.6g}"

        def at(p: float, derivative: int) -> Matrix:
            return size * sum(free) * struck(log_factor, p, derivative)

        return Term(0, OfMoment(0), 0.0, tuple(one for _ in self._names), words, at)
