"""Where a moment of two variables may be carried: the stages at each of the places, see `method.Search`.

Λ(p) is the largest over these places. A place has a first space, small, for the values of the noise that carry the
moment there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fpsolve.errors import NotConverged
from fpsolve.exponent.eigen import BACKWARD_ERROR_LIMIT, PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution, mode_effects
from fpsolve.exponent.method import Stage
from fpsolve.fem.axis import MOST_DEGREE
from fpsolve.fem.generator import Generator
from fpsolve.fem.noise_axes import CellAxis, NoiseAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space, first_axis
from fpsolve.model.coordinates import framed
from fpsolve.model.plane import LinearMotion, Xi
from fpsolve.model.problem import Problem
from fpsolve.theory.frozen import frozen_noise, steady_places, swing

REACH = 12.0
"""Standard deviations on both sides, up to which the first cells of noise with algebraic tails are."""
SHARE = 0.1
"""Share of the tolerance that a new discretisation is made for in each direction, so that it serves other p too."""
ROUND = 360
"""Number of φ at which it is asked which way the phase turns."""
COMPARABLE = 0.6
"""Paths that hold the noise elsewhere are looked at if they grow at this share of Λ (less by the rest, for Λ < 0)."""


@dataclass(frozen=True, eq=False)
class Start(Stage):
    """A `Stage` at a place of two variables, by the functions that Λ(p) is sought among.

    Attributes:
        problem: a motion and its noise.
        space: the functions.
    """

    problem: Problem
    space: Space

    @property
    def size(self) -> int:
        return self.space.size

    @property
    def most_unknowns(self) -> int:
        return self.space.most_unknowns

    def solved(self, p: float, near: Any) -> PrincipalPair:
        """The principal pair on the space, from that of a space before, or pairs of other p. As `principal_pair`."""
        pairs = near if isinstance(near, Sequence) else [near] if near else []
        known = (pair.generator for pair in pairs if pair.generator.chosen is self.space)
        return principal_pair(next(known, None) or Generator(self.problem, self.space), p, start=pairs)

    def judged(self, pair: PrincipalPair, allowed: float) -> Solution:
        """The pair with its error by its highest modes."""
        return Solution(pair)

    def doubled(self, failure: Exception | None) -> Start | None:
        """More functions along the axes that lack most, by the pair that a failed search has reached, if any."""
        pair: Any = failure.partial if isinstance(failure, NotConverged) else None
        is_near = pair is not None and pair.residual <= BACKWARD_ERROR_LIMIT
        found = self.space.doubled(mode_effects(pair) if is_near else ())
        return replace(self, space=found) if found.size > self.space.size else None

    def refined(self, solution: Solution, goal: float, most: int) -> Start:
        """More functions where those of a solution lack more than their share of an error, fewer where less."""
        share = SHARE * goal
        found = self.space.refined(solution.effects, share)
        if found.xi.lines.size:
            lower, upper = solution.truncation
            found = found.with_axis(1, found.xi.reaching(lower > share, upper > share))
        return replace(self, space=found if found.size > self.space.size else found.raised())


def first(problem: Problem, p: float, rtol: float, center: float | None = None) -> Space:
    """A first discretisation, small, for a tilted density around some z; None for where slow noise carries it."""
    noise, digits = problem.valued, -math.log10(rtol)
    if len(noise.parts) == 1 and (of_kind := AXES.get(noise.basis)):
        axis, xi = of_kind(problem, p, digits, center)
        axes = [axis]
    else:
        axes, xi = [first_axis(each, digits) for each in noise.parts.values()], problem.valued.extremes
    is_smooth = sum(axis.dimension for axis in axes) > 1
    return Space((_phase(framed(problem).motion, xi, digits, is_smooth), *axes))


def turns_back(problem: Problem) -> bool:
    """Whether noise turns the phase back."""
    return _swing(framed(problem).motion, problem.valued.extremes) > 1


def _swing(system: LinearMotion, xi: Xi) -> float:
    """The largest change of the phase speed over its mean, for some ξ."""
    speed = system.phase_speed(xi)
    return float(np.max(speed.amplitude / np.maximum(np.abs(speed.mean), 1e-300)))


def _of_tails(problem: Problem, p: float, digits: float, center: float | None) -> tuple[NoiseAxis, Xi]:
    """Cells around ξ = 0, their lines on both sides, further apart further out."""
    noise, steps = problem.valued, np.concatenate([[0.0], 3.0 * 1.5 ** np.arange(60)])
    side = np.append(steps[steps < 0.8 * REACH], REACH)
    lines = np.concatenate([-side[:0:-1], side])
    axis = CellAxis(noise, lines, np.full(lines.size - 1, round(2 + digits / 2)))
    return axis, noise.standard_deviation * np.array([-2.0, 2.0])


def _of_filter(problem: Problem, p: float, digits: float, center: float | None) -> tuple[NoiseAxis, Xi]:
    """With the tilt of the force that holds the noise at z."""
    noise = problem.valued
    center = float(steady_places(problem, p)[0][0]) if center is None else center
    pull = noise.standard_deviation**2 * center / noise.spectral_density(0.0) if center else 0.0
    return replace(first_axis(noise, digits), slope=pull / p), problem.valued.extremes  # type: ignore[call-arg]


def _of_diffusion(problem: Problem, p: float, digits: float, center: float | None) -> tuple[NoiseAxis, Xi]:
    """Polynomials with the tilt that has its peak at z."""
    noise = problem.valued
    frozen: Any = frozen_noise(problem)
    unit, end = noise.standard_deviation, noise.half_width / noise.standard_deviation
    center = frozen.center(p) if center is None else center
    slope = frozen.tilt(center) / p if noise.may_tilt else 0.0
    axis: Any = first_axis(noise, digits)
    return replace(axis, slope=slope), unit * np.clip(center + np.array([-2.0, 2.0]), -end, end)


AXES = {"cells": _of_tails, "pairs": _of_filter, "polynomials": _of_diffusion}
"""The first functions of one noise by its `basis`, and ξ about which the phase is looked at; of others any will do."""


def _phase(system: LinearMotion, xi: Xi, digits: float, is_smooth: bool) -> PhaseAxis:
    """Equal cells on a half circle from one jump to where it comes again, and a line at every other jump.

    There are more where the speed of the phase changes much for some of the ξ; but one, of a higher degree, where
    several numbers move it, which leave T smoother, and each function of φ is a thousand unknowns.
    """
    widest = _swing(system, xi)
    cells = 1 if is_smooth else 8 if widest > 1 else 4 if widest > 0.5 else 2
    rays = [jump.phase for jump in system.jumps] or [math.pi / 2]
    lines = rays[0] + np.linspace(0, math.pi, cells + 1)
    others = rays[0] + np.mod(np.array(rays[1:]) - rays[0], math.pi)
    near = np.min(np.abs(lines[1:-1, None] - others), axis=1, initial=math.inf) < 0.3 * math.pi / cells
    lines = np.sort(np.concatenate([lines[:1], lines[1:-1][~near], lines[-1:], others]))
    degree = round(np.clip(digits + (4 if is_smooth else -2 if widest > 0.5 else 2), 4, MOST_DEGREE))
    return PhaseAxis(lines, np.full(lines.size - 1, degree))


def other_centers(pair: PrincipalPair) -> list[float]:
    """Other z, far from the tilted density of a pair, where paths that hold the noise grow about as fast.

    It is 0 where they do on which the noise of a filter swings far to both sides. Between two such places slow noise
    hardly ever passes: each has its own pair with T > 0 as far as that can be told, and only the larger eigenvalue is
    Λ.
    """
    noise = pair.generator.problem.valued
    others = OTHERS.get(noise.basis) if len(noise.parts) == 1 else None
    return others(pair, pair.value - (1 - COMPARABLE) * abs(pair.value)) if others else []


def _of_filters(pair: PrincipalPair, least: float) -> list[float]:
    problem, center = pair.generator.problem, pair.space.xi.center
    z, rate = steady_places(problem, pair.p)
    found = z[(np.abs(z - center) > 5) & (rate > least)][:1].tolist()
    if center:
        amplitude, swinging = swing(problem, pair.p)
        found += [0.0] * (amplitude > 5 and swinging > least)
    return found


def _of_diffusions(pair: PrincipalPair, least: float) -> list[float]:
    frozen: Any = frozen_noise(pair.generator.problem)
    z, rate = frozen.peaks(pair.p)
    if z.size < 2:
        return []
    measure, right, left = pair.space.on_grid(pair.right, pair.left)
    points, weights = pair.space.xi.rule.points, (measure * right * left).sum(axis=0)
    mean = np.average(points, weights=weights)
    width = math.sqrt(abs(np.average((points - mean) ** 2, weights=weights)))
    far = (np.abs(z - mean) > 3 * width + 2) & (rate > least)
    return [float(z[far][np.argmax(rate[far])])] if np.any(far) else []


OTHERS = {"pairs": _of_filters, "polynomials": _of_diffusions}
"""`other_centers` of one noise by its `basis`, that grow at a least rate; of others there are none."""


def has_cones(problem: Problem) -> bool:
    """Whether the phase never enters some set, nor leaves another one: it passes some φ forward only, others back.

    Bounded noise that hardly moves the two modes of a saddle does this: the sets are around the slower one, and the
    faster one. Told for one noise.
    """
    noise = problem.noise
    if not noise.is_bounded or len(noise.parts) > 1 or noise.is_white:
        return False
    phi = np.linspace(0, math.pi, ROUND, endpoint=False)
    turns = framed(problem).motion.phase_speed(noise.reached)(phi[:, None])
    return bool(np.any(np.all(turns > 0, axis=1)) and np.any(np.all(turns < 0, axis=1)))
