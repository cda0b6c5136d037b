"""Λ(p) of systems of dimension 3 and 4: waves of ever higher degree on the sphere of directions, until Λ(p) settles.

The functions are those of directions in coordinates that the second moments choose. E‖x‖² grows with Λ(2), and
T = xᵀQx is its eigenfunction for p = 2: in the coordinates of the eigenvectors of Q the strong modes are one group and
the weak ones the other. Where the noise is weak against the difference of their dampings, T has a layer of the width
√(q_weak/q_strong) beside the weak ones, and T* one beside the strong ones, for which the elements are graded.

Any search begins at p = 0, where T = 1, or at the nearest p that is known, and goes from p to p on the coarsest space;
on finer ones it begins with what the coarser one has found. What two degrees of waves change tells their error, that of
all else comes from the highest modes, see `error`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.linalg

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.elements import Elements
from fpsolve.exponent.error import Solution, mode_effects
from fpsolve.exponent.method import RTOL_BEYOND_PLANE, SMALL_P, Stage, Tolerance
from fpsolve.exponent.moments import even_moment
from fpsolve.exponent.powers import moment_form
from fpsolve.exponent.starts import SHARE, Start
from fpsolve.fem.axis import FunctionAxis
from fpsolve.fem.directions import DirectionAxis, SphereAxis, group_dimensions
from fpsolve.fem.factors import factorised
from fpsolve.fem.generator import Generator
from fpsolve.fem.space import Space, first_axis
from fpsolve.messages import Remedy
from fpsolve.model.coordinates import framed, mean_matrix
from fpsolve.model.problem import Problem

FIRST_WAVES = 2
"""Number of waves of the first space in each angle."""
FIRST_DEGREE = 6
"""Degree of the polynomials of the first space."""
LARGEST_STEP = 1.0
"""Difference in p from one pair to the next one on the coarsest space."""
WEAK = 0.2
"""Width of a layer of T or T* up to which elements are graded."""
GRADED_STEP = 1.3
"""Size of graded elements in ln tan η."""
THINNEST = 1e-3
"""The least width: of modes that nothing couples the layer has none."""
WORST_CONDITION = 100.0
"""Of the eigenvectors of the motion without noise, up to which they are the coordinates."""
OF_CHANGES = 3.0
"""What is left after the correction, over that and the last change of the corrected value."""
SETTLED_SLOPE = 3e-3
"""Share of Λ′ by which it may change from one level to the next."""
MOST_FOR_SLOPES = 4
"""Number of levels after which a slope is taken as it is."""
MINOR = 0.25
"""Share of the tolerance that elements, or polynomials of a noise, may lack where others are made finer."""
MEASURED = 1.5
"""What is left after elements or polynomials of the noise, over the sizes of what each of two degrees more changes."""


def second_moments(problem: Problem, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Q of E‖x‖² = xᵀQx and the second moments of y = own⁻¹x, each of the trace 1, but for `THINNEST`² in each of y.

    Both are 1 where noise is too strong or slow for the equations of the moments.
    """
    q = moments = np.eye(len(own))
    try:
        found = even_moment(problem, 2)
        q, moments = (moment_form(each, len(own), 2) for each in (found.polynomial, found.moments))
    except NoHierarchy:
        pass
    back = np.linalg.inv(own)
    q, moments = (
        each / np.trace(each) + THINNEST**2 * np.eye(len(own)) for each in (own.T @ q @ own, back @ moments @ back.T)
    )
    return q, moments


def inside_frame(problem: Problem, own: FloatArray) -> FloatArray:
    """Coordinates of x as those of y, in which a problem is solved."""
    return np.asarray(np.linalg.solve(framed(problem).frame.array, own))


def modal_coordinates(problem: Problem) -> tuple[FloatArray, float]:
    """S of y = S⁻¹x whose directions are solved for, and ln tan η of a layer of T; T* has one at about minus that.

    Each mode of the motion without noise has a unit in which Q and E yyᵀ are of one size, so that y is the same, but
    for rotations, whatever the coordinates x are. T is about (yᵀQy)^½p, and T* a power of yᵀ(E yyᵀ)⁻¹y, so that the
    layer lies at ½ ln(q₁/q₂), q being the mean of Q on each of the two groups of y.
    """
    free = mean_matrix(problem, framed(problem).motion)
    rates, own = scipy.linalg.cdf2rdf(*np.linalg.eig(free))
    if np.linalg.cond(own) > WORST_CONDITION:
        rates, (_, own) = np.eye(len(free)), scipy.linalg.matrix_balance(free, permute=False)
    q, moments = second_moments(problem, framed(problem).frame.array @ own)
    modes = (rates != 0) | np.eye(len(free), dtype=bool)
    units = (modes @ np.diagonal(moments) / (modes @ np.diagonal(q))) ** 0.25
    sizes, axes = np.linalg.eigh(units[:, None] * q * units)
    order = [2, 1, 0] if len(sizes) == 3 else [3, 2, 1, 0]
    if len(sizes) == 3 and sizes[0] * sizes[2] < sizes[1] ** 2:  # the weakest one is by itself
        order = [0, 2, 1]
    first, second = (np.mean(each) for each in np.split(sizes[order], [group_dimensions(len(sizes))[0]]))
    return own * units @ axes[:, order], 0.5 * math.log(first / second)


