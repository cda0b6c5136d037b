"""How the numbers of a curve change with every parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.analysis.sensitivity import RECORDS, Sensitivities, Slopes, solve_sensitivities
from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import SENSITIVITIES
from fpsolve.drawing import draw_bars, figure_for
from fpsolve.exponent.error import MEANINGLESS, Estimate
from fpsolve.model.quantity import MOMENT
from fpsolve.page.page import Drawing
from fpsolve.parts.part import Job, Part, Settings
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.theory.perturbation import scale_of


def _settings(case: Case, number: int) -> Settings | None:
    """At which p, and of which indices; intervals follow from them, too."""
    if SENSITIVITIES not in case.asked and not case.uncertain:
        return None
    p = case.differentiated.tolist() if MOMENT.name in case.asked else []
    return {"p": p, "indices": [name for name in RECORDS if name in case.asked]}


def _solve(job: Job, settings: Settings) -> Sensitivities:
    solved = job.columns.p
    p = np.array([p for p in settings["p"] if np.any(solved == p)])
    names = [name for name in settings["indices"] if job.found(name) is not None]
    return solve_sensitivities(job.solver, p, job.curve.problem.derivatives(), indices=names, root=job.root)


def _content(case: Case, result: CurveResult) -> Mapping[str, Any]:
    """∂/∂θ by the key of θ, null where its error leaves it no meaning, and the estimates of these errors alike."""
    if SENSITIVITIES not in case.asked:
        return {}
    if (found := result.sensitivities) is None:
        return {SENSITIVITIES: None}
    known = found

    def numbers(of: Callable[[Estimate], float]) -> dict[str, Any]:
        def row(slopes: Slopes) -> dict[str, float | None]:
            return {key: of(each) if each.relative_error <= MEANINGLESS else None for key, each in slopes.items()}

        moments = zip(known.p.tolist(), known.moments, strict=True)
        indices = {name: row(known.indices[name]) if name in known.indices else None for name in RECORDS}
        return {"moments": [{"p": p, **row(slopes)} for p, slopes in moments], **indices}

    errors = numbers(lambda each: each.error_estimate)
    return {SENSITIVITIES: {**numbers(lambda each: each.value), "errors": errors}}


def _lacks(found: Sensitivities, settings: Settings) -> bool:
    is_there = {*found.p.tolist()} == {*settings["p"]} and found.indices.keys() == {*settings["indices"]}
    return not (is_there and all(found.moments))


def _figures(case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None) -> Iterator[Drawing]:
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


PART: Part = Part(
    SENSITIVITIES,
    _settings,
    _solve,
    Sensitivities,
    SENSITIVITIES,
    said=lambda found, *_: found.notes,
    content=_content,
    figures=_figures,
    lacks=_lacks,
)
