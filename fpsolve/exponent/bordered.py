"""Derivatives of an eigenpair by p: T′ and T*′ from bordered systems, and Λ″(p) from them."""

from __future__ import annotations

import sys
from functools import cached_property

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.fem.factors import Factors, one_thread

REFINEMENTS = 3
"""Of T′, by each of which its error falls to 1e-6 of a rate over the gap of the spectrum."""


class Bordered:
    """(L − Λ)v = f with ⟨T*, v⟩ = 0, where ⟨T*, f⟩ = 0, and the same with the adjoint of L.

    A system is solved with a shift a little off Λ, and what that leaves of T in v is removed.

    Args:
        pair: Λ(p), T and T*.
    """

    def __init__(self, pair: PrincipalPair) -> None:
        self.pair, self._weighed = pair, (pair.space.weighed(pair.right), pair.space.weighed(pair.left))
        self.norm = float(pair.left @ self._weighed[0])
        self._pencil = pair.generator.at(pair.p)
        self._operator = self._pencil.matrix.shifted(pair.value)

    @cached_property
    def _factor(self) -> Factors:
        return self._pencil.factorised(self.pair.value + 1e-6 * self.pair.generator.unit_rate)

    def solve(self, source: FloatArray, *, adjoint: bool = False) -> FloatArray:
        """v from the load f."""
        own, other = self.pair.right, self.pair.left
        weighed, operator, change = self._weighed[0], self._operator, 0.0 * own
        if adjoint:
            own, other, weighed, operator = other, own, self._weighed[1], operator.T
        with one_thread():
            invert = self._factor.solve_transposed if adjoint else self._factor.solve
            for _ in range(REFINEMENTS):
                rest = source - operator @ change
                rest -= (other @ rest) / self.norm * weighed
                change += invert(rest)
                change -= (other @ self.pair.space.weighed(change)) / self.norm * own
        return change

    @cached_property
    def by_p(self) -> FloatArray:
        """T′: (L − Λ)T′ = −(L′ − Λ′)T."""
        pair = self.pair
        slope = pair.generator.matrix(pair.p, derivative=1)
        return self.solve(pair.derivative * self._weighed[0] - slope @ pair.right)

    @cached_property
    def adjoint_by_p(self) -> FloatArray:
        """T*′/P_s."""
        pair = self.pair
        slope = pair.generator.matrix(pair.p, derivative=1)
        return self.solve(pair.derivative * self._weighed[1] - slope.T @ pair.left, adjoint=True)

    @cached_property
    def second_by_p(self) -> FloatArray:
        """T″: (L − Λ)T″ = −(L″ − Λ″)T − 2(L′ − Λ′)T′."""
        pair, change = self.pair, self.by_p
        slope, curvature = (pair.generator.matrix(pair.p, derivative=k) for k in (1, 2))
        source = self.second_derivative * self._weighed[0] - curvature @ pair.right
        return self.solve(source - 2 * (slope @ change - pair.derivative * pair.space.weighed(change)))

    @cached_property
    def second_derivative(self) -> float:
        """Λ″(p) = ⟨T*, L″T⟩ + 2⟨T*, (L′ − Λ′)T′⟩."""
        pair, change = self.pair, self.by_p
        slope, curvature = (pair.generator.matrix(pair.p, derivative=k) for k in (1, 2))
        mixed = pair.left @ (slope @ change) - pair.derivative * (pair.left @ pair.space.weighed(change))
        return float((pair.left @ (curvature @ pair.right) + 2 * mixed) / self.norm)


def second_derivative(pair: PrincipalPair) -> float:
    """Λ″(p), see `Bordered`."""
    return Bordered(pair).second_derivative


def slope_rounding(pair: PrincipalPair) -> float:
    """Bound on the effect of rounding on Λ′."""
    slope = pair.generator.matrix(pair.p, derivative=1)
    bound = abs(pair.left) @ (abs(slope) @ abs(pair.right))
    return float(sys.float_info.epsilon * bound * pair.space.turns)
