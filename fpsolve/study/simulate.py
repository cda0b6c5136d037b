"""Simulating the curves of a case, and writing what was found."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fpsolve import __version__
from fpsolve.case.case import Case, Curve
from fpsolve.errors import FpsolveError, OutputError
from fpsolve.files import atomic, prepare_folder, write_json
from fpsolve.output.plots import write_response_figure
from fpsolve.simulation.setup import TICKS, obstacles

if TYPE_CHECKING:  # numba takes half a second to import
    from fpsolve.simulation.estimators import MonteCarlo
    from fpsolve.simulation.response import Response

SIGNIFICANT = 3.0
"""Standard errors by which λ must exceed 0 before a stationary response is sought."""
Progress = Callable[[], None]


@dataclass(frozen=True, eq=False)
class SimulatedCurve:
    """What the simulation of one parameter set found.

    Attributes:
        curve: the parameter set.
        result: λ and Λ(p) of the linear system.
        response: the stationary response of the nonlinear system; None where c₂ = c₃ = 0 or there is none.
        warnings: what limits these numbers.
    """

    curve: Curve
    result: MonteCarlo
    response: Response | None
    warnings: tuple[str, ...]

    @property
    def interrupted(self) -> bool:
        """Whether the simulation was stopped early."""
        return self.result.interrupted or (self.response is not None and self.response.interrupted)


def simulation_work(case: Case) -> int:
    """How often `simulate_case` reports progress."""
    return TICKS * sum(3 if _is_nonlinear(curve) else 1 for curve in case.curves())


def simulate_case(
    case: Case, out: str | Path = "results", *, progress: Progress = lambda: None
) -> tuple[tuple[SimulatedCurve, ...], bool]:
    """Simulate a case and write monte_carlo.json into `out`/<name of the case>/; further curves have a number.

    With c₂ or c₃ > 0 the stationary response is written too. An interrupt (Ctrl-C) ends the simulation, and what is
    done is estimated and written.

    Returns:
        The curves that were simulated, and whether an interrupt ended it.

    Raises:
        KeyboardInterrupt: nothing was done yet.
        FpsolveError: a curve cannot be simulated; nothing is written.
        OutputError: the folder cannot be made or written to.
    """
    refuse_obstacles(case)
    folder = Path(out) / case.name
    prepare_folder(folder)
    results: list[SimulatedCurve] = []
    written: set[Path] = set()
    is_interrupted = False
    try:
        for number, curve in enumerate(case.curves(), start=1):
            try:
                results.append(_simulate_curve(case, curve, progress))
            except KeyboardInterrupt:
                if not results:
                    raise
                is_interrupted = True
                break
            written |= _write(case, results[-1], "" if number == 1 else f"-{number}", folder)
            if is_interrupted := results[-1].interrupted:
                break
        _remove_stale(folder, written)
    except OSError as failure:
        raise OutputError(f"{failure.filename or folder} cannot be written: {failure.strerror}") from failure
    return tuple(results), is_interrupted


def refuse_obstacles(case: Case) -> None:
    """Refuse a case some curve of which cannot be simulated.

    Raises:
        FpsolveError: with the curve and the reason.
    """
    for curve in case.curves():
        found = obstacles(curve.oscillator, curve.noise, time=case.monte_carlo.time, step=case.monte_carlo.step)
        for name, sentence in found.items():
            place = f"with {curve.label}: " if curve.varied else ""
            raise FpsolveError(f"{case.path}: monte_carlo.{name}: {place}{sentence}")


def _simulate_curve(case: Case, curve: Curve, progress: Progress) -> SimulatedCurve:
    from fpsolve.simulation.estimators import simulate

    setting = case.monte_carlo
    result = simulate(
        curve.oscillator, curve.noise, [float(p) for p in case.simulated], estimator=setting.estimator,
        paths=setting.paths, time=setting.time, step=setting.step, seed=setting.seed, tick=progress,
    )  # fmt: skip
    if not _is_nonlinear(curve) or result.interrupted:
        return SimulatedCurve(curve, result, None, result.warnings)
    response, warnings = _respond(case, curve, result, progress)
    return SimulatedCurve(curve, result, response, (*result.warnings, *warnings))


def _respond(case: Case, curve: Curve, result: MonteCarlo, progress: Progress) -> tuple[Response | None, list[str]]:
    """The stationary response, or why there is none."""
    from fpsolve.simulation.response import stationary_response

    value, error = result.lyapunov_exponent, result.lyapunov_exponent_error
    if value <= SIGNIFICANT * error:
        for _ in range(2 * TICKS):
            progress()
        reason = "is not positive" if value <= 0 else f"is not {SIGNIFICANT:g} standard errors above 0"
        return None, [
            f"no stationary response: λ = {value:.3g} ± {error:.1e} {reason}, "
            "and with λ < 0 almost every path comes to rest"
        ]
    try:
        response = stationary_response(
            curve.oscillator, curve.noise, value, result.variance_rate, paths=max(result.paths // 8, 32),
            time=result.time, step=result.step, seed=result.seed, tick=progress,
        )  # fmt: skip
    except KeyboardInterrupt:
        return None, ["no stationary response: stopped before it was reached"]
    warnings = [f"the response was stopped early, after {response.time:.3g}"] if response.interrupted else []
    return response, warnings


def _is_nonlinear(curve: Curve) -> bool:
    return curve.oscillator.c2 > 0 or curve.oscillator.c3 > 0


def _write(case: Case, simulated: SimulatedCurve, suffix: str, folder: Path) -> set[Path]:
    """The files of one curve, which are returned."""
    result, response = simulated.result, simulated.response
    summary = {
        "case": case.name,
        "title": case.title,
        "fpsolve_version": __version__,
        "parameters": dict(simulated.curve.parameters),
        "varied": dict(simulated.curve.varied),
        "estimates": [asdict(estimate) for estimate in result.estimates],
        "lyapunov_exponent": {
            "value": result.lyapunov_exponent,
            "standard_error": result.lyapunov_exponent_error,
        },
        "variance_rate": {"value": result.variance_rate, "standard_error": result.variance_rate_error},
        "paths": result.paths,
        "time": result.time,
        "step": result.step,
        "seed": result.seed,
        "impacts": result.impacts,
        "response": None if response is None else _response_summary(response),
        "warnings": list(simulated.warnings),
    }
    paths = [folder / f"monte_carlo{suffix}.json"]
    write_json(paths[0], summary)
    if response is not None:
        paths += _write_response(case, simulated, response, suffix, folder)
    return set(paths)


def _response_summary(response: Response) -> dict[str, Any]:
    return {
        "means": {name: {"value": value, "standard_error": error} for name, (value, error) in response.means.items()},
        "impact_rate": response.impact_rate,
        "outside": response.outside,
        "time": response.time,
    }


def _write_response(case: Case, simulated: SimulatedCurve, response: Response, suffix: str, folder: Path) -> list[Path]:
    """The histograms: a table, a picture in two formats, and a grid for ParaView."""
    from fpsolve.output.vtk import write_response

    table, grid = folder / f"response{suffix}.csv", folder / f"response{suffix}.vti"
    pictures = [folder / f"response{suffix}.png", folder / f"response{suffix}.pdf"]
    with atomic(table) as path, path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["amplitude_from", "amplitude_to", "density", "standard_error"])
        edges = response.amplitude_edges
        rows.writerows(
            map(float, row)
            for row in zip(edges, edges[1:], response.amplitude_density, response.amplitude_error, strict=False)
        )
    write_response(grid, response.x_edges, response.v_edges, response.density)
    write_response_figure(
        response.x_edges, response.v_edges, response.density, response.amplitude_edges, response.amplitude_density,
        response.amplitude_error, case.heading(simulated.curve), pictures,
    )  # fmt: skip
    return [table, grid, *pictures]


def _remove_stale(folder: Path, written: set[Path]) -> None:
    """What an earlier simulation left for curves that are no more."""
    ours = re.compile(r"(monte_carlo(-\d+)?\.json|response(-\d+)?\.(csv|vti|png|pdf))")
    for path in set(folder.iterdir()) - written:
        if ours.fullmatch(path.name):
            path.unlink()
