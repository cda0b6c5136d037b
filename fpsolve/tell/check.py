"""The comparisons of a check as a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fpsolve.case.case import Case
from fpsolve.data import written
from fpsolve.exponent.error import digits
from fpsolve.solve.check import Comparison
from fpsolve.tell.blocks import Block, Column, Grid, Sentence
from fpsolve.tell.text import EACH, ROWS


def show(case: Case, comparisons: Sequence[Comparison]) -> Iterator[Block]:
    """A row for each value, or of many values for those that differ, and how many agree."""
    if not comparisons:
        yield Sentence(f"{case.name}: the case expects no value; add [[expect]] to it")
        return
    shown = comparisons if len(comparisons) <= ROWS else [each for each in comparisons if not each.met]
    if shown:
        yield _grid(case, shown[:ROWS], is_short=len(comparisons) > EACH)
    if len(shown) > ROWS:
        yield Sentence(f"{case.name}: {len(shown) - ROWS} more values differ")
    yield Sentence(agreement(comparisons) if shown else f"{case.name}: {agreement(comparisons)}")


def agreement(comparisons: Sequence[Comparison]) -> str:
    """How many agree: "3 of 4 ok"."""
    return f"{sum(item.met for item in comparisons)} of {len(comparisons)} ok"


def _grid(case: Case, comparisons: Sequence[Comparison], *, is_short: bool) -> Grid:
    """A row for each value: in one line, or with its source, with two digits more than the tolerance has."""
    numbers = Column("expected"), Column("±", 2), Column("computed"), Column("difference", 1), Column("")
    grid = Grid(f"{case.name}: {case.headline}", [Column("quantity", is_text=True), *numbers])
    for item in comparisons:
        wanted, value, error = item.expectation, item.value, item.tolerance
        quantity = wanted.quantity if wanted.p is None else f"{wanted.quantity}, p = {wanted.p:g}"
        about = [quantity, *(f"{key} = {written(each)}" for key, each in item.varied.items())]
        if not is_short:
            about.append(wanted.source)
            grid.ends.add(len(grid.rows))
        expected, computed = (
            "none" if each is None else digits(each, error / 100, 12) for each in (wanted.value, value)
        )
        difference = "" if value is None else f"{value - wanted.value:.1e}"
        named = (", " if is_short else "\n").join(about)
        grid.rows.append([named, expected, f"{error:.0e}", computed, difference, "ok" if item.met else "differs"])
    return grid
