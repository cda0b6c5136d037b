"""The tilted generator L(p) = L₀ + ε L₁ + ε² L₂ of Eq. (19), term by term, in weak form.

For trial T and test w, every integral weighted by P_s(ξ), a term ε^n g(ξ) A x adds

    ∫ P_s ε^n g w h·∇T + p ε^n ∫ P_s g q w T,      q = eᵀA e,      h = Ae − q e,

e being the direction of x. White noise by which dx has Bx ∘ dW adds ½ (h·∇ + p q)² with h and q of B. The first axis of
a space, the phase or directions, has the matrices of h·∇ and q, and makes the terms that are its own, as of walls: see
`PlaneTerms` and `DirectionTerms`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, TypeAlias

import numpy as np

from fpsolve.arrays import Coefficient, Matrix, one
from fpsolve.model.coordinates import Framed
from fpsolve.model.plane import CoefficientMatrix, written_coefficient
from fpsolve.model.problem import ParameterDerivative

Noises = tuple[Coefficient | None, ...]
"""For each noise the g of ∫P_s g u v, or None for its generator, ∫P_s v L_ξ u."""
Phase: TypeAlias = "Matrix | Callable[[float, int], Matrix]"
"""A matrix of φ, or what gives its k-th derivative by p from p and k."""


@dataclass(frozen=True)
class OfMoment:
    """The coefficient pⁿ R^p.

    Attributes:
        n: the power of p.
        log_factor: ln R, or several; None for pⁿ alone.
    """

    n: int
    log_factor: Any = None

    def __call__(self, p: float, derivative: int) -> Any:
        """Its k-th derivative, by the rule of Leibniz. Raises `FloatingPointError`: it is beyond all numbers."""
        of_power = [math.perm(self.n, j) * p ** max(self.n - j, 0) for j in range(derivative + 1)]
        if self.log_factor is None:
            return of_power[-1]
        total = sum(
            math.comb(derivative, j) * each * self.log_factor ** (derivative - j) for j, each in enumerate(of_power)
        )
        with np.errstate(over="raise"):
            return total * np.exp(p * self.log_factor)


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
        order: the power of ε with which it begins, 0 for what forcing leaves out; the power itself is in the operator.
        of_p: the coefficient.
        phase: the matrix of the first axis; where p is in more than the coefficient, a function of p that gives it.
        noises: its functions of the noises.
        text: what it does, as a reader would write it, with {0} for its coefficient, {1} for `of`.
        of: that of the motion, or of white noise, that the text names.
        is_wall: whether it is R^p of a wall, which is 1 where nothing is lost: forcing is R^p − 1.
    """

    order: int
    of_p: OfMoment
    phase: Phase
    noises: Noises
    text: str
    of: CoefficientMatrix | None = None
    is_wall: bool = False

    def __str__(self) -> str:
        exponent = "" if self.order == 1 else str(self.order).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
        power, text = f"ε{exponent}", self.text
        if self.of:
            size = f"{power} " * (self.order > 0) + written_coefficient(self.of.g)
            text = text.format(size, self.of)
        return f"{power + ':':<4} {('', 'p ', 'p² ')[self.of_p.n]}{text}"

    def at(self, p: float, derivative: int = 0, is_forcing: bool = False) -> Matrix | None:
        """The k-th derivative by p of the matrix of φ with its coefficient, or of its forcing; None where that is 0."""
        if is_forcing and not self.order:
            return None
        if callable(self.phase):
            return self.phase(p, derivative)
        size = math.expm1(p * self.of_p.log_factor) if is_forcing and self.is_wall else self.of_p(p, derivative)
        return size * self.phase if size else None


