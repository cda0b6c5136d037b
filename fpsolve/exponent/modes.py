"""Λ(p) of systems of dimension 3 and 4: waves of ever higher degree on the sphere of directions, until Λ(p) settles.

The functions are those of directions in coordinates that the second moments choose. E‖x‖² grows with Λ(2), and
T = xᵀQx is its eigenfunction for p = 2: in the coordinates of the eigenvectors of Q the strong modes are one group and
the weak ones the other. Where the noise is weak against the difference of their dampings, T has a layer of the width
√(q_weak/q_strong) beside the weak ones, and T* one beside the strong ones, for which the elements are graded.

Any search begins at p = 0, where T = 1, and goes from p to p on the coarsest space; on finer ones it begins with what
the coarser one has found. What two degrees of waves change tells their error, that of all else comes from the highest
modes, see `error`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoHierarchy
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution, ladders, mode_effects
from fpsolve.exponent.moments import even_moment, mean_rates
from fpsolve.exponent.powers import moment_form
from fpsolve.exponent.starts import SHARE, Start
from fpsolve.fem.generator import SMALL_P, Generator
from fpsolve.fem.noise_axes import CountedAxis
from fpsolve.fem.space import Space, first_axis
from fpsolve.fem.sphere import Coordinates, SphereAxis, group_dimensions
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
"""Number of levels that may be added for Λ′."""
MINOR = 0.25
"""Share of the tolerance that elements, or polynomials of a noise, may lack where others are made finer."""
MEASURED = 3.0
"""What is left after elements or polynomials of the noise, over what two degrees more of them change."""


def second_moments(problem: Problem) -> tuple[float, FloatArray, FloatArray]:
    """Λ(2), Q of E‖x‖² and the second moments E xxᵀ, in the mean over the noise.

    Both matrices are without a scale, and 1 where noise is too strong or slow for the equations of the moments.
    """
    unit = np.eye(problem.dimension)
    try:
        found = even_moment(problem, 2)
    except NoHierarchy:
        return math.nan, unit, unit
    q, moments = (moment_form(each, problem.dimension, 2) for each in (found.polynomial, found.moments))
    return found.value, q * np.sign(np.trace(q)), moments * np.sign(np.trace(moments))


def modal_coordinates(problem: Problem) -> tuple[Coordinates, tuple[float, float]]:
    """S of y = S⁻¹x whose directions are solved for, and where T and T* have their layers.

    Between the groups 1 and 2 of y these lie at ln tan η = ½ ln(q₁/q₂) and ½ ln(p₂/p₁), q and p the sizes of Q and of
    E yyᵀ on each: T is about (yᵀQy)^½p there, and T* a power of yᵀ(E yyᵀ)⁻¹y. Each mode of the motion without noise
    has a unit in which q = p before, so that y is the same, but for rotations, whatever the coordinates x are.
    """
    free = mean_rates(problem)
    values, vectors = np.linalg.eig(free)
    modes = [
        np.column_stack([vector.real, vector.imag] if value.imag else [vector.real])
        for value, vector in zip(values, vectors.T, strict=True)
        if value.imag >= 0
    ]
    own = np.column_stack(modes)
    _, q, p = second_moments(problem)
    frame = np.eye(len(q)) if problem.frame is None else np.array(problem.frame.matrix)
    inverse = np.linalg.inv(frame)
    q, p = frame.T @ q @ frame, inverse @ p @ inverse.T
    if np.linalg.cond(own) < WORST_CONDITION:
        rows = np.split(np.linalg.inv(own), np.cumsum([each.shape[1] for each in modes])[:-1])
        moments = [
            (np.trace(back @ p @ back.T), np.trace(mode.T @ q @ mode)) for back, mode in zip(rows, modes, strict=True)
        ]
        of_p, of_q = (np.maximum(each, THINNEST**2 * np.sum(each)) for each in np.transpose(moments))
        own = np.column_stack([unit * mode for unit, mode in zip((of_p / of_q) ** 0.25, modes, strict=True)])
    else:
        _, own = scipy.linalg.matrix_balance(free, permute=False)
    sizes, axes = np.linalg.eigh(own.T @ q @ own)
    sizes, axes = np.maximum(sizes[::-1], 1e-300), axes[:, ::-1]
    if len(sizes) == 3 and sizes[0] * sizes[2] < sizes[1] ** 2:  # the weakest one is by itself
        axes = axes[:, [2, 0, 1]]
    found = own @ axes
    inverse, first = np.linalg.inv(found), group_dimensions(len(sizes))[0]
    places = []
    for form, sign in ((found.T @ q @ found, 0.5), (inverse @ p @ inverse.T, -0.5)):
        one_group, other = (np.mean(each) for each in np.split(np.maximum(np.diagonal(form), 0.0), [first]))
        share = one_group / max(other, 1e-300)
        places.append(sign * math.log(min(max(share, THINNEST**2), THINNEST**-2)))
    return tuple(map(tuple, found.tolist())), (places[0], places[1])


def first_directions(problem: Problem) -> SphereAxis:
    """The coarsest functions of directions."""
    coordinates, places = modal_coordinates(problem)
    lines = np.linspace(0, math.pi / 2, 3)
    if max(map(abs, places)) > math.log(1 / WEAK):
        low, high = min(places) - 1, max(places) + 1
        inner = np.linspace(low, high, max(2, round((high - low) / GRADED_STEP)) + 1)
        lines = np.concatenate([[0.0], np.arctan(np.exp(inner)), [math.pi / 2]])
    return SphereAxis(coordinates, lines, FIRST_DEGREE, FIRST_WAVES)


def first_order_changes(pair: PrincipalPair, finer: Generator, axis: int, new: Any) -> FloatArray:
    """What each new function of an axis of a finer space changes in Λ(p), to first order, in a table by all axes."""
    pencil, space, old = finer.at(pair.p), finer.space(pair.p), pair.space
    operator = pencil.matrix.shifted(pair.eigenvalue)
    right, left = (
        np.compress(new, space.table(image @ space.carry(each, old)), axis=axis).ravel()
        for image, each in ((operator, pair.right), (operator.T, pair.left))
    )
    factors = pencil.on(axis, new).factorised(pair.eigenvalue)
    found = -left * factors.solve(right) / (pair.left @ old.weighed(pair.right))
    return np.reshape(found, [-1 if k == axis else size for k, size in enumerate(space.shape)])


@dataclass(frozen=True, eq=False)
class SphereStart(Start):
    """Directions of three or four variables, by elements and waves of a degree.

    Attributes:
        before: solutions with the same elements and functions of the noise, but waves of lower degrees.
        enough: the first solution within the tolerance.
        generators: L(p) with the same elements, by the degree of the waves.
        pairs: those at other p with the waves of the lowest degree.
    """

    before: tuple[Solution, ...] = ()
    enough: Solution | None = None
    generators: dict[int, Generator] = field(default_factory=dict)
    pairs: list[PrincipalPair] = field(default_factory=list)

    @property
    def generator(self) -> Generator:
        waves = self.space.phi.waves
        if waves not in self.generators:
            self.generators[waves] = Generator(self.problem, self.space)
        return self.generators[waves]

    def _with(self, more: int, **changes: Any) -> SphereStart:
        """That with waves of higher degrees."""
        waves = max(self.space.phi.waves + more, FIRST_WAVES)
        return replace(self, space=self.space.with_axis(0, replace(self.space.phi, waves=waves)), **changes)

    def solved(self, p: float, near: PrincipalPair | None) -> PrincipalPair:
        """The pair, from that of waves of a lower degree, or from p to p since p = 0."""
        generator = self.generator
        if near is not None:
            near.generator.forget()
            return principal_pair(generator, p, start=near)
        known = [pair for pair in self.pairs if pair.generator is generator] or [principal_pair(generator, 0.0)]
        closest = min(known, key=lambda pair: abs(pair.p - p)).p
        steps = math.ceil(abs(p - closest) / LARGEST_STEP)
        for k in range(1, steps + 1):
            sides = sorted(known, key=lambda pair: abs(pair.p - p))[:2]
            known.append(principal_pair(generator, closest + k / steps * (p - closest), start=sides))
        self.pairs[:] = known
        return min(known, key=lambda pair: abs(pair.p - p))

    def judged(self, pair: PrincipalPair, allowed: float) -> Solution:
        """The pair, corrected by what the next waves change, with what is left then; first the other parts of it.

        What is left is `OF_CHANGES` times the last change of the corrected value and the correction, from two spaces:
        each is too small by chance.
        """
        of_axes, start = self._of_axes(pair, allowed), replace(self, before=(), enough=None)
        if sum(of_axes) > 0.5 * allowed:
            return Solution(pair, math.inf, of_axes, start)
        pair = replace(pair, correction=self.change(pair), rounding=pair.rounding + self._rounding(pair))
        change = pair.value - self.before[-1].pair.value if self.before else math.inf
        left = OF_CHANGES * (abs(change) + abs(pair.correction))
        if self.enough is not None:  # of Λ, not of Λ′
            left = min(left, self.enough.search + abs(pair.value - self.enough.pair.value))
        return Solution(pair, left, of_axes, start)

    def is_enough(self, solution: Solution) -> bool:
        """Whether Λ′, which is not corrected, has settled, or as many waves as may be were added; λ is corrected."""
        if abs(solution.pair.p) <= SMALL_P:
            return True
        slopes = [each.pair.derivative for each in (*self.before, solution)][-2:]
        is_settled = len(slopes) > 1 and float(np.ptp(slopes)) <= SETTLED_SLOPE * abs(slopes[-1])
        first = self.enough.pair.space.phi.waves if self.enough else self.space.phi.waves
        return is_settled or self.space.phi.waves >= first + 2 * (MOST_FOR_SLOPES - 1)

    def doubled(self, failure: Exception | None) -> SphereStart:
        return self._with(2, before=())

    def refined(self, solution: Solution, goal: float, stages: int, most: int) -> SphereStart:
        """Waves of the next degree; or other elements and functions of the noise, with waves of the degree before."""
        of_axes = solution.measured or ()
        if sum(of_axes) <= 0.5 * goal:
            enough = self.enough or (solution if solution.error <= goal else None)
            return self._with(2, before=(*self.before, solution), enough=enough)
        phi, noises = self.space.phi, self._finer_noises(solution, of_axes[1:], MINOR * goal)
        found = Space((phi.finer_elements() if of_axes[0] > MINOR * goal else phi, *noises))
        found = found if found.size > self.space.size else self.space.enriched()
        self.generators.clear()
        self.pairs.clear()
        return SphereStart(self.problem, found, enough=self.enough)._with(phi.waves - 2 - found.phi.waves)

    def _finer_noises(self, solution: Solution, errors: Sequence[float], share: float) -> list[Any]:
        """The axes of the noises, finer where these errors of them exceed a share."""
        noises = list(self.space.noises)
        for k, (axis, effects, error) in enumerate(zip(noises, solution.effects[1:], errors, strict=True)):
            if effects is not None and error > share:
                noises[k] = axis.enriched() if error < effects.error else axis.refined(effects, share, False)
        return noises

    def change(self, pair: PrincipalPair) -> float:
        """What waves of the next degree change in Λ(p), to first order."""
        finer = self._with(2).generator
        return float(np.sum(first_order_changes(pair, finer, 0, finer.phi.degrees > pair.space.phi.waves)))

    def _rounding(self, pair: PrincipalPair) -> float:
        """Of the rates of growth: an entry of S⁻¹AS is a sum of products twice, which may cancel."""
        return 2 * self.problem.dimension * sys.float_info.epsilon * abs(pair.p) * pair.generator.problem.unit_rate

    def _of_axes(self, pair: PrincipalPair, allowed: float) -> tuple[float, ...]:
        """Of the elements and of each noise: the effects of the highest modes, or `MEASURED` of what two degrees more
        change, or the geometric mean of that and of the sum over all functions of directions, whichever is larger.

        Effects are too large where T* has layers that T, and so Λ(p), knows nothing of. An odd number of further
        polynomials in ξ has one about ξ = 0, where T = 1 nearly is an eigenfunction of those alone.
        """
        errors = [each.error if each else 0.0 for each in mode_effects(pair)]
        if sum(errors) <= 0.5 * allowed:
            return tuple(errors)
        for k, (axis, error) in enumerate(zip(self.space.axes, errors, strict=True)):
            if error <= SHARE * allowed:
                continue
            if k and not isinstance(axis, CountedAxis):
                continue
            finer = self.space.with_axis(k, axis.raised() if k else replace(axis, degree=axis.degree + 2))
            ladder = list(ladders(finer))[k]
            assert ladder is not None
            changes = first_order_changes(pair, Generator(self.problem, finer), k, ladder.highest(2))
            of_each = changes.reshape(len(changes), -1).sum(axis=1)
            change, size = abs(float(np.sum(of_each))), float(np.sum(np.abs(of_each)))
            errors[k] = min(error, max(MEASURED * change, math.sqrt(size * change)))
        return tuple(errors)


def sphere_start(problem: Problem, p: float, rtol: float, known: Mapping[float, Solution]) -> SphereStart:
    """The coarsest waves, with the elements and functions of the noise of the nearest p if one is known."""
    for _, solution in sorted(known.items(), key=lambda each: abs(each[0] - p)):
        if isinstance(start := solution.start, SphereStart):
            return start._with(-start.space.phi.waves)
    noises = (first_axis(noise, -math.log10(rtol)) for noise in problem.coloured.parts.values())
    return SphereStart(problem, Space((first_directions(problem), *noises)))
