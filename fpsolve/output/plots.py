"""Figures for print: finite-element results as markers, perturbation theory as lines, as in the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.case.figure import MOST_NAMED, FigureSection
from fpsolve.case.vary import Vary, legend
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, STABILITY_INDEX, P, Quantity, parameter_of
from fpsolve.output.frame import SIZES, Size, add_heading, add_legend, axes_of, bounded, canvas, share_of
from fpsolve.output.many import Entries, colours_of, draw_many, draw_roots
from fpsolve.output.series import STYLES, Series, numbers_of, texts_of
from fpsolve.pictures import COLOURS, draw_bars

if TYPE_CHECKING:
    from fpsolve.simulation.response import Response

_DOT: dict[str, Any] = {"fmt": ".", "color": "black", "zorder": 5}
_MARKERS = "osD^v<"  # one fewer than colours, so that both repeat together after 42 curves only
_LENGTH = 0.2
"""Of a tangent, as a share of the width of the axes."""
_GREY = {"color": "0.35"}


def write_figure(
    series: Sequence[Series],
    x: str,
    y: Quantity,
    title: str,
    paths: Sequence[Path],
    *,
    parameters: Sequence[str] = (),
    setting: FigureSection | None = None,
    is_reduced: bool = False,
) -> None:
    """Draw one quantity over x for several curves, and write it to files whose endings tell the format.

    Args:
        x: "p" or the dotted key of a parameter.
        paths: .png, .pdf or what else matplotlib writes.
        parameters: what holds for all curves, for below the title.
        setting: how the figure is set; None as without a [figure].
        is_reduced: the lines are for the Ornstein-Uhlenbeck reduction of the noise, the markers are not.
    """
    setting = setting or FigureSection()
    with canvas(paths, SIZES[setting.width]) as figure:
        over = P if x == "p" else parameter_of(x)
        axes = axes_of(figure, over.timed(setting.time_unit), y.timed(setting.time_unit))
        axes.axhline(0, color="0.6", linewidth=0.8 * share_of(figure), zorder=0)
        equation = y.closed_form + (", reduced noise" if is_reduced else "")
        draw = draw_many if len(series) > MOST_NAMED else _draw_few
        entries = draw(figure, axes, series, equation, setting.time_unit)
        axes.margins(x=0.03)
        bounded(axes, setting, (x, ""), Vary({x: tuple(np.concatenate([item.x for item in series]).tolist())}))
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
        entries += _mark(axes, series)
        add_legend(figure, entries)
        add_heading(figure, title, parameters)


def write_bars(
    bars: Mapping[str, Sequence[float]],
    names: Sequence[str],
    title: str,
    paths: Sequence[Path],
    parameters: Sequence[str] = (),
) -> None:
    """Draw groups of bars, one group for each name, and in it one bar for each label."""
    with canvas(paths, Size()) as figure:
        axes = figure.add_subplot(
            xlabel=r"effect of a relative change, $\theta\,\partial/\partial\theta$, over the scale"
        )
        draw_bars(axes, bars, names)
        handles, labels = axes.get_legend_handles_labels()
        add_legend(figure, list(zip(labels, handles, strict=True)))
        add_heading(figure, title, parameters)


def write_response_figure(
    response: Response, title: str, paths: Sequence[Path], parameters: Sequence[str] = ()
) -> None:
    """Draw the stationary response: the joint density of x and ẋ, and the density of the amplitude with its errors."""
    with canvas(paths, Size(width=10.5)) as figure:
        plane, radial = figure.subplots(1, 2)
        response.plot(plane)
        figure.get_layout_engine().set(wspace=0.1)
        response.plot_amplitude(radial)
        add_heading(figure, title, parameters)


def _draw_few(figure: Any, axes: Any, series: Sequence[Series], equation: str, time_unit: str) -> Entries:
    """A colour and a marker for each curve, named in the legend; what that says."""
    entries: Entries = []
    for item, style in zip(series, _styles(series), strict=True):
        name = legend(item.varied, time_unit)
        line = _draw(axes, item, **style)
        entries += [(name, line)] if name else []
    return entries + _methods(axes, series, equation)


def _styles(series: Sequence[Series]) -> list[dict[str, Any]]:
    """How each curve is drawn: where numbers and texts vary, colours tell the former, markers and lines the latter."""
    varied = [item.varied for item in series]
    texts = texts_of(varied) if varied else []
    kinds = [tuple(each[key] for key in texts) for each in varied]
    rest = [tuple(value for key, value in each.items() if key not in texts) for each in varied]
    is_mixed = bool(texts) and bool(numbers_of(varied))
    places = {value: i for i, value in enumerate(dict.fromkeys(rest))}
    lines = {value: i for i, value in enumerate(dict.fromkeys(kinds))}
    return [
        {
            "color": COLOURS[(places[rest[i]] if is_mixed else i) % len(COLOURS)],
            "marker": _MARKERS[(lines[kinds[i]] if is_mixed else i) % len(_MARKERS)],
            "linestyle": STYLES[lines[kinds[i]] % len(STYLES)],
        }
        for i in range(len(series))
    ]


def _draw(axes: Any, item: Series, color: str, marker: str, linestyle: Any) -> Any:
    """One curve; what the legend shows of it."""
    axes.plot(item.line_x, item.line_y, color=color, linestyle=linestyle)
    open_marker = {"marker": marker, "color": color, "markerfacecolor": "none"}
    axes.plot(item.x, item.y, linestyle="none", markevery=item.every, **open_marker)
    if np.any(item.rare):
        chosen = np.broadcast_to(item.rare, item.x.shape) & (np.arange(item.x.size) % item.every == 0)
        axes.plot(item.x[chosen], item.y[chosen], marker, color=color)
    if item.simulated is not None:
        x, y, error = item.simulated
        axes.errorbar(x, y, 2 * error, **_dots(axes))
    return axes.plot([], [], linestyle=linestyle, **open_marker)[0]


def _dots(axes: Any) -> dict[str, Any]:
    share = share_of(axes.figure)
    return {**_DOT, "markersize": 5 * share, "markeredgewidth": share, "elinewidth": 1.1 * share, "capsize": 4 * share}


def _methods(axes: Any, series: Sequence[Series], equation: str) -> Entries:
    """Grey entries that tell what is drawn."""
    elements = "finite elements (not all marked)" if any(item.every > 1 for item in series) else "finite elements"
    entries: Entries = [
        (elements, axes.plot([], [], "o", markerfacecolor="none", **_GREY)[0]),
        (f"perturbation, Eq. {equation}", axes.plot([], [], "-", **_GREY)[0]),
    ]
    if any(np.any(item.rare) for item in series):
        entries.append(("carried by rare paths", axes.plot([], [], "o", **_GREY)[0]))
    if any(item.simulated is not None for item in series):
        entries.append(("Monte Carlo ± 2 standard errors", axes.errorbar([], [], [], **_dots(axes))))
    return entries


def _mark(axes: Any, series: Sequence[Series]) -> Entries:
    """Stability indices as ticks on the zero line, λ as tangents at 0, in the ends that the axes have now."""
    share, entries = share_of(axes.figure), Entries()
    is_many = len(series) > MOST_NAMED
    colours = colours_of(series) if is_many else [style["color"] for style in _styles(series)]
    tick = {"marker": "|", "linestyle": "none", "markersize": 16 * share, "markeredgewidth": 2.2 * share, "zorder": 4}
    if any(item.root is not None for item in series):
        if is_many:
            draw_roots(axes, series)
        else:
            for item, colour in zip(series, colours, strict=True):
                if item.root is not None:
                    axes.plot(item.root, 0, color=colour, **tick)
        handle = axes.plot([], [], **tick, **_GREY)[0]
        entries.append((f"{STABILITY_INDEX.words} {STABILITY_INDEX.latex}", handle))
    if any(item.slope is not None for item in series):
        _tangents(axes, series, colours, 1.0 * share if is_many else 2.6 * share)
        line = axes.plot([], [], linewidth=3 * share, solid_capstyle="butt", **_GREY)[0]
        entries.append((f"slope {LYAPUNOV_EXPONENT.latex} at $p = 0$", line))
    return entries


def _tangents(axes: Any, series: Sequence[Series], colours: Any, width: float) -> None:
    """The tangents at 0, all of one length on paper."""
    from matplotlib.collections import LineCollection

    left, right = axes.get_xlim()
    low, high = axes.get_ylim()
    axes.set(xlim=(left, right), ylim=(low, high))
    slopes = [(item.slope, i) for i, item in enumerate(series) if item.slope is not None]
    box = axes.bbox
    paths = []
    for slope, _ in slopes:
        rise = slope * (right - left) / (high - low) * box.height / box.width  # on paper
        half = 0.5 * _LENGTH * (right - left) / np.hypot(1, rise)
        paths.append([(-half, -half * slope), (half, half * slope)])
    style: dict[str, Any] = {"capstyle": "butt", "zorder": 3.5}
    edge = LineCollection(paths, colors="black", linewidths=1.5 * width, **style)
    inner = LineCollection(paths, colors=[colours[i] for _, i in slopes], linewidths=width, **style)
    for lines in (edge, inner):
        axes.add_collection(lines, autolim=False)
