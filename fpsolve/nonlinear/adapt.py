"""How many functions of u, φ and ξ there are, and on which interval of u, until the means of the response settle.

Each direction has two levels. Twice what the means change from the lower to the higher one is taken for what the higher
one lacks; where they converge fast this is more than it lacks. The lower end of the interval is a direction, too: it
is compared with an interval that is shorter by one element. What lies above the upper end follows from the shares of
E a⁴ in the last two elements, as ρ falls faster and faster there; where it falls slowly that end is compared, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import gamma

from fpsolve.arrays import ROUNDED, FloatArray
from fpsolve.errors import NotConverged
from fpsolve.fem.factors import one_thread
from fpsolve.fem.noise_axes import NoiseAxis
from fpsolve.fem.space import first_axis
from fpsolve.messages import Code, Message
from fpsolve.nonlinear.elimination import Solution, Tail, mean_damping, solved, solved_tail
from fpsolve.nonlinear.operator import Elements, Flow, Plane

SHARE = 0.2
"""Share of the tolerance that one direction may lack."""
ABOVE = 0.02
"""Share of the tolerance that may lie above the interval of u."""
FAR = 300.0
"""Error over the tolerance from which on a direction takes two steps."""
MOST_STAGES = 24
"""Largest number of refinements."""
CELLS = 2
"""Number of cells of the phase between two impacts."""
MOST_UNKNOWNS = 100_000
"""Largest number of unknowns."""
SPACING = 1.1
"""Distance of the vertices of u over the standard deviation of ln a in weak noise."""
WIDEST = 0.5
"""Length of the longest element in u."""
FEWEST = 4
"""Smallest number of elements in u."""
HIGHEST_DEGREE = 8
"""Highest degree of an element in u; beyond it elements are halved."""
QUANTILE = 1e-2
"""Share of the tolerance that the first interval leaves out below, in weak noise; above it is the tolerance itself."""
LEAST_DAMPING = 0.01
"""Smallest κ to begin with, over the largest damping at a phase."""
FURTHER = 0.5
"""Step of the lower end of u."""
SEEN = 1e-3
"""Share of E aⁿ above which that of an element is no wave that is not resolved, if it is certain."""
CERTAIN = 0.5
"""Change of a share with the phase and the noise, over the share, below which it is certain."""
SLOW = 0.25
"""Ratio of the last two shares of E a⁴ from which on the upper end is compared with one an element lower."""
MOST_HIGHER = 2
"""Largest step of the upper end of u, in elements."""
SAFETY = 2.0
"""Factor to what the last level of a direction changes, for what it may lack where it converges slowly."""


@dataclass(frozen=True)
class Choice:
    """A discretisation.

    Attributes:
        cells, phi_degree: elements of φ.
        xi: functions of ξ.
        bottom, top: the interval of u.
        step, degree: elements of u.
    """

    cells: int
    phi_degree: int
    xi: NoiseAxis
    bottom: float
    top: float
    step: float
    degree: int

    @property
    def elements(self) -> int:
        """The number of elements in u."""
        return max(FEWEST, math.ceil((self.top - self.bottom) / self.step - 1e-9))

    @property
    def lines(self) -> FloatArray:
        """The vertices of u, from the top downwards, so that a change of the bottom moves none."""
        return np.asarray(self.top - self.step * np.arange(self.elements + 1)[::-1])

    @property
    def size(self) -> int:
        """Unknowns."""
        return self.cells * self.phi_degree * self.xi.size * (self.elements * self.degree + 1)


def finer_phase(choice: Choice) -> Choice:
    return replace(choice, phi_degree=choice.phi_degree + 3)


def finer_noise(choice: Choice) -> Choice:
    return replace(choice, xi=choice.xi.enriched())


def finer_height(choice: Choice) -> Choice:
    if choice.degree < HIGHEST_DEGREE:
        return replace(choice, degree=choice.degree + 1)
    return replace(choice, step=choice.step / 1.3)


def further_down(choice: Choice) -> Choice:
    return replace(choice, bottom=choice.bottom - FURTHER)


DIRECTIONS = (finer_phase, finer_noise, finer_height, further_down)
Levels = tuple[int, ...]
"""How often a first discretisation is made finer in each direction."""


class Search:
    """Discretisations of one problem, and what they give.

    Args:
        flow: the motion.
        index: −δ_p, near which the exponent of the tail is.
        rate: λ.
        numbers: the means that are to settle, of a `Solution`; the last is given with its error, whatever that is.
        rtol: how far, relative to each.
    """

    def __init__(
        self, flow: Flow, index: float, rate: float, numbers: Callable[[Solution], FloatArray], rtol: float
    ) -> None:
        self.flow, self.index, self.rate, self._numbers, self.rtol = flow, index, rate, numbers, rtol
        self._planes: dict[Levels, tuple[Plane, Tail]] = {}
        self.unknowns, self._reached = 0, math.inf

    def settled(self) -> tuple[Settled, FloatArray, FloatArray]:
        """A density whose means are settled, these, and their error estimates. Raises `NotConverged`."""
        levels: Levels = (1,) * len(DIRECTIONS)
        top = self.base.top
        for _ in range(MOST_STAGES):
            lower = [tuple(level - (k == own) for own, level in enumerate(levels)) for k in range(len(levels))]
            found = Settled(self.solve(levels, top), tuple(self.solve(each, top) for each in lower))
            numbers, changes, errors = self._judged(found)
            fall = found.fall(4)
            if self._reached <= self.rtol and fall.ratio > SLOW:
                found = replace(found, lower=(*found.lower, self.solve(levels, top - fall.step)))
                numbers, changes, errors = self._judged(found)
            if self._reached <= self.rtol:
                return found, numbers, errors
            worst = np.max(changes[: len(levels), :-1] / (self.rtol * np.abs(numbers[:-1])), axis=1)
            levels = tuple(int(n) for n in np.array(levels) + (worst > min(SHARE, worst.max() / 2)) + (worst > FAR))
            top = max(fall.top(ABOVE * self.rtol), top + fall.step * (len(changes) > len(worst)))
        raise NotConverged(Message(Code.RESPONSE_OPEN, size=self._reached))

    def _judged(self, found: Settled) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The means of a density, by how much they change in each direction, and their errors."""
        numbers, changes = found.compared(self._numbers)
        scales = np.abs(numbers[:-1])
        errors = found.errors(changes, np.append(scales, self.rate))
        self._reached = float(np.max(errors[:-1] / scales))
        return numbers, changes, errors

    @cached_property
    def base(self) -> Choice:
        """One that serves weak noise, where a² has a law of the shape −δ_p/2 and the mean λ/κ."""
        shape, digits = self.index / 2, -math.log10(self.rtol)
        degree = round(4 + digits / 2)
        plane = Plane(self.flow, self._circle(degree), first_axis(self.flow.problem.valued, digits))
        most = float(np.max(np.abs(self.flow.rise(self.flow.cubic, plane.circle.points))))
        law = gamma(shape, scale=self.rate / max(mean_damping(plane), LEAST_DAMPING * most) / shape)
        bottom, top = (0.5 * math.log(max(law.ppf(q), 1e-300)) for q in (QUANTILE * self.rtol, 1 - self.rtol))
        tail = solved_tail(plane, self.index)
        bottom = min(max(bottom, tail.reach(QUANTILE * self.rtol)), top - 1.0)
        step = min(SPACING * 0.5 / math.sqrt(shape), WIDEST, (top - bottom) / FEWEST)
        return Choice(CELLS, degree, plane.axis, bottom, top, step, 4)

    def _circle(self, degree: int) -> Elements:
        return Elements(self.flow.phases(CELLS + 1), degree, is_closed=True)

    def solve(self, levels: Levels, top: float) -> Solution:
        """The density on one discretisation. Raises `NotConverged` where it is too large."""
        choice = replace(self.base, top=top)
        for finer, level in zip(DIRECTIONS, levels, strict=True):
            for _ in range(level):
                choice = finer(choice)
        if choice.size > MOST_UNKNOWNS:
            data = {"unknowns": choice.size, "most": MOST_UNKNOWNS, "size": self._reached}
            raise NotConverged(Message(Code.RESPONSE_OPEN, **data))
        self.unknowns = max(self.unknowns, choice.size)
        with one_thread():
            if levels[:2] not in self._planes:
                plane = Plane(self.flow, self._circle(choice.phi_degree), choice.xi)
                self._planes[levels[:2]] = plane, solved_tail(plane, self.index)
            plane, tail = self._planes[levels[:2]]
            return solved(plane, Elements(choice.lines, choice.degree), tail)


