"""What can be done with a case: run it, which writes files and then draws."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from fpsolve.case.case import Case, load_case
from fpsolve.commands.interrupts import kept, of_curves, saying_if_interrupted
from fpsolve.commands.simulate import Simulations
from fpsolve.commands.sweep import Sweep
from fpsolve.errors import FpsolveError, NotConverged, WorkersDied
from fpsolve.files import writable
from fpsolve.messages import Code, Message
from fpsolve.pool import SERIAL, Pool, cluster, parallel
from fpsolve.results.csv_json import TABLES
from fpsolve.results.folders import SIMULATED, SOLVED, own_folder
from fpsolve.results.simulate import SIMULATION
from fpsolve.signals import signals_held
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.question import refuse_mesh
from fpsolve.solve.simulate import refuse_obstacles
from fpsolve.tell import solved as results
from fpsolve.tell.notes import MONTE_CARLO, notes
from fpsolve.tell.progress import SILENT, Phase, Watch, ignore
from fpsolve.tell.reports import shown_at_the_end, write_report
from fpsolve.tell.simulate import show as show_simulated


@dataclass(frozen=True, eq=False)
class Outcome:
    """What was done with a case.

    Attributes:
        sweep: its sets, solved.
        simulations: its curves, simulated; none where that was not asked for.
    """

    sweep: Sweep
    simulations: Simulations


def run(
    case: Case | str | Path,
    out: str | Path = "results",
    *,
    jobs: int | None = 1,
    scheduler: str = "",
    fresh: bool = False,
    progress: Callable[[], None] = lambda: None,
) -> tuple[CurveResult, ...]:
    """Solve a case, write `out`/<name of the case>/, and return the results, one for each curve.

    Sets that an earlier run finished there, also one that was killed, are not solved again. Each run rewrites all
    files, and removes what a simulation of other parameters wrote. `complete` in results.nc says whether all
    curves are there.

    >>> run("minimal.toml")  # a case of `fpsolve new minimal`
    (CurveResult(converged, 3 p, λ = -1.4456...e-05 ± ...),)

    Args:
        case: a case file, or what `load_case` made of it.
        out: folder for the results.
        jobs: how many processes solve; None for one on each processor.
        scheduler: the address of a Dask scheduler whose workers solve instead, such as "tcp://host:8786".
        fresh: whether to solve all sets again.
        progress: called once for each curve that is done, or for each p of a case with a single curve.

    Raises:
        CaseError: with every fault of the file; nothing is solved.
        OutputError: the folder cannot be made or written to, or another run writes into it; nothing is solved.
        NotConverged: some p or indices failed; everything else is written, and `partial` holds it.
    """
    read = case if isinstance(case, Case) else load_case(case)
    pool = cluster(scheduler) if scheduler else parallel(jobs, read.planned)

    def advance(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
        for _ in range(count):
            progress()

    watch = Watch(bar=lambda phase: nullcontext(advance if phase.unit else ignore))
    solved = tuple(run_case(read, out, pool=pool, is_fresh=fresh, watch=watch).sweep.results)
    if reasons := tuple(failure.reason for each in solved for failure in each.failures):
        raise NotConverged(Message(Code.SEVERAL, reasons=reasons), solved)
    return solved


def run_case(
    case: Case,
    out: str | Path = "results",
    *,
    monte_carlo: bool = False,
    pool: Pool = SERIAL,
    is_fresh: bool = False,
    watch: Watch = SILENT,
) -> Outcome:
    """Solve a case, simulate it too if `monte_carlo` is true, and draw both in one figure.

    When the simulation is interrupted or fails, the figure shows what is done.

    Args:
        pool: who solves.
        is_fresh: whether to solve all sets again.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: a curve cannot be simulated, or only that; nothing is solved.
        KeyboardInterrupt: a curve was being solved, or nothing was simulated yet; its text says what is kept.
    """
    if not case.method.is_computed and (refused := case.method.reason(0.0, "Λ(p)")):
        raise FpsolveError(f"{case.path}: {refused}")
    refuse_mesh(case)
    if monte_carlo:
        refuse_obstacles(case)
    simulations = Simulations(case)
    simulated = simulations.simulated
    with own_folder(case, out, [SOLVED, *[SIMULATED] * monte_carlo]) as folder:
        sweep = _solve(case, folder, pool, watch, is_fresh=is_fresh)

        def show() -> None:
            with watch.bar(Phase(case.name, "figures")), writable(folder):
                results.write_figures(case, sweep.results, simulated, folder, sweep.results.table)
            if watch.has_report:
                is_whole = not simulations.interruption and len(simulated) == case.planned * monte_carlo
                blocks = chain(
                    results.show(case, sweep.results, folder, simulated, sweep.results.table),
                    show_simulated(case, simulated, sweep.results) if simulated else (),
                    sweep.notes,
                    notes(case, simulated, MONTE_CARLO),
                )
                files = *(name for name in TABLES if (folder / name).exists()), *SIMULATION * bool(simulated)
                is_whole &= sweep.done == case.planned
                write_report(case, folder, watch, blocks, started=sweep.started, files=files, complete=is_whole)

        told = saying_if_interrupted(lambda: f"; what was {'done' if simulated else 'solved'} is kept in {folder}")
        with told, shown_at_the_end(show):
            table = sweep.results.table
            watch.shown(results.show(case, sweep.results, folder, (), table, is_whole=watch.is_whole))
            watch.noted(sweep.notes)
            if monte_carlo:
                simulations.run(folder, pool, watch, sweep.results, is_fresh=is_fresh)
    return Outcome(sweep, simulations)


def _solve(case: Case, folder: Path, pool: Pool, watch: Watch, *, is_fresh: bool) -> Sweep:
    """Solve the sets of a case that are not known, and write all tables."""
    with saying_if_interrupted(lambda: " before the first curve"), writable(folder):
        sweep = Sweep(case, folder, is_fresh=is_fresh)
    with (
        saying_if_interrupted(
            lambda: kept(sweep.done, of_curves(case), folder, is_more=len(sweep.results) > sweep.done)
        ),
        writable(folder),
    ):
        try:
            with watch.bar(sweep.phase) as progress:
                sweep.solve(pool, progress)
        except (KeyboardInterrupt, WorkersDied):
            sweep.results.read(is_all=True)
            sweep.write_all()
            raise
        with watch.bar(Phase(case.name, "tables")), signals_held():
            sweep.write_all()
    return sweep
