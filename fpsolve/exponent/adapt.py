"""Λ(p): the discretisation is chosen for each p, each solve goes on from the nearest p.

A discretisation is refined until Λ(p) meets a tolerance, or the budget is spent. Slow noise may carry a moment in
another place than the one that was found: then both are solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple, NoReturn, TypeVar

import numpy as np

from fpsolve.budget import Meter, OverBudget
from fpsolve.errors import FpsolveError, MeshError, NotConverged, SingularMatrix
from fpsolve.exponent.eigen import PairDerivatives, PrincipalPair, pair_at_zero, principal_pair
from fpsolve.exponent.error import Solution
from fpsolve.exponent.method import Budget, Tolerance, spent_remedy
from fpsolve.exponent.starts import Question, Start, first_place, other_centers, other_places, refined
from fpsolve.fem.factors import FEW_UNKNOWNS, one_thread
from fpsolve.fem.generator import SMALL_P, Generator
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.problem import Problem
from fpsolve.theory.frozen import frozen_noise

MAX_STAGES = 60
"""Number of spaces of a search, of all its places."""
WORTH_A_TRY = FEW_UNKNOWNS
"""Unknowns of a system that takes less time than finding another one."""
MOST_TILT_AWAY = 0.7
"""How far the tilt of a space may be from the best one at another p."""
TRIM = 0.8
"""A smaller space must have at most this share of the unknowns."""
NEGLIGIBLE_P = 1e-30
"""Pairs at smaller |p| are those at p = 0, from which they differ by less than by rounding."""
NEIGHBOURS = 6
"""How many known eigenfunctions those of another p are interpolated from."""
WIDER = 4.0
"""Factor by which the interval of noise with algebraic tails is wider where it tells the error of a narrower one."""
SURELY_SEEN = 1e-6
"""A tolerance down from which cells are small enough for their highest modes to show what is in them."""
AT_CORNER = 1e-3
"""Distance from p = −1, where Λ(p) of a saddle with two variables has a corner, or nearly one: two eigenvalues meet."""
MIXED = 100.0
"""‖T′‖ over ‖T‖ from which on T is thought to be a mixture of those of two eigenvalues that meet."""
MOST_HALVED = 20_000
"""Unknowns of a system on halved cells that is solved for that: beyond, cells are many, and it takes long."""
A_THIRD_MORE = 4 / 3
"""What a budget may be exceeded by."""
UNSOLVED = MeshError, NotConverged, SingularMatrix, np.linalg.LinAlgError
"""What is raised where a discretisation does not have the principal pair, so that another one is tried."""
Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class WholeProblem:
    """Λ(p) of a problem at any number of p, in spaces that are chosen for each; its classes are not solved apart.

    Args:
        problem: a motion and its noise.
        mesh: a mesh for all p; None chooses a discretisation for each p that meets the tolerance.
        rtol: about what the tolerance is relative to the size of Λ(p).
        budget: what the choice of a discretisation may cost.
        tolerance: the usual one.
        meter: of all numbers of the problem.
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
    meter: Meter
    starts: Mapping[float, Solution] = field(default_factory=dict)
    known: dict[float, Solution] = field(init=False, default_factory=dict)
    _failed: dict[float, tuple[type[NotConverged], Message]] = field(init=False, default_factory=dict)

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
            kind, message = self._failed[p]
            raise kind(message)
        allowed = tolerance or self.tolerance
        if p not in self.known or (self.mesh is None and not self.is_accurate(self.known[p], allowed)):
            try:
                with one_thread(), self.meter.running() as meter:
                    self.known[p] = Search(self, p, allowed, meter).solve()
            except NotConverged as failure:
                if tolerance is None:  # a tighter one may be out of reach where this is not
                    self._failed[p] = type(failure), failure.message
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
        return spent_remedy(self.problem) if self.mesh is None else Remedy.MESH

    def pair_on(self, generator: Generator, p: float, start: PrincipalPair | Sequence[PrincipalPair]) -> PrincipalPair:
        """The principal pair; where it is not found, the failure has the remedy of this place."""
        try:
            return principal_pair(generator, p, start=start)
        except OverBudget:
            raise
        except NotConverged as failure:
            remedy = Remedy.BESIDE if is_at_corner(self.problem, p) else self.remedy
            raise NotConverged(failure.reason, failure.partial, remedy) from failure

    def finer_pair(self, pair: PrincipalPair) -> PrincipalPair:
        """That at the same p on a finer discretisation, which tells the errors of what the other says.

        It has two degrees more each way; for algebraic tails its interval is wider, too. Raises as `pair_among`.
        """
        return self.pair_among(widened(pair.generator).enriched(), pair)

    def pair_among(self, chosen: Space, pair: PrincipalPair) -> PrincipalPair:
        """That at the same p on other functions.

        Raises:
            NotConverged: it cannot be made, has a third more unknowns than the budget allows, or does not resolve it.
        """
        limit = A_THIRD_MORE * self.budget.most(chosen) if self.mesh is None else math.inf
        reason: Message | str
        if chosen.size > limit:
            reason = Message(Code.UNKNOWNS_SPENT, unknowns=chosen.size, most=self.budget.most(chosen))
        else:
            try:
                with one_thread(), self.meter.running():
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
            told = Message(Code.NEAR_ZERO, p=q, reason=failure.message)
            raise type(failure)(told, failure.partial) from failure

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
        is_small = abs(pair.p) < SMALL_P or generator.size <= WORTH_A_TRY
        if is_small or self.problem.dimension > 2:
            return generator.chosen
        smaller = refined(solution, tolerance(pair.p, pair.value), 0)
        return smaller if smaller.size <= TRIM * generator.size else generator.chosen

    def may_reuse(self, chosen: Space, q: float, p: float) -> bool:
        """Whether what serves q is likely to serve p, or so small that it is worth a try."""
        if self.problem.dimension > 2:  # every p has waves of its own
            return False
        if chosen.size > WORTH_A_TRY and abs(p - q) > max(0.5, 0.4 * min(abs(p), abs(q))):
            return False
        return self.tilt_fits(chosen, p)

    def tilt_fits(self, chosen: Space, p: float) -> bool:
        """Whether the tilt of a space is about that at p."""
        axis, frozen = chosen.xi, frozen_noise(self.problem)
        if frozen is None or not isinstance(axis, PolynomialAxis):
            return True
        away = abs(frozen.tilt(frozen.center(p)) - axis.slope * p) if self.problem.coloured.may_tilt else 0.0
        return away <= MOST_TILT_AWAY


