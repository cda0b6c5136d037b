"""Nodes on the full circle at which the functions of a pair are shown: those of Lagrange quadrilaterals, x = φ, y = ξ.

They show the elements' polynomials, not an interpolation through shared nodes: nodes are doubled at every φ-line of the
mesh and carry the one-sided limits there, so that the jump T(φ⁻) = R^p T(φ⁺) of an impact is seen. A half circle is
repeated, as everything in Eq. (19) is π-periodic, and its cells are cut at φ = 0 and 2π.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import OutputError
from fpsolve.exponent.fields import Fields, fields, xi_marginal
from fpsolve.fem.noise_axes import LineAxis, Samples
from fpsolve.fem.phase import PhaseAxis

if TYPE_CHECKING:
    from fpsolve.exponent.eigen import PrincipalPair

MAX_ORDER = 4
"""Largest degree of the quadrilaterals; elements of a higher degree are cut into several of them."""
FAINT = 1e-6
NEGLIGIBLE = 1e-3
"""A picture shows the ξ at which a density exceeds this share of its maximum."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of the quadrilaterals: a block of them for each φ-cell or part of one, continuous in ξ.

    Attributes:
        phi: φ of the nodes, shape (blocks, nodes of a block); the ends are the φ-lines, 0 and 2π.
        z_cells: z of the nodes, shape (ξ-cells, nodes of a cell), with the ends of neighbours equal.
        unit: ξ/z.
        order: degree of the quadrilaterals.
    """

    phi: FloatArray
    z_cells: FloatArray
    unit: float
    order: int

    @classmethod
    def of(cls, pair: PrincipalPair, finer: int = 1) -> Nodes:
        """Nodes that show a pair, or so many times more either way; P_s in the adjoint asks for low quadrilaterals.

        Raises:
            OutputError: the noise has states.
        """
        space, lines = pair.space, _z_lines(pair)
        degrees = int(np.max(space.phi.degrees)), int(np.max(space.xi.modes))
        order = min(MAX_ORDER, max(degrees))
        tall = math.ceil(np.max(np.diff(lines) / _resolution(pair, lines)) - 1e-9)
        phi = _nodes(_phi_breaks(space.phi), order, finer * _parts(degrees[0], order))
        z = _nodes(lines, order, finer * max(tall, _parts(pair.generator.chosen.noise.degree, order)))
        return cls(phi, z, pair.generator.problem.noise.standard_deviation, order)

    @property
    def z(self) -> FloatArray:
        """z of the nodes, each once."""
        return np.append(self.z_cells[:, :-1], self.z_cells[-1, -1])

    def seen(self, pair: PrincipalPair) -> Nodes:
        """The same where the tilted density, or that of the noise, is not negligible."""
        noise = pair.generator.problem.noise
        if noise.has_states:  # of which there are no nodes
            return self
        densities = self.fields(pair).product.max(axis=0), noise.density(self.unit * self.z)
        living = np.flatnonzero(np.any([each > NEGLIGIBLE * each.max() for each in densities], axis=0))
        return replace(self, z_cells=self.z[None, living[0] : living[-1] + 1])

    def fields(self, pair: PrincipalPair) -> Fields:
        """The functions of a pair at the nodes, shape (φ-nodes, ξ-nodes)."""
        return fields(pair, self.phase_table(pair), self.samples(pair))

    def phase_table(self, pair: PrincipalPair) -> FloatArray:
        """Values of the φ-elements at the nodes, shape (φ-nodes, φ-unknowns)."""
        phi, inside = pair.space.phi, _inward(self.phi)
        turned = phi.span * np.floor((inside - phi.lines[0]) / phi.span)
        return phi.at((self.phi - turned).ravel(), (inside - turned).ravel())

    def samples(self, pair: PrincipalPair) -> Samples:
        """The functions of ξ at the nodes."""
        return _on_a_line(pair).at(self.z)

    def points(self) -> FloatArray:
        """(φ, ξ, 0), φ slowest, shape (points, 3)."""
        phi, xi = np.meshgrid(self.phi.ravel(), self.unit * self.z, indexing="ij")
        return np.stack([phi.ravel(), xi.ravel(), np.zeros(phi.size)], axis=1)

    def cells(self) -> Any:
        """Points of each quadrilateral in VTK's order, shape (cells, (order + 1)²)."""
        k, (blocks, nodes) = self.order, self.phi.shape
        columns = (np.arange(blocks)[:, None] * nodes + np.arange(0, nodes - 1, k)).ravel()
        corners = columns[:, None] * self.z.size + np.arange(0, self.z.size - 1, k)
        i, j = np.transpose(_vtk_order(k))
        return corners.reshape(-1, 1) + i * self.z.size + j


