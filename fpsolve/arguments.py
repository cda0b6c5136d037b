"""What commands take: case files, other values for their keys, who does the work."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, Token

from fpsolve.errors import CaseError, FpsolveError

if TYPE_CHECKING:
    from fpsolve.case.case import Case
    from fpsolve.pool import Pool

UNITS = "Units: omega in rad/time, c1 in 1/time, D0 in 1/time, tau0 in time"

Cases = Annotated[list[Path], Parameter(help="Case files.", consume_multiple=True, negative="")]
ProvenCases = Annotated[list[Path] | None, Parameter(help="Case files.", consume_multiple=True, negative="")]
Overrides = Annotated[
    list[str] | None,
    Parameter(
        name="--set", help=f"Another value for a key of the case, e.g. oscillator.omega=2.0. {UNITS}.", negative=""
    ),
]


def _whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts alone would take 2.5 for 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'got "{tokens[0].value}"; must be a whole number') from None


Count = Annotated[int, Parameter(converter=_whole)]
Jobs = Annotated[Count | None, Parameter(help="How many processes; as many as there are processors if omitted.")]
Scheduler = Annotated[
    str, Parameter(help="Address of a Dask scheduler whose workers do the work, e.g. tcp://host:8786.")
]
Fresh = Annotated[bool, Parameter(help="Begin anew, also what an earlier run has finished.", negative="")]
Quiet = Annotated[
    bool,
    Parameter(
        help='Print the last line only, and on the standard error what is wrong or "not converged": no tables, notes, '
        "warnings or progress; all of that is in the files.",
        negative="",
    ),
]


def load(paths: Sequence[Path], overrides: Sequence[str] | None, options: Mapping[str, str]) -> list[Case]:
    """All cases, or one error that lists the faults of all of them."""
    from fpsolve.case.case import load_case

    cases, errors = [], []
    for path in paths:
        try:
            cases.append(load_case(path, overrides or (), options))
        except CaseError as error:
            errors.append(_stray_assignment(path, overrides) or str(error))
    if errors:
        raise FpsolveError("\n".join(errors))
    return cases


def _stray_assignment(path: Path, overrides: Sequence[str] | None) -> str:
    """What to write where a case that cannot be is an assignment that lacks its --set, or nothing."""
    is_there = os.path.exists(path)  # noqa: PTH110  (Path.exists raises where a name is too long)
    if is_there or not re.match(r'[\w."-]+ *=', str(path)):
        return ""
    words = " ".join(f"--set {quote(text)}" for text in [*(overrides or ()), str(path)])
    return f"{path}: no such file; each --set takes one assignment: write {words}"


def load_to_write(
    paths: Sequence[Path], overrides: Sequence[str] | None, options: Mapping[str, str], *, monte_carlo: bool
) -> list[Case]:
    """All cases, or an error where two would write into one folder, or one that shall be simulated cannot be."""
    from fpsolve.study.simulate import refuse_obstacles

    cases = load(paths, overrides, options)
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise FpsolveError(f'several cases are called "{name}" and would overwrite each other; run them apart')
    for case in cases if monte_carlo else ():
        refuse_obstacles(case)
    return cases


def pool_of(jobs: int | None, scheduler: str, cases: Sequence[Case] = ()) -> Pool:
    """Who does the work: solves the sets of some cases, or something else. Raises `FpsolveError`."""
    from fpsolve.pool import MOST_JOBS, cluster, several
    from fpsolve.process import limit_processors

    if jobs is not None and scheduler:
        raise FpsolveError("--jobs is for this machine, and --scheduler for a cluster; name one of them")
    pool = cluster(scheduler) if scheduler else several(jobs, max((case.planned for case in cases), default=MOST_JOBS))
    if jobs is not None:
        limit_processors(jobs)
    return pool
