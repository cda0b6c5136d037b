"""Λ(p) of even p alone, by closed equations of moments: of many variables, of impulses, and of delays, for p = 2."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.budget import unless_over_budget
from fpsolve.exponent.method import RTOL_BEYOND_PLANE, Method, Tolerance
from fpsolve.exponent.moments import EvenMoment, constant_scale, even_moment
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.coordinates import infinite
from fpsolve.model.quantity import moment_at
from fpsolve.theory.perturbation import Scale

OF_CLOSED = 1e-4
"""Share of rtol that moments lack of the terms of their equations, as ω is one of these, and Λ a share of ζω."""


class EvenMoments(Method):
    """Λ(p) of even p > 0 of variables whose directions are too many."""

    name = "closed equations of moments"
    usual_rtol = RTOL_BEYOND_PLANE
    by_moments = True
    no_picture = "functions of the directions of so many variables are not computed; look at Λ(2)"
    code = Code.EVEN_ONLY
    is_struck = False

    def has(self, p: float) -> bool:
        return p > 0 and p % 2 == 0

    def reason(self, p: float, symbol: str = "") -> Message | None:
        if not self.has(p):
            symbol = symbol or (moment_at(p).symbol if p else "λ")
            count, remedy = self.problem.dimension, Remedy.SIMULATION
            return Message(self.code, what=symbol, count=count, is_struck=self.is_struck, remedy=remedy)
        return infinite(self.problem, p, symbol)

    def line_rtol(self, p: float) -> float:
        return 1e-7

    @cached_property
    def scales(self) -> Scale:
        """The size of the noise is that of what it does to the fastest modes."""
        return constant_scale(self.problem)

    def preferred_even(self, p: float) -> EvenMoment | None:
        return self.solution(p) if self.has(p) else None

    def even(self, p: float) -> EvenMoment | None:
        with unless_over_budget():  # of a witness nothing is told
            return self.preferred_even(p)
        return None

    @cached_property
    def _solved(self) -> dict[float, EvenMoment]:
        return {}

    def solution(self, p: float, tolerance: Tolerance | None = None) -> EvenMoment:
        if p not in self._solved:
            with self.solving(p):
                settings = self.settings
                found = even_moment(self.problem, p, rtol=OF_CLOSED * settings.rtol, budget=settings.budget)
            self.check(p, found.value, found.error)
            self._solved[p] = found
        return self._solved[p]

    def bounds(self, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[Message, ...]:
        """What even moments say of λ, of Λ between them, and of δ_p; or nothing."""
        if not p.size:
            return ()
        at, low = int(np.argmin(p)), float(p[value < -error].max(initial=0.0))
        high = float(p[value > error].min(initial=np.inf))
        root = " and ".join([f"> {low:g}"] * (low > 0) + [f"< {high:g}"] * (high < np.inf))
        bound = float(value[at] + error[at]) / float(p[at])
        return (Message(Code.CONVEX_BOUNDS, p=p[at], bound=bound, root=root or None),)


class StruckMoments(EvenMoments):
    """Those of few variables, whose directions impulses move."""

    is_struck = True


class DelayMoments(EvenMoments):
    """Λ(2) of a state that its past moves."""

    code = Code.DELAY_ONLY

    def has(self, p: float) -> bool:
        return p == 2


class NotComputed(EvenMoments):
    """No Λ(p) is computed: a wall for one of several variables, of which there are no elements."""

    code = Code.WALL_SIMULATED
    is_computed = False

    def has(self, p: float) -> bool:
        return False
