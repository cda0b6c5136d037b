"""Eigenfunctions and densities as ParaView files: Lagrange quadrilaterals on the full circle, x = φ, y = ξ.

A file shows the elements' polynomials at their `Nodes`; its field data name the curve. Where the noise has
states, y is the number of the state, each a strip. Field data are numbers, as meshio refuses texts: a text is the
codes of its letters, `bytes(mesh.field_data["held"]).decode()`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from xml.sax.saxutils import quoteattr

import numpy as np

from fpsolve.analysis.directions import SettledDirections
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, Curve
from fpsolve.data import plain_unit
from fpsolve.exponent.directions import DirectionGrid
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import xi_marginal
from fpsolve.files import write_text
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import Quantity
from fpsolve.output.directions import on_one_grid, write_densities
from fpsolve.output.nodes import FIELDS, Nodes
from fpsolve.parts import directions
from fpsolve.parts.eigenfunctions import NAME, Eigenfunctions
from fpsolve.study.results import SimulatedCurve, Solved
from fpsolve.vtk import Facts, field_data, pyvista_module, write_between, write_vtk

CURVES = "curves.pvd"
MOST_STATES = 8
"""States of the noise that a picture names."""
_DIGITS = str.maketrans("₁₂₃₄²", "12342")


def write_eigenfunctions(
    directory: Path,
    pairs: Sequence[PrincipalPair],
    stationary: PrincipalPair,
    stem: str = "eigenfunctions",
    parameters: Facts = MappingProxyType({}),
    varied: Collection[str] = (),
) -> list[Path]:
    """Write `<stem>.pvd`, a time series over p, and `<stem>/p….vtu`, one file for each p.

    Point data: `T`; `T_adjoint`, T*; `tilted_density`, T T*; `stationary_density`, T* at p = 0; `z` = ξ/std.
    T, which ParaView shows first, has mean 1 over P_s(ξ)/2π, see `fields`, and is cut off beyond e^±600;
    ∫T T* dφ dξ = 1. Where the noise has states `z` is the number of one, and densities are per radian.
    Field data: `p`; `Lambda`, Λ(p); each of the parameters; and in words, with units, `varied`, those
    that are varied, and `held`, the others; `impacts`, where T jumps, and `along_y`, what stands along y.

    Args:
        directory: the folder, made where it is missing.
        pairs: the eigenpairs, at most one of them written for each p.
        stationary: the pair at p = 0 of the same oscillator and noise, on any mesh.
        stem: name of the collection and of the folder of its files.
        parameters: of the oscillator and the noise, by dotted keys such as "noise.D0".
        varied: the keys of those that differ between curves.

    Returns:
        The files written, the collection first.
    """
    names = {pair.p: _name(stem, pair.p) for pair in sorted(pairs, key=lambda pair: pair.p)}
    problem = stationary.generator.problem
    facts = {**_frame(problem), **field_data(parameters, varied, problem)}
    for pair in pairs:
        grid = Nodes.of(pair)
        found = grid.fields(pair)
        data = {
            "T": found.right,
            "T_adjoint": found.adjoint,
            "tilted_density": found.product,
            "stationary_density": grid.fields(stationary).adjoint,
            "z": grid.z,
        }
        _write_grid(directory / names[pair.p], grid, data, {"p": pair.p, "Lambda": pair.value, **facts})
    collection = directory / f"{stem}.pvd"
    write_text(collection, _collection((p, name, "") for p, name in names.items()))
    return [collection, *(directory / name for name in names.values())]


def write_density(
    path: Path,
    stationary: PrincipalPair,
    parameters: Facts = MappingProxyType({}),
    varied: Collection[str] = (),
) -> Path:
    """Write the stationary density of (φ, ξ), per radian and unit of ξ, with its marginals, to a `.vtu` file.

    Point data: `stationary_density`, which ParaView shows first, `phi_marginal`, `xi_marginal`, `z`. Field data:
    `lyapunov_exponent`, λ; `p` and `Lambda`, which are 0; and the parameters as in `write_eigenfunctions`.
    """
    grid, space = Nodes.of(stationary), stationary.space
    over_xi = space.table(stationary.left) @ (space.xi.mass() @ space.xi.constant)
    data = {
        "stationary_density": grid.fields(stationary).adjoint,
        "phi_marginal": grid.phase_table(stationary) @ over_xi[:, None],
        "xi_marginal": space.turns * xi_marginal(stationary, grid.samples(stationary)),
        "z": grid.z,
    }
    problem = stationary.generator.problem
    known = {"p": 0.0, "Lambda": 0.0, "lyapunov_exponent": stationary.derivative, **_frame(problem)}
    _write_grid(path, grid, data, {**known, **field_data(parameters, varied, problem)})
    return path


def write_functions(solved: Solved, curve: Curve, folder: Path) -> None:
    """Write the eigenfunctions of a curve; with the first curve the stationary density too, if that is wanted."""
    if of_directions := solved.pictures.get(directions.NAME):
        write_directions(of_directions, curve, folder)
    found: Eigenfunctions | None = solved.pictures.get(NAME)
    if found is None or found.stationary is None:
        return
    about = ({**curve.parameters, "curve": float(curve.number)}, curve.varied)
    if curve.number == 1 and found.has_density:
        write_density(folder / "density.vtu", found.stationary, *about)
    if found.pairs:
        copy_show_script(folder)
        write_eigenfunctions(folder, found.pairs, found.stationary, f"eigenfunctions{curve.suffix}", *about)


def write_directions(found: Sequence[SettledDirections], curve: Curve, folder: Path) -> None:
    """Write densities.nc and, as `write_eigenfunctions`, a series over p; with the first curve the stationary density.

    The files for ParaView show x = η and y = θ₁ − θ₂ of four variables, of three variables the unit sphere. At p = 0
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
    names = {each.pair.p: _name(stem, each.pair.p) for each in others}
    for each in others:
        data = {name: getattr(each.fields, own) for name, (own, _) in reversed(FIELDS.items())}
        known = {"p": each.pair.p, "Lambda": each.value}
        _write_plane(folder / names[each.pair.p], grid, {**data, **always}, {**known, **facts})
    if others:
        write_text(folder / f"{stem}.pvd", _collection((p, name, "") for p, name in names.items()))


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


