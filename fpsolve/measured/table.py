"""Columns of numbers, times and words with names and units, as files hold them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.files import Unreadable, Words
from fpsolve.measured.header import STAMP, heading, hint
from fpsolve.measured.signals import factor_of

WORDS = Words("the measurement", "a file of numbers", "spectrum.csv", "comma-separated", "export the data again", True)
DAY = 86400.0
MOST_COLUMNS = 64
Cells = NDArray[np.generic]
Stamps = Callable[[Cells], pd.DatetimeIndex | pd.TimedeltaIndex]
_calendar = partial(pd.to_datetime, utc=True)
STAMPS: Sequence[Stamps] = (pd.to_timedelta, partial(_calendar, format="ISO8601"), partial(_calendar, format="mixed"))
"""How times of a clock, of a calendar as ISO 8601 writes them, and of others are read."""


@dataclass(frozen=True, eq=False)
class Table:
    """The content of a file.

    Attributes:
        columns: by their names, in the order of the file.
        units: of those columns for which the file states one.
        rate: values per second, where the file states it.
        above: lines above the columns.
        lines: of a text the number of the line of each row.
    """

    columns: Mapping[str, Cells]
    units: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    above: Sequence[str] = ()
    lines: Sequence[int] = ()

    def place(self, row: int) -> str:
        """Where a row stands in the file, counted from 0: "line 7", or "row 5" where there are no lines."""
        return f"line {self.lines[row]}" if self.lines else f"row {row + 1}"

    def numbers(self, name: str) -> FloatArray:
        """A column of numbers. Raises `ValueError`."""
        cells = self.columns[name]
        values = pd.to_numeric(pd.Series(cells).replace("[dD]", "e", regex=True), errors="coerce").to_numpy(dtype=float)
        if np.all(np.isfinite(values)):
            return values
        k = int(np.argmin(np.isfinite(values)))
        raise ValueError(f'has "{cells[k]}" in the column {name}, {self.place(k)}; write a number, or remove the row')

    def times(self, name: str, unit: str) -> FloatArray:
        """A column of times in s; those of a calendar or of a clock since the first. Raises `ValueError`."""
        cells = self.columns[name]
        if not (read := stamps_of(cells)):
            return self.numbers(name) * factor_of(unit, "s")
        try:
            found = read(cells)
        except (ValueError, TypeError, OverflowError) as error:
            text = f"has times in the column {name} that are not written alike, as 2026-01-31 12:00:00.5"
            raise ValueError(f"{text} ({str(error).partition('. ')[0]})") from None
        seconds = np.asarray((found - found[0]) / pd.Timedelta(seconds=1), dtype=float)
        return np.unwrap(seconds, period=DAY) if read is pd.to_timedelta else seconds

    def missing(self, what: str, remedy: str, *dimensions: str) -> ValueError:
        """An error on what the file does not state: what it seems to say of it, and how to state it."""
        seems = hint([*self.columns, *self.above], dimensions)
        return ValueError(f"states no {what}{f' (it has {seems!r})' if seems else ''}; state {remedy}")


def stamps_of(cells: Cells) -> Stamps | None:
    """How cells are read that are times of a clock or of a calendar; None of others, by the first one."""
    if cells.dtype.kind in "mM" or (isinstance(cells[0], str) and STAMP.fullmatch(cells[0])):
        for read in STAMPS:
            with suppress(ValueError, TypeError, OverflowError):
                read(cells[:1])
                return read
    return None


class Part(NamedTuple):
    """A vector of a file, a table or a struct of such, with the unit and the step of time that the file states."""

    name: str
    values: object
    unit: str = ""
    step: float = 0.0


def columns_of(name: str, values: object) -> dict[str, Cells]:
    """The vectors of real numbers, times or words in an array or a struct; those of a table by their numbers, "a 2"."""
    if isinstance(values, Mapping):
        inner = [columns_of(f"{name}.{key}".strip("."), each) for key, each in values.items()]
        return {key: each for found in inner for key, each in found.items()}
    array = np.squeeze(np.asarray(values))
    kind, shape = array.dtype.kind, array.shape
    if kind not in "iufmMOcV" or not shape or not array.size:
        return {}
    if kind in "cV" or len(shape) > 2 or (len(shape) == 2 and min(shape) > MOST_COLUMNS):  # perhaps the wanted one
        return {name: np.array([f"{array.dtype} of shape {shape}"], dtype=object)}
    if kind == "O":
        array = array.astype(str).astype(object)
    if len(shape) == 1:
        return {name or "1": array}
    rows = array if shape[0] < shape[1] else array.T
    return {f"{name} {k + 1}".strip(): row for k, row in enumerate(rows)}


def table_of(parts: Iterable[Part]) -> Table:
    columns, units, steps = dict[str, Cells](), dict[str, str](), set[float]()
    for part in parts:
        for text, cells in columns_of(part.name, part.values).items():
            name, unit = heading(text)
            if name in columns:
                raise Unreadable(f'has two columns called "{name}", or one in pieces; rename one, or export one piece')
            is_clear = not unit or part.unit in ("", unit)
            columns[name], units[name] = cells, (part.unit or unit) if is_clear else ""
            steps.add(part.step)
    step = max(steps, default=0.0)
    return Table(columns, units, 1 / step if step > 0 and len(steps) == 1 else None)
