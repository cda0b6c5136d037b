"""How a simulation is set up: how many paths, how long, in which steps; and what would not be right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from fpsolve.arrays import is_whole, real_numbers, shown
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.model.noise import Noise
from fpsolve.model.noises.clock import waves_apart
from fpsolve.model.plane import SAME_DELAY, System
from fpsolve.model.problem import Problem, checked_problem, infinite
from fpsolve.simulation.coefficients import ROUGHER, SplitCoefficients, coefficients, refuse, repeated_delay

Estimator = Literal["direct", "population"]
SPLIT = 0.06
"""The turn, growth or kick in one step at most where several noises move the state in turn."""
BATCHES = 32
"""Independent sets of paths, from whose differences the errors are read."""
PATHS, TRANSIENTS, FEWER = 32_768, 64, 16
"""Defaults: how many paths, and how many transients long they are, in the plane and beyond it."""
MAX_PATHS = 10_000_000
PROGRESS_STEPS = 100
"""How often each stretch of a simulation reports progress."""
_LONGEST = 1_000_000
"""Steps in a transient, and transients in all; with more, a simulation would not end."""


def simulated_parts(problem: Problem) -> tuple[System, Noise]:
    """The system and the noise of a problem, if they can be simulated.

    Raises:
        FpsolveError: they cannot.
    """
    system, noise = checked_problem(problem).system, problem.noise
    if not noise.is_simulated:
        need = f"noise that states a step of its paths, but this is a {type(noise).__name__}"
        raise FpsolveError(f"simulation is for {need}; use the finite elements")
    if system.clock:
        system, noise = waves_apart(system, noise)
    try:
        repeated_delay(system)
    except ValueError as failure:
        raise FpsolveError(f"simulation is in steps that divide each delay, but {failure}") from failure
    refuse(system, noise)
    return system, noise


def check_settings(problem: Problem, p: float | Sequence[float], estimator: Estimator, paths: int, seed: int) -> None:
    """Refuse what lengths and steps have no part in, see `obstacles`.

    Raises:
        ValueError: the variance of the noise or an order is not finite, or a setting is out of its range.
        NoSuchExponent: some Λ(p) is infinite.
    """
    if not (problem.noise.is_white or math.isfinite(problem.noise.standard_deviation)):
        raise ValueError("got a noise of infinite variance; must be finite, as for r0 < 5/3")
    orders = real_numbers(p, "p", may_be_empty=True)
    for order in orders.tolist():
        if told := infinite(problem, order):
            raise NoSuchExponent(told)
    is_possible = is_whole(paths, BATCHES, MAX_PATHS) and is_whole(seed, 0)
    if estimator not in get_args(Estimator) or not is_possible:
        raise ValueError(
            f"got estimator = {shown(estimator)}, paths = {shown(paths)}, seed = {shown(seed)}; must be one of "
            f"{', '.join(get_args(Estimator))}, a whole number from {BATCHES} to {MAX_PATHS}, and one >= 0"
        )


def largest_step(oscillator: System, noise: Noise) -> tuple[float, str]:
    """The largest step that is good to about 1e-4 of the strength of the noise, and what limits it.

    For A₀ = ω((0, 1), (−1, 0)) + D, beyond the plane Ω + D with Ωᵀ = −Ω and ‖Ω‖ = ω, and for A₁ these are ω h ≤ ½,
    ‖D‖ h ≤ ⅛, ‖A₁‖ std(ξ) h ≤ ⅛, or under white noise ‖A₁‖² h ≤ ⅛, and the `largest_step` of the noise. Under a chain
    or impulses, where a step is exact, it is 1/(2π) half-turns.
    """
    known = coefficients(oscillator, noise)
    if known.is_exact:
        return 0.5 * known.half_turn / math.pi, "the frequency"
    turning = 0.5 * (known.steady - known.steady.T)
    turn = float(np.linalg.norm(turning, 2))
    rest = float(np.linalg.norm(known.steady - turning, 2))  # may underflow
    if isinstance(known, SplitCoefficients):
        strengths = [SPLIT / (size**2 if is_white else size) for size, is_white in known.sizes if size]
        split = {
            "the frequency": 2 * SPLIT / turn if turn else math.inf,
            "the damping": SPLIT / rest if rest else math.inf,
            "the strength of the noise": min(strengths, default=math.inf),
            "the correlation time of the noise": noise.largest_step,
            "the delay": repeated_delay(oscillator) / 4,
        }
        reason = min(split, key=lambda name: split[name])
        return split[reason], reason
    driven = float(np.linalg.norm(known.driven, 2))
    limits = {
        "the frequency": 0.5 / turn if turn else math.inf,
        "the damping": 0.125 / rest if rest else math.inf,
        "the strength of the noise": math.inf,
        "the correlation time of the noise": noise.largest_step,
    }
    if driven:
        limits["the strength of the noise"] = 0.125 / (
            driven**2 if noise.is_white else driven * noise.standard_deviation
        )
    reason = min(limits, key=lambda name: limits[name])
    return limits[reason], reason


def transient(oscillator: System, noise: Noise, *, is_mixed: bool = True) -> float:
    """The time after which ln E‖x‖^p grows like Λ(p) t: at least two half-turns π/ω and eight relaxation times.

    Of impulses that is eight times the mean time between two of them.

    It is a whole number of half-turns, in which the oscillation cancels that the start from the stationary law leaves
    in weak noise; beside a harmonic load, with which the growth goes up and down for ever, a whole number of periods.
    Beyond the plane it is, if `is_mixed`, at least as long as the modes remember how they shared the motion.
    """
    known, unit = coefficients(oscillator, noise), _repeated(oscillator, noise)
    relaxation_time = max((part.relaxation_time for part in noise.parts.values() if not part.period), default=0.0)
    return unit * math.ceil(max(2 * known.half_turn, 8 * relaxation_time, is_mixed * known.settling) / unit)


def default_step(oscillator: System, noise: Noise) -> float:
    """Half the largest step, or less, so that a half-turn π/ω or a period is a whole number of steps, rough or not."""
    unit = _repeated(oscillator, noise) / coefficients(oscillator, noise).together
    return unit / math.ceil(unit / (0.5 * largest_step(oscillator, noise)[0]))


def _repeated(oscillator: System, noise: Noise) -> float:
    """The delay, or the period of a harmonic load, without one a half-turn."""
    if math.isfinite(delay := repeated_delay(oscillator)):
        return delay
    return max(part.period for part in noise.parts.values()) or coefficients(oscillator, noise).half_turn


def obstacles(
    oscillator: System, noise: Noise, *, time: float | None = None, step: float | None = None
) -> dict[str, str]:
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
    elif step is not None and not _divides(step, oscillator):
        unit = repeated_delay(oscillator) / ROUGHER
        near = unit / math.ceil(unit / step)
        found["step"] = f"got {step:.10g}; must be a third, a sixth, … of the delay, such as {near:.10g}"
    elif step is not None and step < least <= largest:
        found["step"] = (
            f"got {step:g}, too small: a transient, {settling:.3g}, must take at most {_LONGEST:.0e} steps; must be >= "
            f"{least:.4g} and <= {largest:.4g}; increase it, or leave it out"
        )
    elif (h if step is None else step) < least:
        found["step"] = (
            f"one transient, {settling:.3g}, takes {settling / h:.2g} steps of {h:.3g}, which {reason} requires; must "
            f"be at most {_LONGEST:.0e}; bring the times of noise and oscillator nearer to each other"
        )
    if time is not None and not 2 * settling * (1 - 1e-12) <= time:
        found["time"] = (
            f"got {time:g}; must be >= {2 * settling:.4g}, two transients, as growth is measured after one; increase it"
        )
    elif time is not None and time > _LONGEST * settling:
        found["time"] = f"got {time:g}; must be <= {_LONGEST * settling:.4g}, a million transients; reduce it"
    return found


def _divides(step: float, system: System) -> bool:
    """Whether the delays of a system are whole numbers of rough steps."""
    parts = repeated_delay(system) / (ROUGHER * step)
    return not math.isfinite(parts) or abs(parts - round(parts)) <= SAME_DELAY * parts
