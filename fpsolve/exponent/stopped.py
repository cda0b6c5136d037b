"""Λ(p) of four variables with a stop: finer elements and waves on the half sphere, until Λ(p) settles.

The coordinates are those of the stop, each pair in a unit and, the second one, in a rotation of its own, as nothing
else keeps the impact. Between both pairs the unit is that in which E xxᵀ and Q of `modes` are alike, of the motion
without the stop. T is smooth there, and the layers of T* are nothing to Λ(p).

What two degrees more change to first order, in η, in θ₁ and in θ₂ by themselves, tells where finer functions are
needed. At the stop T is a root, so that these changes fall as a power of the degree, and not evenly: they correct
nothing, but the error is 1.5 times their sum, 4 times what is in a direction that no step has tried, or the last
step of Λ(p), or a quarter of the sum on the space before, ten times that if it was the first one, whichever is the
largest. On a single space this is a guess, so that one step there is at least. Where finer elements leave more than
half of a change in η, they do not see the layer of T from one mode to the other, if there is one: they are halved, and
the error is 10 times what is in η. With R = 1, where the motion without a stop tells Λ(p), errors were at most 0.61
of what is stated in 41 comparisons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
import scipy.linalg

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PrincipalPair, slope_rounding
from fpsolve.exponent.error import Solution
from fpsolve.exponent.modes import Directions, DirectionStart, first_order_changes, inside_frame, second_moments
from fpsolve.exponent.starts import SHARE
from fpsolve.fem.directions import HalfSphereAxis
from fpsolve.fem.generator import Generator
from fpsolve.model.coordinates import mean_matrix
from fpsolve.model.plane import LinearMotion, Stop, rotating_coordinates
from fpsolve.model.problem import Problem

FIRST_DEGREE = 4
"""Degree of the elements of the first space."""
FIRST_WAVES = 2
"""Largest degree of its waves."""
AT_STOP = 0.0, 0.8, 1.0
"""Vertices in η, over ½π: a smaller element where the first mass is at rest at the stop."""
OF_STEP = 1.0
"""What is left at least, over the last step of Λ(p): it was up to 0.7 where a mode is uncoupled."""
OF_LAST = 2.5, 0.25
"""What is left at least, over the sum of the changes of the space before: of the first one, and of a later one."""
OF_ONE = 4.0
"""What is left, over a change, in a direction in which the last step made nothing finer, as on a single space."""
STALLED, OF_STALLED = 0.5, 10.0
"""Share of a change in η that a step in it leaves where elements do not see a layer of T between the two modes, and
what is left then, over the change: it was up to 6 in R = 1."""
OF_TRIED = 1.5
"""What is left, over a change, in a direction in which the last step made it finer: it was up to 1.1 in R = 1."""
MINOR_NOISE = 0.1
"""Share of what is left on the half sphere from which on functions of the noise are made finer, too."""
FALL = 0.2
"""Share of a change that two degrees more leave, about."""
WORTH = 0.2
"""Share of the largest change from which on functions in another direction are made finer, too."""


def reading_coordinates(problem: Problem) -> tuple[Stop, bool]:
    """The coordinates in which variables are looked at, those of the stop, and whether the first one is never negative.

    Without a stop they are x itself.
    """
    stop = problem.linear.stop
    return stop or Stop(np.eye(problem.dimension).tolist(), 1.0), stop is not None


def _rotating(block: FloatArray) -> FloatArray:
    """Coordinates in which a pair rotates uniformly, but for growth, the first one as it was but for its unit."""
    if (found := rotating_coordinates(block)) is None:
        _, found = scipy.linalg.matrix_balance(block, permute=False)
    lower = np.linalg.qr(found.T)[1].T
    return lower * np.sign(np.diagonal(lower))


@dataclass(frozen=True, eq=False)
class StopStart(DirectionStart):
    """Directions of four variables with a stop; `before` holds the solution with coarser functions, if there is one.

    Attributes:
        changes: what finer functions in η, in θ₁ and in θ₂ change, where that is known: the geometric mean of the sum
            and of the sum of sizes. In the first one changes may cancel, the other is too large where T is a root.
        is_first: whether no coarser functions have been looked at, here or at another p.
    """

    changes: tuple[float, ...] = ()
    is_first: bool = True
    tried: tuple[str, ...] = ()

    @staticmethod
    def directions(problem: Problem) -> HalfSphereAxis:
        (at, _), system = reading_coordinates(problem), problem.linear
        free, smooth = at.inside(mean_matrix(problem, system)), LinearMotion(system.terms, epsilon=system.epsilon)
        own = scipy.linalg.block_diag(_rotating(free[:2, :2]), _rotating(free[2:, 2:]))
        own = np.linalg.solve(np.array(at.coordinates), own)
        forms = second_moments(replace(problem, system=smooth), own)
        q, moments = (np.diagonal(each).reshape(2, 2).sum(axis=1) for each in forms)
        return HalfSphereAxis(
            inside_frame(problem, own * np.repeat((moments / q) ** 0.25, 2)),
            0.5 * math.pi * np.array(AT_STOP),
            FIRST_DEGREE,
            FIRST_WAVES,
            np.linspace(-0.5, 0.5, 3) * math.pi,
            FIRST_DEGREE,
        )

    def again(self) -> StopStart:
        """The functions with which another p begins."""
        coarser = (*(each.start for each in self.before), self)[0]
        return StopStart(self.problem, coarser.space, is_first=coarser.is_first)

    def judged(self, pair: PrincipalPair, allowed: float) -> Solution:
        _, *of_noises = self.errors_of_axes(pair, allowed)
        phi, found = self.space.phi, list[float]()
        for finer in map(phi.deeper, phi.ways):
            changes = first_order_changes(pair, Generator(self.problem, self.space.with_axis(0, finer)), 0)
            found.append(math.sqrt(abs(np.sum(changes)) * np.sum(np.abs(changes))))
        left = float(self._left(found) @ found)
        for each in self.before:
            step, lacked = abs(pair.value - each.pair.value), sum(each.start.changes)
            left = max(left, OF_STEP * step, OF_LAST[not each.start.is_first] * lacked)
        unresolved = 0.0 if self.before else math.inf  # of one space
        return Solution(pair, unresolved, (left, *of_noises), replace(self, changes=tuple(found)))

    def _left(self, changes: Sequence[float]) -> FloatArray:
        """What is left over the change in each direction."""
        left = np.array([OF_TRIED if way in self.tried else OF_ONE for way in self.space.phi.ways])
        return np.append(OF_STALLED if self._stalls(changes) else left[0], left[1:])

    def _stalls(self, changes: Sequence[float]) -> bool:
        """Whether the last step made functions in η finer and left more than `STALLED` of what these change."""
        return any("degree" in self.tried and changes[0] > STALLED * each.start.changes[0] for each in self.before)

    def doubled(self, failure: Exception | None) -> StopStart:
        return StopStart(self.problem, self.space.with_axis(0, self.space.phi.enriched()))

    def refined(self, solution: Solution, goal: float, most: int) -> StopStart:
        """Two degrees more where they change most, if they are to, and other functions of the noise."""
        phi, changes, tried = self.space.phi, np.array(solution.start.changes), ()
        if not self.before or solution.measured[0] > 0.5 * goal:
            left, raised = OF_ONE * changes, changes >= WORTH * np.max(changes)
            for at in np.argsort(-changes):
                left[at] *= FALL
                if np.sum(left) <= goal:
                    raised &= changes >= changes[at]
                    break
            tried = tuple(compress(phi.ways, raised))
            phi = phi.finer(tried, ["degree"] if self._stalls(solution.start.changes) else [])
        share = max(SHARE * goal, MINOR_NOISE * solution.measured[0])
        found = self.finer(phi, solution, share)
        return StopStart(self.problem, found, before=(solution,), is_first=False, tried=tried)


class Stopped(Directions):
    """Λ(p) of four variables with a stop, at which T is a root."""

    stage = StopStart
    by_moments = False
    usual_rtol = 1e-3

    def is_dear(self, p: float) -> bool:
        return True

    def line_rtol(self, p: float) -> float:
        return 3e-3

    def slope_error(self, p: float) -> float:
        """Twice what has changed since a coarser solution, where there is one."""
        found = self.solution(p)
        if not (found.start and found.start.before):
            return super().slope_error(p)
        return float(2 * abs(found.start.before[-1].derivative - found.derivative) + slope_rounding(found.pair))
