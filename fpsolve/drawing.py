"""Drawing in one style: axes with units, lines with errors, dots, planes, bars, legends; into notebooks and files."""

from __future__ import annotations

import logging
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fpsolve.arrays import FloatArray, is_log_spaced
from fpsolve.files import atomic

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe and Ito
STYLE: dict[Any, Any] = {
    "font.size": 13, "mathtext.fontset": "cm", "axes.titlesize": 12, "axes.prop_cycle": f"cycler(color={COLOURS})",
}  # fmt: skip
SIZE = (7.2, 5.0)
"""Width and height of a figure of `plot`, in inches."""
DOTS: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 5, "elinewidth": 1.3, "capsize": 4}
"""Of dots with bars, if nothing else is said."""
MARKED = 40
"""Largest number of points of a line that each have a marker."""
MOST_LINES = 10
"""Largest number of lines that a legend names."""
QUARTERS = np.pi * np.arange(5) / 2, ["0", r"$\pi/2$", r"$\pi$", r"$3\pi/2$", r"$2\pi$"]
"""Ticks of a phase, and what they say."""


@dataclass(frozen=True)
class Format:
    """How large a figure in a file is.

    Attributes:
        width: of the figure, in inches.
        height: of its axes, in inches; heading, labels and legend come on top of it.
        scale: of letters, lines and marks.
        dpi: pixels of an inch.
    """

    width: float = SIZE[0]
    height: float = 3.8
    scale: float = 1.0
    dpi: int = 160

    @property
    def style(self) -> dict[Any, Any]:
        sizes = {
            "font.size": 13, "axes.titlesize": 11, "figure.titlesize": 12.5, "legend.fontsize": 11,
            "lines.linewidth": 1.6, "lines.markersize": 7, "lines.markeredgewidth": 1.6, "axes.linewidth": 0.9,
        }  # fmt: skip
        scaled = {name: self.scale * value for name, value in sizes.items()}
        return {**STYLE, **scaled, "legend.frameon": False, "pdf.fonttype": 42}


DOUBLE_COLUMN = Format()
FORMATS = {"double column": DOUBLE_COLUMN, "single column": Format(3.5, 2.1, 0.61, 300)}


@contextmanager
def canvas_of(ax: Axes | None) -> Iterator[Axes]:
    """The axes themselves, or those of a new figure of pyplot."""
    if ax is not None:
        yield ax
        return
    from matplotlib import pyplot, rc_context

    figure = pyplot.figure(figsize=SIZE, layout="constrained")  # before the style, whose end undoes what notebooks set
    with rc_context(STYLE):
        new = figure.subplots()
        new.tick_params(labelsize=STYLE["font.size"])  # which later ticks would take from another style
        yield new


