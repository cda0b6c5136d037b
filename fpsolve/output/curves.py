"""Figures of curves: finite elements, perturbation theory and simulations, as in the paper.

Up to `MOST_NAMED` curves have a marker each, and a name in the legend. More are thin lines, whose colours tell the
value of a key.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.case.figure import MOST_NAMED, FigureSection
from fpsolve.case.vary import legend
from fpsolve.drawing import (
    COLOURS,
    FORMATS,
    draw_dots,
    figure_for,
    label_axes,
    label_of,
    mark_zero,
    plain_numbers,
    points,
    scale_axis,
    scale_of,
)
from fpsolve.model.kinds import parameter_of
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, STABILITY_INDEX, P, Quantity
from fpsolve.output.series import STYLES, Encoding, Series, numbers_of, texts_of

MOST_VECTORS = 1000
"""Curves up to which a PDF holds each as a line, not all as a picture."""
MOST_TALL = 50
"""Curves up to which the ticks of stability indices are tall; more of them would cover what is near zero."""
_MARKERS = "osD^v<"  # one fewer than colours, so that both repeat together after 42 curves only
_TANGENT = 0.2
"""Length of a tangent, as a share of the width of the axes."""
_GREY: dict[str, Any] = {"color": "0.35"}
"""Of what the legend says of all curves."""


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
    unit, is_few = setting.time_unit, len(series) <= MOST_NAMED
    with figure_for(paths, title, parameters, FORMATS[setting.width]) as figure:
        axes = figure.add_subplot()
        over = P if x == "p" else parameter_of(x)
        label_axes(axes, over.timed(unit).attributes, y.timed(unit).attributes)
        mark_zero(axes)
        equation = y.closed_form + (", reduced noise" if is_reduced else "")
        colours = (_draw_few if is_few else _draw_many)(axes, series, equation, unit)
        if any(np.any(item.rare) for item in series):
            axes.plot([], [], "o", label="carried by rare paths", markersize=points(7 if is_few else 4), **_GREY)
        _draw_simulated(axes, series, is_few=is_few)
        axes.margins(x=0.03)
        scale_axis(axes.xaxis, scale_of(np.concatenate([item.x for item in series])), setting.xlim)
        scale_axis(axes.yaxis, "linear", setting.ylim)
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
        _mark(axes, series, colours)


def _draw_few(axes: Any, series: Sequence[Series], equation: str, time_unit: str) -> Sequence[Any]:
    """A colour and a marker for each curve, named in the legend; the colours."""
    styles = _styles(series)
    for item, (colour, marker, line) in zip(series, styles, strict=True):
        hollow: dict[str, Any] = {"marker": marker, "color": colour, "markerfacecolor": "none"}
        axes.plot(item.line_x, item.line_y, color=colour, linestyle=line)
        axes.plot(item.x, item.y, linestyle="none", markevery=item.every, **hollow)
        if np.any(item.rare):
            chosen = np.broadcast_to(item.rare, item.x.shape) & (np.arange(item.x.size) % item.every == 0)
            axes.plot(item.x[chosen], item.y[chosen], marker, color=colour)
        axes.plot([], [], linestyle=line, label=legend(item.varied, time_unit), **hollow)
    words = "finite elements (not all marked)" if any(item.every > 1 for item in series) else "finite elements"
    axes.plot([], [], "o", markerfacecolor="none", label=words, **_GREY)
    axes.plot([], [], "-", label=f"perturbation, Eq. {equation}", **_GREY)
    return [colour for colour, *_ in styles]


def _styles(series: Sequence[Series]) -> list[tuple[str, str, Any]]:
    """Colour, marker and line of each: where numbers and texts vary, colours tell the former, the others the latter."""
    varied = [item.varied for item in series]
    texts = texts_of(varied) if varied else []
    kinds = [tuple(each[key] for key in texts) for each in varied]
    rest = [tuple(value for key, value in each.items() if key not in texts) for each in varied]
    is_mixed = bool(texts) and bool(numbers_of(varied))
    number, line = ({value: i for i, value in enumerate(dict.fromkeys(values))} for values in (rest, kinds))
    return [
        (
            COLOURS[(number[rest[i]] if is_mixed else i) % len(COLOURS)],
            _MARKERS[(line[kinds[i]] if is_mixed else i) % len(_MARKERS)],
            STYLES[line[kinds[i]] % len(STYLES)],
        )
        for i in range(len(series))
    ]


def _draw_many(axes: Any, series: Sequence[Series], equation: str, time_unit: str) -> Any:
    """Thin lines and a bar of their colours; the colours, shape (n, 4)."""
    from matplotlib.collections import LineCollection

    encoding = Encoding.of([item.varied for item in series])
    scale = _colour_scale(encoding)
    colours, is_picture = scale.to_rgba(encoding.colours), len(series) > MOST_VECTORS
    look = {
        "rasterized": is_picture,
        "alpha": 1.0 if len(series) <= 100 else 0.7,
        "linewidths": points(1.2 if len(series) <= 50 else 0.5 if is_picture else 0.8),
    }
    order = [np.argsort(item.x, kind="stable") for item in series]
    paths = [np.stack([item.x[by], item.y[by]], axis=1) for item, by in zip(series, order, strict=True)]
    others = "".join(f", each for {count} values of {parameter_of(key).latex}" for key, count in encoding.unencoded)
    kinds = dict.fromkeys(encoding.styles)
    for kind, style in zip(kinds, STYLES, strict=False):
        chosen = [i for i, each in enumerate(encoding.styles) if each == kind]
        lines = LineCollection([paths[i] for i in chosen], colors=colours[chosen], linestyles=[style], **look)
        axes.add_collection(lines, autolim=True)
        name = f", {legend(dict(kind), time_unit)}" if len(kinds) > 1 else ""
        axes.plot([], [], linestyle=style, label=f"finite elements{name}{others}", **_GREY)
    _draw_points(axes, series, colours, rasterized=is_picture)
    _draw_outermost(axes, [series[i] for i in np.argsort(encoding.colours, kind="stable")], equation)
    axes.autoscale_view()
    _draw_bar(axes, scale, encoding, time_unit)
    return colours


def _colour_scale(encoding: Encoding) -> Any:
    """Colours for values, by their logarithms where they are spread so; none is too pale on white."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    norm = LogNorm if scale_of(encoding.colours) == "log" else Normalize
    dark = ListedColormap(colormaps["viridis"](np.linspace(0, 0.93, 256)))
    return ScalarMappable(norm(float(encoding.colours.min()), float(encoding.colours.max())), dark)


