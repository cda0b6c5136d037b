"""Drawing in one style: axes with units, lines with errors, dots, planes, bars, legends; into notebooks and files.

matplotlib takes 210 ms to import, which who draws nothing saves: so functions import it.
"""

from __future__ import annotations

import logging
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import TextWrapper, fill
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fpsolve.arrays import FloatArray, is_log_spaced
from fpsolve.files import atomic

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.text import Text

STYLE = Path(__file__).with_name("fpsolve.mplstyle")
"""The style of all pictures: sizes, letters, colours, legends."""
DOTS: dict[str, Any] = {"linestyle": "none", "marker": "o"}
"""Of dots with bars, if nothing else is said."""
ZERO: dict[str, Any] = {"color": "0.6", "linewidth": 0.8, "zorder": 0, "gid": "zero"}
"""Of the zero line."""
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

    width: float = 7.2
    height: float = 3.8
    scale: float = 1.0
    dpi: int = 160


FORMATS = {"double column": Format(), "single column": Format(3.5, 2.1, 0.61, 300)}


@contextmanager
def styled(scale: float = 1.0) -> Iterator[None]:
    """Set `STYLE`, with its lengths times a scale."""
    from matplotlib import rc_context, rc_params_from_file

    settings = rc_params_from_file(STYLE, use_default_template=False)
    lengths = {name: scale * value for name, value in settings.items() if isinstance(value, float)}
    with rc_context({**settings, **lengths}):
        yield


@contextmanager
def canvas_of(ax: Axes | None) -> Iterator[Axes]:
    """The axes themselves, or those of a new figure of pyplot."""
    if ax is not None:
        yield ax
        return
    from matplotlib import pyplot

    figure = pyplot.figure(layout="constrained")  # before the style, whose end undoes what notebooks set
    with styled():
        figure.set_size_inches(pyplot.rcParams["figure.figsize"])
        new = figure.subplots()
        new.tick_params(labelsize=pyplot.rcParams["font.size"])  # which later ticks would take from another style
        yield new


@contextmanager
def figure_for(
    paths: Sequence[Path], title: str, parameters: Sequence[str] = (), form: Format = Format()
) -> Iterator[SubFigure]:
    """An empty figure, which gets a heading and a legend of all that has a label, and is written to files in the end.

    Args:
        paths: .png, .pdf or what else matplotlib writes.
        title: the heading, without mathematics.
        parameters: what holds for all of the figure; stands below the title in smaller letters.
        form: how large it is.
    """
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    logging.getLogger("fontTools").setLevel(logging.ERROR)  # it remarks on the dates inside fonts
    with styled(form.scale), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph .* missing", UserWarning)  # it draws boxes for letters without one
        warnings.filterwarnings("ignore", "constrained_layout not applied", UserWarning)  # where words leave no room
        layout = ConstrainedLayoutEngine()
        figure = Figure(figsize=(form.width, 1.3 * form.height), dpi=form.dpi, layout=layout)
        body: SubFigure = figure.subfigures(squeeze=False)[0, 0]
        yield body
        _break(figure.suptitle(title, parse_math=False), form.width)
        if parameters:
            _break(body.suptitle(_unbroken(parameters), fontsize="small", color="0.3"), form.width)
        if any(axes.get_legend_handles_labels()[1] for axes in figure.axes):
            _add_legend(figure)
        figure.set_figheight(4 * form.height)  # has room for everything, so that the layout tells what is left
        layout.execute(figure)
        figure.set_figheight(5 * form.height - figure.axes[0].bbox.height / figure.dpi)
        figure.draw_without_rendering()  # lays it out, once for all formats
        figure.set_layout_engine("none")
        for path in paths:
            with atomic(path) as temporary:
                figure.savefig(temporary, metadata={"CreationDate": None} if path.suffix == ".pdf" else None)


def _add_legend(figure: Figure) -> None:
    """A legend below the axes of what has a label, in as many columns as fit."""
    for columns in (4, 3, 2, 1):
        legend = figure.legend(loc="outside lower center", ncols=columns)
        for text in legend.get_texts():
            text.set_text(_unbroken(text.get_text().split(", ")))
            _break(text, 0.88 * figure.get_figwidth())
        if legend.get_window_extent().width <= 0.98 * figure.bbox.width:
            return
        if columns > 1:
            legend.remove()


def _unbroken(pieces: Iterable[str]) -> str:
    """A list whose pieces `_break` leaves whole."""
    return ", ".join(piece.replace(" ", "\xa0") for piece in pieces)


def _break(text: Text, room: float) -> None:
    """Break a text into lines of about a length in inches."""
    letters = int(room * 72 / (0.6 * float(text.get_fontsize())))
    wrapper = TextWrapper(letters, break_long_words=False, break_on_hyphens=False)
    text.set_text("\n".join(map(wrapper.fill, text.get_text().splitlines())).replace("\xa0", " "))


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


