"""T, T* and their product over two coordinates, for pictures and as densities: phase and noise, or directions.

The functions u and u* of a pair are of the directions of y = S⁻¹x, see `frame` and `modes`. A person reads those of z:
in the plane z = x. Of more variables z = D⁻¹x: where q̇ = cv and v̇ = −kq + … is an oscillator, D divides v by √(k/c),
with c = 1 the frequency with all others held, so that q² + v²c/k is 2/k times its energy; others stay as they are.
With R = S⁻¹D, a direction e of z and ρ = ‖Re‖,

    T(e) = ρ^p u(Re/ρ),    T*(e) = |det R| ρ^(−n − p) u*(Re/ρ),    T(e) T*(e) = |det R| ρ^(−n) u u*(Re/ρ),

as ‖y‖ = ρ‖z‖, and the surface of the sphere obeys dσ_y = |det R| ρ^(−n) dσ_z. All three depend on the noise, too, over
which those of directions are integrated.

Of four variables in two pairs, e = (cos η (cos θ₁, sin θ₁), sin η (cos θ₂, sin θ₂)): sin²η is the share of the second
pair in ‖z‖². Densities are of η and of θ₁ − θ₂, dσ = cos η sin η dη dθ₁ dθ₂, integrated over θ₂ at a fixed difference.
With a stop for q₁ ≥ 0, z is of the coordinates of the stop, and densities are of η and of θ₁ from π/2, where an impact
leaves it, to −π/2, where the next one finds it, integrated over θ₂.
Of three variables they are of longitude and latitude, per unit of the surface of the sphere, alike at e and −e.

Λ(p) settles long before T* does: it is the coarser one that the search for Λ(p) leaves. So functions of directions are
enriched until two densities in turn differ by little in total variation, which then is the estimated error.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray, Matrix, ReadOnly
from fpsolve.budget import unless_over_budget
from fpsolve.data import Quantity
from fpsolve.drawing import QUARTERS, draw_colours, label_axes
from fpsolve.errors import MeshError, OutputError, SingularMatrix
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.modes import inside_frame
from fpsolve.exponent.stopped import reading_coordinates
from fpsolve.fem.generator import Generator
from fpsolve.fem.noise_axes import Samples
from fpsolve.fem.space import Space
from fpsolve.model.coordinates import mean_matrix
from fpsolve.model.plane import is_driven
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import PHASE

MOST_TILT = 1.5
"""Slope of the tilt in z beyond which rounding leaves nothing of T around the mean of the noise."""
UNRESOLVED = 0.1
"""Share of an eigenfunction with the wrong sign from which on it misleads."""
MOST_NEGATIVE = 0.02
"""Share of a density with the wrong sign from which on it misleads."""
UNITS = {"1/time": "time/rad", "1": "1/rad"}
"""The unit of a density per radian and unit of ξ, by that of ξ."""
NODES = 48, 96, 192
"""Numbers of nodes between the ends of a coordinate of directions; there are twice as many steps around."""
CHUNK = 2**21
"""Numbers of a table of functions and of values of the noise over directions, at most."""
PHASES = 16
"""Half turns of both phases together are looked at from so many; at a stop turns of the second one."""
RESOLVED = 1e-3
"""By how much the integral of the tilted density over the nodes may miss 1."""
LARGEST_CHANGE = 0.02
"""Total variation between two densities in turn from which on the finer one is taken."""
MOST_DIRECTIONS = 3000
"""Largest number of functions of directions that are made for a density alone: seconds of work."""
MOST_UNKNOWNS = 15_000
"""Largest number of unknowns that are made for a density alone."""
SHARES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Shares of the second pair in ‖z‖² at which the axis of η has ticks."""
LATITUDES = np.pi * np.arange(-2, 3) / 4, [r"$-\pi/2$", r"$-\pi/4$", "0", r"$\pi/4$", r"$\pi/2$"]
ONE = np.ones(1)
"""ρ and |det R| ρ^(−n) in the coordinates of the solve, where R = 1."""


class Fields(NamedTuple):
    """Functions at nodes, each of shape (first, second), by their names in files.

    Attributes:
        T: T.
        T_adjoint: T* as a density; at p = 0 the stationary one.
        tilted_density: T T*.
    """

    T: FloatArray
    T_adjoint: FloatArray
    tilted_density: FloatArray


