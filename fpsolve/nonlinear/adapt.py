"""How many functions of u, φ and ξ there are, and on which interval of u, until the means of the response settle.

Each direction has two levels. What the means change from the lower to the higher one is taken for what the higher one
lacks; where they converge this is more than it does lack. The two ends of the interval are directions, too: they are
compared with an interval that is shorter by one element.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import gamma

from fpsolve.arrays import FloatArray
from fpsolve.errors import NotConverged
from fpsolve.fem.discretisation import NoisePart, first_part
from fpsolve.fem.factors import one_thread
from fpsolve.messages import Code, Message
from fpsolve.nonlinear.elimination import Solution, Tail, solved, solved_tail
from fpsolve.nonlinear.operator import Circle, Flow, Height, Plane

SHARE = 0.2
"""Of the tolerance that one direction may lack."""
FAR = 300.0
"""Times the tolerance from which on it takes two steps."""
MOST_STAGES = 24
CELLS = 2
"""Of the phase between two impacts."""
GIGABYTES = 2.0
"""Of memory for one solve."""
SPACING = 1.1
"""Of the vertices of u over the standard deviation of ln a in weak noise."""
WIDEST = 0.5
"""Of an element in u."""
FEWEST, HIGHEST_DEGREE = 4, 8
"""Elements in u, and their degree; beyond it they are halved."""
QUANTILE = 1e-2
"""Of the tolerance that the first interval leaves out on each side, in weak noise."""
ROUNDING = 1e-12


@dataclass(frozen=True)
class Choice:
    """A discretisation.

    Attributes:
        cells, phi_degree: elements of φ.
        part: functions of ξ.
        left, right: the interval of u.
        elements, degree: elements of u.
    """

    cells: int
    phi_degree: int
    part: NoisePart
    left: float
    right: float
    elements: int
    degree: int

    @property
    def plane_size(self) -> int:
        return self.cells * self.phi_degree * self.part.size

    @property
    def size(self) -> int:
        """Unknowns."""
        return self.plane_size * (self.elements * self.degree + 1)

    @property
    def gigabytes(self) -> float:
        """Of an element with its factors, and of the columns that are kept."""
        return 8e-9 * self.plane_size**2 * (3 * self.degree**2 + (self.degree + 4) + self.elements * self.degree)

    @property
    def step(self) -> float:
        """The length of an element."""
        return (self.right - self.left) / self.elements


def finer_phase(choice: Choice) -> Choice:
    return replace(choice, phi_degree=choice.phi_degree + 3)


def finer_noise(choice: Choice) -> Choice:
    return replace(choice, part=choice.part.enriched())


def finer_height(choice: Choice) -> Choice:
    if choice.degree < HIGHEST_DEGREE:
        return replace(choice, degree=choice.degree + 1)
    return replace(choice, elements=math.ceil(1.3 * choice.elements))


def further_up(choice: Choice) -> Choice:
    return replace(choice, right=choice.right + choice.step, elements=choice.elements + 1)


def further_down(choice: Choice) -> Choice:
    return replace(choice, left=choice.left - choice.step, elements=choice.elements + 1)


DIRECTIONS = (finer_phase, finer_noise, finer_height, further_up, further_down)
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
        self._known: dict[Levels, FloatArray] = {}
        self.unknowns = 0

    def settled(self) -> tuple[Solution, FloatArray, FloatArray]:
        """A solution whose means are settled, these, and their error estimates. Raises `NotConverged`."""
        levels: Levels = (1,) * len(DIRECTIONS)
        for _ in range(MOST_STAGES):
            solution = self.solve(levels)
            found = self._known[levels] = self._numbers(solution)
            lower = [tuple(level - (k == own) for own, level in enumerate(levels)) for k in range(len(levels))]
            changes = np.abs([found - self.numbers(each) for each in lower])
            scales = np.abs(found[:-1])
            errors = changes.sum(axis=0) + ROUNDING * np.abs(found)
            worst = np.max(changes[:, :-1] / (self.rtol * scales), axis=1)
            if np.all(errors[:-1] <= self.rtol * scales):
                return solution, found, errors
            more = (worst > SHARE) | (worst == worst.max())
            levels = tuple(int(n) for n in np.array(levels) + more + (worst > FAR))
        raise NotConverged(Message(Code.RESPONSE_OPEN, size=float(np.max(errors[:-1] / scales))))

    @cached_property
    def base(self) -> Choice:
        """One that serves weak noise, where a² has a law of the shape −δ_p/2 and the mean λ/κ."""
        motion = self.flow.problem.system.motion()
        shape, digits = self.index / 2, -math.log10(self.rtol)
        damping = (motion.cubic + 3 * motion.rayleigh) / 8
        law = gamma(shape, scale=self.rate / damping / shape)
        left, right = (
            0.5 * math.log(max(law.ppf(q), 1e-300)) for q in (QUANTILE * self.rtol, 1 - QUANTILE * self.rtol)
        )
        part = first_part(self.flow.problem.coloured, digits)
        tail = solved_tail(Plane(self.flow, Circle(CELLS, round(4 + digits / 2)), part), self.index)
        left = min(max(left, tail.reach(QUANTILE * self.rtol)), right - 1.0)
        deviation = 0.5 / math.sqrt(shape)
        elements = max(FEWEST, math.ceil((right - left) / min(SPACING * deviation, WIDEST)))
        return Choice(CELLS, round(4 + digits / 2), part, left, right, elements, 4)

    def numbers(self, levels: Levels) -> FloatArray:
        """The means on one discretisation. Raises `NotConverged`."""
        if levels not in self._known:
            self._known[levels] = self._numbers(self.solve(levels))
        return self._known[levels]

    def solve(self, levels: Levels) -> Solution:
        """The density on one discretisation. Raises `NotConverged` where it does not fit into the memory."""
        choice = self.base
        for finer, level in zip(DIRECTIONS, levels, strict=True):
            for _ in range(level):
                choice = finer(choice)
        if choice.gigabytes > GIGABYTES:
            data = {"unknowns": choice.size, "gigabytes": choice.gigabytes, "most": GIGABYTES}
            raise NotConverged(Message(Code.RESPONSE_TOO_LARGE, **data))
        self.unknowns = max(self.unknowns, choice.size)
        with one_thread():
            if levels[:2] not in self._planes:
                plane = Plane(self.flow, Circle(choice.cells, choice.phi_degree), choice.part)
                self._planes[levels[:2]] = plane, solved_tail(plane, self.index)
            plane, tail = self._planes[levels[:2]]
            lines = np.linspace(choice.left, choice.right, choice.elements + 1)
            return solved(plane, Height(lines, choice.degree), tail)
