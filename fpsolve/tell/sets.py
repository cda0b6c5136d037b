"""Several sets in one table, a row each: what varies, λ, δ_p, what else is asked for; of many the extreme ones."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Protocol, TypeVar

import numpy as np

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.sections import EXCURSIONS, RESPONSE
from fpsolve.data import short_names, written
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX
from fpsolve.model.quantity import MEAN_SQUARE, STATUS, moment_at
from fpsolve.results.table import Table
from fpsolve.solve.intervals import spreads_of
from fpsolve.solve.set_result import SetResult, Status
from fpsolve.tell.blocks import Block, Column, Grid, Sentence, filled
from fpsolve.tell.numbers import STAR, bounds_text, summary_number_text, told_summary_numbers
from fpsolve.tell.text import (
    DIGITS,
    EACH,
    EXTREMES,
    FAILURES,
    MOMENTS,
    ROWS,
    error_text,
    interval,
    short,
    units_in_words,
)

MAIN = LYAPUNOV_EXPONENT, STABILITY_INDEX
"""The summary numbers that come first, and that have a column over a parameter."""
THEORY = "Eqs. (38)-(39): perturbation theory"
"""The remark on the columns of closed forms."""


class _OfSet(Protocol):
    """What was found of a parameter set."""

    @property
    def parameter_set(self) -> ParameterSet: ...


F = TypeVar("F", bound=_OfSet)
Cells = Iterable[tuple[Column, str]]
"""Columns, each with what stands there of one parameter set."""


def show(case: Case, results: Sequence[SetResult], table: Table) -> Iterator[Block]:
    """What was solved of each parameter set in one grid, and of many parameter sets how many converged."""
    yield set_grid(case, results, table)
    if len(results) <= EACH:
        return
    counts = Counter(_states(table))
    failed, whole = sum(count for each, count in counts.items() if each.fails), counts[Status.CONVERGED]
    kinds = {"converged": whole, "with warnings": counts.total() - whole - failed, "not converged": failed}
    states = ", ".join(f"{count} {kind}" for kind, count in kinds.items() if count)
    is_short = len(results) > ROWS and failed > FAILURES
    shown = f"; the table has the first {FAILURES} that are not converged" if is_short else ""
    yield Sentence(f"{len(results)} parameter sets: {states}{shown}; all numbers are in sets.csv and results.nc")


def _states(table: Table) -> list[Status]:
    """Of all parameter sets of which anything is known."""
    values = table[STATUS.name].values
    return [Status(int(each)) for each in values[~np.isnan(values)].tolist()]


def set_grid(case: Case, results: Sequence[SetResult], table: Table) -> Grid:
    """What was solved of each parameter set, beside perturbation theory.

    Args:
        table: the numbers of all parameter sets.
    """
    status = table[STATUS.name].values
    known, told = ~np.isnan(status), told_summary_numbers(case)
    numbers = {each.symbol: table[each.name].values for each in told}
    for p in _told_moments(case):
        numbers[moment_at(p).symbol] = table[MOMENT.name].values[:, np.flatnonzero(case.p == p)[0]]
    extreme = {symbol: numbers[symbol][known] for symbol in [*numbers][:EXTREMES]}
    failed = [place for place, each in enumerate(_states(table)) if each.fails]
    has_status = any(status[known])

    def cells(result: SetResult) -> Cells:
        yield from _numbers(case, result)
        yield Column("status"), result.status.word if has_status else ""

    grid = grid_of(case, results, cells, extreme, failed)
    headings = [each.heading for each in grid.columns]
    quantities = [each for each in (*told, MEAN_SQUARE) if each.symbol in headings]
    theories = [each for each in headings if each.startswith("Eq.")]
    remarks = [", ".join(f"{each.symbol}: {each.words}" for each in quantities)]
    remarks += [units_in_words(case.units.time, quantities)]
    remarks += [THEORY] * bool(theories) + [STAR] * any("*" in each for each in theories)
    return replace(grid, title="", remark="; ".join(filter(None, remarks)))


def grid_of(
    case: Case,
    found: Sequence[F],
    cells: Callable[[F], Cells],
    numbers: Mapping[str, FloatArray] = MappingProxyType({}),
    failed: Sequence[int] = (),
) -> Grid:
    """A row for what was found of each set, or of more than `ROWS` for the extreme and the first `failed` ones.

    Args:
        cells: of one parameter set.
        numbers: by their headings those of all parameter sets whose extreme ones are sought, NaN where there is none.
        failed: the places of the parameter sets that failed.
    """
    if len(found) <= ROWS:
        reasons: dict[int, list[str]] = {place: [] for place in range(len(found))}
    else:
        reasons = {place: [] for place in failed[:FAILURES]}
        for heading, values in numbers.items():
            if np.isfinite(values).any():
                for word, most in (("least", np.nanargmin), ("largest", np.nanargmax)):
                    reasons.setdefault(int(most(values)), []).append(f"{word} {heading}")
    keys, which, rows = [*map(Column, short_names(case.vary.keys))], Column("which", is_text=True), []
    for place, told in sorted(reasons.items()):
        varied = [written(each) for each in found[place].parameter_set.varied.values()]
        rows.append([*zip(keys, varied, strict=True), *cells(found[place]), (which, ", ".join(told))])
    columns = [column for column, _ in rows[0]] if rows else []
    return filled(case.headline, columns, [[text for _, text in row] for row in rows], keep=numbers)


def _told_moments(case: Case) -> list[float]:
    """The p whose Λ(p) has a column: all of few, or else 2; without summary numbers the first and last."""
    p = [float(each) for each in case.p if each] if MOMENT.name in case.asked else []
    if len(p) > MOMENTS:
        p = [2.0] if 2.0 in p else [] if told_summary_numbers(case) else [p[0], p[-1]]
    return p


def _numbers(case: Case, result: SetResult) -> Cells:
    """What has a column, the most important first: λ, δ_p, Λ at 2 or at the p of a case if few, the others."""
    over_p, told, spreads = case.figure.x == "p", told_summary_numbers(case), spreads_of(case, result).summary_numbers
    lost = [each for each in told if result.estimates[each.name] is None] if result.status.fails else []
    texts = {each: "" if each in lost else summary_number_text(each, result, DIGITS) for each in told}
    for quantity in [each for each in told if each in MAIN]:
        yield Column(quantity.symbol), texts[quantity]
        is_second = quantity == STABILITY_INDEX
        yield Column(f"± {quantity.symbol}", 3 if is_second else 1), error_text(result.estimates[quantity.name])
        if case.uncertain and quantity.name in UNCERTAIN:
            spread = spreads.get(quantity.name)
            yield Column(f"{LEVEL:.0%} of {quantity.symbol}", 1), interval(spread.low, spread.high) if spread else ""
        if not over_p:
            value = quantity.theory(result.parameter_set.problem) if result.parameter_set.is_possible else math.nan
            heading = f"Eq. {quantity.closed_form}{'*' if case.theory_reduces_noise else ''}"
            yield Column(heading, 2), "" if math.isnan(value) else f"{value:.6g}"
    for p in _told_moments(case):
        estimate, symbol = result.moment(p), moment_at(p).symbol
        yield Column(symbol, (1 + (p != 2)) * bool(told)), short(estimate) if estimate else ""
        yield Column(f"± {symbol}", 3), error_text(estimate)
    for rank, quantity in enumerate([each for each in told if each not in MAIN and over_p], 4):
        yield Column(quantity.symbol, rank), texts[quantity]
    if EXCURSIONS in case.asked:
        level = min(case.excursions.levels, key=lambda each: abs(math.log(each / 10)))
        bounds = bounds_text(result.excursion, level) if result.excursion else ""
        yield Column(f"P(sup ‖x‖ ≥ {level:g})", 1), bounds
    if RESPONSE in case.asked:
        means = case.problem.linear.response.means
        for name in {"amplitude_squared"} & means.keys() or means:
            yield Column(means[name].symbol, 1), short(result.response.means[name]) if result.response else ""
