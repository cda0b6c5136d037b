"""Several curves in one table, a row each: what varies, λ, δ_p, what else is asked for; of many the extreme ones."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from operator import methodcaller
from typing import Any, NamedTuple

import numpy as np

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import EXCURSIONS, RESPONSE
from fpsolve.data import short_names, written
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX, Index
from fpsolve.model.quantity import MEAN_SQUARE, STATUS, moment_at
from fpsolve.results.table import Table
from fpsolve.solve.curve import CurveResult, Status
from fpsolve.solve.intervals import spreads_of
from fpsolve.tell.blocks import Block, Column, Grid, Sentence
from fpsolve.tell.limits import EACH, EXTREMES, FAILURES, MOMENTS, ROWS
from fpsolve.tell.numbers import STAR, bounds_text, index_text, told_indices
from fpsolve.tell.text import DIGITS, interval, short, units_in_words

MAIN = LYAPUNOV_EXPONENT, STABILITY_INDEX
"""The indices that come first, and that have a column over a parameter."""
THEORY = "Eqs. (38)-(39): perturbation theory"
"""The remark on the columns of closed forms."""


class Shown(NamedTuple):
    """What a column shows of each curve.

    Attributes:
        column: its place.
        text: what stands there, also where there is no number.
        numbers: those of all curves, of which the extreme ones are sought, NaN where there is none; None for the
            other columns.
    """

    column: Column
    text: Callable[[Any], str]
    numbers: FloatArray | None = None


def show(case: Case, results: Sequence[CurveResult], table: Table) -> Iterator[Block]:
    """What was solved of each curve in one grid, and of many curves how many converged."""
    yield curve_grid(case, results, table)
    if len(results) <= EACH:
        return
    counts = Counter(_status(table))
    failed, whole = sum(count for each, count in counts.items() if each.fails), counts[Status.CONVERGED]
    kinds = {"converged": whole, "with warnings": counts.total() - whole - failed, "not converged": failed}
    states = ", ".join(f"{count} {kind}" for kind, count in kinds.items() if count)
    is_short = len(results) > ROWS and failed > FAILURES
    shown = f"; of those that are not converged the first {FAILURES} are shown" if is_short else ""
    yield Sentence(f"{len(results)} curves: {states}{shown}; all numbers are in curves.csv and results.nc")


def curve_grid(case: Case, results: Sequence[CurveResult], table: Table) -> Grid:
    """What was solved of each curve, beside perturbation theory.

    Args:
        table: the numbers of all curves.
    """
    shown, status = list(_quantities(case, table)), _status(table)
    if any(status):
        shown.append(Shown(Column("status"), lambda result: result.status.word))
    grid = grid_of(case, results, shown, [place for place, each in enumerate(status) if each.fails])
    headings = [each.heading for each in grid.columns]
    numbers = [each for each in (*told_indices(case), MEAN_SQUARE) if each.symbol in headings]
    units, theories = units_in_words(case.units.time, numbers), [each for each in headings if each.startswith("Eq.")]
    told = [", ".join(f"{each.symbol}: {each.words}" for each in numbers)] + [units] * bool(units)
    told += [THEORY] * bool(theories) + [STAR] * any("*" in each for each in theories)
    return replace(grid, title="", remark="; ".join(told))


def grid_of(case: Case, found: Sequence[Any], shown: Iterable[Shown], failed: Sequence[int] = ()) -> Grid:
    """A row for what was found of each curve, or of more than `ROWS` for the extreme and the first `failed` ones."""
    shown = [each for each in shown if each.numbers is not None or any(map(each.text, found))]
    is_digest = len(found) > ROWS
    chosen = _chosen(found, shown, failed) if is_digest else [(each, "") for each in found]
    columns = [Column(name) for name in short_names(case.vary.keys)] + [each.column for each in shown]
    grid = Grid(case.headline, columns + [Column("which", is_text=True)] * is_digest)
    for each, which in chosen:
        texts = [column.text(each) for column in shown]
        grid.rows.append([*map(written, each.curve.varied.values()), *texts, *[which] * is_digest])
    return grid


def _chosen(found: Sequence[Any], shown: Sequence[Shown], failed: Sequence[int]) -> list[tuple[Any, str]]:
    """What has the extreme values of the first quantities, and some that failed, each with the reason."""
    reasons: dict[int, list[str]] = {place: [] for place in failed[:FAILURES]}
    for column, _, numbers in [each for each in shown if each.numbers is not None][:EXTREMES]:
        if numbers is not None and np.isfinite(numbers).any():
            for word, place in (("least", np.nanargmin(numbers)), ("largest", np.nanargmax(numbers))):
                reasons.setdefault(int(place), []).append(f"{word} {column.heading}")
    return [(found[place], ", ".join(told)) for place, told in sorted(reasons.items())]


def _status(table: Table) -> list[Status]:
    """Of all curves that are known."""
    values = table[STATUS.name].values
    return [Status(int(each)) for each in values[~np.isnan(values)].tolist()]


def _quantities(case: Case, table: Table) -> Iterator[Shown]:
    """What has a column, the most important first: λ, δ_p, Λ at 2 or at the p of a case if few, the other indices."""
    known = ~np.isnan(table[STATUS.name].values)
    over_p, told = case.figure.x == "p", told_indices(case)
    for index in [each for each in told if each in MAIN]:
        yield Shown(Column(index.symbol), partial(_index, index), table[index.name].values[known])
        yield Shown(
            Column(f"± {index.symbol}", 3 if index == STABILITY_INDEX else 1),
            partial(_error, partial(_estimate, index)),
        )
        if case.uncertain and index.name in UNCERTAIN:
            yield Shown(Column(f"{LEVEL:.0%} of {index.symbol}", 1), partial(_interval, case, index.name))
        if not over_p:
            heading = f"Eq. {index.closed_form}{'*' if case.theory_reduces_noise else ''}"
            yield Shown(Column(heading, 2), partial(_theory, index))
    p = [float(each) for each in case.p if each] if MOMENT.name in case.asked else []
    if len(p) > MOMENTS:
        p = [2.0] if 2.0 in p else [] if told else [p[0], p[-1]]
    for each in p:
        of, about, rank = methodcaller("moment", each), moment_at(each), (1 + (each != 2)) * bool(told)
        values = table[MOMENT.name].values[known][:, np.flatnonzero(case.p == each)[0]]
        yield Shown(Column(about.symbol, rank), partial(_number, of), values)
        yield Shown(Column(f"± {about.symbol}", 3), partial(_error, of))
    for rank, index in enumerate([each for each in told if each not in MAIN and over_p], 4):
        yield Shown(Column(index.symbol, rank), partial(_index, index), table[index.name].values[known])
    if EXCURSIONS in case.asked:
        level = min(case.excursions.levels, key=lambda each: abs(math.log(each / 10)))
        yield Shown(
            Column(f"P(sup ‖x‖ ≥ {level:g})", 1),
            lambda result: bounds_text(result.excursion, level) if result.excursion else "",
        )
    if RESPONSE in case.asked:
        means = case.problem.linear.response.means
        for name in {"amplitude_squared"} & means.keys() or means:
            yield Shown(Column(means[name].symbol, 1), partial(_mean, name))


def _index(index: Index, result: CurveResult) -> str:
    is_lost = result.estimates[index.name] is None and result.status.fails
    return "" if is_lost else index_text(index, result, DIGITS)


def _estimate(index: Index, result: CurveResult) -> Estimate | None:
    return result.estimates[index.name]


def _number(of: Callable[[Any], Estimate | None], result: CurveResult) -> str:
    return short(found) if (found := of(result)) else ""


def _error(of: Callable[[Any], Estimate | None], result: CurveResult) -> str:
    return f"{found.error_estimate:.0e}" if (found := of(result)) else ""


def _mean(name: str, result: CurveResult) -> str:
    return short(result.response.means[name]) if result.response else ""


def _interval(case: Case, name: str, result: CurveResult) -> str:
    spread = spreads_of(case, result).indices.get(name)
    return "" if spread is None else interval(spread.low, spread.high)


def _theory(index: Index, result: CurveResult) -> str:
    value = index.theory(result.curve.problem) if result.curve.is_possible else math.nan
    return "" if math.isnan(value) else f"{value:.6g}"
