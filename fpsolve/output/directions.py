"""Densities of the directions of three and four variables as files: densities.nc, and its figures."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.analysis.directions import SettledDirections, coordinates_of, draw_over, mean_share
from fpsolve.case.case import Case, Curve
from fpsolve.data import Quantity, dataset
from fpsolve.drawing import Format, figure_for
from fpsolve.exponent.directions import DirectionGrid
from fpsolve.files import atomic
from fpsolve.model.quantity import MOMENT, P
from fpsolve.output.charts import held_in_words
from fpsolve.output.figures import headed
from fpsolve.output.nodes import FIELDS
from fpsolve.study.results import CurveResult

if TYPE_CHECKING:
    import xarray

MOST_PANELS = 4
"""Of a figure: the stationary density, and tilted ones."""
ERROR = Quantity(
    "density_error",
    "error",
    "estimated error of the densities",
    dims=("p",),
    comment="total variation, from coarser ones",
)
STATIONARY = Quantity("stationary_density", "ρ", "stationary density", r"$\rho$")


def on_one_grid(found: Sequence[SettledDirections]) -> list[SettledDirections]:
    """All on the finest of their grids."""
    grid = max((each.fields.grid for each in found), key=lambda grid: grid.first.size)
    return [each.on(grid) for each in found]


def directions_file(curve: Curve, folder: Path) -> Path:
    """Where the densities of a curve are."""
    return folder / f"densities{curve.suffix}.nc"


def write_densities(found: Sequence[SettledDirections], curve: Curve, folder: Path) -> None:
    """Write densities.nc: of every p that is there the fields over directions, and that at p = 0 as the stationary one.

    Args:
        found: on one grid; none is written without one.
        curve: whose they are.
        folder: where.
    """
    shown = [each for each in found if each.pair.p or len(found) == 1]
    stationary = next((each for each in found if not each.pair.p), None)
    grid = found[0].fields.grid
    plane, unit = tuple(each.name for each in grid.quantities), {"unit": grid.unit}
    numbers = dict[Quantity, Any]()
    if stationary is not None:
        numbers[replace(STATIONARY, dims=plane, **unit)] = stationary.fields.adjoint
        numbers[replace(ERROR, name="stationary_density_error", dims=())] = stationary.error
    for name, (own, quantity) in FIELDS.items():
        about = replace(quantity, dims=("p", *plane), **({} if own == "right" else unit))
        numbers[replace(about, name=name)] = np.stack([getattr(each.fields, own) for each in shown])
    numbers[ERROR] = np.array([each.error for each in shown])
    numbers[MOMENT] = np.array([each.value for each in shown])
    if grid.dimension == 4:
        share = replace(mean_share(grid), dims=("p",))
        numbers[share] = np.array([grid.share(each.fields.product) for each in shown])
    places: dict[Quantity, Any] = {P: np.array([each.pair.p for each in shown]), **coordinates_of(grid)}
    if grid.dimension == 4:
        words = f"share of {grid.names[1]} in the {grid.what}"
        places[Quantity("share", "sin²η", words, r"$\sin^2\eta$", dims=("eta",))] = np.sin(grid.first) ** 2
    content = io.BytesIO()  # HDF5 does not survive a full disk
    whole = dataset("densities of directions", "finite elements", numbers, places, curve.parameters)
    whole.to_netcdf(content, engine="h5netcdf")
    with atomic(directions_file(curve, folder)) as draft:
        draft.write_bytes(content.getvalue())


def draw_densities(case: Case, results: Iterable[CurveResult], folder: Path, *, into: Path | None = None) -> None:
    """Draw densities.png and .pdf of every curve with densities: the stationary one, and some tilted ones."""
    if not case.output.figure or case.problem.dimension == 2:
        return
    import xarray  # with pandas, which takes half a second

    for result in results:
        source = directions_file(result.curve, folder)
        if not source.is_file():
            continue
        with xarray.open_dataset(source, engine="h5netcdf") as found:
            _draw(case, result.curve, found, *headed(folder, f"densities{result.curve.suffix}", into, case.headline))


def _draw(case: Case, curve: Curve, found: xarray.Dataset, paths: list[Path], title: str) -> None:
    first, _ = (each for each in found["T"].dims if each != "p")
    count = found.sizes[first] if case.problem.dimension == 4 else (found.sizes[first] - 1) // 2
    grid = DirectionGrid.of(curve.problem, count)
    panels = []
    if "stationary_density" in found:
        panels.append(("stationary", found["stationary_density"]))
    chosen = np.unique(np.linspace(0, found.sizes["p"] - 1, MOST_PANELS - len(panels)).round().astype(int))
    for k in chosen:
        if float(found.p[k]):
            panels.append((f"tilted, p = {float(found.p[k]):g}", found["tilted_density"][k]))
    columns = 1 if len(panels) == 1 else 2
    rows = -(-len(panels) // columns)
    form = Format(width=7.2 if columns == 1 else 11.5, height=3.6 if rows == 1 else 2.6, scale=1.1)
    with figure_for(paths, title, held_in_words(curve, (), case.units.time), form) as figure:
        axes = np.ravel(figure.subplots(rows, columns))
        for place, (axis, (words, values)) in enumerate(zip(axes, panels, strict=False)):
            is_right = place % columns == columns - 1 or place == len(panels) - 1
            about = {"long_name": "density", "units": grid.unit} if is_right else {"long_name": "", "units": "1"}
            draw_over(grid, axis, values.values, about, vmin=0.0)
            if place % columns:
                axis.set_ylabel("")
            if place + columns < len(panels):
                axis.set_xlabel("")
            share = f": mean share of {grid.names[1]} {grid.share(values.values):.1%}" if grid.dimension == 4 else ""
            axis.set_title(words + share, parse_math=False)
        for axis in axes[len(panels) :]:
            axis.set_axis_off()
