"""Nodes that show T, T* and their product over phase and noise, for files and pictures.

They are those of Lagrange quadrilaterals on the full circle, x = φ, y = ξ. They show the elements' polynomials,
not an interpolation through shared nodes: nodes are doubled at every φ-line of the mesh and carry the one-sided limits
there, so that the jump T(φ⁻) = R^p T(φ⁺) of an impact is seen. A half circle is repeated, as everything in Eq. (19) is
π-periodic, and its cells are cut at φ = 0 and 2π. Where the noise has states there is a strip for each,
around y = 1 for the first, y = 2 for the second; white noise has one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, cast

import numpy as np

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.exponent.density import Fields, own_phases, plane_fields, refuse_more, xi_marginal
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.fem.noise_axes import LineAxis, Samples
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import Quantity
from fpsolve.results.vtk import nodes_of_quadrilateral

MAX_ORDER = 4
"""Largest degree of the quadrilaterals; elements of a higher degree are cut into several of them."""
FAINT = 1e-6
"""Share of the largest values of P_s and of the tilted density below which the noise is not shown."""
NEGLIGIBLE = 1e-3
"""A picture shows the ξ at which a density exceeds this share of its maximum."""
MOST_STATES = 8
"""States of the noise that a picture names."""
FIELDS = {
    "T": Quantity("T", "T", "eigenfunction", "$T$"),
    "T_adjoint": Quantity("T_adjoint", "T*", "adjoint eigenfunction", "$T^*$"),
    "tilted_density": Quantity("tilted_density", "T T*", "tilted density", r"$T\,T^*$"),
}
"""What the `Fields` of a pair are."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of the quadrilaterals: a block of them for each φ-cell or part of one, continuous in ξ.

    Attributes:
        phi: φ of the nodes, shape (blocks, nodes of a block); the ends are the φ-lines, 0 and 2π.
        z: z of the nodes, shape (n,); of states their numbers from 1 on, and up to 0.4 to either side.
        problem: whose functions they show.
        order: degree of the quadrilaterals.
        is_lines: whether ξ has some values alone, so that a picture has a line for each.
    """

    phi: FloatArray
    z: FloatArray
    problem: Problem
    order: int
    is_lines: ClassVar[bool] = False

    @classmethod
    def of(cls, pair: PrincipalPair, finer: int = 1) -> Nodes:
        """Nodes that show a pair, or so many times more either way; P_s in the adjoint asks for low quadrilaterals.

        Raises:
            OutputError: T depends on more than φ and ξ.
        """
        refuse_more(pair)
        axis, xi = pair.space.phi, pair.space.xi
        degrees = int(np.max(axis.degrees)), int(np.max(xi.modes))
        order = min(MAX_ORDER, max(degrees))
        problem = pair.generator.problem
        starts = np.sort(np.mod(own_phases(pair, axis.lines[:-1])[0], axis.span))
        starts = np.concatenate([starts + k * axis.span for k in range(axis.turns)])
        breaks = np.concatenate([[0.0], starts[(starts > 1e-9) & (starts < 2 * math.pi - 1e-9)], [2 * math.pi]])
        phi = _nodes(breaks, order, finer * _parts(degrees[0], order))
        if problem.noise.has_states:
            strips = _nodes(np.arange(0.5, xi.size + 1), order, 1)
            strips = 0.8 * strips + 0.2 * strips.mean(axis=1, keepdims=True)
            return Strips(phi, strips.ravel(), problem, order)
        lines = _z_lines(pair)
        # P_s is shown by quadrilaterals as high as a noise unit, or higher far out, as in algebraic tails
        inner = np.minimum(abs(lines[:-1]), abs(lines[1:]))
        tall = math.ceil(np.max(np.diff(lines) / np.maximum(1.0, inner / 6)) - 1e-9)
        z = _nodes(lines, order, finer * max(tall, _parts(degrees[1] if xi.lines.size else 0, order)))
        return cls(phi, np.append(z[:, :-1], z[-1, -1]), problem, order)

    @property
    def y(self) -> FloatArray:
        """What stands along y at each z: ξ."""
        return self.problem.valued.standard_deviation * self.z

    @property
    def xi(self) -> FloatArray:
        """ξ of a picture, each once."""
        return self.y

    def at_xi(self, values: FloatArray) -> FloatArray:
        """Values at the nodes as those at `xi`."""
        return values

    @property
    def axis(self) -> str:
        """What stands along y, with its unit."""
        return self.problem.noise_quantity.in_words(" ξ")

    @property
    def along_y(self) -> str:
        """The same in ASCII, for files."""
        return self.axis.replace("ξ", "xi").replace("²", "^2")

    @property
    def impacts(self) -> list[float]:
        """The phases at which T jumps, increasing."""
        jumps, turns = self.problem.linear.jumps, (0, math.pi)
        return sorted({round((jump.phase + turn) % (2 * math.pi), 12) for jump in jumps for turn in turns})

    def seen(self, pair: PrincipalPair) -> Nodes:
        """The same where the tilted density, or that of the noise, is not negligible."""
        densities = self.fields(pair).tilted_density.max(axis=0), self.problem.valued.density(self.y)
        living = np.flatnonzero(np.any([each > NEGLIGIBLE * each.max() for each in densities], axis=0))
        return replace(self, z=self.z[living[0] : living[-1] + 1])

    def fields(self, pair: PrincipalPair, at: Samples | None = None) -> Fields:
        """The functions of a pair at the nodes, shape (φ-nodes, ξ-nodes), or at other samples of ξ."""
        # contracted a little, as they then tell from which side a line of the mesh is seen
        inside = self.phi + 1e-6 * (self.phi.mean(axis=1, keepdims=True) - self.phi)
        return plane_fields(pair, self.phi.ravel(), inside.ravel(), at or self.samples(pair))

    def samples(self, pair: PrincipalPair) -> Samples:
        """The functions of ξ at the nodes."""
        return cast("LineAxis", pair.space.xi).at(self.z)

    def points(self) -> FloatArray:
        """(φ, y, 0), φ slowest, shape (points, 3)."""
        phi, y = np.meshgrid(self.phi.ravel(), self.y, indexing="ij")
        return np.stack([phi.ravel(), y.ravel(), np.zeros(phi.size)], axis=1)

    def cells(self) -> IntArray:
        """Points of each quadrilateral in VTK's order, shape (cells, (order + 1)²)."""
        k, (blocks, nodes) = self.order, self.phi.shape
        columns = (np.arange(blocks)[:, None] * nodes + np.arange(0, nodes - 1, k)).ravel()
        rows = np.arange(0, self.z.size - 1, k + self.is_lines)  # lines share no nodes
        corners = columns[:, None] * self.z.size + rows
        i, j = np.transpose(nodes_of_quadrilateral(k))
        return corners.reshape(-1, 1) + i * self.z.size + j


