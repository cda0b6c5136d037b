"""Intervals of the numbers of a case whose parameters are uncertain."""

from __future__ import annotations

from collections.abc import Iterator

from fpsolve.analysis.spreads import LEVEL
from fpsolve.case.case import Case
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT
from fpsolve.model.quantity import moment_at
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.parts.intervals import Samples, spreads_of
from fpsolve.show.text import interval, percent
from fpsolve.study.results import CurveResult


def show(case: Case, result: CurveResult) -> Iterator[Sentence]:
    """With which probability λ and Λ(2), or else the first Λ(p), have their sign, to first order."""
    spreads = spreads_of(case, result)
    exponent = spreads.indices.get(LYAPUNOV_EXPONENT.name)
    chosen = [(LYAPUNOV_EXPONENT.symbol, exponent)] if exponent else []
    p = 2.0 if 2.0 in spreads.moments else next(iter(spreads.moments), None)
    chosen += [(moment_at(p).symbol, spreads.moments[p])] if p is not None else []
    told = []
    for symbol, spread in chosen:
        is_below = spread.below >= 0.5
        sure = percent(spread.below if is_below else 1 - spread.below)
        told.append(f"{symbol} {'<' if is_below else '>'} 0 with {sure}")
    if told:
        yield Sentence(f"As parameters are uncertain, {', and '.join(told)}.")


def show_samples(case: Case, samples: Samples) -> Iterator[Block]:
    """The intervals of the samples, their medians, and the intervals to first order."""
    columns = [Column("quantity"), Column(f"samples, {LEVEL:.0%}"), Column("median", 1), Column("P(< 0)")]
    remark = f"{samples.planned} samples of a Latin hypercube, seed {samples.seed}"
    grid = Grid(case.headline, [*columns, Column(f"first order, {LEVEL:.0%}"), Column("apart", 2)], remark=remark)
    for each in samples.rows:
        is_there = each.count > 0
        numbers = [interval(each.low, each.high), f"{each.median:.6g}", percent(each.below)]
        first = interval(each.spread.low, each.spread.high)
        apart = f"{each.apart:.0%}" if is_there else ""
        grid.rows.append([each.quantity.symbol, *(numbers if is_there else ["none", "", ""]), first, apart])
    yield grid