@dataclass(frozen=True, eq=False)
class Settled:
    """A density, and those by which its errors are estimated.

    Attributes:
        solution: on the finest discretisation.
        lower: on one that is coarser in each direction; last on an interval that ends lower, where E a⁴ falls slowly.
    """

    solution: Solution
    lower: tuple[Solution, ...]

    def fall(self, n: int) -> Fall:
        """How the shares of E aⁿ fall above."""
        lines, shares = self.solution.height.lines, self.solution.shares(n)
        alike = [each for each in self.lower if np.array_equal(each.height.lines, lines)]
        changes = np.max([np.abs(shares - each.shares(n)) for each in alike], axis=0)
        is_seen = (np.abs(shares) > SEEN * np.abs(shares).sum()) & (changes < CERTAIN * np.abs(shares))
        return Fall.of(np.abs(shares), is_seen, lines)

    def compared(self, numbers: Callable[[Solution], Any]) -> tuple[Any, FloatArray]:
        """Numbers of the solution, and by how much they change in each direction."""
        found = numbers(self.solution)
        return found, np.abs([found - numbers(each) for each in self.lower])

    def errors(self, changes: FloatArray, scales: Any, order: int = 4) -> FloatArray:
        """Error estimates of numbers that grow with a like its power of an order at most, and have these scales."""
        above = self.fall(order).share_above(float(self.solution.height.lines[-1]))
        return np.asarray(SAFETY * changes.sum(axis=0) + (above + ROUNDED) * scales)