@dataclass(frozen=True, eq=False)
class Grid(ReadOnly):
    """Nodes of two coordinates, and the weights of ∫ f dfirst dsecond: phase and noise, if it is no `DirectionGrid`.

    Attributes:
        quantities: what the coordinates are.
        unit: of densities.
        first, second: the nodes, shapes (a,) and (b,).
        first_weights, second_weights: of the same shapes.
    """

    quantities: tuple[Quantity, Quantity]
    unit: str
    first: FloatArray
    second: FloatArray
    first_weights: FloatArray
    second_weights: FloatArray

    @classmethod
    def of(cls, pair: PrincipalPair) -> Grid:
        """The points of the rule of a pair, on the full circle. Raises `OutputError`."""
        refuse_more(pair)
        problem, axis, at = pair.generator.problem, pair.space.phi, pair.space.xi.samples()
        frame, noise = pair.generator.framed.frame, problem.noise_quantity
        phi = frame.own_phase(np.concatenate([axis.points + k * axis.span for k in range(axis.turns)]))
        weights, phi = np.tile(axis.weights, axis.turns) / frame.density(phi), np.mod(phi, 2 * np.pi)
        order = np.argsort(phi)
        unit = "1/rad" if problem.noise.has_states else UNITS.get(noise.unit, "unknown")
        return Grid((PHASE, noise), unit, phi[order], at.xi, weights[order], at.measure)

    @property
    def coordinates(self) -> dict[Quantity, FloatArray]:
        """The nodes and the weights."""
        words = "weight of the rule for integrals"
        weights = (replace(each, name=f"{each.name}_weights", words=words, latex="") for each in self.quantities)
        values = self.first, self.second, self.first_weights, self.second_weights
        return dict(zip((*self.quantities, *weights), values, strict=True))

    def integral(self, values: FloatArray) -> float:
        """∫ of values at the nodes, shape (a, b)."""
        return float(self.first_weights @ values @ self.second_weights)

    def negative_share(self, values: FloatArray) -> float:
        """∫|ρ| where ρ < 0 over ∫|ρ|."""
        return self.integral(np.maximum(-values, 0.0)) / self.integral(np.abs(values))

    def means(self, density: FloatArray) -> dict[Quantity, float]:
        """What is told of a density."""
        return {}

    def finer(self, pair: PrincipalPair) -> Space | None:
        """Finer functions for the sake of a density; None where there are none."""
        return None

    def fields(self, pair: PrincipalPair) -> Fields:
        """T, and T* and T T* of any size."""
        return plane_fields(pair, self.first, self.first, pair.space.xi.samples())

    def densities(self, pair: PrincipalPair) -> Densities:
        """T, and T* and T T* of the integral 1."""
        right, adjoint, product = self.fields(pair)
        total = self.integral(product)
        fields = Fields(right, adjoint / self.integral(adjoint), product / total)
        return Densities(pair, pair.value, self, fields, abs(total - 1))


@dataclass(frozen=True, eq=False)
class Densities:
    """T, T* and T T* of a pair over two coordinates.

    Attributes:
        pair: the eigenpair.
        value: Λ(p) as it was found before.
        grid: the nodes.
        fields: the functions there.
        missing: by how much ∫ T T* over the nodes misses 1, as long as it was not divided by it.
        error: the larger total variation of T* and of T T* from those of coarser functions; NaN if there are none.
    """

    pair: PrincipalPair
    value: float
    grid: Any
    fields: Fields
    missing: float
    error: float = math.nan

    def on(self, grid: Grid) -> Densities:
        """These at other nodes."""
        if grid.first.size == self.grid.first.size:
            return self
        return replace(grid.densities(self.pair), value=self.value, error=self.error)


