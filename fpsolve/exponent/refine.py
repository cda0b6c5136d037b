"""The functions of the noise, cells and degrees in φ that Λ(p) is begun with, and better ones.

Polynomials of the noise are tilted towards where the tilted density lies.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.exponent.corners import corners, graded_more, resolving
from fpsolve.exponent.error import Solution
from fpsolve.fem.discretisation import MOST_DEGREE, Cells, Discretisation, NoisePart, PhaseCells, Polynomials, States
from fpsolve.fem.generator import Generator
from fpsolve.model.noise import Noise
from fpsolve.model.plane import System, phase_speed
from fpsolve.model.problem import Problem
from fpsolve.theory.far import Place
from fpsolve.theory.frozen import frozen_noise

FREE_STAGES = 4
"""From this number of stages on, no cell is made coarser."""
SHARE = 0.05
"""Share of the tolerance that a new discretisation is made for in each direction, so that it serves other p too."""
CORNERS = 0.3
"""Share that all cells at corners may lack."""
FEWEST_CELLS, FALL_PER_CELL = 4, 8.0
"""Of a first discretisation of a place far out, and of ln P_s in one of its cells."""
WIDER = 4.0


def first(problem: Problem, p: float, center: float, rtol: float) -> Discretisation:
    """A first discretisation, small, for a tilted density around some z."""
    noise, system, digits = problem.noise, problem.system, -math.log10(rtol)
    if noise.basis == "states":
        return Discretisation(_phase(system, noise.reached, digits), (States(noise.reached.size),))
    unit = noise.standard_deviation
    end = noise.half_width / unit
    phase = _phase(system, unit * np.clip(center + np.array([-2.0, 2.0]), -end, end), digits)
    part: NoisePart
    if noise.basis == "cells":
        part = Cells(_graded(12.0 + abs(center)), round(2 + digits / 2))
    else:
        frozen = frozen_noise(problem)
        slope = frozen.tilt(center) / p if frozen and noise.may_tilt else 0.0
        part = Polynomials(round(digits / 2) + (3 if math.isinf(end) else 5), slope)
    chosen = Discretisation(phase, (part,))
    found = corners(problem, p, center)
    return resolving(found, chosen, noise, center, rtol) if found else chosen


def first_far(problem: Problem, place: Place, rtol: float) -> Discretisation:
    """A first discretisation, with cells even in ln |ξ|, for a place far out."""
    digits, unit = -math.log10(rtol), problem.noise.standard_deviation
    fall = abs(np.subtract(*_log_density(problem.noise, np.array([place.lower, place.upper]))))
    cells = max(FEWEST_CELLS, math.ceil(fall / FALL_PER_CELL))
    lines = place.lower * np.exp(math.log(place.upper / place.lower) * np.linspace(0, 1, cells + 1))
    phase = _phase(problem.system, unit * lines[[0, -1]], digits, 1)
    return Discretisation(phase, (Cells(lines, round(2 + digits / 2), is_killed=True),))


def _phase(system: System, xi: FloatArray, digits: float, more: int = 0) -> PhaseCells:
    """Equal cells on a half circle from one jump to where it comes again, and a line at every other jump.

    There are more where the speed of the phase changes much for some of the ξ.
    """
    speed = phase_speed(system, xi)
    widest = float(np.max(speed.amplitude / np.maximum(np.abs(speed.mean), 1e-300)))
    cells = (8 if widest > 1 else 4 if widest > 0.5 else 2) + more
    rays = [jump.phase for jump in system.jumps] or [math.pi / 2]
    lines = rays[0] + np.linspace(0, math.pi, cells + 1)
    others = rays[0] + np.mod(np.array(rays[1:]) - rays[0], math.pi)
    near = np.min(np.abs(lines[1:-1, None] - others[None]), axis=1, initial=math.inf) < 0.3 * math.pi / cells
    lines = np.sort(np.concatenate([lines[:1], lines[1:-1][~near], lines[-1:], others]))
    degree = round(np.clip(digits + 2 - (widest > 0.5) * 4, 4, MOST_DEGREE))
    return PhaseCells(lines, np.full(lines.size - 1, degree))


def _graded(end: float) -> FloatArray:
    """Lines on both sides, further apart further out."""
    steps = np.concatenate([[0.0], 3.0 * 1.5 ** np.arange(60)])
    side = np.append(steps[steps < 0.8 * end], end)
    return np.concatenate([-side[:0:-1], side])


def widened(generator: Generator) -> Discretisation:
    """That of a generator on an interval `WIDER` times as wide, where that is one of algebraic tails."""
    chosen, lines = generator.chosen, generator.chosen.noise.lines
    if not (lines.size and generator.problem.noise.has_algebraic_tails):
        return chosen
    steps = WIDER ** np.linspace(0, 1, 4)[1:]
    wide = np.concatenate([(lines[0] * steps)[::-1], lines, lines[-1] * steps])
    return chosen.with_noise(replace(chosen.noise, lines=wide))


def refined(solution: Solution, tolerance: float, stages: int) -> Discretisation:
    """A discretisation on which every cell should lack no more than its share of the tolerance."""
    pair, share = solution.pair, SHARE * tolerance
    chosen, problem = pair.generator.chosen, pair.generator.problem
    new = chosen.refined(solution.effects, share, stages < FREE_STAGES)
    if chosen.noise.lines.size:
        lower, upper = solution.truncation
        new = new.with_noise(new.noise.reaching((lower / share, upper / share), partial(_log_density, problem.noise)))
        if any(np.any(each.at_corners) for each in solution.effects if each):
            lacking = [float(np.sum(each.of_cells[each.at_corners])) for each in solution.effects if each]
            new = graded_more(corners(problem, pair.p), new, [each / (CORNERS * tolerance) for each in lacking])
    return new if new.size > chosen.size or solution.error_by_modes <= tolerance else new.raised()


def _log_density(noise: Noise, z: FloatArray) -> FloatArray:
    """ln P_s of a diffusion."""
    return noise.log_density(noise.standard_deviation * z)
