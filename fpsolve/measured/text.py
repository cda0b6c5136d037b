"""Tables of numbers in text, as loggers, programs and buoys write them.

A table begins where rows of one shape begin. What stands above is a preamble; its last line with a name for each cell
is the header, also behind #, % or //, and the line below that may hold the units.
"""

from __future__ import annotations

import csv
import math
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import pairwise
from pathlib import Path

import numpy as np

from fpsolve.arrays import IntArray
from fpsolve.files import Unreadable, read_text
from fpsolve.measured.columns import WORDS, Column, Table, heading
from fpsolve.measured.signals import FREQUENCIES, SIGNALS, TIMES, among, density_unit

NO_TABLE = "has no table of numbers"
MOST_COLUMNS = 1000
LONGEST = 200
"""Letters of the name of a column, and of a line in which PEER states how many values there are."""
MOST_TEXT, MOST_LINES = 2**26, 4_000_000
"""Bytes and lines of a text; to read it takes some twelve times as many bytes, or 200 a line."""
LETTERS = ("g", "m", "V")
"""Units of one letter, which may be names, too."""
NAMED_WITH_UNITS: Sequence[tuple[str, Iterable[str]]] = (
    (r"t|times?|timestamp|zeit", ("s", "ms", "us", "ns")),
    (r"f|freq|frequency", FREQUENCIES),
    (r"(acc|accel|acceleration)(_\w+)?", SIGNALS["acceleration"].units),
)
"""Names in whose end a unit may stand, and which units may."""
SAMPLE = 2000
"""Lines at the beginning and at the end by which the separator is found."""
TIMES_ALIKE = "alike, such as 2026-01-31 12:00:00.5"
"""How times are to be written."""
_MARK = re.compile(r"^\s*(?:#+|%+|//+)\s?")
_NUMBER = re.compile(r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[ed][+-]?\d++)?|[+-]?(?:nan|inf)|", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)
_DAY, _CLOCK = r"\d{4}[-/]\d\d?[-/]\d\d?", r"\d\d?:\d\d(?::\d\d(?:\.\d*)?)?(?: ?[AP]M)?"
_STAMP = re.compile(rf"(?:{_DAY}|\d\d?/\d\d?/\d\d(?:\d\d)?)(?:[T ]+{_CLOCK})?(?:Z| ?[+-]\d\d:?\d\d)?|{_CLOCK}")
_OTHER_TIME = re.compile(r"\d+:\d\d|\d\d?\.\d\d?\.\d")
_SPACED = re.compile(r"\S+(?:[ \t]+(?:[\[(]\S*[\])]|[\[(][^\])\[(]*[\])])(?=\s|$))?")
"""Names between spaces, each with its unit in brackets."""
SEPARATORS = ("\t", ";", ",", None)


@dataclass(frozen=True)
class _Lines:
    """The rows of a table: the lines of a file, the numbers of those that are rows, and how they are cut."""

    lines: Sequence[str]
    numbers: IntArray
    separator: str | None

    def cells(self, column: int) -> list[str]:
        return [_cells(self.lines[i - 1], self.separator)[column] for i in self.numbers.tolist()]


