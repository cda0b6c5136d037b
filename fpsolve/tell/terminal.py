"""Blocks on a terminal, whose width nothing exceeds, or in a file, which takes any line.

Nothing is cut, and no word and no number is broken.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from shutil import get_terminal_size
from textwrap import TextWrapper

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fpsolve.messages import Severity, escaped
from fpsolve.tell.blocks import TONES, WORDS, Block, Column, Grid, Note, Sentence

ENDLESS = 1_000_000
"""The width of what is not a terminal."""
STYLES = {"good": "green", "bad": "bold red"}
"""The styles of cells that stand out."""
COLOURS = {Severity.FAILURE: "bold red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}
"""The styles of notes."""


def print_blocks(blocks: Iterable[Block], severities: Collection[Severity] = tuple(Severity)) -> None:
    """Print tables and sentences on the standard output, and notes of some severities on the standard error."""
    output, errors = Screen(), Screen(errors=True)
    has_begun = has_grid = False
    for block in blocks:
        if isinstance(block, Note):
            if block.severity in severities:
                errors.say(f"{WORDS[block.severity]}: {block.text}", COLOURS[block.severity])
        elif isinstance(block, Grid | Sentence):
            if block.title:
                output.say("\n" * has_begun + block.title, "italic")
            if isinstance(block, Grid):
                output.show(block)
                has_grid = True
            elif block.text:
                output.say(block.text)
            has_begun = True
    if has_grid:
        output.say("")


class Screen:
    """The standard output, or errors; what is no terminal takes lines of any length."""

    def __init__(self, *, errors: bool = False) -> None:
        self.console = Console(stderr=errors)
        width, height = get_terminal_size(self.console.size)  # of a dumb terminal rich takes 80 columns
        self.width = width if self.console.file.isatty() else ENDLESS
        self.console.size = self.width, height

    def say(self, text: str, style: str = "") -> None:
        """Print a text in lines that fit, indented from the second one on; its own line ends remain."""
        for line in text.split("\n"):
            for each in wrapped(escaped(line), self.width - 1):
                self.console.print(Text(each), style=style, soft_wrap=True)

    def show(self, grid: Grid) -> None:
        """Print a table of as many columns as there is room for; where there is too little, "heading = number" lines.

        Where it has too little room, rich would break numbers; so columns and the breaks of headings are chosen here.
        """
        columns = [replace(each, heading=escaped(each.heading)) for each in grid.columns]
        rows = [[Text(escaped(each), STYLES.get(TONES.get(each, ""), "")) for each in row] for row in grid.rows]
        chosen = self._layout(columns, rows)
        if chosen is None:
            for row in rows:
                told = zip(columns, row, strict=True)
                lines = (f"{column.heading} = {cell}".removeprefix(" = ") for column, cell in told if cell)
                self.say("\n  ".join(line.replace("\n", " ") for line in lines))
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
            if left_out := [column.heading for i, column in enumerate(columns) if i not in kept]:
                self.say(f"no room for: {', '.join(left_out)}", "dim")
        if grid.remark:
            self.say(grid.remark, "dim italic")

    def _layout(self, columns: Sequence[Column], rows: Sequence[Sequence[Text]]) -> tuple[list[int], bool] | None:
        """The columns that are shown, and whether their headings are in several lines; None where no table fits."""

        def needed(i: int) -> int:
            is_broken = columns[i].is_text and not columns[i].rank
            heading = columns[i].heading.split() if is_folded or is_broken else [columns[i].heading]
            parts = [part for row in rows for part in row[i].plain.split(None if is_broken else "\n")]
            return max(map(cell_len, [*heading, *parts]))

        kept = list(range(len(columns)))
        leaving = sorted((i for i in kept if columns[i].rank), key=lambda i: columns[i].rank)
        while True:
            for is_folded in (False, True):
                if sum(needed(i) + 3 for i in kept) + 1 <= self.width:
                    return kept, is_folded
            if not leaving:
                return None
            kept.remove(leaving.pop())


def wrapped(text: str, width: int) -> list[str]:
    """A text in lines of at most this width, but for longer words; those from the second on are indented."""
    start = text[: len(text) - len(text.lstrip())]
    wrapper = TextWrapper(max(width, 20), start, start + "  ", break_long_words=False, break_on_hyphens=False)
    return wrapper.wrap(text.strip()) or [""]
