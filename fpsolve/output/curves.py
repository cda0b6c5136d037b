"""Figures of curves: finite elements, perturbation theory and simulations, as in the paper.

Up to `MOST_NAMED` curves have a marker each, and a name in the legend. More are thin lines, whose colours tell the
value of a key.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.figure import MOST_NAMED, FigureSection
from fpsolve.case.sections import Value, Varied
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

MOST_VECTORS = 1000
"""Curves up to which a PDF holds each as a line, not all as a picture."""
MOST_TALL = 50
"""Curves up to which the ticks of stability indices are tall; more of them would cover what is near zero."""
_MARKERS = "osD^v<"  # one fewer than colours, so that both repeat together after 42 curves only
_TANGENT = 0.2
"""Length of a tangent, as a share of the width of the axes."""
_GREY: dict[str, Any] = {"color": "0.35"}
"""Of what the legend says of all curves."""
STYLES = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
"""Of lines, for up to so many combinations of keys."""


@dataclass(frozen=True, eq=False)
class Series:
    """One curve of a figure: finite elements at (x, y), a line of perturbation theory through (line_x, line_y).

    Attributes:
        varied: the parameters that tell it from the others.
        simulated: x, y and the standard errors of y from a simulation, shape (3, n).
        rare: which of the x have moments that rare paths carry, shape (n,).
        root: the stability index, which is marked on the zero line; None where there is none among the x.
        slope: λ, which is marked as the tangent at 0; None where it is not.
    """

    varied: Varied
    x: FloatArray
    y: FloatArray
    line_x: FloatArray = field(default_factory=lambda: np.zeros(0))
    line_y: FloatArray = field(default_factory=lambda: np.zeros(0))
    simulated: FloatArray | None = None
    rare: Any = False
    root: float | None = None
    slope: float | None = None

    @property
    def every(self) -> int:
        """Of so many x one has a marker."""
        return max(1, self.x.size // 25)


@dataclass(frozen=True)
class Encoding:
    """What tells many curves from each other.

    Attributes:
        key: the one whose value a colour tells; None where it tells the number of the curve.
        colours: that value, or the number, of each curve.
        styles: for each curve what its line style tells; the same everywhere where it tells nothing.
        unencoded: the other keys, each with how many values it has.
    """

    key: str | None
    colours: FloatArray
    styles: tuple[tuple[tuple[str, Value], ...], ...]
    unencoded: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, varied: Sequence[Varied]) -> Encoding:
        """Of the parameters of some curves: a colour for the key with the most values, line styles for a few sets."""
        numbers, texts = _several(varied)

        def of_keys(*keys: str) -> tuple[tuple[tuple[str, Value], ...], ...]:
            return tuple(tuple((key, each[key]) for key in keys) for each in varied)

        sets = len(set(of_keys(*numbers)))
        key = max(numbers, key=lambda name: numbers[name], default=None)
        if key is None or (numbers[key] < sets and np.prod([*numbers.values()]) != sets):
            # none varies, or values side by side, none of which tells the curve
            return cls(None, np.arange(1.0, len(varied) + 1), of_keys(*texts), ())
        colours = np.array([each[key] for each in varied], dtype=float)
        others = [name for name in numbers if name != key] if numbers[key] < sets else []
        styles = of_keys(*others, *texts)
        if len(set(styles)) <= len(STYLES):
            return cls(key, colours, styles, ())
        return cls(key, colours, of_keys(*texts), tuple((name, numbers[name]) for name in others))


def _several(varied: Sequence[Varied]) -> tuple[dict[str, int], list[str]]:
    """The keys of numbers that have several values, and how many; the keys of texts that have several."""
    counts = {key: len({each[key] for each in varied}) for key in (varied[0] if varied else ())}
    several = [key for key, count in counts.items() if count > 1]
    texts = [key for key in several if isinstance(varied[0][key], str)]
    return {key: counts[key] for key in several if key not in texts}, texts


def write_figure(
    series: Sequence[Series],
    x: str,
    y: Quantity,
    title: str,
    paths: Sequence[Path],
    *,
    parameters: Sequence[str] = (),
    setting: FigureSection | None = None,
    about: Callable[[str], Quantity] = parameter_of,
    is_reduced: bool = False,
) -> None:
    """Draw one quantity over x for several curves, and write it to files whose endings tell the format.

    Args:
        x: "p" or the dotted key of a parameter.
        paths: .png, .pdf or what else matplotlib writes.
        parameters: what holds for all curves, for below the title.
        setting: how the figure is set; None as without a [figure].
        about: what a parameter is, by its key.
        is_reduced: the lines are for the Ornstein-Uhlenbeck reduction of the noise, the markers are not.
    """
    setting = setting or FigureSection()
    unit, is_few = setting.time_unit, len(series) <= MOST_NAMED
    with figure_for(paths, title, parameters, FORMATS[setting.width]) as figure:
        axes = figure.add_subplot()
        over = P if x == "p" else about(x)
        label_axes(axes, over.timed(unit).attributes, y.timed(unit).attributes)
        mark_zero(axes)
        equation = y.closed_form + (", reduced noise" if is_reduced else "")
        colours = (_draw_few if is_few else _draw_many)(axes, series, equation, about)
        if any(np.any(item.rare) for item in series):
            axes.plot([], [], "o", label="carried by rare paths", markersize=points(7 if is_few else 4), **_GREY)
        if simulated := [item.simulated for item in series if item.simulated is not None]:
            size, line, cap = (5, 1.1, 4) if is_few else (3, 0.8, 0)
            sizes = {"markersize": points(size), "elinewidth": points(line), "capsize": points(cap)}
            style: dict[str, Any] = {
                "marker": ".",
                "color": "black",
                "markeredgewidth": points(1),
                "zorder": 5,
                **sizes,
            }
            draw_dots(axes, *np.concatenate(simulated, axis=1), label="Monte Carlo ± 2 standard errors", **style)
        axes.margins(x=0.03)
        scale_axis(axes.xaxis, scale_of(np.concatenate([item.x for item in series])), setting.xlim)
        scale_axis(axes.yaxis, "linear", setting.ylim)
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
        _mark(axes, series, colours)


def _draw_few(axes: Any, series: Sequence[Series], equation: str, about: Callable[[str], Quantity]) -> Sequence[Any]:
    """A colour and a marker for each curve, named in the legend; the colours."""
    varied = [item.varied for item in series]
    numbers, texts = _several(varied)
    kinds = [tuple(each[key] for key in texts) for each in varied]
    rest = [tuple(value for key, value in each.items() if key not in texts) for each in varied]
    is_mixed = bool(texts and numbers)  # colours tell numbers, markers and lines texts
    of_rest, of_kind = ({value: i for i, value in enumerate(dict.fromkeys(values))} for values in (rest, kinds))
    colours = [COLOURS[(of_rest[each] if is_mixed else i) % len(COLOURS)] for i, each in enumerate(rest)]
    for i, (item, colour) in enumerate(zip(series, colours, strict=True)):
        marker = _MARKERS[(of_kind[kinds[i]] if is_mixed else i) % len(_MARKERS)]
        line: Any = STYLES[of_kind[kinds[i]] % len(STYLES)]
        hollow: dict[str, Any] = {"marker": marker, "color": colour, "markerfacecolor": "none"}
        axes.plot(item.line_x, item.line_y, color=colour, linestyle=line)
        axes.plot(item.x, item.y, linestyle="none", markevery=item.every, **hollow)
        if np.any(item.rare):
            chosen = np.broadcast_to(item.rare, item.x.shape) & (np.arange(item.x.size) % item.every == 0)
            axes.plot(item.x[chosen], item.y[chosen], marker, color=colour)
        axes.plot([], [], linestyle=line, label=legend(item.varied, about), **hollow)
    words = "finite elements (not all marked)" if any(item.every > 1 for item in series) else "finite elements"
    axes.plot([], [], "o", markerfacecolor="none", label=words, **_GREY)
    axes.plot([], [], "-", label=f"perturbation, Eq. {equation}", **_GREY)
    return colours


def _draw_many(axes: Any, series: Sequence[Series], equation: str, about: Callable[[str], Quantity]) -> Any:
    """Thin lines and a bar of their colours, of which none is too pale on white; the colours, shape (n, 4)."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap, LogNorm, Normalize
    from matplotlib.ticker import MaxNLocator

    encoding = Encoding.of([item.varied for item in series])
    values, is_log = encoding.colours, scale_of(encoding.colours) == "log"
    dark = ListedColormap(colormaps["viridis"](np.linspace(0, 0.93, 256)))
    scale = ScalarMappable((LogNorm if is_log else Normalize)(float(values.min()), float(values.max())), dark)
    colours, is_picture = scale.to_rgba(values), len(series) > MOST_VECTORS
    look = {
        "rasterized": is_picture,
        "alpha": 1.0 if len(series) <= 100 else 0.7,
        "linewidths": points(1.2 if len(series) <= 50 else 0.5 if is_picture else 0.8),
    }
    order = [np.argsort(item.x, kind="stable") for item in series]
    paths = [np.stack([item.x[by], item.y[by]], axis=1) for item, by in zip(series, order, strict=True)]
    others = "".join(f", each for {count} values of {about(key).latex or key}" for key, count in encoding.unencoded)
    kinds = dict.fromkeys(encoding.styles)
    for kind, line in zip(kinds, STYLES, strict=False):
        chosen = [i for i, each in enumerate(encoding.styles) if each == kind]
        lines = LineCollection([paths[i] for i in chosen], colors=colours[chosen], linestyles=[line], **look)
        axes.add_collection(lines, autolim=True)
        name = f", {legend(dict(kind), about)}" if len(kinds) > 1 else ""
        axes.plot([], [], linestyle=line, label=f"finite elements{name}{others}", **_GREY)

    # dots: curves that have but one point, and the points that rare paths carry
    known = [np.isfinite(item.y) for item in series]
    far = [np.broadcast_to(item.rare, item.x.shape).astype(bool) for item in series]
    dots = [(i, at) for i, at in enumerate(known) if at.sum() == 1] + [(i, at) for i, at in enumerate(far) if at.any()]
    if dots:
        x, y = (np.concatenate([getattr(series[i], side)[at] for i, at in dots]) for side in "xy")
        colour = np.repeat(colours[[i for i, _ in dots]], [at.sum() for _, at in dots], axis=0)
        axes.scatter(x, y, s=points(4) ** 2, color=colour, rasterized=is_picture)

    # the perturbation theory of the first, the middle and the last of those that have one
    theories = [series[i] for i in np.argsort(values, kind="stable") if series[i].line_x.size]
    style = {"linestyle": (0, (2, 2)), "color": "black", "linewidth": points(1.2), "zorder": 3}
    outermost = dict.fromkeys([0, len(theories) // 2, len(theories) - 1]) if theories else ()
    for place in outermost:
        axes.plot(theories[place].line_x, theories[place].line_y, **style)
    if outermost:
        axes.plot([], [], label=f"perturbation, Eq. {equation}, of {len(outermost)} curves", **style)

    axes.autoscale_view()
    bar = axes.figure.colorbar(scale, ax=axes, pad=0.02)
    if encoding.key is None:
        bar.set_label("number of the curve")
        bar.ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    else:
        bar.set_label(label_of(about(encoding.key).attributes, 36))
        if is_log:
            plain_numbers(bar.ax.yaxis)
    return colours


def _mark(axes: Any, series: Sequence[Series], colours: Any) -> None:
    """Stability indices as ticks on the zero line, λ as tangents at 0, all of one length, in the present ends."""
    from matplotlib.collections import LineCollection

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
    chosen = [i for i, item in enumerate(series) if item.slope is not None]
    if chosen:
        left, right = axes.get_xlim()
        low, high = axes.get_ylim()
        axes.set(xlim=(left, right), ylim=(low, high))
        slopes = np.array([series[i].slope for i in chosen])
        rises = slopes * (right - left) / (high - low) * axes.bbox.height / axes.bbox.width  # on paper
        half = 0.5 * _TANGENT * (right - left) / np.hypot(1, rises)
        ends, width = np.stack([half, half * slopes], axis=1), points(2.6 if is_few else 1.0)
        for colour, wide in (("black", 1.5 * width), ([colours[i] for i in chosen], width)):  # with black rims
            look: dict[str, Any] = {"colors": colour, "linewidths": wide, "capstyle": "butt", "zorder": 3.5}
            axes.add_collection(LineCollection(list(np.stack([-ends, ends], axis=1)), **look), autolim=False)
        line = {"linewidth": points(3), "solid_capstyle": "butt", **_GREY}
        axes.plot([], [], label=f"slope {LYAPUNOV_EXPONENT.latex} at $p = 0$", **line)
