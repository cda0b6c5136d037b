"""Λ(p) by the principal eigenpair on elements, of the phase of two variables.

A discretisation is chosen for each p, each solve goes on from the nearest p. It is refined until Λ(p) meets a
tolerance, or the budget is spent.
"""

from __future__ import annotations

import math
import sys
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.budget import unless_over_budget
from fpsolve.errors import NotConverged
from fpsolve.exponent.eigen import (
    PairDerivatives,
    PrincipalPair,
    length,
    principal_pair,
    second_derivative,
    slope_rounding,
)
from fpsolve.exponent.error import Moment, Solution
from fpsolve.exponent.method import (
    NEGLIGIBLE_P,
    PHASE_AND_NOISE,
    RTOL,
    RTOL_OF_SEVERAL,
    SMALL_P,
    TINIEST_P,
    TINY_P,
    Method,
    Search,
    Stage,
    Tolerance,
)
from fpsolve.exponent.moments import EvenMoment, even_moment
from fpsolve.exponent.starts import Start, first, has_cones, other_centers, turns_back
from fpsolve.fem.axis import FEW_UNKNOWNS
from fpsolve.fem.generator import Generator
from fpsolve.fem.noise_axes import CellAxis
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.coordinates import infinite
from fpsolve.theory.frozen import eigenvalues_at, frozen_noise

MOST_TILT_AWAY = 0.7
"""How far the tilt of a space may be from the best one at another p."""
MOST_ACROSS_ZERO = 0.5
"""How far apart two p of other signs may be for a large space to serve both."""
SLOWEST = 0.9
"""The largest ratio of two changes in turn that is reckoned with."""
WIDER = 4.0
"""Factor by which the interval of noise with algebraic tails is wider where it tells the error of a narrower one."""
SURELY_SEEN = 1e-6
"""A tolerance down from which cells are small enough for their highest modes to show what is in them."""
AT_CORNER = 1e-3
"""Distance from p = −1, where Λ(p) of a saddle with two variables has a corner, or nearly one: two eigenvalues meet."""
MIXED = 100.0
"""‖T′‖ over ‖T‖ from which on T is thought to be a mixture of those of two eigenvalues that meet."""
MOST_EQUATIONS = 8000
"""Of even moments."""
SURELY = 10.0
"""Multiple of the errors of two values from which on they contradict each other."""
ROUNDED = 1e-6
"""Share of the values themselves that is added to that."""


