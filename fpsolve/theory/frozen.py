"""Where slow noise carries the p-th moment: the growth rate of paths that hold the noise at one value."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.plane import matrix_at, noise_strength, squared_frequency
from fpsolve.model.problem import Problem

SAMPLES = 1001


def eigenvalues_at(problem: Problem, xi: ArrayLike) -> tuple[FloatArray, FloatArray, Any]:
    """Real parts of the eigenvalues of A(ξ), the larger one first, and whether they are complex: the phase turns."""
    a = matrix_at(problem.system, xi)
    half, square = 0.5 * (a[..., 0, 0] + a[..., 1, 1]), squared_frequency(a)
    root = np.sqrt(np.maximum(-square, 0))
    return half + root, half - root, square > 0


def frozen_rate(problem: Problem, p: float) -> tuple[FloatArray, FloatArray] | None:
    """z on both sides, and the growth rate of ‖x‖^p on paths that hold the noise there.

    F = p G(ξ) − ⅛σ²((ln P_s)′)². G is the growth rate of ln ‖x‖ with ξ frozen, the largest real part of an eigenvalue
    of A(ξ): for the paper's oscillator εξ/2 while it oscillates, |εξ| < 2ω, the rate of the faster real mode beyond.
    For p < −1 the paths that stay on the other real mode carry more: (p + 1)·slow − fast. The second term is what
    holding ξ costs. Slow noise has its tilted density where F is largest, and more than one such place.

    None for a chain.
    """
    noise, system = problem.noise, problem.system
    if isinstance(noise, MarkovChain):
        return None
    unit = noise.standard_deviation
    furthest = 2.5 * abs(p) * 2 * unit * noise_strength(system) * noise.correlation_time
    side = min(max(furthest, 1e-3), 0.999 * noise.half_width / unit) * np.linspace(0, 1, SAMPLES)
    z = np.concatenate([-side[:0:-1], side])
    faster, slower, turns = eigenvalues_at(problem, unit * z)
    growth = p * faster
    if p < -1:
        growth = np.where(turns, growth, np.maximum(growth, (p + 1) * slower - faster))
    holding = 0.125 * (noise.diffusion / unit * np.gradient(noise.log_density(unit * z), z)) ** 2
    return z, growth - holding


def likely_center(problem: Problem, p: float) -> float:
    """About the mean z of the tilted density."""
    found = frozen_rate(problem, p)
    return 0.0 if found is None else float(found[0][np.argmax(found[1])])


def growth_without_turning(problem: Problem, p: float, center: float) -> float | None:
    """About Λ(p), where the noise stays so far out that the phase does not turn; else None."""
    found = frozen_rate(problem, p)
    if found is None or eigenvalues_at(problem, problem.noise.standard_deviation * center)[2]:
        return None
    z, rate = found
    return float(rate[np.argmin(np.abs(z - center))])
