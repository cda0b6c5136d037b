"""The folder of a case: one run at a time writes there, and all in it is of the parameters of the case."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fpsolve.case.case import Case
from fpsolve.files import TEMPORARY, alone, writable

AGAIN, ANEW = "run it again to go on", "run it again to start over"
SOLVED = (
    r"summary\.json|(moments|curves)\.csv|curves\.pvd|results\.nc|(figure|sensitivities(-\d+)?)\.(png|pdf)|density\.vtu"
    r"|show\.py|eigenfunctions(-\d+)?(\.pvd|/p[+-][\d.e+-]+\.vtu)"
)
SIMULATED = r"monte_carlo(-\d+)?\.json|response(-\d+)?\.(csv|vti|png|pdf)"
CHART, PROVEN = r"chart\.(csv|json|png|pdf)", r"proof\.json"
"""Patterns of the names of the files that a run writes, a simulation, a chart, and proofs."""
_UNFINISHED = rf"(eigenfunctions(-\d+)?/)?{TEMPORARY}"


@contextmanager
def own_folder(case: Case, out: str | Path, replaced: Sequence[str]) -> Iterator[Path]:
    """The folder of a case for one run alone. Files that match `replaced`, or are of other parameters, are removed.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
    """
    folder = Path(out) / case.name
    with alone(folder):
        with writable(folder):
            stale = replaced if _agrees(case, folder) else (SOLVED, SIMULATED, CHART, PROVEN)
            names = "|".join([*stale, _UNFINISHED])
            for path in {*folder.glob("*"), *folder.glob("*/*")}:
                if re.fullmatch(names, path.relative_to(folder).as_posix()) and not path.is_dir():
                    path.unlink()
                    if path.parent != folder and not any(path.parent.iterdir()):
                        path.parent.rmdir()
        yield folder


@contextmanager
def saying_if_interrupted(what_is_kept: Callable[[], str], again: str = AGAIN) -> Iterator[None]:
    """An interrupt of the body says what is kept, and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted{what_is_kept()}; {again}") from None


def kept(done: int, of: str, folder: Path | None = None) -> str:
    """How much was done of what, and where that is, if it is kept."""
    return f" after {done} {of}" + (f"; what was done is kept in {folder}" if done and folder else "")


def of_curves(case: Case) -> str:
    """What is counted of a case: "of 3 curves"."""
    return f"of {case.planned} curve{'s' if case.planned > 1 else ''}"


def _agrees(case: Case, folder: Path) -> bool:
    """Whether the tables in a folder are all of parameters that the case has."""
    patterns = ("summary.json", "monte_carlo*.json", "chart.json", "proof.json")
    tables = [table for pattern in patterns for table in folder.glob(pattern)]
    if not tables:
        return True
    known = [curve.parameters for curve in case.curves()]
    whole = {frozenset(each.items()) for each in known}

    def is_known(stated: Mapping[str, Any]) -> bool:
        is_part = len(stated) < len(known[0])
        return frozenset(stated.items()) in whole or (is_part and any(stated.items() <= each.items() for each in known))

    try:
        contents = [json.loads(table.read_text(encoding="utf-8")) for table in tables]
        found = [curve["parameters"] for content in contents for curve in content.get("curves", [content])]
        return all(map(is_known, found))
    except (ValueError, KeyError, TypeError, AttributeError):  # it is not a table of fpsolve
        return False
