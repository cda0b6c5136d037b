"""How a simulation is set up: how many paths, how long, in which steps; and what would not be right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np

from fpsolve.arrays import FloatArray, real_numbers, shown
from fpsolve.errors import FpsolveError
from fpsolve.model.noise import Noise
from fpsolve.model.problem import Problem

Estimator = Literal["direct", "population"]
BATCHES = 32
"""Independent sets of paths, from whose differences the errors are read."""
PATHS, TRANSIENTS = 32_768, 64
"""Defaults: how many paths, and how many transients long they are."""
MAX_PATHS = 10_000_000
PROGRESS_STEPS = 100
"""How often each stretch of a simulation reports progress."""
_LONGEST = 1_000_000
"""Steps in a transient, and transients in all; with more, a simulation would not end."""


def simulated_parts(problem: Problem) -> tuple[Any, Noise]:
    """The motion and the noise of a problem, if they can be simulated.

    Raises:
        FpsolveError: they cannot.
    """
    system, noise = problem.system, problem.noise
    if noise.is_simulated and system.motion() is not None:
        return system, noise
    raise FpsolveError(
        "simulation is for a VibroImpactOscillator under noise that states a step of its paths, but this is a "
        f"{type(system).__name__} under {type(noise).__name__}; use the finite elements"
    )


def check_settings(noise: Noise, p: float | Sequence[float], estimator: Estimator, paths: int, seed: int) -> None:
    """Refuse what lengths and steps have no part in, see `obstacles`.

    Raises:
        ValueError: the variance of the noise or an order is not finite, or a setting is out of its range.
        NoSuchExponent: some Λ(p) is infinite.
    """
    if not math.isfinite(noise.standard_deviation):
        raise ValueError("got a noise of infinite variance; must be finite, as for r0 < 5/3")
    for order in real_numbers(p, "p", may_be_empty=True):
        noise.check_existence(order)
    is_whole = all(isinstance(each, int | np.integer) for each in (paths, seed))
    if estimator not in get_args(Estimator) or not is_whole or not BATCHES <= paths <= MAX_PATHS or seed < 0:
        raise ValueError(
            f"got estimator = {shown(estimator)}, paths = {shown(paths)}, seed = {shown(seed)}; must be one of "
            f"{', '.join(get_args(Estimator))}, a whole number from {BATCHES} to {MAX_PATHS}, and one >= 0"
        )


def largest_step(oscillator: Any, noise: Noise) -> tuple[float, str]:
    """The largest step that is good to about 1e-4 of the strength of the noise, and what limits it.

    ω h ≤ ½, ε² |c₁| h ≤ ⅛, ε std(ξ) h ≤ ⅛, and the `largest_step` of the noise.
    """
    damping = oscillator.epsilon**2 * abs(oscillator.c1)  # may underflow
    limits = {
        "the frequency": 0.5 / oscillator.omega,
        "the damping": 0.125 / damping if damping else math.inf,
        "the strength of the noise": 0.125 / (oscillator.epsilon * noise.standard_deviation),
        "the correlation time of the noise": noise.largest_step,
    }
    reason = min(limits, key=lambda name: limits[name])
    return limits[reason], reason


def transient(oscillator: Any, noise: Noise) -> float:
    """The time after which ln E‖x‖^p grows like Λ(p) t: whole half-turns π/ω, at least two and eight correlation times.

    In whole half-turns the oscillation cancels that the start from the stationary law leaves in weak noise.
    """
    half_turn = math.pi / oscillator.omega
    return half_turn * max(2, math.ceil(8 * noise.relaxation_time / half_turn))


def default_step(oscillator: Any, noise: Noise) -> float:
    """Half the largest step, or less, so that a half-turn π/ω is a whole number of steps."""
    half_turn = math.pi / oscillator.omega
    return half_turn / math.ceil(half_turn / (0.5 * largest_step(oscillator, noise)[0]))


def obstacles(oscillator: Any, noise: Noise, *, time: float | None = None, step: float | None = None) -> dict[str, str]:
    """Why a simulation with this length and this step would not be right: a sentence for each of "time" and "step"."""
    found = {}
    largest, reason = largest_step(oscillator, noise)
    settling = transient(oscillator, noise)
    h, least = default_step(oscillator, noise), settling / _LONGEST
    if step is not None and not step > 0:
        found["step"] = f"got {step:g}; must be > 0 and <= {largest:.4g}; make it positive, or leave it out"
    elif step is not None and step > largest * (1 + 1e-12):
        found["step"] = (
            f"got {step:g}, too large for {reason}; must be > 0 and <= {largest:.4g}; reduce it, or leave it out"
        )
    elif step is not None and step < least <= largest:
        found["step"] = (
            f"got {step:g}, too small: a transient, {settling:.3g}, must take at most {_LONGEST:.0e} steps; must be >= "
            f"{least:.4g} and <= {largest:.4g}; increase it, or leave it out"
        )
    elif (h if step is None else step) < least:
        found["step"] = (
            f"one transient, {settling:.3g}, takes {settling / h:.2g} steps of {h:.3g}, which {reason} asks for; must "
            f"be at most {_LONGEST:.0e}; bring the times of noise and oscillator nearer to each other"
        )
    if time is not None and not 2 * settling * (1 - 1e-12) <= time:
        found["time"] = (
            f"got {time:g}; must be >= {2 * settling:.4g}, two transients, as growth is measured after one; increase it"
        )
    elif time is not None and time > _LONGEST * settling:
        found["time"] = f"got {time:g}; must be <= {_LONGEST * settling:.4g}, a million transients; reduce it"
    return found


def starting_state(
    noise: Noise, paths: int, rng: np.random.Generator, amplitude: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, u and ξ of paths of one amplitude, with uniform phases in front of the wall and stationary noise."""
    phase = rng.uniform(0, math.pi, paths)
    return amplitude * np.sin(phase), amplitude * np.cos(phase), noise.sample(paths, rng)
