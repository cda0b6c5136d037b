"""Maps: a quantity over two keys in colours around zero, with its line of zeros."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray, is_log_spaced
from fpsolve.case.figure import FigureSection
from fpsolve.case.vary import Vary
from fpsolve.exponent.quantities import Index
from fpsolve.model.quantity import Quantity, parameter_of
from fpsolve.output.frame import SIZES, add_heading, add_legend, axes_of, bounded, canvas, named, share_of
from fpsolve.output.many import Entries

COLOURS = "RdBu_r"
"""Blue where it is negative, red where it is positive; told apart by all eyes."""
_BETWEEN = "#00C800"
"""Of the line between values, which may lie on the black one of a chart."""


@dataclass(frozen=True, eq=False)
class Plane:
    """A quantity over two keys.

    Attributes:
        keys: of the abscissa and of the ordinate.
        x, y: their values, increasing.
        values: of the quantity, shape (y, x); NaN where there is none.
        failed: where it could not be found, or was not looked for, shape (y, x); elsewhere a NaN says that none exists.
        zero: branches on which it is zero to the tolerance of a chart, each of shape (2, n).
        equation: what holds on them, in LaTeX, such as "$\\lambda = 0$".
        is_partial: whether the chart was not finished.
    """

    keys: tuple[str, str]
    x: FloatArray
    y: FloatArray
    values: FloatArray
    failed: Any
    zero: Sequence[FloatArray] = ()
    equation: str = ""
    is_partial: bool = False


def write_map(
    plane: Plane,
    quantity: Quantity,
    title: str,
    paths: Sequence[Path],
    *,
    parameters: Sequence[str] = (),
    setting: FigureSection,
) -> None:
    """Draw a map, and write it to files whose endings tell the format."""
    with canvas(paths, SIZES[setting.width]) as figure:
        x, y = (parameter_of(key).timed(setting.time_unit) for key in plane.keys)
        axes = axes_of(figure, x, y)
        edges = _edges(plane.x), _edges(plane.y)
        colours = {"cmap": COLOURS, "norm": _norm(plane.values), "rasterized": True}
        picture = axes.pcolormesh(*edges, np.ma.masked_invalid(plane.values), **colours)
        axes.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
        bounded(axes, setting, plane.keys, Vary({plane.keys[0]: tuple(plane.x), plane.keys[1]: tuple(plane.y)}))
        entries = _gaps(axes, plane, edges, quantity) + _zeros(axes, plane)
        bar = figure.colorbar(picture, ax=axes, pad=0.02)
        bar.set_label(named(figure, quantity.timed(setting.time_unit), 0.75 * figure.get_figheight()))
        _tick(bar, share_of(figure))
        add_legend(figure, entries)
        add_heading(figure, title, parameters)


def _norm(values: FloatArray) -> Any:
    """Colours alike on both sides of zero; more of them near it where most values are much smaller than the largest."""
    from matplotlib.colors import AsinhNorm, Normalize

    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    limit = float(np.max(sizes, initial=0.0)) or 1.0
    middle = float(np.median(sizes)) if sizes.size else limit
    return Normalize(-limit, limit) if limit < 4 * middle else AsinhNorm(middle, -limit, limit)


def _tick(bar: Any, share: float) -> None:
    """Numbers beside the colour bar, with room between them."""
    from matplotlib.colors import AsinhNorm
    from matplotlib.ticker import FixedLocator, StrMethodFormatter

    if not isinstance(bar.norm, AsinhNorm):
        bar.formatter.set_powerlimits((-2, 3))
        bar.formatter.set_useMathText(True)
        return
    size, apart = float(bar.norm.vmax or 1.0), 0.06 if share > 0.8 else 0.08
    chosen = [0.0]
    for decade in range(math.ceil(math.log10(size)) - 8, math.floor(math.log10(size)) + 1):
        if bar.norm(10.0**decade) - bar.norm(chosen[-1]) >= apart:
            chosen.append(10.0**decade)
    chosen = chosen if len(chosen) > 1 else [0.0, float(f"{0.8 * size:.0e}")]
    bar.ax.yaxis.set_major_locator(FixedLocator([*(-value for value in chosen[:0:-1]), *chosen]))
    bar.ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _edges(values: FloatArray) -> FloatArray:
    """The edges of cells around values, by their logarithms where they are spread so."""
    places = np.log(values) if is_log_spaced(values) else values
    middles = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
    return np.exp(edges) if is_log_spaced(values) else edges


def _gaps(axes: Any, plane: Plane, edges: tuple[FloatArray, FloatArray], quantity: Quantity) -> Entries:
    """Hatched where it is not known, grey where there is none; what the legend says of these."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Patch, Rectangle

    entries: Entries = []
    absent = np.isnan(plane.values) & ~plane.failed
    hatched: dict[str, Any] = {"facecolor": "white", "edgecolor": "0.45", "hatch": "/////", "linewidth": 0}
    plain: dict[str, Any] = {"facecolor": "0.8", "edgecolor": "none", "linewidth": 0}
    for where, style, words in (
        (plane.failed, hatched, "failed or not solved"),
        (absent, plain, _none(quantity)),
    ):
        cells = [_cell(edges, i, j) for i, j in np.argwhere(where)]
        if cells:
            axes.add_collection(PatchCollection([Rectangle(*cell) for cell in cells], **style))
            entries.append((words, Patch(**style)))
    return entries


def _none(quantity: Quantity) -> str:
    """That there is none where it is sought."""
    where = " from {:g} to {:g}".format(*quantity.interval) if isinstance(quantity, Index) else ""
    return f"no {quantity.words}{where}"


def _cell(edges: tuple[FloatArray, FloatArray], row: int, column: int) -> tuple[tuple[float, float], float, float]:
    """The corner, the width and the height of a cell."""
    x, y = edges
    return (x[column], y[row]), x[column + 1] - x[column], y[row + 1] - y[row]


def _zeros(axes: Any, plane: Plane) -> Entries:
    """The line of zeros between the values, and that of a chart; what the legend says of them."""
    from matplotlib.lines import Line2D

    share, entries = share_of(axes.figure), Entries()
    known = plane.values[np.isfinite(plane.values)]
    if known.size and known.min() < 0 < known.max():
        style: dict[str, Any] = {"linestyles": "--", "linewidths": 1.5 * share, "zorder": 3}
        axes.contour(plane.x, plane.y, np.ma.masked_invalid(plane.values), levels=[0.0], colors=_BETWEEN, **style)
        line = Line2D([], [], color=_BETWEEN, linestyle="--", linewidth=1.5 * share)
        entries.append(("zero, interpolated between the values", line))
    for branch in plane.zero:
        axes.plot(*branch, color="black", linewidth=2.6 * share, scalex=False, scaley=False)
    if plane.zero:
        words = f"{plane.equation}, traced by a chart{', not finished' if plane.is_partial else ''}"
        entries.append((words, Line2D([], [], color="black", linewidth=2.6 * share)))
    return entries
