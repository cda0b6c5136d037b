"""What the figures of a case show: solved curves beside perturbation theory and simulated ones; maps; responses.

Up to `MOST_NAMED` curves have a marker each, and a name in the legend. More are thin lines, whose colours tell the
value of a key.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import MOST_NAMED, Value, Varied, same
from fpsolve.case.vary import legend, map_key
from fpsolve.data import Quantity
from fpsolve.drawing import (
    COLOURS,
    FORMATS,
    draw_colours,
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
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.model.quantity import GROWTH, MOMENT, RATE_FUNCTION, STATUS, P
from fpsolve.results.table import Table
from fpsolve.solve.curve import CurveResult, SimulatedCurve, Status
from fpsolve.tell.blocks import Drawing
from fpsolve.theory import perturbation
from fpsolve.theory.perturbation import perturbed_moments

MOST_VECTORS = 1000
"""Curves up to which a PDF holds each as a line, not all as a picture."""
_MARKERS = "osD^v<"  # one fewer than colours, so that both repeat together after 42 curves only
_TANGENT = 0.2
"""Length of a tangent, as a share of the width of the axes."""
_GREY: dict[str, Any] = {"color": "0.35"}
"""Of what the legend says of all curves."""
STYLES = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
"""Of lines, for up to so many combinations of keys."""
_BETWEEN = "#00C800"
"""Of the line of zeros between values."""
Pair = tuple[CurveResult, SimulatedCurve | None]
_NOTHING = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Series:
    """One curve of a figure: finite elements at (x, y), a line of perturbation theory through (line_x, line_y).

    Attributes:
        varied: the parameters that tell it from the others.
        simulated: x, y and the standard errors of y from a simulation, shape (3, n).
        root: the stability index, which is marked on the zero line; None where there is none among the x.
        slope: λ, which is marked as the tangent at 0; None where it is not.
    """

    varied: Varied
    x: FloatArray
    y: FloatArray
    line_x: FloatArray
    line_y: FloatArray
    simulated: FloatArray | None = None
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
        kinds: for each curve what its line style tells; the same everywhere where it tells nothing.
        untold: the other keys, each with how many values it has.
    """

    key: str | None
    colours: FloatArray
    kinds: Sequence[Varied]
    untold: Mapping[str, int]

    @classmethod
    def of(cls, varied: Sequence[Varied]) -> Encoding:
        """Of the parameters of some curves: a colour for the key with the most values, line styles for a few sets."""
        counts = {name: len({each[name] for each in varied}) for name in varied[0]}
        texts = [name for name in counts if isinstance(varied[0][name], str)]
        others = [name for name in counts if name not in texts]
        key = max(others, key=lambda name: counts[name], default=None)
        sets = len({tuple(each[name] for name in others) for each in varied})
        if key and counts[key] == sets > 1:  # it tells the curve
            others = []
        elif key and math.prod(counts[name] for name in others) == sets > 1:
            others.remove(key)
        else:  # none varies, or values side by side, none of which tells the curve
            key, others = None, []
        names = [name for name in (*others, *texts) if counts[name] > 1]
        kinds = [{name: each[name] for name in names} for each in varied]
        is_told = len({tuple(each.values()) for each in kinds}) <= len(STYLES)
        return cls(
            key,
            np.array([each[key] for each in varied], dtype=float) if key else np.arange(1.0, len(varied) + 1),
            kinds if is_told else [{}] * len(varied),
            {} if is_told else {name: counts[name] for name in names},
        )


def main_figure(
    case: Case,
    results: Sequence[CurveResult],
    simulated: Sequence[SimulatedCurve],
    table: Table,
) -> Drawing:
    """figure.png and .pdf: finite elements, perturbation theory, dots of a simulation.

    Over two keys with many values it is a map. There is none with `[output] figure = false`, and without a [figure]
    none of a case that does not ask for Λ(p).

    Args:
        table: the numbers of all curves.
    """
    over = "p" if case.figure.x == "p" else case.about(case.figure.x).words
    title = f"The {case.figure.quantity.words}, {case.figure.quantity.symbol}, over {over}"
    setting = case.figure
    curves = partial(_draw_curves, case, results, simulated, table)
    other = map_key(setting, case.vary)
    draw = partial(_draw_map, case, table, (setting.x, other)) if other else curves
    return Drawing(title, partial(_draw, case, results, setting.needed, draw), "figure", case.caption)


