"""The joint density of a simulated response as a ParaView file."""

from __future__ import annotations

from pathlib import Path

from fpsolve.study.results import SimulatedCurve
from fpsolve.vtk import field_data, pyvista_module, write_vtk


def write_simulated_response(simulated: SimulatedCurve, folder: Path) -> None:
    """Write the joint density of x and ẋ, if there is one, as cell data `density` of monte_carlo_response.vti.

    Field data: `lyapunov_exponent` and its standard error, `lyapunov_exponent_error`, and the parameters as in
    `write_eigenfunctions`.
    """
    response, curve, found = simulated.response, simulated.curve, simulated.result
    if response is None:
        return
    path, x, v = folder / f"monte_carlo_response{curve.suffix}.vti", response.x_edges, response.v_edges
    size, spacing = (x.size, v.size, 1), (x[1] - x[0], v[1] - v[0], 1.0)
    grid = pyvista_module().ImageData(dimensions=size, spacing=spacing, origin=(x[0], v[0], 0.0))
    grid.cell_data["density"] = response.density.ravel(order="F")
    known = {name: getattr(found, name) for name in ("lyapunov_exponent", "lyapunov_exponent_error")}
    parameters = {**curve.parameters, "curve": float(curve.number)}
    write_vtk(path, grid, {**known, **field_data(parameters, curve.varied, curve.problem)})
