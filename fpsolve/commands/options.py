"""Options that several commands take, the loop of all commands on cases, and what is said where it is interrupted."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import quote
from time import monotonic
from types import MappingProxyType
from typing import Annotated, NamedTuple

from cyclopts import Parameter, Token

from fpsolve.case.case import Case, load_case
from fpsolve.commands.errors import print_error
from fpsolve.errors import CaseError, FpsolveError
from fpsolve.messages import Severity
from fpsolve.pool import Pool, cluster, limit_processors, parallel
from fpsolve.signals import INTERRUPTED, is_interrupt
from fpsolve.tell.progress import Bars, Watch
from fpsolve.tell.solved import last_line
from fpsolve.tell.terminal import print_blocks


def _whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts alone would take 2.5 for 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'got "{tokens[0].value}"; must be a whole number') from None


Count = Annotated[int, Parameter(converter=_whole)]
Cases = Annotated[list[Path], Parameter(help="Case files.", consume_multiple=True)]
Fresh = Annotated[bool, Parameter(help="Also solve or simulate again what an earlier run has finished.")]
SET = (
    "Another value for a key of the case, e.g. oscillator.omega=2.0 or system.zeta=0.1. Units: omega in rad/time, c1 "
    "in 1/time, D0 in 1/time, tau0 in time."
)


@Parameter(name="*")
@dataclass(frozen=True)
class Options:
    """Options of all commands on cases."""

    quiet: Annotated[
        bool,
        Parameter(
            help='Print only the last line, and on the standard error only errors and "not converged". Tables, notes '
            "and warnings are in the files."
        ),
    ] = False
    overrides: Annotated[list[str] | None, Parameter(name="--set", help=SET)] = None

    def load(self, paths: Sequence[Path], typed: Mapping[str, str] = MappingProxyType({})) -> list[Case]:
        """All cases. Raises one `FpsolveError` with the faults of all of them.

        Args:
            paths: their files.
            typed: more assignments, by how messages shall call them.
        """
        cases, errors = [], []
        for path in paths:
            try:
                cases.append(load_case(path, self.overrides or (), typed))
            except CaseError as error:
                is_there = os.path.exists(path)  # noqa: PTH110  (Path.exists raises where a name is too long)
                if is_there or not re.match(r'[\w."-]+ *=', str(path)):
                    errors.append(str(error))
                else:
                    words = " ".join(f"--set {quote(text)}" for text in [*(self.overrides or ()), str(path)])
                    errors.append(f"{path}: no such file; each --set takes one assignment: write {words}")
        if errors:
            raise FpsolveError("\n".join(errors))
        return cases

    def watch(self, *, is_json: bool = False) -> Watch:
        """Prints progress and results, with JSON no tables, or only failures."""
        if self.quiet:
            return Watch(noted=partial(print_blocks, severities=[Severity.FAILURE]), said=print_blocks)
        watch = Watch(Bars().bar, noted=print_blocks, said=print_blocks)
        return watch if is_json else replace(watch, shown=print_blocks)


@Parameter(name="*")
@dataclass(frozen=True)
class Workers:
    """Who works.

    Attributes:
        jobs: Number of processes; if omitted, the number of processors.
        scheduler: Address of a Dask scheduler whose workers do the work, e.g. tcp://host:8786.
    """

    jobs: Count | None = None
    scheduler: str = ""

    def pool(self) -> Pool:
        """The processes of this machine, or the workers of a cluster."""
        if self.jobs is not None and self.scheduler:
            raise FpsolveError("--jobs is for this machine, and --scheduler for a cluster; name one of them")
        pool = cluster(self.scheduler) if self.scheduler else parallel(self.jobs)
        if self.jobs is not None:
            limit_processors(self.jobs)
        return pool


OPTIONS, WORKERS = Options(), Workers()
"""As they are where none is stated."""


@Parameter(name="*")
@dataclass(frozen=True)
class Flags:
    """Options of commands that write files and reports.

    Attributes:
        out: Folder for the results.
        report: Also write a report: one page, .html, with all results and figures.
    """

    options: Options = OPTIONS
    workers: Workers = WORKERS
    out: Path = Path("results")
    report: bool = False

    def watch(self, *, is_json: bool = False, is_whole: bool = False) -> Watch:
        """See `Options.watch`."""
        return replace(self.options.watch(is_json=is_json), has_report=self.report, is_whole=is_whole)


FLAGS: Flags = Flags()
"""As they are where none is stated."""


class Done(NamedTuple):
    """What a command has done with a case.

    Attributes:
        what: is in the folder of its results now, for the last line; empty where none is printed.
        code: the exit code.
        known: how much of it an earlier run had done.
        interruption: where an interrupt has ended the work, and with it the command.
    """

    what: str = ""
    code: int = 0
    known: str = ""
    interruption: str = ""


def on_cases(
    paths: Sequence[Path],
    options: Options,
    work: Callable[[Case, Pool], Done],
    *,
    typed: Mapping[str, str] = MappingProxyType({}),
    refuse: Callable[[Case], object] = lambda _: None,
    workers: Workers = WORKERS,
    out: Path | None = None,
) -> int:
    """Read all cases, work on one after the other, say where its files are, and return the largest exit code.

    Args:
        paths: the files of the cases.
        work: does what the command is for.
        typed: see `Options.load`.
        refuse: raises `FpsolveError` where there is no such work on a case; before any is begun.
        workers: who works.
        out: where the folders of the cases are, if files are written.
    """
    cases = options.load(paths, typed)
    for name, count in Counter(case.name for case in cases).items():
        if out and count > 1:
            raise FpsolveError(f'several cases are called "{name}" and would overwrite each other; run them apart')
    for case in cases:
        refuse(case)
    pool, code = workers.pool(), 0
    for case in cases:
        start = monotonic()
        done = work(case, pool)
        if done.interruption:
            print_error(done.interruption)
        if out and done.what:
            print_blocks([last_line(out / case.name, done.what, monotonic() - start, done.known)])
        if done.interruption:
            return INTERRUPTED
        code = max(code, done.code)
    return code


def print_in_one_line(path: Path) -> None:
    """Print a file of JSON."""
    print(" ".join(line.strip() for line in path.read_text(encoding="utf-8").splitlines()))


AGAIN, ANEW = "run it again to go on", "run it again to start over"


@contextmanager
def saying_if_interrupted(what_is_kept: Callable[[], str], again: str = AGAIN) -> Iterator[None]:
    """An interrupt of the body, also one that a library has made another exception of, says what is kept."""
    try:
        yield
    except BaseException as failure:
        if isinstance(failure, FpsolveError) or not is_interrupt(failure):
            raise
        raise KeyboardInterrupt(f"interrupted{what_is_kept()}; {again}") from None


def kept(done: int, of: str, folder: Path | None = None, *, is_more: bool = False) -> str:
    """How much was done of what, and where that is, if it is kept, or a part of the next."""
    return f" after {done} {of}" + (f"; what was done is kept in {folder}" if (done or is_more) and folder else "")


def of_sets(case: Case) -> str:
    """What is counted of a case: "of 3 parameter sets"."""
    return f"of {case.planned} parameter set{'s' if case.planned > 1 else ''}"
