"""The largest eigenvalue around one place of the noise at any p, each solve starting from those at the nearest p."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import MeshError, NotConverged
from fpsolve.exponent.adapt import WORTH_A_TRY, Budget, fits, resolve, resolve_far
from fpsolve.exponent.corners import corners
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution
from fpsolve.exponent.refine import refined
from fpsolve.exponent.rival import is_far_out, rival
from fpsolve.fem.discretisation import Discretisation
from fpsolve.fem.factors import one_thread
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.problem import Problem

TRIM = 0.8
"""A smaller space must have at most this share of the unknowns."""
SMALL_P = 1e-2
"""For smaller |p| the discretisation is chosen at this one, as Λ and its error go to zero together."""
NEIGHBOURS = 6
"""How many known eigenfunctions those of another p are interpolated from."""
Tolerance = Callable[[float, float], float]
"""The largest error allowed, from p and a value of Λ(p)."""


@dataclass(frozen=True, eq=False)
class Branch:
    """The eigenvalue of one problem on all p.

    Args:
        problem: a motion and its noise.
        mesh: a mesh for all p; None chooses a discretisation for each p that meets the tolerance.
        rtol: about what the tolerance is relative to the size of Λ(p).
        budget: what the choice of a discretisation may cost.
        tolerance: the usual one.
        is_far: whether it is that of the places far out of algebraic tails.
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
    is_far: bool = False
    starts: Mapping[float, Solution] = field(default_factory=dict)
    known: dict[float, Solution] = field(init=False, default_factory=dict)
    _failed: dict[float, NotConverged] = field(init=False, default_factory=dict)

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The principal eigenpair at p and its error, within a tolerance, the usual one if none is given.

        Raises:
            NotConverged: the mesh does not resolve the problem, or the budget does not suffice to find one.
        """
        if tolerance is None and p in self._failed:
            raise self._failed[p]
        allowed = tolerance or self.tolerance
        if p not in self.known or (self.mesh is None and not self._meets(self.known[p], allowed)):
            try:
                with one_thread():
                    self.known[p] = self._found(p, allowed)
            except NotConverged as failure:
                if self.is_far:
                    failure = NotConverged(Message(Code.FAR_OUT, reason=failure.message), failure.partial)
                if tolerance is None:  # a tighter one may be out of reach where this is not
                    self._failed[p] = failure
                raise failure from None
            except MeshError as failure:
                if self.mesh is not None:
                    raise
                told = Message(Code.NOT_CONVERGED, p=p, reason=failure.message, remedy=self.remedy)
                raise NotConverged(told) from failure
            except np.linalg.LinAlgError as failure:
                told = Message(Code.NOT_SOLVED, p=p, reason=str(failure), remedy=self.remedy)
                raise NotConverged(told) from failure
            except ArithmeticError as failure:
                raise NotConverged(Message(Code.OUT_OF_RANGE, p=p, reason=str(failure))) from failure
        return self.known[p]

    @property
    def remedy(self) -> Remedy:
        """What to do where it is not resolved."""
        return Remedy.BUDGET if self.mesh is None else Remedy.MESH

    @property
    def refinement(self) -> Remedy:
        """What to do where it should be resolved better."""
        return Remedy.SMALLER_RTOL if self.mesh is None else Remedy.MESH

    def remedied(self, solve: Callable[[], PrincipalPair]) -> PrincipalPair:
        """A pair; where it is not found, the failure has the remedy of this branch."""
        try:
            return solve()
        except NotConverged as failure:
            raise NotConverged(failure.reason, failure.partial, self.remedy) from failure

    def near_zero(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The solution at ±`SMALL_P` that a smaller p goes with."""
        side = p or (-1.0 if self.problem.noise.has_algebraic_tails else 1.0)  # where Λ is finite
        q = math.copysign(SMALL_P, side)
        try:
            return self.solution(q, tolerance)
        except NotConverged as failure:
            raise NotConverged(Message(Code.NEAR_ZERO, p=q, reason=failure.message), failure.partial) from failure

    def _found(self, p: float, tolerance: Tolerance) -> Solution:
        """A solution that meets a tolerance, or the one on the given mesh."""
        if self.mesh is not None:
            coarse, fine = self._given
            pair = self._tried(coarse, p).pair
            return Solution(pair, self.remedied(lambda: principal_pair(fine, p, start=pair)))
        if abs(p) < SMALL_P and not self.is_far:
            return self._tried(self.near_zero(p, tolerance).pair.generator, p)
        start = None
        for tried in (self._from_start, self._from_nearest):
            start = tried(p, tolerance) or start
            if start is not None and self._meets(start, tolerance) and rival(start.pair) is None:
                return start
        search, allowed = resolve_far if self.is_far else resolve, partial(tolerance, p)
        return search(self.problem, p, tolerance=allowed, rtol=self.rtol, budget=self.budget, start=start)

    @cached_property
    def _given(self) -> tuple[Generator, Generator]:
        """That of the given mesh, and one of four degrees more, whose error hardly counts beside it."""
        assert self.mesh is not None
        generator = Generator(self.problem, self.mesh)
        return generator, generator.enriched().enriched()

    def _from_nearest(self, p: float, tolerance: Tolerance) -> Solution | None:
        """The solution at p with what was chosen for the nearest p, where that is likely to do."""
        nearest = min(self.known, key=lambda q: abs(q - p), default=None)
        if nearest is None:
            return None
        generator = self.known[nearest].pair.generator
        if (chosen := _trimmed(self.known[nearest], tolerance)) is not generator.chosen:
            generator = Generator(self.problem, chosen)
        try:
            solution = self._tried(generator, p) if fits(generator, nearest, p) else None
        except NotConverged:
            return None
        if solution is None or self.is_far or nearest == p or not is_far_out(solution.pair):
            return solution
        return None  # its interval reaches a place far out, which at this p is not the nearest to ξ = 0

    def _from_start(self, p: float, tolerance: Tolerance) -> Solution | None:
        """The solution at p with what was chosen for it in the problem close by, or None."""
        if p not in self.starts or corners(self.problem, p):  # which lie elsewhere there
            return None
        chosen = _trimmed(self.starts[p], tolerance)
        try:
            return Solution(principal_pair(Generator(self.problem, chosen), p, start=self.starts[p].pair))
        except (NotConverged, MeshError):
            return None

    def _tried(self, generator: Generator, p: float) -> Solution:
        """The solution at p with a generator, from those around p, or from the nearest one."""
        known = (solution.pair for solution in self.known.values())
        near = sorted(known, key=lambda pair: abs(pair.p - p))[:NEIGHBOURS]
        return Solution(self.remedied(lambda: principal_pair(generator, p, start=near)))

    def _meets(self, solution: Solution, tolerance: Tolerance) -> bool:
        """Whether an error is within a tolerance; for small p, where Λ has no scale, always."""
        pair = solution.pair
        is_small = abs(pair.p) < SMALL_P and not self.is_far
        return is_small or solution.error <= tolerance(pair.p, pair.value)


def _trimmed(solution: Solution, tolerance: Tolerance) -> Discretisation:
    """The discretisation of a solution, or a much smaller one that would do."""
    pair, generator = solution.pair, solution.pair.generator
    if abs(pair.p) < SMALL_P or generator.size <= WORTH_A_TRY:
        return generator.chosen
    smaller = refined(solution, tolerance(pair.p, pair.value), 0)
    is_better = smaller.size <= TRIM * generator.size
    return smaller if is_better else generator.chosen


def best_order(p: FloatArray) -> Any:
    """Indices of p, inwards from the largest and then from the smallest: a mesh for a large |p| serves smaller ones."""
    return np.lexsort((-np.abs(p), p < 0))
