"""The files of densities of directions: densities.nc, and a series for ParaView."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.case.case import ParameterSet
from fpsolve.data import Quantity, dataset
from fpsolve.exponent.density import Densities, DirectionGrid
from fpsolve.files import write_bytes
from fpsolve.model.quantity import MOMENT, P
from fpsolve.results.nodes import FIELDS
from fpsolve.results.vtk import facts_of_set, write_between, write_series

ERROR = Quantity(
    "density_error",
    "error",
    "estimated error of the densities",
    dims=("p",),
    comment="total variation, from coarser ones",
)
STATIONARY = Quantity("stationary_density", "ρ", "stationary density", r"$\rho$")


def directions_file(parameter_set: ParameterSet, folder: Path) -> Path:
    """Where the densities of a parameter set are."""
    return folder / f"densities{parameter_set.suffix}.nc"


def _write_numbers(
    grid: DirectionGrid,
    stationary: Densities | None,
    shown: Sequence[Densities],
    parameter_set: ParameterSet,
    folder: Path,
) -> None:
    """Write densities.nc: the stationary density, if it is there, and the fields at the p that are shown."""
    plane = tuple(each.name for each in grid.quantities)
    numbers = dict[Quantity, Any]()
    if stationary:
        numbers[replace(STATIONARY, dims=plane, unit=grid.unit)] = stationary.fields.T_adjoint
        numbers[replace(ERROR, name="stationary_density_error", dims=())] = stationary.error
    fields = np.stack([each.fields for each in shown], axis=1)
    for (name, quantity), values in zip(FIELDS.items(), fields, strict=True):
        numbers[replace(quantity, dims=("p", *plane), unit="1" if name == "T" else grid.unit)] = values
    numbers[ERROR] = np.array([each.error for each in shown])
    numbers[MOMENT] = np.array([each.value for each in shown])
    means = [grid.means(each.fields.tilted_density) for each in shown]
    for mean in means[0]:
        numbers[replace(mean, dims=("p",))] = np.array([each[mean] for each in means])
    places = {P: np.array([each.pair.p for each in shown]), **grid.coordinates}
    if grid.share:
        places[grid.share] = np.sin(grid.first) ** 2
    content = io.BytesIO()  # HDF5 does not survive a full disk
    whole = dataset("densities of directions", "finite elements", numbers, places, parameter_set.parameters)
    whole.to_netcdf(content, engine="h5netcdf")
    write_bytes(directions_file(parameter_set, folder), content.getvalue())


def write_directions(found: Sequence[Densities], parameter_set: ParameterSet, folder: Path) -> None:
    """Write densities.nc and, as `write_eigenfunctions`, a series over p; with the first set the stationary density.

    The files for ParaView show x = η and y = θ₁ − θ₂ of four variables, with a stop y = θ₁ between two impacts, so that
    T jumps from one edge to the other, and of three variables the unit sphere. At p = 0
    T = 1 and T* is the stationary density, so that the series leaves it out.
    """
    if not found:
        return
    grid = max((each.grid for each in found), key=lambda grid: grid.first.size)
    found = [each.on(grid) for each in found]
    stationary = next((each for each in found if not each.pair.p), None)
    tilted = [each for each in found if each.pair.p]
    _write_numbers(grid, stationary, tilted or found, parameter_set, folder)
    along = {f"along_{side}": axis.in_words() for side, axis in zip("xy", grid.quantities, strict=True)}
    facts = {**facts_of_set(parameter_set), **along}
    first, second = np.meshgrid(grid.first, grid.second, indexing="ij")
    places = [first, second, 0 * first] if grid.share else [*grid.directions.reshape(3, *first.shape)]
    always = {"stationary_density": stationary.fields.T_adjoint} if stationary else {}
    always |= {"share": np.sin(first) ** 2} if grid.share else {"longitude": first, "latitude": second}
    if stationary and parameter_set.number == 1:
        write_between(folder / "density.vtu", places, always, {"p": 0.0, "Lambda": 0.0, **facts})

    def write(path: Path, each: Densities) -> None:
        data = dict(reversed(each.fields._asdict().items()))
        write_between(path, places, {**data, **always}, {"p": each.pair.p, "Lambda": each.value, **facts})

    if tilted:
        write_series(folder, f"eigenfunctions{parameter_set.suffix}", {each.pair.p: each for each in tilted}, write)
