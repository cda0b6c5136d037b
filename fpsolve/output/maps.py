"""Maps: a quantity over two keys in colours around zero, with its line of zeros."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.figure import FigureSection
from fpsolve.drawing import FORMATS, draw_colours, figure_for, label_axes, points, scale_axis, scale_of
from fpsolve.model.quantity import Quantity

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
        absent: what to say where none exists.
    """

    keys: tuple[str, str]
    x: FloatArray
    y: FloatArray
    values: FloatArray
    failed: Any
    zero: Sequence[FloatArray] = ()
    equation: str = ""
    is_partial: bool = False
    absent: str = ""


def write_map(
    plane: Plane,
    quantity: Quantity,
    title: str,
    paths: Sequence[Path],
    *,
    parameters: Sequence[str] = (),
    setting: FigureSection,
    about: Callable[[str], Quantity],
) -> None:
    """Draw a map, hatched where it is not known, grey where there is none, and write it to files.

    Args:
        paths: .png, .pdf or what else matplotlib writes.
        parameters: what holds for all of it, for below the title.
        setting: how the figure is set.
    """
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    with figure_for(paths, title, parameters, FORMATS[setting.width]) as figure:
        axes, edges = figure.add_subplot(), (_edges(plane.x), _edges(plane.y))
        label_axes(axes, *(about(key).attributes for key in plane.keys))
        _draw_values(axes, plane, edges, quantity.timed(setting.time_unit).attributes)
        for axis, each, ends, limits in zip(
            (axes.xaxis, axes.yaxis), (plane.x, plane.y), edges, (setting.xlim, setting.ylim), strict=True
        ):
            scale_axis(axis, scale_of(each), limits or (float(ends[0]), float(ends[-1])))
        gaps = np.isnan(plane.values) & ~plane.failed
        for where, label, colours in (
            (plane.failed, "failed or not solved", {"facecolor": "white", "edgecolor": "0.45", "hatch": "/////"}),
            (gaps, plane.absent, {"facecolor": "0.8", "edgecolor": "none"}),
        ):
            (x, y), style = edges, dict[str, Any](label=label, linewidth=0, **colours)
            cells = [Rectangle((x[j], y[i]), x[j + 1] - x[j], y[i + 1] - y[i]) for i, j in np.argwhere(where)]
            if cells:
                axes.add_collection(PatchCollection(cells, **style))
        known = plane.values[np.isfinite(plane.values)]
        if known.size and known.min() < 0 < known.max():
            inside, wide = np.ma.masked_invalid(plane.values), points(1.5)
            look: dict[str, Any] = {"colors": _BETWEEN, "linestyles": "--", "linewidths": wide, "zorder": 3}
            axes.contour(plane.x, plane.y, inside, levels=[0.0], **look)
            axes.plot([], [], "--", color=_BETWEEN, linewidth=wide, label="zero, interpolated between the values")
        words = f"{plane.equation}, traced by a chart{', not finished' if plane.is_partial else ''}"
        for i, branch in enumerate(plane.zero):
            label = "" if i else words
            axes.plot(*branch, color="black", linewidth=points(2.6), label=label, scalex=False, scaley=False)


def _draw_values(axes: Any, plane: Plane, edges: tuple[FloatArray, FloatArray], about: Mapping[str, Any]) -> None:
    """Blue where it is negative, red where it is positive, told apart by all eyes; colours are alike on both sides.

    There are more of them near zero where most values are much smaller than the largest; then numbers beside the
    colour bar are powers of ten, with room between them.
    """
    from matplotlib.colors import AsinhNorm, Normalize
    from matplotlib.ticker import FixedLocator, StrMethodFormatter

    sizes = np.abs(plane.values[np.isfinite(plane.values) & (plane.values != 0)])
    limit = float(np.max(sizes, initial=0.0)) or 1.0
    middle = float(np.median(sizes)) if sizes.size else limit
    is_even = limit < 4 * middle
    norm = Normalize(-limit, limit) if is_even else AsinhNorm(middle, -limit, limit)
    values = np.ma.masked_invalid(plane.values)
    bar = draw_colours(axes, *edges, values, about, cmap="RdBu_r", norm=norm, shading="flat")
    if is_even:
        bar.formatter.set_powerlimits((-2, 3))
        bar.formatter.set_useMathText(True)
        return
    chosen = [0.0]
    for decade in range(math.ceil(math.log10(limit)) - 8, math.floor(math.log10(limit)) + 1):
        if norm(10.0**decade) - norm(chosen[-1]) >= (0.06 if points(1) > 0.8 else 0.08):
            chosen.append(10.0**decade)
    chosen = chosen if len(chosen) > 1 else [0.0, float(f"{0.8 * limit:.0e}")]
    bar.ax.yaxis.set_major_locator(FixedLocator([*(-value for value in chosen[:0:-1]), *chosen]))
    bar.ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _edges(values: FloatArray) -> FloatArray:
    """The edges of cells around values, by their logarithms where they are spread so."""
    is_log = scale_of(values) == "log"
    places = np.log(values) if is_log else values
    middles = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
    return np.exp(edges) if is_log else edges
