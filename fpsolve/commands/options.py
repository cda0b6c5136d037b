"""Options that several commands take, and what becomes of them."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
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
    from fpsolve.workflow.progress import Watch
    from fpsolve.workflow.reports import Reporter

CHECK_FAILED, BAD_INPUT, NOT_CONVERGED = 1, 2, 3
"""Exit codes of commands."""


def _whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts alone would take 2.5 for 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'got "{tokens[0].value}"; must be a whole number') from None


Count = Annotated[int, Parameter(converter=_whole)]
ModesFile = Annotated[
    Path | None, Parameter(help="A table of natural frequencies and damping ratios, Fn and Xi, as pyOMA writes it.")
]
ModeRows = Annotated[list[Count] | None, Parameter(help="A row of this table; of two modes twice.", negative="")]
UNITS = "Units: omega in rad/time, c1 in 1/time, D0 in 1/time, tau0 in time"
Cases = Annotated[list[Path], Parameter(help="Case files.", consume_multiple=True, negative="")]
SET = f"Another value for a key of the case, e.g. oscillator.omega=2.0 or system.zeta=0.1. {UNITS}."
Overrides = Annotated[list[str] | None, Parameter(name="--set", help=SET, negative="")]

Jobs = Annotated[Count | None, Parameter(help="Number of processes; if omitted, the number of processors.")]
Out = Annotated[Path, Parameter(help="Folder for the results.")]
Scheduler = Annotated[
    str, Parameter(help="Address of a Dask scheduler whose workers do the work, e.g. tcp://host:8786.")
]
Fresh = Annotated[bool, Parameter(help="Also solve or simulate again what an earlier run has finished.", negative="")]
Quiet = Annotated[
    bool,
    Parameter(
        help='Print only the last line, and on the standard error only errors and what is "not converged". Tables, '
        "notes and warnings are in the files.",
        negative="",
    ),
]


Report = Annotated[
    bool,
    Parameter(help="Also write report.html: one page with all results and figures.", negative=""),
]
Interactive = Annotated[
    bool,
    Parameter(
        help="Also write report.html, in which the pointer shows numbers. Needs pip install 'fpsolve[interactive]'.",
        negative="",
    ),
]


def load(
    paths: Sequence[Path], overrides: Sequence[str] | None, options: Mapping[str, str] = MappingProxyType({})
) -> list[Case]:
    """All cases. Raises one `FpsolveError` with the faults of all of them."""
    from fpsolve.case.case import load_case

    cases, errors = [], []
    for path in paths:
        try:
            cases.append(load_case(path, overrides or (), options))
        except CaseError as error:
            is_there = os.path.exists(path)  # noqa: PTH110  (Path.exists raises where a name is too long)
            if is_there or not re.match(r'[\w."-]+ *=', str(path)):
                errors.append(str(error))
            else:
                words = " ".join(f"--set {quote(text)}" for text in [*(overrides or ()), str(path)])
                errors.append(f"{path}: no such file; each --set takes one assignment: write {words}")
    if errors:
        raise FpsolveError("\n".join(errors))
    return cases


def load_to_write(
    paths: Sequence[Path],
    overrides: Sequence[str] | None,
    options: Mapping[str, str] = MappingProxyType({}),
    *,
    monte_carlo: bool = False,
) -> list[Case]:
    """All cases, or an error where two would write into one folder, or one that shall be simulated cannot be."""
    from fpsolve.study.simulate import refuse_obstacles

    cases = load(paths, overrides, options)
    for name, count in Counter(case.name for case in cases).items():
        if count > 1:
            raise FpsolveError(f'several cases are called "{name}" and would overwrite each other; run them apart')
    for case in cases if monte_carlo else ():
        refuse_obstacles(case)
    return cases


def pool_of(jobs: int | None, scheduler: str, cases: Sequence[Case] = ()) -> Pool:
    """Who does the work that the options ask for; no more processes than a case has sets, where cases are given."""
    from fpsolve.pool import MOST_JOBS, cluster, limit_processors, parallel

    if jobs is not None and scheduler:
        raise FpsolveError("--jobs is for this machine, and --scheduler for a cluster; name one of them")
    pool = cluster(scheduler) if scheduler else parallel(jobs, max((case.planned for case in cases), default=MOST_JOBS))
    if jobs is not None:
        limit_processors(jobs)
    return pool


def reporter_of(report: bool, interactive: bool = False) -> Reporter | None:
    """Who writes reports, if one is wanted. Raises `FpsolveError` where what it needs is not installed."""
    if not (report or interactive):
        return None
    from fpsolve.workflow.reports import Reporter

    return Reporter(is_interactive=interactive)


def watch_of(*, is_json: bool = False, is_quiet: bool = False) -> Watch:
    """What is printed on the way: progress and results, with JSON no tables, or only what failed."""
    from fpsolve.page.terminal import print_blocks
    from fpsolve.workflow.progress import Bars, Watch

    if is_quiet:
        return Watch(noted=partial(print_blocks, severities=[Severity.FAILURE]), said=print_blocks)
    tables: dict[str, Any] = {} if is_json else {"shown": print_blocks}
    return Watch(Bars().bar, noted=print_blocks, said=print_blocks, **tables)
