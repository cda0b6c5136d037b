"""Λ(p) of systems of dimension 3 and 4: waves of ever higher degree on the sphere of directions, until Λ(p) settles.

The functions are those of directions in coordinates that the second moments choose. E‖x‖² grows with Λ(2), and
T = xᵀQx is its eigenfunction for p = 2: in the coordinates of the eigenvectors of Q the strong modes are one group and
the weak ones the other. Where the noise is weak against the difference of their dampings, T has a layer of the width
√(q_weak/q_strong) beside the weak ones, and T* one beside the strong ones, for which the elements are graded; where
both grow alike there is none, and harmonics of the sphere take the place of the elements.

Any search begins at p = 0, where T = 1, and goes from p to p on the coarsest space; on finer ones it begins with what
the coarser one has found. What two degrees of waves change tells their error, that of all else comes from the highest
modes, see `error`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.linalg

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoHierarchy, NotConverged
from fpsolve.exponent.adapt import SHARE, NearPlace, Search
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution, mode_effects
from fpsolve.fem.effects import ModeEffects
from fpsolve.fem.generator import Generator
from fpsolve.fem.harmonics import HarmonicAxis
from fpsolve.fem.noise_axes import CountedAxis
from fpsolve.fem.space import Space, first_axis
from fpsolve.fem.sphere import Coordinates, DirectionAxis, SphereAxis, group_dimensions
from fpsolve.model.problem import Problem
from fpsolve.theory.moments import even_moment, moment_form

FIRST_WAVES, FIRST_DEGREE = 2, 6
LARGEST_STEP = 1.0
"""Of p, from one pair to the next one on the coarsest space."""
ROUND = 0.6
"""Width of a layer from which on there is none to speak of, and harmonics of the sphere settle the soonest."""
WEAK, STEP = 0.2, 1.3
"""Width of a layer of T or T* for which elements are graded, and their size in ln tan η."""
THINNEST = 1e-3
"""The least width: of modes that nothing couples the layer has none."""
WORST_CONDITION = 100.0
"""Of the eigenvectors of the motion without noise, up to which they are the coordinates."""
BEYOND = (10.0, 1.5, 1.0)
"""What is left after the correction by a change, over this change, by how many spaces agree: one, two, and more."""
SETTLED_SLOPE, MOST_FOR_SLOPES = 3e-3, 4
"""Share of Λ′ by which it may change from one level to the next, and levels that may be added for it."""
LEFT = 0.5
"""The same, over what two degrees more changed in the corrected value, or will change in the other, see `left_of`."""
MEASURED = 3.0
"""What is left after elements or polynomials of the noise, over what two degrees more of them change."""


def second_moments(problem: Problem) -> tuple[float, FloatArray, FloatArray]:
    """Λ(2), Q of E‖x‖² and the second moments E xxᵀ, in the mean over the noise, in the coordinates of the motion.

    Both matrices are without a scale, and 1 where noise is too strong or slow for the equations of the moments.
    """
    unit = np.eye(problem.dimension)
    try:
        found = even_moment(problem, 2)
    except NoHierarchy:
        return math.nan, unit, unit
    q, moments = (moment_form(each, problem.dimension, 2) for each in (found.polynomial, found.moments))
    frame = unit if problem.frame is None else np.array(problem.frame.matrix)
    inverse = np.linalg.inv(frame)
    q, moments = frame.T @ q @ frame, inverse @ moments @ inverse.T
    return found.value, q * np.sign(np.trace(q)), moments * np.sign(np.trace(moments))


def modal_coordinates(problem: Problem) -> tuple[Coordinates, float, tuple[float, float]]:
    """S of y = S⁻¹x whose directions are solved for, the width of the layer of T, and where T and T* have theirs.

    Between the groups 1 and 2 of y these lie at ln tan η = ½ ln(q₁/q₂) and ½ ln(p₂/p₁), q and p the sizes of Q and of
    E yyᵀ on each: T is about (yᵀQy)^½p there, and T* a power of yᵀ(E yyᵀ)⁻¹y. Each mode of the motion without noise
    has a unit in which q = p before, so that y is the same, but for rotations, whatever the coordinates x are.
    """
    free = sum(
        problem.motion.epsilon**term.order * float(term.g(problem.named_noise(term.noise).mean)) * np.array(term.matrix)
        for term in problem.motion.terms
    )
    values, vectors = np.linalg.eig(free)
    modes = [
        np.column_stack([vector.real, vector.imag] if value.imag else [vector.real])
        for value, vector in zip(values, vectors.T, strict=True)
        if value.imag >= 0
    ]
    own = np.column_stack(modes)
    _, q, p = second_moments(problem)
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
    count = len(sizes) // 2
    if len(sizes) == 3 and sizes[0] * sizes[2] < sizes[1] ** 2:  # the weakest one is by itself
        axes = axes[:, [2, 0, 1]]
        width = math.sqrt(sizes[2] / sizes[1])
    else:
        width = math.sqrt(sizes[count] / sizes[count - 1])
    found = own @ axes
    inverse, first = np.linalg.inv(found), group_dimensions(len(sizes))[0]
    places = []
    for form, sign in ((found.T @ q @ found, 0.5), (inverse @ p @ inverse.T, -0.5)):
        one_group, other = (np.mean(each) for each in np.split(np.maximum(np.diagonal(form), 0.0), [first]))
        share = one_group / max(other, 1e-300)
        places.append(sign * math.log(min(max(share, THINNEST**2), THINNEST**-2)))
    return tuple(map(tuple, found.tolist())), max(width, THINNEST), (places[0], places[1])


def first_directions(problem: Problem) -> DirectionAxis:
    """The coarsest functions of directions."""
    coordinates, width, places = modal_coordinates(problem)
    if width >= ROUND:
        return HarmonicAxis(coordinates, FIRST_WAVES)
    lines = np.linspace(0, math.pi / 2, 3)
    if max(map(abs, places)) > math.log(1 / WEAK):
        low, high = min(places) - 1, max(places) + 1
        inner = np.linspace(low, high, max(2, round((high - low) / STEP)) + 1)
        lines = np.concatenate([[0.0], np.arctan(np.exp(inner)), [math.pi / 2]])
    return SphereAxis(coordinates, lines, FIRST_DEGREE, FIRST_WAVES)


def left_of(degrees: Sequence[int], values: Sequence[float]) -> float:
    """What higher degrees may still change, from how values changed from one even degree to the next.

    With A and B the sums of all changes from half the degree and from a quarter to half of it, A²/(B − A): exact where
    the changes fall as a power of the degree, as where T, or T*, is not smooth. Where each of the last three changes
    is a share of the one before, twice the rest of a geometric series with the largest of these shares, if that is
    less. Of two changes alone their ratio tells.
    """
    changes, m = np.abs(np.diff(values)), np.array(degrees[1:])
    halves = m > m[-1] / 2, (m > m[-1] / 4) & (m <= m[-1] / 2)
    if not np.any(halves[1]):
        halves = m == m[-1], m == m[-1] - 2
    if not np.any(halves[1]):
        return 0.0
    last, before = (float(np.sum(changes[each])) for each in halves)
    left = last * last / (before - last) if last < before else math.inf
    if len(changes) > 3 and (share := float(np.max(changes[-3:] / np.maximum(changes[-4:-1], 1e-300)))) < 1:
        left = min(left, 2 * float(changes[-1]) * share / (1 - share))
    return left


def first_order_change(pair: PrincipalPair, finer: Generator, axis: int, new: Any) -> float:
    """What the new functions of an axis of a finer space change in Λ(p), to first order."""
    pencil, space, old = finer.at(pair.p), finer.space(pair.p), pair.space
    operator = pencil.matrix.shifted(pair.eigenvalue)
    right, left = (
        np.compress(new, space.table(image @ space.carry(each, old)), axis=axis).ravel()
        for image, each in ((operator, pair.right), (operator.T, pair.left))
    )
    factors = pencil.on(axis, new).factorised(pair.eigenvalue)
    return float(-left @ factors.solve(right) / (pair.left @ old.weighed(pair.right)))


@dataclass(frozen=True, eq=False)
class SpherePlace(NearPlace):
    """Λ(p) of a system of dimension 3 or 4; arguments as in `NearPlace`."""

    _levels: list[Generator] = field(init=False, default_factory=list)
    _pairs: list[PrincipalPair] = field(init=False, default_factory=list)

    def may_reuse(self, chosen: Space, q: float, p: float) -> bool:
        """False: every p has waves of its own."""
        return False

    def coarsened(self, solution: Solution, tolerance: Any) -> Space:
        return solution.pair.generator.chosen

    def solve_places(self, search: Search, start: Solution | None) -> Solution:
        """From the coarsest space on."""
        if not self._levels:
            noises = (first_axis(noise, -math.log10(self.rtol)) for noise in self.problem.coloured.parts.values())
            self._begin(Space((first_directions(self.problem), *noises)))
        steps = list[PrincipalPair]()
        pair: PrincipalPair | None = None
        enough: Solution | None = None
        level, more = 0, MOST_FOR_SLOPES
        while True:
            chosen = self._chosen(level)
            try:
                search.check(chosen)
            except NotConverged:
                if enough is None:
                    raise
                return enough
            pair = search.attempt(partial(self._pair, level, search, pair))
            if pair is None:
                level, steps = level + 1, []
                continue
            allowed = search.tolerance(search.p, pair.value)
            effects = mode_effects(pair)
            errors = self._errors(pair, effects, allowed)
            if sum(errors) > 0.5 * allowed:
                self._begin(self._finer(chosen, effects, errors, allowed))
                level, steps = max(0, level - 1), []
                continue
            level += 1
            change = self._change(pair, level)
            pair = replace(pair, correction=change, rounding=pair.rounding + self._rounding(pair))
            steps.append(pair)
            left = BEYOND[min(len(steps), len(BEYOND)) - 1] * abs(change)
            if len(steps) > 1:
                waves = [each.space.phi.waves for each in steps]
                uncorrected = left_of(waves, [each.eigenvalue for each in steps])
                step, beyond = abs(pair.value - steps[-2].value), left_of(waves, [each.value for each in steps])
                left = max(left, beyond, LEFT * step, LEFT * uncorrected)
            if enough is not None:  # of Λ, not of Λ′
                left = min(left, enough.search + abs(pair.value - enough.pair.value))
            solution = Solution(pair, search=left, measured=sum(errors))
            if solution.error <= allowed:
                slopes, enough, more = [each.derivative for each in steps[-2:]], enough or solution, more - 1
                is_settled = len(slopes) > 1 and np.ptp(slopes) <= SETTLED_SLOPE * abs(slopes[-1])
                if is_settled or not more:
                    return solution
            search.note(solution, solution.error, allowed)

    def _rounding(self, pair: PrincipalPair) -> float:
        """Of the rates of growth: an entry of S⁻¹AS is a sum of products twice, which may cancel."""
        return 2 * self.problem.dimension * sys.float_info.epsilon * abs(pair.p) * pair.generator.unit_rate

    def _change(self, pair: PrincipalPair, level: int) -> float:
        """What the waves of the next level change in Λ(p), to first order."""
        generator = self._generator(level)
        return first_order_change(pair, generator, 0, generator.phi.degrees > pair.space.phi.waves)

    def _errors(self, pair: PrincipalPair, effects: Sequence[ModeEffects | None], allowed: float) -> list[float]:
        """Of the elements and of each noise: the effects of the highest modes, or the geometric mean of these and of
        what finer functions change, `MEASURED` of it at least.

        Effects are too large where T* has layers that T, and so Λ(p), knows nothing of.
        """
        errors, chosen = [each.error if each else 0.0 for each in effects], pair.generator.chosen
        if sum(errors) <= 0.5 * allowed:
            return errors
        for k, (axis, error) in enumerate(zip(chosen.axes, errors, strict=True)):
            if error <= SHARE * allowed:
                continue
            if k == 0:
                finer = replace(axis, degree=axis.degree + 2)
                new = (finer.cells >= 0) & (finer.modes > axis.degree)
            elif isinstance(axis, CountedAxis):
                finer = axis.enriched()
                new = np.arange(finer.size) >= axis.size
            else:
                continue
            change = first_order_change(pair, Generator(self.problem, chosen.with_axis(k, finer)), k, new)
            errors[k] = min(error, max(MEASURED * abs(change), math.sqrt(error * abs(change))))
        return errors

    def _begin(self, chosen: Space) -> None:
        """Other elements and functions of the noise, the waves from the coarsest on."""
        coarsest = chosen.with_axis(0, replace(chosen.phi, waves=FIRST_WAVES))
        self._levels[:] = [Generator(self.problem, coarsest)]

    def _chosen(self, level: int) -> Space:
        first = self._levels[0].chosen
        return first.with_axis(0, replace(first.phi, waves=first.phi.waves + 2 * level))

    def _finer(self, chosen: Space, effects: Sequence[Any], errors: Sequence[float], allowed: float) -> Space:
        share = SHARE * allowed
        noises = (
            axis if error <= share else axis.enriched() if error < each.error else axis.refined(each, share, False)
            for axis, each, error in zip(chosen.noises, effects[1:], errors[1:], strict=True)
        )
        found = Space((chosen.phi.finer_elements() if errors[0] > 0.1 * allowed else chosen.phi, *noises))
        return found if found.size > chosen.size else chosen.enriched()

    def _generator(self, level: int) -> Generator:
        while len(self._levels) <= level:
            self._levels.append(Generator(self.problem, self._chosen(len(self._levels))))
        return self._levels[level]

    def _pair(self, level: int, search: Search, coarse: PrincipalPair | None) -> PrincipalPair:
        """The pair at p on one level, from that on a coarser one, or from p to p since p = 0."""
        generator, p = self._generator(level), search.p
        if coarse is not None:
            return principal_pair(generator, p, start=coarse)
        near = [pair for pair in self._pairs if pair.generator is generator]
        if not near:
            near = [principal_pair(generator, 0.0)]
        closest = min(near, key=lambda pair: abs(pair.p - p)).p
        steps = math.ceil(abs(p - closest) / LARGEST_STEP)
        for k in range(1, steps + 1):
            sides = sorted(near, key=lambda pair: abs(pair.p - p))[:2]
            near.append(principal_pair(generator, closest + k / steps * (p - closest), start=sides))
        self._pairs[:] = near
        return min(near, key=lambda pair: abs(pair.p - p))
