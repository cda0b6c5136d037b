"""Densities of the directions of three and four variables, in the place of eigenfunctions: densities.nc, figures."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.analysis.directions import (
    SettledDirections,
    coordinates_of,
    draw_over,
    mean_share,
    negative_part,
    settled_directions,
)
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, Curve
from fpsolve.data import Quantity, dataset
from fpsolve.drawing import Format, figure_for
from fpsolve.exponent.directions import DirectionGrid
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import MOST_NEGATIVE
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.files import atomic, write_text
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import MOMENT, P
from fpsolve.page.page import Drawing
from fpsolve.parts.eigenfunctions import said_of_pictures, shown_of, without_failed
from fpsolve.parts.nodes import FIELDS
from fpsolve.parts.part import Job, Part, Reason, Settings, attempt
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.vtk import Facts, collection_of, field_data, name_at, write_between

if TYPE_CHECKING:
    import xarray


NAME = "directions"
ROUGH = 0.05
"""Total variation by which finer functions may move a density that a picture shows."""
MOST_PANELS = 4
"""Of a figure: the stationary density, and tilted ones."""
ERROR = Quantity(
    "density_error",
    "error",
    "estimated error of the densities",
    dims=("p",),
    comment="total variation, from coarser ones",
)
_DIGITS = str.maketrans("₁₂₃₄²", "12342")
"""Digits in ASCII."""
STATIONARY = Quantity("stationary_density", "ρ", "stationary density", r"$\rho$")


def _settings(case: Case, number: int) -> Settings | None:
    return shown_of(case, number) if case.problem.dimension > 2 else None


def _solve(job: Job, settings: Settings) -> tuple[Message, ...]:
    """The densities at the p that converge, at p = 0 with the stationary one; what is said of them."""
    found, said, shown = list[SettledDirections](), list[Message](), without_failed(job, settings["p"])
    for p in sorted({*shown, 0.0} if settings["density"] else shown):
        pair = attempt(partial(job.solver.pair, p), NAME)
        if isinstance(pair, Reason):
            continue
        each = attempt(partial(_at, job.solver, pair), NAME)
        if isinstance(each, Reason):
            said.append(Message(Code.INDEX_MISSING, symbols=["density of directions"], reason=each.message))
        else:
            found.append(each)
    job.pictures[NAME] = tuple(found)
    return (*said, *(message for each in found for message in _unclear(each)))


def _at(solver: ExponentSolver, pair: PrincipalPair) -> SettledDirections:
    with solver.meter.running():
        return settled_directions(pair)


def _unclear(found: SettledDirections) -> Iterator[Message]:
    """Which densities mislead."""
    p, fields = found.pair.p, found.fields
    for name, values in {"T_adjoint": fields.adjoint, "tilted_density": fields.product}.items():
        if (defect := negative_part(fields.grid, values)) > MOST_NEGATIVE:
            yield Message(Code.UNREADABLE, name=name, p=p, size=defect)
    if not fields.is_resolved:
        yield Message(Code.FINE_DENSITY, p=p, size=abs(fields.total - 1))
    if not found.error <= ROUGH:
        yield Message(Code.ROUGH_DENSITY, p=p, size=None if math.isnan(found.error) else found.error)


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


def write_directions(found: Sequence[SettledDirections], curve: Curve, folder: Path) -> None:
    """Write densities.nc and, as `write_eigenfunctions`, a series over p; with the first curve the stationary density.

    The files for ParaView show x = η and y = θ₁ − θ₂ of four variables, with a stop y = θ₁ between two impacts, so that
    T jumps from one edge to the other, and of three variables the unit sphere. At p = 0
    T = 1 and T* is the stationary density, so that the series leaves it out.
    """
    found = on_one_grid(found)
    write_densities(found, curve, folder)
    grid, problem = found[0].fields.grid, curve.problem
    stationary = next((each for each in found if not each.pair.p), None)
    facts = {"curve": float(curve.number), **field_data(curve.parameters, curve.varied, problem)}
    facts |= {f"along_{side}": _plain(axis) for side, axis in zip("xy", grid.quantities, strict=True)}
    always: dict[str, FloatArray] = {}
    if stationary is not None:
        always["stationary_density"] = stationary.fields.adjoint
    first, second = np.meshgrid(grid.first, grid.second, indexing="ij")
    always |= {"share": np.sin(first) ** 2} if grid.dimension == 4 else {"longitude": first, "latitude": second}
    if stationary is not None and curve.number == 1:
        _write_plane(folder / "density.vtu", grid, always, {"p": 0.0, "Lambda": 0.0, **facts})
    stem, others = f"eigenfunctions{curve.suffix}", [each for each in found if each.pair.p]
    names = {each.pair.p: name_at(stem, each.pair.p) for each in others}
    for each in others:
        data = {name: getattr(each.fields, own) for name, (own, _) in reversed(FIELDS.items())}
        known = {"p": each.pair.p, "Lambda": each.value}
        _write_plane(folder / names[each.pair.p], grid, {**data, **always}, {**known, **facts})
    if others:
        write_text(folder / f"{stem}.pvd", collection_of((p, name, "") for p, name in names.items()))


def _plain(axis: Quantity) -> str:
    """The words of a coordinate and its unit, in ASCII."""
    return f"{axis.words} ({axis.unit})".translate(_DIGITS).encode("ascii", "replace").decode()


def _write_plane(path: Path, grid: DirectionGrid, data: Mapping[str, FloatArray], facts: Facts) -> None:
    """Write a .vtu file of quadrilaterals between the nodes; the first array of point data is shown first."""
    first, second = np.meshgrid(grid.first, grid.second, indexing="ij")
    places = [first, second, 0 * first]
    if grid.dimension == 3:
        flat = np.cos(second)
        places = [flat * np.cos(first), flat * np.sin(first), np.sin(second)]
    write_between(path, places, data, facts)


def _figures(case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None) -> Iterator[Drawing]:
    """densities.png and .pdf, where densities were written."""
    curve, source = result.curve, directions_file(result.curve, folder)
    if case.output.figure and case.problem.dimension > 2 and source.is_file():
        what = "energy share and phase difference" if case.problem.dimension == 4 else "directions"
        what = "energy share and phase" if case.problem.system.stop else what
        title, job = f"Densities of {what}{curve.of}", partial(_draw, case, curve, source)
        yield Drawing(title, job, f"densities{curve.suffix}", case.headline)


def _draw(case: Case, curve: Curve, source: Path, paths: Sequence[Path], heading: str) -> None:
    """The stationary density, and some tilted ones."""
    import xarray  # with pandas, which takes half a second

    with xarray.open_dataset(source, engine="h5netcdf") as found:
        _draw_panels(case, curve, found, paths, heading)


def _draw_panels(case: Case, curve: Curve, found: xarray.Dataset, paths: Sequence[Path], heading: str) -> None:
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
    with figure_for(paths, heading, curve.held(case.units.time), form) as figure:
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


PART: Part = Part(
    NAME,
    _settings,
    _solve,
    tuple[Message, ...],
    "density of directions",
    said=said_of_pictures,
    draw=write_directions,
    figures=_figures,
)
