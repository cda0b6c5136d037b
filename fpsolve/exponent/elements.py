"""Λ(p) by the principal eigenpair on elements: of the phase of two variables, or of directions of three and four."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.budget import unless_over_budget
from fpsolve.errors import NoHierarchy, NotConverged
from fpsolve.exponent.adapt import AT_CORNER, WIDER, WholeProblem, is_at_corner, solved_p, widened
from fpsolve.exponent.changed import SMALL_P as SMALLEST
from fpsolve.exponent.changed import Changed
from fpsolve.exponent.eigen import PairDerivatives, PrincipalPair, second_derivative, slope_rounding
from fpsolve.exponent.error import Estimate, Moment, Solution, checked, slope_error
from fpsolve.exponent.fields import no_picture_of
from fpsolve.exponent.method import RTOL, RTOL_BEYOND_PLANE, RTOL_OF_SEVERAL, Method, Tolerance, refuse_tails
from fpsolve.exponent.moments import EvenMoment, even_moment, moment_row
from fpsolve.fem.factors import one_thread
from fpsolve.fem.generator import SMALL_P
from fpsolve.messages import Code, Message
from fpsolve.model import quantity
from fpsolve.model.problem import ParameterDerivative, Problem

MOST_EQUATIONS = 8000
"""Of even moments."""
SURELY = 10.0
"""Multiple of the errors of two values from which on they contradict each other."""
ROUNDED = 1e-6
"""Share of the values themselves that is added to that."""
TINY_P = 1e-3
"""Below it Λ(p)/p is a mean of Λ′, as rounding is not proportional to p."""
TINIEST_P = 1e-9
"""For smaller |p| the error of Λ(p), which falls as p, has no scale, which may fall as p²."""


class Elements(Method):
    """Λ(p) of two variables."""

    is_function = True

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._even = dict[float, EvenMoment | None]()

    @classmethod
    def takes(cls, problem: Problem) -> bool:
        return True

    @property
    def usual_rtol(self) -> float:  # type: ignore[override]
        return RTOL_OF_SEVERAL if self.is_dear(1.0) else RTOL

    def is_dear(self, p: float) -> bool:
        return len(self.problem.coloured.parts) > 1

    @property
    def no_picture(self) -> str:  # type: ignore[override]
        return no_picture_of(self.problem)

    @property
    def goes_on(self) -> bool:  # type: ignore[override]
        return self.settings.mesh is None and not self.problem.noise.has_algebraic_tails

    @cached_property
    def whole(self) -> WholeProblem:
        """What solves the eigenproblem."""
        own = self.settings
        return WholeProblem(
            self.problem,
            mesh=own.mesh,
            rtol=own.rtol,
            budget=own.budget,
            tolerance=self.tolerance,
            meter=own.meter,
            starts=self._starts,
        )

    @property
    def _starts(self) -> Mapping[float, Any]:
        return self.settings.starts

    @property
    def known(self) -> Mapping[float, Any]:  # type: ignore[override]
        return self.whole.known

    @property
    def spaces(self) -> Mapping[float, Any]:  # type: ignore[override]
        return self.whole.known

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The principal eigenpair at p and its error, which no even moment contradicts. Raises `NotConverged`."""
        point = solved_p(p)
        try:
            found = self.whole.solution(point, tolerance)
        except NotConverged as failure:
            if failure.reason.code is Code.BUDGET_SPENT:  # which tells a value
                self._witness(point, failure.reason.data["value"], failure.reason.data["error"])
            raise
        self._witness(point, found.value, found.error)
        return found

    def _witness(self, p: float, value: float, error: float) -> None:
        """Refuse a value with this error that contradicts the even moment of the same p."""
        if (known := self.even(p)) and abs(value - known.value) > doubt(error, known):
            told = {"p": p, "value": value, "other": p, "expected": known.value}
            raise NotConverged(Message(Code.NOT_PRINCIPAL, **told), remedy=self.refinement)

    def even(self, p: float) -> EvenMoment | None:
        """Λ(p) of an even p > 0 by the equations of the moments; None where these do not close, or are too many.

        In the plane it is the witness under noise of several dimensions and under chains, where other pairs may be
        positive, too; under other noise it would take as long as elements do, and is None.
        """
        if p <= 0 or p % 2 or not self._has_witness:
            return None
        if p not in self._even:
            self._even[p] = None
            with suppress(NoHierarchy, ArithmeticError), unless_over_budget():
                with one_thread(), self.settings.meter.running():
                    found = even_moment(self.problem, p, 0.1 * self.tolerance(p, 0.0), MOST_EQUATIONS)
                checked(Estimate(found.value, found.error, self.scale(p)), self.refinement, p)
                self._even[p] = found
        return self._even[p]

    @property
    def _has_witness(self) -> bool:
        noise = self.problem.coloured
        return len(noise.parts) > 1 or noise.basis == "pairs" or (noise.has_states and not noise.is_white)

    def pair(self, p: float) -> PrincipalPair:
        return self.solution(p).pair

    def row(self, p: float) -> tuple[Moment, PrincipalPair | None]:
        """Λ(p) on the scale of the terms of Eq. (37) before they cancel.

        Near p = 0, where rounding is not proportional to p, it is that of Λ(p)/p.
        """
        try:
            solution = self.solution(p)
            value, error, pair = solution.value, solution.error, solution.pair
            if p == 0:  # but for rounding, in every space
                value, error = 0.0, 0.0
            elif abs(p) < TINY_P:
                ratio, error = self.ratio_alone(p)
                value, error = p * ratio, abs(p) * error
            found = Estimate(value, error, self.scale(p), quantity=quantity.moment_at(p))
            if abs(p) >= TINIEST_P:  # else Λ has no scale
                checked(found, self.refinement, p)
        except NotConverged:
            if even := self.even(p):
                return moment_row(even), None
            raise
        return Moment(found.value, pair.derivative, math.nan, found.error_estimate, pair.residual), pair

    def ratio_alone(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float]:
        """Λ(p)/p and its error.

        Near p = 0 it is the mean of Λ′ from 0 to p, by two points of Gauss; its error is that at p = ±`SMALL_P`.
        """
        if known := self.number(p):
            return known.value / p, known.error / p
        if abs(p) >= TINY_P:
            solution = self.whole.solution(p, tolerance)
            return solution.value / p, solution.error / abs(p)
        points = {p * (0.5 + shift) for shift in (-0.5 / math.sqrt(3), 0.5 / math.sqrt(3))}
        pairs = [self.whole.solution(point, tolerance).pair for point in points]
        if self.problem.has_algebraic_tails:  # of which Λ(p) for p < 0 hardly tells: their moments are finite
            return self._among_tails(pairs[0])
        near = self.whole.near_zero(p, tolerance)
        error = near.error / abs(near.pair.p) + slope_rounding(pairs[0])
        return float(np.mean([pair.derivative for pair in pairs])) + near.pair.correction / near.pair.p, error

    def ratio(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float, float]:
        value, error = self.ratio_alone(p, tolerance)
        if abs(p) < TINY_P:  # ∫₀¹ s Λ″(sp) ds, by one point of Gauss
            return value, 0.5 * second_derivative(self.whole.solution(p * 2 / 3, tolerance).pair), error
        return value, (self.whole.solution(p, tolerance).derivative - value) / p, error

    def _among_tails(self, pair: PrincipalPair) -> tuple[float, float]:
        """λ from a pair at p = 0, on ever wider intervals of the noise, and what its modes and the ends leave.

        As the variance is finite, an interval twice as wide leaves less than half of λ that the noise makes beyond it.
        On a given mesh it is that of the mesh.
        """
        ends = pair.space.xi.lines[[0, -1]]
        change = math.inf if np.any(pair.space.xi.weight(ends) * ends**2 > sys.float_info.epsilon) else 0.0
        while change > (WIDER - 1) * self.tolerance(SMALL_P, 0.0) / SMALL_P:
            wider = self.whole.pair_among(widened(pair.generator), pair)
            change = abs(wider.derivative - pair.derivative)
            if self.settings.mesh is not None:
                return pair.derivative, change * WIDER / (WIDER - 1) + slope_error(pair)
            pair = wider
        return pair.derivative, change / (WIDER - 1) + slope_error(pair)

    def slope_error(self, p: float) -> float:
        """It is from the highest modes, see `error.slope_error`; where these do not tell, twice what a finer
        discretisation changes, or what has changed since a coarser one of the same place.
        """
        if abs(p) < TINIEST_P:
            return self.ratio_alone(0.0)[1]
        solution = self.solution(p)
        with one_thread():
            jump = self._jump() if is_at_corner(self.problem, p) else 0.0
            if solution.measured is None:
                return slope_error(solution.pair) + jump
            coarser = [each.pair for each in getattr(solution.start, "before", ())]
            other = coarser[-1] if coarser else self.whole.finer_pair(solution.pair)
            return 2 * abs(other.derivative - solution.derivative) + slope_rounding(solution.pair) + jump

    def _jump(self) -> float:
        """What Λ′ rises at p = −1 if Λ″ on both sides does not explain it: there is any slope between at a corner."""
        low, high = (self.solution(-1 + side).pair for side in (-2 * AT_CORNER, 2 * AT_CORNER))
        rise, smooth = high.derivative - low.derivative, second_derivative(low) + second_derivative(high)
        return rise if rise > 3 * smooth * 2 * AT_CORNER else 0.0

    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖.

        Its error is what two finer discretisations change in it, as one change is small by chance; twice the first one
        where the second has too many unknowns.
        """
        refuse_tails(self.problem)
        scale = 2 * self.scales.quadratic
        value, better = self.around_zero.second_derivative, self.finer_around_zero.second_derivative
        error = 2 * abs(better - value)
        with unless_over_budget():
            finest = PairDerivatives(self.whole.finer_pair(self.finer_around_zero.pair)).second_derivative
            error, better = abs(finest - better) + 0.5 * error, finest
        error += 10 * sys.float_info.epsilon * max(scale, abs(better))
        return checked(Estimate(better, error, scale, quantity=quantity.VARIANCE_RATE), self.refinement)

    @cached_property
    def around_zero(self) -> PairDerivatives:
        return PairDerivatives(self.whole.solution(0.0).pair)

    @cached_property
    def finer_around_zero(self) -> PairDerivatives:
        """For algebraic tails of a wider one. Raises `NotConverged`."""
        return PairDerivatives(self.whole.finer_pair(self.around_zero.pair))

    def finer_pair(self, pair: PrincipalPair) -> PrincipalPair:
        return self.whole.finer_pair(pair)

    def gradient_along(self, p: float, along: Sequence[ParameterDerivative]) -> FloatArray:
        is_large = abs(p) >= SMALLEST
        around = PairDerivatives(self.whole.solution(p).pair) if is_large else self.around_zero
        changed = [Changed(around, by) for by in along]
        if is_large:
            return np.array([each.value.value / p for each in changed])
        more = [0.5 * p * each.curvature.value if p else 0.0 for each in changed]
        return np.array([each.slope.value for each in changed]) + more


class Directions(Elements):
    """Λ(p) of three and four variables; of even p it is that of the equations of the moments, where these close."""

    is_function = False
    _has_witness = True
    _starts = known = MappingProxyType[float, Any]({})
    no_picture = ""

    @classmethod
    def takes(cls, problem: Problem) -> bool:
        return problem.dimension > 2

    @property
    def usual_rtol(self) -> float:  # type: ignore[override]
        return 1e-3 if self.problem.system.stop else RTOL_BEYOND_PLANE  # where T is a root

    def is_dear(self, p: float) -> bool:
        return p <= 0 or p % 2 != 0

    def line_rtol(self, p: float) -> float:
        return 3e-3 if self.problem.system.stop else super().line_rtol(p)

    def number(self, p: float) -> EvenMoment | None:
        return self.even(p)

    def row(self, p: float) -> tuple[Moment, PrincipalPair | None]:
        return (moment_row(even), None) if (even := self.even(p)) else super().row(p)

    def gradient(self, p: float, keys: Sequence[str]) -> FloatArray:
        return known.gradient(keys) / p if (known := self.even(p)) else super().gradient(p, keys)


def doubt(error: float, known: Any) -> float:
    """The difference beyond which a value with this error contradicts an even moment."""
    return SURELY * (error + float(known.error)) + ROUNDED * abs(float(known.value))
