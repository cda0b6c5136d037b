"""What `fpsolve explore` shows beside a curve: the map of stability, T and densities, simulated paths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from itertools import chain

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.axis import check_axes
from fpsolve.analysis.density import stationary_density, tilted_density
from fpsolve.analysis.scan import Scan, scan_row
from fpsolve.arrays import FloatArray
from fpsolve.budget import Meter, charge
from fpsolve.case.case import Case
from fpsolve.case.explain import explain, is_number
from fpsolve.case.sections import ChartSection
from fpsolve.data import Quantity
from fpsolve.errors import FpsolveError
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.model.faults import TableError
from fpsolve.model.quantity import GROWTH
from fpsolve.results.nodes import Nodes
from fpsolve.solve.chart import Chart, begun_lines, solve_chart
from fpsolve.solve.question import Numerics
from fpsolve.tell.blocks import Column, Drawing, Grid, Sentence
from fpsolve.tell.chart import NAMED, show
from fpsolve.tell.local import Answer
from fpsolve.tell.reports import part_of_page
from fpsolve.tell.text import sampled

PIXELS = 144, 72
"""Of a picture, each way."""
SHOWN = 9, 5
"""Rows and columns of its table."""
PATHS, POINTS = 10, 400
"""Paths, and points of each; the motion is shown for as many steps."""


def map_of(case: Case, axes: object, tell: Callable[[Answer], None]) -> Answer:
    """The lines λ = 0 and Λ(2) = 0 over two parameters, as `chart` traces them, and the regions between them.

    Args:
        axes: two tables such as those of [chart].
        tell: takes what there is so far, of the grid that is searched for a line its rows.
    """
    lines = ["lyapunov_exponent = 0"] * case.method.has_pairs + ["moment(2) = 0"] * (case.method.reason(2.0) is None)
    x, y = axes if isinstance(axes, list) and len(axes) == 2 else (None, None)
    try:
        frame = ChartSection.model_validate({"x": x, "y": y, "lines": lines})
        check_axes(case.problem, frame.x, frame.y)
    except ValidationError as failure:
        texts = [f"{key}: {text}" for _, key, text in explain(failure.errors(), ChartSection.model_fields)]
        raise FpsolveError("\n".join(texts)) from failure
    except TableError as failure:
        raise FpsolveError(str(failure)) from failure
    sides = frame.x, frame.y
    case, grid = case.model_copy(update={"chart": frame}), list[list[float | None]]()

    def answer(chart: Chart) -> Answer:
        return {
            "axes": [asdict(side) for side in sides],
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


def field_of(case: Case, p: object) -> Answer:
    """T and the stationary density over phase and noise, of three and four variables densities of directions."""
    if not is_number(p):
        raise FpsolveError(f"got p = {p!r}; must be a finite number; write, for example, 2")
    if why := case.method.no_picture:
        raise FpsolveError(why)
    solver = Numerics.of(case).solver(case.problem)
    stationary = solver.pair(0.0)
    density, pair = stationary_density(stationary), solver.pair(float(str(p)))  # which refuses one that misleads
    grid = density.grid
    about = Quantity("", "", "density", unit=grid.unit), case.problem.noise_quantity
    unit, noise_unit = (f" ({unit})" if (unit := each.timed(case.units.time).unit_in_words) else "" for each in about)
    if case.method.pictures == DIRECTIONS:
        found = [density, *([tilted_density(pair)] if pair.p else [])]
        names = [f"{each.words} ({each.unit})" for each in grid.quantities]
        panels = [panel(each.name + unit, grid.first, grid.second, each.values, names) for each in found]
        said = [Sentence(repr(each)) for each in found]
    else:
        nodes, names = Nodes.of(pair).seen(pair), ["phase φ (rad)", f"noise ξ{noise_unit}"]
        draw = partial(panel, x=nodes.phi.ravel(), y=nodes.y, names=names, is_chain=nodes.is_lines)
        panels = [
            draw(f"eigenfunction T of p = {pair.p:g}", values=nodes.fields(pair).T),
            draw(f"stationary density{unit}", values=nodes.fields(stationary).T_adjoint),
        ]
        said = []
    pictures, tables = zip(*panels, strict=True)
    return {"panels": pictures, "told": part_of_page([*tables, *said])}


def listed(values: FloatArray) -> list[float | None]:
    """Numbers for JSON, which has no NaN."""
    return [each if math.isfinite(each) else None for each in values.tolist()]


def panel(
    title: str, x: FloatArray, y: FloatArray, values: FloatArray, names: Sequence[str], is_chain: bool = False
) -> tuple[Answer, Grid]:
    """A picture of values at nodes, on pixels between them, x first, of the states of a chain strips; and its table."""
    u, v = (np.linspace(each[0], each[-1], count) for each, count in zip((x, y), PIXELS, strict=True))
    rows = np.array([np.interp(u, x, column) for column in values.T])
    near = np.abs(v[:, None] - y).argmin(axis=1)
    pixels = np.array([column[near] if is_chain else np.interp(v, y, column) for column in rows.T])
    ends = [[u[0], u[-1]], [v[0], v[-1]]]
    picture: Answer = {"title": title, "ends": ends, "names": names, "values": [*map(listed, pixels)]}
    i, j = (np.linspace(0, size - 1, count).round().astype(int) for size, count in zip(PIXELS, SHOWN, strict=True))
    columns = [Column(" \\ ".join(names)), *(Column(f"{each:.3g}") for each in v[j])]
    cells = np.column_stack([u[i], pixels[np.ix_(i, j)]])
    return picture, Grid(title, columns, [[f"{each:.4g}" for each in row] for row in cells])


def paths_of(case: Case) -> Answer:
    """ln‖x(t)‖ of ten simulated paths, and the motion of one of them, whose wall throws it back."""
    from fpsolve.simulation.batches import standard_error
    from fpsolve.simulation.coefficients import coefficients, starting_state  # which takes 110 ms
    from fpsolve.simulation.kernels import RENORMALISED, advance
    from fpsolve.simulation.setup import obstacles, simulated_parts

    system, noise = simulated_parts(case.problem)
    if told := obstacles(system, noise):
        raise FpsolveError("; ".join(told.values()))
    known, rng = coefficients(system, noise), np.random.default_rng(case.monte_carlo.seed)
    h = known.default_step
    motion, (y, xi) = known.motion(h), starting_state(noise, PATHS, rng, known.size(h))

    def followed(count: int) -> tuple[FloatArray, FloatArray]:
        """After every so many steps ln‖x‖ of all paths, and the first variable of the first one."""
        log_norm, push = np.zeros((2, PATHS))
        logs, first = np.zeros((POINTS + 1, PATHS)), np.zeros(POINTS + 1)
        for k in range(POINTS + 1):
            logs[k], first[k] = log_norm, y[0, 0]
            charge(PATHS)
            advance(motion, h, y, xi, log_norm, push, np.zeros(2), count, RENORMALISED, rng)
        return logs, first * np.exp(logs[:, 0])

    short = h * np.arange(POINTS + 1)
    long = short * max(1, round(64 * known.transient() / h / POINTS))
    with Meter(math.inf).running():
        logs, _ = followed(round(long[1] / h))
        _, first = followed(1)
    if not (np.isfinite(logs).all() and np.isfinite(first).all()):
        raise FpsolveError("the paths leave the range of numbers; take a weaker noise")
    has_wall = any(abs(math.cos(jump.phase)) < 1e-12 for jump in system.jumps)  # at x = 0
    rates = logs[-1] / long[-1]
    mean, error = float(rates.mean()), standard_error(rates)
    rows: list[Sequence[str]] = [[f"{k}", f"{rate:.4g}"] for k, rate in enumerate(rates, 1)]
    unit = GROWTH.timed(case.units.time).unit
    grid = Grid("", [Column("path"), Column(f"ln‖x‖/t ({unit})")], rows)
    said = Sentence(f"Their mean growth rate ({unit}) is {sampled(mean, error)} ± {error:.1e}, a standard error.")
    return {
        "time": long.tolist(), "logs": logs.T.tolist(), "short": short.tolist(),
        "motion": (np.abs(first) if has_wall else first).tolist(),
        "name": case.problem.linear.states[0].removesuffix("₁"), "told": part_of_page([said, grid]),
    }  # fmt: skip
