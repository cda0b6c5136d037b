"""Running a case: its curves are solved, simulated or checked, written one after the other, and drawn in the end."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.errors import NotConverged
from fpsolve.files import TEMPORARY, alone, writable
from fpsolve.output.charts import draw_chart, write_chart
from fpsolve.output.figures import draw, draw_response, draw_sensitivities
from fpsolve.output.tables import write_results, write_simulation
from fpsolve.output.vtk import write_curve, write_response
from fpsolve.study.chart import Chart, chart_work, refuse_no_chart, solve_chart
from fpsolve.study.results import Comparison, CurveResult, SimulatedCurve
from fpsolve.study.simulate import refuse_obstacles, simulate_curves, simulation_work
from fpsolve.study.solve import compare, expected, solve_curves, solving_work

Progress = Callable[[], None]
AGAIN = "run it again to start over"
SOLVED, SIMULATED = (
    r"summary\.json|moments\.csv|(figure|sensitivities(-\d+)?)\.(png|pdf)|density\.vtu|show\.py"
    r"|eigenfunctions(-\d+)?(\.pvd|/p[+-][\d.e+-]+\.vtu)",
    r"monte_carlo(-\d+)?\.json|response(-\d+)?\.(csv|vti|png|pdf)",
)
"""The names of the files that a run writes, and of those of a simulation; and of a chart."""
CHART = r"chart\.(csv|json|png|pdf)"
_UNFINISHED = rf"(eigenfunctions(-\d+)?/)?{TEMPORARY}"


@dataclass(frozen=True)
class Watch:
    """Whom to tell how it goes; by default nobody.

    Attributes:
        bar: gives a stretch of work, from its name and how often it reports progress, None where nobody knows, what it
            shall call for that; a chart has two at a time.
        solved: takes a case and its curves once they are solved.
        simulated: takes a case, its simulated curves, and those that are solved too.
    """

    bar: Callable[[str, int | None], AbstractContextManager[Progress]] = lambda *_: nullcontext(lambda: None)
    solved: Callable[[Case, Sequence[CurveResult]], None] = lambda *_: None
    simulated: Callable[[Case, Sequence[SimulatedCurve], Sequence[CurveResult]], None] = lambda *_: None


NOBODY = Watch()


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a case.

    Attributes:
        results: its curves, solved; what did not converge is in their `failures`.
        simulated: its curves, simulated.
        interruption: where an interrupt ended the simulation, what is kept, and how to go on; empty where none came.
        comparisons: what it expects beside what was computed.
    """

    results: tuple[CurveResult, ...] = ()
    simulated: tuple[SimulatedCurve, ...] = ()
    interruption: str = ""
    comparisons: tuple[Comparison, ...] = ()

    @property
    def failures(self) -> tuple[str, ...]:
        """Why some p of some curves are missing."""
        return tuple(failure.reason for result in self.results for failure in result.failures)


def run(case: Case, out: str | Path = "results", *, progress: Progress = lambda: None) -> tuple[CurveResult, ...]:
    """Solve a case and write `out`/<name of the case>/.

    What an earlier run wrote there is removed first, and a simulation of other parameters. Tables are written anew
    after every curve, each file whole or not at all, so that what is finished stays; summary.json says whether all
    curves are.

    Args:
        case: from `load_case`.
        out: folder for the results.
        progress: called after each moment of each curve.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it; nothing is solved.
        NotConverged: some p failed; everything else is written, and `partial` holds it.
    """
    outcome = run_case(case, out, watch=Watch(bar=lambda *_: nullcontext(progress)))
    if outcome.failures:
        raise NotConverged("\n".join(outcome.failures), outcome.results)
    return outcome.results


def run_case(case: Case, out: str | Path = "results", *, monte_carlo: bool = False, watch: Watch = NOBODY) -> Outcome:
    """Solve a case, simulate it too if `monte_carlo` says so, and draw both in one figure.

    When the simulation is interrupted or fails, the figure shows what was done.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: a curve cannot be simulated; nothing is solved.
        KeyboardInterrupt: a curve was being solved, or nothing was simulated yet; its text says what is kept.
    """
    if monte_carlo:
        refuse_obstacles(case)
    simulated: list[SimulatedCurve] = []
    interruption = ""
    replaced = (SOLVED, SIMULATED) if monte_carlo else (SOLVED,)
    with _own_folder(case, out, replaced) as folder:
        results = _solve(case, folder, watch)
        with _saying_if_interrupted(lambda: f"; what was solved is kept in {folder}"):
            try:
                watch.solved(case, results)
                if monte_carlo:
                    interruption = _simulate(case, folder, watch, simulated)
                    watch.simulated(case, simulated, results)
            finally:
                with writable(folder):
                    draw(case, results, simulated, folder)
    return Outcome(results, tuple(simulated), interruption)


def simulate_case(case: Case, out: str | Path = "results", *, watch: Watch = NOBODY) -> Outcome:
    """Simulate a case and write monte_carlo.json into `out`/<name of the case>/; further curves have a number.

    What an earlier simulation wrote there is removed first, and a run with other parameters; with c₂ or c₃ > 0 the
    stationary response is written too.
    An interrupt (Ctrl-C) ends the simulation, and what is done is estimated and written.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: a curve cannot be simulated; nothing is written.
        KeyboardInterrupt: nothing was done yet, which its text says.
    """
    refuse_obstacles(case)
    simulated: list[SimulatedCurve] = []
    with (
        _own_folder(case, out, (SIMULATED,)) as folder,
        _saying_if_interrupted(lambda: _kept(case, simulated, folder)),
    ):
        interruption = _simulate(case, folder, watch, simulated)
        watch.simulated(case, simulated, ())
    return Outcome((), tuple(simulated), interruption)


