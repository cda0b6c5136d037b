"""Columns of numbers with names and units, as files hold them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.files import Words

WORDS = Words("the measurement", "a file of numbers", "spectrum.csv", "comma-separated", "export the data again", True)
_HEADING = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>.*)\))\s*")


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers with a unit.

    Attributes:
        values: shape (n,).
        unit: an empty text where it is not stated.
        resolution: one unit of the last digit that is written, in the unit of the values; 0 where that is not known.
    """

    values: FloatArray
    unit: str = ""
    resolution: float = 0.0


@dataclass(frozen=True, eq=False)
class Table:
    """What a file holds.

    Attributes:
        path: where it is from.
        columns: by their names, in the order of the file.
        rate: values per second, where the file states it.
        abscissa: the name of the column that the others are over, where the file states it.
        kind: "record" or "spectrum", where the file states it.
        lines: of a text the line of each row.
        rows: of a file with several spectra over one abscissa each of them, shape (k, n).
        notes: what was assumed to read it.
    """

    path: Path
    columns: Mapping[str, Column]
    rate: float | None = None
    abscissa: str = ""
    kind: str = ""
    lines: Sequence[int] | IntArray = ()
    rows: FloatArray | None = None
    notes: tuple[str, ...] = ()

    def unit_of(self, name: str) -> str:
        """The unit of a column, also of one whose cells are no numbers."""
        units = getattr(self.columns, "units", None)
        return self.columns[name].unit if units is None else str(units[name])

    def place(self, row: int) -> str:
        """Where a row stands in the file, counted from 0: "line 7", or "row 5" where there are no lines."""
        return f"line {self.lines[row]}" if len(self.lines) else f"row {row + 1}"


def heading(text: str) -> tuple[str, str]:
    """The name and the unit of a column: "a (m/s²)", "a [m/s²]" or "a / (m/s²)"."""
    found = _HEADING.fullmatch(text.strip())
    if found is None or not found["name"]:
        return text.strip(), ""
    return found["name"].removesuffix("/").rstrip(), (found["square"] or found["round"] or "").strip()
