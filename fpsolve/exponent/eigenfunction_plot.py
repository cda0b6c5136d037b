"""The eigenfunctions of a pair as pictures."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Literal

from fpsolve.exponent.nodes import Nodes
from fpsolve.model.problem import parameter_lines
from fpsolve.model.quantity import PHASE, Quantity, density_unit
from fpsolve.surfaces import Picture, Surface, can_render, flat_picture, picture_in_space

if TYPE_CHECKING:
    from fpsolve.exponent.eigen import PrincipalPair

FINER = 2
"""So many times as many nodes either way as a file for ParaView has; there they carry polynomials."""
Field = Literal["T", "T_adjoint", "tilted_density"]
FIELDS = {
    "T": ("right", Quantity("T", "T", "eigenfunction", "$T$")),
    "T_adjoint": ("adjoint", Quantity("T_adjoint", "T*", "adjoint eigenfunction", "$T^*$")),
    "tilted_density": ("product", Quantity("tilted_density", "T T*", "tilted density", r"$T\,T^*$")),
}
"""By the names that they have in files for ParaView: those among `Fields`, and what they are."""


class EigenfunctionPlot:
    """A mixin of a `PrincipalPair`."""

    def plot(self, field: Field = "T", *, cylinder: bool = False, cmap: str = "viridis") -> Picture:
        """Draw an eigenfunction, or the tilted density, over phase and noise.

        In space by pyvista where this machine can render, which takes some seconds to find out the first time; else in
        the plane by matplotlib.

        Args:
            field: "T", "T_adjoint", or their product "tilted_density".
            cylinder: whether φ goes around a cylinder; only where this machine can render.
            cmap: the colours, by matplotlib's names.

        Raises:
            ValueError: there is no such field.
            OutputError: the noise has states.
        """
        surface = surface_of(self, field)  # type: ignore[arg-type]
        if can_render():
            return picture_in_space(surface, cmap, cylinder=cylinder)
        if cylinder:
            warnings.warn(
                "nothing can be rendered here, so that the plane is drawn; for a cylinder install OpenGL, as by "
                "apt-get install libegl1 libgl1-mesa-dri",
                stacklevel=2,
            )
        return flat_picture(surface, cmap)


def surface_of(pair: PrincipalPair, field: str) -> Surface:
    """A function of a pair where it is not negligible, with its words. Raises `ValueError`, `OutputError`."""
    if field not in FIELDS:
        raise ValueError(f"got field = {field!r}; must be one of {', '.join(map(repr, FIELDS))}")
    (name, quantity), problem = FIELDS[field], pair.generator.problem
    nodes, noise = Nodes.of(pair, FINER).seen(pair), problem.noise_quantity
    unit = quantity.unit if name == "right" else density_unit(noise)
    about = {"phi": PHASE.attributes, "xi": noise.attributes, "values": {**quantity.attributes, "units": unit}}
    rays = {(jump.phase + turn) % (2 * math.pi) for jump in problem.system.jumps for turn in (0, math.pi)}
    return Surface(
        phi=nodes.phi,
        xi=nodes.unit * nodes.z,
        values=getattr(nodes.fields(pair), name),
        about=about,
        name=quantity.symbol,
        title=f"p = {pair.p:g}, Λ(p) = {round(pair.value, 14) + 0.0:.6g} (1/time)",
        lines=parameter_lines(problem.parameters),
        impacts=sorted(rays),
    )
