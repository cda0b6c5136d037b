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
from fpsolve.fem.discretisation import Cells, Discretisation, PhaseCells
from fpsolve.model.noise import Noise
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
UNGRADED = 1e-3
"""Error of Λ(p) over (R^p − 1)² and its scale, where cells have one size."""
FEWEST_LEVELS, MOST_LEVELS, MOST_MORE = 2, 8, 4
"""How often cells get smaller, first and then again."""
DEGREE = 6
SAFETY = 2.0
"""Of what is thought to be left in cells with a corner: without it some errors are 1.2 times their estimate."""
THINNEST = {RATIO: 1e-4, CUBED: 1e-8}
"""No cells get smaller than that: where lines of ξ are closer, rounding counts."""
NEAR, CLOSE = 1e-9, 1e-5
"""Within the first a line is a place, within the second two corners have one line of ξ."""
AT_END = 1e-4
"""From the end of the support: a corner closer by does not count, as next to no path comes there."""


@dataclass(frozen=True)
class Corner:
    """A place where T is singular.

    Attributes:
        phase: φ of the ray.
        z: the noise, in standard deviations.
        factor: R^p.
        scale: of Λ(p), which is about p times a rate: |p|, but not more than 1.
    """

    phase: float
    z: float
    factor: float
    scale: float

    @property
    def order(self) -> float:
        """By which power of the length of cells in ξ the error of Λ falls; by a third of it in φ."""
        return 6 / math.pi * math.acos(min(0.5 * self.factor, 1.0))

    def levels(self, rtol: float) -> int:
        """How often cells should get smaller towards it."""
        needed = math.log2(max(UNGRADED * (self.factor - 1) ** 2 / (rtol * self.scale), 2.0))
        return math.ceil(np.clip(needed / max(self.order, 1e-3), FEWEST_LEVELS, MOST_LEVELS))


def corners(problem: Problem, p: float, center: float | None = None) -> list[Corner]:
    """Those that matter for a p; a chain has none, as its states are apart.

    Args:
        center: about the mean z of the tilted density; None for that where slow noise carries the moment.
    """
    noise, system = problem.coloured, problem.motion
    jumps = [jump for jump in system.jumps if jump.log_factor and not is_steady(system, jump)]
    if not jumps or (frozen := frozen_noise(problem)) is None:
        return []
    center = frozen.center(p) if center is None else center
    unit, ends = noise.standard_deviation, _interval(noise, center)
    inside = noise.half_width / unit - AT_END
    found = [
        Corner(jump.phase, float(xi) / unit, math.exp(p * jump.log_factor), min(abs(p), 1.0))
        for jump in jumps
        for xi in turning_noise(system, jump, unit * np.clip(ends, -inside, inside))
    ]
    places = np.array([center, *(corner.z for corner in found)])
    logs = noise.log_density(unit * places) + 2 * frozen.tilt(center) * places
    return [corner for corner, log in zip(found, logs[1:], strict=True) if log > logs[0] - NEGLIGIBLE]


def resolving(
    found: Sequence[Corner], chosen: Discretisation, noise: Noise, center: float, rtol: float
) -> Discretisation:
    """Cells instead of polynomials, smaller towards the corners, down to the distance of one to the end of the support.

    Beyond the end P_s is singular, and between both the phase runs the other way.
    """
    lower, upper = _interval(noise, center)
    even = np.linspace(lower, upper, math.ceil((upper - lower) / WIDTH) + 1)
    lines, z = chosen.noise.lines if chosen.noise.lines.size else even, _z(found)
    far = np.min(np.abs(lines[1:-1, None] - z), axis=1) > 0.3 * np.min(np.diff(lines))
    lines = np.unique(np.concatenate([lines[:1], lines[1:-1][far], lines[-1:], z]))
    phase = replace(chosen.phase, degrees=np.minimum(DEGREE, chosen.phase.degrees))
    cells = Discretisation(phase, (Cells.of_degree(lines, DEGREE),))
    to_end = noise.half_width / noise.standard_deviation - np.max(np.abs(z))
    levels = max(math.ceil(math.log2(WIDTH / min(to_end, WIDTH))), *(corner.levels(rtol) for corner in found))
    return _graded(found, cells, levels, levels)