def _phi_breaks(phi: PhaseAxis) -> FloatArray:
    """0, 2π and the φ-lines between them, those of a half circle repeated."""
    lines = np.sort(np.mod(phi.lines[:-1], phi.span))
    lines = np.concatenate([lines + k * phi.span for k in range(round(2 * math.pi / phi.span))])
    inside = lines[(lines > 1e-9) & (lines < 2 * math.pi - 1e-9)]
    return np.concatenate([[0.0], inside, [2 * math.pi]])


def _z_lines(pair: PrincipalPair) -> FloatArray:
    """The lines of the ξ-cells; of polynomials the interval in which the noise lives along some paths, in noise units.

    Outside it P_s and the tilted density are below `FAINT` of their largest values.
    """
    xi, noise = _on_a_line(pair), pair.generator.problem.noise
    if pair.generator.chosen.noise.lines.size or noise.has_states:
        return pair.generator.chosen.noise.lines
    end = noise.half_width / noise.standard_deviation
    reach = min(end, 12.0 + abs(xi.center))
    z = np.linspace(-reach, reach, 2001)[1:-1]
    tilted, stationary = np.abs(xi_marginal(pair, xi.at(z))), noise.density(noise.standard_deviation * z)
    seen = z[(tilted > FAINT * tilted.max()) | (stationary > FAINT * stationary.max())]
    lower, upper = max(math.floor(seen[0]), -end), min(math.ceil(seen[-1]), end)
    inside = np.arange(math.floor(lower) + 1, math.ceil(upper))
    return np.concatenate([[lower], inside[(inside > lower + 0.1) & (inside < upper - 0.1)], [upper]])


def _resolution(pair: PrincipalPair, lines: FloatArray) -> FloatArray:
    """The height of quadrilaterals, in noise units, that shows P_s in each cell: 1, or more in algebraic tails."""
    if not pair.generator.problem.noise.has_algebraic_tails:
        return np.ones(lines.size - 1)
    return np.maximum(1.0, np.minimum(abs(lines[:-1]), abs(lines[1:])) / 6)


def _on_a_line(pair: PrincipalPair) -> LineAxis:
    """The functions of ξ of a pair. Raises `OutputError` where the noise has states."""
    if pair.generator.problem.noise.has_states:
        raise OutputError("noise with states makes no surface over (phi, xi); look at T for each state instead")
    return pair.space.xi


def _parts(degree: int, order: int) -> int:
    """Into how many polynomials of degree `order` one of `degree` is cut: one where that is exact."""
    return 1 if degree <= order else math.ceil(degree / order) + 1


def _nodes(breaks: FloatArray, order: int, parts: int) -> FloatArray:
    """Equidistant nodes in each interval, shape (intervals, parts·order + 1)."""
    t = np.linspace(0, 1, parts * order + 1)
    return breaks[:-1, None] * (1 - t) + breaks[1:, None] * t


def _inward(x: FloatArray) -> FloatArray:
    """Each row of x, contracted a little: at a line of a mesh it tells from which side the line is seen."""
    return x + 1e-6 * (x.mean(axis=1, keepdims=True) - x)


def _vtk_order(k: int) -> list[tuple[int, int]]:
    """Nodes (i, j) of VTK's Lagrange quadrilateral of degree k: corners, edges, interior."""
    inner = range(1, k)
    corners = [(0, 0), (k, 0), (k, k), (0, k)]
    edges = [*((i, 0) for i in inner), *((k, j) for j in inner), *((i, k) for i in inner), *((0, j) for j in inner)]
    return [*corners, *edges, *((i, j) for j in inner for i in inner)]