def first_order_changes(pair: PrincipalPair, finer: Generator, k: int) -> FloatArray:
    """What each function of a finer axis that the pair's lacks changes in Λ(p), to first order."""
    pencil, space, old = finer.at(pair.p), finer.space(pair.p), pair.space
    operator, new = pencil.shifted(pair.eigenvalue), space.axes[k].new_in(old.axes[k])
    right, left = (
        np.compress(new, space.table(image @ space.carry(each, old)), axis=k)
        for image, each in ((operator, pair.right), (operator.T, pair.left))
    )
    factors = factorised(operator.on(k, new), space.chain)
    found = left * factors.solve(right.ravel()).reshape(right.shape) / -(pair.left @ old.weighed(pair.right))
    return found.sum(axis=tuple(each for each in range(found.ndim) if each != k))


@dataclass(frozen=True, eq=False)
class DirectionStart(Start):
    """Directions of three or four variables.

    Attributes:
        before: solutions on coarser spaces.
    """

    before: tuple[Solution, ...] = ()

    @property
    def generator(self) -> Generator:
        """L(p) on the space."""
        return Generator(self.problem, self.space)

    @staticmethod
    def directions(problem: Problem) -> DirectionAxis:
        """The coarsest functions of directions."""
        raise NotImplementedError

    def solved(self, p: float, near: PrincipalPair | None) -> PrincipalPair:
        """The pair, from that of coarser functions, or from p to p."""
        generator = self.generator
        pair = near or principal_pair(generator, 0.0)
        steps = max(math.ceil(abs(p - pair.p) / LARGEST_STEP), 1)
        for point in np.linspace(pair.p, p, steps + 1)[1:].tolist():
            pair = principal_pair(generator, point, start=pair)
        rounding = 2 * self.problem.dimension * sys.float_info.epsilon * abs(p) * framed(self.problem).unit_rate
        return replace(pair, rounding=pair.rounding + rounding)  # an entry of S⁻¹AS is a sum of products twice

    def lacking(self, pair: PrincipalPair, k: int, finer: FunctionAxis) -> float:
        """What is left without them, by the sizes of these changes, as their sum may be small by chance."""
        if finer.size == self.space.axes[k].size:  # there are no more
            return math.inf
        changes = first_order_changes(pair, Generator(self.problem, self.space.with_axis(k, finer)), k)
        return MEASURED * float(np.sum(np.abs(changes)))

    def errors_of_axes(self, pair: PrincipalPair, allowed: float) -> tuple[float, ...]:
        """Of the elements and of each noise: the effects of the highest modes, or what is lacking if that is less.

        Effects are too large where T* has layers that T, and so Λ(p), knows nothing of. An odd number of further
        polynomials in ξ has one about ξ = 0, where T = 1 nearly is an eigenfunction of those alone.
        """
        errors = [each.error if each else 0.0 for each in mode_effects(pair)]
        if sum(errors) <= 0.5 * allowed:
            return tuple(errors)
        pairs = enumerate(zip(self.space.axes, errors, strict=True))
        return tuple(
            min(error, self.lacking(pair, k, axis.raised())) if error > SHARE * allowed else error
            for k, (axis, error) in pairs
        )

    def finer(self, phi: DirectionAxis, solution: Solution, share: float) -> Space:
        """That with some functions of directions, and more of each noise that lacks more than a share."""
        noises, errors = list(self.space.noises), solution.measured[1:]
        for k, (axis, effects, error) in enumerate(zip(noises, solution.effects[1:], errors, strict=True)):
            if effects is not None and error > share:
                noises[k] = axis.enriched() if error < effects.error else axis.refined(effects, share)
        found = Space((phi, *noises))
        return found if found.size > self.space.size else self.space.finer


