"""T, T* and their product over the directions of three and four variables, in the user's coordinates.

The functions u and u* of a pair are of the directions of y = S⁻¹x, see `modes`. A person reads those of z = D⁻¹x: where
q̇ = cv and v̇ = −kq + … is an oscillator, D divides v by √(k/c), with c = 1 the frequency with all others held, so that
q² + v²c/k is 2/k times its energy; other variables stay as they are. With R = S⁻¹D, a direction e of z and ρ = ‖Re‖,

    T(e) = ρ^p u(Re/ρ),    T*(e) = |det R| ρ^(−n − p) u*(Re/ρ),    T(e) T*(e) = |det R| ρ^(−n) u u*(Re/ρ),

as ‖y‖ = ρ‖z‖, and the surface of the sphere obeys dσ_y = |det R| ρ^(−n) dσ_z. All three are integrated over the noise.

Of four variables in two pairs, e = (cos η (cos θ₁, sin θ₁), sin η (cos θ₂, sin θ₂)): sin²η is the share of the second
pair in ‖z‖². Densities are of η and of θ₁ − θ₂, dσ = cos η sin η dη dθ₁ dθ₂, integrated over θ₂ at a fixed difference.
With a stop for q₁ ≥ 0, z is of the coordinates of the stop, and densities are of η and of θ₁ from π/2, where an impact
leaves it, to −π/2, where the next one finds it, integrated over θ₂.
Of three variables they are of longitude and latitude, per unit of the surface of the sphere, alike at e and −e.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from fpsolve.arrays import FloatArray, one
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.fem.axis import along
from fpsolve.model.plane import is_driven
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import Quantity

FEWEST_NODES = 48
"""Number of nodes of the first coordinate to begin with; the second has twice as many."""
MOST_NODES = 192
"""Largest number of nodes of the first coordinate, where the tilted density is not resolved with fewer."""
PHASES = 16
"""Half turns of both phases together are looked at from so many; at a stop turns of the second one."""
RESOLVED = 1e-3
"""By how much the integral of the tilted density over the nodes may miss 1."""
CHUNK = 2**23
"""Numbers of a table of functions at points, at most."""


def oscillators(problem: Problem) -> dict[int, float]:
    """√(k/c) of each oscillator q̇ = cv, v̇ = −kq + …, by the place of q among the variables; pairs begin at 0 and 2."""
    system, n, stop = problem.system, problem.dimension, problem.system.stop
    free, driven = np.zeros((n, n)), np.zeros((n, n))
    for term in system.terms:
        size = system.epsilon**term.order * (stop.inside(term.matrix) if stop else np.array(term.matrix))
        mean = problem.named_noise(term.noise).mean_of(term.g)
        free += mean * size
        driven += abs(size) * is_driven(term.g)
    found = {}
    for q in range(0, n - 1, 2):
        others = np.arange(n) != q + 1
        is_rate = not (np.any(free[q, others]) or np.any(driven[q]))
        if is_rate and -free[q + 1, q] * free[q, q + 1] > 0:
            found[q] = math.sqrt(-free[q + 1, q] / free[q, q + 1])
    return found


def pair_names(problem: Problem) -> tuple[str, str]:
    """What the two pairs of four variables are called: the names of q, or of both variables."""
    states, own, stop = problem.system.states, oscillators(problem), problem.system.stop
    states = stop.names(states) if stop else states
    first, second = (states[k] if k in own else f"({states[k]}, {states[k + 1]})" for k in (0, 2))
    return first, second


@dataclass(frozen=True, eq=False)
class DirectionGrid:
    """Nodes of the two coordinates in which directions are shown, with the weights of ∫ f dfirst dsecond.

    Of three variables the weights of the latitude are those of its sine, as densities are per unit of the surface.

    Attributes:
        dimension: n.
        names: of the pairs of four variables, of the three variables.
        first, second: η and θ₁ − θ₂ on [0, 2π], or longitude on [0, 2π] and latitude, shapes (a,) and (b,).
        first_weights, second_weights: of the same shapes.
        has_stop: whether `second` is θ₁ on [−π/2, π/2].
    """

    dimension: int
    names: tuple[str, ...]
    first: FloatArray
    second: FloatArray
    first_weights: FloatArray
    second_weights: FloatArray
    has_stop: bool = False

    @classmethod
    def of(cls, problem: Problem, count: int) -> DirectionGrid:
        """One of `count` nodes between the ends, and twice as many steps around."""
        from scipy.special import roots_jacobi  # which takes long to import

        inner, _ = roots_jacobi(count - 2, 1.0, 1.0)  # of Gauss and Lobatto: with both ends, towards which they crowd
        x = np.concatenate([[-1.0], inner, [1.0]])
        last = np.polynomial.legendre.legval(x, np.eye(count)[-1])
        weights = 2 / (count * (count - 1) * last**2)
        around = np.linspace(0, 2 * math.pi, 2 * count + 1)
        of_around = np.full(around.size, math.pi / count)
        of_around[[0, -1]] /= 2
        if problem.dimension == 4:
            line, has_stop = 0.25 * math.pi * (1 + x), problem.system.stop is not None
            second = (0.5 * math.pi * x, 0.5 * math.pi * weights) if has_stop else (around, of_around)
            return cls(4, pair_names(problem), line, second[0], 0.25 * math.pi * weights, second[1], has_stop)
        return cls(3, tuple(problem.system.states), around, np.arcsin(x), of_around, weights)

    @property
    def quantities(self) -> tuple[Quantity, Quantity]:
        """What the coordinates are."""
        if self.dimension == 4:
            one, two = self.names
            share = Quantity("eta", "η", f"angle whose squared sine is the share of {two}", r"$\eta$", "rad", ("eta",))
            if self.has_stop:
                return share, Quantity(
                    "phase", "θ₁", f"phase of {one} between impacts", r"$\theta_1$", "rad", ("phase",)
                )
            words = f"phase of {one} less that of {two}"
            signs = "θ₁ − θ₂", r"$\theta_1 - \theta_2$"
            return share, Quantity("phase_difference", signs[0], words, signs[1], "rad", ("phase_difference",))
        x, y, z = self.names
        longitude = Quantity("longitude", "longitude", f"longitude, from {x} towards {y}", "", "rad", ("longitude",))
        return longitude, Quantity("latitude", "latitude", f"latitude, towards {z}", "", "rad", ("latitude",))

    @property
    def unit(self) -> str:
        """Of densities."""
        return "1/rad^2" if self.dimension == 4 else "1/sr"

    def integral(self, values: FloatArray) -> float:
        """∫ of values at the nodes, shape (a, b)."""
        return float(self.first_weights @ values @ self.second_weights)

    def share(self, values: FloatArray) -> float:
        """The mean of sin²η in a density of four variables; of three, that of the third variable in ‖z‖²."""
        shares = np.sin(self.first)[:, None] if self.dimension == 4 else np.sin(self.second)
        return self.integral(values * shares**2) / self.integral(values)

    def points(self) -> FloatArray:
        """Directions over the nodes, shape (n, a, b, m), over m values of θ₂ in half a turn of four variables."""
        if self.dimension == 3:
            longitude, latitude = np.meshgrid(self.first, self.second, indexing="ij")
            flat = np.cos(latitude)
            return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), np.sin(latitude)])[..., None]
        turns = (1 + self.has_stop) * math.pi * np.arange(PHASES) / PHASES
        eta, one, two = np.meshgrid(self.first, self.second, turns, indexing="ij", sparse=True)
        if not self.has_stop:
            one = two + one
        c, s = np.cos(eta), np.sin(eta)
        parts = c * np.cos(one), c * np.sin(one), s * np.cos(two), s * np.sin(two)
        return np.stack(np.broadcast_arrays(*parts))

    def reduced(self, values: FloatArray) -> FloatArray:
        """Densities per unit of the surface at the `points` as densities at the nodes, shape (a, b)."""
        if self.dimension == 3:
            return values[..., 0]
        return (np.cos(self.first) * np.sin(self.first))[:, None] * 2 * math.pi * np.mean(values, axis=-1)

    @property
    def what(self) -> str:
        """What the share of a pair is of: the energy where both are oscillators."""
        return "energy" if not any(name.startswith("(") for name in self.names) else "sum of squares"


@dataclass(frozen=True, eq=False)
class DirectionFields:
    """Functions of directions at the nodes of a grid, each of shape (a, b), integrated over the noise.

    Attributes:
        grid: the nodes.
        right: T, of mean 1 over the sphere, or its half at a stop; of four variables its mean over θ₂.
        adjoint: T* as a density; at p = 0 the stationary one.
        product: T T*, the tilted density.
        total: ∫ T T* over the nodes, which is 1 where they resolve it.
    """

    grid: DirectionGrid
    right: FloatArray
    adjoint: FloatArray
    product: FloatArray
    total: float

    @property
    def is_resolved(self) -> bool:
        """Whether the nodes are close enough."""
        return abs(self.total - 1) <= RESOLVED


@dataclass(frozen=True, eq=False)
class Directions:
    """T, T* and T T* of a pair at any directions."""

    pair: PrincipalPair

    @cached_property
    def _map(self) -> FloatArray:
        """R = S⁻¹D."""
        coordinates, problem = np.array(self.pair.space.phi.coordinates), self.pair.generator.problem
        for rows in (problem.frame and problem.frame.matrix, problem.system.stop and problem.system.stop.coordinates):
            coordinates = coordinates if rows is None else np.array(rows) @ coordinates
        scales = np.ones(len(coordinates))
        for q, size in oscillators(problem).items():
            scales[q + 1] = size
        return np.linalg.inv(coordinates) * scales

    @cached_property
    def _tables(self) -> tuple[FloatArray, FloatArray]:
        """Coefficients over directions alone: the means of T and T* over the noise, and T beside T* times its mass."""
        space = self.pair.space
        right, left = (space.table(v).reshape(space.phi.size, -1) for v in (self.pair.right, self.pair.left))
        samples = [axis.samples() for axis in space.noises]
        mean = reduce(np.kron, [(at.measure * at.weight / at.factor) @ at.values for at in samples])
        masses = [None, *(axis.matrix(one) for axis in space.noises)]
        weighed = along(masses, space.table(self.pair.left)).reshape(left.shape)
        return np.column_stack([right @ mean, left @ mean]), np.concatenate([right, weighed], axis=1)

    def at(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """T, T* and T T* at directions z, shape (n, m): the first of any size, the others per unit of the surface."""
        axis, n, p = self.pair.space.phi, len(points), self.pair.p
        y = self._map @ points
        length = np.linalg.norm(y, axis=0)
        means, both = self._tables
        found = np.empty((3, length.size))
        step = max(1, CHUNK // (axis.size + both.shape[1]))
        for start in range(0, length.size, step):
            part = slice(start, start + step)
            functions = axis.at(y[:, part] / length[part])
            right, left = np.split(np.asarray(functions @ both), 2, axis=1)
            found[:2, part] = np.asarray(functions @ means).T
            found[2, part] = np.einsum("mk,mk->m", right, left)
        stretched = abs(np.linalg.det(self._map)) * length**-n / axis.area
        return found[0] * length**p, found[1] * stretched * length**-p, found[2] * stretched

    def on(self, grid: DirectionGrid) -> DirectionFields:
        """Over the nodes of a grid."""
        points = grid.points()
        right, adjoint, product = (each.reshape(points.shape[1:]) for each in self.at(points.reshape(len(points), -1)))
        sphere = grid.reduced(np.ones_like(right))
        mean = grid.integral(grid.reduced(right)) / grid.integral(sphere)
        adjoint, product = grid.reduced(adjoint), grid.reduced(product)
        total = grid.integral(product)
        return DirectionFields(
            grid, np.mean(right, axis=-1) / mean, adjoint / grid.integral(adjoint), product / total, total
        )

    @cached_property
    def fields(self) -> DirectionFields:
        """On the first grid that resolves the tilted density, or the finest."""
        count = FEWEST_NODES
        while True:
            found = self.on(DirectionGrid.of(self.pair.generator.problem, count))
            if found.is_resolved or count >= MOST_NODES:
                return found
            count *= 2