def scale_axis(axis: Axis, scale: str, limits: tuple[float, float] | None) -> None:
    """Set the scale of an axis, "linear" or "log", its ends, and numbers such as 0.5, 1, 2 where it is logarithmic."""
    side = "x" if axis is axis.axes.xaxis else "y"
    axis.axes.set(**{f"{side}scale": scale, **({f"{side}lim": limits} if limits else {})})
    if scale == "log":
        plain_numbers(axis)


def plain_numbers(axis: Axis) -> None:
    """Numbers such as 0.5, 1, 2 on a logarithmic axis of a few decades."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    start, stop = axis.get_view_interval()
    decades = math.log10(stop / start)
    if decades < 4:
        subs = (1, 2, 5) if decades < 2.2 else (1,)
        axis.set_major_locator(MaxNLocator(5) if decades < 0.7 else LogLocator(subs=subs))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")


def draw(found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
    """Draw the first variable of a dataset with its error: a point, a line or colours, by its dimensions."""
    main = next(iter(found.data_vars.values()))
    error = found.get(f"{main.name}_error")
    if main.ndim == 0:  # above its symbol, as several stand side by side
        size = None if error is None else [error.item()]
        axes.errorbar([str(main.attrs.get("symbol", main.name))], [main.item()], size, **{**DOTS, **kwargs})
        axes.set_ylabel(label_of(main.attrs))
        axes.axhline(0, **ZERO)
        axes.margins(x=0.3)
    elif main.ndim == 1:
        draw_line(axes, main, error, **{"label": found.attrs["method"], **kwargs})
    else:
        draw_plane(axes, main, **kwargs)
    finish(axes, **kwargs)


def draw_line(axes: Axes, main: xarray.DataArray, error: xarray.DataArray | None, **kwargs: Any) -> None:
    """A variable over its coordinate: a few values with bars of ± their errors, many in a band."""
    x = main[main.dims[0]]
    order = np.argsort(x.values, kind="stable")
    places, values = x.values[order], main.values[order]
    size = None if error is None else error.values[order]
    if places.size <= MARKED:
        axes.errorbar(places, values, size, **{"marker": "o", **kwargs})
    else:
        [line] = axes.plot(places, values, **kwargs)
        if size is not None:
            axes.fill_between(places, values - size, values + size, color=line.get_color(), alpha=0.3, linewidth=0)
    label_axes(axes, x.attrs, main.attrs)


def draw_dots(axes: Axes, x: FloatArray, y: FloatArray, error: FloatArray, **kwargs: Any) -> None:
    """Dots with bars of ± two standard errors."""
    axes.errorbar(x, y, 2 * error, **{**DOTS, **kwargs})


def draw_plane(axes: Axes, main: xarray.DataArray, **kwargs: Any) -> None:
    """A variable over two coordinates, the first to the right, in colours, with a colour bar."""
    x, y = (main[name] for name in main.dims)
    draw_colours(axes, x.values, y.values, main.values.T, main.attrs, **kwargs)
    label_axes(axes, x.attrs, y.attrs)


def draw_colours(
    axes: Axes, x: FloatArray, y: FloatArray, values: FloatArray, about: Mapping[str, Any], **kwargs: Any
) -> Colorbar:
    """Values over a plane, shape (y, x), in colours, with a colour bar that their attributes name; the bar."""
    mesh = axes.pcolormesh(x, y, values, **{"rasterized": True, "shading": "nearest", **kwargs})
    return axes.figure.colorbar(mesh, ax=axes, pad=0.02, label=label_of(about, 36))


def draw_bars(
    axes: Axes, bars: Mapping[str, Sequence[float] | FloatArray], names: Sequence[str], **kwargs: Any
) -> None:
    """Groups of horizontal bars, one group for each name, and in it one bar for each label."""
    axes.axvline(0, **ZERO)
    height, middles = 0.8 / max(len(bars), 1), np.arange(len(names))
    for i, (label, values) in enumerate(bars.items()):
        places = middles + (i - 0.5 * (len(bars) - 1)) * height
        axes.barh(places, values, 0.9 * height, **{"label": label, **kwargs})
    axes.set_yticks(middles, names)
    axes.invert_yaxis()


def finish(axes: Axes, **kwargs: Any) -> None:
    """The zero line, where it is seen, and a legend, where it tells things apart or was asked for by a `label`."""
    low, high = axes.get_ylim()
    if low < 0 < high:
        axes.axhline(0, **ZERO)
    labels = set(axes.get_legend_handles_labels()[1])
    if ("label" in kwargs and labels) or len(labels) > 1:
        axes.legend()
