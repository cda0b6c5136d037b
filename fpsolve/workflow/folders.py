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
SOLVED, SIMULATED = (
    r"summary\.json|(moments|curves)\.csv|curves\.pvd|results\.nc|(figure|sensitivities(-\d+)?)\.(png|pdf)|density\.vtu|show\.py"
    r"|eigenfunctions(-\d+)?(\.pvd|/p[+-][\d.e+-]+\.vtu)",
    r"monte_carlo(-\d+)?\.json|response(-\d+)?\.(csv|vti|png|pdf)",
)
"""The names of the files that a run writes, and of those of a simulation; of a chart, and of proofs."""
CHART, PROVEN = r"chart\.(csv|json|png|pdf)", r"proof\.json"
_UNFINISHED = rf"(eigenfunctions(-\d+)?/)?{TEMPORARY}"


@contextmanager
def own_folder(case: Case, out: str | Path, replaced: Sequence[str]) -> Iterator[Path]:
    """The folder of a case, which other runs keep out of; nothing is in it that is replaced, or of other parameters.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
    """
    folder = Path(out) / case.name
    with alone(folder):
        with writable(folder):
            stale = replaced if _agrees(case, folder) else (SOLVED, SIMULATED, CHART, PROVEN)
            _remove(folder, "|".join([*stale, _UNFINISHED]))
        yield folder


@contextmanager
def saying_if_interrupted(what_is_kept: Callable[[], str], again: str = AGAIN) -> Iterator[None]:
    """An interrupt of the body says what is kept, and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted{what_is_kept()}; {again}") from None


def kept(case: Case, done: int, folder: Path | None = None) -> str:
    """How many curves of a case are done, and where these are, if they are kept."""
    count = f" after {done} of {case.planned} curve{'s' if case.planned > 1 else ''}"
    return f"{count}; what was done is kept in {folder}" if done and folder else count


def _agrees(case: Case, folder: Path) -> bool:
    """Whether the tables in a folder are all of parameters that the case has."""
    tables = [
        *folder.glob("summary.json"),
        *folder.glob("monte_carlo*.json"),
        *folder.glob("chart.json"),
        *folder.glob("proof.json"),
    ]
    try:
        contents = [json.loads(table.read_text(encoding="utf-8")) for table in tables]
        found = [curve["parameters"] for content in contents for curve in content.get("curves", [content])]
        return all(map(_is_among([curve.parameters for curve in case.curves()] if tables else []), found))
    except (ValueError, KeyError, TypeError, AttributeError):  # it is no table of ours
        return False


def _is_among(known: Sequence[Mapping[str, Any]]) -> Callable[[Mapping[str, Any]], bool]:
    """Whether parameters, or those that are stated, are those of one of some curves."""
    whole = {frozenset(each.items()) for each in known}
    return lambda each: (
        frozenset(each.items()) in whole
        or (len(each) < len(known[0]) and any(each.items() <= one.items() for one in known))
    )


def _remove(folder: Path, names: str) -> None:
    """Remove files with names that match, in a folder and one below."""
    for path in {*folder.glob("*"), *folder.glob("*/*")}:
        if re.fullmatch(names, path.relative_to(folder).as_posix()) and not path.is_dir():
            path.unlink()
            if path.parent != folder and not any(path.parent.iterdir()):
                path.parent.rmdir()
