"""The files of a stationary response: response.csv, response.vtu, response_3d.vtu."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fpsolve.case.case import Curve
from fpsolve.files import write_csv
from fpsolve.results.vtk import facts_of_curve, write_between
from fpsolve.solve.curve import CurveResponse


def write_response(found: CurveResponse, curve: Curve, folder: Path) -> None:
    """Write the stationary density of a curve, if it has one, as response.csv, response.vtu and response_3d.vtu.

    The table has that of the amplitude. response.vtu shows both variables as x and y, with the `density` of these, and
    `amplitude` and `phi`; response_3d.vtu shows (a, φ, ξ) as x, y and z, with the `density` of these. Field data: the
    numbers of the response, `stability_index`, and the parameters as in `write_eigenfunctions`.
    """
    if found.density is None:
        return
    density, system = found.density, curve.problem.linear
    rows = np.stack([density.amplitude, density.of_amplitude], axis=1).tolist()
    write_csv(folder / f"response{curve.suffix}.csv", ["amplitude", "density"], rows)
    about = system.response
    known = {about.numbers[name].name: each.value for name, each in found.numbers.items()}
    facts = {**known, "stability_index": found.stability_index, **facts_of_curve(curve)}
    phases, of_plane = density.plane(about.has_wall)
    a, phi = np.meshgrid(density.amplitude, phases, indexing="ij")
    plane = {"density": of_plane, "amplitude": a, "phi": phi}
    places = [a * np.cos(phi), -a * system.aspect * np.sin(phi), 0 * a]
    write_between(folder / f"response{curve.suffix}.vtu", places, plane, facts)
    places = [*np.meshgrid(density.amplitude, density.phi, density.xi, indexing="ij")]
    whole = {"density": density.whole.astype(np.float32)}
    write_between(folder / f"response_3d{curve.suffix}.vtu", places, whole, facts)
