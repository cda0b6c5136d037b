"""What the figures of a case show: solved curves beside perturbation theory and simulated ones; maps; responses.

Up to `MOST_NAMED` curves have a marker each, and a name in the legend. More are thin lines, whose colours tell the
value of a key.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import MOST_NAMED, Value, Varied, same
from fpsolve.case.vary import legend, map_key
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
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.model.quantity import (
    GROWTH,
    MOMENT,
    RATE_FUNCTION,
    STATUS,
    P,
)
from fpsolve.page.page import Drawing
from fpsolve.results.curve import CurveResult, SimulatedCurve, Status
from fpsolve.results.table import Table
from fpsolve.theory import perturbation
from fpsolve.theory.perturbation import perturbed_moments

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
    line_x: FloatArray = field(default_factory=lambda: np.zeros(0))
    line_y: FloatArray = field(default_factory=lambda: np.zeros(0))
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
    return Drawing(title, partial(_draw, case, results, simulated, table), "figure", case.caption)


def _draw(
    case: Case,
    results: Sequence[CurveResult],
    simulated: Sequence[SimulatedCurve],
    table: Table,
    paths: Sequence[Path],
    heading: str,
) -> None:
    setting = case.figure
    if not case.output.figure or setting.needed not in case.asked or not results:
        return
    held = results[0].curve.held(case.units.time, case.vary.keys)
    with figure_for(paths, heading, held, FORMATS[setting.width]) as figure:
        axes = figure.add_subplot()
        if other := map_key(setting, case.vary):
            _draw_map(axes, case, table, (setting.x, other))
            return
        samples = {each.curve.key: each for each in simulated}
        pairs = [(result, samples.get(result.curve.key)) for result in results]
        if setting.x == "p":
            shown = _some(len(pairs))
            series = [_moment_series(case, *pair, with_theory=i in shown) for i, pair in enumerate(pairs)]
        else:
            series = _over_parameter(case, pairs, _numbers(case, table))
        draw_series(axes, case, series, setting.quantity.closed_form + ", reduced noise" * case.theory_reduces_noise)


def rate_figure(case: Case, results: Sequence[CurveResult]) -> Drawing:
    """rate_function.png and .pdf, if the case asks for it."""
    title = f"The {RATE_FUNCTION.words}, {RATE_FUNCTION.symbol}"
    return Drawing(title, partial(_draw_rates, case, results), "rate_function", case.headline)


def _draw_rates(case: Case, results: Sequence[CurveResult], paths: Sequence[Path], heading: str) -> None:
    """I(s) at s = Λ′(p) of every p, 0 at s = λ."""
    if RATE_FUNCTION.name not in case.asked or not case.output.figure or not results:
        return
    held, is_few = results[0].curve.held(case.units.time, case.vary.keys), len(results) <= MOST_NAMED
    shown = _some(len(results))
    series = [_rates(result, with_theory=i in shown) for i, result in enumerate(results)]
    form = FORMATS[case.figure.width]
    with figure_for(paths, heading, held, form) as figure:
        axes = figure.add_subplot()
        label_axes(axes, *(each.timed(case.units.time).attributes for each in (GROWTH, RATE_FUNCTION)))
        mark_zero(axes)
        (_draw_few if is_few else _draw_many)(
            axes, case, series, MOMENT.closed_form + ", reduced noise" * case.theory_reduces_noise
        )
        axes.margins(x=0.03)
        axes.ticklabel_format(style="sci", scilimits=(-2, 3), useMathText=True)


def _some(count: int) -> set[int]:
    """Places of curves with perturbation theory: all that a legend can name, or of more some, evenly spread."""
    places = np.linspace(0, count - 1, count if count <= MOST_NAMED else 3 * MOST_NAMED)
    return set(places.round().astype(int).tolist())


def _moment_series(case: Case, result: CurveResult, sample: SimulatedCurve | None, *, with_theory: bool) -> Series:
    p = result.moments.p
    first, last = (float(p.min()), float(p.max())) if p.size else (math.nan, math.nan)
    line = np.linspace(first, last, 200) if with_theory and p.size else _NOTHING
    estimates = sample.result.estimates if sample else ()
    root, slope = (
        _value(result.estimates[each.name]) if each.name in case.figure.mark else None
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
        others = tuple((name, value) for name, value in pair[0].curve.key if name != key)
        groups.setdefault(others, []).append(pair)
    shown, found = _some(len(groups)), []
    for i, (others, group) in enumerate(groups.items()):
        x = np.array([float(result.curve.varied[key]) for result, _ in group])
        line = np.linspace(x.min(), x.max(), 100) if i in shown else _NOTHING
        if line.size and x.min() > 0:
            line = np.unique(np.concatenate([line, np.geomspace(x.min(), x.max(), 100)]))
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


def _value(estimate: Estimate | None) -> float | None:
    return None if estimate is None else estimate.value


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


def draw_series(axes: Any, case: Case, series: Sequence[Series], equation: str) -> None:
    """Draw what [figure] says over its x for several curves; the lines are of perturbation theory, by an equation."""
    setting, is_few = case.figure, len(series) <= MOST_NAMED
    over = P if setting.x == "p" else case.about(setting.x)
    label_axes(axes, over.attributes, setting.quantity.timed(case.units.time).attributes)
    mark_zero(axes)
    colours = (_draw_few if is_few else _draw_many)(axes, case, series, equation)
    if simulated := [item.simulated for item in series if item.simulated is not None]:
        size, line, cap = (5, 1.1, 4) if is_few else (3, 0.8, 0)
        style: dict[str, Any] = {"marker": ".", "color": "black", "markeredgewidth": points(1), "zorder": 5}
        style |= {"markersize": points(size), "elinewidth": points(line), "capsize": points(cap)}
        draw_dots(axes, *np.concatenate(simulated, axis=1), label="Monte Carlo ± 2 standard errors", **style)
    axes.margins(x=0.03)
    places = np.concatenate([item.x for item in series])
    is_short = setting.x == "p" and places.size and places.max() < 10 * places.min()
    scale_axis(axes.xaxis, "linear" if is_short else scale_of(places), setting.xlim)
    scale_axis(axes.yaxis, "linear", setting.ylim)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    _mark(axes, series, colours)


def _draw_few(axes: Any, case: Case, series: Sequence[Series], equation: str) -> Sequence[Any]:
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
        axes.plot([], [], linestyle=line, label=legend(item.varied, case.about), **hollow)
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
    others = "".join(f", each for {count} values of {case.about(key).shown}" for key, count in encoding.unencoded)
    kinds = dict.fromkeys(encoding.styles)
    for kind, line in zip(kinds, STYLES, strict=False):
        chosen = [i for i, each in enumerate(encoding.styles) if each == kind]
        lines = LineCollection([paths[i] for i in chosen], colors=colours[chosen], linestyles=[line], **look)
        axes.add_collection(lines, autolim=True)
        name = f", {legend(dict(kind), case.about)}" if len(kinds) > 1 else ""
        axes.plot([], [], linestyle=line, label=f"finite elements{name}{others}", **_GREY)

    # dots: curves that have but one point
    known = [np.isfinite(item.y) for item in series]
    dots = [(i, at) for i, at in enumerate(known) if at.sum() == 1]
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
        bar.set_label(label_of(case.about(encoding.key).attributes, 36))
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
        sizes = points(high) * (np.linspace(2.0, 1.0, len(roots)) if is_few else 1.0)  # to see those behind
        axes.scatter(where, np.zeros(len(roots)), s=sizes**2, color=shown, **style)
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


def _draw_map(axes: Any, case: Case, table: Table, keys: tuple[str, str]) -> None:
    """A quantity over two keys in colours around zero, hatched where it is not known, grey where there is none.

    The line of its zeros is dashed between the values.
    """
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    setting = case.figure
    x, y = (np.array(case.vary.values(key), dtype=float) for key in keys)
    is_x_first = case.vary.keys.index(keys[0]) < case.vary.keys.index(keys[1])
    shape, order = ((x.size, y.size) if is_x_first else (y.size, x.size)), np.ix_(np.argsort(y), np.argsort(x))
    values, status = (
        (each.reshape(shape).T if is_x_first else each.reshape(shape))[order]
        for each in (_numbers(case, table), table[STATUS.name].values)
    )
    x, y = np.sort(x), np.sort(y)
    failed = np.isnan(values) & ~np.isin(status, [each for each in Status if not each.fails])
    edges = _edges(x), _edges(y)
    label_axes(axes, *(case.about(key).attributes for key in keys))
    _draw_values(axes, values, edges, setting.quantity.timed(case.units.time).attributes)
    limits = setting.xlim, setting.ylim
    for axis, each, ends, limit in zip((axes.xaxis, axes.yaxis), (x, y), edges, limits, strict=True):
        scale_axis(axis, scale_of(each), limit or (float(ends[0]), float(ends[-1])))
    sought = "" if setting.moment is not None else " from {:g} to {:g}".format(*INDICES[setting.needed].interval)
    unsolved: dict[str, Any] = {"facecolor": "white", "edgecolor": "0.45", "hatch": "/////"}
    absent: dict[str, Any] = {"facecolor": "0.8", "edgecolor": "none"}
    for where, style, label in (
        (failed, unsolved, "failed or not solved"),
        (np.isnan(values) & ~failed, absent, f"no {setting.quantity.words}{sought}"),
    ):
        (left, low), (width, height) = edges, map(np.diff, edges)
        cells = [Rectangle((left[j], low[i]), width[j], height[i]) for i, j in np.argwhere(where)]
        if cells:
            axes.add_collection(PatchCollection(cells, linewidth=0, label=label, **style))
    finite = values[np.isfinite(values)]
    if finite.size and finite.min() < 0 < finite.max():
        wide = points(1.5)
        look: dict[str, Any] = {"colors": _BETWEEN, "linestyles": "--", "linewidths": wide, "zorder": 3}
        axes.contour(x, y, np.ma.masked_invalid(values), levels=[0.0], **look)
        axes.plot([], [], "--", color=_BETWEEN, linewidth=wide, label="zero, interpolated between the values")


def _draw_values(axes: Any, values: FloatArray, edges: tuple[FloatArray, FloatArray], about: Mapping[str, Any]) -> None:
    """Blue where it is negative, red where it is positive, told apart by all eyes; colours are alike on both sides.

    There are more of them near zero where most values are much smaller than the largest; then numbers beside the
    colour bar are powers of ten, with room between them.
    """
    from matplotlib.colors import AsinhNorm, Normalize
    from matplotlib.ticker import FixedLocator, StrMethodFormatter

    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    limit = float(np.max(sizes, initial=0.0)) or 1.0
    middle = float(np.median(sizes)) if sizes.size else limit
    is_even = limit < 4 * middle
    norm = Normalize(-limit, limit) if is_even else AsinhNorm(middle, -limit, limit)
    shown = np.ma.masked_invalid(values)
    bar = draw_colours(axes, *edges, shown, about, cmap="RdBu_r", norm=norm, shading="flat")
    if is_even:
        bar.formatter.set_powerlimits((-2, 3))
        bar.formatter.set_useMathText(True)
        return
    chosen = [0.0]
    for decade in range(math.ceil(math.log10(limit)) - 8, math.floor(math.log10(limit)) + 1):
        if norm(10.0**decade) - norm(chosen[-1]) >= (0.06 if points(1) > 0.8 else 0.08):
            chosen.append(10.0**decade)
    chosen = chosen if len(chosen) > 1 else [0.0, float(f"{0.8 * limit:.0e}")]
    bar.ax.yaxis.set_major_locator(FixedLocator([*(-value for value in chosen[:0:-1]), *chosen]))
    bar.ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _edges(values: FloatArray) -> FloatArray:
    """The edges of cells around values, by their logarithms where they are spread so."""
    is_log = scale_of(values) == "log"
    places = np.log(values) if is_log else values
    middles = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
    return np.exp(edges) if is_log else edges