def densities(pair: PrincipalPair) -> Densities:
    """Those of a pair; of three or four variables on as fine functions as T* and T T* need.

    Raises:
        OutputError: T of two variables depends on more than φ and ξ.
    """
    found, problem = on_nodes(pair), pair.generator.problem
    with suppress(SingularMatrix, MeshError), unless_over_budget():  # what there is stands, with its error
        while not found.error <= LARGEST_CHANGE and (finer := found.grid.finer(found.pair)):
            new = on_nodes(principal_pair(Generator(problem, finer), pair.p, start=found.pair))
            old = found.on(new.grid)
            _, *changes = (np.abs(after - before) for after, before in zip(new.fields, old.fields, strict=True))
            found = replace(new, value=pair.value, error=0.5 * max(map(new.grid.integral, changes)))
    return found


def on_nodes(pair: PrincipalPair) -> Densities:
    """Those of a pair, of directions on the first grid that resolves T T*, or the finest."""
    problem = pair.generator.problem
    for grid in (direction_grid(problem, count) for count in NODES) if problem.dimension in GRIDS else [Grid.of(pair)]:
        found = grid.densities(pair)
        if found.missing <= RESOLVED:
            break
    return found


def evaluated(
    pair: PrincipalPair, functions: Matrix, at: Samples, length: FloatArray = ONE, surface: FloatArray = ONE
) -> Fields:
    """T, T* and T T* at directions and values of the noise, shape (directions, values).

    Args:
        pair: the eigenpair.
        functions: the values of the functions of directions, as rows.
        at: samples of the functions of the noise.
        length: ρ, shape (directions,).
        surface: |det R| ρ^(−n), of the same shape.
    """
    table = pair.space.phi.size, -1
    right, left = (functions @ each.reshape(table) @ at.values.T for each in (pair.right, pair.left))
    factors, weights = np.outer(length**pair.p, at.factor), np.outer(surface, at.weight)
    return Fields(right * factors, left * weights / factors, right * left * weights)


def plane_fields(pair: PrincipalPair, phi: FloatArray, inside: FloatArray, at: Samples) -> Fields:
    """T, T* and T T* at φ, seen from the cells that hold `inside`, and at samples of the noise.

    T has mean 1 over P_s(ξ)/2π; with a tilt beyond `MOST_TILT`, which leaves T there to rounding, over P_s exp(2s z).
    """
    xi, rule = pair.space.xi, pair.space.xi.samples()
    law = xi.law() * rule.factor if abs(xi.tilt) <= MOST_TILT else xi.rule.measure
    mean = mean_functions(pair) @ pair.space.table(pair.right) @ (law @ rule.values)
    functions, length, surface = phase_functions(pair, phi, inside)
    right, adjoint, product = evaluated(pair, functions, at, length, surface)
    return Fields(right / mean, adjoint * mean, product)


def phase_functions(pair: PrincipalPair, phi: FloatArray, inside: FloatArray) -> tuple[Matrix, FloatArray, FloatArray]:
    """The functions of the phase at φ, seen from the cells that hold `inside`; ρ, and dψ/dφ, see `frame`."""
    axis, frame = pair.space.phi, pair.generator.framed.frame
    psi, cells = frame.phase(phi), frame.phase(inside)
    turned = axis.span * np.floor((cells - axis.lines[0]) / axis.span)
    return axis.at(psi - turned, cells - turned), frame.length(phi), frame.density(phi)


def mean_functions(pair: PrincipalPair) -> FloatArray:
    """The means of ρ^p times the functions of the phase over φ, shape (size,)."""
    axis, frame = pair.space.phi, pair.generator.framed.frame
    psi, weights = axis.finer_rule(frame.parts)
    phi, stretch = own_phases(pair, psi)
    return weights / frame.density(phi) * stretch @ axis.at(psi) / axis.span


