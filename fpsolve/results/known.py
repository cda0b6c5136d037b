"""What is known of the parameter sets of a case: their records become results, and their work becomes records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from fpsolve.case.case import Case, ParameterSet
from fpsolve.model.quantity import STATUS
from fpsolve.results.table import Table
from fpsolve.solve.discretisation import QUESTION as DISCRETISATION
from fpsolve.solve.discretisation import largest_of
from fpsolve.solve.moments import QUESTION as MOMENTS
from fpsolve.solve.question import Asked, Job, Numerics
from fpsolve.solve.questions import BY_NAME
from fpsolve.solve.records import Entries, Records, key_of, made, plain
from fpsolve.solve.set_result import SetResult
from fpsolve.solve.sets import everything, result_of

ROW = "row"
"""What the entries of Λ(p) are called, before their p: a row of `Job.rows`, and the budget in which it was found."""


def names_of(asked: Asked, numerics: Numerics) -> dict[str, str]:
    """What the entries of a set are called in its records: by a digest of all that their numbers follow from.

    A budget is none of this: a number is the same under any.
    """
    solver = numerics.rtol, numerics.mesh and vars(numerics.mesh)
    of_row = {name: each for name, each in asked[MOMENTS.name].items() if name != "p"}
    return {name: f"{name}-{key_of(each, *solver)[:16]}" for name, each in {**asked, ROW: of_row}.items()}


def record_of(job: Job) -> Entries:
    """The entries of what was solved now of a set, and of each p."""
    names = names_of(job.asked, job.numerics)
    record = Entries({names[name]: plain(BY_NAME[name].entry, each) for name, each in job.new.items()})
    moments = job.new.get(MOMENTS.name)
    if moments or MOMENTS.name not in job.entries:
        limit = moments.limit if moments else job.numerics.limit
        asked = job.asked[MOMENTS.name]["p"]
        record |= {f"{names[ROW]} {p!r}": (job.rows[p], limit) for p in asked if p in job.rows}
    if record and DISCRETISATION.name not in job.entries and "solver" in vars(job) and (largest := largest_of(job)):
        record[f"{names[MOMENTS.name]} largest"] = largest
    return record


def read_into(job: Job, record: Entries, names: Mapping[str, str], *, is_all: bool = False) -> Job:
    """Give a job what its record has of what is asked: what is settled, or all; what cannot be read is not there."""
    for name in job.asked:
        with suppress(ValueError, KeyError):
            entry = made(BY_NAME[name].entry, record[names[name]])
            if is_all or job.numerics.settles(entry.limit):
                job.entries[name] = entry
    with suppress(ValueError, KeyError):
        p, facts = record[f"{names[MOMENTS.name]} largest"]
        job.largest = p, facts
    for p in job.asked[MOMENTS.name]["p"]:
        with suppress(ValueError, KeyError):
            row, limit = record[f"{names[ROW]} {p!r}"]
            if is_all or job.numerics.settles(limit):
                job.rows[p] = row
    return job


class Results(Sequence[SetResult]):
    """What is known of the parameter sets of a case, in their order; each is made of its records when it is looked at.

    Args:
        case: whose parameter sets these are.
        records: those of its folder.

    Attributes:
        case: the same.
        asked: what is asked of the first parameter set, and of each other one.
        table: the numbers and messages of all that are known.
        whole: the numbers of the parameter sets of which all is known that is asked for.
    """

    def __init__(self, case: Case, records: Records) -> None:
        self.case, self._records, self._numerics = case, records, Numerics.of(case)
        self.asked = everything(case, 1), everything(case, 2)
        self._names = [names_of(each, self._numerics) for each in self.asked]
        self.table, self.whole = Table(case), set[int]()
        self.read()

    def job(self, number: int, *, is_all: bool = False) -> Job:
        """The work on the set with a number, with what is known of it; or also with what is to be sought again."""
        vary, place = self.case.vary, number > 1
        parameter_set = ParameterSet(self.case.problem, vary.sets[number - 1], number)
        job = Job(parameter_set, self.asked[place], self._numerics, vary.line_of(number))
        return read_into(job, self._records.get(parameter_set.digest), self._names[place], is_all=is_all)

    def add(self, job: Job) -> SetResult:
        """Take what is known of a parameter set into the table."""
        number, result = job.parameter_set.number, result_of(job)
        if job.is_whole:
            self.whole.add(number)
        self.table.put(result)
        return result

    def put(self, parameter_set: ParameterSet, record: Entries) -> SetResult:
        """Keep what was solved of a parameter set."""
        self._records.put(parameter_set.digest, record)
        return self.add(self.job(parameter_set.number, is_all=True))

    def read(self, *, is_all: bool = False) -> None:
        """Take in what records hold of the sets that are finished, or of all."""
        left = {*range(1, self.case.planned + 1)}.difference(self.numbers) if self._records else ()
        for number in sorted(left):
            job = self.job(number, is_all=is_all)
            if job.is_whole or (is_all and (job.entries or job.rows)):
                self.add(job)

    @property
    def numbers(self) -> list[int]:
        """Those of the parameter sets of which anything is known."""
        return (1 + np.flatnonzero(np.isfinite(self.table[STATUS.name].values))).tolist()

    @property
    def telling(self) -> Iterator[SetResult]:
        """Those of which something is said."""
        return (self.of(number) for number in self.numbers if self.table.messages[number - 1])

    def of(self, number: int) -> SetResult:
        """That of the parameter set with a number."""
        return result_of(self.job(number, is_all=True))

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[SetResult]:
        return map(self.of, self.numbers)

    def __getitem__(self, index: Any) -> Any:
        numbers = self.numbers[index]
        return [*map(self.of, numbers)] if isinstance(index, slice) else self.of(numbers)
