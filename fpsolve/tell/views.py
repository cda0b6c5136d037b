"""What `fpsolve explore` shows beside a curve: the map of stability, T and densities, simulated paths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.axis import check_axes
from fpsolve.analysis.density import stationary_density, tilted_density
from fpsolve.analysis.scan import Scan, scan_row
from fpsolve.analysis.target import said
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.explain import explain, is_number
from fpsolve.case.sections import ChartSection
from fpsolve.errors import FpsolveError
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.method import DIRECTIONS, PHASE_AND_NOISE
from fpsolve.results.nodes import Nodes
from fpsolve.solve.chart import Chart, begun_lines, solve_chart
from fpsolve.solve.question import Numerics
from fpsolve.tell.blocks import Column, Drawing, Grid, Sentence
from fpsolve.tell.chart import show
from fpsolve.tell.html import part_of_page
from fpsolve.tell.text import sampled

PIXELS = 144, 72
"""Of a picture, each way."""
SHOWN = 9, 5
"""Rows and columns of its table."""
PATHS, POINTS, PERIODS = 10, 400, 12
"""Paths, points of each, and half-turns of the motion that is shown."""
NAMED = 0.02
"""Share of the frame from which on a region is named."""
Answer = Mapping[str, Any]
Panels = tuple[list[Answer], list[Sentence]]


def map_of(case: Case, axes: object, tell: Callable[[Answer], None]) -> Answer:
    """The lines λ = 0 and Λ(2) = 0 over two parameters, as `chart` traces them, and the regions between them.

    Args:
        axes: two tables such as those of [chart].
        tell: takes what there is so far, of the grid that is searched for a line its rows.
    """
    lines = ["moment(2) = 0"] if case.method.reason(2.0) is None else []
    lines = lines if not case.method.has_pairs else ["lyapunov_exponent = 0", *lines]
    x, y = axes if isinstance(axes, list) and len(axes) == 2 else (None, None)
    try:
        frame = ChartSection.model_validate({"x": x, "y": y, "lines": lines})
        sides = frame.x, frame.y
        check_axes(case.problem, *sides)
    except ValidationError as failure:
        told = [f"{key}: {text}" for _, key, text in explain(failure.errors(), ChartSection.model_fields)]
        raise FpsolveError("\n".join(told)) from failure
    except ValueError as failure:
        raise FpsolveError(said(failure)) from failure
    case, grid = case.model_copy(update={"chart": frame}), list[list[float | None]]()

    def answer(chart: Chart) -> Answer:
        return {
            "axes": axes,
            "grid": [*grid],
            "lines": [
                {"name": line.target.equation, "branches": [[*map(listed, each.path)] for each in line.branches]}
                for line in chart.lines
            ],
            "regions": [
                {"name": each.name, "at": [float(side.value(u)) for side, u in zip(sides, each.at, strict=True)]}
                for each in (chart.regions.each if chart.regions else ())
                if each.share >= NAMED
            ],
            "told": part_of_page(each for each in show(case, chart) if not isinstance(each, Drawing)),
        }

    def scans() -> Iterator[Scan]:
        for row in chain.from_iterable(line.rows() for line in begun):
            grid[:] = grid if row.number else [[None] * row.count] * row.count
            found = scan_row(row)
            grid[row.number] = listed(np.sign(found.values))
            tell(answer(chart))
            yield found

    chart, begun = Chart((), ()), begun_lines(case)
    for chart in solve_chart(begun, scans()):
        tell(answer(chart))
    grid.clear()
    return answer(chart)


def field_of(case: Case, p: Any) -> Answer:
    """T and the stationary density over phase and noise, of three and four variables densities of directions."""
    if not is_number(p):
        raise FpsolveError(f"got p = {p!r}; must be a finite number; write, for example, 2")
    if why := case.method.no_picture:
        raise FpsolveError(why)
    solver = Numerics.of(case).solver(case.problem)
    stationary = solver.pair(0.0)
    density = stationary_density(stationary)  # which refuses one that misleads
    panels, said = PANELS[case.method.pictures.part](density, stationary, solver.pair(float(p)))
    return {"panels": panels, "told": part_of_page([*told_of(panels), *said])}


def _panels_of_directions(density: Any, stationary: PrincipalPair, pair: PrincipalPair) -> Panels:
    """The stationary density and, at another p, the tilted one."""
    found = [density, *([tilted_density(pair)] if pair.p else [])]
    names = [f"{each.words} ({each.unit})" for each in density.grid.quantities]
    panels = [panel(each.name, each.grid.first, each.grid.second, each.values, names) for each in found]
    return panels, [Sentence(each._said()) for each in found]


def _panels_over_noise(density: Any, stationary: PrincipalPair, pair: PrincipalPair) -> Panels:
    """T and the stationary density."""
    grid = Nodes.of(pair).seen(pair)
    names = ["phase φ (rad)", grid.axis]
    shown = {f"eigenfunction T of p = {pair.p:g}": grid.fields(pair).T}
    shown["stationary density"] = grid.fields(stationary).T_adjoint
    return [panel(title, grid.phi.ravel(), grid.y, values, names, grid.is_lines) for title, values in shown.items()], []


PANELS = {PHASE_AND_NOISE.part: _panels_over_noise, DIRECTIONS.part: _panels_of_directions}
"""What is shown of each of the `Pictures`."""


def listed(values: FloatArray) -> list[float | None]:
    """Numbers for JSON, which has no NaN."""
    return [each if math.isfinite(each) else None for each in values.tolist()]


def panel(
    title: str, x: FloatArray, y: FloatArray, values: FloatArray, names: Sequence[str], is_chain: bool = False
) -> Answer:
    """A picture of values at nodes, on pixels between them, x first; of the states of a chain strips."""
    u, v = (np.linspace(each[0], each[-1], count) for each, count in zip((x, y), PIXELS, strict=True))
    rows = np.array([np.interp(u, x, column) for column in values.T])
    near = np.abs(v[:, None] - y).argmin(axis=1)
    pixels = [listed(column[near] if is_chain else np.interp(v, y, column)) for column in rows.T]
    return {"title": title, "ends": [[u[0], u[-1]], [v[0], v[-1]]], "names": names, "values": pixels}


def told_of(panels: Sequence[Answer]) -> Iterator[Grid]:
    """A table for each picture."""
    shares = [np.linspace(0, size - 1, count) for size, count in zip(PIXELS, SHOWN, strict=True)]
    places = [each.round().astype(int) for each in shares]
    for each in panels:
        (x0, x1), (y0, y1) = each["ends"]
        x, y = np.linspace(x0, x1, PIXELS[0])[places[0]], np.linspace(y0, y1, PIXELS[1])[places[1]]
        heads = [Column(f"{each['names'][0]} \\ {each['names'][1]}"), *(Column(f"{value:.3g}") for value in y)]
        numbers = np.array(each["values"], dtype=float)[np.ix_(*places)]
        rows = [[f"{value:.4g}" for value in (x[i], *row)] for i, row in enumerate(numbers)]
        yield Grid(each["title"], heads, [*rows])


def paths_of(case: Case, look: Callable[[], None]) -> Answer:
    """ln‖x(t)‖ of ten simulated paths, and the motion of one of them, whose wall throws it back."""
    from fpsolve.simulation.coefficients import coefficients, starting_state  # which compiles
    from fpsolve.simulation.kernels import RENORMALISED, advance
    from fpsolve.simulation.setup import obstacles, simulated_parts

    system, noise = simulated_parts(case.problem)
    for name, sentence in obstacles(system, noise).items():
        raise FpsolveError(f"{name}: {sentence}")
    known, rng = coefficients(system, noise), np.random.default_rng(case.monte_carlo.seed)
    h = known.default_step
    motion, (y, xi) = known.motion(h), starting_state(noise, PATHS, rng, known.size(h))
    log_norm, push = np.zeros((2, PATHS))

    def followed(count: int) -> Iterator[tuple[float, FloatArray, float]]:
        """Points with the time, ln‖x‖ of all paths, and the first variable of the first one."""
        for k in range(POINTS + 1):
            yield k * count * h, log_norm.copy(), float(y[0, 0] * math.exp(log_norm[0]))
            look()
            advance(motion, h, y, xi, log_norm, push, np.zeros(2), count, RENORMALISED, rng)

    long = max(1, round(64 * known.transient() / h / POINTS))
    time, logs, _ = zip(*followed(long), strict=True)
    log_norm[:] = 0.0
    near = max(1, round(PERIODS * known.half_turn / h / POINTS)) if math.isfinite(known.half_turn) else 1
    short, _, first = zip(*followed(near), strict=True)
    if not (np.all(np.isfinite(logs)) and np.all(np.isfinite(first))):
        raise FpsolveError("the paths leave the range of numbers; take a weaker noise")
    has_wall = any(abs(math.cos(jump.phase)) < 1e-12 for jump in system.jumps)  # at x = 0
    rates = logs[-1] / time[-1]
    mean, error = float(np.mean(rates)), float(np.std(rates, ddof=1) / math.sqrt(PATHS))
    rows: list[Sequence[str]] = [[f"{k + 1}", f"{each:.4g}"] for k, each in enumerate(rates)]
    grid = Grid("", [Column("path"), Column("ln‖x‖/t")], rows)
    said = Sentence(f"Their mean growth rate is {sampled(mean, error)} ± {sampled(error, error)}, a standard error.")
    return {
        "time": time, "logs": np.array(logs).T.tolist(), "short": short,
        "motion": np.abs(first).tolist() if has_wall else first,
        "name": case.problem.linear.states[0].removesuffix("₁"), "told": part_of_page([said, grid]),
    }  # fmt: skip