def directions(question: Question, found: Sequence[Solution]) -> Iterator[Start]:
    """Directions of three or four variables."""
    if question.problem.system.stop and not found:
        from fpsolve.exponent.stopped import stop_start

        yield stop_start(question)
    elif question.problem.dimension > 2 and not found:
        from fpsolve.exponent.modes import sphere_start  # with scikit-fem, which takes long to import

        yield sphere_start(question)


STARTS: tuple[Callable[[Question, Sequence[Solution]], Iterator[Start]], ...] = (first_place, directions, other_places)
"""Functions that yield the places where Λ(p) may be carried, called in order, from what was found in those before."""


class Best(NamedTuple):
    """The solution of a place that is nearest to the tolerance, and its error over what is allowed."""

    solution: Solution
    share: float


class Ended(Exception):
    """No larger space may be solved on, for a reason other than time."""

    def __init__(self, reason: Message) -> None:
        super().__init__(str(reason))
        self.reason = reason


@dataclass
class Search:
    """A search for the solution at one p within a tolerance, and what it has cost.

    Attributes:
        whole: where known solutions are, and what is usual for the problem.
        stages: how many discretisations were solved.
        failure: why the last discretisation had no solution.
        last: seconds spent before the last stage, and its unknowns.
    """

    whole: WholeProblem
    p: float
    tolerance: Tolerance
    meter: Meter
    stages: int = 0
    failure: Exception | None = None
    last: tuple[float, int] = (0.0, 0)

    def solve(self) -> Solution:
        """A solution within the tolerance, or the one on the given mesh."""
        if self.whole.mesh is not None:
            coarse, fine = self.whole.given
            pair = self.solve_with(coarse).pair
            finer = self.whole.pair_on(fine, self.p, pair)
            return Solution(pair, measured=(abs(finer.value - pair.value),))
        if abs(self.p) < SMALL_P:
            near = self.whole.near_zero(self.p, self.tolerance).pair
            at_zero = pair_at_zero(near) if self.p == 0 else None
            return Solution(at_zero) if at_zero else self.solve_with(near.generator)
        known = None
        for attempt in (self.try_problem_close_by, self.try_nearest_p):
            known = attempt() or known
            if known and self.whole.is_accurate(known, self.tolerance) and not other_centers(known.pair):
                return self.confirm(known)
        return self.confirm(self.solve_places(known))

    def solve_places(self, known: Solution | None) -> Solution:
        """The largest of all places where the moment may be carried, the first from a solution that does not suffice.

        It is the principal one, as far as the spaces can tell.
        """
        question = Question(self.whole.problem, self.p, self.whole.rtol, self.whole.known)
        found = [] if known is None else [self.adapt(self.after(known), known.pair)]
        for places in STARTS:
            for start in places(question, found):
                found.append(self.adapt(start))
        return max(found, key=lambda each: each.pair.value)

    def after(self, known: Solution) -> Start:
        """The place of a solution, with a space that should be within the tolerance."""
        start = known.start or Start(self.whole.problem, known.pair.generator.chosen)
        allowed = self.tolerance(self.p, known.pair.value)
        return start.refined(known, allowed, 0, self.whole.budget.most(start.space))

    def confirm(self, found: Solution) -> Solution:
        """A solution that agrees with that of halved cells of φ within its error, or within what is allowed.

        At a coarse tolerance a thin layer of T, as where the phase rests, may lie within a cell that is so large that
        none of its modes shows it. Where two eigenvalues meet, modes of a mixture of both T tell little.
        """
        chosen = found.pair.generator.chosen
        if is_at_corner(self.whole.problem, self.p) and is_mixed(found.pair):
            change = self.whole.finer_pair(found.pair).value - found.pair.value
            return replace(found, search=2 * abs(change))
        if self.whole.rtol <= SURELY_SEEN or not isinstance(chosen.phi, PhaseAxis):
            return found
        halved = chosen.with_axis(0, chosen.phi.doubled())
        if halved.size > min(MOST_HALVED, self.whole.budget.most(halved)):
            return found
        start = Start(self.whole.problem, halved)
        finer = self.attempt(lambda: Solution(start.pair(self.p, found.pair))) or self.adapt(start)
        change = abs(finer.pair.value - found.pair.value)
        if change <= found.error:
            return found
        if change + finer.error <= self.tolerance(self.p, finer.pair.value):
            return replace(finer, search=finer.search + change)
        return self.confirm(finer)

    def try_problem_close_by(self) -> Solution | None:
        """The solution with what was chosen for this p in the problem close by, or None."""
        start, problem = self.whole.starts.get(self.p), self.whole.problem
        if start is None:
            return None
        if _bases(start.pair.generator.problem) != _bases(problem):
            return None
        coarsened = Start(problem, self.whole.coarsened(start, self.tolerance))
        if coarsened.space.size > WORTH_A_TRY and not self.whole.tilt_fits(coarsened.space, self.p):
            return None
        return self.attempt(lambda: Solution(coarsened.pair(self.p, start.pair)))

    def try_nearest_p(self) -> Solution | None:
        """The solution with what was chosen for the nearest p, where that is likely to do."""
        nearest = min(self.whole.known, key=lambda q: abs(q - self.p), default=None)
        if nearest is None:
            return None
        known = self.whole.known[nearest]
        generator, chosen = known.pair.generator, self.whole.coarsened(known, self.tolerance)
        if nearest == self.p and chosen is generator.chosen:
            return known
        if not self.whole.may_reuse(chosen, nearest, self.p):
            return None
        is_same, problem = chosen is generator.chosen, self.whole.problem
        return self.attempt(lambda: self.solve_with(generator if is_same else Generator(problem, chosen)))

    def solve_with(self, generator: Generator) -> Solution:
        """The solution with a generator, from those around p, or from the nearest one."""
        known = (solution.pair for solution in self.whole.known.values())
        near = sorted(known, key=lambda pair: abs(pair.p - self.p))[:NEIGHBOURS]
        return Solution(self.whole.pair_on(generator, self.p, near))

    def attempt(self, solve: Callable[[], Found]) -> Found | None:
        """What is solved, or None where a discretisation does not have it, and the `failure` tells why."""
        try:
            return solve()
        except OverBudget:
            raise
        except UNSOLVED as failure:
            self.failure = failure.with_traceback(None)  # which would keep this search, and all that it has found
            return None

    def adapt(self, start: Start, near: PrincipalPair | None = None) -> Solution:
        """A solution within the tolerance at one place: solve, judge, and stop or refine.

        Args:
            start: the place.
            near: a pair of another space to begin with.

        Raises:
            NotConverged: the budget does not suffice, or rounding is larger than the tolerance; `partial` is the best
                `Solution`, or None.
        """
        best: Best | None = None
        try:
            while True:
                self.check(start.space)
                near = self.attempt(partial(start.pair, self.p, near))
                if near is None:
                    start = start.doubled(self.failure)
                    continue
                allowed = self.tolerance(self.p, near.value)
                solution = start.with_error(near, allowed)
                if solution.error <= allowed and start.is_enough(solution):
                    return solution
                if solution.error / allowed < (best.share if best else math.inf):
                    best = Best(solution, solution.error / allowed)
                if near.rounding > allowed:
                    raise Ended(Message(Code.ROUNDED, size=near.rounding))
                start = start.refined(solution, allowed, self.stages, self.whole.budget.most(start.space))
        except (OverBudget, Ended) as failure:
            if best is not None and best.share <= 1:  # within the tolerance, but for its slope
                return best.solution
            return self.stop(failure, best)

    def check(self, chosen: Space) -> None:
        """Refuse a stage beyond the budget, and count it."""
        size, spent, most = chosen.size, self.meter.spent, self.whole.budget.most(chosen)
        if size > most:
            raise Ended(Message(Code.UNKNOWNS_SPENT, unknowns=size, most=most))
        if self.last[1]:  # what it takes at least
            self.meter.refuse(spent + (spent - self.last[0]) * size / self.last[1])
        if self.stages >= MAX_STAGES:
            raise Ended(Message(Code.MESHES_SPENT, count=MAX_STAGES))
        self.last, self.stages = (spent, size), self.stages + 1

    def stop(self, ended: OverBudget | Ended, best: Best | None) -> NoReturn:
        """Raise `NotConverged`, or `OverBudget`, with the best solution."""
        reason, kind = ended.reason, OverBudget if isinstance(ended, OverBudget) else NotConverged
        if best is not None:
            pair, error = best.solution.pair, best.solution.error
            told = Message(Code.BUDGET_SPENT, p=self.p, reason=reason, value=pair.value, error=error, size=best.share)
        else:
            last, is_thin = self.failure, isinstance(self.failure, NotConverged)
            said = last.message.advising(None) if isinstance(last, FpsolveError) else last and str(last)
            told = Message(Code.NOTHING_RESOLVED, p=self.p, reason=reason, is_thin=is_thin, last=said)
        remedy = None if reason.code is Code.ROUNDED else spent_remedy(self.whole.problem)
        raise kind(told, best and best.solution, remedy)