class Elements(Method):
    """Λ(p) by pairs on elements.

    Attributes:
        spaces: what was solved, by p.
        has_witness: whether the equations of even moments are independent of L(p), and quick.
    """

    has_witness = True
    remedy = Remedy.BUDGET

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._even = dict[float, EvenMoment | None]()
        self.spaces: dict[float, Solution] = {}
        self._accepted = dict[float, float]()  # the largest error that was allowed
        self._failed = dict[float, tuple[type[NotConverged], Message]]()
        self._finer = dict[Space, Generator]()

    def _near(self, p: float) -> list[PrincipalPair]:
        """The pairs at other p, the nearest first."""
        return [each.pair for each in sorted(self.spaces.values(), key=lambda each: abs(each.pair.p - p))]

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The principal eigenpair at p and its error, within a tolerance, the usual one if none is given.

        Raises:
            NotConverged: the mesh does not resolve the problem, or the budget does not suffice to find one, or the even
                moment of this p contradicts it.
        """
        if abs(p) < SMALL_P and self.adapts:
            return self._beside_zero(p if abs(p) >= NEGLIGIBLE_P else 0.0, tolerance)
        if tolerance is None and p in self._failed:
            kind, message = self._failed[p]
            raise kind(message)
        allowed = partial(self.allowed, tolerance or self.tolerance)
        if (known := self.spaces.get(p)) and min(known.error, self._accepted[p]) <= allowed(known.pair):
            return known
        try:
            with self.solving(p):
                search, found = Search(p, allowed, self.settings.budget, self.remedy), list[Solution]()
                for stage, near in self.places(p, tolerance or self.tolerance, found):
                    found.append(search.settle(stage, near))
                solution = self.confirmed(search, found)
            self._witness(p, solution.value, solution.error)
        except NotConverged as failure:
            if failure.reason.code is Code.BUDGET_SPENT:  # which tells a value
                self._witness(p, failure.reason.data["value"], failure.reason.data["error"])
            if tolerance is None:  # a tighter one may be out of reach where this is not
                self._failed[p] = type(failure), failure.message
            raise failure from None
        self.spaces[p], self._accepted[p] = solution, allowed(solution.pair)
        return solution

    def _beside_zero(self, p: float, tolerance: Tolerance | None) -> Solution:
        """The pair at a small p, on the functions of that at ±`SMALL_P`, with its share of the error there."""
        near, known = self.near_zero(p, tolerance), self.spaces.get(p)
        if not known or known.pair.generator is not near.pair.generator:
            share = p / near.pair.p
            with self.solving(p):
                search = Search(p, lambda pair: math.inf, self.settings.budget, self.remedy)
                pair = search.settle(Start(self.problem, near.pair.generator.chosen), self._near(p)).pair
            pair = replace(pair, correction=share * near.pair.correction)
            self.spaces[p] = known = Solution(pair, measured=(share * near.error,))
        return known

    @abstractmethod
    def places(self, p: float, tolerance: Tolerance, found: Sequence[Solution]) -> Iterator[tuple[Stage, Any]]:
        """The first stages of the places where Λ(p) may be carried, and what each begins with.

        `found` has what was found at those before.
        """

    def confirmed(self, search: Search, found: Sequence[Solution]) -> Solution:
        """The largest of those at all places."""
        return max(found, key=lambda each: each.value)

    def is_at_corner(self, p: float) -> bool:
        """Whether p is where Λ may have a corner."""
        return False

    def allowed(self, tolerance: Tolerance, pair: PrincipalPair) -> float:
        """The largest error of Λ(p)."""
        return tolerance(pair.p, pair.value)

    def pair_on(self, generator: Generator, p: float, start: PrincipalPair | Sequence[PrincipalPair]) -> PrincipalPair:
        """The principal pair; where it is not found, the failure has the remedy of this place."""
        try:
            return principal_pair(generator, p, start=start)
        except NotConverged as failure:
            raise failure.advising(Remedy.BESIDE if self.is_at_corner(p) else self.remedy) from None

    def finer_pair(self, pair: PrincipalPair) -> PrincipalPair:
        """That at the same p on a finer discretisation, which tells the errors of what the other says.

        Each axis is finer; for algebraic tails its interval is wider, too. Raises as `pair_among`.
        """
        return self.pair_among(widened(pair.generator).finer, pair)

    def pair_among(self, chosen: Space, pair: PrincipalPair) -> PrincipalPair:
        """That at the same p on other functions.

        Raises:
            NotConverged: it cannot be made, has more unknowns than the budget allows, or does not resolve it.
        """
        if chosen.size > (most := self.settings.budget.most(chosen)):
            reason = Message(Code.UNKNOWNS_SPENT, unknowns=chosen.size, most=most)
            raise NotConverged(Message(Code.NOT_FINER, p=pair.p, reason=reason), remedy=self.remedy)
        with self.solving(pair.p):
            generator = self._finer[chosen] = self._finer.get(chosen) or Generator(self.problem, chosen)
            return self.pair_on(generator, pair.p, pair)

    def near_zero(self, p: float, tolerance: Tolerance | None) -> Solution:
        """The solution at ±`SMALL_P` that a smaller p goes with."""
        side = p or (-1.0 if self.lacks_moments else 1.0)  # on which Λ is finite
        q = math.copysign(SMALL_P, side)
        try:
            return self.solution(q, tolerance)
        except NotConverged as failure:
            told = Message(Code.NEAR_ZERO, p=q, reason=failure.message)
            raise type(failure)(told, failure.partial) from failure

    def _witness(self, p: float, value: float, error: float) -> None:
        """Refuse a value with this error that contradicts the even moment of the same p."""
        if (known := self.even(p)) and abs(value - known.value) > doubt(error, known):
            told = Message(Code.NOT_PRINCIPAL, p=p, value=value, other=p, expected=known.value)
            raise NotConverged(told, remedy=self.refinement)

    def even(self, p: float) -> EvenMoment | None:
        """Λ(p) of an even p > 0 by the equations of the moments; None where these do not close, or are too many.

        In the plane it is the witness under noise of several dimensions and under chains, where other pairs may be
        positive, too; under other noise it would take as long as elements do, and is None.
        """
        if p <= 0 or p % 2 or not self.has_witness:
            return None
        if p not in self._even:
            found = None
            with unless_over_budget(), self.solving(p):
                moment = even_moment(self.problem, p, 0.1 * self.tolerance(p, 0.0), MOST_EQUATIONS)
                self.check(p, moment.value, moment.error)
                found = moment
            self._even[p] = found
        return self._even[p]

    def pair(self, p: float) -> PrincipalPair:
        return self.solution(p).pair

    def row(self, p: float) -> Moment:
        """Λ(p), of which enough is left on its scale; of an even p that of the equations where elements do not have it.

        Near p = 0, where rounding is not proportional to p, it is that of Λ(p)/p.
        """
        if self.preferred_even(p):
            return super().row(p)
        even = self.even(p)
        with unless_over_budget() if even else nullcontext():
            solution = self.solution(p)
            value, error = solution.value, solution.error
            if p == 0:  # but for rounding, in every space
                value, error = 0.0, 0.0
            elif abs(p) < TINY_P:
                ratio, error = self.ratio_alone(p)
                value, error = p * ratio, abs(p) * error
            if abs(p) >= TINIEST_P:  # else Λ has no scale
                self.check(p, value, error)
            return Moment(value, solution.derivative, math.nan, error, solution.pair.residual)
        return Moment.of(even)

    def ratio_alone(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float]:
        """Λ(p)/p and its error.

        Near p = 0 it is the mean of Λ′ from 0 to p, by two points of Gauss; its error is that at p = ±`SMALL_P`.
        """
        if abs(p) >= TINY_P:
            return super().ratio_alone(p, tolerance)
        points = {p * (0.5 + shift) for shift in (-0.5 / math.sqrt(3), 0.5 / math.sqrt(3))}
        pairs = [self.solution(point, tolerance).pair for point in points]
        if self.lacks_moments:  # algebraic tails, of which Λ(p) for p < 0 hardly tells: their moments are finite
            return self._among_tails(pairs[0])
        near = self.near_zero(p, tolerance)
        error = near.error / abs(near.pair.p) + slope_rounding(pairs[0])
        return float(np.mean([pair.derivative for pair in pairs])) + near.pair.correction / near.pair.p, error

    def ratio(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float, float]:
        if abs(p) >= TINY_P:
            return super().ratio(p, tolerance)
        value, error = self.ratio_alone(p, tolerance)
        return value, 0.5 * self.around_zero.second_derivative, error

    def _among_tails(self, pair: PrincipalPair) -> tuple[float, float]:
        """λ from a pair at p = 0, on ever wider intervals of the noise, with what the ends and the first cells leave.

        As the variance is finite, an interval twice as wide leaves less than half of λ that the noise makes beyond it.
        """
        lacked = self._lacked(pair)
        change = math.inf if any(are_cut(pair.space.xi)) else 0.0
        while change > (WIDER - 1) * self.tolerance(SMALL_P, 0.0) / SMALL_P:
            wider = self.pair_among(widened(pair.generator), pair)
            change, pair = abs(wider.derivative - pair.derivative), wider
        return pair.derivative, change / (WIDER - 1) + lacked

    def _lacked(self, pair: PrincipalPair) -> float:
        """Estimate of |error of Λ′| on the interval of a noise: twice what a finer discretisation changes."""
        finer = self.pair_among(pair.generator.chosen.finer, pair)
        return 2 * abs(finer.derivative - pair.derivative) + slope_rounding(pair)

    def slope_error(self, p: float) -> float:
        """1.5 times the larger of two changes by finer discretisations over 1 − r, r their ratio if they have one sign.

        With one finer one alone r is taken as ¼. Both may be small by chance, so that the error of Λ is added.
        """
        if abs(p) < TINIEST_P:
            return self.ratio_alone(0.0)[1]
        solution = self.solution(p)
        rest = slope_rounding(solution.pair) + (self._jump() if self.is_at_corner(p) else 0.0)
        finer = self.finer_pair(solution.pair)
        change = finer.derivative - solution.derivative
        more = 0.25 * change
        with unless_over_budget():
            more = self.finer_pair(finer).derivative - finer.derivative
        ratio = np.clip(more / (change or sys.float_info.min), 0.0, SLOWEST)
        return float(1.5 * max(abs(change), abs(more)) / (1 - ratio) + solution.error + rest)

    def _jump(self) -> float:
        """What Λ′ rises at p = −1 if Λ″ on both sides does not explain it: there is any slope between at a corner."""
        low, high = (self.solution(-1 + side).pair for side in (-2 * AT_CORNER, 2 * AT_CORNER))
        rise, smooth = high.derivative - low.derivative, second_derivative(low) + second_derivative(high)
        return rise if rise > 3 * smooth * 2 * AT_CORNER else 0.0


class PlaneElements(Elements):
    """Λ(p) of two variables."""

    is_function = True
    pictures = PHASE_AND_NOISE

    @property
    def usual_rtol(self) -> float:  # type: ignore[override]
        return RTOL_OF_SEVERAL if self.is_dear(1.0) else RTOL

    @property
    def turns_back(self) -> bool:  # type: ignore[override]
        return self.is_quick and turns_back(self.problem)

    def is_dear(self, p: float) -> bool:
        return len(self.problem.valued.parts) > 1

    @property
    def is_quick(self) -> bool:  # type: ignore[override]
        return self.problem.valued.variables == 1

    @property
    def no_picture(self) -> str:  # type: ignore[override]
        noise = self.problem.valued
        if len(noise.parts) > 1:
            several = "an eigenfunction of the phase and of several noises that are not white cannot be drawn"
            return f"{several}; make all of these noises white but one"
        if noise.is_markov:
            return ""
        return (
            f"{noise.kind} noise is no Markov process by itself, so that an eigenfunction is not a function of phase "
            "and noise, which could be drawn; look at Λ(p), or at densities of a simulation"
        )

    def places(self, p: float, tolerance: Tolerance, found: Sequence[Solution]) -> Iterator[tuple[Stage, Any]]:
        """The first one is that of the nearest p, if it is not far away, else where slow noise carries
        the moment, or the mean of other noise. Others are far from there.
        """
        near = self._near(p)
        space = near and self._moved(near[0], p)
        yield Start(self.problem, space or first(self.problem, p, self.settings.rtol)), near
        for center in other_centers(found[0].pair):
            yield Start(self.problem, first(self.problem, p, self.settings.rtol, center)), None

    def _moved(self, near: PrincipalPair, p: float) -> Space | None:
        """The space of another p, with the tilt for this one if its own is far off; None where p is far away."""
        q, space, frozen = near.p, near.generator.chosen, frozen_noise(self.problem)
        if space.size > FEW_UNKNOWNS and p * q < 0 and abs(p - q) > MOST_ACROSS_ZERO:
            return None
        if frozen is None or not self.problem.valued.may_tilt:
            return space
        tilt = frozen.tilt(frozen.center(p))
        if abs(tilt - space.xi.slope * p) <= MOST_TILT_AWAY:
            return space
        is_near = abs(tilt - frozen.tilt(frozen.center(q))) <= MOST_TILT_AWAY
        return space.with_axis(1, replace(space.xi, slope=tilt / p)) if is_near else None

    def confirmed(self, search: Search, found: Sequence[Solution]) -> Solution:
        """The largest one, if it agrees with that of halved cells of φ within its error, or within what is allowed.

        At a coarse tolerance a thin layer of T, as where the phase rests, may lie within a cell that is so large that
        none of its modes shows it. Where two eigenvalues meet, modes of a mixture of both T tell little.
        """
        best = super().confirmed(search, found)
        chosen = best.pair.generator.chosen
        if self.is_at_corner(search.p) and length(PairDerivatives(best.pair).by_p) > MIXED * length(best.pair.right):
            halves = chosen.doubled()
            with unless_over_budget():
                pair = self.pair_among(halves, best.pair)
                return replace(best, unresolved=2 * abs(pair.value - best.value))
            return self.confirmed(search, [search.settle(Start(self.problem, halves))])
        halved = chosen.with_axis(0, chosen.phi.doubled())
        if self.settings.rtol <= SURELY_SEEN or halved.size > self.settings.budget.most(halved):
            return best
        finer = search.settle(Start(self.problem, halved), best.pair)
        change = abs(finer.value - best.value)
        if change <= best.error:
            return best
        if change + finer.error <= search.allowed(finer.pair):
            return replace(finer, unresolved=finer.unresolved + change)
        return self.confirmed(search, [finer])

    def is_at_corner(self, p: float) -> bool:
        return abs(p + 1) <= AT_CORNER and not eigenvalues_at(self.problem, 0.0)[2]

    @property
    def has_witness(self) -> bool:  # type: ignore[override]
        return frozen_noise(self.problem) is None and not self.problem.valued.is_white

    def bounds(self, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[Message, ...]:
        """That Λ(p) for p < −1 depends on the start, or nothing.

        On paths with singular values s₁ > s₂ of the matrix that moves x, starts in the cone of the faster mode grow as
        s₁. Of those in that of the slower one a share s₂/s₁ stays there and grows as s₂. So there are E s₁^p and
        E s₂^(p + 1)/s₁, which are equal at p = −1.
        """
        return (Message(Code.START_MATTERS),) if np.any(p < -1) and has_cones(self.problem) else ()


class GivenMesh(PlaneElements):
    """Λ(p) of two variables on a given mesh, with the error that a finer one tells."""

    adapts = False
    goes_on = False
    remedy = Remedy.MESH

    @cached_property
    def generators(self) -> tuple[Generator, Generator]:
        """That of the mesh, and one that is finer twice, whose error hardly counts beside it. Raises `MeshError`."""
        assert self.settings.mesh is not None
        generator = Generator(self.problem, self.settings.mesh)
        return generator, Generator(self.problem, generator.chosen.finer.finer)

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        _ = self.generators  # refuses a mesh that cannot be used
        return super().solution(p, tolerance)

    def places(self, p: float, tolerance: Tolerance, found: Sequence[Solution]) -> Iterator[tuple[Stage, Any]]:
        return iter(())

    def confirmed(self, search: Search, found: Sequence[Solution]) -> Solution:
        """The solution on the mesh, whatever its error."""
        coarse, fine = self.generators
        pair = self.pair_on(coarse, search.p, self._near(search.p))
        return Solution(pair, measured=(abs(self.pair_on(fine, search.p, pair).value - pair.value),))

    def allowed(self, tolerance: Tolerance, pair: PrincipalPair) -> float:
        return math.inf

    def finer_pair(self, pair: PrincipalPair) -> PrincipalPair:
        """It reaches further, too, where an end of the interval cuts off what counts."""
        chosen = widened(pair.generator)
        if chosen.xi.lines.size:
            chosen = chosen.with_axis(1, chosen.xi.reaching(*are_cut(chosen.xi)))
        return self.pair_among(chosen.finer, pair)

    def _among_tails(self, pair: PrincipalPair) -> tuple[float, float]:
        """λ, on the interval of the mesh, and what a wider one would change."""
        change = abs(self.pair_among(widened(pair.generator), pair).derivative - pair.derivative)
        return pair.derivative, change * WIDER / (WIDER - 1) + self._lacked(pair)

    def doubts(self, p: Sequence[float]) -> tuple[Message, ...]:
        """That slow noise may carry a moment elsewhere, where the mesh does not show it."""
        pairs = [self.spaces[each].pair for each in p if each in self.spaces]
        elsewhere = ((pair.p, z) for pair in pairs for z in other_centers(pair))
        return tuple(Message(Code.CARRIED_ELSEWHERE, p=p, z=z, remedy=Remedy.REACH) for p, z in elsewhere)[:1]


def doubt(error: Any, known: Any) -> Any:
    """The difference beyond which a value with this error, or each of some, contradicts an even moment."""
    return SURELY * (error + known.error) + ROUNDED * abs(known.value)


def are_cut(xi: CellAxis) -> list[bool]:
    """Whether what counts of the variance of a noise lies beyond each of the ends of its cells."""
    ends = xi.lines[[0, -1]]
    return (xi.weight(ends) * ends**2 > sys.float_info.epsilon).tolist()


def widened(generator: Generator) -> Space:
    """That of a generator, on an interval `WIDER` times as wide for algebraic tails."""
    chosen, lines = generator.chosen, generator.chosen.xi.lines
    if not (lines.size and infinite(generator.problem, 1.0)):
        return chosen
    steps = WIDER ** np.linspace(0, 1, 4)[1:]
    wide = np.concatenate([(lines[0] * steps)[::-1], lines, lines[-1] * steps])
    return chosen.with_axis(1, chosen.xi.between(wide))