@dataclass(frozen=True, eq=False)
class SphereStart(DirectionStart):
    """Those without a stop; `before` are solutions that have the same but waves of lower degrees.

    Attributes:
        generators: L(p) with the same elements, by the degree of the waves.
    """

    generators: dict[int, Generator] = field(default_factory=dict)

    @staticmethod
    def directions(problem: Problem) -> SphereAxis:
        coordinates, place = modal_coordinates(problem)
        lines = np.linspace(0, math.pi / 2, 3)
        if abs(place) > math.log(1 / WEAK):
            high = abs(place) + 1
            inner = np.linspace(-high, high, max(2, round(2 * high / GRADED_STEP)) + 1)
            lines = np.concatenate([[0.0], np.arctan(np.exp(inner)), [math.pi / 2]])
        return SphereAxis(coordinates, lines, FIRST_DEGREE, FIRST_WAVES)

    @property
    def generator(self) -> Generator:
        waves = self.space.phi.waves
        if waves not in self.generators:
            self.generators[waves] = Generator(self.problem, self.space)
        return self.generators[waves]

    def again(self) -> SphereStart:
        """The functions with which another p begins."""
        return self.of_waves(FIRST_WAVES)

    def of_waves(self, waves: int, before: tuple[Solution, ...] = ()) -> SphereStart:
        """That with waves up to another degree, after solutions with those of lower ones."""
        space = self.space.with_axis(0, replace(self.space.phi, waves=max(waves, FIRST_WAVES)))
        return replace(self, space=space, before=before)

    def judged(self, pair: PrincipalPair, allowed: float) -> Solution:
        """The pair, corrected by what the next waves change, with what is left then; first the other parts of it.

        What is left is `OF_CHANGES` times the last change of the corrected value and the correction, from two spaces:
        each is too small by chance.
        """
        of_axes, start = self.errors_of_axes(pair, allowed), replace(self, before=())
        if sum(of_axes) > 0.5 * allowed:
            return Solution(pair, math.inf, of_axes, start)
        changes = first_order_changes(pair, self.of_waves(self.space.phi.waves + 2).generator, 0)
        pair = replace(pair, correction=float(np.sum(changes)))
        change = pair.value - self.before[-1].pair.value if self.before else math.inf
        return Solution(pair, OF_CHANGES * (abs(change) + abs(pair.correction)), of_axes, start)

    def is_enough(self, found: Solution) -> bool:
        """Whether Λ′, which is not corrected, has settled, or after so many levels is what it is; λ is corrected."""
        change = abs(found.derivative - self.before[-1].derivative)
        is_settled = change <= SETTLED_SLOPE * abs(found.derivative) or len(self.before) >= MOST_FOR_SLOPES
        return is_settled or abs(found.pair.p) <= SMALL_P

    def doubled(self, failure: Exception | None) -> SphereStart:
        return self.of_waves(self.space.phi.waves + 2)

    def refined(self, solution: Solution, goal: float, most: int) -> SphereStart:
        """Waves of the next degree; or other elements and functions of the noise, with waves of the degree before."""
        of_axes, phi, share = solution.measured, self.space.phi, MINOR * goal
        if sum(of_axes) <= 0.5 * goal:
            return self.of_waves(phi.waves + 2, (solution,))
        found = self.finer(phi.finer(["degree"]) if of_axes[0] > share else phi, solution, share)
        return SphereStart(self.problem, found).of_waves(phi.waves - 2)


class Directions(Elements):
    """Λ(p) of three and four variables; of even p it is that of the equations of the moments, where these close."""

    stage: ClassVar[type[DirectionStart]] = SphereStart
    by_moments = True
    usual_rtol = RTOL_BEYOND_PLANE
    remedy = Remedy.MANY
    preferred_even = Elements.even

    def places(
        self, p: float, tolerance: Tolerance, found: Sequence[Solution]
    ) -> Iterator[tuple[Stage, PrincipalPair | None]]:
        """One: the coarsest functions, or some of the nearest p; where that is p itself, finer ones than before."""
        if known := self.spaces.get(p):
            yield known.start.refined(known, tolerance(p, known.value), 0), known.pair
        elif started := [each for each in self.spaces.values() if each.start]:
            nearest = min(started, key=lambda each: abs(each.pair.p - p))
            yield nearest.start.again(), nearest.pair
        else:
            digits, noises = -math.log10(self.settings.rtol), self.problem.valued.parts.values()
            axes = (self.stage.directions(self.problem), *(first_axis(noise, digits) for noise in noises))
            yield self.stage(self.problem, Space(axes)), None

    def is_dear(self, p: float) -> bool:
        return p <= 0 or p % 2 != 0