def own_phases(pair: PrincipalPair, psi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """φ at ψ, and ρ^p."""
    frame = pair.generator.framed.frame
    phi = frame.own_phase(psi)
    return phi, frame.length(phi) ** pair.p


@dataclass(frozen=True, eq=False)
class DirectionGrid(Grid):
    """Directions of three or four variables.

    Attributes:
        directions: e over the nodes, at m values of an angle that is left out, shape (n, a b m).
        surface: of the sphere for dfirst dsecond, shape (a, b).
        share: sin²η, if there are pairs of variables.
    """

    directions: FloatArray
    surface: FloatArray
    share: Quantity | None = None

    def means(self, density: FloatArray) -> dict[Quantity, float]:
        if self.share is None:
            return {}
        words, latex = f"mean {self.share.words}", r"$E\,\sin^2\eta$"
        mean = replace(self.share, name="mean_share", words=words, latex=latex, dims=())
        return {mean: self.integral(np.sin(self.first)[:, None] ** 2 * density)}

    def finer(self, pair: PrincipalPair) -> Space | None:
        chosen = pair.generator.chosen
        found = chosen.with_axis(0, chosen.phi.enriched())
        return found if found.phi.size <= MOST_DIRECTIONS and found.size <= MOST_UNKNOWNS else None

    def fields(self, pair: PrincipalPair) -> Fields:
        """T as its mean over the noise and the angle, itself of mean 1 over the sphere, or its half at a stop; T* and
        T T* integrated over these."""
        axis, noises, matrix = pair.space.phi, pair.space.noises, direction_map(pair)
        at = Samples(*(reduce(np.kron, each) for each in zip(*(axis.samples() for axis in noises), strict=True)))
        law = reduce(np.kron, [axis.law() for axis in noises])
        found, numbers = [], self.directions.shape[1] * (axis.size + law.size)
        for y in np.array_split(matrix @ self.directions, numbers // CHUNK + 1, axis=1):
            length = np.linalg.norm(y, axis=0)
            surface = abs(np.linalg.det(matrix)) / axis.area * length ** -len(y)
            right, adjoint, product = evaluated(pair, axis.at(y / length), at, length, surface)
            found.append([right @ law, adjoint @ at.measure, product @ at.measure])
        right, adjoint, product = np.concatenate(found, axis=1).reshape(3, *self.surface.shape, -1).mean(axis=-1)
        mean = self.integral(right * self.surface) / self.integral(self.surface)
        return Fields(right / mean, adjoint * self.surface, product * self.surface)

    def draw(self, axes: Any, values: FloatArray, about: Any, **kwargs: Any) -> None:
        """Draw values at the nodes in colours, with ticks at shares, or at parts of a turn."""
        draw_colours(axes, self.first, self.second, values.T, about, **{"shading": "gouraud", **kwargs})
        (first, second), ticks = (each.attributes for each in self.quantities), QUARTERS
        if self.share:
            first = {"long_name": f"{self.share.words}, {self.share.latex} (%)", "units": "1"}
            ticks = np.arcsin(np.sqrt(SHARES)), [f"{100 * each:g}" for each in SHARES]
        axes.set_xticks(*ticks)
        axes.set_yticks(*(LATITUDES if self.second[0] else QUARTERS))
        label_axes(axes, first, second)


def _line(count: int) -> tuple[FloatArray, FloatArray]:
    """The rule of Gauss and Lobatto on [−1, 1]: with both ends, towards which the nodes crowd."""
    last = np.polynomial.Legendre.basis(count - 1)
    x = np.concatenate([[-1.0], last.deriv().roots(), [1.0]])
    return x, 2 / (count * (count - 1) * last(x) ** 2)


def _circle(count: int) -> tuple[FloatArray, FloatArray]:
    """The trapezoidal rule on [0, 2π], with both ends."""
    angles = np.linspace(0, 2 * math.pi, 2 * count + 1)
    weights = np.full(angles.size, math.pi / count)
    weights[[0, -1]] /= 2
    return angles, weights


def _longitude_and_latitude(problem: Problem, count: int) -> DirectionGrid:
    """Of three variables; the weights of the latitude are those of its sine."""
    (x, y, z), (first, turn), (sine, weights) = problem.linear.states, _circle(count), _line(count)
    longitude = Quantity("longitude", "longitude", f"longitude, from {x} towards {y}", "", "rad", ("longitude",))
    latitude = Quantity("latitude", "latitude", f"latitude, towards {z}", "", "rad", ("latitude",))
    nodes, (turned, height) = (first, np.arcsin(sine), turn, weights), np.meshgrid(first, sine, indexing="ij")
    flat = np.sqrt(1 - height**2)
    e = np.stack([flat * np.cos(turned), flat * np.sin(turned), height])
    return DirectionGrid((longitude, latitude), "1/sr", *nodes, e.reshape(3, -1), np.ones(flat.shape))


def _share_and_phase(problem: Problem, count: int) -> DirectionGrid:
    """η and θ₁ − θ₂, at a stop θ₁, of four variables in two pairs."""
    (read, is_half), own = reading_coordinates(problem), oscillators(problem)
    states = read.names(problem.linear.states)
    one, two = (states[k] if k in own else f"({states[k]}, {states[k + 1]})" for k in (0, 2))
    words = f"angle whose squared sine is the share of {two}"
    eta = Quantity("eta", "η", words, r"$\eta$", "rad", ("eta",))
    words = f"share of {two} in the {'energy' if len(own) == 2 else 'sum of squares'}"
    share = Quantity("share", f"share of {two}", words, r"$\sin^2\eta$", dims=("eta",))
    x, weights = (0.25 * math.pi * each for each in _line(count))
    first = x + 0.25 * math.pi
    if is_half:
        phase = Quantity("phase", "θ₁", f"phase of {one} between impacts", r"$\theta_1$", "rad", ("phase",))
        second, second_weights, turn = 2 * x, 2 * weights, 2 * math.pi
    else:
        words, latex = f"phase of {one} less that of {two}", r"$\theta_1 - \theta_2$"
        phase = Quantity("phase_difference", "θ₁ − θ₂", words, latex, "rad", ("phase_difference",))
        (second, second_weights), turn = _circle(count), math.pi
    at, theta, other = np.meshgrid(first, second, turn * np.arange(PHASES) / PHASES, indexing="ij")
    theta, c, s = theta if is_half else theta + other, np.cos(at), np.sin(at)
    e = np.stack([c * np.cos(theta), c * np.sin(theta), s * np.cos(other), s * np.sin(other)])
    nodes, surface = (first, second, weights, second_weights), 2 * math.pi * (c * s)[..., 0]
    return DirectionGrid((eta, phase), "1/rad^2", *nodes, e.reshape(4, -1), surface, share)


GRIDS = {3: _longitude_and_latitude, 4: _share_and_phase}
"""Grids of directions by the number of variables."""


def direction_grid(problem: Problem, count: int) -> DirectionGrid:
    """One of `count` nodes between the ends of a coordinate, and twice as many steps around."""
    return GRIDS[problem.dimension](problem, count)


def oscillators(problem: Problem) -> dict[int, float]:
    """√(k/c) of each oscillator q̇ = cv, v̇ = −kq + …, by the place of q among the variables; pairs begin at 0 and 2."""
    system, (at, _) = problem.linear, reading_coordinates(problem)
    free = at.inside(mean_matrix(problem, system))
    driven = 0.0 * free
    for term in system.terms:
        driven += is_driven(term.g) * system.epsilon**term.order * abs(at.inside(term.matrix))
    found = {}
    for q in range(0, problem.dimension - 1, 2):
        is_rate = not np.any(np.delete(free[q], q + 1)) and not np.any(driven[q])
        if is_rate and -free[q + 1, q] * free[q, q + 1] > 0:
            found[q] = math.sqrt(-free[q + 1, q] / free[q, q + 1])
    return found


def direction_map(pair: PrincipalPair) -> FloatArray:
    """R = S⁻¹D, which takes z to y."""
    problem = pair.generator.problem
    scales = np.ones(problem.dimension)
    for q, size in oscillators(problem).items():
        scales[q + 1] = size
    at, _ = reading_coordinates(problem)
    inside = inside_frame(problem, np.linalg.inv(np.array(at.coordinates)))
    return np.linalg.solve(pair.space.phi.coordinates, inside) * scales


def xi_marginal(pair: PrincipalPair, at: Samples) -> FloatArray:
    """∫ T T* dφ over the mesh at points of ξ, shape (n,)."""
    phi = pair.space.phi
    return phi.weights @ evaluated(pair, phi.values, at).tilted_density


def refuse_more(pair: PrincipalPair) -> None:
    """Raises `OutputError` where T depends on more than φ and ξ."""
    method = choose(pair.generator.problem)
    if not method.pictures.is_seen:
        why = f"T of {method.problem.dimension} variables is no function of phase and noise"
        raise OutputError(
            f"{why}; use `draw_eigenfunction`, `tilted_density`, or a case, whose run writes files for ParaView"
        )
    if method.no_picture:
        raise OutputError(method.no_picture)