def graded_more(found: Sequence[Corner], chosen: Discretisation, excess: Sequence[float]) -> Discretisation:
    """With cells that get smaller so often more that errors at the corners fall by these factors, in φ and in ξ."""
    levels = [math.log2(max(each, 1.0)) / max(_order(found), 1e-3) for each in excess]
    return _graded(found, chosen, *(math.ceil(min(each, MOST_MORE)) for each in levels))


def slow_shares(found: Sequence[Corner], chosen: Discretisation, degrees: tuple[Any, Any]) -> tuple[Any, Any]:
    """For each cell of φ, and of ξ, what error is left over the effect of its two highest modes, where it has a corner.

    With the degree d an error that falls by h^order falls by d^(−2 order).

    Args:
        degrees: of the cells of φ, and of ξ, two arrays.
    """
    return (
        _slow(chosen.phase.lines, _rays(found, chosen.phase.lines), degrees[0], _order(found) / 3),
        _slow(chosen.noise.lines, _z(found), degrees[1], _order(found)),
    )


def left_on_mesh(found: Sequence[Corner], degree: int, finer: int) -> float:
    """The error on a given mesh over the difference from one of a higher degree, or of cells half as large."""
    if not found:
        return 1.0
    fall = 2 * math.log(finer / degree) if finer > degree else math.log(2)
    return 1 / -math.expm1(-max(_order(found), 1e-3) / 3 * fall)


def _slow(lines: FloatArray, places: FloatArray, degrees: Any, order: float) -> FloatArray:
    is_place, d = _are(lines, places), np.maximum(degrees, 3.0)
    return np.where(is_place[:-1] | is_place[1:], SAFETY / np.expm1(2 * max(order, 1e-3) * np.log(d / (d - 2))), 0.0)


def _order(found: Sequence[Corner]) -> float:
    """The least one."""
    return min(corner.order for corner in found)


def _z(found: Sequence[Corner]) -> FloatArray:
    """z of corners, one for all that are `CLOSE`: an error of the size `CLOSE`² is nothing."""
    z = np.sort([corner.z for corner in found])
    return z[np.append(True, np.diff(z) > CLOSE)]


def _rays(found: Sequence[Corner], lines: FloatArray) -> FloatArray:
    """φ of corners, among lines over π or 2π."""
    phases = np.array([corner.phase for corner in found])
    turns = np.arange(
        math.floor((lines[0] - phases.max()) / math.pi), math.ceil((lines[-1] - phases.min()) / math.pi) + 1
    )
    rays = (phases + math.pi * turns[:, None]).ravel()
    return rays[(rays > lines[0] - NEAR) & (rays < lines[-1] + NEAR)]


def _interval(noise: Noise, center: float) -> FloatArray:
    """The ends of the z around those of the tilted density and around 0, or of the support if it ends near by."""
    end = noise.half_width / noise.standard_deviation
    lower, upper = min(center, 0.0) - REACH, max(center, 0.0) + REACH
    return np.array([-end if -end > lower - WIDTH else lower, end if end < upper + WIDTH else upper])


def _are(lines: FloatArray, places: FloatArray) -> Any:
    """Which lines are places."""
    return np.min(np.abs(lines[:, None] - places), axis=1) < NEAR


def _graded(found: Sequence[Corner], chosen: Discretisation, in_phi: int, in_z: int) -> Discretisation:
    """With cells that get smaller so often towards the corners."""
    phase, part = chosen.phase, chosen.noise
    phi, phi_cells = _towards(phase.lines, _rays(found, phase.lines), CUBED, in_phi)
    z, _ = _towards(part.lines, _z(found), RATIO, in_z)
    return Discretisation(PhaseCells(phi, phase.degrees[phi_cells]), (part.on(z),))


def _towards(lines: FloatArray, places: FloatArray, ratio: float, levels: int) -> tuple[FloatArray, Any]:
    """Lines, and more between each place, which is one of them, and its neighbours; the old cell of each cell."""
    is_place, found = _are(lines, places), [lines]
    for a, b, left, right in zip(lines[:-1], lines[1:], is_place[:-1], is_place[1:], strict=True):
        width = 0.5 * (b - a) if left and right else b - a
        steps = width * ratio ** np.arange(0 if left and right else 1, levels + 1)
        steps = steps[steps > THINNEST[ratio]]
        found += [a + steps] * int(left) + [b - steps[steps < 0.9 * width]] * int(right)
    new = np.unique(np.concatenate(found))
    return new, np.searchsorted(lines, new[:-1], side="right") - 1
