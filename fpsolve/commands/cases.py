"""What can be done with a case: run it, which solves its sets, writes files and then draws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic

import numpy as np

from fpsolve.arrays import require
from fpsolve.case.case import Case, load_case
from fpsolve.case.sections import RESPONSE
from fpsolve.commands.options import kept, of_sets, saying_if_interrupted
from fpsolve.commands.simulate import Simulations
from fpsolve.errors import FpsolveError, NotConverged, WorkersDied
from fpsolve.files import writable, write_bytes
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import MOMENT, SECONDS, STATUS
from fpsolve.pool import SERIAL, Pool, cluster, parallel
from fpsolve.results.csv_json import GROWING, TABLES, Content, Writer, facts_of
from fpsolve.results.eigenfunctions import FILES, write_sets
from fpsolve.results.folders import own_folder
from fpsolve.results.known import Results, record_of
from fpsolve.results.simulate import SIMULATION, write_response
from fpsolve.results.table import COUNTS
from fpsolve.solve.question import Job, idle, refuse_mesh
from fpsolve.solve.questions import BY_NAME
from fpsolve.solve.records import Entries, Records
from fpsolve.solve.set_result import SetResult, Status
from fpsolve.solve.sets import attempt_set
from fpsolve.solve.simulate import refuse_obstacles
from fpsolve.tell import solved as told
from fpsolve.tell.notes import MONTE_CARLO, notes
from fpsolve.tell.progress import MOMENTS, SETS, SILENT, Advance, Phase, Watch
from fpsolve.tell.reports import shown_at_the_end, write_report
from fpsolve.tell.simulate import show as show_simulated

SOLVED_RECORDS = "records/solved.jsonl"
"""The file of the records of sets."""
REST = 50
"""Tables are rewritten when so many times as long has gone by as the last time took, so that all of it costs little."""


@dataclass(frozen=True, eq=False)
class Solved:
    """What becomes of a set, as any process can send it to that which writes.

    Attributes:
        record: what was solved now.
        files: the contents of its pictures, by their names in the folder of the case.
        interrupted: whether the work was.
    """

    record: Entries
    files: Mapping[str, bytes]
    interrupted: bool = False


def solved(job: Job) -> Solved:
    """The task: solves a set and draws its pictures; where it is interrupted, what is done by then."""
    try:
        attempt_set(job)
        return Solved(record_of(job), contents_of(job))
    except KeyboardInterrupt:
        return Solved(record_of(job), {}, interrupted=True)


def contents_of(job: Job) -> dict[str, bytes]:
    """The pictures of a set by their names, drawn in a folder of their own: a cluster may not have that of the case."""
    if not job.pictures:
        return {}
    with TemporaryDirectory() as place:
        folder = Path(place)
        for name, found in job.pictures.items():
            FILES[name](found, job.parameter_set, folder)
        files = (path for path in sorted(folder.rglob("*")) if path.is_file())
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


class Sweep:
    """All sets of a case on the way to being solved, of which an earlier run may have kept some.

    Args:
        case: whose sets these are.
        folder: where they are kept.
        is_fresh: whether to solve all of them again.

    Attributes:
        results: what is known of them.
        known: how many an earlier run had finished.
        facts: what the tables say of this run, as they were written the last time.
    """

    def __init__(self, case: Case, folder: Path, *, is_fresh: bool = False) -> None:
        self.case, self.folder, self.started = case, folder, datetime.now(UTC)
        self.results = Results(case, Records(folder / SOLVED_RECORDS, is_fresh=is_fresh))
        self.known, self._due = len(self.results), 0.0
        self.facts: Content = {}

    def run(self, pool: Pool, watch: Watch) -> None:
        """Solve the sets that are not known, and write all tables; an interrupt keeps what is solved, which it says."""
        case, results, each = self.case, self.results, 1
        phase = Phase(case.name, "solving", case.planned, SETS)
        if case.planned == 1:
            each = max(case.p.size if MOMENT.name in case.asked else 0, 1)
            phase = Phase(case.name, "solving", each, MOMENTS)

        def done() -> str:
            whole = len(results.whole)
            return kept(whole, of_sets(case), self.folder, is_more=len(results) > whole)

        with saying_if_interrupted(done), writable(self.folder):
            try:
                with watch.bar(phase) as progress:
                    self._solve(pool, progress, each)
            except (KeyboardInterrupt, WorkersDied):
                results.read(is_all=True)
                self._write_all()
                raise
            with watch.bar(Phase(case.name, "tables")):
                self._write_all()

    def _solve(self, pool: Pool, progress: Advance, steps: int) -> None:
        """Solve what is not known yet, and draw; tables are written first, if anything is missing, and as they grow.

        Args:
            steps: of the progress, for each set; a single one reports each p itself.
        """
        case, results = self.case, self.results
        if len(results.whole) < case.planned:
            self._write(GROWING)
        draws = [any(BY_NAME[name].draws for name in asked) for asked in results.asked]
        numbers = range(1, case.planned + 1)
        left = [number for number in numbers if draws[number > 1] or number not in results.whole]
        if len(left) < case.planned:
            progress((case.planned - len(left)) * steps, known=True)
        is_alone = case.planned == 1 and not pool.is_elsewhere
        jobs: Iterable[Job] = map(results.job, left)
        if is_alone:
            jobs = (replace(job, keep=self._grow, progress=progress) for job in jobs)
        with SERIAL if is_alone else pool as workers:
            try:
                for job, done in workers.run(solved, jobs):
                    is_failed = self._take(job, done)
                    if done.interrupted:
                        raise KeyboardInterrupt
                    progress(0 if is_alone and done.record else steps, failed=int(is_failed))
                    if done.record:
                        self._write_if_due()
            except (KeyboardInterrupt, WorkersDied):
                for job, done in workers.rest():
                    self._take(job, done)
                raise

    def _grow(self, job: Job) -> None:
        """Keep what is known of the only set, and show it in the tables; once it is solved, only pictures are drawn."""
        if job.parameter_set.number not in self.results.whole:
            self.results.put(job.parameter_set, record_of(job))
            self._write_if_due()

    def _take(self, job: Job, done: Solved) -> bool:
        """Keep what became of a set, and its pictures; whether it has failed."""
        is_failed = bool(done.record) and self.results.put(job.parameter_set, done.record).status.fails
        for name, content in done.files.items():
            write_bytes(self.folder / name, content)
        return is_failed

    def _write_if_due(self) -> None:
        if monotonic() >= self._due:
            self._write(GROWING)

    def _write(self, tables: dict[str, Writer]) -> None:
        """Write tables of all sets, the first one last."""
        started, self.facts = monotonic(), facts_of(self.case, self.started)
        for name, write in reversed(tables.items()):
            write(self.results, self.folder / name, self.facts)
        self._due = monotonic() + REST * (monotonic() - started)

    def _write_all(self) -> None:
        """Write all tables, the series over the parameter sets, and the files of what records hold."""
        self._write(TABLES)
        write_sets(self.case, self.folder)
        for result in self.results if RESPONSE in self.results.asked[0] else ():
            if result.response:
                write_response(result.response, result.parameter_set, self.folder)

    @property
    def failed(self) -> int:
        """How many sets have failed, also in part."""
        return int(np.isin(self.results.table[STATUS.name].values, [each for each in Status if each.fails]).sum())

    @property
    def is_empty(self) -> bool:
        """Whether numbers were asked for, and none was found."""
        columns = self.results.table.values()
        numbers = [each.values for each in columns if each.quantity not in (*COUNTS, STATUS, SECONDS)]
        return bool(numbers) and not any(np.isfinite(each).any() for each in numbers)


@dataclass(frozen=True, eq=False)
class Outcome:
    """The results of a case.

    Attributes:
        sweep: its sets, solved.
        simulations: its parameter sets, simulated; none where that was not asked for.
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
) -> tuple[SetResult, ...]:
    """Solve a case, write `out`/<name of the case>/, and return a result for each parameter set.

    A run does not repeat sets that an earlier run finished there. Each run rewrites all files, and removes those of a
    simulation of other parameters. `complete` in results.nc says whether all sets are there.

    >>> run("minimal.toml")  # a case of `fpsolve new minimal`
    (SetResult(converged, 3 p, λ = -1.4456...e-05 ± ...),)

    Args:
        case: a case file, or what `load_case` made of it.
        out: folder for the results.
        jobs: how many processes solve; None for one on each processor.
        scheduler: the address of a Dask scheduler whose workers solve instead, such as "tcp://host:8786".
        fresh: whether to solve all sets again.
        progress: called once for each set, or for each p of a single set.

    Raises:
        TypeError: an argument is of another type.
        CaseError: with every fault of the file; nothing is solved.
        OutputError: the folder cannot be made or written to, or another run writes into it; nothing is solved.
        NotConverged: some p or summary numbers failed; everything else is written, and `partial` holds it.
    """
    require(case, Case | str | Path, "case", "a case, or the path of its file")
    require(out, str | Path, "out", "the path of a folder")
    require(progress, Callable, "progress", "a function")
    read = case if isinstance(case, Case) else load_case(case)
    pool = cluster(scheduler) if scheduler else parallel(jobs)

    def advance(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
        for _ in range(count):
            progress()

    watch = Watch(bar=lambda phase: nullcontext(advance if phase.unit else idle))
    results = tuple(run_case(read, out, pool=pool, is_fresh=fresh, watch=watch).sweep.results)
    if reasons := tuple(failure.reason for each in results for failure in each.failures):
        raise NotConverged(Message(Code.SEVERAL, reasons=reasons), results)
    return results


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
        FpsolveError: a parameter set cannot be simulated, or only that; nothing is solved.
        KeyboardInterrupt: a parameter set was being solved, or nothing was simulated yet; its text says what is kept.
    """
    refuse_no_numbers(case, monte_carlo=monte_carlo)
    folder, simulations = Path(out) / case.name, Simulations(case)
    with own_folder(folder, "run", *["simulate"] * monte_carlo, case=case) as files_of:
        with writable(folder):
            sweep = Sweep(case, folder, is_fresh=is_fresh)
        sweep.run(pool, watch)
        results, simulated = sweep.results, simulations.simulated
        said = [*notes(case, results.telling, count=len(results))]

        def finish() -> None:
            with watch.bar(Phase(case.name, "figures")), writable(folder):
                told.write_figures(case, results, simulated, folder, results.table)
            blocks = chain(
                told.show(case, results, folder, simulated, results.table),
                show_simulated(case, simulated, results) if simulated else (),
                said,
                notes(case, simulated, MONTE_CARLO),
            )
            is_whole = len(results.whole) == case.planned and simulations.whole == case.planned * monte_carlo
            files = *(name for name in TABLES if (folder / name).exists()), *SIMULATION * bool(simulated)
            write_report(case, folder, watch, blocks, started=sweep.started, files=files, complete=is_whole)

        saying = saying_if_interrupted(lambda: f"; what was {'done' if simulated else 'solved'} is kept in {folder}")
        with saying, shown_at_the_end(finish):
            watch.shown(told.show(case, results, folder, (), results.table, is_whole=watch.is_whole))
            watch.noted(said)
            if monte_carlo:
                with files_of("simulate"):
                    simulations.run(folder, pool, watch, results, is_fresh=is_fresh)
    return Outcome(sweep, simulations)


def refuse_no_numbers(case: Case, *, monte_carlo: bool) -> None:
    """Refuse a case that can only be simulated, or cannot be where that is asked for. Raises `FpsolveError`."""
    if not case.method.is_computed and (refused := case.method.reason(0.0, "Λ(p)")):
        raise FpsolveError(f"{case.path}: {refused}")
    refuse_mesh(case)
    if monte_carlo:
        refuse_obstacles(case)
