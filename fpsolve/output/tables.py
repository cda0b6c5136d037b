"""Results as tables: summary.json and moments.csv; of simulated curves monte_carlo.json and response.csv."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fpsolve import __version__
from fpsolve.analysis.sensitivity import DIFFERENTIATED, Sensitivities, Slopes
from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.exponent.error import MEANINGLESS, Estimate
from fpsolve.exponent.quantities import INDICES, Index
from fpsolve.files import write_csv, write_json
from fpsolve.study.results import CurveResult, SimulatedCurve

if TYPE_CHECKING:
    from fpsolve.simulation.response import Response


def write_results(case: Case, results: Sequence[CurveResult], folder: Path) -> None:
    """summary.json, which says whether all curves of the case are there, and moments.csv."""
    state = {"complete": len(results) == case.planned, "planned": case.planned, "done": len(results)}
    write_json(folder / "summary.json", {**head(case), **state, "curves": [_summary(result) for result in results]})
    columns = ["p", "value", "derivative", "perturbation", "error_estimate", "residual"]
    rows = ([*result.curve.varied.values(), *row.values()] for result in results for row in _rows(result))
    write_csv(folder / "moments.csv", [*case.vary.keys, *columns], rows)


def write_simulation(case: Case, simulated: SimulatedCurve, folder: Path) -> None:
    """monte_carlo.json of a curve, and response.csv where there is a response."""
    suffix, response = simulated.curve.suffix, simulated.response
    write_json(folder / f"monte_carlo{suffix}.json", {**head(case), **_simulation_summary(simulated)})
    if response is None:
        return
    edges = response.amplitude_edges
    columns = (edges[:-1], edges[1:], response.amplitude_density, response.amplitude_error)
    rows = (map(float, row) for row in zip(*columns, strict=True))
    header = ["amplitude_from", "amplitude_to", "density", "standard_error"]
    write_csv(folder / f"response{suffix}.csv", header, rows)


def head(case: Case) -> dict[str, str]:
    """What every table begins with."""
    return {"case": case.name, "title": case.title, "fpsolve_version": __version__}


def _parameters(curve: Curve) -> dict[str, dict[str, Any]]:
    return {"parameters": dict(curve.parameters), "varied": dict(curve.varied)}


def _summary(result: CurveResult) -> dict[str, Any]:
    return {
        **_parameters(result.curve),
        "moments": _rows(result),
        **{name: _estimate(result, index) for name, index in INDICES.items()},
        "sensitivities": None if result.sensitivities is None else _sensitivities(result.sensitivities),
        "discretisation": result.discretisation,
        "warnings": [*result.warnings, *(failure.reason for failure in result.failures)],
        "notes": list(result.notes),
    }


def _rows(result: CurveResult) -> list[dict[str, float | None]]:
    """One row for each p; what is not known is None."""
    moments = result.moments
    columns = {
        "p": moments.p,
        "value": moments.value,
        "derivative": moments.derivative,
        "perturbation": result.moments_perturbation,
        "error_estimate": moments.error_estimate,
        "residual": moments.residual,
    }
    known = {name: [None if math.isnan(x) else x for x in values.tolist()] for name, values in columns.items()}
    return [dict(zip(known, row, strict=True)) for row in zip(*known.values(), strict=True)]


def _estimate(result: CurveResult, index: Index) -> dict[str, float | None] | None:
    """An index beside its perturbation theory, null where that overflows."""
    estimate = result.estimates[index.name]
    if estimate is None:
        return None
    theory = index.theory(result.curve.problem)
    perturbation = theory if math.isfinite(theory) else None
    return {"value": estimate.value, "error_estimate": estimate.error_estimate, "perturbation": perturbation}


def _sensitivities(found: Sensitivities) -> dict[str, Any]:
    """∂/∂θ by the key of θ, null where its error leaves it no meaning, and the estimates of these errors alike."""

    def numbers(of: Callable[[Estimate], float]) -> dict[str, Any]:
        def row(slopes: Slopes) -> dict[str, float | None]:
            return {key: of(each) if each.relative_error <= MEANINGLESS else None for key, each in slopes.items()}

        moments = zip(found.p.tolist(), found.moments, strict=True)
        indices = {name: row(found.indices[name]) if name in found.indices else None for name in DIFFERENTIATED}
        return {"moments": [{"p": p, **row(slopes)} for p, slopes in moments], **indices}

    errors = numbers(lambda each: each.error_estimate)
    return {**numbers(lambda each: each.value), "error_estimates": errors}


def _simulation_summary(simulated: SimulatedCurve) -> dict[str, Any]:
    result, response = simulated.result, simulated.response
    return {
        **_parameters(simulated.curve),
        "estimates": [asdict(estimate) for estimate in result.estimates],
        **_with_errors(simulated.estimates),
        "paths": result.paths,
        "time": result.time,
        "step": result.step,
        "seed": result.seed,
        "impacts": result.impacts,
        "response": None if response is None else _response_summary(response),
        "warnings": list(simulated.warnings),
    }


def _response_summary(response: Response) -> dict[str, Any]:
    return {
        "means": _with_errors(response.means),
        "impact_rate": response.impact_rate,
        "outside": response.outside,
        "time": response.time,
    }


def _with_errors(numbers: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {name: {"value": value, "standard_error": error} for name, (value, error) in numbers.items()}
