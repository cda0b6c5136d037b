"""Where a search for Λ(p) starts: a small space for the values of the noise that carry a moment, and other values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import noise_marginal
from fpsolve.fem.effects import MOST_DEGREE
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_axes import CellAxis, PolynomialAxis
from fpsolve.fem.pairs import PairAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space, first_axis
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.plane import System, Xi, phase_speed
from fpsolve.model.problem import Problem
from fpsolve.theory.frozen import frozen_noise, steady_places, swing

REACH = 12.0
"""Standard deviations on both sides, up to which the first cells of noise with algebraic tails are."""
COMPARABLE = 0.6
"""Paths that hold the noise elsewhere are looked at if they grow at this share of Λ (less by the rest, for Λ < 0)."""


def first(problem: Problem, p: float, rtol: float, center: float | None = None) -> Space:
    """A first discretisation, small, for a tilted density around some z; None for where slow noise carries it."""
    noise, system, digits = problem.coloured, problem.motion, -math.log10(rtol)
    if noise.basis == "cells":  # around ξ = 0, their lines on both sides, further apart further out
        steps = np.concatenate([[0.0], 3.0 * 1.5 ** np.arange(60)])
        side = np.append(steps[steps < 0.8 * REACH], REACH)
        phase = _phase(system, noise.standard_deviation * np.array([-2.0, 2.0]), digits)
        lines = np.concatenate([-side[:0:-1], side])
        return Space((phase, CellAxis(noise, lines, np.full(lines.size - 1, round(2 + digits / 2)))))
    frozen = frozen_noise(problem)
    if frozen is None:  # the noise has states, or a state of its own, or there are several
        axes = [first_axis(each, digits) for each in noise.parts.values()]
        phase = _phase(system, problem.typical, digits, is_smooth=sum(axis.dimension for axis in axes) > 1)
        if len(axes) == 1 and isinstance(axis := axes[0], PairAxis):
            if center is None:
                center = float(steady_places(problem, p)[0][0])
            pull = noise.standard_deviation**2 * center / noise.spectral_density(0.0) if center else 0.0
            axes = [replace(axis, slope=pull / p)]
        return Space((phase, *axes))
    unit, center = noise.standard_deviation, frozen.center(p) if center is None else center
    end = noise.half_width / unit
    phase = _phase(system, unit * np.clip(center + np.array([-2.0, 2.0]), -end, end), digits)
    slope = frozen.tilt(center) / p if noise.may_tilt else 0.0
    return Space((phase, PolynomialAxis(noise, round(digits / 2) + (3 if math.isinf(end) else 5), slope)))


def _phase(system: System, xi: Xi, digits: float, is_smooth: bool = False) -> PhaseAxis:
    """Equal cells on a half circle from one jump to where it comes again, and a line at every other jump.

    There are more where the speed of the phase changes much for some of the ξ; but one, of a higher degree, where
    several numbers move it, which leave T smoother, and each function of φ is a thousand unknowns.
    """
    speed = phase_speed(system, xi)
    widest = float(np.max(speed.amplitude / np.maximum(np.abs(speed.mean), 1e-300)))
    cells = 1 if is_smooth else 8 if widest > 1 else 4 if widest > 0.5 else 2
    rays = [jump.phase for jump in system.jumps] or [math.pi / 2]
    lines = rays[0] + np.linspace(0, math.pi, cells + 1)
    others = rays[0] + np.mod(np.array(rays[1:]) - rays[0], math.pi)
    near = np.min(np.abs(lines[1:-1, None] - others[None]), axis=1, initial=math.inf) < 0.3 * math.pi / cells
    lines = np.sort(np.concatenate([lines[:1], lines[1:-1][~near], lines[-1:], others]))
    degree = round(np.clip(digits + (4 if is_smooth else -2 if widest > 0.5 else 2), 4, MOST_DEGREE))
    return PhaseAxis.of(lines, np.full(lines.size - 1, degree))


def other_centers(pair: PrincipalPair) -> list[float]:
    """Other z, far from the tilted density of a pair, where paths that hold the noise grow about as fast.

    It is 0 where they do on which the noise of a filter swings far to both sides. Between two such places slow noise
    hardly ever passes: each has its own pair with T > 0 as far as that can be told, and only the larger eigenvalue is
    Λ.
    """
    frozen, noise = frozen_noise(pair.generator.problem), pair.generator.problem.coloured
    if noise.basis == "pairs":
        center, (z, rate) = pair.space.xi.center, steady_places(pair.generator.problem, pair.p)
        far = (np.abs(z - center) > 5) & (rate > comparable(pair.value))
        found: list[float] = z[far][:1].tolist()
        if center:
            amplitude, swinging = swing(pair.generator.problem, pair.p)
            found += [0.0] * (amplitude > 5 and swinging > comparable(pair.value))
        return found
    if frozen is None:
        return []
    z, rate = frozen.peaks(pair.p)
    if z.size < 2:
        return []
    at, density = noise_marginal(pair)
    mean = float(at @ density / density.sum())
    width = math.sqrt(float((at - mean) ** 2 @ density / density.sum()))
    far = (np.abs(z - mean) > 3 * width + 2) & (rate > comparable(pair.value))
    return [float(z[far][np.argmax(rate[far])])] if np.any(far) else []


def warnings_of_other_places(mesh: CylinderMesh | None, pairs: Sequence[PrincipalPair]) -> tuple[Message, ...]:
    """A warning about a pair on a given mesh whose moment slow noise may carry elsewhere, or nothing."""
    if mesh is None:  # then both places have been looked at
        return ()
    for pair in pairs:
        for z in other_centers(pair):
            return (Message(Code.CARRIED_ELSEWHERE, p=pair.p, z=z, remedy=Remedy.REACH),)
    return ()


def comparable(value: float) -> float:
    """The growth rate from which on a place may outdo one with a value."""
    return value - (1 - COMPARABLE) * abs(value)
