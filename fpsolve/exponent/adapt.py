"""Λ(p): the discretisation is chosen for each p, each solve goes on from the nearest p.

A discretisation is refined until Λ(p) meets a tolerance, or the budget is spent. Slow noise may carry a moment in
another place than the one that was found: then both are solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from typing import Annotated, NoReturn, TypeVar

import numpy as np
from pydantic.dataclasses import dataclass as pydantic_dataclass

from fpsolve.budget import Countdown, OverBudget, counted, half_the_memory, under_way
from fpsolve.errors import FpsolveError, MeshError, NotConverged, SingularMatrix
from fpsolve.exponent.eigen import BACKWARD_ERROR_LIMIT, PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution, mode_effects
from fpsolve.exponent.starts import first, other_centers
from fpsolve.fem.effects import ModeEffects
from fpsolve.fem.factors import MAX_DENSE_UNKNOWNS, one_thread
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.faults import with_plain_errors
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.model.problem import Problem
from fpsolve.theory.frozen import frozen_noise

MAX_STAGES = 30
WORTH_A_TRY = MAX_DENSE_UNKNOWNS
"""Unknowns of a system that takes less time than finding another one."""
MOST_TILT_AWAY = 0.7
"""How far the tilt of a space may be from the best one at another p."""
TRIM = 0.8
"""A smaller space must have at most this share of the unknowns."""
SMALL_P = 1e-2
"""For smaller |p| the discretisation is chosen at this one, as Λ and its error go to zero together."""
NEGLIGIBLE_P = 1e-30
"""Pairs at smaller |p| are those at p = 0, from which they differ by less than by rounding."""
NEIGHBOURS = 6
"""How many known eigenfunctions those of another p are interpolated from."""
FREE_STAGES = 4
"""From this number of stages on, no cell is made coarser."""
SHARE = 0.05
"""Share of the tolerance that a new discretisation is made for in each direction, so that it serves other p too."""
ALONE = 0.5
"""Share of the tolerance in each direction of a discretisation that serves one p only."""
MOST_GAIN = 1e-3
"""Least factor by which one stage with cells of the noise aims to reduce the error: a larger fall is foreseen badly."""
WIDER = 4.0
"""Factor by which the interval of noise with algebraic tails is wider where it tells the error of a narrower one."""
SURELY_SEEN = 1e-6
"""A tolerance down from which cells are small enough for their highest modes to show what is in them."""
MOST_HALVED = 20_000
"""Unknowns of a system on halved cells that is solved for that: beyond, cells are many, and it takes long."""
A_THIRD_MORE = 4 / 3
"""What a budget may be exceeded by."""
Tolerance = Callable[[float, float], float]
"""The largest error allowed, from p and a value of Λ(p)."""
GROWTH = 1.5
"""A stage costs about this power of the number of unknowns, by the last one."""
UNSOLVED = MeshError, NotConverged, SingularMatrix, np.linalg.LinAlgError
"""What is raised where a discretisation does not have the principal pair, so that another one is tried."""
Found = TypeVar("Found")


@with_plain_errors
@pydantic_dataclass(frozen=True, config=STRICT)
class Budget:
    """What one number may cost, and a line of a chart. A number that is given does not depend on it.

    Args:
        unknowns: of the largest system.
        seconds: of a processor for one number, such as Λ(2), λ or Λ″(0), with all that it takes; foreseen before each
            factorisation, by counting operations at a fixed speed. The nodes of a row of a scan share it, and each may
            take half of what is left.
        memory: of the process, in gigabytes, foreseen as the seconds; None for half of that of the machine, which the
            processes of a run share.
        line_seconds: of a processor for a line of a chart, its scan, which may take half of them, and its branches;
            None for any time.

    Raises:
        ParameterError: a number is out of its range.
    """

    unknowns: Annotated[int, parameter("number of unknowns of the largest system", "unknowns = 80000", ge=100)] = 80_000
    seconds: Annotated[float, parameter("seconds of processor time for one number", "seconds = 60.0", gt=0)] = 60.0
    memory: Annotated[
        float | None,
        parameter("memory in GB; if omitted, half of that of the machine", "memory = 8.0", gt=0),
    ] = None
    line_seconds: Annotated[
        float | None, parameter("seconds of processor time for a line of a chart", "line_seconds = 600.0", gt=0)
    ] = None

    def countdown(self, name: str) -> Countdown:
        """For one number."""
        return Countdown(self.seconds, self.memory or half_the_memory(), name)


@dataclass(frozen=True, eq=False)
class NearPlace:
    """Λ(p) of a problem that is solved as a whole, for any number of p.

    Args:
        problem: a motion and its noise.
        mesh: a mesh for all p; None chooses a discretisation for each p that meets the tolerance.
        rtol: about what the tolerance is relative to the size of Λ(p).
        budget: what the choice of a discretisation may cost.
        tolerance: the usual one.
        starts: solutions of a problem with parameters close by, by their p.

    Attributes:
        known: what was solved, by p.
    """

    problem: Problem
    _: KW_ONLY
    mesh: CylinderMesh | None = None
    rtol: float
    budget: Budget
    tolerance: Tolerance
    starts: Mapping[float, Solution] = field(default_factory=dict)
    known: dict[float, Solution] = field(init=False, default_factory=dict)
    _failed: dict[float, Message] = field(init=False, default_factory=dict)

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The principal eigenpair at p and its error, within a tolerance, the usual one if none is given.

        Args:
            p: the moment.
            tolerance: the largest error allowed.

        Raises:
            NotConverged: the mesh does not resolve the problem, or the budget does not suffice to find one.
        """
        p = solved_p(p)
        if tolerance is None and p in self._failed:
            raise NotConverged(self._failed[p])
        allowed = tolerance or self.tolerance
        if p not in self.known or (self.mesh is None and not self.is_accurate(self.known[p], allowed)):
            try:
                with one_thread():
                    self.known[p] = Search(self, p, allowed, under_way() or self.budget.countdown(f"Λ({p:g})")).solve()
            except NotConverged as failure:
                if tolerance is None:  # a tighter one may be out of reach where this is not
                    self._failed[p] = failure.message
                raise failure from None
            except MeshError as failure:
                if self.mesh is not None:
                    raise
                told = Message(Code.NOT_CONVERGED, p=p, reason=failure.message, remedy=self.remedy)
                raise NotConverged(told) from failure
            except (SingularMatrix, np.linalg.LinAlgError) as failure:
                told = Message(Code.NOT_SOLVED, p=p, reason=str(failure), remedy=self.remedy)
                raise NotConverged(told) from failure
            except MemoryError as failure:
                raise NotConverged(Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)) from failure
            except ArithmeticError as failure:
                raise NotConverged(Message(Code.OUT_OF_RANGE, p=p, reason=str(failure))) from failure
        return self.known[p]

    @property
    def remedy(self) -> Remedy:
        """What to do where it is not resolved."""
        return Remedy.BUDGET if self.mesh is None else Remedy.MESH

    def pair_on(self, generator: Generator, p: float, start: PrincipalPair | Sequence[PrincipalPair]) -> PrincipalPair:
        """The principal pair; where it is not found, the failure has the remedy of this place."""
        try:
            return principal_pair(generator, p, start=start)
        except NotConverged as failure:
            raise NotConverged(failure.reason, failure.partial, self.remedy) from failure

    def finer_pair(self, pair: PrincipalPair) -> PrincipalPair:
        """That at the same p on a finer discretisation, which tells the errors of what the other says.

        It has two degrees more each way; for algebraic tails its interval is wider, too.

        Raises:
            NotConverged: it cannot be made, has a third more unknowns than the budget allows, or does not resolve it.
        """
        chosen = widened(pair.generator).enriched()
        limit = A_THIRD_MORE * self.budget.unknowns if self.mesh is None else math.inf
        reason: Message | str
        if chosen.size > limit:
            reason = Message(Code.UNKNOWNS_SPENT, unknowns=chosen.size, most=self.budget.unknowns)
        else:
            try:
                with one_thread(), counted(self.budget.countdown(f"a finer Λ({pair.p:g})")):
                    return self.pair_on(Generator(self.problem, chosen), pair.p, pair)
            except (MeshError, SingularMatrix, np.linalg.LinAlgError) as failure:
                reason = getattr(failure, "message", str(failure))
            except MemoryError:
                raise NotConverged(Message(Code.NO_MEMORY), remedy=Remedy.MEMORY) from None
        raise NotConverged(Message(Code.NOT_FINER, p=pair.p, reason=reason, remedy=self.remedy))

    def near_zero(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The solution at ±`SMALL_P` that a smaller p goes with."""
        side = p or (-1.0 if self.problem.coloured.has_algebraic_tails else 1.0)  # on which Λ is finite
        q = math.copysign(SMALL_P, side)
        try:
            return self.solution(q, tolerance)
        except NotConverged as failure:
            raise NotConverged(Message(Code.NEAR_ZERO, p=q, reason=failure.message), failure.partial) from failure

    def solve_places(self, search: Search, start: Solution | None) -> Solution:
        """A solution within a tolerance from a first discretisation, or from a solution that does not suffice.

        Where slow noise may carry the moment in several places, the largest eigenvalue.
        """
        places = [search.adapt(start or first(self.problem, search.p, self.rtol))]
        for center in other_centers(places[0].pair):
            search.best, search.error, search.share = None, math.inf, math.inf  # those of a lower eigenvalue, maybe
            places.append(search.adapt(first(self.problem, search.p, self.rtol, center)))
        return max(places, key=lambda each: each.pair.value)

    @cached_property
    def given(self) -> tuple[Generator, Generator]:
        """That of the given mesh, and one of four degrees more, whose error hardly counts beside it."""
        assert self.mesh is not None
        generator = Generator(self.problem, self.mesh)
        return generator, generator.enriched().enriched()

    def is_accurate(self, solution: Solution, tolerance: Tolerance) -> bool:
        """Whether an error is within a tolerance; for small p, where Λ has no scale, always."""
        pair = solution.pair
        return abs(pair.p) < SMALL_P or solution.error <= tolerance(pair.p, pair.value)

    def coarsened(self, solution: Solution, tolerance: Tolerance) -> Space:
        """The discretisation of a solution, or a much smaller one that would do."""
        pair, generator = solution.pair, solution.pair.generator
        if abs(pair.p) < SMALL_P or generator.size <= WORTH_A_TRY:
            return generator.chosen
        smaller = refined(solution, tolerance(pair.p, pair.value), 0)
        return smaller if smaller.size <= TRIM * generator.size else generator.chosen

    def may_reuse(self, chosen: Space, q: float, p: float) -> bool:
        """Whether what serves q is likely to serve p, or so small that it is worth a try."""
        axis, frozen = chosen.xi, frozen_noise(self.problem)
        if chosen.size > WORTH_A_TRY and abs(p - q) > max(0.5, 0.4 * min(abs(p), abs(q))):
            return False
        if frozen is None or not isinstance(axis, PolynomialAxis):
            return True
        away = abs(frozen.tilt(frozen.center(p)) - axis.slope * p) if self.problem.coloured.may_tilt else 0.0
        return away <= MOST_TILT_AWAY


@dataclass
class Search:
    """A search for the solution at one p within a tolerance: what it has cost, and the best it has found.

    Attributes:
        place: where known solutions are, and what is usual for the problem.
        stages: how many discretisations were solved.
        best, error, share: the solution nearest to its tolerance, its error, and this over what is allowed.
        failure: why the last discretisation had no solution.
        last: seconds spent before the last stage, and its unknowns.
    """

    place: NearPlace
    p: float
    tolerance: Tolerance
    countdown: Countdown
    stages: int = 0
    best: Solution | None = None
    error: float = math.inf
    share: float = math.inf
    failure: Exception | None = None
    last: tuple[float, int] = (0.0, 0)

    def solve(self) -> Solution:
        """A solution within the tolerance, or the one on the given mesh."""
        if self.countdown is under_way():
            return self._solve()
        try:
            with self.countdown.running():
                return self._solve()
        except OverBudget as failure:
            if failure.countdown is not self.countdown:
                raise
            if self.best is not None and self.share <= 1:  # within the tolerance, but for its slope
                return self.best
            return self.stop(failure.reason)

    def _solve(self) -> Solution:
        """A solution, unless the budget ends it."""
        if self.place.mesh is not None:
            coarse, fine = self.place.given
            pair = self.solve_with(coarse).pair
            return Solution(pair, self.place.pair_on(fine, self.p, pair))
        if abs(self.p) < SMALL_P:
            return self.solve_with(self.place.near_zero(self.p, self.tolerance).pair.generator)
        start = None
        for attempt in (self.try_problem_close_by, self.try_nearest_p):
            start = attempt() or start
            if start is not None and self.place.is_accurate(start, self.tolerance) and not other_centers(start.pair):
                return self.confirm(start)
        return self.confirm(self.place.solve_places(self, start))

    def confirm(self, found: Solution) -> Solution:
        """A solution that agrees with that of halved cells of φ within its error, or within what is allowed.

        At a coarse tolerance a thin layer of T, as where the phase rests, may lie within a cell that is so large that
        none of its modes shows it.
        """
        chosen = found.pair.generator.chosen
        if self.place.rtol <= SURELY_SEEN or not isinstance(chosen.phi, PhaseAxis):
            return found
        halved = chosen.with_axis(0, chosen.phi.doubled())
        if halved.size > min(MOST_HALVED, self.place.budget.unknowns):
            return found
        finer = self.attempt(lambda: Solution(self.pair_on(halved, found.pair))) or self.adapt(halved)
        change = abs(finer.pair.value - found.pair.value)
        if change <= found.error:
            return found
        if change + finer.error <= self.tolerance(self.p, finer.pair.value):
            return replace(finer, search=finer.search + change)
        return self.confirm(finer)

    def try_problem_close_by(self) -> Solution | None:
        """The solution with what was chosen for this p in the problem close by, or None."""
        start, problem = self.place.starts.get(self.p), self.place.problem
        if start is None:
            return None
        if _bases(start.pair.generator.problem) != _bases(problem):
            return None
        return self.attempt(lambda: Solution(self.pair_on(self.place.coarsened(start, self.tolerance), start.pair)))

    def try_nearest_p(self) -> Solution | None:
        """The solution with what was chosen for the nearest p, where that is likely to do."""
        nearest = min(self.place.known, key=lambda q: abs(q - self.p), default=None)
        if nearest is None:
            return None
        known = self.place.known[nearest]
        generator, chosen = known.pair.generator, self.place.coarsened(known, self.tolerance)
        if nearest == self.p and chosen is generator.chosen:
            return known
        if not self.place.may_reuse(chosen, nearest, self.p):
            return None
        is_same, problem = chosen is generator.chosen, self.place.problem
        return self.attempt(lambda: self.solve_with(generator if is_same else Generator(problem, chosen)))

    def solve_with(self, generator: Generator) -> Solution:
        """The solution with a generator, from those around p, or from the nearest one."""
        known = (solution.pair for solution in self.place.known.values())
        near = sorted(known, key=lambda pair: abs(pair.p - self.p))[:NEIGHBOURS]
        return Solution(self.place.pair_on(generator, self.p, near))

    def pair_on(self, chosen: Space, start: PrincipalPair | None) -> PrincipalPair:
        """The principal pair on a discretisation."""
        return principal_pair(Generator(self.place.problem, chosen), self.p, start=start)

    def attempt(self, solve: Callable[[], Found]) -> Found | None:
        """What is solved, or None where a discretisation does not have it, and the `failure` tells why."""
        try:
            return solve()
        except UNSOLVED as failure:
            self.failure = failure.with_traceback(None)  # which would keep this search, and all that it has found
            return None

    def adapt(self, start: Solution | Space) -> Solution:
        """A solution within the tolerance, the tilted density sought where a first discretisation, or a solution, is.

        Raises:
            NotConverged: the budget does not suffice, or rounding is larger than the tolerance; `partial` is the best
                `Solution`, or None.
        """
        if isinstance(start, Solution):
            chosen, pair = refined(start, self.tolerance(self.p, start.pair.value), 0), start.pair
        else:
            chosen, pair = start, None
        while True:
            self.check(chosen)
            pair = self.attempt(partial(self.pair_on, chosen, pair))
            if pair is None:
                chosen = chosen.doubled(effects_of(self.failure))
                continue
            solution, allowed = Solution(pair), self.tolerance(self.p, pair.value)
            seems_enough = solution.error_by_modes <= allowed
            error = solution.error if seems_enough else solution.error_by_modes
            if error <= allowed:
                return solution
            self.note(solution, error, allowed)
            goal = max(allowed, MOST_GAIN * error) if chosen.xi.lines.size else allowed
            chosen = chosen.enriched() if seems_enough else self.affordable(solution, goal)

    def affordable(self, solution: Solution, goal: float) -> Space:
        """A refined discretisation; where it takes more unknowns than there are, one that does for this p alone."""
        found = refined(solution, goal, self.stages)
        if found.size <= self.place.budget.unknowns:
            return found
        return refined(solution, ALONE / SHARE * goal, self.stages)

    def check(self, chosen: Space) -> None:
        """Refuse a stage beyond the budget, and count it."""
        size, spent = chosen.size, self.countdown.spent
        if size > self.place.budget.unknowns:
            self.stop(Message(Code.UNKNOWNS_SPENT, unknowns=size, most=self.place.budget.unknowns))
        seconds = spent + (spent - self.last[0]) * (size / max(self.last[1], 1)) ** GROWTH
        if self.last[1] and seconds > self.countdown.seconds:
            raise OverBudget(self.countdown, Message(Code.SECONDS_SPENT, seconds=seconds, most=self.countdown.seconds))
        if self.stages >= MAX_STAGES:
            self.stop(Message(Code.MESHES_SPENT, count=MAX_STAGES))
        self.last, self.stages = (spent, size), self.stages + 1

    def note(self, solution: Solution, error: float, allowed: float) -> None:
        """Keep the best solution; stop where only rounding is left."""
        if error / allowed < self.share:
            self.best, self.error, self.share = solution, error, error / allowed
        if solution.pair.rounding > allowed:
            self.stop(Message(Code.ROUNDED, size=solution.pair.rounding))

    def stop(self, reason: Message) -> NoReturn:
        """Raise `NotConverged` with the best solution."""
        if best := self.best:
            reached = {"value": best.pair.value, "error": self.error, "size": self.share}
            told = Message(Code.BUDGET_SPENT, p=self.p, reason=reason, **reached)
        else:
            last, is_thin = self.failure, isinstance(self.failure, NotConverged)
            said = last.message.advising(None) if isinstance(last, FpsolveError) else last and str(last)
            told = Message(Code.NOTHING_RESOLVED, p=self.p, reason=reason, is_thin=is_thin, last=said)
        raise NotConverged(told, best, None if reason.code is Code.ROUNDED else Remedy.BUDGET)


def effects_of(failure: Exception | None) -> Sequence[ModeEffects | None]:
    """Those of the pair that a failed search has reached; nothing where there is none."""
    pair = getattr(failure, "partial", None)
    return mode_effects(pair) if pair is not None and pair.residual <= BACKWARD_ERROR_LIMIT else ()


def widened(generator: Generator) -> Space:
    """That of a generator, on an interval `WIDER` times as wide for algebraic tails."""
    chosen, lines = generator.chosen, generator.chosen.xi.lines
    if not (lines.size and generator.problem.coloured.has_algebraic_tails):
        return chosen
    steps = WIDER ** np.linspace(0, 1, 4)[1:]
    wide = np.concatenate([(lines[0] * steps)[::-1], lines, lines[-1] * steps])
    return chosen.with_axis(1, chosen.xi.between(wide))


def refined(solution: Solution, tolerance: float, stages: int) -> Space:
    """A discretisation on which every cell should lack no more than its share of the tolerance."""
    pair, share = solution.pair, SHARE * tolerance
    chosen = pair.generator.chosen
    new = chosen.refined(solution.effects, share, stages < FREE_STAGES)
    if chosen.xi.lines.size:
        lower, upper = solution.truncation
        new = new.with_axis(1, new.xi.reaching(lower > share, upper > share))
    return new if new.size > chosen.size or solution.error_by_modes <= tolerance else new.raised()


def _bases(problem: Problem) -> list[str]:
    """What the functions of each noise are made of."""
    return [noise.basis for noise in problem.coloured.parts.values()]


def solved_p(p: float) -> float:
    """The p at which the pair for a p is solved."""
    return p if abs(p) >= NEGLIGIBLE_P else 0.0
