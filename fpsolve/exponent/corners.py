"""Where T is singular: at a ray that stretches, for the ξ at which the phase turns there from forward to backward.

Near such a corner, φ = φ₀ and ξ = ξ₀, the ray is passed forward for the ξ on one side of ξ₀ and backward on the other,
and T is stretched the other way round there. It is no smooth function of φ and ξ, but one of (φ − φ₀)/(ξ − ξ₀)³ times
|ξ − ξ₀|^s, and so is T*. Of R^p the factor u between two passages, H. P. McKean, J. Math. Kyoto Univ. 2, 1963, has
E u^s = ½/sin(π(2s + 5)/6) = R^−p: s = ½ − (3/π) arcsin(R^p/2). What cells of the length h in ξ and h³ in φ do not see
there has the size |dφ/dt| T T* in a length h: Λ lacks about h^(2 + 2s), 2 + 2s = (6/π) arccos(R^p/2). So cells become
smaller towards the corner. No polynomials on the whole axis of ξ stand for that, nor for |dφ/dt| at the ray.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.fem.space import Discretisation
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import Diffusion
from fpsolve.model.plane import is_steady, turning_noise
from fpsolve.model.problem import Problem
from fpsolve.theory.frozen import frozen_noise

REACH = 8.0
"""Standard deviations around the tilted density that a mesh has."""
NEGLIGIBLE = 40.0
"""Fall of the logarithm of the tilted density, from its centre on, beyond which a corner does not count."""
WIDTH = 2.0
"""Of cells away from corners, in standard deviations."""
RATIO, CUBED = 0.5, 0.125
"""Of cells towards a corner, in ξ and in φ."""
UNGRADED, MOST_LEVELS = 1e-3, 8
"""Error of Λ(p) over (R^p − 1)² and its scale, where cells have one size; how often cells may get smaller."""
DEGREE = 6
SAFETY = 2.0
"""Of what is thought to be left in cells with a corner: without it some errors are 1.2 times their estimate."""
NEAR = 1e-9
"""Lines closer than that are one."""


@dataclass(frozen=True)
class Corner:
    """A place where T is singular.

    Attributes:
        phase: φ of the ray.
        z: the noise, in standard deviations.
        factor: R^p.
        share: |p|, or 1 for larger ones, as Λ(p) is about p times a rate.
    """

    phase: float
    z: float
    factor: float
    share: float

    @property
    def order(self) -> float:
        """By which power of the length of cells in ξ the error of Λ falls; by a third of it in φ."""
        return 6 / math.pi * math.acos(min(0.5 * self.factor, 1.0))

    def levels(self, rtol: float) -> int:
        """How often cells should get smaller towards it."""
        needed = math.log2(max(UNGRADED * (self.factor - 1) ** 2 / (rtol * self.share), 2.0))
        return math.ceil(min(needed / max(self.order, 1e-3), MOST_LEVELS))


def corners(problem: Problem, p: float, center: float | None = None) -> list[Corner]:
    """Those that matter for a p; a chain has none, as its states are apart.

    Args:
        center: about the mean z of the tilted density; None for that where slow noise carries the moment.
    """
    noise, system = problem.noise, problem.system
    kicks = [kick for kick in system.kicks if kick.log_factor and not is_steady(system, kick)]
    if not kicks or isinstance(noise, MarkovChain) or (frozen := frozen_noise(problem)) is None:
        return []
    center = frozen.center(p) if center is None else center
    unit, ends = noise.standard_deviation, _interval(noise, center)
    found = [
        Corner(kick.phase, float(xi) / unit, math.exp(p * kick.log_factor), min(abs(p), 1.0))
        for kick in kicks
        for xi in turning_noise(system, kick, unit * ends)
    ]
    places = np.array([center, *(corner.z for corner in found)])
    logs = noise.log_density(unit * places) + 2 * frozen.tilt(center) * places
    return [corner for corner, log in zip(found, logs[1:], strict=True) if log > logs[0] - NEGLIGIBLE]


def resolving(
    found: Sequence[Corner], chosen: Discretisation, noise: Diffusion, center: float, rtol: float
) -> Discretisation:
    """Cells instead of polynomials, smaller towards the corners."""
    levels = max(corner.levels(rtol) for corner in found)
    lower, upper = _interval(noise, center)
    even = np.linspace(lower, upper, math.ceil((upper - lower) / WIDTH) + 1)
    places = np.array([corner.z for corner in found])
    z_lines = _graded(_with(chosen.z_lines if chosen.z_lines.size else even, places), places, RATIO, levels)
    phi_lines = _graded(chosen.phi_lines, _rays(found, chosen.phi_lines), CUBED, levels)
    degrees = np.full(phi_lines.size - 1, min(DEGREE, int(np.max(chosen.phi_degrees))))
    return replace(
        chosen, phi_lines=phi_lines, phi_degrees=degrees, polynomials=0, slope=0.0, z_lines=z_lines, xi_degree=DEGREE
    )


def slow_shares(found: Sequence[Corner], chosen: Discretisation, degrees: tuple[Any, Any]) -> tuple[Any, Any]:
    """For each cell of φ, and of ξ, what error is left over the effect of its two highest modes, where it has a corner.

    With the degree d an error that falls by h^order falls by d^(−2 order).

    Args:
        degrees: of the cells of φ, and of ξ, two arrays.
    """
    z = np.array([corner.z for corner in found])
    return (
        _slow(chosen.phi_lines, _rays(found, chosen.phi_lines), degrees[0], min(corner.order for corner in found) / 3),
        _slow(chosen.z_lines, z, degrees[1], min(corner.order for corner in found)),
    )


def _slow(lines: FloatArray, places: FloatArray, degrees: Any, order: float) -> FloatArray:
    is_place = np.min(np.abs(lines[:, None] - places), axis=1) < NEAR
    d = np.maximum(degrees, 3.0)
    return np.where(is_place[:-1] | is_place[1:], SAFETY / np.expm1(2 * max(order, 1e-3) * np.log(d / (d - 2))), 0.0)


def _rays(found: Sequence[Corner], lines: FloatArray) -> FloatArray:
    """φ of corners, among lines over π or 2π."""
    phases = np.array([corner.phase for corner in found])
    turns = np.arange(
        math.floor((lines[0] - phases.max()) / math.pi), math.ceil((lines[-1] - phases.min()) / math.pi) + 1
    )
    rays = (phases + math.pi * turns[:, None]).ravel()
    return rays[(rays > lines[0] - NEAR) & (rays < lines[-1] + NEAR)]


def _interval(noise: Diffusion, center: float) -> FloatArray:
    """z on which a mesh for a tilted density is made, and where it is 0 without a tilt."""
    end = noise.half_width / noise.standard_deviation
    lower, upper = min(center, 0.0) - REACH, max(center, 0.0) + REACH
    return np.array([-end if -end > lower - WIDTH else lower, end if end < upper + WIDTH else upper])


def _with(lines: FloatArray, places: FloatArray) -> FloatArray:
    """Lines with some more, instead of those close to them."""
    far = np.min(np.abs(lines[1:-1, None] - places), axis=1) > 0.3 * np.min(np.diff(lines))
    return np.unique(np.concatenate([lines[:1], lines[1:-1][far], lines[-1:], places]))


def _graded(lines: FloatArray, places: FloatArray, ratio: float, levels: int) -> FloatArray:
    """Lines, and more between each place, which is one of them, and its neighbours, by a ratio nearer to it."""
    is_place = np.min(np.abs(lines[:, None] - places), axis=1) < NEAR
    found, shares = [lines], ratio ** np.arange(1, levels + 1)
    for a, b, left, right in zip(lines[:-1], lines[1:], is_place[:-1], is_place[1:], strict=True):
        width = 0.5 * (b - a) if left and right else b - a
        if left:
            found.append(a + width * np.append(shares, 1.0))
        if right:
            found.append(b - width * shares)
    return np.unique(np.concatenate(found))
