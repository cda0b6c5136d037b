"""Λ(p) of four variables with a stop: finer elements and waves on the half sphere, until Λ(p) settles.

The coordinates are those of the stop, each pair in a unit and, the second one, in a rotation of its own, as nothing
else keeps the impact. Between both pairs the unit is that in which E xxᵀ and Q of `modes` are alike, of the motion
without the stop. T is smooth there, and the layers of T* are nothing to Λ(p).

What two degrees more change to first order, in η, in θ₁ and in θ₂ by themselves, tells where finer functions are
needed. At the stop T is a root, so that these changes fall as a power of the degree, and not evenly: they correct
nothing. What is left is `MEASURED` of them and the last step of Λ(p), so that there is one step at least. Where finer
functions leave more than half of a change, elements do not see the layer of T from one mode to the other, if there is
one: they are halved.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Solution
from fpsolve.exponent.modes import MEASURED, MINOR, DirectionStart, frame_of, mean_matrix, second_moments
from fpsolve.fem.directions import HalfSphereAxis
from fpsolve.model.plane import LinearMotion, rotating_coordinates
from fpsolve.model.problem import Problem

FIRST_DEGREE = 4
"""Degree of the elements of the first space."""
FIRST_WAVES = 2
"""Largest degree of its waves."""
AT_STOP = 0.0, 0.8, 1.0
"""Vertices in η, over ½π: a smaller element where the first mass is at rest at the stop."""
STALLED = 0.5
"""Share of a change that a step leaves where elements do not see a layer of T between the two modes."""
WORTH = 0.1
"""Share of the largest change, or of the tolerance, from which on functions of another angle are made finer, too."""


def _rotating(block: FloatArray) -> FloatArray:
    """Coordinates in which a pair rotates uniformly, but for growth, the first one as it was but for its unit."""
    if (found := rotating_coordinates(block)) is None:
        _, found = scipy.linalg.matrix_balance(block, permute=False)
    lower = np.linalg.qr(found.T)[1].T
    return np.asarray(lower * np.sign(np.diagonal(lower)))


@dataclass(frozen=True, eq=False)
class StopStart(DirectionStart):
    """Directions of four variables with a stop; `before` holds the solution with coarser functions, if there is one.

    Attributes:
        changes: what is lacking in each of the ways of the functions of directions, where that is known.
    """

    changes: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def directions(problem: Problem) -> HalfSphereAxis:
        stop, system = problem.system.stop, problem.system
        assert stop is not None
        free, smooth = stop.inside(mean_matrix(problem, system)), LinearMotion(system.epsilon, tuple(system.terms))
        own = scipy.linalg.block_diag(_rotating(free[:2, :2]), _rotating(free[2:, 2:]))
        own = np.linalg.solve(np.array(stop.coordinates), own)
        forms = second_moments(replace(problem, system=smooth), own)
        q, moments = (np.diagonal(each).reshape(2, 2).sum(axis=1) for each in forms)
        return HalfSphereAxis(
            np.linalg.solve(frame_of(problem), own * np.repeat((moments / q) ** 0.25, 2)),
            0.5 * math.pi * np.array(AT_STOP),
            FIRST_DEGREE,
            FIRST_WAVES,
            np.linspace(-0.5, 0.5, 3) * math.pi,
            FIRST_DEGREE,
        )

    def again(self) -> StopStart:
        """Those before the ones that were enough."""
        return self.before[0].start if self.before else self

    def judged(self, pair: PrincipalPair, allowed: float) -> Solution:
        phi, (_, *of_noises) = self.space.phi, self.errors_of_axes(pair, allowed)
        changes = {way: self.lacking(pair, 0, phi.deeper(way)) for way in phi.ways if way != "waves"}
        changes["waves"] = MEASURED * abs(self.change(pair))
        step = abs(pair.value - self.before[0].pair.value) if self.before else math.inf
        return Solution(pair, step, (sum(changes.values()), *of_noises), replace(self, changes=changes))

    def doubled(self, failure: Exception | None) -> StopStart:
        return replace(self, space=self.space.with_axis(0, self.space.phi.enriched()))

    def refined(self, solution: Solution, goal: float, stages: int, most: int) -> StopStart:
        """Two degrees more in the ways that change most, if they are to, and other functions of the noise."""
        phi, changes = self.space.phi, solution.start.changes
        if not self.before or solution.search + sum(changes.values()) > 0.5 * goal:
            largest = max(changes.values())
            ways = [way for way, each in changes.items() if each >= min(largest, WORTH * max(largest, goal))]
            stalled = [way for way in ways for each in self.before if self._stalls(way, changes[way], each)]
            phi = phi.finer(ways, stalled)
        return replace(self, space=self.finer(phi, solution, MINOR * goal), before=(solution,))

    def _stalls(self, way: str, change: float, coarser: Solution) -> bool:
        """Whether the last step made functions finer in a way and left more than `STALLED` of what these change."""
        is_finer = getattr(self.space.phi, way) != getattr(coarser.pair.space.phi, way)
        return is_finer and change > STALLED * coarser.start.changes[way]
