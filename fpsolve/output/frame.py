"""Figures for print: a canvas that grows with its heading above and its legend below, so that these cover nothing."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

from fpsolve.case.figure import FigureSection, Width, is_logarithmic
from fpsolve.case.vary import Vary
from fpsolve.files import atomic
from fpsolve.model.quantity import Quantity
from fpsolve.pictures import SIZE, STYLE, plain_numbers


@dataclass(frozen=True)
class Size:
    """How large a figure is.

    Attributes:
        width, height: in inches, without heading and legend.
        share: of letters, lines and marks, of those in the larger figure.
        dpi: pixels of an inch.
    """

    width: float = SIZE[0]
    height: float = 4.5
    share: float = 1.0
    dpi: int = 160


SIZES: Mapping[Width, Size] = {"double column": Size(), "single column": Size(3.5, 2.6, 0.61, 300)}
_GAP = 0.09
"""Between parts of a figure, in inches, of the larger one."""


@contextmanager
def canvas(paths: Sequence[Path], size: Size) -> Iterator[Any]:
    """An empty figure in the house style, which is written to the paths in the end."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    logging.getLogger("fontTools").setLevel(logging.ERROR)  # it remarks on the dates inside fonts
    style: dict[Any, Any] = {**STYLE, **_small(size.share), "pdf.fonttype": 42}
    with rc_context(style):
        figure = Figure(figsize=(size.width, size.height), dpi=size.dpi, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.draw_without_rendering()  # lays it out, once for all formats
        figure.set_layout_engine("none")
        for path in paths:
            with atomic(path) as temporary:
                figure.savefig(temporary, metadata={"CreationDate": None} if path.suffix == ".pdf" else None)


def _small(share: float) -> dict[str, Any]:
    """Letters, lines and marks of a size."""
    sizes = {
        **{"font.size": 13, "axes.titlesize": 11, "figure.titlesize": 12.5, "legend.fontsize": 11},
        **{"lines.linewidth": 1.6, "lines.markersize": 7, "lines.markeredgewidth": 1.6, "axes.linewidth": 0.9},
        **{f"{side}tick.{which}.{what}": length for side in "xy" for which, what, length in _TICKS},
    }
    return {"legend.frameon": False, **{name: share * value for name, value in sizes.items()}}


_TICKS = (("major", "size", 4), ("minor", "size", 2.2), ("major", "width", 0.9), ("minor", "width", 0.7))


def share_of(figure: Any) -> float:
    """Of letters and marks, see `Size`."""
    from matplotlib import rcParams

    return float(rcParams["font.size"]) / 13


def axes_of(figure: Any, x: Quantity, y: Quantity) -> Any:
    """Axes over a quantity, and for another, with their names in lines that fit."""
    long, high = 0.78 * figure.get_figwidth(), 0.88 * figure.get_figheight()
    return figure.add_subplot(xlabel=named(figure, x, long), ylabel=named(figure, y, high))


def named(figure: Any, quantity: Quantity, room: float) -> str:
    """The title of an axis, its symbol in a second line where it is long, for a length in inches."""
    title = quantity.title
    if _width(figure, title, _font("font.size")) <= room:
        return title
    return f"{quantity.words}\n{title.removeprefix(quantity.words).strip()}"


def bounded(axes: Any, setting: FigureSection, keys: tuple[str, str], vary: Vary) -> None:
    """The ends that a case sets, and logarithmic axes for values that are spread so."""
    for side, key, limits in (("x", keys[0], setting.xlim), ("y", keys[1], setting.ylim)):
        axis = axes.xaxis if side == "x" else axes.yaxis
        if is_logarithmic(key, vary):
            axes.set(**{f"{side}scale": "log"})
        if limits:
            axes.set(**{f"{side}lim": limits})
        if is_logarithmic(key, vary):
            start, stop = axis.get_view_interval()
            plain_numbers(axis, start, stop, share_of(axes.figure))


def add_legend(figure: Any, entries: Sequence[tuple[str, Any]]) -> None:
    """A legend below the axes, in as many columns as fit; the figure grows by it."""
    if not entries:
        return
    room, letters = 0.98 * figure.get_figwidth(), _font("legend.fontsize")
    labels = [in_lines(figure, label.split(", "), room - letters / 18, letters, ", ") for label, _ in entries]
    handles = [handle for _, handle in entries]
    several = [(columns, share) for columns in (4, 3, 2) for share in (1.0, 0.9) if columns <= len(entries)]
    for columns, share in [*several, (1, 1.0)]:
        style = {"ncols": columns, "columnspacing": 1.2, "handlelength": 1.8, "fontsize": share * letters}
        legend = figure.legend(handles, labels, loc="outside lower center", **style)
        box = legend.get_window_extent(figure.canvas.get_renderer())
        if box.width <= room * figure.dpi or columns == 1:
            break
        legend.remove()
    _grow(figure, box.height / figure.dpi)


def add_heading(figure: Any, title: str, parameters: Sequence[str] = ()) -> None:
    """The title and, smaller, the parameters above all else; the last that a figure gets, which it grows by."""
    from matplotlib.transforms import ScaledTranslation

    size, small = _font("figure.titlesize"), _font("axes.titlesize")
    room, gap = 0.96 * figure.get_figwidth(), _GAP * share_of(figure)
    told = in_lines(figure, parameters, room, small, ", ")
    above = gap
    for text, letters, colour, has_math in (
        (filled(figure, title, room, size), size, "black", False),
        (told, small, "0.3", True),
    ):
        if not text:
            continue
        place = figure.transFigure + ScaledTranslation(0, -above, figure.dpi_scale_trans)
        style = {"ha": "center", "va": "top", "fontsize": letters, "color": colour, "parse_math": has_math}
        drawn = figure.text(0.5, 1, text, transform=place, linespacing=1.15, **style)
        drawn.set_in_layout(False)
        above += drawn.get_window_extent(figure.canvas.get_renderer()).height / figure.dpi + gap
    _grow(figure, above)
    figure.get_layout_engine().set(rect=(0, 0, 1, 1 - above / figure.get_figheight()))


def filled(figure: Any, text: str, room: float, size: float) -> str:
    """A text without mathematics in lines that fit, each of its own lines for itself."""
    lines = []
    for line in text.splitlines():
        for width in range(120, 4, -3):
            made = fill(line, width)
            if max((_width(figure, each, size, is_math=False) for each in made.splitlines()), default=0) <= room:
                break
        lines.append(made)
    return "\n".join(lines)


def in_lines(figure: Any, pieces: Sequence[str], room: float, size: float, mark: str) -> str:
    """Pieces with a mark between them in as few lines as fit, these of like lengths, none of the pieces broken."""
    lines = _lines(figure, pieces, room, size, mark)
    for share in (0.9, 0.8, 0.7, 0.6):
        shorter = _lines(figure, pieces, share * room, size, mark)
        lines = shorter if len(shorter) == len(lines) else lines
    return f"{mark.rstrip()}\n".join(lines)


def _lines(figure: Any, pieces: Sequence[str], room: float, size: float, mark: str) -> list[str]:
    """The same, each line as long as it can be."""
    lines: list[str] = []
    for piece in pieces:
        longer = f"{lines[-1]}{mark}{piece}" if lines else piece
        if lines and _width(figure, longer, size) <= room:
            lines[-1] = longer
        else:
            lines.append(piece)
    return lines


def _width(figure: Any, text: str, size: float, *, is_math: bool = True) -> float:
    """Of a line, in inches."""
    from matplotlib.font_manager import FontProperties

    measure = figure.canvas.get_renderer().get_text_width_height_descent
    wide, _, _ = measure(text, FontProperties(size=size), is_math and "$" in text)
    return float(wide) / float(figure.dpi)


def _font(name: str) -> float:
    """A size of letters of the style, in points."""
    from matplotlib import rcParams

    sizes: Mapping[Any, Any] = rcParams
    return float(sizes[name])


def _grow(figure: Any, height: float) -> None:
    figure.set_figheight(figure.get_figheight() + height)
