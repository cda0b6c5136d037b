"""Pictures of labelled arrays in the house style: lines with their errors, colours over a plane, bars."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe and Ito
STYLE: dict[Any, Any] = {"font.size": 13, "mathtext.fontset": "cm", "axes.titlesize": 12}
SIZE = (7.2, 5.0)
"""Of a figure, in inches."""
LONG = 40
"""With more letters a label has several lines."""
MARKED = 40
"""Up to so many points of a line have markers."""


def title_of(attributes: Mapping[str, Any]) -> str:
    r"""A variable on an axis, from its attributes: "largest Lyapunov exponent $\lambda$ (1/time)"."""
    unit = "" if attributes["units"] == "1" else f"({attributes['units']})"
    return " ".join(part for part in (attributes["long_name"], attributes.get("symbol", ""), unit) if part)


def label_of(variable: xarray.DataArray) -> str:
    """The same in several lines, where it is long."""
    words = str(variable.attrs["long_name"])
    rest = title_of({**variable.attrs, "long_name": ""})
    return f"{fill(words, LONG)}{' ' if len(words) <= LONG else chr(10)}{rest}".strip()


@contextmanager
def canvas_of(ax: Axes | None) -> Iterator[Axes]:
    """The axes themselves, or those of a new figure in the house style."""
    if ax is not None:
        yield ax
        return
    from matplotlib import pyplot, rc_context

    figure = pyplot.figure(figsize=SIZE, layout="constrained")  # before the style, whose end undoes what notebooks set
    with rc_context(STYLE):
        new = figure.subplots()
        new.tick_params(labelsize=STYLE["font.size"])  # which later ticks would take from another style
        yield new


def draw(found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
    """Draw the first variable of a dataset with its error: a point, a line or colours, by its dimensions."""
    main = next(iter(found.data_vars.values()))
    error = found.get(f"{main.name}_error")
    label = {"label": found.attrs["method"]}
    if main.ndim == 2:
        draw_plane(axes, main, **kwargs)
    elif main.ndim == 1:
        draw_line(axes, main, error, **{**label, **kwargs})
    else:
        draw_point(axes, main, error, **kwargs)
    finish(axes, **kwargs)


def draw_line(axes: Axes, main: xarray.DataArray, error: xarray.DataArray | None, **kwargs: Any) -> None:
    """A variable over its coordinate, in a band of ± its error."""
    x = main[main.dims[0]]
    order = np.argsort(x.values, kind="stable")
    places, values = x.values[order], main.values[order]
    marker = {"marker": "o", "markersize": 4} if places.size <= MARKED else {}
    [line] = axes.plot(places, values, **{"linewidth": 1.6, **marker, **coloured(axes, kwargs)})
    if error is not None:
        low, high = values - error.values[order], values + error.values[order]
        axes.fill_between(places, low, high, color=line.get_color(), alpha=0.3, linewidth=0)
    axes.set(xlabel=label_of(x), ylabel=label_of(main))


def draw_dots(axes: Axes, main: xarray.DataArray, error: xarray.DataArray, **kwargs: Any) -> None:
    """A variable over its coordinate, as dots with bars of ± two standard errors."""
    x = main[main.dims[0]]
    style = {"linestyle": "none", "marker": "o", "markersize": 5, "elinewidth": 1.3, "capsize": 4}
    axes.errorbar(x.values, main.values, 2 * error.values, **{**style, **coloured(axes, kwargs)})
    axes.set(xlabel=label_of(x), ylabel=label_of(main))


def draw_point(axes: Axes, main: xarray.DataArray, error: xarray.DataArray | None, **kwargs: Any) -> None:
    """One number with a bar of ± its error, above its symbol; several stand side by side."""
    name = str(main.attrs.get("symbol", main.name))
    size = None if error is None else [error.item()]
    style = {"linestyle": "none", "marker": "o", "markersize": 6, "elinewidth": 1.3, "capsize": 5}
    axes.errorbar([name], [main.item()], size, **{**style, **coloured(axes, kwargs)})
    axes.set_ylabel(label_of(main))
    mark_zero(axes)
    axes.margins(x=0.3)


def draw_plane(axes: Axes, main: xarray.DataArray, **kwargs: Any) -> Any:
    """A variable over two coordinates, the first to the right, in colours, with a colour bar."""
    x, y = (main[name] for name in main.dims)
    style = {"cmap": "viridis", "rasterized": True, "shading": "nearest", **kwargs}
    picture = axes.pcolormesh(x.values, y.values, main.values.T, **style)
    axes.set(xlabel=label_of(x), ylabel=label_of(y))
    axes.figure.colorbar(picture, ax=axes, label=label_of(main))
    return picture


def draw_bars(
    axes: Axes, bars: Mapping[str, Sequence[float] | FloatArray], names: Sequence[str], **kwargs: Any
) -> None:
    """Groups of horizontal bars, one group for each name, and in it one bar for each label."""
    axes.axvline(0, color="0.6", linewidth=0.8, zorder=0)
    height, middles = 0.8 / max(len(bars), 1), np.arange(len(names))
    for i, (label, values) in enumerate(bars.items()):
        places = middles + (i - 0.5 * (len(bars) - 1)) * height
        style = {"color": COLOURS[i % len(COLOURS)], "label": label, **kwargs}
        axes.barh(places, values, 0.9 * height, **style)
    axes.set_yticks(middles, names)
    axes.invert_yaxis()


def plain_numbers(side: Any, start: float, stop: float, share: float = 1.0) -> None:
    """Numbers such as 0.5, 1, 2 on a logarithmic axis of a few decades; fewer of them where letters take more room.

    Args:
        share: of letters, see `Size`; those of a small figure are large for it.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

    decades = math.log10(stop / start)
    if decades < 4:
        few = MaxNLocator(5 if share > 0.8 else 4)
        many = LogLocator(subs=(1, 2, 5) if decades < (2.5 if share > 0.8 else 1.8) else (1,))
        side.set_major_locator(few if decades < 0.7 else many)
        side.set_major_formatter(StrMethodFormatter("{x:g}"))
        side.set_minor_formatter(NullFormatter())


def coloured(axes: Axes, kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """What matplotlib is told of a line, with a colour that no other line has unless it has one."""
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.colors import to_hex
    from matplotlib.lines import Line2D

    taken = {to_hex(line.get_color()).upper() for line in axes.lines}
    free = next((colour for colour in COLOURS if colour not in taken), COLOURS[0])
    return {"color": free, **normalize_kwargs(dict(kwargs), Line2D)}


def mark_zero(axes: Axes) -> None:
    """The zero line, once."""
    if not any(line.get_gid() == "zero" for line in axes.lines):
        axes.axhline(0, color="0.6", linewidth=0.8, zorder=0, gid="zero")


def finish(axes: Axes, **kwargs: Any) -> None:
    """The zero line, where it is seen, and a legend, where it tells things apart or was asked for by a `label`."""
    low, high = axes.get_ylim()
    if low < 0 < high:
        mark_zero(axes)
    if "label" in kwargs or len(set(axes.get_legend_handles_labels()[1])) > 1:
        add_legend(axes)


def add_legend(axes: Axes) -> None:
    """A legend in letters a little smaller than those of the axes."""
    axes.legend(frameon=False, fontsize=0.85 * float(axes.xaxis.label.get_fontsize()))
