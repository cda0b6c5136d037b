"""Simulations of the parameter sets of a case."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fpsolve.analysis.target import said
from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.refusals import obstacle
from fpsolve.case.sections import MonteCarloSection
from fpsolve.errors import FpsolveError
from fpsolve.exponent.kinds import choose
from fpsolve.messages import Code, Message
from fpsolve.pool import processors
from fpsolve.simulation.setup import PROGRESS_STEPS, obstacles, simulated_parts
from fpsolve.solve.question import idle
from fpsolve.solve.records import key_of

if TYPE_CHECKING:
    from fpsolve.simulation import MonteCarlo, Response


Simulation: TypeAlias = "tuple[MonteCarlo, Response | None, tuple[Message, ...], bool]"
"""What a simulation finds, see `SimulatedSet`."""
RECORDS = "records/simulated.jsonl"
"""The file of the records of simulations."""
SIGNIFICANT = 3.0
"""Standard errors by which λ must exceed 0 before a stationary response is sought."""


def simulation_steps(parameter_set: ParameterSet) -> int:
    """How often the simulation of a parameter set reports progress."""
    return PROGRESS_STEPS * (3 if parameter_set.problem.linear.cubic else 1)


def refuse_obstacles(case: Case) -> None:
    """Refuse a case some parameter set of which cannot be simulated, or a number of processors that is none.

    Raises:
        FpsolveError: with the parameter set and the reason.
    """
    processors()
    stated = case.monte_carlo
    for each in case.sets():
        place = case.vary.line_of(each.number) + (f"with {each.label}: " if each.varied else "")
        try:
            parts = simulated_parts(each.problem)
        except (FpsolveError, ValueError) as failure:
            raise case.refusal(f"{place}{said(failure)}", "monte_carlo") from None
        for name, sentence in obstacles(*parts, time=stated.time, step=stated.step).items():
            raise case.refusal(f"{place}{sentence}", "monte_carlo", name)
        orders = np.array(stated.p or ())
        if reason := obstacle(each.base, each.varied, orders, with_moments=choose(each.problem).has_pairs):
            raise case.refusal(f"{place}{reason}", "monte_carlo", "p")


def simulation_of(
    parameter_set: ParameterSet,
    orders: Sequence[float],
    setting: MonteCarloSection,
    progress: Callable[[], None] = idle,
) -> Simulation:
    """Simulate one parameter set, and with terms of degree 3 its stationary response; a task that pickles small.

    Args:
        parameter_set: the parameters.
        orders: p of the moments.
        setting: [monte_carlo] of the case, whose p are not used.
        progress: called as often as `simulation_steps` says; a task for another process has none.

    Raises:
        KeyboardInterrupt: nothing was done yet.
        FpsolveError: as `simulate`.
    """
    from fpsolve.simulation.estimators import simulate  # 310 ms

    result = simulate(
        parameter_set.problem, orders, estimator=setting.estimator,
        paths=setting.paths, time=setting.time, step=setting.step, seed=setting.seed, progress=progress,
    )  # fmt: skip
    response, said, interrupted = None, list[Message](), result.interrupted
    if parameter_set.problem.linear.cubic and not interrupted:
        from fpsolve.simulation.response import no_simulation, simulated_response  # 150 ms

        value, error = result.lyapunov_exponent, result.lyapunov_exponent_error
        at_rest = Message(Code.AT_REST, value=value, error=error, most=SIGNIFICANT if value > 0 else None)
        if reason := at_rest if value <= SIGNIFICANT * error else no_simulation(parameter_set.problem):
            said.append(reason)
            for _ in range(2 * PROGRESS_STEPS):
                progress()
        else:
            try:
                response = simulated_response(
                    parameter_set.problem, value, result.variance_rate, paths=max(result.paths // 8, 32),
                    time=result.time, step=result.step, seed=result.seed, progress=progress,
                )  # fmt: skip
                interrupted = response.interrupted
                said += [Message(Code.RESPONSE_STOPPED, time=response.time)] * interrupted
            except KeyboardInterrupt:
                interrupted = True
                said.append(Message(Code.RESPONSE_NOT_REACHED))
    return result, response, (*result.warnings, *said), interrupted


def form_of_record() -> Any:
    """The form of a simulation in its record, see `SimulatedSet`."""
    from fpsolve.simulation import MonteCarlo, Response  # 460 ms

    return tuple[MonteCarlo, Response | None, tuple[Message, ...], bool]


def simulation_key(parameter_set: ParameterSet, orders: Sequence[float], setting: MonteCarloSection) -> str:
    """What the record of a parameter set is found by."""
    return key_of(parameter_set.digest, list(orders), setting.model_dump(mode="json"))


def is_finished(found: Simulation) -> bool:
    """Whether a simulation was not stopped early, so that it is recorded."""
    *_, interrupted = found
    return not interrupted
