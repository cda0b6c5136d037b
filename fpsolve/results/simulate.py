"""The files of a simulation: monte_carlo.json, and of a stationary response a table and a .vti file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from fpsolve.case.case import Case
from fpsolve.files import write_csv, write_json
from fpsolve.results.csv_json import head, parameters_of
from fpsolve.results.vtk import field_data, pyvista_module, write_vtk
from fpsolve.solve.curve import SimulatedCurve

if TYPE_CHECKING:
    from fpsolve.simulation import Response


SIMULATION = ("monte_carlo.json",)
"""The file with all numbers of a simulation."""


def write_simulation(case: Case, simulated: SimulatedCurve, folder: Path) -> None:
    """monte_carlo.json of a curve, and where there is a response, monte_carlo_response.csv, .vti, .png and .pdf."""
    result, response = simulated.result, simulated.response
    content = {
        **head(case),
        **parameters_of(simulated.curve),
        "estimates": [asdict(estimate) for estimate in result.estimates],
        **_with_errors(simulated.estimates),
        **{name: getattr(result, name) for name in ("paths", "time", "step", "seed", "impacts")},
        "response": response
        and {
            "means": _with_errors(response.means),
            **({} if response.impact_rate is None else {"impact_rate": response.impact_rate}),
            **{name: getattr(response, name) for name in ("outside", "time")},
        },
        "warnings": simulated.warnings,
    }
    write_json(folder / f"monte_carlo{simulated.curve.suffix}.json", content)
    if response is not None:
        _write_response(simulated, response, folder)


def _with_errors(numbers: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {name: {"value": value, "standard_error": error} for name, (value, error) in numbers.items()}


def _write_response(simulated: SimulatedCurve, response: Response, folder: Path) -> None:
    """Write the density of the amplitude, and the joint density of x and ẋ as cell data `density` of a .vti file.

    Field data: `lyapunov_exponent` and its standard error, `lyapunov_exponent_error`, and the parameters as in
    `write_eigenfunctions`.
    """
    curve, found, edges = simulated.curve, simulated.result, response.amplitude_edges
    columns = (edges[:-1], edges[1:], response.amplitude_density, response.amplitude_error)
    rows = (map(float, row) for row in zip(*columns, strict=True))
    header = ["amplitude_from", "amplitude_to", "density", "standard_error"]
    write_csv(folder / f"monte_carlo_response{curve.suffix}.csv", header, rows)
    path, x, v = folder / f"monte_carlo_response{curve.suffix}.vti", response.x_edges, response.v_edges
    size, spacing = (x.size, v.size, 1), (x[1] - x[0], v[1] - v[0], 1.0)
    grid = pyvista_module().ImageData(dimensions=size, spacing=spacing, origin=(x[0], v[0], 0.0))
    grid.cell_data["density"] = response.density.ravel(order="F")
    known = {name: getattr(found, name) for name in ("lyapunov_exponent", "lyapunov_exponent_error")}
    parameters = {**curve.parameters, "curve": float(curve.number)}
    write_vtk(path, grid, {**known, **field_data(parameters, curve.varied, curve.problem)})
