"""The functions of the noise, cells and degrees in φ that Λ(p) is begun with, and better ones.

How fast the effect of a cell's modes falls with their degree is how fast the cell converges, and decides between a
higher degree and smaller cells. Polynomials of the noise are tilted towards where the tilted density lies.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.exponent.corners import corners, graded_more, resolving
from fpsolve.exponent.error import ModeEffects, Solution
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import MAX_DEGREE, halved
from fpsolve.fem.space import Discretisation
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import has_algebraic_tails
from fpsolve.model.plane import System, phase_speed
from fpsolve.model.problem import AnyNoise, Problem
from fpsolve.theory.far import Place
from fpsolve.theory.frozen import frozen_noise

HALVING = 2 * math.log(2)
"""By how much more the logarithm of an effect falls with each degree in half a cell."""
MAX_POLYNOMIALS = 200
FREE_STAGES = 4
"""From this number of stages on, no cell is made coarser."""
SHARE = 0.05
"""Share of the tolerance that a new discretisation is made for in each direction, so that it serves other p too."""
CORNERS = 0.3
"""Share that all cells at corners may lack."""
LEAST_DEGREE, SPLIT_DEGREE, MOST_DEGREE = 4, 6, 14
FEWEST_CELLS, FALL_PER_CELL = 4, 8.0
"""Of a first discretisation of a place far out, and of ln P_s in one of its cells."""
THIRDS = 3
"""Into how many parts a cell of φ is cut for a place far out: where the phase rests must not come to lie on a line."""
WIDER = 4.0
LARGEST_RATIO = 1.4
"""Of the z of two lines there."""
OPEN, OPENED = 3.0, np.array([1.0, 2.5, 5.0, 10.0])
"""z from which on paths may come and go, and lines that then are added on both sides."""


def first(problem: Problem, p: float, center: float, rtol: float) -> Discretisation:
    """A first discretisation, small, for a tilted density around some z."""
    noise, system, digits = problem.noise, problem.system, -math.log10(rtol)
    if isinstance(noise, MarkovChain):
        states = np.array(noise.states)
        return _with_phi(Discretisation(np.zeros(0), None), system, states, digits)
    unit = noise.standard_deviation
    end = noise.half_width / unit
    reach = np.clip(center + np.array([-2.0, 2.0]), -end, end)
    if has_algebraic_tails(noise):
        chosen = Discretisation(np.zeros(0), None, z_lines=_graded(12.0 + abs(center)), xi_degree=round(2 + digits / 2))
    else:
        frozen = frozen_noise(problem)
        slope = frozen.tilt(center) / p if frozen else 0.0
        count = round(digits / 2) + (3 if math.isinf(end) else 5)
        chosen = Discretisation(np.zeros(0), None, polynomials=count, slope=slope)
    chosen = _with_phi(chosen, system, unit * reach, digits)
    found = corners(problem, p, center)
    return resolving(found, chosen, noise, center, rtol) if found else chosen


def first_far(problem: Problem, place: Place, rtol: float) -> Discretisation:
    """A first discretisation, with cells even in ln |ξ|, for a place far out."""
    digits, unit = -math.log10(rtol), problem.noise.standard_deviation
    fall = abs(np.subtract(*_log_density(problem.noise, np.array([place.lower, place.upper]))))
    cells = max(FEWEST_CELLS, math.ceil(fall / FALL_PER_CELL))
    lines = place.lower * np.exp(math.log(place.upper / place.lower) * np.linspace(0, 1, cells + 1))
    chosen = Discretisation(np.zeros(0), None, z_lines=lines, xi_degree=round(2 + digits / 2), is_killed=True)
    return _with_phi(chosen, problem.system, unit * lines[[0, -1]], digits)


def _with_phi(chosen: Discretisation, system: System, xi: FloatArray, digits: float) -> Discretisation:
    """With cells in φ, more where its speed changes much for some of the ξ."""
    speed = phase_speed(system, xi)
    widest = float(np.max(speed.amplitude / np.maximum(np.abs(speed.mean), 1e-300)))
    cells = 8 if widest > 1 else 4 if widest > 0.5 else 2
    lines = _phi_lines(system, cells + chosen.is_killed)
    degrees = np.full(lines.size - 1, round(np.clip(digits + 2 - (widest > 0.5) * 4, 4, MOST_DEGREE)))
    return replace(chosen, phi_lines=lines, phi_degrees=degrees)


def _phi_lines(system: System, cells: int) -> FloatArray:
    """Equal cells on a half circle from one kick to where it comes again, and a line at every other kick."""
    rays = [kick.phase for kick in system.kicks] or [math.pi / 2]
    lines = rays[0] + np.linspace(0, math.pi, cells + 1)
    others = rays[0] + np.mod(np.array(rays[1:]) - rays[0], math.pi)
    near = np.min(np.abs(lines[1:-1, None] - others[None]), axis=1, initial=math.inf) < 0.3 * math.pi / cells
    return np.sort(np.concatenate([lines[:1], lines[1:-1][~near], lines[-1:], others]))


def _graded(end: float) -> FloatArray:
    """Lines on both sides, further apart further out."""
    steps = np.concatenate([[0.0], 3.0 * 1.5 ** np.arange(60)])
    side = np.append(steps[steps < 0.8 * end], end)
    return np.concatenate([-side[:0:-1], side])


def widened(generator: Generator) -> Discretisation:
    """That of a generator on an interval `WIDER` times as wide, where that is one of algebraic tails."""
    chosen = generator.chosen
    if not (chosen.z_lines.size and has_algebraic_tails(generator.problem.noise)):
        return chosen
    steps = WIDER ** np.linspace(0, 1, 4)[1:]
    lines = np.concatenate([(chosen.z_lines[0] * steps)[::-1], chosen.z_lines, chosen.z_lines[-1] * steps])
    return replace(chosen, z_lines=lines)


def doubled(chosen: Discretisation) -> Discretisation:
    """Twice as many functions each way, where nothing is known yet."""
    if chosen.is_killed:
        lines = chosen.phi_lines if np.max(chosen.phi_degrees) < MOST_DEGREE - 2 else _in_thirds(chosen.phi_lines)
        degrees = np.full(lines.size - 1, min(int(np.max(chosen.phi_degrees)) + 4, MOST_DEGREE))
        return replace(chosen, phi_lines=lines, phi_degrees=degrees, z_lines=halved(chosen.z_lines))
    fine = replace(chosen, phi_lines=halved(chosen.phi_lines), phi_degrees=np.repeat(chosen.phi_degrees, 2))
    if chosen.polynomials:
        return replace(fine, polynomials=min(2 * chosen.polynomials, MAX_POLYNOMIALS))
    return replace(fine, z_lines=halved(chosen.z_lines)) if chosen.z_lines.size else fine


def refined(solution: Solution, tolerance: float, stages: int) -> Discretisation:
    """A discretisation on which every cell should lack no more than its share of the tolerance."""
    chosen, noise = solution.pair.generator.chosen, solution.pair.generator.problem.noise
    share, may_coarsen = SHARE * tolerance, stages < FREE_STAGES
    phi, xi = solution.effects
    lines, degrees = _split(chosen.phi_lines, phi, share, may_coarsen, THIRDS if chosen.is_killed else 2)
    new = replace(chosen, phi_lines=lines, phi_degrees=degrees)
    if xi and chosen.polynomials:
        needed = math.ceil(float(xi.needed(share)[0]) + 1.3)
        least = max(chosen.polynomials // 2, 3) if may_coarsen else chosen.polynomials
        most = min(3 * chosen.polynomials // 2 + 3, MAX_POLYNOMIALS)
        new = replace(new, polynomials=max(least, min(needed, most)))
    elif xi:
        lines, degrees = _split(chosen.z_lines, xi, share, may_coarsen)
        new = _reaching(replace(new, z_lines=lines, xi_degree=int(np.max(degrees))), solution, share)
        if np.any(phi.at_corners):
            lacking = [float(np.sum(each.of_cells[each.at_corners])) for each in (phi, xi)]
            found = corners(solution.pair.generator.problem, solution.pair.p)
            new = graded_more(found, new, [each / (CORNERS * tolerance) for each in lacking])
    grows = new.unknowns(noise) > chosen.unknowns(noise)
    return new if grows or solution.error_by_modes <= tolerance else _raised(new)


def _split(
    lines: FloatArray, effects: ModeEffects, share: float, may_coarsen: bool, parts: int = 2
) -> tuple[FloatArray, Any]:
    """Lines and a degree for each cell with which all together should lack no more than a share.

    A cell is halved, or cut into other parts, where halves take fewer unknowns: in them the effects fall faster. Those
    at corners are left as they are.
    """
    rate, needed = effects.fall, effects.needed(max(share, 1e-290) / math.sqrt(effects.degrees.size))
    if not may_coarsen:
        needed = np.maximum(needed, effects.degrees)
    needed = np.where(effects.at_corners, effects.degrees - 0.2, needed)  # see `graded_more`
    in_half = needed * rate / (rate + HALVING)
    is_split = (2 * in_half + 2 < needed + 1) & (effects.degrees >= SPLIT_DEGREE) & (needed > effects.degrees)
    is_split |= needed > MOST_DEGREE
    degrees = np.ceil(np.where(is_split, in_half, needed) + 0.2)
    degrees = np.clip(degrees, np.maximum(LEAST_DEGREE, effects.degrees - 4), effects.degrees + 4)
    counts = np.where(is_split, parts, 1)
    new = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(lines[:-1], lines[1:], counts, strict=True)]
    return np.concatenate([*new, lines[-1:]]), np.repeat(np.minimum(degrees, MOST_DEGREE).astype(int), counts)


def _in_thirds(lines: FloatArray) -> FloatArray:
    return np.interp(np.arange(3 * lines.size - 2) / 3, np.arange(lines.size), lines)


def _raised(chosen: Discretisation) -> Discretisation:
    """One more function each way, where what a cell lacks harms others."""
    if chosen.polynomials:
        chosen = replace(chosen, polynomials=min(chosen.polynomials + 2, MAX_POLYNOMIALS))
    elif chosen.xi_degree:
        chosen = replace(chosen, xi_degree=min(chosen.xi_degree + 1, MAX_DEGREE))
    return replace(chosen, phi_degrees=np.minimum(chosen.phi_degrees + 1, MAX_DEGREE))


def _reaching(chosen: Discretisation, solution: Solution, share: float) -> Discretisation:
    """With further cells at each end whose effect is more than a share of the tolerance."""
    lines, (lower, upper) = chosen.z_lines, solution.truncation
    if chosen.is_killed:
        return _less_killed(chosen, solution.pair.generator.problem.noise, np.array([lower, upper]) / share)
    below = [1.6 * lines[0]] if lower > share else []
    above = [1.6 * lines[-1]] if upper > share else []
    return replace(chosen, z_lines=np.concatenate([below, lines, above]))


def _less_killed(chosen: Discretisation, noise: AnyNoise, excess: FloatArray) -> Discretisation:
    """The same for the ends of a place far out; close to ξ = 0 paths are no longer killed, and return freely.

    Inwards the effect of killing falls like 1/P_s, outwards faster.
    """
    side = math.copysign(1.0, chosen.z_lines[0])
    lines = np.sort(side * chosen.z_lines)
    inner, outer = excess if side > 0 else excess[::-1]
    if outer > 1:
        lines = np.append(lines, 1.6 * lines[-1])
    if inner > 1:
        steps = lines[0] / LARGEST_RATIO ** np.arange(1, 200)
        gain = _log_density(noise, side * steps) - _log_density(noise, side * lines[:1])
        enough = int(np.argmax(gain > math.log(inner))) + 1 if math.log(inner) < gain[-1] else steps.size
        if steps[enough - 1] < OPEN:
            lines = np.concatenate([-OPENED[::-1], [0.0], OPENED[0.8 * lines[0] > OPENED], lines])
            return replace(chosen, z_lines=np.sort(side * lines), is_killed=False)
        lines = np.concatenate([steps[:enough][::-1], lines])
    return replace(chosen, z_lines=np.sort(side * lines))


def _log_density(noise: AnyNoise, z: FloatArray) -> FloatArray:
    """ln P_s of a diffusion."""
    return noise.log_density(noise.standard_deviation * z)  # type: ignore[union-attr]
