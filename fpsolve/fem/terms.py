"""The tilted generator L(p) = L₀ + ε L₁ + ε² L₂ of Eq. (19), term by term, in weak form.

For trial T and test w, every integral weighted by P_s(ξ), a term ε^n g(ξ) A x with h = e′ᵀA e and q = eᵀA e gives

    ∫ P_s ε^n g h w T_φ + p ε^n ∫ P_s g q w T,

and at each φ-vertex the point load ∫ P_s (v {w} − ½θ [w]) [T], with the phase speed v = Σ ε^n g h, the mean {w} and the
jump [w] = w(φ⁺) − w(φ⁻) of its two traces. θ = |v| is upwinding; for polynomials of ξ, which cannot follow its kink, θ
is its size for the typical ξ, |Σ ε^n h| over what no noise drives + Σ ε^n |h| (mean of g²)^½ over the rest. At a wall
v is one number for all ξ, and θ = |v|. The wall is the point load (R^p − 1)|v| δ(φ − φ_j) T of the trace of T that v
brings, T(φ⁺) on w(φ⁻) for v > 0 and T(φ⁻) on w(φ⁺) for v < 0, so that T jumps by R^p. The vertex has |v| times the same
trace: it is left out there, and the wall has R^p, as a tiny R^p would be rounded beside 1.

White noise by which dx has Bx ∘ dW adds ½ (h ∂φ + p q)² with h and q of B, see `PhaseAxis.diffusion`. Impulses
exp(B) add their rate times |exp(B)e|^p T(ψ) − T, ψ being where they take φ, see `PhaseAxis.impulses`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product
from operator import add
from typing import Any, NamedTuple

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray, Matrix, one
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.mesh import vertices_at
from fpsolve.fem.phase import by_rows
from fpsolve.fem.space import Space
from fpsolve.model.plane import (
    CoefficientMatrix,
    Harmonics,
    Impulse,
    Jump,
    LinearMotion,
    Xi,
    is_driven,
    matrix_at,
    phase_speed,
    turning,
    written_coefficient,
)
from fpsolve.model.problem import ParameterDerivative, Problem

ALL_ORDERS = slice(None)
Noises = tuple[Coefficient | None, ...]
"""For each noise the g of ∫P_s g u v, or None for its generator, ∫P_s v L_ξ u."""


@dataclass(frozen=True)
class OfMoment:
    """The coefficient pⁿ R^p, n ≤ 1 unless R = 1.

    Attributes:
        n: the power of p.
        log_factor: ln R.
        is_change: whether 1 of it is of order 0 in ε, so that the change at a jump is of the order of its term.
    """

    n: int
    log_factor: float = 0.0
    is_change: bool = False

    def of_orders(self, p: float, derivative: int, has_first: bool, has_own: bool) -> float:
        """Its k-th derivative, of order 0, of that of its term, or of both."""
        if self.is_change and has_first != has_own and not derivative:
            return math.expm1(p * self.log_factor) if has_own else 1.0
        return self(p, derivative) if has_own else 0.0

    def __call__(self, p: float, derivative: int = 0) -> float:
        """Its k-th derivative."""
        if not self.log_factor:
            return math.perm(self.n, derivative) * float(p) ** max(self.n - derivative, 0)
        parts = p**self.n * self.log_factor**derivative, self.n * derivative * self.log_factor ** max(derivative - 1, 0)
        return sum(parts) * math.exp(p * self.log_factor)


@dataclass(frozen=True)
class At:
    """The coefficient that is 1 in the states of one value, and 0 in others.

    Attributes:
        value: ξ.
    """

    value: float

    def __call__(self, xi: Any) -> Any:
        return 1.0 * (np.asarray(xi) == self.value)


@dataclass(frozen=True, eq=False)
class Term:
    """One term of L(p): a coefficient of p times an operator with a factor for each axis.

    Attributes:
        order: the power of ε with which it begins; the power itself is in the operator.
        of_p: the coefficient.
        phase: the matrix of φ.
        noises: its functions of the noises.
        text: the term as a reader would write it.
        phase_at: gives the k-th derivative of the matrix of φ by p, from p and k, where that is no coefficient times
            one matrix; `phase` is then 0.
    """

    order: int
    of_p: OfMoment
    phase: Matrix
    noises: Noises
    text: str
    phase_at: Callable[[float, int], Matrix] | None = None

    def at(self, p: float, derivative: int = 0) -> Matrix | None:
        """The k-th derivative by p of the matrix of φ with its coefficient; None where that is 0."""
        if self.phase_at:
            return self.phase_at(p, derivative)
        size = self.of_p(p, derivative)
        return size * self.phase if size else None


class TermSum:
    """A sum of terms, in which those with the same functions of the noises, order and coefficient are added up once."""

    def __init__(self, terms: Iterable[Term]) -> None:
        sums: dict[Noises, dict[tuple[int, OfMoment], Matrix]] = {}
        self._others = list[tuple[Noises, int, Callable[[float, int], Matrix]]]()
        for term in terms:
            if term.phase_at:
                self._others.append((term.noises, term.order, term.phase_at))
                continue
            parts, key = sums.setdefault(term.noises, {}), (term.order, term.of_p)
            parts[key] = parts[key] + term.phase if key in parts else term.phase
        (noises, first), *_ = sums.items()
        self._nothing: dict[Noises, Matrix] = {(one,) * len(noises): 0.0 * next(iter(first.values()))}
        self._parts = [(noises, [(*key, phase) for key, phase in parts.items()]) for noises, parts in sums.items()]
        orders = [order for parts in sums.values() for order, _ in parts] + [order for _, order, _ in self._others]
        self._orders = range(1 + max(orders))

    def phase_matrices(self, p: float, derivative: int = 0, orders: slice = ALL_ORDERS) -> dict[Noises, Matrix]:
        """For each function of the noises the matrix of φ; the first is that of 1."""
        phases, wanted = self._nothing.copy(), self._orders[orders]
        for noises, parts in self._parts:
            total = phases.get(noises)
            for order, of_p, phase in parts:
                if size := of_p.of_orders(p, derivative, 0 in wanted, order in wanted):
                    total = size * phase if total is None else total + size * phase
            if total is not None:
                phases[noises] = total
        for noises, order, phase_at in self._others:
            if order in wanted:
                phases[noises] = phases[noises] + phase_at(p, derivative)
        return phases

    def matrix(self, space: Space, p: float, derivative: int = 0, orders: slice = ALL_ORDERS) -> KroneckerSum:
        """The sum in a space for p; its first term has ∫ P_s u v of every noise."""
        return KroneckerSum(
            [
                (phase, *(axis.matrix(g) for axis, g in zip(space.noises, noises, strict=True)))
                for noises, phase in self.phase_matrices(p, derivative, orders).items()
            ],
            space.phi.unit,
        )


class Wall(NamedTuple):
    """A jump, the speed v of the phase at its ray φ_j, and δ(φ − φ_j): w(φ⁻) T(φ⁺) for v > 0, else w(φ⁺) T(φ⁻)."""

    jump: Jump
    speed: float
    delta: Matrix


class NoiseTerms:
    """L(p) of a system, and ∂L(p)/∂θ, term by term, on whatever functions of directions.

    Args:
        problem: whose motion it is, and what white noise adds to it.
        space: the trial and test functions.
    """

    def __init__(self, problem: Problem, space: Space) -> None:
        self._names, self._problem, self.phi = tuple(problem.coloured.parts), problem, space.phi
        self.system, self._diffusions = problem.motion, problem.diffusions

    def whole(self) -> Iterator[Term]:
        """L(p) of Eq. (19)."""
        yield from self._generators(self.phi.identity)
        for term in self.system.terms:
            yield from self._driven(term)
        for each in self._diffusions:
            yield from self._diffused([(0.5, each, each)])
        yield from self._loads()

    def changed(self, by: ParameterDerivative) -> Iterator[Term]:
        """∂L(p)/∂θ of the same terms; what makes functions smooth is held."""
        for term in by.terms:
            yield from self._driven(term)
        for own, other in zip(self._diffusions, by.diffusions, strict=bool(by.diffusions)):
            yield from self._diffused([(0.5, own, other), (0.5, other, own)])
        yield from self._changed_loads(by)

    def _driven(self, term: CoefficientMatrix) -> Iterator[Term]:
        """A term of the motion."""
        raise NotImplementedError

    def _loads(self) -> Iterator[Term]:
        """Walls, impulses, and what makes functions smooth."""
        raise NotImplementedError

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """∂/∂θ of these."""
        return iter(())

    def _own(self, term: CoefficientMatrix) -> Any:
        """A matrix as the functions of directions take it."""
        return term

    def _text(self, term: CoefficientMatrix) -> str:
        """An operator of white noise as a reader would write it."""
        return "(h·∇ + p q)² of white noise"

    def _diffused(self, pairs: Sequence[tuple[float, CoefficientMatrix, CoefficientMatrix]]) -> Iterator[Term]:
        """Σ c (h_a·∇ + p q_a)(h_b·∇ + p q_b) of matrices a and b, written by the first one."""
        order, parts = min(a.order + b.order for _, a, b in pairs), list[Any]()
        for c, a, b in pairs:
            size = c * self.system.epsilon ** (a.order + b.order)
            parts.append([size * part for part in self.phi.diffusion(self._own(a), self._own(b))])
        text = f"½ {self._text(pairs[0][1])}"
        for power, of_pairs in enumerate(zip(*parts, strict=True)):
            yield self._term(reduce(add, of_pairs), one, ("", "p ", "p² ")[power] + text, OfMoment(power), order)

    def _term(
        self,
        phase: Matrix,
        g: Coefficient | None,
        text: str,
        of_p: OfMoment = OfMoment(0),
        order: int = 0,
        of: str = "",
    ) -> Term:
        """One with a function of the noise `of`, or of the first."""
        at = self._names.index(of) if of in self._names else 0
        return Term(order, of_p, phase, tuple(g if k == at else one for k in range(len(self._names))), text)

    def _generators(self, identity: Matrix) -> Iterator[Term]:
        """The generator of every noise."""
        for name in self._names:
            yield self._term(identity, None, f"L_ξ, the generator of the noise{f' {name}' if name else ''}", of=name)


class Terms(NoiseTerms):
    """L(p) of two variables; what is of φ alone is the same with any tilt. Args as those of `NoiseTerms`."""

    def __init__(self, problem: Problem, space: Space) -> None:
        super().__init__(problem, space)
        system, self.noises, self._impulses = self.system, space.noises, problem.impulses
        self._vertices, self._jump = self.phi.lines[:-1], self.phi.jump
        brought = 0.0 * self._jump  # to a wall
        # where θ = |v|, and the sign of v where that is the same for all ξ, otherwise 0
        is_exact, direction = np.full(self._vertices.size, False), np.zeros(self._vertices.size)
        if all(axis.is_local for axis in self.noises):
            rates = matrix_at(system, problem.at_values([axis.samples().xi for axis in self.noises]))
            speed = turning(rates.reshape(-1, 1, 2, 2))(self._vertices)
            is_exact, direction = ~is_exact, 1.0 * np.all(speed > 0, axis=0) - np.all(speed < 0, axis=0)
        self._walls = list[Wall]()
        for jump, v in zip(system.jumps, problem.wall_speeds(system), strict=True):
            at = vertices_at(self.phi.lines, jump.phase)
            is_exact[at], direction[at] = True, math.copysign(1.0, v)
            left, right = self.phi.left_trace[at], self.phi.right_trace[at]
            self._walls.append(Wall(jump, v, left.T @ right if v > 0 else right.T @ left))
            at_wall = np.isin(np.arange(self._vertices.size), at).astype(float)
            brought = brought + by_rows(at_wall, self.phi.right_trace if v > 0 else -self.phi.left_trace)
        self._step = self._jump - brought
        self._is_exact, self._two_way = is_exact, np.flatnonzero(is_exact & (direction == 0))
        # nothing is left of the other side: where ξ is large that would count
        self._trace = 0.5 * (self.phi.right_trace + self.phi.left_trace) - by_rows(0.5 * direction, self._jump)

    def _loads(self) -> Iterator[Term]:
        for struck in self._impulses:
            yield self._struck(struck)
        # −½ ∫ P_s θ [w] [T] at the φ-vertices where the phase runs both ways, or θ is not |v|
        text, jump = "upwind loads between cells", self._jump
        if not np.all(self._is_exact):
            typical = np.where(self._is_exact, 0.0, self.typical_speed())
            yield self._term(-0.5 * jump.T @ by_rows(typical, jump), one, text)
        yield from self._upwind(lambda phi, xi: np.abs(phase_speed(self.system, xi)(phi)), text)
        for ray, v, delta in self._walls:
            text = f"(R^p − 1) |dφ/dt| δ(φ − {ray.phase:.6g} mod π), R = {math.exp(ray.log_factor):.6g}"
            yield self._term(abs(v) * delta, one, text, OfMoment(0, ray.log_factor, is_change=True), order=2)

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """The size of the speed for the typical ξ is held: [T] = 0 there but for the error of the elements."""
        text, moved = "∂/∂θ", LinearMotion(self.system.epsilon, by.terms)
        for struck, moved_by in zip(self._impulses, by.impulses, strict=bool(by.impulses)):
            yield self._struck(struck, moved_by)
        yield from self._upwind(
            lambda phi, xi: np.sign(phase_speed(self.system, xi)(phi)) * phase_speed(moved, xi)(phi), text
        )
        faster = self._problem.wall_speeds(moved)
        for k, (ray, v, delta) in enumerate(self._walls):
            if by.jumps:
                yield self._term(by.jumps[k] * abs(v) * delta, one, text, OfMoment(1, ray.log_factor), order=2)
            of_p = OfMoment(0, ray.log_factor)
            yield self._term(math.copysign(1.0, v) * faster[k] * delta, one, text, of_p, order=2)

    def _driven(self, term: CoefficientMatrix) -> Iterator[Term]:
        """h ∂φ with the loads at the φ-vertices, and p q."""
        size = self.system.epsilon**term.order
        text = (f"{power_of_epsilon(term.order)} " if term.order else "") + written_coefficient(term.g)
        if not term.h.vanishes:
            loads = self._trace.T @ by_rows(term.h(self._vertices), self._step)
            along = size * (self.phi.convection(term.h) + loads)
            yield self._term(along, term.g, f"{text}{_written(term.h)} ∂φ", order=term.order, of=term.noise)
        if not term.q.vanishes:
            along = size * self.phi.mass(term.q)
            yield self._term(along, term.g, f"p {text}{_written(term.q)}", OfMoment(1), term.order, term.noise)

    def _text(self, term: CoefficientMatrix) -> str:
        return f"(h ∂φ + p q)² of white noise, h = {_written(term.h)}, q = {_written(term.q)}"

    def _struck(self, of: Impulse, by: Impulse | None = None) -> Term:
        """An impulse, or ∂/∂θ of it."""

        def phase_at(p: float, derivative: int) -> Matrix:
            rate = of.rate if by is None else by.rate
            total = 0.0 if by is None else of.rate * self.phi.changed_impulses(of, by, p, derivative)
            if rate:
                total = total + rate * self.phi.impulses(of, p, derivative)
                total = total if derivative else total - rate * self.phi.identity
            return total

        stretch = ", ".join(f"{size:.3g}" for size in np.linalg.svd(of.matrix, compute_uv=False))
        text = f"{of.rate:.6g} (|Me|^p T(ψ) − T) of impulses M, which stretch by {stretch}"
        return Term(1, OfMoment(0), 0.0, (one,) * len(self.noises), text, phase_at)

    def typical_speed(self) -> FloatArray:
        """θ at the φ-vertices for the typical ξ, shape (m,)."""
        steady, driven = np.zeros(self._vertices.size), np.zeros(self._vertices.size)
        for term in self.system.terms:
            speed = self.system.epsilon**term.order * term.h(self._vertices)
            if not is_driven(term.g):
                steady += float(term.g(0.0)) * speed
            else:
                xi = self.noises[self._names.index(term.noise) if term.noise in self._names else 0]
                constant, square = xi.constant, xi.mass(lambda xi, g=term.g: g(xi) ** 2)
                total = constant @ (xi.matrix(one) @ constant)
                driven = driven + abs(speed) * math.sqrt(constant @ (square @ constant) / total)
        return np.asarray(abs(steady) + driven)

    def _upwind(self, theta: Callable[[float, Xi], FloatArray], text: str) -> Iterator[Term]:
        """−½ ∫ P_s θ(φ, ξ) [w] [T] where the phase runs both ways: of several noises, chains, for each other state."""
        first, *others = self._names
        for j in self._two_way:
            phi, phase = float(self._vertices[j]), -0.5 * self._jump[[j]].T @ self._jump[[j]]
            for values in product(*(np.unique(axis.support) for axis in self.noises[1:])):
                held = dict(zip(others, values, strict=True))

                def of_first(xi: Any, phi: float = phi, held: dict[str, float] = held) -> Any:
                    return theta(phi, {**held, first: xi} if held else xi)

                yield Term(0, OfMoment(0), phase, (of_first, *map(At, values)), text)


def power_of_epsilon(order: int) -> str:
    """ε²."""
    return "ε" if order == 1 else "ε" + str(order).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _written(harmonics: Harmonics) -> str:
    """(0.5 − 0.5 cos 2φ), or one number."""
    values = harmonics.mean, harmonics.cosine, harmonics.sine
    names = ("", " cos 2φ", " sin 2φ")
    parts = [(float(value), name) for value, name in zip(values, names, strict=True) if value]
    text = "".join(f" {'−' if value < 0 else '+'} {abs(value):g}{name}" for value, name in parts)
    text = text.removeprefix(" + ").removeprefix(" ")
    return text if parts == [(values[0], "")] else f"({text})"
