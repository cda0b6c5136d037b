"""Simulating the curves of a case."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import MonteCarloSection
from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message
from fpsolve.pool import processors
from fpsolve.simulation.setup import PROGRESS_STEPS, obstacles, simulated_parts
from fpsolve.study.results import SimulatedCurve
from fpsolve.theory.validity import simulated_tail_note

if TYPE_CHECKING:  # numba takes half a second to import
    from fpsolve.simulation.estimators import MonteCarlo
    from fpsolve.simulation.response import Response

SIGNIFICANT = 3.0
"""Standard errors by which λ must exceed 0 before a stationary response is sought."""


def simulation_work(case: Case) -> int:
    """How often `simulate_curves` reports progress."""
    return sum(map(simulation_steps, case.curves()))


def simulation_steps(curve: Curve) -> int:
    """How often the simulation of a curve does."""
    return PROGRESS_STEPS * (3 if _is_nonlinear(curve) else 1)


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


@dataclass(frozen=True)
class SimulateCurve:
    """The task: simulates a curve with as many processors as there are.

    Attributes:
        orders: p of the moments.
        setting: [monte_carlo] of the case, whose p are not used.
    """

    orders: tuple[float, ...]
    setting: MonteCarloSection

    @classmethod
    def of(cls, case: Case) -> SimulateCurve:
        return cls(tuple(float(p) for p in case.simulated), case.monte_carlo)

    def __call__(self, curve: Curve, progress: Callable[[], None] = lambda: None) -> SimulatedCurve:
        return simulate_curve(curve, self.orders, self.setting, progress)


def simulate_curves(
    case: Case,
    *,
    progress: Callable[[], None] = lambda: None,
    known: Callable[[Curve], SimulatedCurve | None] = lambda curve: None,
) -> Iterator[SimulatedCurve]:
    """Simulate the curves of a case one after the other; an interrupt (Ctrl-C) ends it with what is done.

    Args:
        progress: called as often as `simulation_work` counts, but not for what is known.
        known: the simulation of a curve, if that is done already.

    Raises:
        KeyboardInterrupt: nothing was done yet.
    """
    task = SimulateCurve.of(case)
    for curve in case.curves():
        if found := known(curve):
            yield found
            continue
        try:
            simulated = task(curve, progress)
        except KeyboardInterrupt:
            if curve.number == 1:
                raise
            return
        yield simulated
        if simulated.interrupted:
            return


def simulate_curve(
    curve: Curve, orders: Sequence[float], setting: MonteCarloSection, progress: Callable[[], None] = lambda: None
) -> SimulatedCurve:
    """Simulate one curve, and with c₂ or c₃ > 0 its stationary response; a task that pickles small.

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
    note = simulated_tail_note(curve.problem) if any(each.p for each in result.estimates) else None
    noted = result.warnings if note is None else (*result.warnings, note)
    if not _is_nonlinear(curve) or result.interrupted:
        return SimulatedCurve(curve, result, None, noted, result.interrupted)
    try:
        response, warnings = _respond(curve, result, progress)
    except KeyboardInterrupt:
        return SimulatedCurve(curve, result, None, (*noted, Message(Code.RESPONSE_NOT_REACHED)), interrupted=True)
    interrupted = response is not None and response.interrupted
    return SimulatedCurve(curve, result, response, (*noted, *warnings), interrupted)


def _respond(curve: Curve, result: MonteCarlo, progress: Callable[[], None]) -> tuple[Response | None, list[Message]]:
    """The stationary response, or why there is none. Raises KeyboardInterrupt before it is stationary."""
    from fpsolve.simulation.response import stationary_response

    value, error = result.lyapunov_exponent, result.lyapunov_exponent_error
    if value <= SIGNIFICANT * error:
        for _ in range(2 * PROGRESS_STEPS):
            progress()
        return None, [Message(Code.AT_REST, value=value, error=error, most=SIGNIFICANT if value > 0 else None)]
    response = stationary_response(
        curve.problem, value, result.variance_rate, paths=max(result.paths // 8, 32),
        time=result.time, step=result.step, seed=result.seed, progress=progress,
    )  # fmt: skip
    return response, [Message(Code.RESPONSE_STOPPED, time=response.time)] if response.interrupted else []


def _is_nonlinear(curve: Curve) -> bool:
    return curve.oscillator.c2 > 0 or curve.oscillator.c3 > 0
