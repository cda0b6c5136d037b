"""Eigenfunctions over phase and noise, and the stationary density: files for ParaView, and their pictures on a page.

The files have Lagrange quadrilaterals on the full circle, x = φ, y = ξ. They show the elements' polynomials at
their `Nodes`; their field data name the set. Where the noise has states, y is the number of the state, each a strip.
Field data are numbers, as meshio refuses texts: a text is the codes of its letters,
`bytes(mesh.field_data["held"]).decode()`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.sections import EIGENFUNCTIONS
from fpsolve.exponent.density import xi_marginal
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.files import write_text
from fpsolve.results.directions import write_directions
from fpsolve.results.nodes import Nodes
from fpsolve.results.vtk import (
    Facts,
    collection_of,
    facts_of_set,
    name_at,
    pyvista_module,
    write_points,
    write_series,
)
from fpsolve.solve.eigenfunctions import Eigenfunctions


def write_pictures(found: Eigenfunctions, parameter_set: ParameterSet, folder: Path) -> None:
    """Write the eigenfunctions of a parameter set; with the first set the stationary density too, if that is wanted."""
    if found.stationary is None:
        return
    facts = facts_of_set(parameter_set)
    if parameter_set.number == 1 and found.has_density:
        write_density(folder / "density.vtu", found.stationary, facts)
    if found.pairs:
        write_eigenfunctions(folder, found.pairs, found.stationary, f"eigenfunctions{parameter_set.suffix}", facts)


def write_eigenfunctions(
    directory: Path,
    pairs: Sequence[PrincipalPair],
    stationary: PrincipalPair,
    stem: str = "eigenfunctions",
    facts: Facts = MappingProxyType({}),
) -> list[Path]:
    """Write `<stem>.pvd`, a time series over p, and `<stem>/p….vtu`, one file for each p.

    Point data: `T`; `T_adjoint`, T*; `tilted_density`, T T*; `stationary_density`, T* at p = 0; `z` = ξ/std.
    T, which ParaView shows first, has mean 1 over P_s(ξ)/2π, see `fields`, and is cut off beyond e^±600;
    ∫T T* dφ dξ = 1. Where the noise has states `z` is the number of one, and densities are per radian.
    Field data: `p`; `Lambda`, Λ(p); `impacts`, where T jumps; `along_y`, what stands along y; and the facts, those of a
    case its parameters and, in words with units, `varied`, those that are varied, and `fixed`, the others.

    Args:
        directory: the folder, made where it is missing.
        pairs: the eigenpairs, at most one of them written for each p.
        stationary: the pair at p = 0 of the same oscillator and noise, on any mesh.
        stem: name of the collection and of the folder of its files.
        facts: more field data, numbers or texts by their names.

    Returns:
        The files written, the collection first.
    """

    def write(path: Path, pair: PrincipalPair) -> None:
        grid = Nodes.of(pair)
        density = grid.fields(stationary).T_adjoint
        data = {**grid.fields(pair)._asdict(), "stationary_density": density, "z": grid.z}
        _write_grid(path, grid, data, {"p": pair.p, "Lambda": pair.value, **facts})

    return write_series(directory, stem, {pair.p: pair for pair in pairs}, write)


def write_density(
    path: Path,
    stationary: PrincipalPair,
    facts: Facts = MappingProxyType({}),
) -> Path:
    """Write the stationary density of (φ, ξ), per radian and unit of ξ, with its marginals, to a `.vtu` file.

    Point data: `stationary_density`, which ParaView shows first, `phi_marginal`, `xi_marginal`, `z`. Field data:
    `lyapunov_exponent`, λ; `p` and `Lambda`, which are 0; and the facts as in `write_eigenfunctions`.
    """
    grid, space = Nodes.of(stationary), stationary.space
    rule = space.xi.samples()
    data = {
        "stationary_density": grid.fields(stationary).T_adjoint,
        "phi_marginal": grid.fields(stationary, rule).T_adjoint @ rule.measure[:, None],
        "xi_marginal": space.turns * xi_marginal(stationary, grid.samples(stationary)),
        "z": grid.z,
    }
    known = {"p": 0.0, "Lambda": 0.0, "lyapunov_exponent": stationary.derivative}
    _write_grid(path, grid, data, {**known, **facts})
    return path


FILES: Mapping[str, Callable[..., None]] = {
    EIGENFUNCTIONS: write_pictures,
    DIRECTIONS.part: write_directions,
}
"""Each writes what was found of a parameter set, and no record holds, into a folder, by the names of questions."""


def write_sets(case: Case, folder: Path) -> None:
    """Write `sets.pvd`, a time series over the sets of which there are eigenfunctions in a folder, all at one p.

    The time is the varied value where there is one that is a number, and else the number of the set; the name of each
    entry tells which, and p. Nothing is written of a single parameter set.
    """
    p, shown = case.usual_p, case.sets() if case.shown.size and case.output.asks_for_eigenfunctions else ()
    names = [(parameter_set, name_at(f"eigenfunctions{parameter_set.suffix}", p)) for parameter_set in shown]
    there = [(parameter_set, name) for parameter_set, name in names if (folder / name).is_file()]
    if case.planned == 1 or not there:
        return
    keys = [key for key in case.vary.keys if len(case.vary.values(key)) > 1]
    is_number = len(keys) == 1 and not case.vary.is_text(keys[0])
    entries = (
        (float(each.varied[keys[0]] if is_number else each.number), name, f"{each.label}, p = {p:g}")
        for each, name in there
    )
    write_text(folder / "sets.pvd", collection_of(sorted(entries)))


def _write_grid(path: Path, grid: Nodes, data: Mapping[str, FloatArray], facts: Facts) -> None:
    """Write a .vtu file; arrays of point data broadcast to (φ-nodes, ξ-nodes), and the first is shown first."""
    pyvista, axes = pyvista_module(), {"impacts": grid.impacts or [math.nan], "along_y": grid.along_y}
    cells = {pyvista.CellType.LAGRANGE_QUADRILATERAL: grid.cells()}
    shown = {name: np.broadcast_to(values, (grid.phi.size, grid.z.size)) for name, values in data.items()}
    write_points(path, pyvista.UnstructuredGrid(cells, grid.points()), shown, {**axes, **facts})
