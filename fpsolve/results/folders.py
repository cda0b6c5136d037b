"""The folder of a case: one run at a time writes there, and all in it is of the parameters of the case."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.errors import OutputError, Remedy
from fpsolve.files import TEMPORARY, alone, writable, write_text
from fpsolve.results.csv_json import TABLES
from fpsolve.solve.questions import QUESTIONS

SOLVED = "|".join([*map(re.escape, TABLES), r"figure\.(png|pdf)", *(each.names for each in QUESTIONS if each.names)])
SIMULATED = r"monte_carlo(-\d+)?\.json|monte_carlo_response(-\d+)?\.(csv|vti|png|pdf)"
REPORT = r"report\.html"
"""Pattern of the name of the report of what was done last, which whatever is done next makes stale."""
CHART, PROVEN, DESIGNED = r"chart\.(csv|json|png|pdf)", r"proof\.json", r"design\.(json|toml)"
"""Patterns of the names of the files that a run writes, a simulation, a chart, proofs, and a design."""
_FOLDERS = r"records|eigenfunctions(-\d+)?"
_UNFINISHED = rf"(({_FOLDERS})/)?{TEMPORARY}"
_PARAMETERS = "records/parameters"
"""The file that tells of which parameter sets all others are."""


@contextmanager
def own_folder(case: Case, out: str | Path, replaced: Sequence[str]) -> Iterator[Path]:
    """The folder of a case for one run alone. Files that match `replaced` are removed, of other parameters all.

    Raises:
        OutputError: the folder cannot be made or written to, another run writes into it, or something in it has the
            name of what will be written and cannot be replaced; nothing is removed.
    """
    folder = Path(out) / case.name
    with alone(folder):
        with writable(folder):
            there = {path.relative_to(folder).as_posix(): path for path in _entries(folder)}
            for name, path in there.items():
                is_folder = path.is_dir() and not path.is_symlink()
                if re.fullmatch(_FOLDERS, name) and not is_folder:
                    raise OutputError(f"{path} cannot be written to: it is no folder, or a link to one", Remedy.FOLDER)
                if re.fullmatch("|".join([*replaced, REPORT]), name) and is_folder:
                    raise OutputError(f"{path} cannot be written: Is a directory", Remedy.FOLDER)
            sets = json.dumps([case.curve({}).digest, case.vary.mode, case.vary.columns])
            parameters, stated, is_same = sha256(sets.encode()).hexdigest(), folder / _PARAMETERS, False
            with suppress(OSError):
                is_long = stated.is_file() and stated.stat().st_size == len(parameters)
                is_same = is_long and stated.read_bytes() == parameters.encode()
            kinds = replaced if is_same else (SOLVED, SIMULATED, CHART, PROVEN, DESIGNED)
            names = "|".join([*kinds, REPORT, _UNFINISHED])
            for name, path in there.items():
                if re.fullmatch(names, name) and (path.is_symlink() or not path.is_dir()):
                    path.unlink()
                    if path.parent != folder and not any(path.parent.iterdir()):
                        path.parent.rmdir()
            write_text(stated, parameters)
        yield folder


def _entries(folder: Path) -> Iterator[Path]:
    """What is in a folder, and in the folders in it; what links lead to is not."""
    for path in sorted(folder.iterdir()):
        yield path
        if path.is_dir() and not path.is_symlink():
            with suppress(PermissionError):  # somebody else's
                yield from sorted(path.iterdir())
