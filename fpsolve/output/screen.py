"""Where words and tables are printed: a terminal, whose width nothing exceeds, or a file, which takes any line.

Nothing is cut, and no word and no number is broken.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from textwrap import TextWrapper

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fpsolve.messages import escaped
from fpsolve.output.letters import spelt

ENDLESS = 1_000_000
"""The width of what is not a terminal."""
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
            from shutil import get_terminal_size  # with its compression it takes longer than the rest

            size = get_terminal_size()  # rich takes 80 columns
            console = Console(stderr=errors, width=size.columns, height=size.lines)
        return cls(console, console.width)

    def lines(self, texts: Sequence[str], style: str = "") -> None:
        for text in texts:
            self.console.print(Text(self._spelt(text)), style=style, soft_wrap=True)

    def say(self, text: str, style: str = "") -> None:
        """Print a text in lines that fit, indented from the second one on; its own line ends remain."""
        for line in text.split("\n"):
            self.lines(wrapped(self._spelt(line), self.width - 1), style)

    def packed(self, parts: Sequence[str], indent: str = "", hang: str = "") -> None:
        """Print texts in as few lines as hold them whole; from the second line on they are indented by `hang` more."""
        room = (80 if self.width == ENDLESS else self.width) - 1 - len(indent + hang)
        lines: list[str] = []
        for part in map(self._spelt, parts):
            if lines and cell_len(lines[-1]) + 3 + cell_len(part) <= room:
                lines[-1] += f"   {part}"
            else:
                lines.append(part)
        for number, line in enumerate(lines):
            start = indent + hang if number else indent
            self.lines(wrapped(start + line, self.width - 1, start + "  "))

    def show(self, grid: Grid) -> None:
        """Print a table of as many columns as there is room for; where there is too little, "heading = number" lines.

        Where it has too little room, rich would break numbers; so columns and the breaks of headings are chosen here.
        """
        self.say(grid.title, "italic")
        columns = [replace(each, heading=self._spelt(each.heading)) for each in grid.columns]
        rows = [[self._cell(each) for each in row] for row in grid.rows]
        chosen = self._layout(columns, rows)
        if chosen is None:
            for row in rows:
                parts = []
                for column, cell in zip(columns, row, strict=True):
                    first, *others = cell.plain.split("\n")
                    parts += [f"{column.heading} = {first}" if first and column.heading else first, *others]
                self.packed(list(filter(None, parts)), hang="  ")
        else:
            kept, is_folded = chosen
            table = Table()
            for i in kept:
                if columns[i].is_text:
                    table.add_column(Text(columns[i].heading), overflow="fold")
                else:
                    heading = columns[i].heading.replace(" ", "\n") if is_folded else columns[i].heading
                    table.add_column(Text(heading), justify="right", no_wrap=True)
            for number, row in enumerate(rows):
                table.add_row(*(row[i] for i in kept), end_section=number in grid.ends)
            self.console.print(table)
            left_out = [column.heading for i, column in enumerate(columns) if i not in kept]
            if left_out:
                self.say(f"no room for: {', '.join(left_out)}", "dim")
        if grid.remark:
            self.say(grid.remark, "dim italic")

    def _layout(self, columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> tuple[list[int], bool] | None:
        """The columns that are shown, and whether their headings are in several lines; None where no table fits."""

        def needed(i: int) -> int:
            is_text = columns[i].is_text
            heading = columns[i].heading.split() if is_folded or is_text else [columns[i].heading]
            parts = [part for row in rows for part in row[i].plain.split(None if is_text else "\n")]
            return max(map(cell_len, [*heading, *parts]), default=0)

        kept = list(range(len(columns)))
        leaving = sorted((i for i in kept if columns[i].rank), key=lambda i: columns[i].rank)
        while True:
            for is_folded in (False, True):
                if sum(needed(i) + 3 for i in kept) + 1 <= self.width:
                    return kept, is_folded
            if not leaving:
                return None
            kept.remove(leaving.pop())

    def _spelt(self, text: str) -> str:
        return spelt(escaped(text), self.console.encoding)

    def _cell(self, cell: Cell) -> Text:
        text = Text(cell) if isinstance(cell, str) else cell
        plain = self._spelt(text.plain)
        return text if plain == text.plain else Text(plain, text.style)


def wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    """A text in lines of at most this width, but for longer words; those from the second on are indented.

    "D0 = 0.1" and "0.1 ± 1e-3" stay together where they fit.
    """
    start = text[: len(text) - len(text.lstrip())]
    wrapper = TextWrapper(max(width, 20), start, indent, break_long_words=False, break_on_hyphens=False)
    tied = _TIE.sub(lambda found: found[0].replace(" ", _TIED), text.strip())
    lines = wrapper.wrap(tied) or [""]
    if max(map(len, lines)) > width:
        lines = wrapper.wrap(text.strip()) or [""]
    return [line.replace(_TIED, " ") for line in lines]


_TIE, _TIED = re.compile(r"(?<=\S) (=|±|<=|<|>) (?=\S)"), "\0"
