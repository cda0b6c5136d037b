"""The sets of a case: a pool solves them, each is kept as it is finished, and the tables are written as they grow."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import Varied
from fpsolve.model.quantity import MOMENT, STATUS
from fpsolve.output.datasets import write_dataset
from fpsolve.output.records import (
    SOLVED_RECORDS,
    Address,
    Records,
    Results,
    append,
    begun_record,
    record_of_set,
    set_key,
)
from fpsolve.output.tables import facts_of, write_results
from fpsolve.page.page import Note
from fpsolve.parts.eigenfunctions import write_curves
from fpsolve.parts.every import BY_NAME, PARTS
from fpsolve.parts.moments import PART as OF_P
from fpsolve.parts.part import Job, Numerics
from fpsolve.pool import Pool, serial
from fpsolve.results.curve import CurveResult, Status
from fpsolve.results.table import Table
from fpsolve.show.notes import notes
from fpsolve.study.solve import Order, Solved, batches, result_of, solve_batch
from fpsolve.workflow.progress import MOMENTS, SETS, Advance, Phase

Found = tuple[int, Address | CurveResult | None, bool]
"""The number of a curve, its numbers where they are new, and whether some of these are missing."""
TABLES = "summary.json", "curves.csv", "moments.csv", "results.nc"
"""The files with all numbers of a run."""
REST = 50
"""Tables are rewritten when so many times as long has gone by as the last time took, so that all of it costs little."""


def keep(folder: Path, numerics: Numerics, order: Order, curve: Curve, solved: Solved) -> Found:
    """Write what was found of a set into the folder of its case, and say where the numbers are."""
    for name, found in solved.pictures.items():
        if draw := BY_NAME[name].draw:
            draw(found, curve, folder)
    if not solved.entries and order.entries:  # its numbers were known
        return curve.number, None, False
    is_failed = solved.result.status.fails
    record = record_of_set(curve, order.asked, numerics, solved.entries)
    place = append(folder / SOLVED_RECORDS, set_key(curve), record) if record else None
    is_whole = place is not None and len(record) == len(solved.entries)
    return curve.number, place if is_whole else solved.result, is_failed


def grow(folder: Path, numerics: Numerics, order: Order, job: Job) -> None:
    """Write what is known of a set that is not finished."""
    new = {name: entry for name, entry in job.entries.items() if name not in order.entries}
    record = record_of_set(job.curve, order.asked, numerics, new)
    if OF_P.name not in job.entries and job.begun:
        record |= begun_record(job)
    if record:
        append(folder / SOLVED_RECORDS, set_key(job.curve), record)


class Sweep:
    """All sets of a case on the way to being solved, of which an earlier run may have kept some.

    Args:
        case: whose sets these are.
        folder: where they are kept.
        is_fresh: whether to solve all of them again.

    Attributes:
        failed: how many sets have failed, also in part, once the tables are written.
        notes: what is said of all sets, then.
    """

    failed = 0
    notes: tuple[Note, ...] = ()

    def __init__(self, case: Case, folder: Path, *, is_fresh: bool = False) -> None:
        self.case, self.folder = case, folder.resolve()
        self.records = Records(self.folder / SOLVED_RECORDS)
        if is_fresh:
            self.records.remove()
        self.started, self._clock = datetime.now(UTC), monotonic()
        self.numerics = Numerics.of(case)
        self.results, self.facts = Results(case, self.records, self.numerics), dict[str, Any]()
        self._due, self._unfinished = 0.0, set[int]()
        self._are_drawn = [any(BY_NAME[name].is_drawn for name in self.results.asked(number)) for number in (1, 2)]
        self._steps_each = max(case.p.size if MOMENT.name in case.asked else 0, 1) if case.planned == 1 else 1
        self._settled = 0
        self.find()
        self.known = len(self.results)

    @property
    def phase(self) -> Phase:
        """What `solve` reports as progress: each set, of a single one each p."""
        if self.case.planned > 1:
            return Phase(self.case.name, "solving", self.case.planned, SETS)
        return Phase(self.case.name, "solving", self._steps_each, MOMENTS)

    @property
    def done(self) -> int:
        """How many sets are finished."""
        return len(self.results) - len(self._unfinished)

    def find(self) -> None:
        """Look for the records of all sets, also those that a worker has finished without reporting them."""
        for curve in self.case.curves() if self.records.look().are_there else ():
            if self.results.find(curve):
                self._unfinished.discard(curve.number)
                self._settled += not self._is_drawn(curve.number)

    def find_unfinished(self) -> None:
        """Count what is known of the sets that were being solved."""
        for number in range(1, self.case.planned + 1):
            if self.results.is_begun(number) and not self.results.has(number):
                self._unfinished.add(number)
                self.results.add(number)

    def _grow(self, order: Order, job: Job) -> None:
        """Keep what is known of the only set, and show it in the tables; once it is solved, only pictures are drawn."""
        if self.results.has(1) and not self._unfinished:
            return
        grow(self.folder, self.numerics, order, job)
        self._unfinished.add(1)
        self.results.add(1, result_of(job.curve, order.asked, self.numerics, job.entries, job.begun))
        if monotonic() >= self._due:
            self.write_tables()

    def solve(self, pool: Pool, progress: Advance) -> None:
        """Solve what is not known yet; tables are written first, where anything is missing, and as they grow."""
        if self.done < self.case.planned:
            self.write_tables()
        is_alone = self.case.planned == 1 and not pool.is_elsewhere
        if self._settled:
            progress(self._settled * self._steps_each, known=True)
        kept = partial(keep, self.folder, self.numerics)
        growing = self._grow if is_alone else partial(grow, self.folder, self.numerics)
        task = partial(solve_batch, problem=self.case.problem, numerics=self.numerics, keep=kept, grow=growing)
        if is_alone:
            task = partial(task, progress=progress)
        with serial() if is_alone else pool as workers:
            for _, solved in workers.run(task, batches(self.case, self._order)):
                are_new = any(found is not None for _, found, _ in solved)
                for number, found, is_failed in solved:
                    if isinstance(found, Address):
                        self.records.expect(found)
                    if found is not None:
                        self._unfinished.discard(number)
                        self.results.add(number, found)
                    is_reported = is_alone and not self.known  # p by p
                    progress(0 if is_reported else self._steps_each, failed=int(is_failed))
                if are_new and monotonic() >= self._due:
                    self.write_tables()

    def write_tables(self) -> Table:
        """Write summary.json, moments.csv and curves.csv; return their numbers."""
        started, self.facts = monotonic(), facts_of(self.case, self.started, monotonic() - self._clock)
        results, table = self.results, self.results.table
        write_results(self.case, results, self.folder, self.facts, self.done, table, results.says)
        self._due = monotonic() + REST * (monotonic() - started)
        return table

    def write_all(self) -> None:
        """Write the tables, results.nc, the series over the curves, and the files of parts."""
        table = self.write_tables()
        write_curves(self.case, self.folder)
        writers = [part.files for part in PARTS if part.files and part.name in self.results.asked(1)]
        for result in self.results if writers else ():
            for write in writers:
                write(result, self.folder)
        write_dataset(self.case, table, self.folder, self.facts)
        self.failed = int(np.isin(table[STATUS.name].values, [each for each in Status if each.fails]).sum())
        self.notes = tuple(notes(self.case, self.results.telling, count=len(self.results)))

    def _is_drawn(self, number: int) -> bool:
        """Whether pictures of a set are wanted, which are drawn in each run."""
        return self._are_drawn[number > 1]

    def _order(self, number: int, varied: Varied) -> Order | None:
        is_known = self.results.has(number)
        if is_known and not self._is_drawn(number):
            return None
        order = Order(number, varied, self.results.asked(number), self.case.vary.line_of(number))
        if not (is_known or self.results.is_begun(number)):
            return order
        [curve] = self.case.curves(number - 1, number)
        entries, begun = self.results.entries(curve)
        return replace(order, entries=entries, begun=begun)