def _draw_points(axes: Any, series: Sequence[Series], colours: Any, **style: Any) -> None:
    """Curves that have but one point, and the points that rare paths carry."""
    known = [np.isfinite(item.y) for item in series]
    shown = [
        (item.x[at], item.y[at], i) for i, (item, at) in enumerate(zip(series, known, strict=True)) if at.sum() == 1
    ]
    shown += [(*item.far, i) for i, item in enumerate(series) if np.any(item.rare)]
    if shown:
        x, y = (np.concatenate([each[k] for each in shown]) for k in (0, 1))
        colour = np.repeat(colours[[i for *_, i in shown]], [each[0].size for each in shown], axis=0)
        axes.scatter(x, y, s=points(4) ** 2, color=colour, **style)


def _draw_outermost(axes: Any, series: Sequence[Series], equation: str) -> None:
    """The perturbation theory of the first, the middle and the last of those that have one."""
    known = [item for item in series if item.line_x.size]
    style = {"linestyle": (0, (2, 2)), "color": "black", "linewidth": points(1.2), "zorder": 3}
    chosen = [known[i] for i in dict.fromkeys([0, len(known) // 2, len(known) - 1])] if known else []
    for item in chosen:
        axes.plot(item.line_x, item.line_y, **style)
    if chosen:
        axes.plot([], [], label=f"perturbation, Eq. {equation}, of {len(chosen)} curves", **style)


def _draw_bar(axes: Any, scale: Any, encoding: Encoding, time_unit: str) -> None:
    """The bar of colours, with the name of the key and its unit."""
    from matplotlib.ticker import MaxNLocator

    bar = axes.figure.colorbar(scale, ax=axes, pad=0.02)
    if encoding.key is None:
        bar.set_label("number of the curve")
        bar.ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
        return
    bar.set_label(label_of(parameter_of(encoding.key).timed(time_unit).attributes, 36))
    if scale_of(encoding.colours) == "log":
        plain_numbers(bar.ax.yaxis)


def _draw_simulated(axes: Any, series: Sequence[Series], *, is_few: bool) -> None:
    """What is simulated, all dots at once."""
    found = [item.simulated for item in series if item.simulated is not None]
    if found:
        size, line, cap = (5, 1.1, 4) if is_few else (3, 0.8, 0)
        style: dict[str, Any] = {
            "markersize": points(size),
            "elinewidth": points(line),
            "capsize": points(cap),
            "marker": ".",
        }
        style |= {"color": "black", "markeredgewidth": points(1), "zorder": 5}
        draw_dots(axes, *np.concatenate(found, axis=1), label="Monte Carlo ± 2 standard errors", **style)


def _mark(axes: Any, series: Sequence[Series], colours: Any) -> None:
    """Stability indices as ticks on the zero line, λ as tangents at 0, in the ends that the axes have now."""
    is_few, rasterized = len(series) <= MOST_NAMED, len(series) > MOST_VECTORS
    roots = [i for i, item in enumerate(series) if item.root is not None]
    if roots:
        high, wide = (16, 2.2) if is_few else (12, 1.2) if len(series) <= MOST_TALL else (6, 1.2)
        style = {"marker": "|", "zorder": 4, "rasterized": rasterized, "linewidths": points(wide)}
        where, shown = [series[i].root for i in roots], [colours[i] for i in roots]
        axes.scatter(where, np.zeros(len(roots)), s=points(high) ** 2, color=shown, **style)
        words = f"{STABILITY_INDEX.words} {STABILITY_INDEX.latex}"
        tick = {"linestyle": "none", "markersize": points(16), "markeredgewidth": points(2.2)}
        axes.plot([], [], marker="|", label=words, **tick, **_GREY)
    if any(item.slope is not None for item in series):
        _draw_tangents(axes, series, colours, points(2.6 if is_few else 1.0))
        line = {"linewidth": points(3), "solid_capstyle": "butt", **_GREY}
        axes.plot([], [], label=f"slope {LYAPUNOV_EXPONENT.latex} at $p = 0$", **line)


def _draw_tangents(axes: Any, series: Sequence[Series], colours: Any, width: float) -> None:
    """The tangents at 0, all of one length on paper, with black rims."""
    from matplotlib.collections import LineCollection

    left, right = axes.get_xlim()
    low, high = axes.get_ylim()
    axes.set(xlim=(left, right), ylim=(low, high))
    chosen = [i for i, item in enumerate(series) if item.slope is not None]
    slopes = np.array([series[i].slope for i in chosen])
    rises = slopes * (right - left) / (high - low) * axes.bbox.height / axes.bbox.width  # on paper
    half = 0.5 * _TANGENT * (right - left) / np.hypot(1, rises)
    ends = np.stack([half, half * slopes], axis=1)
    for colour, wide in (("black", 1.5 * width), ([colours[i] for i in chosen], width)):
        style: dict[str, Any] = {"colors": colour, "linewidths": wide, "capstyle": "butt", "zorder": 3.5}
        axes.add_collection(LineCollection(list(np.stack([-ends, ends], axis=1)), **style), autolim=False)
