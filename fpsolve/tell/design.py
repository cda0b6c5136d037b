"""A design as a table, or the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterator

from fpsolve.case.case import Case
from fpsolve.data import short_names
from fpsolve.exponent.error import digits
from fpsolve.solve.design import DesignOutcome
from fpsolve.tell.blocks import Block, Column, Grid, Sentence
from fpsolve.tell.notes import note_on
from fpsolve.tell.text import error_text, plural


def show(case: Case, outcome: DesignOutcome) -> Iterator[Block]:
    """The parameters, and how near the wanted value is; or the reason."""
    found, keys = outcome.found, [axis.key for axis in outcome.by]
    if outcome.reason is not None:
        yield note_on(case.name, outcome.reason)
    if found is None:
        return
    columns = [Column("parameter"), Column("before"), Column("after"), Column("± error", 1), Column("unit", 2)]
    grid = Grid(case.headline, columns)
    for key, name in zip(keys, short_names(keys), strict=True):
        value = found.values[key]
        numbers = digits(value.value, value.error_estimate), error_text(value)
        grid.rows.append([name, f"{found.start.values[key]:.10g}", *numbers, case.about(key).unit_in_words])
    yield grid
    symbol, value = outcome.target.quantity.symbol, found.found
    met = digits(value.value, value.error_estimate)
    solves = f"{found.solves} {plural('solve', found.solves)}"
    yield Sentence(f"{symbol} = {met} ± {error_text(value)}; wanted {outcome.target.value:.10g}; {solves}")
    if len(keys) > 1:
        measures = ", ".join(f"{key} / {outcome.units[key]:.6g}" for key in keys)
        told = f"the square root of the sum of the squares of the changes of {measures}"
        yield Sentence(f"This is the nearest such point. Its distance, {told}, is {found.distance:.6g}.")


def found_of(outcome: DesignOutcome) -> str:
    """What was written: "design.toml, 4 solves"."""
    found = outcome.found
    return "no design" if found is None else f"design.toml, {found.solves} {plural('solve', found.solves)}"