def _draw(
    case: Case,
    results: Sequence[CurveResult],
    needed: str,
    draw: Callable[[Any], None],
    paths: Sequence[Path],
    heading: str,
) -> None:
    """A figure of all curves, if there are any and the case asks for it and for the quantity that it needs."""
    if case.output.figure and needed in case.asked and results:
        held = results[0].curve.held(case.units.time, case.vary.keys)
        with figure_for(paths, heading, held, FORMATS[case.figure.width]) as figure:
            draw(figure.add_subplot())


def _draw_curves(
    case: Case, results: Sequence[CurveResult], simulated: Sequence[SimulatedCurve], table: Table, axes: Any
) -> None:
    setting, samples = case.figure, {each.curve.number: each for each in simulated}
    pairs = [(result, samples.get(result.curve.number)) for result in results]
    if setting.x == "p":
        shown = _some(len(pairs))
        series = [_moment_series(case, *pair, with_theory=i in shown) for i, pair in enumerate(pairs)]
    else:
        series = _over_parameter(case, pairs, _numbers(case, table))
    over = P if setting.x == "p" else case.about(setting.x)
    colours = draw_series(axes, case, series, over, setting.quantity)
    places = np.concatenate([item.x for item in series])
    is_short = setting.x == "p" and places.size and places.max() < 10 * places.min()
    scale_axis(axes.xaxis, "linear" if is_short else scale_of(places), setting.xlim)
    scale_axis(axes.yaxis, "linear", setting.ylim)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    _mark(axes, series, colours)


def rate_figure(case: Case, results: Sequence[CurveResult]) -> Drawing:
    """rate_function.png and .pdf, if the case asks for it."""
    title = f"The {RATE_FUNCTION.words}, {RATE_FUNCTION.symbol}"
    draw = partial(_draw, case, results, RATE_FUNCTION.name, partial(_draw_rates, case, results))
    return Drawing(title, draw, "rate_function", case.headline)


def _draw_rates(case: Case, results: Sequence[CurveResult], axes: Any) -> None:
    """I(s) at s = Λ′(p) of every p, 0 at s = λ."""
    shown = _some(len(results))
    series = [_rates(result, with_theory=i in shown) for i, result in enumerate(results)]
    draw_series(axes, case, series, GROWTH, RATE_FUNCTION)
    axes.ticklabel_format(style="sci", scilimits=(-2, 3), useMathText=True)