def is_at_corner(problem: Problem, p: float) -> bool:
    """Whether p is where Λ may have a corner."""
    return problem.dimension == 2 and abs(p + 1) <= AT_CORNER


def is_mixed(pair: PrincipalPair) -> bool:
    """Whether another eigenvalue is so near, and of another slope, that T changes all at once."""
    return bool(np.linalg.norm(PairDerivatives(pair).by_p) > MIXED * np.linalg.norm(pair.right))


def widened(generator: Generator) -> Space:
    """That of a generator, on an interval `WIDER` times as wide for algebraic tails."""
    chosen, lines = generator.chosen, generator.chosen.xi.lines
    if not (lines.size and generator.problem.coloured.has_algebraic_tails):
        return chosen
    steps = WIDER ** np.linspace(0, 1, 4)[1:]
    wide = np.concatenate([(lines[0] * steps)[::-1], lines, lines[-1] * steps])
    return chosen.with_axis(1, chosen.xi.between(wide))


def _bases(problem: Problem) -> list[str]:
    """What the functions of each noise are made of."""
    return [noise.basis for noise in problem.coloured.parts.values()]


def solved_p(p: float) -> float:
    """The p at which the pair for a p is solved."""
    return p if abs(p) >= NEGLIGIBLE_P else 0.0
