"""The seal of a folder: a digest of its tables and of all that these follow from, so that a further run lets them stay.

It is written last. Tables that are not whole, or that something has changed, are not sealed.
"""

from __future__ import annotations

import json
from hashlib import file_digest, sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fpsolve import __version__
from fpsolve.case.case import Case
from fpsolve.files import parsed_json, plain_text, write_json
from fpsolve.messages import Severity
from fpsolve.output.records import SOLVED_RECORDS, Records, part_keys, set_key
from fpsolve.page.page import Note
from fpsolve.parts.part import Numerics
from fpsolve.study.columns import columns_of
from fpsolve.study.solve import everything

TABLES = "summary.json", "curves.csv", "moments.csv", "results.nc"
"""The files with all numbers of a run."""
SEAL = "records/seal.json"
"""The file of the seal."""


class Told(NamedTuple):
    """What a run tells of all curves: how many have failed, how many records are of another version, and the notes."""

    failed: int
    outdated: int
    notes: tuple[Note, ...]


def seal(case: Case, folder: Path, told: Told) -> None:
    """Seal the tables of a case in a folder."""
    notes = [(each.severity, each.text) for each in told.notes]
    write_json(folder / SEAL, [_digest(case, folder), told.failed, told.outdated, notes])


def sealed(case: Case, folder: Path) -> Told | None:
    """What was told when the tables in a folder were sealed; None where a run would write others."""
    try:
        digest, failed, outdated, notes = parsed_json(plain_text(folder / SEAL))
        if digest == _digest(case, folder):
            return Told(failed, outdated, tuple(Note(Severity(severity), text) for severity, text in notes))
    except (OSError, ValueError, TypeError):  # it is no seal
        pass
    return None


def _digest(case: Case, folder: Path) -> str:
    """A digest of a case, the version, the records in a folder and its tables. Raises OSError where one is missing."""
    numerics = Numerics.of(case)
    asked = [part_keys(json.dumps(everything(case, number)), numerics) for number in (1, 2)]
    names = [each.name for each in columns_of(case)]
    stated = [__version__, case.text, case.overrides, repr(case), asked, names, set_key(case.curve({}))]
    found = sha256(json.dumps(stated).encode())
    for values in (*case.vary.columns.values(), case.vary.lines):
        found.update(values.tobytes() if isinstance(values, np.ndarray) else json.dumps(values).encode())
    for path in (*Records(folder / SOLVED_RECORDS).files, *(folder / name for name in TABLES)):
        if not path.is_file():
            raise FileNotFoundError(path)
        with path.open("rb") as file:
            found.update(file_digest(file, "sha256").digest())
    return found.hexdigest()
