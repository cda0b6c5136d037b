"""Where words and tables are printed: a terminal, whose width nothing exceeds, or a file, which takes any line.

Nothing is cut, and no word and no number is broken.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from textwrap import wrap

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fpsolve.letters import spelt

ENDLESS = 1_000_000
"""The width of what is no terminal."""
Cell = str | Text


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        heading: above it.
        rank: where there is no room, columns are left out, that of the largest rank first, of equal ones that on the
            right; with 0 never.
        is_text: whether its entries are sentences, which may take several lines, and not numbers.
    """

    heading: str
    rank: int = 0
    is_text: bool = False


@dataclass(frozen=True, eq=False)
class Grid:
    """A table.

    Attributes:
        title: above it.
        columns: their headings.
        rows: the cells; those of sentences may have several lines.
        ends: the rows below which there is a line.
        remark: below it, or nothing.
    """

    title: str
    columns: Sequence[Column]
    rows: list[Sequence[Cell]] = field(default_factory=list)
    ends: set[int] = field(default_factory=set)
    remark: str = ""


@dataclass(frozen=True)
class Screen:
    """The standard output, or errors.

    Attributes:
        console: which prints.
        width: of the terminal, or `ENDLESS`.
    """

    console: Console
    width: int

    @classmethod
    def of(cls, *, errors: bool = False) -> Screen:
        console = Console(stderr=errors)
        if not console.file.isatty():
            console = Console(stderr=errors, width=ENDLESS)
        elif console.is_dumb_terminal:
            size = shutil.get_terminal_size()  # rich takes 80 columns
            console = Console(stderr=errors, width=size.columns, height=size.lines)
        return cls(console, console.width)

    def lines(self, texts: Sequence[str], style: str = "") -> None:
        """Lines as they are."""
        for text in texts:
            self.console.print(Text(spelt(text, self.console.encoding)), style=style, soft_wrap=True)

    def say(self, text: str, style: str = "") -> None:
        """A text in lines that fit, indented from the second one on; those that it has remain."""
        for line in text.split("\n"):
            self.lines(wrapped(spelt(line, self.console.encoding), self.width - 1), style)

    def packed(self, parts: Sequence[str], indent: str = "", hang: str = "") -> None:
        """Texts in as few lines as hold them whole; those from the second on are indented by `hang` more."""
        room = (80 if self.width == ENDLESS else self.width) - 1 - len(indent + hang)
        lines: list[str] = []
        for part in (spelt(each, self.console.encoding) for each in parts):
            if lines and cell_len(lines[-1]) + 3 + cell_len(part) <= room:
                lines[-1] += f"   {part}"
            else:
                lines.append(part)
        for number, line in enumerate(lines):
            start = indent + hang if number else indent
            self.lines(wrapped(start + line, self.width - 1, start + "  "))

    def show(self, grid: Grid) -> None:
        """A table in as many columns as there is room for; in lines of "heading = number" where there is too little."""
        self.say(grid.title, "italic")
        grid = self._spelt(grid)
        chosen = next(_layouts(grid, self.width), None)
        if chosen is None:
            self._list(grid)
        else:
            self.console.print(_table(grid, *chosen))
            left_out = [column.heading for i, column in enumerate(grid.columns) if i not in chosen[0]]
            if left_out:
                self.say(f"no room for: {', '.join(left_out)}", "dim")
        if grid.remark:
            self.say(grid.remark, "dim italic")

    def _spelt(self, grid: Grid) -> Grid:
        """A table as the encoding of the output can show it."""
        encoding = self.console.encoding
        columns = [Column(spelt(each.heading, encoding), each.rank, each.is_text) for each in grid.columns]
        rows: list[Sequence[Cell]] = [[_spelt_cell(cell, encoding) for cell in row] for row in grid.rows]
        return Grid(grid.title, columns, rows, grid.ends, grid.remark)

    def _list(self, grid: Grid) -> None:
        for row in grid.rows:
            parts = []
            for column, cell in zip(grid.columns, row, strict=True):
                first, *others = str(cell).split("\n")
                parts += [f"{column.heading} = {first}" if first and column.heading else first, *others]
            self.packed(list(filter(None, parts)), hang="  ")


def wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    """A text in lines of at most this width, but for longer words; those from the second on are indented.

    "D0 = 0.1" and "0.1 ± 1e-3" stay together where they fit.
    """
    tied = _TIE.sub(lambda found: found[0].replace(" ", _TIED), text)
    lines = _lines(tied, width, indent)
    if max(map(len, lines)) > width:
        lines = _lines(text, width, indent)
    return [line.replace(_TIED, " ") for line in lines]


_TIE, _TIED = re.compile(r"(?<=\S) (=|±|<=|<|>) (?=\S)"), "\0"


def _lines(text: str, width: int, indent: str) -> list[str]:
    start = text[: len(text) - len(text.lstrip())]
    lines = wrap(
        text.strip(),
        max(width, 20),
        initial_indent=start,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return lines or [""]


def _layouts(grid: Grid, width: int) -> Iterator[tuple[list[int], bool]]:
    """The columns that may be shown, and whether their headings are in several lines, the best first."""
    leaving = sorted((column.rank, i) for i, column in enumerate(grid.columns) if column.rank)
    kept = list(range(len(grid.columns)))
    while True:
        for is_folded in (False, True):
            needed = sum(_width(grid, i, is_folded=is_folded) for i in kept) + 3 * len(kept) + 1
            if needed <= width:
                yield kept, is_folded
        if not leaving:
            return
        kept = [i for i in kept if i != leaving[-1][1]]
        leaving.pop()


def _width(grid: Grid, i: int, *, is_folded: bool) -> int:
    """The least width of a column."""
    column = grid.columns[i]
    heading = column.heading.split() if is_folded or column.is_text else [column.heading]
    cells = [str(row[i]) for row in grid.rows]
    parts = [part for cell in cells for part in (cell.split() if column.is_text else cell.split("\n"))]
    return max(map(cell_len, [*heading, *parts]), default=0)


def _table(grid: Grid, kept: Sequence[int], is_folded: bool) -> Table:
    table = Table()
    for column in (grid.columns[i] for i in kept):
        heading = Text(column.heading.replace(" ", "\n") if is_folded and not column.is_text else column.heading)
        if column.is_text:
            table.add_column(heading, overflow="fold")
        else:
            table.add_column(heading, justify="right", no_wrap=True)
    for number, row in enumerate(grid.rows):
        cells = [Text(cell) if isinstance(cell, str) else cell for cell in (row[i] for i in kept)]
        table.add_row(*cells, end_section=number in grid.ends)
    return table


def _spelt_cell(cell: Cell, encoding: str) -> Cell:
    if isinstance(cell, str):
        return spelt(cell, encoding)
    return cell if spelt(cell.plain, encoding) == cell.plain else Text(spelt(cell.plain, encoding), style=cell.style)
