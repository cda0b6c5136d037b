"""Pictures of an eigenpair: T, T* or their product over phase and noise, or over directions."""

from __future__ import annotations

import math
from functools import partial
from typing import Literal

from fpsolve.arrays import shown
from fpsolve.exponent.density import Grid, on_directions
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.model.problem import parameter_lines
from fpsolve.model.quantity import PHASE
from fpsolve.parts.nodes import FIELDS, Nodes
from fpsolve.parts.surfaces import Picture, Surface, painted, picture_of

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
    if pair.generator.problem.dimension > 2:
        return _picture_of_directions(pair, field, cmap)
    return picture_of(surface_of(pair, field), cmap)


def _title_of(pair: PrincipalPair) -> str:
    """p and Λ(p) in words."""
    return f"p = {pair.p:g}, Λ(p) = {round(pair.value, 14) + 0.0:.6g} (1/time)"


def _picture_of_directions(pair: PrincipalPair, field: str, cmap: str) -> Picture:
    """A function of directions in colours."""
    found, quantity = on_directions(pair), FIELDS[field]
    about = {**quantity.attributes, "units": quantity.unit if field == "T" else found.grid.unit}
    draw = partial(found.grid.draw, values=getattr(found.fields, field), about=about, cmap=cmap)
    return painted(draw, _title_of(pair), parameter_lines(pair.generator.problem.parameters))


def surface_of(pair: PrincipalPair, field: str) -> Surface:
    """A function of a pair where it is not negligible, with its words."""
    quantity, problem = FIELDS[field], pair.generator.problem
    nodes, noise, is_lines = Nodes.of(pair, FINER).seen(pair), problem.noise_quantity, problem.noise.has_states
    unit = quantity.unit if field == "T" else Grid.of(pair).unit
    xi = pair.space.xi.support if is_lines else nodes.unit * nodes.z
    values = getattr(nodes.fields(pair), field)
    about = {"phi": PHASE.attributes, "xi": noise.attributes, "values": {**quantity.attributes, "units": unit}}
    rays = {(jump.phase + turn) % (2 * math.pi) for jump in problem.system.jumps for turn in (0, math.pi)}
    return Surface(
        phi=nodes.phi,
        xi=xi,
        values=values[:, :: nodes.order + 1] if is_lines else values,
        about=about,
        name=quantity.symbol,
        title=_title_of(pair),
        lines=parameter_lines(problem.parameters),
        impacts=sorted(rays),
        is_lines=is_lines,
    )