def _some(count: int) -> set[int]:
    """Places of curves with perturbation theory: all of few, or of many three."""
    return set(range(count)) if count <= MOST_NAMED else {0, count // 2, count - 1}


def _moment_series(case: Case, result: CurveResult, sample: SimulatedCurve | None, *, with_theory: bool) -> Series:
    p = result.moments.p
    first, last = (float(p.min()), float(p.max())) if p.size else (math.nan, math.nan)
    line = np.linspace(first, last, 200) if with_theory and p.size else _NOTHING
    estimates = sample.result.estimates if sample else ()
    root, slope = (
        found.value if each.name in case.figure.mark and (found := result.estimates[each.name]) else None
        for each in (STABILITY_INDEX, LYAPUNOV_EXPONENT)
    )
    return Series(
        dict(result.curve.varied),
        p,
        result.moments.value,
        line,
        perturbed_moments(result.curve.problem, line) if line.size else line,
        _columns([(each.p, each.value, each.standard_error) for each in estimates if each.value is not None]),
        root=root if root is not None and first <= root <= last else None,
        slope=slope if first <= 0 <= last else None,
    )


def _rates(result: CurveResult, *, with_theory: bool) -> Series:
    """I over s, beside the parabola (s − λ)²/2Λ″(0) of perturbation theory."""
    found = result.moments
    theory = perturbation.second_order_or_none(result.curve.problem) if found.p.size else None
    known = np.isfinite(found.derivative)
    s, line, values = found.derivative[known], _NOTHING, _NOTHING
    if with_theory and theory and theory.variance_rate and s.size:
        line = np.linspace(s.min(), s.max(), 200)
        values = (line - theory.lyapunov_exponent) ** 2 / (2 * theory.variance_rate)
    return Series(dict(result.curve.varied), s, found.rate_function[known], line, values)


def _over_parameter(case: Case, pairs: Sequence[Pair], numbers: FloatArray) -> list[Series]:
    """A number over the parameter: one series for each set of the other parameters that vary."""
    key = case.figure.x
    groups: dict[tuple[tuple[str, Value], ...], list[Pair]] = {}
    for pair in pairs:
        others = tuple((name, value) for name, value in pair[0].curve.varied.items() if name != key)
        groups.setdefault(others, []).append(pair)
    shown, found = _some(len(groups)), []
    for i, (others, group) in enumerate(groups.items()):
        x = np.array([float(result.curve.varied[key]) for result, _ in group])
        line = (np.geomspace if x.min() > 0 else np.linspace)(x.min(), x.max(), 200) if i in shown else _NOTHING
        dots = [(at, _simulated(case, sample)) for at, (_, sample) in zip(x, group, strict=True) if sample]
        found.append(
            Series(
                dict(others),
                x,
                numbers[[result.curve.number - 1 for result, _ in group]],
                line,
                np.array([_theory(case, case.curve({**dict(others), key: float(each)})) for each in line]),
                _columns([(at, *dot) for at, dot in dots if dot]),
            )
        )
    return found


def _numbers(case: Case, table: Table) -> FloatArray:
    """What a figure over parameters shows of each curve; NaN where there is none."""
    found = table[case.figure.needed].values
    if case.figure.moment is None:
        return found
    return found[:, int(np.argmin(abs(case.p - case.figure.moment)))]  # which is among them, but for its last digits


def _theory(case: Case, curve: Curve) -> float:
    if not curve.is_possible:
        return math.nan
    if case.figure.moment is not None:
        return float(perturbed_moments(curve.problem, np.array(case.figure.moment)))
    index = INDICES[case.figure.needed]
    value = index.theory(curve.problem)
    return value if index.interval[0] <= value <= index.interval[1] else math.nan


def _simulated(case: Case, sample: SimulatedCurve) -> tuple[float, float] | None:
    """The same from a simulation, with its standard error."""
    p = case.figure.moment
    if p is None:
        return sample.estimates.get(case.figure.needed)
    found = [each for each in sample.result.estimates if same(each.p, p)]
    return next(
        ((e.value, e.standard_error) for e in found if e.value is not None and e.standard_error is not None), None
    )


def _columns(dots: Sequence[tuple[float | None, ...]]) -> FloatArray | None:
    return np.array(dots, dtype=float).T if dots else None


def draw_series(axes: Any, case: Case, series: Sequence[Series], over: Quantity, about: Quantity) -> Sequence[Any]:
    """Draw a quantity over another one for several curves; the colours of these."""
    is_few = len(series) <= MOST_NAMED
    label_axes(axes, *(each.timed(case.units.time).attributes for each in (over, about)))
    mark_zero(axes)
    equation = (about.closed_form or MOMENT.closed_form) + ", reduced noise" * case.theory_reduces_noise
    colours = (_draw_few if is_few else _draw_many)(axes, case, series, equation)
    if simulated := [item.simulated for item in series if item.simulated is not None]:
        style: dict[str, Any] = {"marker": ".", "color": "black", "markeredgewidth": points(1), "zorder": 5}
        style |= {"markersize": points(5 if is_few else 3), "elinewidth": points(1), "capsize": points(3 * is_few)}
        draw_dots(axes, *np.concatenate(simulated, axis=1), label="Monte Carlo ± 2 standard errors", **style)
    axes.margins(x=0.03)
    return colours


def _draw_few(axes: Any, case: Case, series: Sequence[Series], equation: str) -> Sequence[Any]:
    """A colour and a marker for each curve, named in the legend; the colours."""
    colours = [COLOURS[i % len(COLOURS)] for i in range(len(series))]
    for i, (item, colour) in enumerate(zip(series, colours, strict=True)):
        look = {"marker": _MARKERS[i % len(_MARKERS)], "color": colour, "markerfacecolor": "none"}
        axes.plot(item.line_x, item.line_y, color=colour)
        axes.plot(item.x, item.y, linestyle="none", markevery=item.every, **look)
        axes.plot([], [], label=legend(item.varied, case.about), **look)
    words = case.method.name + " (not all marked)" * any(item.every > 1 for item in series)
    axes.plot([], [], "o", markerfacecolor="none", label=words, **_GREY)
    if any(np.any(np.isfinite(item.line_y)) for item in series):
        axes.plot([], [], "-", label=f"perturbation, Eq. {equation}", **_GREY)
    return colours


def _draw_many(axes: Any, case: Case, series: Sequence[Series], equation: str) -> Any:
    """Thin lines and a bar of their colours, of which none is too pale on white; the colours, shape (n, 4)."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    encoding = Encoding.of([item.varied for item in series])
    values, is_log = encoding.colours, scale_of(encoding.colours) == "log"
    dark = ListedColormap(colormaps["viridis"](np.linspace(0, 0.93, 256)))
    scale = ScalarMappable((LogNorm if is_log else Normalize)(float(values.min()), float(values.max())), dark)
    colours, look = scale.to_rgba(values), {"rasterized": len(series) > MOST_VECTORS, "linewidths": points(1)}
    paths = [np.stack([item.x, item.y], axis=1)[np.argsort(item.x, kind="stable")] for item in series]
    untold = "".join(f", each for {count} values of {case.about(key).shown}" for key, count in encoding.untold.items())
    kinds = list({tuple(each.values()): each for each in encoding.kinds}.values())
    for kind, line in zip(kinds, STYLES, strict=False):
        chosen = [i for i, each in enumerate(encoding.kinds) if each == kind]
        lines = LineCollection([paths[i] for i in chosen], colors=colours[chosen], linestyles=[line], **look)
        axes.add_collection(lines, autolim=True)
        name = f", {legend(kind, case.about)}" if kind else ""
        axes.plot([], [], linestyle=line, label=f"finite elements{name}{untold}", **_GREY)

    # dots: curves that have but one point
    dots = [(*path[np.isfinite(path[:, 1])][0], colour)
            for path, colour in zip(paths, colours, strict=True) if np.isfinite(path[:, 1]).sum() == 1]  # fmt: skip
    if dots:
        x, y, shades = zip(*dots, strict=True)
        axes.scatter(x, y, s=points(4) ** 2, color=shades)

    theories = [item for item in series if item.line_x.size]
    label = f"perturbation, Eq. {equation}, of {len(theories)} curves"
    for place, item in enumerate(theories):
        style = {"linestyle": (0, (2, 2)), "color": "black", "linewidth": points(1.2), "zorder": 3}
        axes.plot(item.line_x, item.line_y, label="" if place else label, **style)

    axes.autoscale_view()
    words = "number of the curve" if encoding.key is None else label_of(case.about(encoding.key).attributes, 36)
    bar = axes.figure.colorbar(scale, ax=axes, pad=0.02, label=words)
    if is_log:
        plain_numbers(bar.ax.yaxis)
    return colours


def _mark(axes: Any, series: Sequence[Series], colours: Any) -> None:
    """Stability indices as ticks on the zero line, λ as tangents at 0, in the present ends."""
    from matplotlib.collections import LineCollection

    is_few, rasterized = len(series) <= MOST_NAMED, len(series) > MOST_VECTORS
    roots = [i for i, item in enumerate(series) if item.root is not None]
    if roots:
        where, shown = [series[i].root for i in roots], [colours[i] for i in roots]
        style = {"marker": "|", "linewidths": points(2.2 if is_few else 1.2), "zorder": 4, "rasterized": rasterized}
        words = f"{STABILITY_INDEX.words} {STABILITY_INDEX.latex}"
        axes.scatter(where, np.zeros(len(roots)), s=points(16 if is_few else 8) ** 2, color=shown, label=words, **style)
    chosen = [i for i, item in enumerate(series) if item.slope is not None]
    if chosen:
        left, right = axes.get_xlim()
        axes.set(xlim=(left, right), ylim=axes.get_ylim())
        ends = 0.5 * _TANGENT * (right - left) * np.array([-1.0, 1.0])
        lines = [np.stack([ends, series[i].slope * ends], axis=1) for i in chosen]
        look: dict[str, Any] = {"linewidths": points(3 if is_few else 1), "capstyle": "butt", "zorder": 3.5}
        look |= {"colors": [colours[i] for i in chosen], "label": f"slope {LYAPUNOV_EXPONENT.latex} at $p = 0$"}
        axes.add_collection(LineCollection(lines, rasterized=rasterized, **look), autolim=False)


def _draw_map(case: Case, table: Table, keys: tuple[str, str], axes: Any) -> None:
    """A quantity over two keys in colours around zero, hatched where it is not known, grey where there is none.

    The line of its zeros is dashed between the values.
    """
    from matplotlib import patches, path

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
    limits = setting.xlim, setting.ylim
    for axis, each, ends, limit in zip((axes.xaxis, axes.yaxis), (x, y), edges, limits, strict=True):
        scale_axis(axis, scale_of(each), limit or (float(ends[0]), float(ends[-1])))
    finite = values[np.isfinite(values)]
    if finite.size and finite.min() < 0 < finite.max():
        look: dict[str, Any] = {"linestyles": "--", "linewidths": points(1.5), "zorder": 3}
        axes.contour(x, y, np.ma.masked_invalid(values), levels=[0.0], colors=_BETWEEN, **look)
        axes.plot([], [], "--", color=_BETWEEN, label="zero, interpolated between the values")
    sought = "" if setting.moment is not None else " from {:g} to {:g}".format(*INDICES[setting.needed].interval)
    unsolved: dict[str, Any] = {"facecolor": "white", "edgecolor": "0.45", "hatch": "/////"}
    for where, style, label in (
        (failed, unsolved, "failed or not solved"),
        (np.isnan(values) & ~failed, {"facecolor": "0.8"}, f"no {setting.quantity.words}{sought}"),
    ):
        (i, j), (left, low) = np.nonzero(where), edges
        if i.size:
            corners = np.array([(left[j + k], low[i + m]) for k, m in ((0, 0), (1, 0), (1, 1), (0, 1))])
            cells = path.Path.make_compound_path_from_polys(np.moveaxis(corners, 2, 0))
            axes.add_patch(patches.PathPatch(cells, linewidth=0, label=label, **style))


def _draw_values(axes: Any, values: FloatArray, edges: tuple[FloatArray, FloatArray], about: Mapping[str, Any]) -> None:
    """Blue where it is negative, red where it is positive, told apart by all eyes; colours are alike on both sides.

    There are more of them near zero where most values are much smaller than the largest.
    """
    from matplotlib.colors import AsinhNorm, Normalize
    from matplotlib.ticker import AsinhLocator

    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    limit = float(np.max(sizes, initial=0.0)) or 1.0
    middle = float(np.median(sizes)) if sizes.size else limit
    is_even = limit < 4 * middle
    look: dict[str, Any] = {
        "cmap": "RdBu_r",
        "norm": Normalize(-limit, limit) if is_even else AsinhNorm(middle, -limit, limit),
    }
    bar = draw_colours(axes, *edges, np.ma.masked_invalid(values), about, shading="flat", **look)
    if is_even:
        bar.formatter.set_powerlimits((-2, 3))
        bar.formatter.set_useMathText(True)
    else:
        bar.ax.yaxis.set_major_locator(AsinhLocator(middle, numticks=5))
        bar.ax.yaxis.set_major_formatter("{x:g}")


def _edges(values: FloatArray) -> FloatArray:
    """The edges of cells around values, by their logarithms where they are spread so."""
    is_log = scale_of(values) == "log"
    places = np.log(values) if is_log else values
    middles = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
    return np.exp(edges) if is_log else edges
