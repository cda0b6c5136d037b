"""Parameter sets from a file of comma-separated values: its header names the keys, each further row is a set."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from fpsolve.case.messages import nearest, own_faults, shortened
from fpsolve.case.reading import Unreadable, Words, read_text
from fpsolve.case.sections import Value
from fpsolve.case.vary import COLUMN, RECORDS, WORDS, Vary, repeats
from fpsolve.model.parameters import meaning_of
from fpsolve.model.words import accepted

_WORDS = Words(
    *("the sets", "a file of sets", "sets.csv", "comma-separated"),
    start="its first row must name keys, as in noise.D0,noise.tau0",
    may_have_mark=True,
)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
Faults = list[tuple[int, str]]
"""Lines, and what is wrong there."""


@dataclass(frozen=True)
class FileVary(Vary):
    """The sets of a file.

    Attributes:
        file: its name, for messages.
        lines: where each set stands.
        faults: what is wrong in other rows, with their lines.
    """

    file: str = ""
    lines: tuple[int, ...] = ()
    faults: tuple[tuple[int, str], ...] = ()


@dataclass
class _Table:
    """The header of a file and its rows that are as long as it, with their lines; what is wrong with others."""

    first: int = 0
    header: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    faults: Faults = field(default_factory=list)


def read_sets(file: str, folder: Path) -> FileVary:
    """The sets of a file, with the faults of its rows.

    Raises:
        Unreadable: there is no table in it.
    """
    table = _table(read_text(folder / file, _WORDS))
    unknown = _header_faults(table.header)
    faults, columns = [(table.first, reason) for reason in unknown] + table.faults, {}
    wrong: set[int] = set()
    for key, cells in zip(table.header, zip(*table.rows, strict=True), strict=False):
        if key not in RECORDS:
            continue
        values, reasons = _texts(key, cells) if key in WORDS else _numbers(key, cells)
        faults += [(table.lines[i], f"{key}: {reason}") for i, reason in reasons.items()]
        columns[key] = values
        wrong |= reasons.keys()
    good = [i for i in range(len(table.lines)) if i not in wrong and not unknown]
    lines = tuple(table.lines[i] for i in good)
    kept = {key: tuple(values[i] for i in good) for key, values in columns.items()}
    for place, first in repeats(kept) if good else ():
        faults.append((lines[place], f"is the same set as line {lines[first]}; must be distinct; remove one of them"))
    return FileVary(kept, "zip", file, lines, tuple(faults))


def _table(text: str) -> _Table:
    """The cells of a file. Raises Unreadable where there are no rows, no commas, or wrong quotes."""
    reader, table = csv.reader(io.StringIO(text, newline=""), strict=True), _Table()
    line = 1
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not table.header:
                _refuse_other_marks(cells, line)
                table.header, table.first = cells, line
            elif any(cells) and len(cells) != len(table.header):
                table.faults.append((line, _wrong_length(cells, table.header)))
            elif any(cells):
                table.rows.append(cells)
                table.lines.append(line)
            line = reader.line_num + 1
    except csv.Error as error:
        raise Unreadable(f"cannot be read as comma-separated values ({error}); mend its quotes", line) from None
    if not table.header or not (table.rows or table.faults):
        raise Unreadable("has a header but no sets; write a row of values for each set")
    return table


def _refuse_other_marks(header: Sequence[str], line: int) -> None:
    """Refuse a header without commas between its keys."""
    if len(header) == 1 and re.search(r"[;\t]", header[0]):
        mark = "semicolons" if ";" in header[0] else "tabs"
        raise Unreadable(f"is separated by {mark}; write commas, and decimal points in the numbers", line)


def _header_faults(header: Sequence[str]) -> list[str]:
    """What of a header is no key, or there already."""
    reasons, known = list[str](), f"known keys: {', '.join(RECORDS)}; rename or remove it"
    for i, key in enumerate(header):
        if not key:
            reasons.append(f"column {i + 1}: has no key in the header; {known}")
        elif key not in RECORDS:
            reasons.append(f"{shortened(key)}: cannot be varied;{nearest(key, RECORDS)} {known}")
        elif key in header[:i]:
            reasons.append(f"{key}: stands twice in the header; remove one of them")
    return reasons


def _wrong_length(cells: Sequence[str], header: Sequence[str]) -> str:
    text = f"has {len(cells)} cell{'s' if len(cells) > 1 else ''}; must have {len(header)}, one for each key"
    if len(cells) == 1 and ";" in cells[0]:
        return f"{text}; write commas between them, and decimal points in the numbers"
    if len(cells) < len(header):
        return f"{text}; add those that are missing"
    return f"{text}; remove the others, and write decimal points, not commas, in the numbers"


def _texts(key: str, cells: Sequence[str]) -> tuple[Sequence[Value], dict[int, str]]:
    """Cells that must be texts, and why some are none of those known, by their places."""
    known = ", ".join(WORDS[key])
    wrong = [i for i, cell in enumerate(cells) if cell not in WORDS[key]]
    return cells, {
        i: f"{_got(cells[i])}; must be one of {known};{nearest(cells[i], WORDS[key])} write one of them" for i in wrong
    }


def _numbers(key: str, cells: Sequence[str]) -> tuple[Sequence[Value], dict[int, str]]:
    """Cells that must be numbers, 0 without a sign, and why some are none in the range of the key, by their places."""
    values, no_numbers = list[float](), dict[int, str]()
    must = f"must be {accepted(RECORDS[key])} ({meaning_of(RECORDS[key])})"
    for i, cell in enumerate(cells):
        try:
            values.append(float(cell) + 0.0)
        except ValueError:
            values.append(float("nan"))
            no_numbers[i] = f"{_got(cell)}; {must}; {_remedy(cell)}"
    return values, {
        i: no_numbers.get(i) or f"{_got(cells[i])}; {must}; change it, or remove the row" for i in _invalid(key, values)
    }


def _remedy(cell: str) -> str:
    """What to do about a cell that is no number."""
    if _DECIMAL_COMMA.fullmatch(cell):
        return f"write the decimal point as {cell.replace(',', '.')}"
    return "write commas between cells, and decimal points in numbers" if ";" in cell else "write a number"


def _invalid(key: str, values: Sequence[float]) -> Iterator[int]:
    """The places of the numbers that the key does not accept."""
    try:
        COLUMN[key].validate_python(values)
    except ValidationError as error:
        yield from (int(detail["loc"][0]) for detail in own_faults(error))


def _got(cell: str) -> str:
    return f"got {shortened(cell)}" if cell else "is empty"
