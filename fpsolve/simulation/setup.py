"""How a simulation is set up: how many paths, how long, in which steps; and what would not be right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, get_args

from fpsolve.arrays import is_whole, real_numbers, shown
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.model.coordinates import infinite
from fpsolve.model.noise import Noise
from fpsolve.model.noises.clock import waves_apart
from fpsolve.model.plane import LinearMotion
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.simulation.coefficients import ROUGHER, coefficients, refuse

Estimator = Literal["direct", "population"]
BATCHES = 32
"""Independent sets of paths, from whose differences the errors are read."""
PATHS, TRANSIENTS, FEWER = 32_768, 64, 16
"""Defaults: how many paths, and how many transients long they are, in the plane and beyond it."""
MAX_PATHS = 10_000_000
PROGRESS_STEPS = 100
"""How often each stretch of a simulation reports progress."""
_LONGEST = 1_000_000
"""Steps in a transient, and transients in all; with more, a simulation would not end."""


def simulated_parts(problem: Problem) -> tuple[LinearMotion, Noise]:
    """The system and the noise of a problem, if they can be simulated.

    Raises:
        FpsolveError: they cannot.
    """
    system, noise = checked_problem(problem).linear, problem.noise
    if not noise.is_simulated:
        need = f"noise that states a step of its paths, but this is a {type(noise).__name__}"
        raise FpsolveError(f"simulation is for {need}; use the finite elements")
    if system.clock:
        system, noise = waves_apart(system, noise)
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


def obstacles(
    oscillator: LinearMotion, noise: Noise, *, time: float | None = None, step: float | None = None
) -> dict[str, str]:
    """Why a simulation with this length and this step would not be right: a sentence for each of "time" and "step"."""
    found, known = {}, coefficients(oscillator, noise)
    largest, reason = known.largest_step
    transient = known.transient()
    h, least, unit = known.default_step, transient / _LONGEST, known.repeated / ROUGHER
    if step is not None and not step > 0:
        found["step"] = f"got {step:g}; must be > 0 and <= {largest:.4g}; make it positive, or leave it out"
    elif step is not None and step > largest * (1 + 1e-12):
        found["step"] = (
            f"got {step:g}, too large for {reason}; must be > 0 and <= {largest:.4g}; reduce it, or leave it out"
        )
    elif step is not None and not known.divides(step):
        near = unit / math.ceil(unit / step)
        found["step"] = f"got {step:.10g}; must be a third, a sixth, … of the delay, such as {near:.10g}"
    elif step is not None and step < least <= largest:
        found["step"] = (
            f"got {step:g}, too small: a transient, {transient:.3g}, must take at most {_LONGEST:.0e} steps; must be "
            f">= {least:.4g} and <= {largest:.4g}; increase it, or leave it out"
        )
    elif (h if step is None else step) < least:
        found["step"] = (
            f"one transient, {transient:.3g}, takes {transient / h:.2g} steps of {h:.3g}, which {reason} requires; "
            f"must be at most {_LONGEST:.0e}; change {reason}, so that it allows steps >= {least:.3g}"
        )
    if time is not None and not 2 * transient * (1 - 1e-12) <= time:
        found["time"] = (
            f"got {time:g}; must be >= {2 * transient:.4g}, two transients, as growth is measured after one; "
            "increase it"
        )
    elif time is not None and time > _LONGEST * transient:
        found["time"] = f"got {time:g}; must be <= {_LONGEST * transient:.4g}, a million transients; reduce it"
    return found
