"""The tilted generator L(p) = L₀ + ε L₁ + ε² L₂ of Eq. (19), term by term, in weak form.

For trial T and test w, every integral weighted by P_s(ξ), a term ε^n g(ξ) A x adds

    ∫ P_s ε^n g w h·∇T + p ε^n ∫ P_s g q w T,      q = eᵀA e,      h = Ae − q e,

e being the direction of x. White noise by which dx has Bx ∘ dW adds ½ (h·∇ + p q)² with h and q of B. The first axis of
a space, the phase or directions, has the matrices of h·∇ and q, and makes the terms that are its own, as of walls: see
`PlaneTerms` and `DirectionTerms`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from fpsolve.arrays import Coefficient, Matrix, one
from fpsolve.fem.axis import Axis, KroneckerSum
from fpsolve.model.plane import CoefficientMatrix, written_coefficient
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

    def matrix(self, axes: Sequence[Axis], p: float, derivative: int = 0, orders: slice = ALL_ORDERS) -> KroneckerSum:
        """The sum for p on the functions of some axes; its first term has ∫ P_s u v of every noise."""
        phi, *others = axes
        return KroneckerSum(
            [
                (phase, *(axis.matrix(g) for axis, g in zip(others, noises, strict=True)))
                for noises, phase in self.phase_matrices(p, derivative, orders).items()
            ],
            phi.unit,
        )


class Terms:
    """L(p) of a problem, and ∂L(p)/∂θ, term by term, on whatever functions of the phase or of directions.

    Args:
        problem: whose motion it is, and what white noise adds to it.
        phi: the functions of the phase, or of directions.
        noises: those of each noise.
    """

    def __init__(self, problem: Problem, phi: Any, noises: Sequence[Any]) -> None:
        self.phi, self.noises, self._names = phi, noises, tuple(problem.coloured.parts)
        self._problem, self.system = problem, problem.motion

    def whole(self) -> Iterator[Term]:
        """L(p) of Eq. (19)."""
        for name in self._names:
            text = f"L_ξ, the generator of the noise{f' {name}' if name else ''}"
            yield self._term(self.phi.identity, None, text, of=name)
        for term in self.system.terms:
            yield from self._driven(term)
        for each in self._problem.diffusions:
            yield from self._diffused([(0.5, each, each)])
        yield from self._loads()

    def changed(self, by: ParameterDerivative) -> Iterator[Term]:
        """∂L(p)/∂θ of the same terms; what makes functions smooth is held."""
        for term in by.terms:
            yield from self._driven(term)
        for own, other in zip(self._problem.diffusions, by.diffusions, strict=bool(by.diffusions)):
            yield from self._diffused([(0.5, own, other), (0.5, other, own)])
        yield from self._changed_loads(by)

    def _loads(self) -> Iterator[Term]:
        """Walls, impulses, and what makes functions smooth."""
        raise NotImplementedError

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """∂/∂θ of these."""
        raise NotImplementedError

    def _written(self, term: CoefficientMatrix) -> tuple[str, str, str]:
        """h·∇, q and the square of their sum as a reader would write them."""
        raise NotImplementedError

    def _matrices(self, term: CoefficientMatrix) -> tuple[Matrix, Matrix]:
        """h·∇ and q of a term of the motion."""
        found: tuple[Matrix, Matrix] = self.phi.driven(term)
        return found

    def _driven(self, term: CoefficientMatrix) -> Iterator[Term]:
        """h·∇ + p q of a term of the motion."""
        size, power = self.system.epsilon**term.order, f"{power_of_epsilon(term.order)} " if term.order else ""
        for k, (matrix, text) in enumerate(zip(self._matrices(term), self._written(term), strict=False)):
            if abs(matrix).max():
                words = "p " * k + power + written_coefficient(term.g) + text
                yield self._term(size * matrix, term.g, words, OfMoment(k), term.order, term.noise)

    def _diffused(self, pairs: Sequence[tuple[float, CoefficientMatrix, CoefficientMatrix]]) -> Iterator[Term]:
        """Σ c (h_a·∇ + p q_a)(h_b·∇ + p q_b) of matrices a and b, written by the first one."""
        order, parts = min(a.order + b.order for _, a, b in pairs), list[Any]()
        for c, a, b in pairs:
            size = c * self.system.epsilon ** (a.order + b.order)
            parts.append([size * part for part in self.phi.diffusion(a, b)])
        text = f"½ {self._written(pairs[0][1])[2]}"
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

    def _at(self, phase_at: Callable[[float, int], Matrix], text: str, order: int = 0) -> Term:
        """One of no noise whose matrix is given by p and the number of derivatives by p."""
        return Term(order, OfMoment(0), 0.0, (one,) * len(self._names), text, phase_at)


def power_of_epsilon(order: int) -> str:
    """ε²."""
    return "ε" if order == 1 else "ε" + str(order).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
