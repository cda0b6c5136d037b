"""Pictures of an eigenpair: T, T* or their product over phase and noise, or over directions."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from fpsolve.arrays import shown
from fpsolve.case.case import Case
from fpsolve.exponent.density import Grid, on_nodes
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import DIRECTIONS, PHASE_AND_NOISE
from fpsolve.model.quantity import NOISE, PHASE
from fpsolve.output.surfaces import Picture, Surface, painted, picture_of
from fpsolve.page.page import Drawing
from fpsolve.parts.nodes import FIELDS, FURTHEST, Nodes
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.vtk import name_at, parameter_lines, pyvista_module

FINER = 2
"""So many times as many nodes either way as a file for ParaView has; there they carry polynomials."""
Field = Literal["T", "T_adjoint", "tilted_density"]


def draw_eigenfunction(pair: PrincipalPair, field: Field = "T", *, cmap: str = "viridis") -> Picture:
    """Draw an eigenfunction, or the tilted density, over phase and noise; for noise with states a line for each.

    Of more than two variables over directions, see `analysis.DirectionDensity`, as the functions of the pair have it: T
    as its mean, T* and T T* as densities.

    Args:
        pair: the eigenpair.
        field: "T", "T_adjoint", or their product "tilted_density".
        cmap: the colours, by matplotlib's names.

    Raises:
        ValueError: there is no such field.
        OutputError: T depends on more than φ and ξ.
    """
    if field not in FIELDS:
        raise ValueError(f"got field = {shown(field)}; must be one of {', '.join(map(repr, FIELDS))}")
    return DRAWN[choose(pair.generator.problem).pictures.part](pair, field, cmap)


def _title_of(pair: PrincipalPair) -> str:
    """p and Λ(p) in words."""
    return f"p = {pair.p:g}, Λ(p) = {round(pair.value, 14) + 0.0:.6g} (1/time)"


def _picture_of_directions(pair: PrincipalPair, field: str, cmap: str) -> Picture:
    """A function of directions in colours."""
    found, quantity = on_nodes(pair), FIELDS[field]
    about = {**quantity.attributes, "units": quantity.unit if field == "T" else found.grid.unit}
    draw = partial(found.grid.draw, values=getattr(found.fields, field), about=about, cmap=cmap)
    return painted(draw, _title_of(pair), parameter_lines(pair.generator.problem.parameters))


def _picture_over_noise(pair: PrincipalPair, field: str, cmap: str) -> Picture:
    """A function of phase and noise where it is not negligible."""
    quantity, problem, nodes = FIELDS[field], pair.generator.problem, Nodes.of(pair, FINER).seen(pair)
    unit = quantity.unit if field == "T" else Grid.of(pair).unit
    surface = Surface(
        phi=nodes.phi,
        xi=nodes.xi,
        values=nodes.at_xi(getattr(nodes.fields(pair), field)),
        about={
            "phi": PHASE.attributes,
            "xi": problem.noise_quantity.attributes,
            "values": {**quantity.attributes, "units": unit},
        },
        name=quantity.symbol,
        title=_title_of(pair),
        lines=parameter_lines(problem.parameters),
        impacts=nodes.impacts,
        is_lines=nodes.is_lines,
    )
    return picture_of(surface, cmap)


DRAWN = {PHASE_AND_NOISE.part: _picture_over_noise, DIRECTIONS.part: _picture_of_directions}
"""What draws each of the `Pictures`."""


def figures(case: Case, result: CurveResult, folder: Path, _: SimulatedCurve | None) -> Iterator[Drawing]:
    """A picture at one p for a page, where the eigenfunction was written."""
    source = folder / name_at(f"eigenfunctions{result.curve.suffix}", case.usual_p)
    if case.method.pictures == PHASE_AND_NOISE and case.shown.size and source.is_file():
        title = f"Eigenfunction T(φ, ξ) of p = {case.usual_p:g}{result.curve.of}"
        yield Drawing(title, partial(_paint, source), kind="png")


def _paint(source: Path, paths: Sequence[Path], heading: str) -> None:
    """The picture of a file."""
    for path in paths:
        picture_of(surface_from(source)).save(path)


def surface_from(path: Path) -> Surface:
    """T of a file, on the nodes of the elements."""
    grid = pyvista_module().read(path)
    phi, xi = np.asarray(grid.points)[:, :2].T
    count = int(np.argmax(phi != phi[0])) or phi.size
    rows = (-1, count)
    z, facts = np.asarray(grid.point_data["z"]).reshape(rows)[0], grid.field_data
    along, y = bytes(facts["along_y"]).decode(), xi.reshape(rows)[0]
    is_lines = not along.startswith("noise xi")  # y is the number of a state, each a strip on which T is constant
    if is_lines:
        numbers, near = np.unique(np.round(y), return_index=True)
        stated = [float(each) for each in re.findall(r"xi = (\S+?)(?:;|$)", along)]
        y = y.copy()
        y[near] = stated if len(stated) == numbers.size else numbers
    else:
        near = np.flatnonzero(np.abs(z) <= FURTHEST)
        near = near if near.size > 1 else np.arange(z.size)
    impacts = [each for each in np.asarray(facts["impacts"]).tolist() if not math.isnan(each)]
    about = {"phi": PHASE.attributes, "xi": {**NOISE.attributes, "units": "1"}, "values": FIELDS["T"].attributes}
    return Surface(
        phi=phi.reshape(rows)[:, :1].T,
        xi=y[near],
        values=np.asarray(grid.point_data["T"]).reshape(rows)[:, near],
        about=about,
        name="T",
        title=f"p = {float(facts['p'][0]):g}, Λ(p) = {float(facts['Lambda'][0]):.6g}",
        lines=bytes(facts["held"]).decode().splitlines() if "held" in facts else (),
        impacts=[each % (2 * math.pi) for each in impacts],
        is_lines=is_lines,
    )
