"""Options that several commands take, and what becomes of them."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import quote
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, Token

from fpsolve.errors import CaseError, FpsolveError
from fpsolve.messages import Severity

if TYPE_CHECKING:
    from fpsolve.case.case import Case
    from fpsolve.pool import Pool
    from fpsolve.tell.progress import Watch

CHECK_FAILED, BAD_INPUT, NOT_CONVERGED = 1, 2, 3
"""Exit codes of commands."""


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
    """What all commands on cases take."""

    quiet: Annotated[
        bool,
        Parameter(
            help='Print only the last line, and on the standard error only errors and what is "not converged". Tables, '
            "notes and warnings are in the files."
        ),
    ] = False
    overrides: Annotated[list[str] | None, Parameter(name="--set", help=SET)] = None

    def load(self, paths: Sequence[Path], typed: Mapping[str, str] = MappingProxyType({})) -> list[Case]:
        """All cases. Raises one `FpsolveError` with the faults of all of them.

        Args:
            paths: their files.
            typed: more assignments, by how messages shall call them.
        """
        from fpsolve.case.case import load_case

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
        """What is printed on the way: progress and results, with JSON no tables, or only what failed."""
        from fpsolve.tell.progress import Bars, Watch
        from fpsolve.tell.terminal import print_blocks

        if self.quiet:
            return Watch(noted=partial(print_blocks, severities=[Severity.FAILURE]), said=print_blocks)
        tables: dict[str, Any] = {} if is_json else {"shown": print_blocks}
        return Watch(Bars().bar, noted=print_blocks, said=print_blocks, **tables)


@Parameter(name="*")
@dataclass(frozen=True)
class Writing(Options):
    """What commands take that write files.

    Attributes:
        out: Folder for the results.
    """

    out: Path = Path("results")

    def load(self, paths: Sequence[Path], typed: Mapping[str, str] = MappingProxyType({})) -> list[Case]:
        """All cases, or an error also where two would write into one folder."""
        cases = super().load(paths, typed)
        for name, count in Counter(case.name for case in cases).items():
            if count > 1:
                raise FpsolveError(f'several cases are called "{name}" and would overwrite each other; run them apart')
        return cases

    def print_written(self, case: Case, what: str, seconds: float, known: str = "") -> None:
        """Print where the results of a case are, and how long that took."""
        from fpsolve.tell.solved import last_line
        from fpsolve.tell.terminal import print_blocks

        print_blocks([last_line(self.out / case.name, what, seconds, known)])


@Parameter(name="*")
@dataclass(frozen=True)
class Working(Options):
    """What commands take that several processes may share.

    Attributes:
        jobs: Number of processes; if omitted, the number of processors.
        scheduler: Address of a Dask scheduler whose workers do the work, e.g. tcp://host:8786.
    """

    jobs: Count | None = None
    scheduler: str = ""

    def pool(self, cases: Sequence[Case] = ()) -> Pool:
        """Who does the work; no more processes than a case has sets, where cases are given."""
        from fpsolve.pool import MOST_JOBS, cluster, limit_processors, parallel

        if self.jobs is not None and self.scheduler:
            raise FpsolveError("--jobs is for this machine, and --scheduler for a cluster; name one of them")
        most = max((case.planned for case in cases), default=MOST_JOBS)
        pool = cluster(self.scheduler) if self.scheduler else parallel(self.jobs, most)
        if self.jobs is not None:
            limit_processors(self.jobs)
        return pool


@Parameter(name="*")
@dataclass(frozen=True)
class Reporting(Writing, Working):
    """What commands take that can write a report.

    Attributes:
        report: Also write report.html: one page with all results and figures.
    """

    report: bool = False

    def watch(self, *, is_json: bool = False) -> Watch:
        return replace(super().watch(is_json=is_json), has_report=self.report)


OPTIONS_OF_WORK, OPTIONS_OF_FILES, ALL_OPTIONS = Working(), Writing(), Reporting()
"""As they are where none is stated."""
