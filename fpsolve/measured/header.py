"""Names and units of columns from the lines above them: the only place where the words of a file are read."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

from fpsolve.files import Unreadable
from fpsolve.measured.signals import has_dimension

SEPARATORS = ("\t", ";", ",", "")
"""Of cells; the last one is any number of spaces."""
KNOWN = ("s", "Hz", "rad/s", "m", "m/s", "m/s^2", "V", "(m/s^2)^2/Hz", "m^2/Hz", "V^2/Hz", "1/Hz")
"""Units by whose kinds a line of units is told from one of names."""
LONGEST = 60
"""Letters of a name, and of what a file seems to say."""
_MARK = re.compile(r"\s*(?:#+|%+|//+)\s?")
_HEADING = re.compile(r"(?P<name>.*?)\s*(?:/\s*)?(?:\[(?P<a>[^\]]*)\]|\((?P<b>.*)\))|(?P<bare>.+?)\s+/\s+(?P<c>\S+)")
_TIMES = re.compile(
    r"(?:t|times?|timestamp|zeit)[ _](?P<unit>s|ms|us|ns)|"
    r"(?P<word>millis|micros|(?:milli|micro|nano)?seconds|sec)(?:_elapsed)?",
    re.IGNORECASE,
)
_ARITHMETIC = re.compile(r"log|[*×^]|\de[+-]?\d|^\d+\s*\D", re.IGNORECASE)
"""In a heading: its unit may not be that of the numbers."""
STAMP = re.compile(r"\d{4}[-/]\d\d?[-/]\d\d?.*|\d\d?[/.]\d\d?[/.]\d\d.*|([01]?\d|2[0-3]):\d\d:\d\d(\.\d+)?")
"""A time of a calendar, or of a clock."""
_WORDS = re.compile(r"[\s:;,=\[\]_]+|\((?=\w*\))|(?<=\w)\)")
_BRACKETS = re.compile(r"^[\[(]([^\[\]()]*)[\])]$")
_SPACED = re.compile(r"\S+(?:[ \t]+(?:\[.*?\]|\(.*?\)(?=\s|$)))?")
_NUMBER = re.compile(r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[ed][+-]?\d++)?|nan", re.IGNORECASE)


def without_mark(line: str) -> tuple[bool, str]:
    """Whether a line is a remark, behind #, % or //, and what it says."""
    found = _MARK.match(line)
    return (True, line[found.end() :]) if found else (False, line)


def is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def cells_of(line: str, separator: str) -> list[str]:
    """Raises Unreadable where the quotes of a line are wrong."""
    if not separator:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line.strip("\n")], delimiter=separator), [])]
    except csv.Error as error:
        raise Unreadable(f"is no table ({error}); export it again") from None


def heading(text: str) -> tuple[str, str]:
    """The name and the unit of a column: "a (m/s²)", "a [m/s²]", "a / (m/s²)", "a / g"; of times "millis", "t_ms"."""
    text = text.strip()
    if found := _HEADING.fullmatch(text):
        name, unit = found["name"] or found["bare"] or "", found["a"] or found["b"] or found["c"] or ""
        return (text, "") if _ARITHMETIC.search(name) else (name.strip(), unit.strip())
    found = _TIMES.fullmatch(text)
    return text, (found["unit"] or found["word"]).lower() if found else ""


def header(above: Sequence[str], count: int, separator: str) -> tuple[list[str], list[str]]:
    """The names of some columns, and the units below these, by the lines above; no names where there are none.

    The names stand in the last line with one for each column, or in the one before where that has units. The files of
    Campbell have a line below with what was done.
    """
    lines = [without_mark(each)[1] for each in above]
    if is_of_campbell := bool(lines) and lines[0].startswith('"TOA5"'):
        del lines[3:]
    rows = [row for line in reversed(lines) if (row := _row(line, count, separator))]
    if not rows or (count == 1 and len(lines) > 1):  # any line may be that of one column
        return [], [""] * count
    below = [_BRACKETS.sub(r"\1", each) for each in rows[0]]
    known = [has_dimension(each, *KNOWN) for each in below if each]
    if len(rows) > 1 and (is_of_campbell or 2 * sum(known) > len(known)):
        return rows[1], below
    return rows[0], [""] * count


def _row(line: str, count: int, separator: str) -> list[str] | None:
    """The cells of a line that has one for each column, and perhaps an empty one more."""
    for each in dict.fromkeys((separator, *SEPARATORS)):
        found = cells_of(line, each)
        if not each and len(found) != count:
            found = _SPACED.findall(line)
        found = found[:count] if not any(found[count:]) else found
        if len(found) == count and any(found) and not any("=" in each or len(each) > LONGEST for each in found):
            return found
    return None


def hint(lines: Sequence[str], dimensions: Sequence[str]) -> str:
    """The first line in which a unit of some kinds stands; empty if none has one."""
    for line in lines:
        if any(has_dimension(word, *dimensions) for word in _WORDS.split(line)):
            return " ".join(line.split())[:LONGEST]
    return ""
