"""Tables of numbers in text, as loggers, programs and buoys write them.

A table begins at the first row that is like most of its last ones. The lines above may have the names
and units of its columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from io import StringIO

import numpy as np
import pandas as pd

from fpsolve.files import Unreadable
from fpsolve.measured.header import SEPARATORS, cells_of, header, is_number, without_mark
from fpsolve.measured.table import Part, Table, table_of

SAMPLE = 50
"""Lines at the end by which the shape of a row is found."""


def parse(text: str, *, skip: int = 0, names: str = "", by_rows: bool = False) -> Table:
    """The table of a text.

    Args:
        skip: lines at its beginning that are left out.
        names: of the columns with their units, in place of those of the text: "t (s),a (m/s^2)".
        by_rows: whether the values follow each other along rows.

    Raises:
        Unreadable: there is none.
    """
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if i > skip and line.strip()]
    rows = [each for each in lines if not without_mark(each[1])[0]]
    if not rows:
        raise Unreadable("has no table of numbers; export a row for each frequency or time")
    separator = next((each for each in SEPARATORS if each in rows[-2:][0][1].strip(" ")), "")
    shapes = Counter(shape for _, line in rows[-SAMPLE:] if (shape := _shape(line, separator))[1])
    if not shapes:
        told = f"has no table of numbers, but ends with {rows[-1][1].strip()[:60]!r}"
        raise Unreadable(f"{told}; export a row for each frequency or time")
    count, numeric = shapes.most_common(1)[0][0]

    def is_row(line: str) -> bool:
        cells = cells_of(line, separator)
        if by_rows:
            return all(map(is_number, filter(None, cells)))
        return len(cells) == count and all(is_number(cells[k]) for k in numeric)

    begin = next(k for k, (_, line) in enumerate(rows) if is_row(line))
    above = [line for i, line in lines if i < rows[begin][0]]
    rows = rows[begin:]
    if by_rows:
        cells = [cell for _, line in rows for cell in cells_of(line, separator) if cell]
        return replace(table_of([Part(names or "values", np.array(cells, dtype=object))]), above=above)
    found, units = header([names] if names else above, count, separator)
    if names and not found:
        raise Unreadable(f"has {count} columns, and others are named by --names {names}", rows[0][0])
    found = [name or f"column {k + 1}" for k, name in enumerate(found)] or [str(k + 1) for k in range(count)]
    sample = [cell for _, line in rows[:SAMPLE] for cell in cells_of(line, separator) if is_number(cell)]
    decimals = {sign for sign in ".," if any(sign in cell for cell in sample)}
    frame = _frame(rows, separator or r"\s+", "," if "," in decimals else ".")
    wrong = None
    if len(frame) < len(rows) or frame[count - 1].isna().any():
        wrong = next((i for i, line in rows if len(cells_of(line, separator)) != count), None)
    if wrong or len(frame) < len(rows) or len(decimals) > 1 or not is_row(rows[-1][1]):
        told = f"is no table of {count} columns of numbers with one decimal sign to its end"
        raise Unreadable(f"{told}; complete or remove the row, or state --by rows", wrong or rows[-1][0])
    kept = [k for k in frame if not frame[k].isna().all()]
    table = table_of(Part(found[k], frame[k].to_numpy(), units[k]) for k in kept)
    return replace(table, above=above, lines=[i for i, _ in rows])


def _shape(line: str, separator: str) -> tuple[int, tuple[int, ...]]:
    """How many cells a line has, and which of them are numbers."""
    cells = cells_of(line, separator)
    return len(cells), tuple(k for k, cell in enumerate(cells) if is_number(cell))


def _frame(rows: Sequence[tuple[int, str]], separator: str, decimal: str) -> pd.DataFrame:
    """The cells of some lines; none where these are no table."""
    body = StringIO("\n".join(line for _, line in rows))
    try:
        return pd.read_csv(body, sep=separator, header=None, decimal=decimal, skipinitialspace=True)
    except pd.errors.ParserError:
        return pd.DataFrame()
