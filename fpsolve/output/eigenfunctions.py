"""Pictures of an eigenpair: T, T* or their product over phase and noise, or over directions."""

from __future__ import annotations

from functools import partial
from typing import Literal

from fpsolve.arrays import shown
from fpsolve.exponent.density import Grid, on_nodes
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import DIRECTIONS, PHASE_AND_NOISE
from fpsolve.model.quantity import PHASE
from fpsolve.output.surfaces import Picture, Surface, painted, picture_of
from fpsolve.parts.nodes import FIELDS, Nodes
from fpsolve.vtk import parameter_lines

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
