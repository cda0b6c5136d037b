"""Pictures of an eigenpair: T, T* or their product over phase and noise, or over directions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Literal

import numpy as np

from fpsolve.arrays import FloatArray, shown
from fpsolve.data import Quantity
from fpsolve.drawing import MOST_LINES, QUARTERS, draw_colours, figure_for, label_axes
from fpsolve.exponent.density import Grid, on_nodes
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.model.quantity import MOMENT, PHASE
from fpsolve.results.nodes import FIELDS, Nodes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FINER = 2
"""So many times as many nodes either way as a file for ParaView has; there they carry polynomials."""
RED = "#C8102E"
NEXT_TO_ZERO = 0.05
"""A least value below this share of the maximum is drawn as 0, which rounding and small errors miss."""
DECADES = 2
"""So many powers of ten of T, which is positive, are drawn on a logarithmic scale."""
Field = Literal["T", "T_adjoint", "tilted_density"]


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that notebooks show.

    Attributes:
        png: the content of its file.
    """

    png: bytes

    def save(self, path: str | Path) -> Path:
        """Write it as a PNG file."""
        Path(path).write_bytes(self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png


def draw_eigenfunction(
    pair: PrincipalPair, field: Field = "T", *, cmap: str = "viridis", time_unit: str = "time"
) -> Picture:
    """Draw an eigenfunction, or the tilted density, over phase and noise; for noise with states a line for each.

    Of more than two variables over directions, see `analysis.DirectionDensity`, as the functions of the pair have it: T
    as its mean, T* and T T* as densities.

    Args:
        pair: the eigenpair.
        field: "T", "T_adjoint", or their product "tilted_density".
        cmap: the colours, by matplotlib's names.
        time_unit: what the unit of time is called, such as "s".

    Raises:
        ValueError: there is no such field.
        OutputError: T depends on more than φ and ξ.
    """
    if field not in FIELDS:
        raise ValueError(f"got field = {shown(field)}; must be one of {', '.join(map(repr, FIELDS))}")
    problem = pair.generator.problem
    number = f"p = {pair.p:g}, {MOMENT.symbol} = {round(pair.value, 14) + 0.0:.6g} ({MOMENT.timed(time_unit).unit})"
    known = [each.quantity.timed(time_unit).stated(each.value) for each in problem.parameters.values()]
    with TemporaryDirectory() as place:
        path = Path(place, "picture.png")
        with figure_for([path], number, known) as figure:
            axes = figure.add_subplot()
            if choose(problem).pictures == DIRECTIONS:
                found = on_nodes(pair)
                about = _about(field, found.grid, time_unit).attributes
                found.grid.draw(axes, found.fields._asdict()[field], about, cmap=cmap)
            else:
                _draw_over_noise(pair, field, cmap, time_unit, axes)
        return Picture(path.read_bytes())


def _about(field: str, grid: Grid, time_unit: str) -> Quantity:
    """A function; densities have the unit of a grid."""
    quantity = FIELDS[field]
    return replace(quantity, unit=quantity.unit if field == "T" else grid.unit).timed(time_unit)


def _draw_over_noise(pair: PrincipalPair, field: str, cmap: str, time_unit: str, axes: Axes) -> None:
    """A function of phase and noise where it is not negligible, in colours, or as a line for each state of the noise.

    The scale begins at 0 where the least value is next to it, or all are the same.
    """
    nodes, about = Nodes.of(pair, FINER).seen(pair), _about(field, Grid.of(pair), time_unit)
    values = nodes.at_xi(nodes.fields(pair)._asdict()[field])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    is_log = field == "T" and 0 < 10**DECADES * low < high
    if nodes.is_lines:
        _draw_lines(axes, nodes, values, is_log=is_log)
    else:
        is_next = not is_log and (abs(low) < NEXT_TO_ZERO * high or high - low < 1e-6 * high)
        ends = {"norm": "log" if is_log else "linear", "vmin": 0.0 if is_next else low, "vmax": high}
        draw_colours(
            axes, nodes.phi.ravel(), nodes.xi, values.T, about.attributes, shading="gouraud", cmap=cmap, **ends
        )
    for impact in nodes.impacts:
        axes.axvline(impact, color=RED, linewidth=1.2)
    axes.set_xticks(*QUARTERS)
    noise = pair.generator.problem.noise_quantity.timed(time_unit)
    label_axes(axes, PHASE.attributes, (about if nodes.is_lines else noise).attributes)


def _draw_lines(axes: Axes, nodes: Nodes, values: FloatArray, *, is_log: bool) -> None:
    """A line over φ for each value of the noise, with a gap where the function jumps."""
    blocks = nodes.phi[..., None], values.reshape(*nodes.phi.shape, -1)
    phi, shown = (np.pad(each, ((0, 0), (0, 1), (0, 0)), constant_values=math.nan) for each in blocks)
    is_named = 1 < nodes.xi.size <= MOST_LINES
    for number, xi in enumerate(nodes.xi):
        axes.plot(phi.ravel(), shown[..., number].ravel(), label=rf"$\xi$ = {xi:g}" if is_named else None)
    axes.set_xlim(0, 2 * math.pi)
    if is_log:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