@dataclass(frozen=True)
class Fall:
    """How E aⁿ falls in the uppermost elements of u: faster and faster where it is small, as far up as it is resolved.

    Attributes:
        end: up to where it does.
        step: the length of an element.
        share: what lies above `end`.
        ratio: of the shares of the last two elements below; 1 or more if they do not fall.
    """

    end: float
    step: float
    share: float
    ratio: float

    @classmethod
    def of(cls, shares: FloatArray, is_seen: Any, lines: FloatArray) -> Fall:
        """The fall of shares of elements between vertices, those that are no waves being known."""
        last, ratio = int(np.argmax(shares)), 1.0
        while last + 1 < shares.size and (shares[last + 1] < ratio * shares[last] or is_seen[last + 1]):
            last, ratio = last + 1, float(shares[last + 1] / shares[last])
        share = shares[last] / shares.sum() * (ratio / (1 - ratio) if ratio < 1 else 1)
        return cls(float(lines[last + 1]), float(lines[-1] - lines[-2]), float(share), ratio)

    def share_above(self, top: float) -> float:
        """The largest share above a place that is not below `end`."""
        return self.share * self.ratio ** ((top - self.end) / self.step)

    def top(self, share: float) -> float:
        """A place above which there is about a share, if what is above falls like exp(−const e^{2u}); not far above."""
        if self.ratio >= 1:
            return self.end + self.step
        rate = math.log(1 / self.ratio) / -math.expm1(-2 * self.step)
        return self.end + min(0.5 * math.log1p(max(0.0, math.log(self.share / share)) / rate), MOST_HIGHER * self.step)
