"""The comparisons of a check as a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fpsolve.case.case import Case
from fpsolve.data import short_names, written
from fpsolve.exponent.error import digits
from fpsolve.solve.check import Comparison
from fpsolve.tell.blocks import Block, Column, Grid, Sentence
from fpsolve.tell.text import EACH, ROWS


def show(case: Case, comparisons: Sequence[Comparison]) -> Iterator[Block]:
    """A row for each value, or of many values for those that differ, and how many agree."""
    if not comparisons:
        yield Sentence(f"{case.name}: nothing is expected; add [[expect]] to the case")
        return
    shown = comparisons if len(comparisons) <= ROWS else [each for each in comparisons if not each.met]
    if shown:
        yield _grid(case, shown[:ROWS], is_short=len(comparisons) > EACH)
    if len(shown) > ROWS:
        yield Sentence(f"{case.name}: {len(shown) - ROWS} more differ")
    yield Sentence(agreement(comparisons) if shown else f"{case.name}: {agreement(comparisons)}")


def agreement(comparisons: Sequence[Comparison]) -> str:
    """How many agree: "3 of 4 ok"."""
    return f"{sum(item.met for item in comparisons)} of {len(comparisons)} ok"


def _grid(case: Case, comparisons: Sequence[Comparison], *, is_short: bool) -> Grid:
    """A row for each value: with its source, or in one line, with two digits more than the tolerance has."""
    first = (
        [Column("quantity"), *map(Column, short_names(case.vary.keys))]
        if is_short
        else [Column("quantity", is_text=True)]
    )
    tolerance = [Column("±", 2)] if is_short else []
    numbers = [Column("expected"), *tolerance, Column("computed"), Column("difference", 1), Column("")]
    grid = Grid(f"{case.name}: {case.headline}", [*first, *numbers])
    for item in comparisons:
        wanted, value = item.expectation, item.value
        quantity = wanted.quantity if wanted.p is None else f"{wanted.quantity}, p = {wanted.p:g}"
        error = f"{item.tolerance:.0e}"
        expected, computed = (
            "none" if each is None else digits(each, item.tolerance / 100, 12) if is_short else f"{each:.12g}"
            for each in (wanted.value, value)
        )
        if is_short:
            row = [quantity, *map(written, item.varied.values()), expected, error, computed]
        else:
            where = "".join(f"\n{key} = {written(each)}" for key, each in item.varied.items())
            row = [f"{quantity}{where}\n{wanted.source}", f"{expected}\n± {error}", computed]
            grid.ends.add(len(grid.rows))
        difference = "" if value is None else f"{value - wanted.value:.1e}"
        grid.rows.append([*row, difference, "ok" if item.met else "differs"])
    return grid
