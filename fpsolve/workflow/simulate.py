"""Simulations of the curves of a case: their estimates, records, files, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fpsolve.analysis.target import said
from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import MonteCarloSection
from fpsolve.drawing import Format, figure_for
from fpsolve.errors import FpsolveError
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, MOMENT
from fpsolve.files import writable, write_csv, write_json
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import OF_STOPS
from fpsolve.output.records import Records, answered, key_of
from fpsolve.output.tables import head, in_case_words, parameters_of
from fpsolve.page.limits import EACH, PICTURES
from fpsolve.page.page import Block, Column, Drawing, Grid, Sentence, filled
from fpsolve.parts.question import idle
from fpsolve.pool import SERIAL, Pool, processors
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.results.text import fate, sampled, sign_of, units_in_words
from fpsolve.show.curves import Shown, grid_of
from fpsolve.show.notes import MONTE_CARLO, notes
from fpsolve.simulation.setup import PROGRESS_STEPS, obstacles, simulated_parts
from fpsolve.vtk import field_data, pyvista_module, write_vtk
from fpsolve.workflow.folders import AGAIN, SIMULATED, kept, of_curves, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import PERCENT, SILENT, Phase, Watch
from fpsolve.workflow.reports import write_report

if TYPE_CHECKING:
    from fpsolve.simulation import MonteCarlo, Response

Simulation: TypeAlias = "tuple[MonteCarlo, Response | None, tuple[Message, ...], bool]"
"""What a simulation finds, see `SimulatedCurve`."""
RECORDS = "records/simulated.jsonl"
"""The file of the records of simulations."""
SIMULATION = ("monte_carlo.json",)
"""The file with all numbers of a simulation."""
SIGNIFICANT = 3.0
"""Standard errors by which λ must exceed 0 before a stationary response is sought."""
SURE = 3
"""Standard errors from 0 at which a simulated sign is told."""
COMPARED = Column("finite elements", 2), Column("s.e. away", 1)
"""The columns of what finite elements have found."""


def simulation_steps(curve: Curve) -> int:
    """How often the simulation of a curve reports progress."""
    return PROGRESS_STEPS * (3 if curve.problem.linear.cubic else 1)


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
        except (FpsolveError, ValueError) as failure:
            raise FpsolveError(f"{case.path}: {place}{said(failure)}") from None
        found = obstacles(*parts, time=case.monte_carlo.time, step=case.monte_carlo.step)
        for name, sentence in found.items():
            raise FpsolveError(f"{case.path}: monte_carlo.{name}: {place}{sentence}")


def simulate_curve(
    curve: Curve, orders: Sequence[float], setting: MonteCarloSection, progress: Callable[[], None] = idle
) -> SimulatedCurve:
    """Simulate one curve, see `simulation_of`."""
    return SimulatedCurve(curve, *simulation_of(curve, orders, setting, progress))


def simulation_of(
    curve: Curve, orders: Sequence[float], setting: MonteCarloSection, progress: Callable[[], None]
) -> Simulation:
    """Simulate one curve, and with terms of degree 3 its stationary response; a task that pickles small.

    Args:
        curve: the parameters.
        orders: p of the moments.
        setting: [monte_carlo] of the case, whose p are not used.
        progress: called as often as `simulation_steps` says; a task for another process has none.

    Raises:
        KeyboardInterrupt: nothing was done yet.
        FpsolveError: as `simulate`.
    """
    from fpsolve.simulation.estimators import simulate

    result = simulate(
        curve.problem, orders, estimator=setting.estimator,
        paths=setting.paths, time=setting.time, step=setting.step, seed=setting.seed, progress=progress,
    )  # fmt: skip
    if not curve.problem.linear.cubic or result.interrupted:
        return result, None, result.warnings, result.interrupted
    from fpsolve.simulation.response import no_simulation, simulated_response

    def telling(message: Message, response: Response | None = None, *, interrupted: bool = True) -> Simulation:
        return result, response, (*result.warnings, message), interrupted

    value, error = result.lyapunov_exponent, result.lyapunov_exponent_error
    at_rest = Message(Code.AT_REST, value=value, error=error, most=SIGNIFICANT if value > 0 else None)
    if reason := at_rest if value <= SIGNIFICANT * error else no_simulation(curve.problem):
        for _ in range(2 * PROGRESS_STEPS):
            progress()
        return telling(reason, interrupted=False)
    try:
        response = simulated_response(
            curve.problem, value, result.variance_rate, paths=max(result.paths // 8, 32),
            time=result.time, step=result.step, seed=result.seed, progress=progress,
        )  # fmt: skip
    except KeyboardInterrupt:
        return telling(Message(Code.RESPONSE_NOT_REACHED))
    if response.interrupted:
        return telling(Message(Code.RESPONSE_STOPPED, time=response.time), response)
    return result, response, result.warnings, False


def form_of_record() -> Any:
    """The form of a simulation in its record, see `SimulatedCurve`."""
    from fpsolve.simulation import MonteCarlo, Response

    return tuple[MonteCarlo, Response | None, tuple[Message, ...], bool]


def simulation_key(curve: Curve, orders: Sequence[float], setting: MonteCarloSection) -> str:
    """What the record of a curve is found by."""
    return key_of(curve.digest, list(orders), setting.model_dump(mode="json"))


@dataclass(eq=False)
class Simulations:
    """The simulations of the curves of a case, of which an earlier run may have kept some.

    Attributes:
        case: whose curves these are.
        simulated: what is done, in the order of the curves.
        interruption: where an interrupt ended the simulation, what is kept, and how to go on; empty without interrupt.
        known: how many an earlier run had finished.
    """

    case: Case
    simulated: list[SimulatedCurve] = field(default_factory=list)
    interruption: str = ""
    known: int = 0

    def run(
        self, folder: Path, pool: Pool, watch: Watch, results: Sequence[CurveResult] = (), *, is_fresh: bool
    ) -> None:
        """Simulate the curves, write what is found of each, and show it.

        Args:
            folder: where they are written and kept.
            pool: whose other machines simulate; all processors of this one where there are none.
            results: what is solved of the same curves.
            is_fresh: whether to do all of them again.
        """
        case, is_elsewhere = self.case, pool.is_elsewhere
        asked: dict[str, Any] = {"orders": case.simulated.tolist(), "setting": case.monte_carlo}
        how: dict[str, Any] = {"kind": form_of_record(), "key": partial(simulation_key, **asked), "keeps": is_finished}
        work = Phase(case.name, "simulation", sum(map(simulation_steps, case.curves())), PERCENT)
        with watch.bar(work) as progress, writable(folder), pool if is_elsewhere else SERIAL as workers:
            records = Records(folder / RECORDS, is_fresh=is_fresh)
            task = partial(simulation_of, **asked, progress=idle if is_elsewhere else progress)
            try:
                for curve, found, is_known in answered(records, workers, task, case.curves(), **how):
                    if is_elsewhere or is_known:
                        progress(simulation_steps(curve), known=is_known)
                    self.known += is_known
                    self.simulated.append(SimulatedCurve(curve, *found))
                    write_simulation(case, self.simulated[-1], folder)
                    if not is_finished(found):
                        break
            except KeyboardInterrupt:
                if len(self.simulated) in (0, case.planned):  # nothing is found, or all, but not written
                    raise
        whole = len(self.simulated) - self.simulated[-1].interrupted
        if whole < case.planned:
            place = f"in the simulation of curve {whole + 1} of {case.planned}"
            self.interruption = f"interrupted {place}; what was done is kept in {folder}; {AGAIN}"
        watch.shown(show(case, self.simulated, results))
        watch.noted(notes(case, self.simulated, MONTE_CARLO))


def is_finished(found: Simulation) -> bool:
    """Whether a simulation was not stopped early, so that it is recorded."""
    *_, interrupted = found
    return not interrupted


def write_simulation(case: Case, simulated: SimulatedCurve, folder: Path) -> None:
    """monte_carlo.json of a curve, and where there is a response, monte_carlo_response.csv, .vti, .png and .pdf."""
    result, response = simulated.result, simulated.response
    content = {
        **head(case),
        **parameters_of(simulated.curve),
        "estimates": [asdict(estimate) for estimate in result.estimates],
        **_with_errors(simulated.estimates),
        **{name: getattr(result, name) for name in ("paths", "time", "step", "seed", "impacts")},
        "response": response
        and {
            "means": _with_errors(response.means),
            **({} if response.impact_rate is None else {"impact_rate": response.impact_rate}),
            **{name: getattr(response, name) for name in ("outside", "time")},
        },
        "warnings": in_case_words(simulated.warnings),
    }
    write_json(folder / f"monte_carlo{simulated.curve.suffix}.json", content)
    if response is not None:
        _write_response(simulated, response, folder)
        simulated_response_figure(case, simulated).write(folder)


def _with_errors(numbers: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {name: {"value": value, "standard_error": error} for name, (value, error) in numbers.items()}


def _write_response(simulated: SimulatedCurve, response: Response, folder: Path) -> None:
    """Write the density of the amplitude, and the joint density of x and ẋ as cell data `density` of a .vti file.

    Field data: `lyapunov_exponent` and its standard error, `lyapunov_exponent_error`, and the parameters as in
    `write_eigenfunctions`.
    """
    curve, found, edges = simulated.curve, simulated.result, response.amplitude_edges
    columns = (edges[:-1], edges[1:], response.amplitude_density, response.amplitude_error)
    rows = (map(float, row) for row in zip(*columns, strict=True))
    header = ["amplitude_from", "amplitude_to", "density", "standard_error"]
    write_csv(folder / f"monte_carlo_response{curve.suffix}.csv", header, rows)
    path, x, v = folder / f"monte_carlo_response{curve.suffix}.vti", response.x_edges, response.v_edges
    size, spacing = (x.size, v.size, 1), (x[1] - x[0], v[1] - v[0], 1.0)
    grid = pyvista_module().ImageData(dimensions=size, spacing=spacing, origin=(x[0], v[0], 0.0))
    grid.cell_data["density"] = response.density.ravel(order="F")
    known = {name: getattr(found, name) for name in ("lyapunov_exponent", "lyapunov_exponent_error")}
    parameters = {**curve.parameters, "curve": float(curve.number)}
    write_vtk(path, grid, {**known, **field_data(parameters, curve.varied, curve.problem)})


def simulated_response_figure(case: Case, simulated: SimulatedCurve) -> Drawing:
    """monte_carlo_response.png and .pdf of a curve, if it has a response."""
    curve = simulated.curve
    title, name = f"Simulated stationary response{curve.of}", f"monte_carlo_response{curve.suffix}"
    return Drawing(title, partial(_draw_response, simulated), name, case.headline)


def _draw_response(simulated: SimulatedCurve, paths: Sequence[Path], heading: str) -> None:
    """The density of (x, ẋ) and of the amplitude."""
    if simulated.response is None:
        return
    with figure_for(paths, heading, simulated.curve.held("time"), Format(width=10.5)) as figure:
        plane, radial = figure.subplots(1, 2)
        simulated.response.plot(plane)
        figure.get_layout_engine().set(wspace=0.1)
        simulated.response.plot_amplitude(radial)


def show(case: Case, simulated: Sequence[SimulatedCurve], results: Sequence[CurveResult] = ()) -> Iterator[Block]:
    """The simulated curves, one by one or a row each."""
    solved = {result.curve.number: result for result in results}
    is_short, over_p = len(simulated) <= EACH, case.figure.x == "p"
    if not (is_short and over_p):
        yield exponent_grid(case, simulated, solved)
        if not is_short:
            yield Sentence(f"{len(simulated)} curves; all numbers are in {MONTE_CARLO}, one for each curve")
    for each in simulated if is_short else ():
        result = solved.get(each.curve.number)
        yield Sentence("", case.heading(each.curve) if over_p else each.curve.label)
        found, unit = each.result, case.units.time
        if result is None:
            value, error = found.lyapunov_exponent, found.lyapunov_exponent_error
            meaning = fate("almost every path", value, sign_of(value, SURE * error), unit)
            yield Sentence(f"λ = {sampled(value, error)} ± {error:.1e}: {meaning}.")
        if over_p:
            yield moment_grid(case, each, result)
        yield number_grid(case, each, result)
        yield Sentence(f"{found.paths} paths over a time of {found.time:.4g} in steps of {found.step:.4g}")
        if each.response and each.curve.number <= PICTURES:
            yield simulated_response_figure(case, each)


def moment_grid(case: Case, simulated: SimulatedCurve, result: CurveResult | None) -> Grid:
    """p, Λ(p) and its standard error; where it is known the value by finite elements, and how far away it is."""
    is_direct = any(each.estimator == "direct" for each in simulated.result.estimates)
    effective = "effective windows" if is_direct else "effective paths"  # a path has many windows
    columns = [Column("p"), Column(MOMENT.symbol), Column("± s.e."), *COMPARED, Column(effective, 3)]
    exact = dict(zip(result.moments.p.tolist(), result.moments.value.tolist(), strict=True)) if result else {}
    rows = []
    for each in simulated.result.estimates:
        known = (exact.get(each.p) if each.p else 0.0) if result else None
        cells = _cells(each.value, each.standard_error, known)
        rows.append([f"{each.p:g}", *cells, f"{each.effective_paths:.0f}"])
    return filled("", columns, rows, units_in_words(case.units.time, [MOMENT]))


def number_grid(case: Case, simulated: SimulatedCurve, result: CurveResult | None) -> Grid:
    """λ, Λ″(0) and the means of a response with their standard errors, beside the finite elements."""
    known, estimates = {**INDICES, **OF_STOPS}, dict(result.estimates if result else {})
    numbers = [(known[name], each, estimates.get(name)) for name, each in simulated.estimates.items()]
    if response := simulated.response:
        means = result.response.means if result and result.response else {}
        numbers += [(response.about.means[name], each, means.get(name)) for name, each in response.means.items()]
    rows = [[about.words, about.symbol, *_cells(*each, found and found.value)] for about, each, found in numbers]
    columns = [Column("quantity", 3, is_text=True), Column("symbol"), Column("value"), Column("± s.e."), *COMPARED]
    units = units_in_words(case.units.time, [known[name] for name in simulated.estimates])
    return filled("", columns, rows, units)


def exponent_grid(case: Case, simulated: Sequence[SimulatedCurve], solved: Mapping[int, CurveResult]) -> Grid:
    """λ of each curve by both methods."""

    def cell(i: int, each: SimulatedCurve) -> str:
        result, found = solved.get(each.curve.number), each.result
        known = result.lyapunov_exponent.value if result and result.lyapunov_exponent else None
        return _cells(found.lyapunov_exponent, found.lyapunov_exponent_error, known)[i]

    columns = [Column(LYAPUNOV_EXPONENT.symbol), Column("± s.e."), *COMPARED]
    shown = [Shown(column, partial(cell, i)) for i, column in enumerate(columns)]
    shown[0] = shown[0]._replace(numbers=np.array([each.result.lyapunov_exponent for each in simulated]))
    return replace(grid_of(case, simulated, shown), remark=units_in_words(case.units.time, [LYAPUNOV_EXPONENT]))


def _cells(value: float | None, error: float | None, known: float | None) -> list[str]:
    """A number with its standard error; what is known of it, and how far away that is."""
    row = ["none", ""] if value is None or error is None else [sampled(value, error), f"{error:.1e}"]
    away = "" if known is None or value is None or not error else f"{(value - known) / error:+.1f}"
    return [*row, "" if known is None else f"{known:.6g}", away]


def simulate_case(
    case: Case,
    out: str | Path = "results",
    *,
    pool: Pool = SERIAL,
    is_fresh: bool = False,
    watch: Watch = SILENT,
) -> Simulations:
    """Simulate a case and write `out`/<name of the case>/monte_carlo.json, for further curves monte_carlo-2.json, ….

    Of a system with terms of degree 3 the stationary response is written too. What an earlier simulation wrote there is
    removed first, and a run with other parameters. An interrupt (Ctrl-C) ends the simulation; what is done is estimated
    and written, and curves that are finished are not simulated again the next time.

    Args:
        pool: whose other machines simulate, such as a `cluster`; all processors of this one where there are none.
        is_fresh: whether to simulate all curves again.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: a curve cannot be simulated; nothing is written.
        KeyboardInterrupt: nothing was done yet, which its text says.
    """
    refuse_obstacles(case)
    simulations, started = Simulations(case), datetime.now(UTC)
    with (
        own_folder(case, out, (SIMULATED,)) as folder,
        saying_if_interrupted(lambda: kept(len(simulations.simulated), of_curves(case), folder)),
    ):
        simulations.run(folder, pool, watch, is_fresh=is_fresh)
        simulated, is_whole = simulations.simulated, not simulations.interruption
        blocks = chain(show(case, simulated), notes(case, simulated, MONTE_CARLO))
        write_report(case, folder, watch, blocks, started=started, files=SIMULATION, complete=is_whole)
    return simulations
