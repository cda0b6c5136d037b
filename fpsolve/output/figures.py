"""What the figures of a case show: solved curves beside perturbation theory and simulated ones; responses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import Value, Varied
from fpsolve.case.vary import PARAMETERS
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.quantities import INDICES, QUANTITIES, Index
from fpsolve.model.parameters import symbol_of
from fpsolve.output.plots import MOST_LABELLED, Series, write_bars, write_figure, write_response_figure
from fpsolve.study.results import CurveResult, SimulatedCurve
from fpsolve.theory.perturbation import scale_of, second_order

Pair = tuple[CurveResult, SimulatedCurve | None]


def draw(case: Case, results: Sequence[CurveResult], simulated: Sequence[SimulatedCurve], folder: Path) -> None:
    """Draw figure.png and figure.pdf: finite elements, perturbation theory, and what is simulated as dots.

    Without a [figure] there is none of a case that does not ask for Λ(p).
    """
    if case.figure.y not in case.output.quantities:
        return
    samples = {each.curve.key: each for each in simulated}
    pairs = [(result, samples.get(result.curve.key)) for result in results]
    is_many = len(pairs) > MOST_LABELLED
    of_moments = _plain_series if is_many else _moment_series
    series = [of_moments(*pair) for pair in pairs] if case.figure.x == "p" else _over_parameter(case, pairs)
    pictures = [folder / "figure.png", folder / "figure.pdf"]
    quantity = QUANTITIES[case.figure.y]
    is_exact = any(result.curve.is_exact for result in results)
    write_figure(series, case.figure.x, quantity, case.headline, pictures, is_reduced=is_exact)


def draw_sensitivities(case: Case, results: Iterable[CurveResult], folder: Path) -> None:
    """Draw sensitivities.png and .pdf of every curve, if the case says so."""
    for result in results if case.output.sensitivities else ():
        _draw_sensitivities(case, result, folder)


def _draw_sensitivities(case: Case, result: CurveResult, folder: Path) -> None:
    """θ ∂Λ(p)/∂θ of some p, and that of λ, over the scale of each."""
    found = result.sensitivities
    if found is None:
        return
    scale, bars = scale_of(result.curve.problem), dict[str, list[float]]()
    for label, (p, slopes) in found.shown().items():
        size = float(scale.moment(p)) if p else scale.linear
        bars[label] = [found.theta[key] * slopes[key].value / size for key in slopes]
    pictures = [folder / f"sensitivities{result.curve.suffix}.{ending}" for ending in ("png", "pdf")]
    write_bars(bars, [symbol_of(PARAMETERS[key]) for key in found.theta], case.heading(result.curve), pictures)


def draw_response(case: Case, simulated: SimulatedCurve, folder: Path) -> None:
    """Draw response.png and response.pdf of a curve, if it has a response."""
    if simulated.response is None:
        return
    pictures = [folder / f"response{simulated.curve.suffix}.{ending}" for ending in ("png", "pdf")]
    write_response_figure(simulated.response, case.heading(simulated.curve), pictures)


def _moment_series(result: CurveResult, sample: SimulatedCurve | None) -> Series:
    moments = result.moments
    line = np.linspace(moments.p.min(), moments.p.max(), 200) if moments.p.size else moments.p
    theory = second_order(result.curve.problem).moment_exponent(line)
    estimates = sample.result.estimates if sample else ()
    dots = [(each.p, each.value, each.standard_error) for each in estimates if each.value is not None]
    rare = np.isin(moments.p, moments.rare)
    root = _root_in(result.stability_index, line)
    return Series(dict(result.curve.varied), moments.p, moments.value, line, theory, _columns(dots), rare, root)


def _plain_series(result: CurveResult, _: SimulatedCurve | None) -> Series:
    """Λ(p) alone, of one of many curves."""
    nothing = np.zeros(0)
    return Series(dict(result.curve.varied), result.moments.p, result.moments.value, nothing, nothing)


def _root_in(index: Estimate | None, line: FloatArray) -> float | None:
    """The stability index, if it lies where the curve is drawn."""
    return index.value if index is not None and line.size and line[0] <= index.value <= line[-1] else None


def _over_parameter(case: Case, pairs: Sequence[Pair]) -> list[Series]:
    """One series for each set of the other parameters that vary."""
    groups: dict[tuple[tuple[str, Value], ...], list[Pair]] = {}
    for pair in pairs:
        others = tuple((key, value) for key, value in pair[0].curve.key if key != case.figure.x)
        groups.setdefault(others, []).append(pair)
    count = 200 if len(groups) <= MOST_LABELLED else 0
    return [_index_series(case, INDICES[case.figure.y], dict(others), group, count) for others, group in groups.items()]


def _index_series(case: Case, index: Index, others: Varied, group: Sequence[Pair], count: int) -> Series:
    """λ or δ_p over the parameter; its perturbation theory, which has poles, at `count` points where it is sought."""
    x = np.array([result.curve.varied[case.figure.x] for result, _ in group])
    found = [result.estimates[index.name] for result, _ in group]
    y = np.array([np.nan if estimate is None else estimate.value for estimate in found])
    line = np.linspace(x.min(), x.max(), count)
    curves = [case.curve({**others, case.figure.x: float(value)}) for value in line]
    line_y = np.array([index.theory(curve.problem) for curve in curves])
    line_y[(line_y < index.interval[0]) | (line_y > index.interval[1])] = np.nan
    samples = [(each, sample.estimates.get(index.name)) for each, (_, sample) in zip(x, group, strict=True) if sample]
    return Series(others, x, y, line, line_y, _columns([(each, *sample) for each, sample in samples if sample]))


def _columns(dots: Sequence[tuple[float | None, ...]]) -> FloatArray | None:
    """x, y and the errors of some dots; None where there are none."""
    return np.array(dots, dtype=float).T if dots else None
