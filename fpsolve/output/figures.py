"""What the figures of a case show: solved curves beside perturbation theory and simulated ones; maps; responses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from fpsolve.analysis.zero import Zero
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.figure import MOST_NAMED, map_key
from fpsolve.case.sections import Value, same
from fpsolve.drawing import Format, draw_bars, figure_for
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.model.problem import Problem
from fpsolve.output.charts import held_in_words, read_line
from fpsolve.output.curves import Series, write_figure
from fpsolve.output.maps import Plane, write_map
from fpsolve.simulation.response import Response
from fpsolve.study.results import CurveResult, SimulatedCurve
from fpsolve.theory.perturbation import perturbed_moments, scale_of

Pair = tuple[CurveResult, SimulatedCurve | None]
_NOTHING = np.zeros(0)


def draw(case: Case, results: Sequence[CurveResult], simulated: Sequence[SimulatedCurve], folder: Path) -> None:
    """Draw figure.png and figure.pdf: finite elements, perturbation theory, and what is simulated as dots.

    Over two keys with many values it is a map. Without a [figure] there is none of a case that does not ask for Λ(p).
    """
    setting = case.figure
    if setting.needed not in case.output.quantities or not results:
        return
    paths = _paths(folder, "figure")
    held = held_in_words(results[0].curve, case.vary.keys, setting.time_unit)
    if other := map_key(setting, case.vary):
        plane = _plane(case, results, (setting.x, other), folder)
        write_map(plane, setting.quantity, case.caption, paths, parameters=held, setting=setting, about=case.about)
        return
    samples = {each.curve.key: each for each in simulated}
    pairs = [(result, samples.get(result.curve.key)) for result in results]
    if setting.x == "p":
        shown = _some(len(pairs))
        series = [_moment_series(case, *pair, with_theory=i in shown) for i, pair in enumerate(pairs)]
    else:
        series = _over_parameter(case, pairs)
    is_exact = any(result.curve.is_exact for result in results)
    write_figure(
        series, setting.x, setting.quantity, case.caption, paths,
        parameters=held, setting=setting, about=case.about, is_reduced=is_exact,
    )  # fmt: skip


def draw_sensitivities(case: Case, results: Iterable[CurveResult], folder: Path) -> None:
    """Draw sensitivities.png and .pdf of every curve, if the case says so: θ ∂/∂θ of λ and of some Λ(p), scaled."""
    for result in results if case.output.sensitivities else ():
        found = result.sensitivities
        if found is None:
            continue
        scale, bars = scale_of(result.curve.problem), dict[str, list[float]]()
        for label, (p, slopes) in found.shown().items():
            size = float(scale.moment(p)) if p else scale.linear
            bars[label] = [found.theta[key] * slopes[key].value / size for key in slopes]
        held = held_in_words(result.curve, (), case.figure.time_unit)
        with figure_for(_paths(folder, f"sensitivities{result.curve.suffix}"), case.headline, held) as figure:
            words = r"effect of a relative change, $\theta\,\partial/\partial\theta$, over the scale"
            draw_bars(figure.add_subplot(xlabel=words), bars, [case.about(key).latex or key for key in found.theta])


def draw_response(case: Case, simulated: SimulatedCurve, folder: Path) -> None:
    """Draw response.png and response.pdf of a curve, if it has a response."""
    if simulated.response is not None:
        held = held_in_words(simulated.curve, (), "time")
        paths = _paths(folder, f"response{simulated.curve.suffix}")
        write_response_figure(simulated.response, case.headline, paths, held)


def write_response_figure(
    response: Response, title: str, paths: Sequence[Path], parameters: Sequence[str] = ()
) -> None:
    """Draw the stationary response: the joint density of x and ẋ, and the density of the amplitude with its errors."""
    with figure_for(paths, title, parameters, Format(width=10.5)) as figure:
        plane, radial = figure.subplots(1, 2)
        response.plot(plane)
        figure.get_layout_engine().set(wspace=0.1)
        response.plot_amplitude(radial)


def _paths(folder: Path, name: str) -> list[Path]:
    return [folder / f"{name}.{ending}" for ending in ("png", "pdf")]


def _some(count: int) -> set[int]:
    """Places of curves with perturbation theory: all that a legend can name, or of more some, evenly spread."""
    places = np.linspace(0, count - 1, count if count <= MOST_NAMED else 3 * MOST_NAMED)
    return set(places.round().astype(int).tolist())


def _moment_series(case: Case, result: CurveResult, sample: SimulatedCurve | None, *, with_theory: bool) -> Series:
    """Λ(p) of a curve over p."""
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
        perturbed_moments(result.curve.problem, line),
        _columns([(each.p, each.value, each.standard_error) for each in estimates if each.value is not None]),
        np.isin(p, result.moments.rare) if result.moments.rare.size else False,
        root=root if root is not None and first <= root <= last else None,
        slope=slope if first <= 0 <= last else None,
    )


def _over_parameter(case: Case, pairs: Sequence[Pair]) -> list[Series]:
    """A number over the parameter: one series for each set of the other parameters that vary."""
    key, p = case.figure.x, case.figure.moment
    groups: dict[tuple[tuple[str, Value], ...], list[Pair]] = {}
    for pair in pairs:
        others = tuple((name, value) for name, value in pair[0].curve.key if name != key)
        groups.setdefault(others, []).append(pair)
    shown, found = _some(len(groups)), []
    for i, (others, group) in enumerate(groups.items()):
        x = np.array([float(result.curve.varied[key]) for result, _ in group])
        line = np.linspace(x.min(), x.max(), 200) if i in shown else _NOTHING
        if line.size and x.min() > 0:
            line = np.unique(np.concatenate([line, np.geomspace(x.min(), x.max(), 200)]))
        dots = [(at, _simulated(case, sample)) for at, (_, sample) in zip(x, group, strict=True) if sample]
        found.append(
            Series(
                dict(others),
                x,
                np.array([_number(case, result) for result, _ in group]),
                line,
                np.array([_theory(case, case.curve({**dict(others), key: float(each)}).problem) for each in line]),
                _columns([(at, *dot) for at, dot in dots if dot]),
                np.array([p in result.moments.rare for result, _ in group]),
            )
        )
    return found


def _value(estimate: Estimate | None) -> float | None:
    return None if estimate is None else estimate.value


def _number(case: Case, result: CurveResult) -> float:
    """What a figure over parameters shows of a curve; NaN where there is none."""
    if case.figure.moment is None:
        found = _value(result.estimates[case.figure.needed])
        return math.nan if found is None else found
    at = np.flatnonzero(np.isclose(result.moments.p, case.figure.moment, rtol=0, atol=1e-12))
    return float(result.moments.value[at[0]]) if at.size else math.nan


def _theory(case: Case, problem: Problem) -> float:
    """Its perturbation theory, NaN beyond where it is sought."""
    if case.figure.moment is not None:
        return float(perturbed_moments(problem, np.array(case.figure.moment)))
    index = INDICES[case.figure.needed]
    value = index.theory(problem)
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


def _plane(case: Case, results: Sequence[CurveResult], keys: tuple[str, str], folder: Path) -> Plane:
    """What a map shows, and the line of zeros that a chart has traced in the same folder."""
    x, y = (np.sort(np.array(case.vary.values(key), dtype=float)) for key in keys)
    values, failed = np.full((y.size, x.size), math.nan), np.ones((y.size, x.size), dtype=bool)
    for result in results:
        column, row = (
            axis.searchsorted(float(result.curve.varied[key])) for axis, key in zip((x, y), keys, strict=True)
        )
        values[row, column] = number = _number(case, result)
        failed[row, column] = math.isnan(number) and bool(result.failures)
    setting = case.figure
    zero = Zero("moment", setting.moment) if setting.moment else Zero("lyapunov_exponent")
    traced = read_line(folder, keys, zero, results[0].curve.parameters)
    where = "" if setting.moment is not None else " from {:g} to {:g}".format(*INDICES[setting.needed].interval)
    return Plane(
        keys, x, y, values, failed, traced.branches, zero.latex,
        is_partial=not traced.is_whole, absent=f"no {setting.quantity.words}{where}",
    )  # fmt: skip


def _columns(dots: Sequence[tuple[float | None, ...]]) -> FloatArray | None:
    """x, y and the errors of some dots; None where there are none."""
    return np.array(dots, dtype=float).T if dots else None
