"""Densities of the directions of three and four variables, on functions of directions that are fine enough for the eye.

Λ(p) settles long before T* does: it is the coarser one that the search for Λ(p) leaves. So the functions of a pair are
enriched until two densities in turn differ by little in total variation, which then is the estimated error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.budget import unless_over_budget
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import QUARTERS, draw_colours, label_axes
from fpsolve.errors import MeshError, SingularMatrix
from fpsolve.exponent.directions import DirectionFields, DirectionGrid, Directions
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.fem.generator import Generator

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

SETTLED = 0.02
"""Total variation between two densities in turn from which on the finer one is taken."""
MOST_DIRECTIONS = 3000
"""Largest number of functions of directions that are made for a density alone: seconds of work."""
MOST_UNKNOWNS = 15_000
"""Largest number of unknowns that are made for a density alone."""
SHARES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Shares of the second pair in ‖z‖² at which the axis of η has ticks."""
LATITUDES = np.pi * np.arange(-2, 3) / 4, [r"$-\pi/2$", r"$-\pi/4$", "0", r"$\pi/4$", r"$\pi/2$"]
DENSITY = Quantity("density", "ρ", "density")


@dataclass(frozen=True, eq=False)
class SettledDirections:
    """T, T* and T T* over directions on the finest functions that were looked at.

    Attributes:
        value: Λ(p) as it was found before.
        pair: the eigenpair on these.
        fields: what it has over directions.
        error: the larger total variation of T* and of T T* from those of the functions before; NaN if there are none.
    """

    value: float
    pair: PrincipalPair
    fields: DirectionFields
    error: float

    def on(self, grid: DirectionGrid) -> SettledDirections:
        """These fields at other nodes."""
        if grid.first.size == self.fields.grid.first.size:
            return self
        return replace(self, fields=Directions(self.pair).on(grid))


def settled_directions(pair: PrincipalPair) -> SettledDirections:
    """Those of a pair of three or four variables, on as fine functions as its T* needs."""
    found = SettledDirections(pair.value, pair, Directions(pair).fields, math.nan)
    while not found.error <= SETTLED:
        generator = found.pair.generator
        finer = generator.chosen.with_axis(0, generator.chosen.phi.enriched())
        if finer.phi.size > MOST_DIRECTIONS or finer.size > MOST_UNKNOWNS:
            return found
        new = None
        with suppress(SingularMatrix, MeshError), unless_over_budget():
            new = principal_pair(Generator(generator.problem, finer), pair.p, start=found.pair)
        if new is None:  # what there is stands, with its error
            return found
        fields = Directions(new).fields
        before = found.on(fields.grid).fields
        error = max(_variation(fields, before, name) for name in ("adjoint", "product"))
        found = SettledDirections(pair.value, new, fields, error)
    return found


def _variation(new: DirectionFields, old: DirectionFields, name: str) -> float:
    """½ ∫ |ρ − ρ₀|."""
    return 0.5 * new.grid.integral(np.abs(getattr(new, name) - getattr(old, name)))


@dataclass(frozen=True, eq=False, repr=False)
class DirectionDensity(Result):
    """A probability density of the directions of three or four variables, integrated over the noise.

    Of four variables it is of η and θ₁ − θ₂, where (cos η (cos θ₁, sin θ₁), sin η (cos θ₂, sin θ₂)) is the direction of
    the variables, each rate of an oscillator divided by its frequency: sin²η is the share of the second pair in the
    energy. θ = atan2(q̇/ω, q) falls in time, so that θ₁ − θ₂ > 0 is a lead of the second one; with a stop it is of η and
    θ₁, on the half sphere that the stop leaves. Of three variables it is
    of longitude and latitude, per unit of the surface of the unit sphere, alike at opposite directions.

    Attributes:
        grid: the nodes and the weights for integrals.
        values: the density, shape (first, second).
        error: ½∫ of the difference from coarser functions, which is the estimated error; NaN where there are none.
        name: what it is a density of, and at which p.
        parameters: of the problem, by keys such as "noise.alpha".
    """

    grid: DirectionGrid
    values: FloatArray
    error: float
    name: str = "density of directions"
    parameters: Mapping[str, float | str] = field(default_factory=dict)

    def to_xarray(self) -> xarray.Dataset:
        """The density over its two coordinates, the weights for integrals, and of four variables the mean share."""
        density = self._density
        numbers: dict[Quantity, Any] = {density: self.values}
        if self.grid.dimension == 4:
            numbers[mean_share(self.grid)] = self.grid.share(self.values)
        more = {"total_variation_error": self.error}
        return dataset(self.name, "finite elements", numbers, coordinates_of(self.grid), self.parameters, **more)

    @property
    def _density(self) -> Quantity:
        dims = tuple(each.name for each in self.grid.quantities)
        return replace(DENSITY, words=self.name, unit=self.grid.unit, dims=dims)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        about = replace(self._density, words="density").attributes
        draw_over(self.grid, axes, self.values, about, **{"vmin": 0.0, **kwargs})

    def _said(self) -> str:
        share = f", mean share of {self.grid.names[1]} {self.grid.share(self.values):.2%}"
        return f"{self.name}, ± {self.error:.1%}{share if self.grid.dimension == 4 else ''}"

    def mean(self, f: Callable[[FloatArray, FloatArray], ArrayLike]) -> float:
        """∫ f ρ; f gets the first coordinate as a column and the second as a row."""
        values = np.asarray(f(self.grid.first[:, None], self.grid.second[None]))
        return self.grid.integral(values * self.values)

    def negative_share(self) -> float:
        """∫|ρ| where ρ < 0 over ∫|ρ|."""
        return negative_part(self.grid, self.values)


def negative_part(grid: DirectionGrid, values: FloatArray) -> float:
    """∫|ρ| where ρ < 0 over ∫|ρ|."""
    return grid.integral(np.maximum(-values, 0.0)) / grid.integral(np.abs(values))


def mean_share(grid: DirectionGrid) -> Quantity:
    """The mean of sin²η."""
    return Quantity("mean_share", "E sin²η", f"mean share of {grid.names[1]} in the {grid.what}", r"$E\,\sin^2\eta$")


def coordinates_of(grid: DirectionGrid) -> dict[Quantity, FloatArray]:
    """The nodes and the weights for integrals."""
    found = dict[Quantity, FloatArray]()
    weights = grid.first_weights, grid.second_weights
    for axis, nodes, own in zip(grid.quantities, (grid.first, grid.second), weights, strict=True):
        unit = "1" if axis.name == "latitude" else axis.unit
        words = "weight of the rule for integrals"
        found |= {axis: nodes, Quantity(f"{axis.name}_weights", "w", words, unit=unit, dims=axis.dims): own}
    return found


def draw_over(grid: DirectionGrid, axes: Any, values: FloatArray, about: Any, **kwargs: Any) -> None:
    """Values at the nodes in colours, with ticks at shares of the second pair, or of a turn."""
    first, second = grid.quantities
    draw_colours(axes, grid.first, grid.second, values.T, about, **{"shading": "gouraud", **kwargs})
    if grid.dimension == 4:
        axes.set_xticks(np.arcsin(np.sqrt(SHARES)), [f"{100 * share:g}" for share in SHARES])
        axes.set_yticks(*(LATITUDES if grid.has_stop else QUARTERS))
        words = f"share of {grid.names[1]} in the {grid.what}, $\\sin^2\\eta$ (%)"
        label_axes(axes, {"long_name": words, "units": "1"}, second.attributes)
    else:
        axes.set_xticks(*QUARTERS)
        axes.set_yticks(*LATITUDES)
        label_axes(axes, first.attributes, second.attributes)
