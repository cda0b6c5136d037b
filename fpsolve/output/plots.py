"""Figures for print: finite-element results as markers, perturbation theory as lines, as in the paper."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.sections import Varied
from fpsolve.case.vary import ABSCISSAE, legend
from fpsolve.exponent.quantities import Quantity
from fpsolve.files import atomic
from fpsolve.model.parameters import axis_title
from fpsolve.pictures import COLOURS, SIZE, STYLE, draw_bars

if TYPE_CHECKING:
    from fpsolve.simulation.response import Response

MOST_LABELLED, MOST_INSIDE = 20, 6
"""Curves that a legend can tell apart, and those whose legend finds room among them."""
_DOT: dict[str, Any] = {"fmt": ".", "color": "black", "markersize": 5, "elinewidth": 1.1, "capsize": 4, "zorder": 5}
_ROOT: dict[str, Any] = {"marker": "|", "linestyle": "none", "markersize": 16, "markeredgewidth": 2.2, "zorder": 4}
_MARKERS = "osD^v<"  # one fewer than colours, so that both repeat together after 42 curves only


@dataclass(frozen=True, eq=False)
class Series:
    """One curve of a figure: markers at (x, y), a line through (line_x, line_y).

    Attributes:
        varied: the parameters that tell it from the others, for the legend.
        simulated: x, y and the standard errors of y from a simulation, shape (3, n).
        rare: which of the x have moments that rare paths carry, shape (n,).
        root: the stability index, which is marked on the zero line; None where there is none among the x.
    """

    varied: Varied
    x: FloatArray
    y: FloatArray
    line_x: FloatArray
    line_y: FloatArray
    simulated: FloatArray | None = None
    rare: Any = False
    root: float | None = None

    @property
    def every(self) -> int:
        """Of so many x one has a marker."""
        return max(1, self.x.size // 25)


def write_figure(
    series: Sequence[Series], x: str, y: Quantity, title: str, paths: Sequence[Path], *, is_reduced: bool = False
) -> None:
    """Draw one quantity over x for several curves, and write it to files whose endings tell the format.

    Args:
        x: "p" or the dotted key of a parameter.
        paths: .png, .pdf or what else matplotlib writes.
        is_reduced: the lines are for the Ornstein-Uhlenbeck reduction of the noise, the markers are not.
    """
    is_beside = MOST_INSIDE < len(series) <= MOST_LABELLED
    with canvas(paths, width=SIZE[0] * (1.4 if is_beside else 1)) as figure:
        axes = figure.add_subplot(xlabel=axis_title(ABSCISSAE[x]), ylabel=y.title)
        axes.set_title(filled(title, 80), parse_math=False, pad=12)  # clear of the power of ten of the axis
        axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        if len(series) > MOST_LABELLED:
            _draw_many(figure, axes, series)
        else:
            for i, item in enumerate(series):
                _draw(axes, item, i)
            handles = _legend_handles(axes, series, y.equation + (", reduced noise" if is_reduced else ""))
            place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1), "fontsize": 9} if is_beside else {"fontsize": 11}
            axes.legend(handles.values(), handles.keys(), frameon=False, **place)
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
        axes.margins(x=0.03)


def write_bars(bars: Mapping[str, Sequence[float]], names: Sequence[str], title: str, paths: Sequence[Path]) -> None:
    """Draw groups of bars, one group for each name, and in it one bar for each label."""
    with canvas(paths) as figure:
        axes = figure.add_subplot(xlabel=r"$\theta\,\partial/\partial\theta$ over the scale")
        axes.set_title(filled(title, 80), parse_math=False)
        draw_bars(axes, bars, names)
        figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=11)


def write_response_figure(response: Response, title: str, paths: Sequence[Path]) -> None:
    """Draw the stationary response: the joint density of x and ẋ, and the density of the amplitude with its errors."""
    with canvas(paths, width=10.5) as figure:
        figure.suptitle(filled(title, 100), fontsize=12, parse_math=False)
        plane, radial = figure.subplots(1, 2)
        response.plot(plane)
        figure.get_layout_engine().set(wspace=0.1)
        response.plot_amplitude(radial)


def filled(text: str, width: int) -> str:
    """A text in lines that fit, each of its own lines for itself."""
    return "\n".join(fill(line, width) for line in text.splitlines())


@contextmanager
def canvas(paths: Sequence[Path], width: float = SIZE[0], height: float = SIZE[1]) -> Iterator[Any]:
    """An empty figure in the house style, which is written to the paths in the end."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    logging.getLogger("fontTools").setLevel(logging.ERROR)  # it remarks on the dates inside fonts
    with rc_context({**STYLE, "pdf.fonttype": 42}):
        figure = Figure(figsize=(width, height), dpi=160, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.draw_without_rendering()  # lays it out, once for all formats
        figure.set_layout_engine("none")
        for path in paths:
            with atomic(path) as temporary:
                figure.savefig(temporary, metadata={"CreationDate": None} if path.suffix == ".pdf" else None)


def _draw(axes: Any, item: Series, i: int) -> None:
    colour, marker = COLOURS[i % len(COLOURS)], _MARKERS[i % len(_MARKERS)]
    axes.plot(item.line_x, item.line_y, color=colour, linewidth=1.6)
    axes.plot(
        item.x, item.y, marker, color=colour, markersize=7, markerfacecolor="none", markeredgewidth=1.6,
        markevery=item.every, label=legend(item.varied) or None,
    )  # fmt: skip
    if _has_rare(item):
        filled = item.rare & (np.arange(item.x.size) % item.every == 0)
        axes.plot(item.x[filled], item.y[filled], marker, color=colour, markersize=7)
    if item.simulated is not None:
        x, y, error = item.simulated
        axes.errorbar(x, y, 2 * error, **_DOT)
    if item.root is not None:
        axes.plot(item.root, 0, color=colour, **_ROOT)


def _draw_many(figure: Any, axes: Any, series: Sequence[Series]) -> None:
    """Many curves as thin lines, or points where they have but one, coloured in their order."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    order = ScalarMappable(Normalize(1, len(series)), "viridis")
    colours = order.to_rgba(np.arange(1, len(series) + 1))
    lines = LineCollection([np.stack([item.x, item.y], axis=1) for item in series], colors=colours, linewidths=0.8)
    axes.add_collection(lines, autolim=True)
    alone = [i for i, item in enumerate(series) if item.x.size == 1]
    axes.scatter([series[i].x[0] for i in alone], [series[i].y[0] for i in alone], s=8, color=colours[alone])
    axes.autoscale_view()
    figure.colorbar(order, ax=axes, label="number of the curve")


def _has_rare(item: Series) -> bool:
    return bool(np.any(item.rare))


def _legend_handles(axes: Any, series: Sequence[Series], equation: str) -> dict[str, Any]:
    """Colours tell the curves apart; two to five grey entries tell what is drawn."""
    handles, labels = axes.get_legend_handles_labels()
    grey = {"color": "0.35"}
    elements = "finite elements" + (", not all marked" if any(item.every > 1 for item in series) else "")
    methods = {
        elements: axes.plot([], [], "o", markersize=7, markerfacecolor="none", markeredgewidth=1.6, **grey)[0],
        f"perturbation, Eq. {equation}": axes.plot([], [], "-", linewidth=1.6, **grey)[0],
    }
    if any(map(_has_rare, series)):
        methods["carried by rare paths"] = axes.plot([], [], "o", markersize=7, **grey)[0]
    if any(item.root is not None for item in series):
        methods[r"stability index $\delta_p$"] = axes.plot([], [], **_ROOT, **grey)[0]
    if any(item.simulated is not None for item in series):
        methods["Monte Carlo ± 2 standard errors"] = axes.errorbar([], [], [], **_DOT)
    return dict(zip(labels, handles, strict=True)) | methods