def write_curves(case: Case, folder: Path) -> Path | None:
    """Write `curves.pvd`, a time series over the curves of which there are eigenfunctions in a folder, all at one p.

    The time is the varied value where there is one that is a number, and else the number of the curve; the name of each
    entry tells which, and p. Nothing is written of a single curve.
    """
    p, shown = case.usual_p, case.curves() if case.shown.size and case.output.asks_for_eigenfunctions else ()
    names = [(curve, _name(f"eigenfunctions{curve.suffix}", p)) for curve in shown]
    there = [(curve, name) for curve, name in names if (folder / name).is_file()]
    if case.planned == 1 or not there:
        return None
    keys = [key for key in case.vary.keys if len(case.vary.values(key)) > 1]
    if len(keys) == 1 and not case.vary.is_text(keys[0]):
        entries = [(float(curve.varied[keys[0]]), name, f"{curve.label}, p = {p:g}") for curve, name in there]
    else:
        entries = [(float(each.number), name, f"curve {each.number}: {each.label}, p = {p:g}") for each, name in there]
    write_text(folder / CURVES, _collection(sorted(entries)))
    return folder / CURVES


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


def copy_show_script(directory: Path) -> Path:
    """Put `show.py`, which draws a collection in ParaView, into the folder."""
    target = directory / "show.py"
    write_text(target, files("fpsolve.output").joinpath("show.py").read_text(encoding="utf-8"))
    return target


def _write_grid(path: Path, grid: Nodes, data: Mapping[str, FloatArray], facts: Facts) -> None:
    """Write a .vtu file; arrays of point data broadcast to (φ-nodes, ξ-nodes), and the first is shown first."""
    pyvista, connectivity = pyvista_module(), grid.cells()
    count, size = connectivity.shape
    cells = np.column_stack([np.full(count, size), connectivity]).ravel()
    kinds = np.full(count, pyvista.CellType.LAGRANGE_QUADRILATERAL, dtype=np.uint8)
    output = pyvista.UnstructuredGrid(cells, kinds, grid.points())
    for name, values in data.items():
        output.point_data[name] = np.broadcast_to(values, (grid.phi.size, grid.z.size)).ravel()
    output.GetPointData().SetActiveScalars(next(iter(data)))
    write_vtk(path, output, facts)


def _frame(problem: Problem) -> Facts:
    """What pictures say of the axes: where T jumps, in radians, and what stands along y."""
    turns = {round((jump.phase + turn) % (2 * math.pi), 12) for jump in problem.system.jumps for turn in (0, math.pi)}
    noise, unit = problem.noise, plain_unit(problem.noise_quantity.unit).replace("²", "^2")
    along = "noise xi" if unit in ("1", "unknown") else f"noise xi ({unit})"
    if noise.has_states:
        states = [] if noise.is_white else [f"xi = {each:g}" for each in noise.reached]
        along = "; ".join(
            [
                f"{noise.kind or 'white'} noise" if noise.is_white else "states",
                *(states if len(states) <= MOST_STATES else ()),
            ]
        )
    return {"impacts": sorted(turns) or [math.nan], "along_y": along}


def _name(stem: str, p: float) -> str:
    """The file of an eigenfunction, seen from its collection."""
    return f"{stem}/p{p + 0.0:+}.vtu"


def _collection(entries: Iterable[tuple[float, str, str]]) -> str:
    """The XML of a ParaView collection: times, the file for each, and a name for it that may be empty."""
    sets = [
        f'    <DataSet timestep="{time}"{f" name={quoteattr(name)}" if name else ""} file={quoteattr(file)}/>'
        for time, file, name in entries
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>'
    return "\n".join([head, *sets, "  </Collection>", "</VTKFile>", ""])
