"""The sets of a case: a pool solves them, each is kept as it is finished, and the tables are written as they grow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

import numpy as np

from fpsolve.case.case import Case
from fpsolve.case.sections import RESPONSE
from fpsolve.errors import WorkersDied
from fpsolve.files import atomic
from fpsolve.model.quantity import MOMENT, SECONDS, STATUS
from fpsolve.pool import SERIAL, Pool
from fpsolve.results.csv_json import GROWING, TABLES, Writer, facts_of
from fpsolve.results.eigenfunctions import FILES, write_curves
from fpsolve.results.known import Results, record_of
from fpsolve.results.response import write_response
from fpsolve.results.table import COUNTS
from fpsolve.solve.curve import Status
from fpsolve.solve.question import Job
from fpsolve.solve.questions import BY_NAME
from fpsolve.solve.records import Entries, Records
from fpsolve.solve.sets import solve_set
from fpsolve.tell.blocks import Note
from fpsolve.tell.notes import notes
from fpsolve.tell.progress import MOMENTS, SETS, Advance, Phase

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
        solve_set(job)
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
            FILES[name](found, job.curve, folder)
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
        failed: how many sets have failed, also in part, once the tables are written.
        fails: whether some have, or no number was found, then.
        notes: what is said of all sets, then.
    """

    failed = 0
    fails = False
    notes: tuple[Note, ...] = ()

    def __init__(self, case: Case, folder: Path, *, is_fresh: bool = False) -> None:
        self.case, self.folder = case, folder.resolve()
        self.started = datetime.now(UTC)
        self.results = Results(case, Records(self.folder / SOLVED_RECORDS, is_fresh=is_fresh))
        self.facts, self._due, self.known = dict[str, Any](), 0.0, len(self.results)
        self._steps_each = max(case.p.size if MOMENT.name in case.asked else 0, 1) if case.planned == 1 else 1

    @property
    def phase(self) -> Phase:
        """What `solve` reports as progress: each set, of a single one each p."""
        if self.case.planned > 1:
            return Phase(self.case.name, "solving", self.case.planned, SETS)
        return Phase(self.case.name, "solving", self._steps_each, MOMENTS)

    @property
    def done(self) -> int:
        """How many sets are finished."""
        return len(self.results.whole)

    def _grow(self, job: Job) -> None:
        """Keep what is known of the only set, and show it in the tables; once it is solved, only pictures are drawn."""
        if job.curve.number not in self.results.whole:
            self.results.put(job.curve, record_of(job))
            self._write_if_due()

    def solve(self, pool: Pool, progress: Advance) -> None:
        """Solve what is not known yet, and draw; tables are written first, if anything is missing, and as they grow."""
        if self.done < self.case.planned:
            self.write_tables()
        draws = [any(BY_NAME[name].draws for name in asked) for asked in self.results.asked]
        numbers = range(1, self.case.planned + 1)
        left = [number for number in numbers if draws[number > 1] or number not in self.results.whole]
        if len(left) < self.case.planned:
            progress((self.case.planned - len(left)) * self._steps_each, known=True)
        is_alone = self.case.planned == 1 and not pool.is_elsewhere
        jobs: Iterable[Job] = map(self.results.job, left)
        if is_alone:
            jobs = (replace(job, keep=self._grow, progress=progress) for job in jobs)
        with SERIAL if is_alone else pool as workers:
            try:
                for job, each in workers.run(solved, jobs):
                    is_failed = self._take(job, each)
                    if each.interrupted:
                        raise KeyboardInterrupt
                    progress(0 if is_alone and each.record else self._steps_each, failed=int(is_failed))
                    if each.record:
                        self._write_if_due()
            except (KeyboardInterrupt, WorkersDied):
                for job, each in workers.rest():
                    self._take(job, each)
                raise

    def _take(self, job: Job, each: Solved) -> bool:
        """Keep what became of a set, and its pictures; whether it has failed."""
        is_failed = bool(each.record) and self.results.put(job.curve, each.record).status.fails
        for name, content in each.files.items():
            with atomic(self.folder / name) as draft:
                draft.write_bytes(content)
        return is_failed

    def _write_if_due(self) -> None:
        if monotonic() >= self._due:
            self.write_tables()

    def write_tables(self, tables: dict[str, Writer] = GROWING) -> None:
        """Write tables of all sets, the first one last."""
        started, self.facts = monotonic(), facts_of(self.case, self.started)
        for name, write in reversed(tables.items()):
            write(self.results, self.folder / name, self.facts)
        self._due = monotonic() + REST * (monotonic() - started)

    def write_all(self) -> None:
        """Write all tables, the series over the curves, and the files of what records hold."""
        self.write_tables(TABLES)
        write_curves(self.case, self.folder)
        for result in self.results if RESPONSE in self.results.asked[0] else ():
            if result.response:
                write_response(result.response, result.curve, self.folder)
        table = self.results.table
        numbers = [each.values for each in table.values() if each.quantity not in (*COUNTS, STATUS, SECONDS)]
        is_empty = bool(numbers) and not any(np.isfinite(each).any() for each in numbers)
        self.failed = int(np.isin(table[STATUS.name].values, [each for each in Status if each.fails]).sum())
        self.fails = is_empty or self.failed > 0
        self.notes = tuple(notes(self.case, self.results.telling, count=len(self.results)))
