"""Probability densities of (φ, ξ) on the full circle: stationary, adjoint and tilted, and their means."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.analysis.directions import DirectionDensity, settled_directions
from fpsolve.arrays import FloatArray, one
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import MOST_LINES, QUARTERS, add_legend, coloured, draw_plane, label_axes
from fpsolve.errors import NotConverged
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import MOST_NEGATIVE, fields
from fpsolve.fem.mesh import vertices_at
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.plane import growth_rate
from fpsolve.model.quantity import NOISE, PHASE, density_unit

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

UNSEEN = 1e-5
"""Where the density of ξ is below this share of its largest value, no picture shows it."""


@dataclass(frozen=True, eq=False, repr=False)
class Density(Result):
    """A probability density on the cylinder, known at the points of a quadrature rule.

    Attributes:
        phi: points on the full circle, from 0 to 2π, shape (m,), increasing.
        xi: points on the noise axis, shape (n,), increasing.
        phi_weights, xi_weights: weights of the rule, so that ∫f dφ dξ = phi_weights @ f @ xi_weights.
        values: the density, per radian and unit of ξ, shape (m, n).
        name: what it is a density of, and at which p.
        noise: what ξ is, with its unit.
        parameters: of the problem, by keys such as "noise.D0".
        has_states: whether the noise has these ξ alone; the density is then per radian.
    """

    phi: FloatArray
    xi: FloatArray
    phi_weights: FloatArray
    xi_weights: FloatArray
    values: FloatArray
    name: str = "density of phase and noise"
    noise: Quantity = NOISE
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    has_states: bool = False

    def to_xarray(self) -> xarray.Dataset:
        """The density over φ and ξ, and the weights for integrals."""
        unit = "1/rad" if self.has_states else density_unit(self.noise)
        density = Quantity("density", "ρ", "density", unit=unit, dims=("phi", "xi"))
        coordinates = {PHASE: self.phi, self.noise: self.xi}
        for axis, weights in ((PHASE, self.phi_weights), (self.noise, self.xi_weights)):
            words = "weight of the rule for integrals"
            coordinates[Quantity(f"{axis.name}_weights", "w", words, unit=axis.unit, dims=axis.dims)] = weights
        return dataset(self.name, "finite elements", {density: self.values}, coordinates, self.parameters)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        axes.set_xticks(*QUARTERS)
        if self.has_states:
            for xi, values in zip(self.xi, self.values.T, strict=True):
                axes.plot(self.phi, values, **{"linewidth": 1.6, "label": rf"$\xi$ = {xi:g}", **coloured(axes, kwargs)})
            axes.set(xlim=(0, 2 * np.pi), ylim=(0, None))
            label_axes(axes, found.phi.attrs, found.density.attrs)
            if 1 < self.xi.size <= MOST_LINES:
                add_legend(axes)
            return
        seen = self.xi[self.xi_marginal() > UNSEEN * self.xi_marginal().max()]
        even = {"phi": np.linspace(0, 2 * np.pi, 721), "xi": np.linspace(seen.min(), seen.max(), 401)}
        shown = found.density.interp(even, kwargs={"fill_value": "extrapolate"})
        draw_plane(axes, shown, **kwargs)
        axes.set_xticks(*QUARTERS)
        axes.set(xlim=(0, 2 * np.pi), ylim=(seen.min(), seen.max()))

    def _said(self) -> str:
        return f"{self.name}, on {self.phi.size} x {self.xi.size} points"

    def mean(self, f: Callable[[FloatArray, FloatArray], ArrayLike]) -> float:
        """∫ f(φ, ξ) ρ dφ dξ; f gets φ as a column and ξ as a row, and may return either, or a number."""
        values = np.asarray(f(self.phi[:, None], self.xi[None])) * self.values
        return float(self.phi_weights @ values @ self.xi_weights)

    def phi_marginal(self) -> FloatArray:
        """∫ρ dξ at `phi`, shape (m,)."""
        return self.values @ self.xi_weights

    def negative_share(self) -> float:
        """∫|ρ| where ρ < 0 over ∫|ρ|."""
        sizes = self.phi_weights[:, None] * np.abs(self.values) * self.xi_weights
        return float(np.sum(sizes[self.values < 0]) / np.sum(sizes))

    def xi_marginal(self) -> FloatArray:
        """∫ρ dφ at `xi`, shape (n,)."""
        return self.phi_weights @ self.values


def stationary_density(pair: PrincipalPair) -> Density | DirectionDensity:
    """ρ(φ, ξ), solution of the Fokker-Planck equation L*(0)ρ = 0; of more than two variables that of directions.

    >>> stationary_density(ExponentSolver(problem).pair(0.0))
    Density(stationary density at p = 0, on ... points)

    Raises:
        NotConverged: too much of it is negative; `partial` is what was found.
        ValueError: the pair is not the one at p = 0.
    """
    return _checked(pair, _density(_of_zero(pair), "adjoint"), "stationary density")


def adjoint_density(pair: PrincipalPair) -> Density | DirectionDensity:
    """T*(φ, ξ; p) normalised to 1, or that of directions. Raises `NotConverged` where too much of it is negative."""
    return _checked(pair, _density(pair, "adjoint"), "adjoint density")


def tilted_density(pair: PrincipalPair) -> Density | DirectionDensity:
    """T T*: how phase and noise, or directions, are distributed along the paths that carry the p-th moment.

    >>> tilted_density(ExponentSolver(problem).pair(2.0))
    Density(tilted density at p = 2, on ... points)

    Raises:
        NotConverged: too much of it is negative; `partial` is what was found.
    """
    return _checked(pair, _density(pair, "product"), "tilted density")


def negative_share(pair: PrincipalPair) -> float:
    """How much of T T* is negative, by ∫|T T*|."""
    return _density(pair, "product").negative_share()


def furstenberg_khasminskii(pair: PrincipalPair) -> float:
    """λ = ∫(ε q₁ξ + ε² q₂) ρ dφ dξ + ω ln R ∫[ρ(π/2, ξ) + ρ(3π/2, ξ)] dξ, with ρ from the pair at p = 0.

    ω ρ, in other systems |dφ/dt| ρ, is the probability flux through an impact, where the log-amplitude jumps by ln R;
    it is taken on the side from where the impact is met.

    Raises:
        ValueError: the pair is not the one at p = 0, several noises have values, or there are more than two variables.
    """
    if pair.generator.problem.dimension > 2:
        raise ValueError("the formula is for two variables, but there are more; use lyapunov_exponent")
    if len(pair.generator.problem.coloured.parts) > 1:
        raise ValueError("the formula is for one noise that is not white, but there are several; use lyapunov_exponent")
    space, problem, at = _of_zero(pair).space, pair.generator.problem, pair.space.xi.samples()
    system, phi = problem.motion, space.phi.points[:, None]
    rate = growth_rate(system, at.xi)(phi)
    for each in problem.diffusions:  # ½ h q′, by which q ∘ dW has a mean
        rate = rate + 0.5 * system.epsilon ** (2 * each.order) * each.h(phi) * each.q.slope(phi)
    for struck in problem.impulses:
        rate = rate + struck.rate * np.log(struck.stretched(phi)[0])
    density = space.evaluate(pair.left, space.phi.values, at.values) * at.weight / at.factor
    growth = space.turns * float(space.phi.weights @ (rate * density) @ at.measure)
    table = space.table(pair.left)
    for jump, speed in zip(system.jumps, problem.wall_speeds(system), strict=True):
        vertices = vertices_at(space.phi.lines, jump.phase)
        density = np.sum((space.phi.left_trace if speed > 0 else space.phi.right_trace)[vertices] @ table, axis=0)
        passages = abs(speed) * float(density @ (space.xi.matrix(one) @ space.xi.constant))
        growth += space.turns * jump.log_factor * passages
    return growth


def _of_zero(pair: PrincipalPair) -> PrincipalPair:
    """The pair, which must be that at p = 0. Raises `ValueError`."""
    if pair.p == 0:
        return pair
    raise ValueError(f"the stationary density is the adjoint eigenfunction at p = 0, but the pair has p = {pair.p:g}")


def _checked(pair: PrincipalPair, density: Density | DirectionDensity, name: str) -> Density | DirectionDensity:
    """The density, if it is one. Raises `NotConverged`."""
    share = density.negative_share()
    if share > MOST_NEGATIVE:
        raise NotConverged(Message(Code.NEGATIVE_DENSITY, name=name, p=pair.p, size=share), density, Remedy.CELLS)
    return density


def _density(pair: PrincipalPair, name: Literal["adjoint", "product"]) -> Density | DirectionDensity:
    """One of the `Fields`, normalised, repeated from a half circle to the full one; or that of directions."""
    words = "tilted" if name == "product" else "adjoint" if pair.p else "stationary"
    title = f"{words} density at p = {pair.p:g}"
    if pair.generator.problem.dimension > 2:
        found = settled_directions(pair)
        values = getattr(found.fields, name)
        return DirectionDensity(found.fields.grid, values, found.error, title, pair.generator.problem.values)
    space, at, turns, frame = pair.space, pair.space.xi.samples(), pair.space.turns, pair.generator.problem.frame
    points, weights = space.phi.points, space.phi.weights
    if frame is not None:
        points = frame.own_phase(points)
        weights = weights / frame.density(points)
    values = np.tile(getattr(fields(pair, points, space.phi.values, at), name), (turns, 1))
    phi = np.mod(np.concatenate([points + k * space.phi.span for k in range(turns)]), 2 * np.pi)
    order = np.argsort(phi)
    phi, values, phi_weights = phi[order], values[order], np.tile(weights, turns)[order]
    total, problem = phi_weights @ values @ at.measure, pair.generator.problem
    about = title, problem.noise_quantity, problem.values, problem.noise.has_states
    return Density(phi, at.xi, phi_weights, at.measure, values / total, *about)
