"""The four blocks of which all that people see is made: a table, a sentence, a drawing, a note."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fpsolve.messages import Severity

WORDS = {Severity.FAILURE: "not converged", Severity.WARNING: "warning", Severity.NOTE: "note"}
"""How a note begins, in the order in which notes are told."""
TONES = {"ok": "good", "differs": "bad", "not proven": "bad"}
"""The cells that stand out, and how."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        heading: above it.
        rank: where there is no room, columns are left out, that of the largest rank first, of equal ones that on the
            right; with 0 never.
        is_text: whether its entries are words, and not numbers; with rank 0 they may take several lines.
    """

    heading: str
    rank: int = 0
    is_text: bool = False


@dataclass(frozen=True, eq=False)
class Grid:
    """A table.

    Attributes:
        title: above it, or nothing.
        columns: their headings.
        rows: the cells; those of words may have several lines.
        ends: the rows below which there is a line.
        remark: below it, or nothing.
    """

    title: str
    columns: Sequence[Column]
    rows: list[Sequence[str]] = field(default_factory=list)
    ends: set[int] = field(default_factory=set)
    remark: str = ""


def filled(
    title: str, columns: Sequence[Column], rows: Sequence[Sequence[str]], remark: str = "", keep: Container[str] = ()
) -> Grid:
    """A table of those columns that have any entry, or a heading that is to be kept."""
    kept = [i for i, column in enumerate(columns) if column.heading in keep or any(row[i] for row in rows)]
    return Grid(title, [columns[i] for i in kept], [[row[i] for i in kept] for row in rows], remark=remark)


@dataclass(frozen=True)
class Sentence:
    """The meaning of numbers, in one sentence or a few.

    Attributes:
        text: the sentence, or nothing.
        title: what the blocks from here on are about, if something else than before.
    """

    text: str
    title: str = ""


@dataclass(frozen=True)
class Drawing:
    """A picture, which a page has and a terminal has not.

    Attributes:
        title: below it in a page.
        draw: draws it with a heading into files, or does not where there is nothing to draw.
        name: of its own files; empty where it has none.
        heading: in these; a page has one itself.
    """

    title: str
    draw: Callable[[Sequence[Path], str], None]
    name: str = ""
    heading: str = ""

    def write(self, folder: Path) -> None:
        """Draw it as .png and .pdf into a folder, if it has files of its own."""
        if self.name:
            self.draw([folder / f"{self.name}.{ending}" for ending in ("png", "pdf")], self.heading)


@dataclass(frozen=True)
class Note:
    """A limit of the numbers, or a remark.

    Attributes:
        severity: how much it means.
        text: with what it is about.
    """

    severity: Severity
    text: str


Block = Grid | Sentence | Drawing | Note
