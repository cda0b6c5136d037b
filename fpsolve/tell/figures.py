"""What the figures of a case show: solved curves beside perturbation theory and simulated ones; maps.

Up to `MOST_NAMED` curves have a marker each, and a name in the legend. More are thin lines, whose colours tell the
value of the key that tells them from each other, or else their number. matplotlib takes 210 ms to import, which a run
without pictures saves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.sections import MOST_NAMED, Value, Varied, same
from fpsolve.case.vary import legend, map_key
from fpsolve.data import Quantity
from fpsolve.drawing import (
    FORMATS,
    ZERO,
    draw_colours,
    draw_dots,
    figure_for,
    label_axes,
    label_of,
    plain_numbers,
    scale_axis,
    scale_of,
)
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX, SUMMARY_NUMBERS
from fpsolve.model.quantity import GROWTH, MOMENT, RATE_FUNCTION, STATUS, P
from fpsolve.results.table import Table
from fpsolve.solve.set_result import SetResult, SimulatedSet, Status
from fpsolve.tell.blocks import Drawing
from fpsolve.theory import perturbation
from fpsolve.theory.perturbation import perturbed_moments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType

MOST_VECTORS = 1000
"""Curves up to which a PDF holds each as a line, not all as a picture."""
_MARKERS = "osD^v<"  # one fewer than colours, so that both repeat together after 42 curves only
_TANGENT = 0.1
"""Length of half a tangent, as a share of the width of the axes."""
_BETWEEN = "#00C800"
"""Of the line of zeros between values."""
_NOTHING = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Series:
    """One curve of a figure: finite elements at (x, y), a line of perturbation theory through (line_x, line_y).

    Attributes:
        varied: the parameters that tell it from the others.
        root: the stability index, which is marked on the zero line; None where there is none among the x.
        slope: λ, which is marked as the tangent at 0; None where it is not.
    """

    varied: Varied
    x: FloatArray
    y: FloatArray
    line_x: FloatArray
    line_y: FloatArray
    root: float | None = None
    slope: float | None = None

    @property
    def path(self) -> FloatArray:
        """The points (x, y) from the left to the right, shape (n, 2)."""
        return np.stack([self.x, self.y], axis=1)[np.argsort(self.x, kind="stable")]


def coloured_by(varied: Sequence[Varied]) -> tuple[str | None, FloatArray]:
    """The key whose value tells each of some sets from the others, and its values; without one their numbers."""
    for key, first in varied[0].items():
        values = [each[key] for each in varied]
        if not isinstance(first, str) and len(set(values)) == len(varied):
            return key, np.array(values, dtype=float)
    return None, np.arange(1.0, len(varied) + 1)


def main_figure(
    case: Case,
    results: Sequence[SetResult],
    simulated: Sequence[SimulatedSet],
    table: Table,
) -> Drawing:
    """figure.png and .pdf: finite elements, perturbation theory, dots of a simulation.

    Over two keys with many values it is a map. There is none with `[output] figure = false`, and without a [figure]
    none of a case that does not ask for Λ(p).

    Args:
        table: the numbers of all parameter sets.
    """
    setting, other = case.figure, map_key(case.figure, case.vary)
    over = "p" if setting.x == "p" else case.about(setting.x).words
    title = f"The {setting.quantity.words}, {setting.quantity.symbol}, over {over}"

    def draw(axes: Axes) -> None:
        if other:
            _draw_map(case, table, (setting.x, other), axes)
        else:
            _draw_curves(case, results, simulated, table, axes)
        own = {"xlabel": setting.xlabel, "ylabel": setting.ylabel}
        axes.set(**{name: text for name, text in own.items() if text is not None})

    return Drawing(title, partial(_draw, case, results, setting.needed, draw), "figure", case.caption)


def _draw(
    case: Case,
    results: Sequence[SetResult],
    needed: str,
    draw: Callable[[Axes], None],
    paths: Sequence[Path],
    heading: str,
) -> None:
    """A figure of all curves, if there are any and the case asks for it and for the quantity that it needs."""
    if case.output.figure and needed in case.asked and results:
        fixed = results[0].parameter_set.fixed(case.units.time, case.vary.keys)
        with figure_for(paths, heading, fixed, FORMATS[case.figure.width]) as figure:
            draw(figure.add_subplot())


def _draw_curves(
    case: Case, results: Sequence[SetResult], simulated: Sequence[SimulatedSet], table: Table, axes: Axes
) -> None:
    setting = case.figure
    if setting.x == "p":
        shown = _with_theory(case, len(results))
        series = [_moment_series(case, result, with_theory=i in shown) for i, result in enumerate(results)]
    else:
        series = _over_parameter(case, results, _numbers(case, table))
    over = P if setting.x == "p" else case.about(setting.x)
    colours = draw_series(axes, case, series, over, setting.quantity, _dots(case, simulated))
    places = np.concatenate([item.x for item in series])
    scale_axis(axes.xaxis, scale_of(places), setting.xlim)
    scale_axis(axes.yaxis, "linear", setting.ylim)
    _mark(axes, series, colours)


def rate_figure(case: Case, results: Sequence[SetResult]) -> Drawing:
    """rate_function.png and .pdf, if the case asks for it: I(s) at s = Λ′(p) of every p, 0 at s = λ."""

    def draw(axes: Axes) -> None:
        shown = _with_theory(case, len(results))
        series = [_rates(result, with_theory=i in shown) for i, result in enumerate(results)]
        draw_series(axes, case, series, GROWTH, RATE_FUNCTION)

    title = f"The {RATE_FUNCTION.words}, {RATE_FUNCTION.symbol}"
    return Drawing(title, partial(_draw, case, results, RATE_FUNCTION.name, draw), "rate_function", case.headline)


def _with_theory(case: Case, count: int) -> set[int]:
    """Places of curves with perturbation theory: all of few, or of many three."""
    shown = set(range(count)) if count <= MOST_NAMED else {0, count // 2, count - 1}
    return shown if case.figure.lines else set()


def _moment_series(case: Case, result: SetResult, *, with_theory: bool) -> Series:
    p = result.moments.p
    first, last = p.min(initial=math.inf), p.max(initial=-math.inf)
    line = np.linspace(first, last, 200) if with_theory and p.size else _NOTHING
    root, slope = (
        found.value if each.name in case.figure.mark and (found := result.estimates[each.name]) else None
        for each in (STABILITY_INDEX, LYAPUNOV_EXPONENT)
    )
    return Series(
        dict(result.parameter_set.varied),
        p,
        result.moments.value,
        line,
        perturbed_moments(result.parameter_set.problem, line) if line.size else _NOTHING,
        root if root is not None and first <= root <= last else None,
        slope if first <= 0 <= last else None,
    )


def _rates(result: SetResult, *, with_theory: bool) -> Series:
    """I over s, beside the parabola (s − λ)²/2Λ″(0) of perturbation theory."""
    found = result.moments
    theory = perturbation.second_order_or_none(result.parameter_set.problem) if found.p.size else None
    known = np.isfinite(found.derivative)
    s, line, values = found.derivative[known], _NOTHING, _NOTHING
    if with_theory and theory and theory.variance_rate and s.size:
        line = np.linspace(s.min(), s.max(), 200)
        values = (line - theory.lyapunov_exponent) ** 2 / (2 * theory.variance_rate)
    return Series(dict(result.parameter_set.varied), s, found.rate_function[known], line, values)


def _over_parameter(case: Case, results: Sequence[SetResult], numbers: FloatArray) -> list[Series]:
    """A number over the parameter: one series for each set of the other parameters that vary."""
    key = case.figure.x
    groups: dict[tuple[tuple[str, Value], ...], list[ParameterSet]] = {}
    for result in results:
        others = tuple((name, value) for name, value in result.parameter_set.varied.items() if name != key)
        groups.setdefault(others, []).append(result.parameter_set)
    shown, found = _with_theory(case, len(groups)), []
    for i, (others, sets) in enumerate(groups.items()):
        x = np.array([each.varied[key] for each in sets], dtype=float)
        line = (np.geomspace if x.min() > 0 else np.linspace)(x.min(), x.max(), 200) if i in shown else _NOTHING
        theory = [_theory(case, case.parameter_set({**dict(others), key: float(each)})) for each in line]
        found.append(Series(dict(others), x, numbers[[each.number - 1 for each in sets]], line, np.array(theory)))
    return found


def _dots(case: Case, simulated: Sequence[SimulatedSet]) -> FloatArray:
    """The same of all simulated parameter sets: x, y and the standard errors of y, shape (3, n)."""
    x, p, found = case.figure.x, case.figure.moment, list[tuple[Value | None, ...]]()
    for each in simulated:
        if x != "p" and p is None:
            found.append((each.parameter_set.varied[x], *each.estimates.get(case.figure.needed, (None, None))))
        else:
            wanted = [one for one in each.result.estimates if p is None or same(one.p, p)]
            found += [
                (one.p if x == "p" else each.parameter_set.varied[x], one.value, one.standard_error) for one in wanted
            ]
    return np.array([each for each in found if None not in each], dtype=float).reshape(-1, 3).T


def _numbers(case: Case, table: Table) -> FloatArray:
    """What a figure over parameters shows of each parameter set; NaN where there is none."""
    found = table[case.figure.needed].values
    if case.figure.moment is None:
        return found
    return found[:, int(np.argmin(abs(case.p - case.figure.moment)))]  # which is among them, but for its last digits


def _theory(case: Case, parameter_set: ParameterSet) -> float:
    if not parameter_set.is_possible:
        return math.nan
    if case.figure.moment is not None:
        return float(perturbed_moments(parameter_set.problem, np.array(case.figure.moment)))
    quantity = SUMMARY_NUMBERS[case.figure.needed]
    value = quantity.theory(parameter_set.problem)
    return value if quantity.interval[0] <= value <= quantity.interval[1] else math.nan


def draw_series(
    axes: Axes, case: Case, series: Sequence[Series], over: Quantity, about: Quantity, dots: FloatArray = _NOTHING
) -> Sequence[ColorType]:
    """Draw a quantity over another one for several curves, and simulated dots; the colours of the curves.

    Args:
        dots: x, y and the standard errors of y, shape (3, n).
    """
    label_axes(axes, *(each.timed(case.units.time).attributes for each in (over, about)))
    axes.axhline(0, **ZERO)
    is_few = len(series) <= MOST_NAMED
    colours = (_draw_few if is_few else _draw_many)(axes, case, series)
    theories = [i for i, item in enumerate(series) if np.isfinite(item.line_y).any()]
    for i in theories:
        look = {"color": colours[i]} if is_few else {"color": "black", "linestyle": "--", "zorder": 3}
        axes.plot(series[i].line_x, series[i].line_y, **look)
    if theories:
        equation = (about.closed_form or MOMENT.closed_form) + ", reduced noise" * case.theory_reduces_noise
        words = f"perturbation, Eq. {equation}" + f", of {len(theories)} parameter sets" * (not is_few)
        axes.plot([], [], color="0.35" if is_few else "black", linestyle="-" if is_few else "--", label=words)
    if dots.size:
        draw_dots(axes, *dots, label="Monte Carlo ± 2 standard errors", marker=".", color="black", zorder=5)
    axes.margins(x=0.03)
    return colours


def _draw_few(axes: Axes, case: Case, series: Sequence[Series]) -> Sequence[ColorType]:
    """A colour and a marker for each curve, named in the legend; the colours."""
    colours = [f"C{i}" for i in range(len(series))]
    join = "none" if case.figure.lines else "-"
    for item, colour, marker in zip(series, colours, cycle(_MARKERS), strict=False):
        look = partial(axes.plot, marker=marker, color=colour, markerfacecolor="none")
        look(*item.path.T, linestyle=join, markevery=max(1, item.x.size // 25))
        look([], [], label=legend(item.varied, case.about))
    words = case.method.name + " (not all marked)" * any(item.x.size >= 50 for item in series)
    axes.plot([], [], color="0.35", linestyle=join, marker="o", markerfacecolor="none", label=words)
    return colours


def _draw_many(axes: Axes, case: Case, series: Sequence[Series]) -> Sequence[ColorType]:
    """Thin lines and a bar of their colours, of which none is too pale on white; the colours."""
    from matplotlib import colormaps, rcParams
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap

    key, values = coloured_by([item.varied for item in series])
    scale, paths = scale_of(values), [item.path for item in series]
    lines = LineCollection(paths, array=values, norm=scale, rasterized=len(series) > MOST_VECTORS)
    lines.set(cmap=ListedColormap(colormaps["viridis"](np.linspace(0, 0.93, 256))))
    thin, colours = 0.6 * rcParams["lines.linewidth"], lines.to_rgba(values)
    axes.add_collection(lines).set_linewidth(thin)
    axes.plot([], [], color="0.35", linewidth=thin, label=case.method.name)
    for path, colour in zip(paths, colours, strict=True):
        known = path[np.isfinite(path[:, 1])]
        if len(known) == 1:
            axes.plot(*known.T, "o", color=colour)
    axes.autoscale_view()
    words = "number of the parameter set" if key is None else label_of(case.about(key).attributes, 36)
    bar = axes.figure.colorbar(lines, ax=axes, pad=0.02, label=words)
    if scale == "log":
        plain_numbers(bar.ax.yaxis)
    return list(colours)


def _mark(axes: Axes, series: Sequence[Series], colours: Sequence[ColorType]) -> None:
    """Stability indices as ticks on the zero line, λ as tangents at 0, in the present ends."""
    from matplotlib import rcParams

    wide = (2.0 if len(series) <= MOST_NAMED else 1.0) * rcParams["lines.linewidth"]
    marks = list(zip(series, colours, strict=True))
    if roots := [(item.root, colour) for item, colour in marks if item.root is not None]:
        x, shown = zip(*roots, strict=True)
        index = axes.scatter(x, [0] * len(x), (5 * wide) ** 2, shown, marker="|", linewidths=wide, zorder=4)
        index.set_label(f"{STABILITY_INDEX.words} {STABILITY_INDEX.latex}")
    ends = _TANGENT * np.ptp(axes.get_xlim()) * np.array([-1.0, 1.0])
    words = f"slope {LYAPUNOV_EXPONENT.latex} at $p = 0$"
    for item, colour in marks:
        if item.slope is not None:
            [line] = axes.plot(ends, item.slope * ends, color=colour, label=words, scalex=False, scaley=False)
            line.set(linewidth=wide, solid_capstyle="butt", zorder=3.5)
            words = "_"


def _draw_map(case: Case, table: Table, keys: tuple[str, str], axes: Axes) -> None:
    """A quantity over two keys in colours around zero, hatched where it is not known, grey where there is none.

    The line of its zeros is dashed between the values.
    """
    from matplotlib.colors import ListedColormap

    setting = case.figure
    (x, column), (y, row) = (
        np.unique(np.array([each[key] for each in case.vary.sets], dtype=float), return_inverse=True) for key in keys
    )
    values, status = np.full((2, y.size, x.size), math.nan)
    values[row, column], status[row, column] = _numbers(case, table), table[STATUS.name].values
    failed = np.isnan(values) & ~np.isin(status, [each for each in Status if not each.fails])
    edges = _edges(x), _edges(y)
    label_axes(axes, *(case.about(key).attributes for key in keys))
    _draw_values(axes, values, edges, setting.quantity.timed(case.units.time).attributes)
    if (values < 0).any() and (values > 0).any():
        axes.contour(x, y, values, levels=[0.0], colors=_BETWEEN, linestyles="--", zorder=3)
        axes.plot([], [], "--", color=_BETWEEN, label="zero, interpolated between the values")
    if failed.any():
        cells = axes.pcolor(*edges, np.ma.masked_where(~failed, failed), cmap=ListedColormap(["white"]))
        cells.set(hatch="/////", edgecolor="0.45", linewidth=0)
        axes.fill([], [], facecolor="white", edgecolor="0.45", hatch="/////", label="failed or not solved")
    if (np.isnan(values) & ~failed).any():
        sought = (
            "" if setting.moment is not None else " from {:g} to {:g}".format(*SUMMARY_NUMBERS[setting.needed].interval)
        )
        axes.set_facecolor("0.8")
        axes.fill([], [], color="0.8", label=f"no {setting.quantity.words}{sought}")
    limits = setting.xlim, setting.ylim
    for axis, each, ends, limit in zip((axes.xaxis, axes.yaxis), (x, y), edges, limits, strict=True):
        scale_axis(axis, scale_of(each), limit or (float(ends[0]), float(ends[-1])))


def _draw_values(
    axes: Axes, values: FloatArray, edges: tuple[FloatArray, FloatArray], about: Mapping[str, str]
) -> None:
    """Blue where it is negative, red where it is positive, told apart by all eyes; colours are alike on both sides.

    There are more of them near zero where most values are much smaller than the largest.
    """
    from matplotlib.colors import AsinhNorm, Normalize
    from matplotlib.ticker import AsinhLocator

    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    limit = float(np.max(sizes, initial=0.0)) or 1.0
    middle = float(np.median(sizes)) if sizes.size else limit
    is_even = limit < 4 * middle
    norm = Normalize(-limit, limit) if is_even else AsinhNorm(middle, -limit, limit)
    bar = draw_colours(axes, *edges, values, about, shading="flat", cmap="RdBu_r", norm=norm)
    if not is_even:
        bar.ax.yaxis.set_major_locator(AsinhLocator(middle, numticks=5))
        bar.ax.yaxis.set_major_formatter("{x:g}")


def _edges(values: FloatArray) -> FloatArray:
    """The edges of cells around values, by their logarithms where they are spread so."""
    is_log = scale_of(values) == "log"
    places = np.log(values) if is_log else values
    middles = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
    return np.exp(edges) if is_log else edges
