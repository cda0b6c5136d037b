"""Tables of numbers in text, as loggers, programs and buoys write them.

A table begins where two rows follow each other that are like the one before the last. The lines above may have the
names and units of its columns.
"""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from itertools import pairwise

import numpy as np
import pandas as pd

from fpsolve.files import Unreadable
from fpsolve.measured.header import cells_of, header, is_number, separator_of, without_mark
from fpsolve.measured.table import Part, Table, table_of


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
    model = rows[-2:][0][1]
    separator = separator_of(model)
    pattern = cells_of(model, separator)
    numeric = [k for k, cell in enumerate(pattern) if is_number(cell)]
    if not numeric:
        told = f"has no table of numbers, but ends with {' '.join(pattern)[:60]!r}"
        raise Unreadable(f"{told}; export a row for each frequency or time")

    def is_row(line: str) -> bool:
        cells = cells_of(line, separator)
        if by_rows:
            return all(map(is_number, filter(None, cells)))
        return len(cells) == len(pattern) and all(is_number(cells[k]) for k in numeric)

    begin = next((i for i, (a, b) in enumerate(pairwise(rows)) if is_row(a[1]) and is_row(b[1])), max(len(rows) - 2, 0))
    above = [line for i, line in lines if i < rows[begin][0]]
    rows = rows[begin:]
    if by_rows:
        cells = [cell for _, line in rows for cell in cells_of(line, separator) if cell]
        return Table({"values": np.array(cells, dtype=object)}, above=above)
    found, units = header([names] if names else above, len(pattern), separator)
    if names and not found:
        raise Unreadable(f"has {len(pattern)} columns, and others are named by --names {names}", rows[0][0])
    found = [name or f"column {k + 1}" for k, name in enumerate(found)] or [str(k + 1) for k in range(len(pattern))]
    decimal = "," if separator != "," and any("," in pattern[k] for k in numeric) else "."
    body = StringIO("\n".join(line for _, line in rows))
    try:
        frame = pd.read_csv(body, sep=separator or r"\s+", header=None, decimal=decimal, skipinitialspace=True)
    except pd.errors.ParserError as error:
        at = next((i for i, line in rows if len(cells_of(line, separator)) != len(pattern)), None)
        raise Unreadable(f"is no table of {len(pattern)} columns ({error}); complete or remove the row", at) from None
    kept = [k for k in frame if not frame[k].isna().all()]
    table = table_of(Part(found[k], frame[k].to_numpy(), units[k]) for k in kept)
    return replace(table, above=above, lines=[i for i, _ in rows])
