"""More curves than a legend can tell apart: thin lines, coloured by the value of a key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray, is_log_spaced
from fpsolve.case.vary import legend
from fpsolve.model.quantity import parameter_of
from fpsolve.output.frame import named, share_of
from fpsolve.output.series import STYLES, Series, Telling
from fpsolve.pictures import plain_numbers

MOST_VECTORS = 1000
"""Curves up to which a PDF holds each as a line, not all as a picture."""
MOST_TALL = 50
"""Curves up to which the ticks of stability indices are tall; more of them would cover what is near zero."""
Entries = list[tuple[str, Any]]


def draw_many(figure: Any, axes: Any, series: Sequence[Series], equation: str, time_unit: str) -> Entries:
    """Draw curves and their colour bar; what the legend says."""
    told, share = Telling.of([item.varied for item in series]), share_of(figure)
    colours = _scale(told.colours)
    look = {
        "rasterized": len(series) > MOST_VECTORS,
        "alpha": 1.0 if len(series) <= 100 else 0.7,
        "linewidths": share * (1.2 if len(series) <= 50 else 0.8 if len(series) <= MOST_VECTORS else 0.5),
    }
    entries: Entries = []
    for style, places in _by_style(told).items():
        _lines(axes, [series[i] for i in places], told.colours[places], colours, linestyles=[style], **look)
    _points(axes, series, told.colours, colours)
    entries += _styles(axes, told, time_unit)
    entries += _theory(axes, _outermost(series, told), equation)
    entries += _simulated(axes, series)
    axes.autoscale_view()
    _bar(figure, axes, colours, told, time_unit)
    return entries


def draw_roots(axes: Any, series: Sequence[Series]) -> None:
    """The stability indices of many curves as ticks on the zero line."""
    told = Telling.of([item.varied for item in series])
    rgba = _scale(told.colours).to_rgba(told.colours)
    chosen = [i for i, item in enumerate(series) if item.root is not None]
    share = share_of(axes.figure)
    size = (150 if len(series) <= MOST_TALL else 40) * share**2
    style = {"marker": "|", "linewidths": 1.2 * share, "zorder": 4, "rasterized": len(series) > MOST_VECTORS}
    axes.scatter([series[i].root for i in chosen], np.zeros(len(chosen)), s=size, color=rgba[chosen], **style)


def colours_of(series: Sequence[Series]) -> Any:
    """The colour of each of many curves, shape (n, 4)."""
    told = Telling.of([item.varied for item in series])
    return _scale(told.colours).to_rgba(told.colours)


def _scale(values: FloatArray) -> Any:
    """Colours for values, by their logarithms where they are spread so; none is too pale on white."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    norm = LogNorm if is_log_spaced(values) else Normalize
    dark = ListedColormap(colormaps["viridis"](np.linspace(0, 0.93, 256)))
    return ScalarMappable(norm(float(values.min()), float(values.max())), dark)


def _by_style(told: Telling) -> Mapping[Any, list[int]]:
    """The places of the curves of each line style."""
    places: dict[Any, list[int]] = {}
    kinds = {kind: STYLES[i] for i, kind in enumerate(dict.fromkeys(told.styles))}
    for i, kind in enumerate(told.styles):
        places.setdefault(kinds[kind], []).append(i)
    return places


def _lines(axes: Any, series: Sequence[Series], values: FloatArray, colours: Any, **style: Any) -> None:
    from matplotlib.collections import LineCollection

    order = [np.argsort(item.x, kind="stable") for item in series]
    paths = [np.stack([item.x[by], item.y[by]], axis=1) for item, by in zip(series, order, strict=True)]
    axes.add_collection(LineCollection(paths, colors=colours.to_rgba(values), **style), autolim=True)


def _points(axes: Any, series: Sequence[Series], values: FloatArray, colours: Any) -> None:
    """Curves that have but one point, and the points that rare paths carry."""
    size, rgba = 16 * share_of(axes.figure) ** 2, colours.to_rgba(values)
    alone = [i for i, item in enumerate(series) if np.count_nonzero(np.isfinite(item.y)) == 1]
    seen = [np.isfinite(series[i].y) for i in alone]
    shown = [(series[i].x[is_seen], series[i].y[is_seen], i) for i, is_seen in zip(alone, seen, strict=True)]
    shown += [(*item.far, i) for i, item in enumerate(series) if np.any(item.rare)]
    if shown:
        x, y = (np.concatenate([np.ravel(each[k]) for each in shown]) for k in (0, 1))
        colour = np.repeat(rgba[[i for *_, i in shown]], [np.size(each[0]) for each in shown], axis=0)
        axes.scatter(x, y, s=size, color=colour, rasterized=len(series) > MOST_VECTORS)


def _styles(axes: Any, told: Telling, time_unit: str) -> Entries:
    """What lines and their styles are."""
    kinds = list(dict.fromkeys(told.styles))
    untold = "".join(f", each for {count} values of {parameter_of(key).latex}" for key, count in told.untold)
    if len(kinds) == 1:
        return [(f"finite elements{untold}", axes.plot([], [], "-", color="0.35")[0])]
    lines = [axes.plot([], [], linestyle=style, color="0.35")[0] for style in STYLES[: len(kinds)]]
    names = [f"finite elements, {legend(dict(kind), time_unit)}{untold}" for kind in kinds]
    return list(zip(names, lines, strict=True))


def _outermost(series: Sequence[Series], told: Telling) -> list[Series]:
    """The first, the middle and the last by their colour, of those that have a perturbation theory."""
    order = [i for i in np.argsort(told.colours, kind="stable") if series[i].line_x.size]
    return [series[i] for i in dict.fromkeys([order[0], order[len(order) // 2], order[-1]])] if order else []


def _theory(axes: Any, series: Sequence[Series], equation: str) -> Entries:
    if not series:
        return []
    style = {"linestyle": (0, (2, 2)), "color": "black", "linewidth": 1.2 * share_of(axes.figure), "zorder": 3}
    for item in series:
        axes.plot(item.line_x, item.line_y, **style)
    return [(f"perturbation, Eq. {equation}, of {len(series)} curves", axes.plot([], [], **style)[0])]


def _simulated(axes: Any, series: Sequence[Series]) -> Entries:
    """All dots at once."""
    found = [item.simulated for item in series if item.simulated is not None]
    share = share_of(axes.figure)
    style: dict[str, Any] = {
        "fmt": ".",
        "color": "black",
        "markersize": 3 * share,
        "markeredgewidth": share,
        "elinewidth": 0.8 * share,
        "zorder": 5,
    }
    entries: Entries = []
    if any(np.any(item.rare) for item in series):
        dot = axes.plot([], [], "o", color="0.35", markersize=4 * share)[0]
        entries.append(("carried by rare paths", dot))
    if found:
        x, y, error = np.concatenate(found, axis=1)
        entries.append(("Monte Carlo ± 2 standard errors", axes.errorbar(x, y, 2 * error, **style)))
    return entries


def _bar(figure: Any, axes: Any, colours: Any, told: Telling, time_unit: str) -> None:
    """The colour bar, with the name of the key and its unit."""
    bar = figure.colorbar(colours, ax=axes, pad=0.02)
    if told.key is None:
        from matplotlib.ticker import MaxNLocator

        bar.set_label("number of the curve")
        bar.ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
        return
    bar.set_label(named(figure, parameter_of(told.key).timed(time_unit), 0.75 * figure.get_figheight()))
    if is_log_spaced(told.colours):
        plain_numbers(bar.ax.yaxis, float(told.colours.min()), float(told.colours.max()), share_of(figure))
