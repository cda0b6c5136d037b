"""A picture of how numbers change with the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from fpsolve.analysis.sensitivity import Sensitivities
from fpsolve.case.case import Case, Curve
from fpsolve.drawing import draw_bars, figure_for
from fpsolve.page.page import Drawing
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.theory.perturbation import scale_of


def figures(case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None) -> Iterator[Drawing]:
    """sensitivities.png and .pdf, if the case asks for them."""
    if case.output.sensitivities and result.sensitivities:
        title, name = f"Effect of the parameters{result.curve.of}", f"sensitivities{result.curve.suffix}"
        yield Drawing(title, partial(_draw, case, result.curve, result.sensitivities), name, case.headline)


def _draw(case: Case, curve: Curve, found: Sensitivities, paths: Sequence[Path], heading: str) -> None:
    """θ ∂/∂θ of λ and of some Λ(p), scaled."""
    scale, bars = scale_of(curve.problem), dict[str, list[float]]()
    for label, (p, slopes) in found.shown().items():
        size = float(scale.moment(p)) if p else scale.linear
        bars[label] = [found.theta[key] * slopes[key].value / size for key in slopes]
    with figure_for(paths, heading, curve.held(case.units.time)) as figure:
        words = r"effect of a relative change, $\theta\,\partial/\partial\theta$, over the scale"
        draw_bars(figure.add_subplot(xlabel=words), bars, [case.about(key).shown for key in found.theta])