@dataclass(frozen=True)
class _Columns(Mapping[str, Column]):
    """The columns of a text, each read when it is wanted; a word in one of them is no fault of another."""

    rows: _Lines
    places: Mapping[str, int]
    units: Mapping[str, str]
    _read: dict[str, Column] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Column:
        if name not in self._read:
            self._read[name] = self._column(name, self.rows.cells(self.places[name]))
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.places)

    def __len__(self) -> int:
        return len(self.places)

    def _column(self, name: str, cells: list[str]) -> Column:
        if _STAMP.fullmatch(cells[0]):
            return _times(name, cells, self.rows.numbers)
        try:
            values = np.array([float(cell) for cell in cells])
        except ValueError:
            values = np.array([_number(name, *each) for each in zip(cells, self.rows.numbers.tolist(), strict=True)])
        return Column(values, self.units[name], _last_digit(cells[:: max(len(cells) // SAMPLE, 1)]))


def _number(name: str, cell: str, line: int) -> float:
    """The number in a cell, also with the exponent of Fortran. Raises Unreadable."""
    try:
        return float(cell.lower().replace("d", "e"))
    except ValueError:
        remedy = "write decimal points" if _DECIMAL_COMMA.fullmatch(cell) else "write a number or remove the row"
        remedy = f"write times {TIMES_ALIKE}" if _OTHER_TIME.match(cell) else remedy
        told = f'"{cell}"' if cell else "nothing"
        raise Unreadable(f"has {told} in the column {name}; {remedy}", line) from None


def _last_digit(cells: Sequence[str]) -> float:
    """One unit of the last digit of some numbers, of which up to three quarters may lack zeros at their ends."""
    found = list[float]()
    for cell in cells:
        mantissa, _, exponent = cell.lower().partition("e")
        found.append(float(f"1e{exponent or 0}") * 10.0 ** -len(mantissa.partition(".")[2]))
    return sorted(found)[len(found) // 4]


def _times(name: str, cells: Sequence[str], numbers: IntArray) -> Column:
    """Seconds since the first of some times of the calendar, or of a day, which may end at midnight."""
    import pandas as pd

    clock = re.fullmatch(_CLOCK, cells[0]) is not None and not cells[0].endswith("M")
    try:
        with warnings.catch_warnings(action="ignore"):  # a form that pandas does not know takes it longer
            found = pd.to_timedelta([*cells]) if clock else pd.to_datetime([*cells])
        seconds = np.asarray((found - found[0]) / pd.Timedelta(seconds=1), dtype=float)
        if np.isnan(seconds).any():
            raise ValueError
    except (ValueError, TypeError, OverflowError):
        wrong = next((i for i, cell in enumerate(cells) if not _STAMP.fullmatch(cell)), 0)
        text = f'has "{cells[wrong]}" in the column {name}; write all times {TIMES_ALIKE}'
        raise Unreadable(text, int(numbers[wrong])) from None
    if clock:
        seconds += 86400.0 * np.cumsum(np.diff(seconds, prepend=0.0) < -43200)
    digits = max(len(re.match(r"\d*", each.partition(".")[2])[0]) for each in cells)  # type: ignore[index]
    return Column(seconds, "s", 10.0**-digits)


def read_text_table(path: Path, skip: int = 0) -> Table:
    """The table of a text file.

    Args:
        path: of a file in UTF-8, or Latin-1.
        skip: lines at its beginning that are left out.

    Raises:
        Unreadable: there is none, or its header has a name twice.
    """
    text = read_text(path, WORDS, may_be_latin=True, most=MOST_TEXT)
    if text.count("\n") > MOST_LINES:
        raise Unreadable(f"has more than {MOST_LINES} lines; cut the measurement, or save it as .npy")
    lines = text.splitlines()
    separators: Sequence[str | None] = SEPARATORS
    if lines and (stated := re.fullmatch(r'"?sep=(.)"?', lines[0].strip(), re.IGNORECASE)):  # of Excel
        separators, lines[0] = (stated[1],), ""
    stated_lines = [i for i in range(skip + 1, len(lines) + 1) if lines[i - 1].strip()]
    numbers = np.array([i for i in stated_lines if not _MARK.match(lines[i - 1])], dtype=np.int32)
    sample = np.concatenate([numbers[:SAMPLE], numbers[SAMPLE:][-SAMPLE:]]).tolist()
    separator, count = _shape([lines[i - 1] for i in sample], separators)
    table = _Lines(lines, numbers[_start([lines[i - 1] for i in sample], separator, count) :], separator)
    begin = int(table.numbers[0])
    first = _cells(lines[begin - 1], separator)
    above = [i for i in stated_lines[: begin + 1] if i < begin]
    names, units, header = _header([(i, lines[i - 1]) for i in above], first, separator)
    for i in table.numbers.tolist():
        if (found := len(_cells(lines[i - 1], separator))) != count:
            told = f"has {found} cells, and {'the header' if names else 'the first row'} has {count}"
            raise Unreadable(f"{told}; complete the row, or remove it", i)
    if not names and separator == "," and count == 2:
        _refuse_decimal_commas(table)
    ends = [k for k in range(count) if not first[k] and not any(table.cells(k))]
    if names:
        twice = next((name for name in names if name and names.count(name) > 1), None)
        if twice is not None:
            raise Unreadable(f'has two columns called "{twice}"; rename one', header)
        names = [name or f"column {k + 1}" for k, name in enumerate(names)]
    else:
        names, units = [str(k + 1) for k in range(count)], [""] * count
    places = {name: k for k, name in enumerate(names) if k not in ends}
    columns = _Columns(table, places, dict(zip(names, units, strict=True)))
    notes = () if not above or header else (f"left out the lines 1 to {above[-1]}, which have no names of columns",)
    return Table(
        path,
        _without_index(columns),
        abscissa=_stamps(columns, first),
        lines=table.numbers,
        notes=notes,
    )


def _refuse_decimal_commas(rows: _Lines) -> None:
    """Refuse two whole numbers in each row, of which the first do not increase: they are one with a decimal comma."""
    whole, behind = rows.cells(0), rows.cells(1)
    if not all(map(str.isdigit, behind)) or not all(re.fullmatch(r"[+-]?\d+", each) for each in whole):
        return
    if any(Decimal(a) >= Decimal(b) for a, b in pairwise(whole)):
        text = (
            f'has "{whole[0]},{behind[0]}"; write decimal points; if these are two columns, name them in a line above'
        )
        raise Unreadable(text, int(rows.numbers[0]))


def _is_number(cell: str) -> bool:
    """Whether a heading is a number with a decimal point."""
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _cells(line: str, separator: str | None) -> list[str]:
    """The cells of a row. Raises Unreadable where its quotes are wrong."""
    if separator is None:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except csv.Error as error:
        raise Unreadable(f"is no table ({error}); export it again") from None


def _like_row(cells: Sequence[str]) -> bool:
    """Whether at least half of some cells are numbers or times."""
    if len(cells) == 1 and "," in cells[0]:
        return False
    fitting = sum(_NUMBER.fullmatch(each) is not None or _STAMP.fullmatch(each) is not None for each in cells)
    return any(cells) and 2 * fitting >= len(cells) and any(map(str.isdigit, "".join(cells)))


def _shape(lines: Sequence[str], separators: Sequence[str | None]) -> tuple[str | None, int]:
    """The separator by which most lines are rows of one shape, and how many cells these have. Raises Unreadable.

    Of two, it is the one by which more rows have nothing but numbers: a semicolon, where commas are in numbers.
    """
    most, best = (0, 0), 0
    chosen: str | None = None
    for separator in separators:
        rows = [cells for cells in (_cells(each, separator) for each in lines) if _like_row(cells)]
        counts, whole = Counter(map(len, rows)), Counter(len(cells) for cells in rows if all(map(_fits, cells)))
        found, count = max((((many, whole[count]), count) for count, many in counts.items()), default=((0, 0), 0))
        if found > most or (found == most and count > best and separator is not None):
            most, best, chosen = found, count, separator
    if not best:
        raise Unreadable(f"{NO_TABLE}; it needs a header and a row for each frequency or time")
    if best > MOST_COLUMNS:
        raise Unreadable(f"has {best} columns; export at most {MOST_COLUMNS}")
    return chosen, best


def _start(lines: Sequence[str], separator: str | None, count: int) -> int:
    """Where the table begins: the first row of its shape that another one follows."""
    split = [_cells(line, separator) for line in lines]
    rows = [i for i, cells in enumerate(split) if len(cells) == count and _like_row(cells)]
    numeric = Counter(k for i in rows for k, cell in enumerate(split[i]) if _fits(cell))
    columns = [k for k, times in numeric.items() if 2 * times > len(rows)]
    good = [i for i in rows if all(_fits(split[i][k]) for k in columns)] or rows
    return next((i for i, j in pairwise(good) if j == i + 1), good[0])


def _fits(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None or _STAMP.fullmatch(cell) is not None


def _header(
    above: Sequence[tuple[int, str]], first: Sequence[str], separator: str | None
) -> tuple[list[str], list[str], int]:
    """The names and the units of columns, and the line of these; empty where there is none.

    Args:
        above: the lines above the table, with remarks.
        first: the cells of its first row.
        separator: of these.

    Letters that may be units, and numbers of channels, are names only where there are no others above.
    """
    units, count = [""] * len(first), len(first)
    otherwise: tuple[list[str], list[str], int] = [], [], 0
    for line, text in reversed(above):
        found = next(
            filter(None, (_names(_MARK.sub("", text, 1), each, count) for each in (separator, *SEPARATORS))), None
        )
        if found is None:
            continue
        split = [_heading(each) for each in found]
        below = zip(split, units, strict=True)
        named = [name for name, _ in split], [unit or other for (_, unit), other in below], line
        if all(not name or _is_unit(name) for name in found):
            units = [each.strip("()[] ") for each in found]
        elif _counts(found) or all(not name or name in LETTERS or _is_unit(name) for name in found):
            otherwise = otherwise if otherwise[0] else named
            units = units if _counts(found) else found
        else:
            return named
    return otherwise


def _heading(text: str) -> tuple[str, str]:
    """A name and its unit, in brackets, as in "Acc / g", or at the end of a name that tells what it is, as in acc_g."""
    name, unit = heading(text)
    over = re.fullmatch(r"(.+?)\s+/\s+(\S+)", name)
    if not unit and over and (over[2] in LETTERS or _is_unit(over[2])):
        return over[1], over[2]
    first, _, last = name.lower().rpartition("_")
    units = next((units for words, units in NAMED_WITH_UNITS if re.fullmatch(words, first)), ())
    return name, unit or among(last, units)


def _is_unit(text: str) -> bool:
    """Whether a heading is a unit alone, in brackets or as m/s^2; one letter alone is a name."""
    if re.fullmatch(r"\(.*\)|\[.*\]|-|1", text):
        return True
    known = [*TIMES, *FREQUENCIES, *(unit for each in SIGNALS.values() for unit in each.units if len(unit) > 1)]
    if among(text, known) and (len(text) > 1 or text == "s"):
        return True
    try:
        return bool(density_unit(text).per)
    except ValueError:
        return False


def _names(text: str, separator: str | None, count: int) -> list[str] | None:
    """The names in a line, if it has one for each cell of the rows, or one more for a last column without values."""
    if separator is None:
        found = list(_SPACED.findall(text))
        found = text.split() if len(found) != count else found
    else:
        found = _cells(text, separator)
    if len(found) == count + 1 and separator is not None:
        found = found[:-1]
    if len(found) != count or not any(found) or any("=" in each or len(each) > LONGEST for each in found):
        return None
    return found if not any(map(_is_number, found)) or _counts(found) else None


def _counts(names: Sequence[str]) -> bool:
    """Whether all names but the first are numbers of channels, from 0 or 1 on."""
    first, *tail = names
    return (
        len(tail) > 1
        and not (first and _fits(first))
        and any(tail == [str(begin + k) for k in range(len(tail))] for begin in (0, 1))
    )


def _stamps(columns: _Columns, first: Sequence[str]) -> str:
    """The column of times of the calendar or of a day, if there is one."""
    return next((name for name, k in columns.places.items() if _STAMP.fullmatch(first[k])), "")


def _without_index(columns: _Columns) -> _Columns:
    """The columns but for the first one if that counts the rows, and has no name or is called #."""
    name = next(iter(columns))
    if len(columns) > 2 and name in ("column 1", "#") and not _STAMP.fullmatch(columns.rows.cells(0)[0]):
        values = columns[name].values
        if np.array_equal(values, values[0] + np.arange(values.size)) and values[0] in (0, 1):
            places = {each: k for each, k in columns.places.items() if each != name}
            return _Columns(columns.rows, places, columns.units)
    return columns


def read_peer_table(path: Path, skip: int = 0) -> Table:
    """A record as the PEER ground motion database has it, .AT2 or .VT2: values row by row behind NPTS and DT.

    Raises:
        Unreadable: it has no DT, or not as many values as it states.
    """
    lines = read_text(path, WORDS, may_be_latin=True, most=MOST_TEXT).splitlines()
    new = re.compile(r"NPTS\s*=\s*(?P<count>\d+).*DT\s*=\s*(?P<step>(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?)", re.IGNORECASE)
    old = re.compile(r"\s*(?P<count>\d+)\s+(?P<step>[\d.]+(?:E[+-]?\d+)?)\s+NPTS,\s*DT", re.IGNORECASE)
    heads = enumerate((line[:LONGEST] for line in lines[:20]), 1)
    stated = next(((i, m) for i, line in heads if (m := new.search(line) or old.match(line))), None)
    if stated is None or not float(stated[1]["step"]) > 0:
        raise Unreadable("states no NPTS and DT above its values; export it again, or as .csv")
    values = [
        _number("values", cell, i) for i, line in enumerate(lines[stated[0] :], stated[0] + 1) for cell in line.split()
    ]
    if len(values) != int(stated[1]["count"]):
        raise Unreadable(
            f"states {stated[1]['count']} values and has {len(values)}; copy or export it again", stated[0]
        )
    unit = re.search(r"UNITS OF\s+(\S+)", " ".join(lines[: stated[0]]), re.IGNORECASE)
    column = Column(np.array(values[skip:]), unit[1] if unit else "")
    return Table(path, {"values": column}, rate=1 / float(stated[1]["step"]), kind="record")