def chart_case(case: Case, out: str | Path = "results", *, watch: Watch = NOBODY) -> Chart:
    """Trace the lines of the chart of a case, and write chart.csv, .json, .png and .pdf into `out`/<name of the case>/.

    Tables are written anew after every branch. What an earlier chart wrote there is removed first, and what was solved
    or simulated with other parameters.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: the case has no chart, or several curves; nothing is written.
        KeyboardInterrupt: its text says what is kept; the figure shows that.
    """
    refuse_no_chart(case)
    chart = Chart((), ())
    with (
        _own_folder(case, out, (CHART,)) as folder,
        _saying_if_interrupted(lambda: _kept_lines(case, chart, folder)),
        watch.bar(f"{case.name}, scan", chart_work(case)) as progress,
        watch.bar(f"{case.name}, points", None) as stepped,
        writable(folder),
    ):
        try:
            for chart in solve_chart(case, progress=progress, stepped=stepped):
                write_chart(case, chart, folder)
        finally:
            if chart.lines:
                draw_chart(case, chart, folder)
    return chart


def check_case(case: Case, *, watch: Watch = NOBODY) -> Outcome:
    """Solve what a case expects, and compare it; nothing is written."""
    with watch.bar(case.name, solving_work(case, expected)) as progress:
        results = tuple(result.without_pairs() for result in solve_curves(case, expected, progress=progress))
    return Outcome(results, comparisons=tuple(compare(case, results)))


def _solve(case: Case, folder: Path, watch: Watch) -> tuple[CurveResult, ...]:
    """Solve the curves of a case, and write after each."""
    results: list[CurveResult] = []
    with (
        _saying_if_interrupted(lambda: _kept(case, results, folder)),
        watch.bar(case.name, solving_work(case)) as progress,
        writable(folder),
    ):
        write_results(case, results, folder)
        for result in solve_curves(case, progress=progress):
            write_curve(result, folder)
            if case.output.sensitivities:
                draw_sensitivities(case, result, folder)
            write_results(case, [*results, result], folder)
            results.append(result.without_pairs())
    return tuple(results)


def _simulate(case: Case, folder: Path, watch: Watch, simulated: list[SimulatedCurve]) -> str:
    """Simulate the curves of a case into a list, and write each; what to say where an interrupt ended it."""
    with watch.bar(f"{case.name}, simulation", simulation_work(case)) as progress, writable(folder):
        for each in simulate_curves(case, progress=progress):
            simulated.append(each)
            write_simulation(case, each, folder)
            write_response(each, folder)
            draw_response(case, each, folder)
    whole = len(simulated) - simulated[-1].interrupted
    if whole == case.planned:
        return ""
    place = f"in the simulation of curve {whole + 1} of {case.planned}"
    return f"interrupted {place}; what was done is kept in {folder}; {AGAIN}"


@contextmanager
def _own_folder(case: Case, out: str | Path, replaced: Sequence[str]) -> Iterator[Path]:
    """The folder of a case, which other runs keep out of; nothing is in it that is replaced, or of other parameters."""
    folder = Path(out) / case.name
    with alone(folder):
        with writable(folder):
            stale = replaced if _agrees(case, folder) else (SOLVED, SIMULATED, CHART)
            _remove(folder, "|".join([*stale, _UNFINISHED]))
        yield folder


def _agrees(case: Case, folder: Path) -> bool:
    """Whether the tables in a folder are all of parameters that the case has."""
    tables = [*folder.glob("summary.json"), *folder.glob("monte_carlo*.json"), *folder.glob("chart.json")]
    known = [dict(curve.parameters) for curve in case.curves()] if tables else []
    try:
        contents = [json.loads(table.read_text(encoding="utf-8")) for table in tables]
        found = [curve["parameters"] for content in contents for curve in content.get("curves", [content])]
    except (ValueError, KeyError, TypeError, AttributeError):  # it is no table of ours
        return False
    return all(any(each.items() <= one.items() for one in known) for each in found)


@contextmanager
def _saying_if_interrupted(what_is_kept: Callable[[], str]) -> Iterator[None]:
    """An interrupt of the body says what is kept, and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted{what_is_kept()}; {AGAIN}") from None


def _kept(case: Case, done: Sequence[CurveResult] | Sequence[SimulatedCurve], folder: Path) -> str:
    """How many curves of a case are done, and where these are."""
    count = f" after {len(done)} of {case.planned} curve{'s' if case.planned > 1 else ''}"
    return f"{count}; what was done is kept in {folder}" if done else count


def _kept_lines(case: Case, chart: Chart, folder: Path) -> str:
    """How many branches of a chart are traced, and where these are."""
    count = sum(len(line.traces) for line in chart.lines)
    text = f" after {count} branch{'es' if count != 1 else ''} of {len(chart.closed_forms) or 'its'} lines"
    return f"{text}; what was done is kept in {folder}" if count else text


def _remove(folder: Path, names: str) -> None:
    """Remove files with names that match, in a folder and one below."""
    for path in {*folder.glob("*"), *folder.glob("*/*")}:
        if re.fullmatch(names, path.relative_to(folder).as_posix()) and not path.is_dir():
            path.unlink()
            if path.parent != folder and not any(path.parent.iterdir()):
                path.parent.rmdir()