class Strips(Nodes):
    """The same for the states of a noise: a strip for each, z their numbers from 1 on, half a unit to either side."""

    is_lines = True

    @property
    def y(self) -> FloatArray:
        return self.z

    @property
    def xi(self) -> FloatArray:
        return np.asarray(self.problem.valued.reached)

    def at_xi(self, values: FloatArray) -> FloatArray:
        return values[:, :: self.order + 1]

    @property
    def axis(self) -> str:
        return "number of the state"

    @property
    def along_y(self) -> str:
        noise = self.problem.noise
        if noise.is_white:
            return f"{noise.kind or 'white'} noise"
        return "; ".join(["states", *(f"xi = {each:g}" for each in self.xi if self.xi.size <= MOST_STATES)])

    def seen(self, pair: PrincipalPair) -> Strips:
        """All of them."""
        return self

    def samples(self, pair: PrincipalPair) -> Samples:
        states = np.arange(self.z.size) // (self.order + 1)
        return Samples(*(each[states] for each in pair.space.xi.samples()))


def _z_lines(pair: PrincipalPair) -> FloatArray:
    """The lines of the ξ-cells; of polynomials the interval in which the noise lives along some paths, in noise units.

    Outside it P_s and the tilted density are below `FAINT` of their largest values.
    """
    xi, noise = cast("LineAxis", pair.space.xi), pair.generator.problem.valued
    if xi.lines.size:
        return xi.lines
    end = noise.half_width / noise.standard_deviation
    reach = min(end, 12.0 + abs(xi.center))
    z = np.linspace(-reach, reach, 2001)[1:-1]
    tilted, stationary = np.abs(xi_marginal(pair, xi.at(z))), noise.density(noise.standard_deviation * z)
    seen = z[(tilted > FAINT * tilted.max()) | (stationary > FAINT * stationary.max())]
    lower, upper = max(math.floor(seen[0]), -end), min(math.ceil(seen[-1]), end)
    inside = np.arange(math.floor(lower) + 1, math.ceil(upper))
    return np.concatenate([[lower], inside[(inside > lower + 0.1) & (inside < upper - 0.1)], [upper]])


def _parts(degree: int, order: int) -> int:
    """Into how many polynomials of degree `order` one of `degree` is cut: one where that is exact."""
    return 1 if degree <= order else math.ceil(degree / order) + 1


def _nodes(breaks: FloatArray, order: int, parts: int) -> FloatArray:
    """Equidistant nodes in each interval, shape (intervals, parts·order + 1)."""
    t = np.linspace(0, 1, parts * order + 1)
    return breaks[:-1, None] * (1 - t) + breaks[1:, None] * t