@contextmanager
def figure_for(
    paths: Sequence[Path], title: str, parameters: Sequence[str] = (), form: Format = DOUBLE_COLUMN
) -> Iterator[Any]:
    """An empty figure, which gets a heading and a legend of all that has a label, and is written to files in the end.

    Args:
        paths: .png, .pdf or what else matplotlib writes.
        title: the heading, without mathematics.
        parameters: what holds for all of the figure; stands below the title in smaller letters.
        form: how large it is.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    logging.getLogger("fontTools").setLevel(logging.ERROR)  # it remarks on the dates inside fonts
    with rc_context(form.style), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph .* missing", UserWarning)  # it draws boxes for letters without one
        warnings.filterwarnings("ignore", "constrained_layout not applied", UserWarning)  # where words leave no room
        layout = ConstrainedLayoutEngine(h_pad=0.07 * form.scale)
        figure = Figure(figsize=(form.width, 1.3 * form.height), dpi=form.dpi, layout=layout)
        FigureCanvasAgg(figure)
        body: Any = figure.subfigures()
        yield body
        large, small = (_font_size(f"{which}.titlesize") for which in ("figure", "axes"))
        if title:
            lines = [fill(line, letters_in(form.width, large)) for line in title.splitlines()]
            figure.suptitle("\n".join(lines), parse_math=False)
        if parameters:
            body.suptitle(in_lines(parameters, letters_in(form.width, small)), fontsize=small, color="0.3")
        _add_legend(figure)
        figure.set_figheight(4 * form.height)  # has room for everything, so that the layout tells what is left
        layout.execute(figure)
        figure.set_figheight(5 * form.height - figure.axes[0].bbox.height / figure.dpi)
        figure.draw_without_rendering()  # lays it out, once for all formats
        figure.set_layout_engine("none")
        for path in paths:
            with atomic(path) as temporary:
                figure.savefig(temporary, metadata={"CreationDate": None} if path.suffix == ".pdf" else None)


def _add_legend(figure: Any) -> None:
    """A legend below the axes of what has a label, in as many columns as fit."""
    found = [each.get_legend_handles_labels() for each in figure.axes]
    handles, labels = ([item for each in found for item in each[k]] for k in (0, 1))
    if not labels:
        return
    room, size = 0.98 * figure.get_figwidth(), _font_size("legend.fontsize")
    labels = [in_lines(label.split(", "), letters_in(0.9 * room, size)) for label in labels]
    for columns in (4, 3, 2, 1):
        legend = figure.legend(
            handles, labels, loc="outside lower center", ncols=columns, columnspacing=1.2, handlelength=1.8
        )
        if columns == 1 or legend.get_window_extent(figure.canvas.get_renderer()).width <= room * figure.dpi:
            return
        legend.remove()


def letters_in(room: float, size: float) -> int:
    """About how many letters of a size in points have room in a line, whose length is in inches."""
    return int(room * 72 / (0.6 * size))


def in_lines(pieces: Iterable[str], letters: int) -> str:
    """A list in lines of about so many letters, none of its pieces broken."""
    text = ", ".join(piece.replace(" ", "\xa0") for piece in pieces)
    return fill(text, letters, break_long_words=False, break_on_hyphens=False).replace("\xa0", " ")


def is_math(text: str) -> bool:
    """Whether matplotlib can draw a text with dollars."""
    from matplotlib.mathtext import MathTextParser

    try:
        MathTextParser("path").parse(text)
    except ValueError:
        return False
    return True


def typeset(unit: str) -> str:
    """A unit in which matplotlib raises what follows a "^": "1/time$^{1/2}$"."""
    return unit if "$" in unit else re.sub(r"\^(?:\(([^()]+)\)|([+-]?[\d.]+))", r"$^{\1\2}$", unit)


def title_of(attributes: Mapping[str, Any]) -> str:
    r"""A variable on an axis, from its attributes: "largest Lyapunov exponent $\lambda$ (1/time)"."""
    unit = "" if attributes["units"] in ("1", "unknown") else f"({typeset(attributes['units'])})"
    return " ".join(part for part in (attributes["long_name"], attributes.get("symbol", ""), unit) if part)


def label_of(attributes: Mapping[str, Any], letters: int = 40) -> str:
    """The title of a variable in several lines, of at most so many letters each, where it is long."""
    words, rest = str(attributes["long_name"]), title_of({**attributes, "long_name": ""})
    drawn = re.sub(r"\\[A-Za-z]+ ?|[${}^_]", "", rest)
    return f"{fill(words, letters)}{' ' if len(words) + 1 + len(drawn) <= letters else chr(10)}{rest}".strip()


def label_axes(axes: Axes, x: Mapping[str, Any], y: Mapping[str, Any]) -> None:
    axes.set(xlabel=label_of(x, 56), ylabel=label_of(y))


def scale_of(values: FloatArray) -> Literal["linear", "log"]:
    """The scale of an axis on which values are spread evenly."""
    return "log" if is_log_spaced(values) else "linear"


def scale_axis(axis: Any, scale: str, limits: tuple[float, float] | None) -> None:
    """Set the scale of an axis, "linear" or "log", its ends, and numbers such as 0.5, 1, 2 where it is logarithmic."""
    axes, side = axis.axes, axis.axis_name
    axes.set(**{f"{side}scale": scale}, **({f"{side}lim": limits} if limits else {}))
    if scale == "log":
        plain_numbers(axis)


def plain_numbers(axis: Any) -> None:
    """Numbers such as 0.5, 1, 2 on a logarithmic axis of a few decades."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    start, stop = axis.get_view_interval()
    decades = math.log10(stop / start)
    if decades < 4:
        subs = (1, 1.5, 2, 3, 4, 5, 7) if decades < 0.7 else (1, 2, 5) if decades < 2.2 else (1,)
        axis.set_major_locator(MaxNLocator(4) if decades < 0.4 else LogLocator(subs=subs))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")


def _font_size(name: str) -> float:
    from matplotlib import rcParams

    sizes: Mapping[Any, Any] = rcParams
    return float(sizes[name])


def points(size: float) -> float:
    """A width of lines or a size of marks, in points, in proportion to the letters of the style that is set."""
    return size * _font_size("font.size") / float(STYLE["font.size"])


