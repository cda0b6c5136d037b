"""Simulating the curves of a case."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import MonteCarloSection
from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message
from fpsolve.pool import processors
from fpsolve.simulation.setup import PROGRESS_STEPS, obstacles, simulated_parts
from fpsolve.study.results import SimulatedCurve

SIGNIFICANT = 3.0
"""Standard errors by which λ must exceed 0 before a stationary response is sought."""


def simulation_work(case: Case) -> int:
    """How often `simulate_curves` reports progress."""
    return sum(map(simulation_steps, case.curves()))


def simulation_steps(curve: Curve) -> int:
    """How often the simulation of a curve does."""
    return PROGRESS_STEPS * (3 if curve.problem.system.is_nonlinear else 1)


def refuse_obstacles(case: Case) -> None:
    """Refuse a case some curve of which cannot be simulated, or a number of processors that is none.

    Raises:
        FpsolveError: with the curve and the reason.
    """
    processors()
    for curve in case.curves():
        place = f"with {curve.label}: " if curve.varied else ""
        try:
            parts = simulated_parts(curve.problem)
        except FpsolveError as failure:
            raise FpsolveError(f"{case.path}: {place}{failure}") from None
        found = obstacles(*parts, time=case.monte_carlo.time, step=case.monte_carlo.step)
        for name, sentence in found.items():
            raise FpsolveError(f"{case.path}: monte_carlo.{name}: {place}{sentence}")


def simulate_curves(
    case: Case,
    *,
    progress: Callable[[], None] = lambda: None,
    known: Callable[[Curve], SimulatedCurve | None] = lambda curve: None,
    made: Iterator[SimulatedCurve] | None = None,
) -> Iterator[SimulatedCurve]:
    """Simulate the curves of a case one after the other; an interrupt (Ctrl-C) ends it with what is done.

    Args:
        progress: called as often as `simulation_work` counts, but not for what is known, or made elsewhere.
        known: the simulation of a curve, if that is done already.
        made: the simulations of the other curves in their order, made elsewhere; None where this process makes them.

    Raises:
        KeyboardInterrupt: nothing was done yet.
    """
    orders, setting = case.simulated.tolist(), case.monte_carlo
    for curve in case.curves():
        if (found := known(curve)) is None:
            try:
                found = next(made) if made else simulate_curve(curve, orders, setting, progress)
            except KeyboardInterrupt:
                if curve.number == 1:
                    raise
                return
        yield found
        if found.interrupted:
            return


def simulate_curve(
    curve: Curve, orders: Sequence[float], setting: MonteCarloSection, progress: Callable[[], None] = lambda: None
) -> SimulatedCurve:
    """Simulate one curve, and with terms of degree 3 its stationary response; a task that pickles small.

    Args:
        curve: the parameters.
        orders: p of the moments.
        setting: [monte_carlo] of the case, whose p are not used.
        progress: called as often as `simulation_work` counts; a task for another process has none.

    Raises:
        KeyboardInterrupt: nothing was done yet.
        FpsolveError: as `simulate`.
    """
    from fpsolve.simulation.estimators import simulate

    result = simulate(
        curve.problem, orders, estimator=setting.estimator,
        paths=setting.paths, time=setting.time, step=setting.step, seed=setting.seed, progress=progress,
    )  # fmt: skip
    if not curve.problem.system.is_nonlinear or result.interrupted:
        return SimulatedCurve(curve, result, None, result.warnings, result.interrupted)
    value, error, noted = result.lyapunov_exponent, result.lyapunov_exponent_error, result.warnings
    try:
        if value <= SIGNIFICANT * error:
            for _ in range(2 * PROGRESS_STEPS):
                progress()
            at_rest = Message(Code.AT_REST, value=value, error=error, most=SIGNIFICANT if value > 0 else None)
            return SimulatedCurve(curve, result, None, (*noted, at_rest))
        from fpsolve.simulation.response import no_simulation, simulated_response

        if reason := no_simulation(curve.problem):
            for _ in range(2 * PROGRESS_STEPS):
                progress()
            return SimulatedCurve(curve, result, None, (*noted, reason))
        response = simulated_response(
            curve.problem, value, result.variance_rate, paths=max(result.paths // 8, 32),
            time=result.time, step=result.step, seed=result.seed, progress=progress,
        )  # fmt: skip
    except KeyboardInterrupt:
        return SimulatedCurve(curve, result, None, (*noted, Message(Code.RESPONSE_NOT_REACHED)), interrupted=True)
    if response.interrupted:
        noted = (*noted, Message(Code.RESPONSE_STOPPED, time=response.time))
    return SimulatedCurve(curve, result, response, noted, response.interrupted)
