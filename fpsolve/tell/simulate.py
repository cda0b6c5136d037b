"""Simulated parameter sets as tables and pictures, beside finite elements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fpsolve.case.case import Case
from fpsolve.drawing import Format, figure_for, label_axes, label_of
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, MOMENT, SUMMARY_NUMBERS
from fpsolve.model.quantity import OF_STOPS
from fpsolve.solve.set_result import SetResult, SimulatedSet
from fpsolve.tell.blocks import Block, Column, Drawing, Grid, Sentence, filled
from fpsolve.tell.notes import MONTE_CARLO
from fpsolve.tell.sets import Cells, grid_of
from fpsolve.tell.text import EACH, PICTURES, fate, sampled, sign_of, units_in_words

SURE = 3
"""Standard errors from 0 at which a simulated sign is told."""
COMPARED = Column("finite elements", 2), Column("s.e. away", 1)
"""The columns of what finite elements have found."""


def simulated_response_figure(case: Case, simulated: SimulatedSet) -> Drawing:
    """monte_carlo_response.png and .pdf of a parameter set, if it has a response."""
    parameter_set = simulated.parameter_set
    title, name = f"Simulated stationary response{parameter_set.of}", f"monte_carlo_response{parameter_set.suffix}"
    return Drawing(title, partial(_draw_response, simulated, case.units.time), name, case.headline)


def _draw_response(simulated: SimulatedSet, time_unit: str, paths: Sequence[Path], heading: str) -> None:
    """The density of (x, ẋ) and of the amplitude."""
    if simulated.response is None:
        return
    with figure_for(paths, heading, simulated.parameter_set.fixed(time_unit), Format(width=10.5)) as figure:
        plane, radial = figure.subplots(1, 2)
        of = simulated.response.about
        quantities = of.first, of.second, of.amplitude, of.amplitude_density, of.density
        x, v, amplitude, of_amplitude, of_both = (each.timed(time_unit).attributes for each in quantities)
        simulated.response.plot(plane)
        simulated.response.plot_amplitude(radial)
        if inside := radial.get_legend():
            inside.remove()  # as it stands below
        label_axes(plane, x, v)
        label_axes(radial, amplitude, of_amplitude)
        figure.axes[-1].set_ylabel(label_of(of_both, 36))  # of the colour bar


def show(case: Case, simulated: Sequence[SimulatedSet], results: Sequence[SetResult] = ()) -> Iterator[Block]:
    """The simulated parameter sets, one by one or a row each."""
    solved = {result.parameter_set.number: result for result in results}
    is_short, over_p = len(simulated) <= EACH, case.figure.x == "p"
    if not (is_short and over_p):
        yield exponent_grid(case, simulated, solved)
        if not is_short:
            yield Sentence(f"{len(simulated)} parameter sets; all numbers are in {MONTE_CARLO}, a file for each set")
    for each in simulated if is_short else ():
        result = solved.get(each.parameter_set.number)
        yield Sentence("", case.heading(each.parameter_set) if over_p else each.parameter_set.label)
        found = each.result
        if result is None:
            value, error = found.lyapunov_exponent, found.lyapunov_exponent_error
            meaning = fate("almost every path", value, sign_of(value, SURE * error), case.units.time)
            yield Sentence(f"λ = {sampled(value, error)} ± {error:.1e}: {meaning}.")
        if over_p:
            yield moment_grid(case, each, result)
        yield number_grid(case, each, result)
        yield Sentence(f"{found.paths} paths over a time of {found.time:.4g} in steps of {found.step:.4g}")
        if each.response and each.parameter_set.number <= PICTURES:
            yield simulated_response_figure(case, each)


def moment_grid(case: Case, simulated: SimulatedSet, result: SetResult | None) -> Grid:
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


def number_grid(case: Case, simulated: SimulatedSet, result: SetResult | None) -> Grid:
    """λ, Λ″(0) and the means of a response with their standard errors, beside the finite elements."""
    known, estimates = {**SUMMARY_NUMBERS, **OF_STOPS}, dict(result.estimates if result else {})
    numbers = [(known[name], each, estimates.get(name)) for name, each in simulated.estimates.items()]
    if response := simulated.response:
        means = result.response.means if result and result.response else {}
        numbers += [(response.about.means[name], each, means.get(name)) for name, each in response.means.items()]
    rows = [[about.words, about.symbol, *_cells(*each, found and found.value)] for about, each, found in numbers]
    columns = [Column("quantity", 3, is_text=True), Column("symbol"), Column("value"), Column("± s.e."), *COMPARED]
    units = units_in_words(case.units.time, [known[name] for name in simulated.estimates])
    return filled("", columns, rows, units)


def exponent_grid(case: Case, simulated: Sequence[SimulatedSet], solved: Mapping[int, SetResult]) -> Grid:
    """λ of each parameter set by both methods."""

    def cells(each: SimulatedSet) -> Cells:
        result, found = solved.get(each.parameter_set.number), each.result
        known = result.lyapunov_exponent.value if result and result.lyapunov_exponent else None
        return zip(columns, _cells(found.lyapunov_exponent, found.lyapunov_exponent_error, known), strict=True)

    symbol = LYAPUNOV_EXPONENT.symbol
    columns = Column(symbol), Column("± s.e."), *COMPARED
    numbers = {symbol: np.array([each.result.lyapunov_exponent for each in simulated])}
    remark = units_in_words(case.units.time, [LYAPUNOV_EXPONENT])
    return replace(grid_of(case, simulated, cells, numbers), remark=remark)


def _cells(value: float | None, error: float | None, known: float | None) -> list[str]:
    """A number with its standard error; what is known of it, and how far away that is."""
    row = ["none", ""] if value is None or error is None else [sampled(value, error), f"{error:.1e}"]
    away = "" if known is None or value is None or not error else f"{(value - known) / error:+.1f}"
    return [*row, "" if known is None else f"{known:.6g}", away]