class Terms:
    """L(p) of a problem, and ∂L(p)/∂θ, term by term, on whatever functions of the phase or of directions.

    Args:
        framed: the motion, and what white noise adds to it.
        phi: the functions of the phase, or of directions.
        noises: those of each noise.

    Attributes:
        words: h·∇, q and the square of their sum, of `Term.text`.
        keeps_constants: whether ⟨P_s, L₀T⟩ = 0 for every T: the order 0 only rotates uniformly, as it does in the plane
            alone.
    """

    words: tuple[str, str, str]
    keeps_constants = False

    def __init__(self, framed: Framed, phi: Any, noises: Sequence[Any]) -> None:
        self.phi, self.noises, self._names = phi, noises, tuple(framed.problem.valued.parts)
        self._framed, self.system = framed, framed.motion

    def all(self) -> list[Term]:
        """L(p) of Eq. (19)."""
        found = []
        for name in self._names:
            text = f"L_ξ, the generator of the noise{f' {name}' if name else ''}"
            found.append(self._term(self.phi.matrix(one), None, text, name=name))
        for term in self.system.terms:
            found += self._driven(term)
        for each in self.system.diffusions:
            found += self._diffused([(0.5, each, each)])
        return [*found, *self._loads()]

    def growth_bound(self, p: float, noises: Sequence[Any]) -> float:
        """Λ(p) from above, about: (|p| + n) ‖A‖ max |g| for each term of the motion of n variables, and so on."""
        total, power = 0.0, abs(p) + self._framed.problem.dimension
        for term in self.system.terms:
            size = power * self.system.epsilon**term.order * float(np.linalg.norm(term.matrix, 2))
            total += size * float(np.max(np.abs(term.g(noises[self.place(term.noise)].xi))))
        for each in self.system.diffusions:
            total += 0.5 * (power * self.system.epsilon**each.order * float(np.linalg.norm(each.matrix, 2))) ** 2
        return total

    def changed(self, by: ParameterDerivative) -> Iterator[Term]:
        """∂L(p)/∂θ of the same terms; what makes functions smooth is held."""
        by = self._framed.changed(by)
        for term in by.terms:
            yield from self._driven(term)
        for own, other in zip(self.system.diffusions, by.diffusions, strict=bool(by.diffusions)):
            yield from self._diffused([(0.5, own, other), (0.5, other, own)])
        yield from self._changed_loads(by)

    def _loads(self) -> Iterator[Term]:
        """Walls, impulses, and what makes functions smooth."""
        raise NotImplementedError

    def _changed_loads(self, by: ParameterDerivative) -> Iterator[Term]:
        """∂/∂θ of these, but for what makes functions smooth."""
        return iter(())

    def _matrices(self, term: CoefficientMatrix) -> tuple[Matrix, Matrix]:
        """h·∇ and q of a term of the motion."""
        return self.phi.motion(term)

    def _driven(self, term: CoefficientMatrix) -> Iterator[Term]:
        """h·∇ + p q of a term of the motion."""
        size = self.system.epsilon**term.order
        for k, matrix in enumerate(self._matrices(term)):
            if abs(matrix).max():
                yield self._term(size * matrix, term.g, self.words[k], OfMoment(k), term.order, term.noise, term)

    def _diffused(self, pairs: Sequence[tuple[float, CoefficientMatrix, CoefficientMatrix]]) -> Iterator[Term]:
        """Σ c (h_a·∇ + p q_a)(h_b·∇ + p q_b) of matrices a and b, written by the first one."""
        order, parts = min(a.order + b.order for _, a, b in pairs), list[Any]()
        for c, a, b in pairs:
            size = c * self.system.epsilon ** (a.order + b.order)
            parts.append([size * part for part in self.phi.diffusion(a, b)])
        for power, of_pairs in enumerate(zip(*parts, strict=True)):
            yield self._term(reduce(add, of_pairs), one, self.words[2], OfMoment(power), order, of=pairs[0][1])

    def _term(
        self,
        phase: Phase,
        g: Coefficient | None,
        text: str,
        of_p: OfMoment = OfMoment(0),
        order: int = 0,
        name: str = "",
        of: CoefficientMatrix | None = None,
        is_wall: bool = False,
    ) -> Term:
        """One with a function of the noise of a name, or of the first."""
        noises: list[Coefficient | None] = [one] * len(self._names)
        noises[self.place(name)] = g
        return Term(order, of_p, phase, tuple(noises), text, of, is_wall)

    def place(self, name: str) -> int:
        """The place of a noise among those that have values; the first one for others."""
        return self._names.index(name) if name in self._names else 0
