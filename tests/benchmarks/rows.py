"""Tables of measurements, printed row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits


@dataclass(frozen=True)
class Row:
    """A line of the table.

    Attributes:
        name: what is measured.
        asked: what it should be.
        measure: numbers by what they are of; a time is negative where nothing was found in it.
    """

    name: str
    asked: str
    measure: Callable[[], Mapping[str, float]]


def print_rows(rows: Sequence[Row], words: Sequence[str]) -> None:
    """Print those whose name has one of some words, or all without words, each as it is measured, on one thread."""
    console = Console(width=120)
    for row in rows:
        if words and not any(word in row.name for word in words):
            continue
        table = Table(row.name, "", caption=f"asked: {row.asked}", min_width=70)
        with threadpool_limits(1):
            for name, each in row.measure().items():
                table.add_row(name, f"{each:.3g}" if each >= 0 else f"not converged after {-each:.3g}")
        console.print(table)