def draw(found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
    """Draw the first variable of a dataset with its error: a point, a line or colours, by its dimensions."""
    main = next(iter(found.data_vars.values()))
    error = found.get(f"{main.name}_error")
    label = {"label": found.attrs["method"]}
    if main.ndim == 0:
        draw_point(axes, main, error, **kwargs)
    elif main.ndim == 1:
        draw_line(axes, main, error, **{**label, **kwargs})
    else:
        draw_plane(axes, main, **kwargs)
    finish(axes, **kwargs)


def draw_line(axes: Axes, main: xarray.DataArray, error: xarray.DataArray | None, **kwargs: Any) -> None:
    """A variable over its coordinate: a few values with bars of ± their errors, many in a band."""
    x = main[main.dims[0]]
    order = np.argsort(x.values, kind="stable")
    places, values = x.values[order], main.values[order]
    marker = {"marker": "o", "markersize": 4} if places.size <= MARKED else {}
    [line] = axes.plot(places, values, **{"linewidth": 1.6, **marker, **in_full(kwargs)})
    if error is not None and marker:
        axes.errorbar(places, values, error.values[order], fmt="none", ecolor=line.get_color(), capsize=4)
    elif error is not None:
        low, high = values - error.values[order], values + error.values[order]
        axes.fill_between(places, low, high, color=line.get_color(), alpha=0.3, linewidth=0)
    label_axes(axes, x.attrs, main.attrs)


def draw_dots(axes: Axes, x: FloatArray, y: FloatArray, error: FloatArray, **kwargs: Any) -> None:
    """Dots with bars of ± two standard errors."""
    axes.errorbar(x, y, 2 * error, **{**DOTS, **in_full(kwargs)})


def draw_point(axes: Axes, main: xarray.DataArray, error: xarray.DataArray | None, **kwargs: Any) -> None:
    """One number with a bar of ± its error, above its symbol; several stand side by side."""
    name = str(main.attrs.get("symbol", main.name))
    size = None if error is None else [error.item()]
    axes.errorbar([name], [main.item()], size, **{**DOTS, **in_full(kwargs)})
    axes.set_ylabel(label_of(main.attrs))
    mark_zero(axes)
    axes.margins(x=0.3)


def draw_plane(axes: Axes, main: xarray.DataArray, **kwargs: Any) -> None:
    """A variable over two coordinates, the first to the right, in colours, with a colour bar."""
    x, y = (main[name] for name in main.dims)
    draw_colours(axes, x.values, y.values, main.values.T, main.attrs, **kwargs)
    label_axes(axes, x.attrs, y.attrs)


def draw_colours(axes: Axes, x: FloatArray, y: FloatArray, values: Any, about: Mapping[str, Any], **kwargs: Any) -> Any:
    """Values over a plane, shape (y, x), in colours, with a colour bar that their attributes name; the bar."""
    style = {"cmap": "viridis", "rasterized": True, "shading": "nearest", **kwargs}
    return axes.figure.colorbar(axes.pcolormesh(x, y, values, **style), ax=axes, pad=0.02, label=label_of(about, 36))


def draw_bars(
    axes: Axes, bars: Mapping[str, Sequence[float] | FloatArray], names: Sequence[str], **kwargs: Any
) -> None:
    """Groups of horizontal bars, one group for each name, and in it one bar for each label."""
    axes.axvline(0, color="0.6", linewidth=0.8, zorder=0)
    height, middles = 0.8 / max(len(bars), 1), np.arange(len(names))
    for i, (label, values) in enumerate(bars.items()):
        places = middles + (i - 0.5 * (len(bars) - 1)) * height
        axes.barh(places, values, 0.9 * height, **{"label": label, **kwargs})
    axes.set_yticks(middles, names)
    axes.invert_yaxis()


def in_full(kwargs: dict[str, Any]) -> dict[str, Any]:
    """What matplotlib is told of a line, by the full names: "linewidth" for "lw"."""
    from matplotlib.cbook import normalize_kwargs
    from matplotlib.lines import Line2D

    return normalize_kwargs(kwargs, Line2D)


def mark_zero(axes: Axes) -> None:
    """The zero line, once."""
    if not any(line.get_gid() == "zero" for line in axes.lines):
        axes.axhline(0, color="0.6", linewidth=points(0.8), zorder=0, gid="zero")


def finish(axes: Axes, **kwargs: Any) -> None:
    """The zero line, where it is seen, and a legend, where it tells things apart or was asked for by a `label`."""
    low, high = axes.get_ylim()
    if low < 0 < high:
        mark_zero(axes)
    labels = set(axes.get_legend_handles_labels()[1])
    if ("label" in kwargs and labels) or len(labels) > 1:
        add_legend(axes)


def add_legend(axes: Axes) -> None:
    """A legend in letters a little smaller than those of the axes."""
    axes.legend(frameon=False, fontsize=0.85 * float(axes.xaxis.label.get_fontsize()))
