"""The files of a simulation, monte_carlo.json, and of a stationary response, solved or simulated."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.case.case import Case, ParameterSet
from fpsolve.files import write_csv, write_json
from fpsolve.results.csv_json import head, parameters_of, sampled
from fpsolve.results.vtk import facts_of_set, pyvista_module, write_between, write_vtk
from fpsolve.solve.set_result import SetResponse, SimulatedSet

if TYPE_CHECKING:
    from fpsolve.simulation import Response


SIMULATION = ("monte_carlo.json",)
"""The file with all numbers of a simulation."""


def write_simulation(case: Case, simulated: SimulatedSet, folder: Path) -> None:
    """monte_carlo.json of a set, and where there is a response, monte_carlo_response.csv, .vti, .png and .pdf."""
    result, response = simulated.result, simulated.response
    content = {
        **head(case),
        **parameters_of(simulated.parameter_set),
        "estimates": [asdict(estimate) for estimate in result.estimates],
        **{name: sampled(*each) for name, each in simulated.estimates.items()},
        **{name: vars(result)[name] for name in ("paths", "time", "step", "seed", "impacts")},
        "response": response
        and {
            "means": {name: sampled(*each) for name, each in response.means.items()},
            "impact_rate": response.impact_rate,
            "outside": response.outside,
            "time": response.time,
        },
        "warnings": simulated.warnings,
    }
    write_json(folder / f"monte_carlo{simulated.parameter_set.suffix}.json", content)
    if response is not None:
        _write_simulated(simulated, response, folder)


def _write_simulated(simulated: SimulatedSet, response: Response, folder: Path) -> None:
    """Write the density of the amplitude, and the joint density of x and ẋ as cell data `density` of a .vti file.

    Field data: `lyapunov_exponent` and its standard error, `lyapunov_exponent_error`, and the parameters as in
    `write_eigenfunctions`.
    """
    parameter_set, found, edges = simulated.parameter_set, simulated.result, response.amplitude_edges
    columns = edges[:-1], edges[1:], response.amplitude_density, response.amplitude_error
    header = ["amplitude_from", "amplitude_to", "density", "standard_error"]
    write_csv(folder / f"monte_carlo_response{parameter_set.suffix}.csv", header, np.stack(columns, axis=1).tolist())
    path, x, v = folder / f"monte_carlo_response{parameter_set.suffix}.vti", response.x_edges, response.v_edges
    size, spacing = (x.size, v.size, 1), (x[1] - x[0], v[1] - v[0], 1.0)
    grid = pyvista_module().ImageData(dimensions=size, spacing=spacing, origin=(x[0], v[0], 0.0))
    grid.cell_data["density"] = response.density.ravel(order="F")
    value, error = found.lyapunov_exponent, found.lyapunov_exponent_error
    write_vtk(path, grid, {"lyapunov_exponent": value, "lyapunov_exponent_error": error, **facts_of_set(parameter_set)})


def write_response(found: SetResponse, parameter_set: ParameterSet, folder: Path) -> None:
    """Write the stationary density of a set, if it has one, as response.csv, response.vtu and response_3d.vtu.

    The table has that of the amplitude. response.vtu shows both variables as x and y, with the `density` of these, and
    `amplitude` and `phi`; response_3d.vtu shows (a, φ, ξ) as x, y and z, with the `density` of these. Field data: the
    numbers of the response, `stability_index`, and the parameters as in `write_eigenfunctions`.
    """
    if found.density is None:
        return
    density, system = found.density, parameter_set.problem.linear
    rows = np.stack([density.amplitude, density.of_amplitude], axis=1).tolist()
    write_csv(folder / f"response{parameter_set.suffix}.csv", ["amplitude", "density"], rows)
    about = system.response
    known = {about.numbers[name].name: each.value for name, each in found.numbers.items()}
    facts = {**known, "stability_index": found.stability_index, **facts_of_set(parameter_set)}
    phases, of_plane = density.plane(about.has_wall)
    a, phi = np.meshgrid(density.amplitude, phases, indexing="ij")
    plane = {"density": of_plane, "amplitude": a, "phi": phi}
    places = [a * np.cos(phi), -a * system.aspect * np.sin(phi), 0 * a]
    write_between(folder / f"response{parameter_set.suffix}.vtu", places, plane, facts)
    places = [*np.meshgrid(density.amplitude, density.phi, density.xi, indexing="ij")]
    whole = {"density": density.whole.astype(np.float32)}
    write_between(folder / f"response_3d{parameter_set.suffix}.vtu", places, whole, facts)
