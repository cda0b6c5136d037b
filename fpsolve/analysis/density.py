"""Probability densities of phase and noise, or of directions: stationary, adjoint and tilted, and their means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, require
from fpsolve.data import Parameters, Quantity, Result, dataset
from fpsolve.drawing import MOST_LINES, QUARTERS, draw_line, draw_plane
from fpsolve.errors import NotConverged
from fpsolve.exponent.density import MOST_NEGATIVE, DirectionGrid, Grid, densities
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.messages import Code, Message, Remedy

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

UNSEEN = 1e-5
"""Where the density of ξ is below this share of its largest value, no picture shows it."""

PAIR = "a PrincipalPair, such as ExponentSolver(problem).pair(2.0)"


@dataclass(frozen=True, eq=False, repr=False)
class GridDensity(Result):
    """A probability density at the nodes of a grid.

    Attributes:
        grid: the nodes of both coordinates, and the weights for integrals.
        values: the density, shape (first, second).
        name: what it is a density of, and at which p.
        parameters: of the problem, by keys such as "noise.D0".
        error: ½∫ of the difference from coarser functions, which is the estimated error; NaN where there are none.
    """

    grid: Grid
    values: FloatArray
    name: str
    parameters: Parameters
    error: float

    def to_xarray(self) -> xarray.Dataset:
        """The density over its coordinates, the weights for integrals, and of four variables the mean share."""
        dims = tuple(each.name for each in self.grid.quantities)
        density = Quantity("density", "ρ", "density", unit=self.grid.unit, dims=dims)
        numbers: dict[Quantity, ArrayLike] = {density: self.values, **self.grid.means(self.values)}
        return dataset(self.name, "finite elements", numbers, self.grid.coordinates, self.parameters)

    def mean(self, f: Callable[[FloatArray, FloatArray], ArrayLike]) -> float:
        """∫ f ρ; f gets the first coordinate as a column and the second as a row, and may return either or a number."""
        return self.grid.integral(np.asarray(f(self.grid.first[:, None], self.grid.second[None])) * self.values)

    def negative_share(self) -> float:
        """∫|ρ| where ρ < 0 over ∫|ρ|."""
        return self.grid.negative_share(self.values)


class Density(GridDensity):
    """A probability density of phase and noise on the full circle, known at the points of a quadrature rule.

    ∫f dφ dξ = phi_weights @ f @ xi_weights; it is per radian and unit of ξ, or per radian where the noise has states.
    """

    @property
    def phi(self) -> FloatArray:
        """Points on the full circle, from 0 to 2π, shape (m,), increasing."""
        return self.grid.first

    @property
    def xi(self) -> FloatArray:
        """Points on the noise axis, shape (n,), increasing."""
        return self.grid.second

    @property
    def phi_weights(self) -> FloatArray:
        """Weights of the rule, shape (m,)."""
        return self.grid.first_weights

    @property
    def xi_weights(self) -> FloatArray:
        """Weights of the rule, shape (n,)."""
        return self.grid.second_weights

    def phi_marginal(self) -> FloatArray:
        """∫ρ dξ at `phi`, shape (m,)."""
        return self.values @ self.xi_weights

    def xi_marginal(self) -> FloatArray:
        """∫ρ dφ at `xi`, shape (n,)."""
        return self.phi_weights @ self.values

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        if self.grid.unit == "1/rad":  # a density of the phase at each state of the noise
            for k, xi in enumerate(self.xi):
                draw_line(axes, found.density[:, k], None, **{"label": rf"$\xi$ = {xi:g}", **kwargs})
            axes.set(ylim=(0, None))
            if 1 < self.xi.size <= MOST_LINES:
                axes.legend()
        else:
            seen = self.xi[self.xi_marginal() > UNSEEN * self.xi_marginal().max()]
            even = {"phi": np.linspace(0, 2 * np.pi, 721), "xi": np.linspace(seen[0], seen[-1], 401)}
            draw_plane(axes, found.density.interp(even, kwargs={"fill_value": "extrapolate"}), **kwargs)
            axes.set(ylim=(seen[0], seen[-1]))
        axes.set_xticks(*QUARTERS)
        axes.set(xlim=(0, 2 * np.pi))

    def _said(self) -> str:
        return f"{self.name}, on {self.phi.size} x {self.xi.size} points"


class DirectionDensity(GridDensity):
    """A probability density of the directions of three or four variables, integrated over the noise.

    Of four variables it is of η and θ₁ − θ₂, where (cos η (cos θ₁, sin θ₁), sin η (cos θ₂, sin θ₂)) is the direction of
    the variables, each rate of an oscillator divided by its frequency: sin²η is the share of the second pair in the
    energy. θ = atan2(q̇/ω, q) falls in time, so that θ₁ − θ₂ > 0 is a lead of the second one; with a stop it is of η and
    θ₁, on the half sphere that the stop leaves. Of three variables it is
    of longitude and latitude, per unit of the surface of the unit sphere, alike at opposite directions.
    """

    grid: DirectionGrid

    def to_xarray(self) -> xarray.Dataset:
        return super().to_xarray().assign_attrs(total_variation_error=self.error)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        self.grid.draw(axes, self.values, found.density.attrs, **{"vmin": 0.0, **kwargs})

    def _said(self) -> str:
        means = (f", mean {each.symbol} {value:.2%}" for each, value in self.grid.means(self.values).items())
        return f"{self.name}, ± {self.error:.1%}{''.join(means)}"


OF_GRIDS: dict[type[Grid], type[Density | DirectionDensity]] = {Grid: Density, DirectionGrid: DirectionDensity}


def stationary_density(pair: PrincipalPair) -> Density | DirectionDensity:
    """ρ(φ, ξ), solution of the Fokker-Planck equation L*(0)ρ = 0; of more than two variables that of directions.

    >>> stationary_density(ExponentSolver(problem).pair(0.0))
    Density(stationary density at p = 0, on ... points)

    Raises:
        NotConverged: too much of it is negative; `partial` is what was found.
        ValueError: the pair is not the one at p = 0.
    """
    require(pair, PrincipalPair, "pair", PAIR)
    if pair.p:
        raise ValueError(f"the stationary density is T* at p = 0, but the pair has p = {pair.p:g}")
    return _density(pair, "stationary")


def adjoint_density(pair: PrincipalPair) -> Density | DirectionDensity:
    """T*(φ, ξ; p) normalised to 1, or that of directions. Raises `NotConverged` where too much of it is negative."""
    return _density(pair, "adjoint")


def tilted_density(pair: PrincipalPair) -> Density | DirectionDensity:
    """T T*: how phase and noise, or directions, are distributed along the paths that carry the p-th moment.

    >>> tilted_density(ExponentSolver(problem).pair(2.0))
    Density(tilted density at p = 2, on ... points)

    Raises:
        NotConverged: too much of it is negative; `partial` is what was found.
    """
    return _density(pair, "tilted")


def _density(pair: PrincipalPair, kind: Literal["stationary", "adjoint", "tilted"]) -> Density | DirectionDensity:
    """One of the `densities`, if it is one. Raises `NotConverged`."""
    require(pair, PrincipalPair, "pair", PAIR)
    found, problem, name = densities(pair), pair.generator.problem, f"{kind} density"
    values = found.fields.tilted_density if kind == "tilted" else found.fields.T_adjoint
    density = OF_GRIDS[type(found.grid)](
        found.grid, values, f"{name} at p = {pair.p:g}", dict(problem.values), found.error
    )
    if (share := density.negative_share()) > MOST_NEGATIVE:
        raise NotConverged(Message(Code.NEGATIVE_DENSITY, name=name, p=pair.p, size=share), density, Remedy.CELLS)
    return density
