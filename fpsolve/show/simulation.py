"""Simulations: Λ(p), λ and the means of a response with standard errors, beside the finite elements where they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fpsolve.case.case import Case
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, MOMENT
from fpsolve.output.figures import simulated_response_figure
from fpsolve.page.limits import EACH, PICTURES
from fpsolve.page.page import Block, Column, Grid, Sentence, filled
from fpsolve.results.text import fate, sampled, sign_of, units_in_words
from fpsolve.show.curves import Shown, table_of
from fpsolve.show.notes import MONTE_CARLO
from fpsolve.study.results import CurveResult, SimulatedCurve

SURE = 3
"""Standard errors from 0 at which a simulated sign is told."""
COMPARED = Column("finite elements", 2), Column("s.e. away", 1)
"""The columns of what finite elements have found."""


def show(case: Case, simulated: Sequence[SimulatedCurve], results: Sequence[CurveResult] = ()) -> Iterator[Block]:
    """The simulated curves, one by one or a row each."""
    solved = {result.curve.key: result for result in results}
    is_short, over_p = len(simulated) <= EACH, case.figure.x == "p"
    if not (is_short and over_p):
        yield exponent_grid(case, simulated, solved)
        if not is_short:
            yield Sentence(f"{len(simulated)} curves; all numbers are in {MONTE_CARLO}, one for each curve")
    for each in simulated if is_short else ():
        result = solved.get(each.curve.key)
        yield Sentence("", case.heading(each.curve) if over_p else each.curve.label)
        if over_p:
            yield moment_grid(case, each, result)
        yield number_grid(case, each, result)
        found, unit = each.result, case.units.time
        if result is None:
            value, error = found.lyapunov_exponent, found.lyapunov_exponent_error
            meaning = fate("almost every path", value, sign_of(value, SURE * error), unit)
            yield Sentence(f"λ = {sampled(value, error)} ± {error:.1e}{meaning}.")
        yield Sentence(f"{found.paths} paths over a time of {found.time:.4g} in steps of {found.step:.4g}")
        if each.response and each.curve.number <= PICTURES:
            yield simulated_response_figure(case, each)


def moment_grid(case: Case, simulated: SimulatedCurve, result: CurveResult | None) -> Grid:
    """p, Λ(p) and its standard error; where it is known the value by finite elements, and how far away it is."""
    is_direct = any(each.estimator == "direct" for each in simulated.result.estimates)
    effective = "effective windows" if is_direct else "effective paths"  # a path has many windows
    columns = [Column("p"), Column(MOMENT.symbol), Column("± s.e."), *COMPARED, Column(effective, 3)]
    exact = dict(zip(result.moments.p.tolist(), result.moments.value.tolist(), strict=True)) if result else {}
    rows = []
    for each in simulated.result.estimates:
        known = (exact.get(each.p) if each.p else 0.0) if result else None
        cells = _cells(each.value, each.standard_error, known)
        rows.append([f"{each.p:g}", *cells, f"{each.effective_paths:.0f}"])
    return filled("", columns, rows, units_in_words(case.units.time, [MOMENT]))


def number_grid(case: Case, simulated: SimulatedCurve, result: CurveResult | None) -> Grid:
    """λ, Λ″(0) and the means of a response with their standard errors, beside the finite elements."""
    rows = []
    for name, number in simulated.estimates.items():
        found = result.estimates[name] if result else None
        rows.append([INDICES[name].words, INDICES[name].symbol, *_cells(*number, found.value if found else None)])
    if response := simulated.response:
        means = result.response.means if result and result.response else {}
        for name, number in response.means.items():
            about, found = response.about.means[name], means.get(name)
            rows.append([about.words, about.symbol, *_cells(*number, found.value if found else None)])
    columns = [Column("quantity", 3, is_text=True), Column("symbol"), Column("value"), Column("± s.e."), *COMPARED]
    units = units_in_words(case.units.time, [INDICES[name] for name in simulated.estimates])
    return filled("", columns, rows, units)


def exponent_grid(case: Case, simulated: Sequence[SimulatedCurve], solved: Mapping[Any, CurveResult]) -> Grid:
    """λ of each curve by both methods."""

    def cell(i: int, each: SimulatedCurve) -> str:
        result, found = solved.get(each.curve.key), each.result
        known = result.lyapunov_exponent.value if result and result.lyapunov_exponent else None
        return _cells(found.lyapunov_exponent, found.lyapunov_exponent_error, known)[i]

    columns = [Column(LYAPUNOV_EXPONENT.symbol), Column("± s.e."), *COMPARED]
    shown = [Shown(column, partial(cell, i)) for i, column in enumerate(columns)]
    shown[0] = shown[0]._replace(number=lambda each: each.result.lyapunov_exponent)
    return replace(table_of(case, simulated, shown), remark=units_in_words(case.units.time, [LYAPUNOV_EXPONENT]))


def _cells(value: float | None, error: float | None, known: float | None) -> list[str]:
    """A number with its standard error; what is known of it, and how far away that is."""
    row = ["none", ""] if value is None or error is None else [sampled(value, error), f"{error:.1e}"]
    away = "" if known is None or value is None or not error else f"{(value - known) / error:+.1f}"
    return [*row, "" if known is None else f"{known:.6g}", away]
