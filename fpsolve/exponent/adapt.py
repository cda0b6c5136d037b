"""Choosing the discretisation for each p: it is refined until Λ(p) meets a tolerance, or the budget is spent."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic.dataclasses import dataclass as pydantic_dataclass

from fpsolve.errors import FpsolveError, MeshError, NotConverged, SingularMatrix
from fpsolve.exponent.corners import corners
from fpsolve.exponent.eigen import principal_pair
from fpsolve.exponent.error import Solution
from fpsolve.exponent.refine import first, first_far, refined
from fpsolve.exponent.rival import comparable, rival
from fpsolve.fem.discretisation import Discretisation
from fpsolve.fem.factors import MAX_DENSE_UNKNOWNS
from fpsolve.fem.generator import Generator
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.faults import told_in_words
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.model.problem import Problem
from fpsolve.theory.far import far_places
from fpsolve.theory.frozen import frozen_noise

MAX_STAGES = 30
WORTH_A_TRY = MAX_DENSE_UNKNOWNS
"""Unknowns of a system that takes less time than finding another one."""
MOST_RESCALING = 0.1
"""Of ln |p|, on which the place far out depends, for one discretisation."""
MOST_TILT_AWAY = 0.7
"""How far the tilt of a space may be from the best one at another p."""
SECONDS_PER_UNKNOWN = 3e-8
"""A solve takes about this times the power 1.5 of the number of unknowns; it is corrected by the last one."""


@told_in_words
@pydantic_dataclass(frozen=True, config=STRICT)
class Budget:
    """What one Λ(p) may cost.

    Args:
        unknowns: of the largest system; memory grows with it, some 30 kB each, 1.8 GB in all for the 60,000.
        seconds: of the processor for one p; foreseen before every solve from the last one, so that it may take a third
            more.

    Raises:
        ParameterError: a number is out of its range.
    """

    unknowns: Annotated[int, parameter("unknowns of the largest system", "unknowns = 60000", ge=100)] = 60_000
    seconds: Annotated[float, parameter("time for one p", "seconds = 60.0", gt=0)] = 60.0


def resolve(
    problem: Problem,
    p: float,
    *,
    tolerance: Callable[[float], float],
    rtol: float,
    budget: Budget,
    start: Solution | None = None,
) -> Solution:
    """A solution whose error of Λ(p) is within a tolerance.

    Args:
        p: the moment, not 0, where Λ has no scale.
        tolerance: the largest error allowed, from a value of Λ(p).
        rtol: about what that is relative to the size of Λ(p), for a first discretisation.
        start: a solution at p that does not suffice, to go on from.

    Raises:
        NotConverged: the budget does not suffice, or rounding is larger than the tolerance; `partial` is the best
            `Solution`, or None.
    """
    meter = _Meter(p, budget)
    frozen = frozen_noise(problem)
    center = frozen.center(p) if frozen else 0.0
    found = _search(problem, start or first(problem, p, center, rtol), tolerance, meter)
    elsewhere = rival(found.pair)
    if elsewhere is not None:
        other = _search(problem, first(problem, p, elsewhere, rtol), tolerance, meter)
        found = max(found, other, key=lambda each: each.pair.value)
    return found


def resolve_far(
    problem: Problem,
    p: float,
    *,
    tolerance: Callable[[float], float],
    rtol: float,
    budget: Budget,
    start: Solution | None = None,
) -> Solution:
    """The same for the places far out of algebraic tails, of which there is one at least.

    Paths that leave the interval of the noise are killed, which makes Λ(p) smaller, but by no more than the tolerance.
    """
    meter = _Meter(p, budget)
    places = far_places(problem, p)
    enough = comparable(max(place.rate for place in places))
    wanted = [place for place in places if place.rate > enough]
    if start is not None and len(wanted) == 1:
        return _search(problem, start, tolerance, meter)
    found = (_search(problem, first_far(problem, place, rtol), tolerance, meter) for place in wanted)
    return max(found, key=lambda each: each.pair.value)


def _search(
    problem: Problem, start: Solution | Discretisation, tolerance: Callable[[float], float], meter: _Meter
) -> Solution:
    """What `resolve` promises, with the tilted density sought where a first discretisation, or a solution, is."""
    p, pair = meter.p, None
    if isinstance(start, Discretisation):
        chosen = start
    else:
        chosen, pair = refined(start, tolerance(start.pair.value), 0), start.pair
    while True:
        meter.check(chosen)
        try:
            pair = principal_pair(Generator(problem, chosen), p, start=pair)
        except (MeshError, NotConverged, SingularMatrix, np.linalg.LinAlgError) as failure:
            meter.failure, pair = failure, None
            chosen = chosen.doubled()
            continue
        solution = Solution(pair)
        allowed = tolerance(pair.value)
        seems_enough = solution.error_by_modes <= allowed
        error = solution.error if seems_enough else solution.error_by_modes
        if error <= allowed:
            return solution
        meter.note(solution, error, allowed)
        chosen = chosen.enriched() if seems_enough else refined(solution, allowed, meter.stages)


@dataclass
class _Meter:
    """What a search for a discretisation has cost, and the best it has found."""

    p: float
    budget: Budget
    started: float = field(default_factory=time.thread_time)
    stages: int = 0
    best: Solution | None = None
    error: float = math.inf
    share: float = math.inf
    failure: Exception | None = None
    last: tuple[float, int] = (0.0, 0)

    def check(self, chosen: Discretisation) -> None:
        """Refuse a stage beyond the budget, and count it."""
        size, elapsed = chosen.size, time.thread_time() - self.started
        cost = max(SECONDS_PER_UNKNOWN, (elapsed - self.last[0]) / max(self.last[1], 1) ** 1.5 if self.last[1] else 0.0)
        seconds = elapsed + cost * size**1.5
        if size > self.budget.unknowns:
            self.stop(Message(Code.UNKNOWNS_SPENT, unknowns=size, most=self.budget.unknowns))
        if seconds > self.budget.seconds:
            self.stop(Message(Code.SECONDS_SPENT, seconds=seconds, most=self.budget.seconds))
        if self.stages >= MAX_STAGES:
            self.stop(Message(Code.MESHES_SPENT, count=MAX_STAGES))
        self.last, self.stages = (elapsed, size), self.stages + 1

    def note(self, solution: Solution, error: float, allowed: float) -> None:
        """Keep the best solution; stop where only rounding is left."""
        if error / allowed < self.share:
            self.best, self.error, self.share = solution, error, error / allowed
        if solution.pair.rounding > allowed:
            self.stop(Message(Code.ROUNDED, size=solution.pair.rounding))

    def stop(self, reason: Message) -> None:
        """Raise `NotConverged` with the best solution."""
        if best := self.best:
            reached = {"value": best.pair.value, "error": self.error, "size": self.share}
            told = Message(Code.BUDGET_SPENT, p=self.p, reason=reason, **reached)
        else:
            last, is_thin = self.failure, isinstance(self.failure, NotConverged)
            said = last.message.advising(None) if isinstance(last, FpsolveError) else last and str(last)
            told = Message(Code.NOTHING_RESOLVED, p=self.p, reason=reason, is_thin=is_thin, last=said)
        raise NotConverged(told, best, Remedy.BUDGET)


def fits(generator: Generator, q: float, p: float) -> bool:
    """Whether what serves q is likely to serve p, or so small that it is worth a try."""
    if generator.chosen.is_killed:
        return abs(math.log(p / q)) < MOST_RESCALING
    frozen = frozen_noise(generator.problem)
    if generator.size > WORTH_A_TRY and abs(p - q) > max(0.5, 0.4 * min(abs(p), abs(q))):
        return False
    if frozen is None or generator.chosen.noise.kind != "polynomials":
        return True
    if corners(generator.problem, p):
        return False
    return abs(frozen.tilt(frozen.center(p)) - generator.chosen.noise.slope * p) <= MOST_TILT_AWAY
