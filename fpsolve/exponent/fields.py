"""The functions that a pair of eigenvectors stands for, T, T* and their product; nodes that show them, and pictures.

The nodes are those of Lagrange quadrilaterals on the full circle, x = φ, y = ξ. They show the elements' polynomials,
not an interpolation through shared nodes: nodes are doubled at every φ-line of the mesh and carry the one-sided limits
there, so that the jump T(φ⁻) = R^p T(φ⁺) of an impact is seen. A half circle is repeated, as everything in Eq. (19) is
π-periodic, and its cells are cut at φ = 0 and 2π. Where the noise has states there is a strip for each,
around y = 1 for the first, y = 2 for the second; white noise has one.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np

from fpsolve.arrays import FloatArray, shown
from fpsolve.drawing import SIZE, STYLE
from fpsolve.errors import OutputError
from fpsolve.exponent.directions import Directions
from fpsolve.fem.noise_axes import LineAxis, Samples
from fpsolve.model.problem import parameter_lines
from fpsolve.model.quantity import PHASE, Quantity, density_unit
from fpsolve.surfaces import Picture, Surface, can_render, flat_picture, picture_in_space

if TYPE_CHECKING:
    from fpsolve.exponent.eigen import PrincipalPair

MOST_TILT = 1.5
UNRESOLVED, MOST_NEGATIVE = 0.1, 0.02
"""The share of an eigenfunction, and of a density, with the wrong sign from which on it misleads."""
MAX_ORDER = 4
"""Largest degree of the quadrilaterals; elements of a higher degree are cut into several of them."""
FAINT = 1e-6
NEGLIGIBLE = 1e-3
"""A picture shows the ξ at which a density exceeds this share of its maximum."""
FINER = 2
"""So many times as many nodes either way as a file for ParaView has; there they carry polynomials."""
Field = Literal["T", "T_adjoint", "tilted_density"]
FIELDS = {
    "T": ("right", Quantity("T", "T", "eigenfunction", "$T$")),
    "T_adjoint": ("adjoint", Quantity("T_adjoint", "T*", "adjoint eigenfunction", "$T^*$")),
    "tilted_density": ("product", Quantity("tilted_density", "T T*", "tilted density", r"$T\,T^*$")),
}
"""By the names that they have in files for ParaView: those among `Fields`, and what they are."""


class Fields(NamedTuple):
    """Functions of (φ, ξ) at points, each of shape (φ-points, ξ-points).

    Attributes:
        right: T; NaN beyond an arc of φ on which a pair is known, where T* is 0.
        adjoint: T*, per radian and unit of ξ; at p = 0 the stationary density.
        product: T T*, the tilted density.
    """

    right: FloatArray
    adjoint: FloatArray
    product: FloatArray


def fields(pair: PrincipalPair, phi: FloatArray, at_phi: Any, at_xi: Samples) -> Fields:
    """T, T* and T T* at φ from the values of the φ-elements there and samples of the functions of ξ.

    T has mean 1 over P_s(ξ)/2π; with a tilt beyond `MOST_TILT`, which leaves T there to rounding, over P_s exp(2s z).
    Raises `OutputError` where it depends on more than φ and ξ.
    """
    _refuse_more(pair)
    space, xi, frame = pair.space, pair.space.xi, pair.generator.problem.frame
    mean, stretch, density = 1.0, np.ones(1), np.ones(1)
    if frame is not None or 0 < abs(xi.tilt) <= MOST_TILT:
        own = xi.samples().factor if 0 < abs(xi.tilt) <= MOST_TILT else np.ones(xi.measure.size)
        over_phi = space.phi.constant @ space.table(pair.right) / space.phi.span
        if frame is not None:  # the mean over φ of |y|^p T_y
            psi, weights = space.phi.finer_rule(frame.parts)
            at = frame.own_phase(psi)
            weights = weights / frame.density(at) * frame.length(at) ** pair.p
            over_phi = weights @ (space.phi.at(psi) @ space.table(pair.right)) / space.phi.span
            stretch, density = frame.length(phi) ** pair.p, frame.density(phi)
        mean = float(xi.measure / own @ (xi.values @ over_phi) / np.sum(xi.measure / own**2))
    right, left = (space.evaluate(v, at_phi, at_xi.values) for v in (pair.right, pair.left))
    factor = at_xi.factor / mean * stretch[:, None]
    of_phi = at_xi.weight * density[:, None]
    return Fields(right * factor, left * of_phi / factor, right * left * of_phi)


def xi_marginal(pair: PrincipalPair, at_xi: Samples) -> FloatArray:
    """∫ T T* dφ over the mesh at points of ξ, shape (n,)."""
    right, left = (at_xi.values @ pair.space.table(v).T for v in (pair.right, pair.left))
    return np.asarray(np.einsum("zi,zi->z", right, left) * at_xi.weight)


def noise_marginal(pair: PrincipalPair) -> tuple[FloatArray, FloatArray]:
    """z and the ξ-marginal of the tilted density at the points of a rule, times their measure."""
    at = pair.space.xi.samples()
    return at.xi / pair.generator.problem.coloured.standard_deviation, np.abs(xi_marginal(pair, at)) * at.measure


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
            OutputError: T depends on more than φ and ξ.
        """
        _refuse_more(pair)
        space = pair.space
        degrees = int(np.max(space.phi.degrees)), int(np.max(space.xi.modes))
        order = min(MAX_ORDER, max(degrees))
        frame = pair.generator.problem.frame
        lines_of_phi = space.phi.lines if frame is None else frame.own_phase(space.phi.lines)
        starts = np.sort(np.mod(lines_of_phi[:-1], space.phi.span))
        starts = np.concatenate([starts + k * space.phi.span for k in range(space.phi.turns)])
        breaks = np.concatenate([[0.0], starts[(starts > 1e-9) & (starts < 2 * math.pi - 1e-9)], [2 * math.pi]])
        phi = _nodes(breaks, order, finer * _parts(degrees[0], order))
        if pair.generator.problem.noise.has_states:
            return Strips(phi, _nodes(np.arange(0.5, space.xi.size + 1), order, 1), 1.0, order)
        lines = _z_lines(pair)
        # P_s is shown by quadrilaterals as high as a noise unit, or higher in algebraic tails
        noise, inner = pair.generator.problem.coloured, np.minimum(abs(lines[:-1]), abs(lines[1:]))
        widest = np.maximum(1.0, inner / 6 if noise.has_algebraic_tails else 1.0)
        tall = math.ceil(np.max(np.diff(lines) / widest) - 1e-9)
        z = _nodes(lines, order, finer * max(tall, _parts(pair.generator.chosen.noise.degree, order)))
        return cls(phi, z, noise.standard_deviation, order)

    @property
    def z(self) -> FloatArray:
        """z of the nodes, each once."""
        return np.append(self.z_cells[:, :-1], self.z_cells[-1, -1])

    def seen(self, pair: PrincipalPair) -> Nodes:
        """The same where the tilted density, or that of the noise, is not negligible."""
        noise = pair.generator.problem.coloured
        densities = self.fields(pair).product.max(axis=0), noise.density(self.unit * self.z)
        living = np.flatnonzero(np.any([each > NEGLIGIBLE * each.max() for each in densities], axis=0))
        return replace(self, z_cells=self.z[None, living[0] : living[-1] + 1])

    def fields(self, pair: PrincipalPair) -> Fields:
        """The functions of a pair at the nodes, shape (φ-nodes, ξ-nodes)."""
        return fields(pair, self.phi.ravel(), self.phase_table(pair), self.samples(pair))

    def phase_table(self, pair: PrincipalPair) -> FloatArray:
        """Values of the φ-elements at the nodes, shape (φ-nodes, φ-unknowns)."""
        axis, frame, phi = pair.space.phi, pair.generator.problem.frame, self.phi
        # contracted a little, as they then tell from which side a line of the mesh is seen
        inside = phi + 1e-6 * (phi.mean(axis=1, keepdims=True) - phi)
        if frame is not None:
            phi, inside = frame.phase(phi), frame.phase(inside)
        turned = axis.span * np.floor((inside - axis.lines[0]) / axis.span)
        return axis.at((phi - turned).ravel(), (inside - turned).ravel())

    def samples(self, pair: PrincipalPair) -> Samples:
        """The functions of ξ at the nodes."""
        axis: Any = pair.space.xi
        found: Samples = axis.at(self.z)
        return found

    def points(self) -> FloatArray:
        """(φ, ξ, 0), φ slowest, shape (points, 3)."""
        phi, xi = np.meshgrid(self.phi.ravel(), self.unit * self.z, indexing="ij")
        return np.stack([phi.ravel(), xi.ravel(), np.zeros(phi.size)], axis=1)

    @property
    def _rows(self) -> Any:
        """Where cells begin among the nodes of ξ."""
        return np.arange(0, self.z.size - 1, self.order)

    def cells(self) -> Any:
        """Points of each quadrilateral in VTK's order, shape (cells, (order + 1)²)."""
        k, (blocks, nodes) = self.order, self.phi.shape
        columns = (np.arange(blocks)[:, None] * nodes + np.arange(0, nodes - 1, k)).ravel()
        corners = columns[:, None] * self.z.size + self._rows
        inner = range(1, k)
        edges = [*((i, 0) for i in inner), *((k, j) for j in inner), *((i, k) for i in inner), *((0, j) for j in inner)]
        i, j = np.transpose([(0, 0), (k, 0), (k, k), (0, k), *edges, *((i, j) for j in inner for i in inner)])
        return corners.reshape(-1, 1) + i * self.z.size + j


class Strips(Nodes):
    """The same for the states of a noise: a strip for each, z their numbers from 1 on, half a unit to either side."""

    @property
    def z(self) -> FloatArray:
        return 0.8 * self.z_cells.ravel() + 0.2 * self.z_cells.mean(axis=1).repeat(self.z_cells.shape[1])

    def seen(self, pair: PrincipalPair) -> Strips:
        """All of them."""
        return self

    def samples(self, pair: PrincipalPair) -> Samples:
        at, states = pair.space.xi.samples(), np.arange(self.z_cells.shape[0]).repeat(self.z_cells.shape[1])
        return Samples(*(each[states] for each in at))

    @property
    def _rows(self) -> Any:
        return np.arange(0, self.z.size, self.order + 1)


def _refuse_more(pair: PrincipalPair) -> None:
    """Raises `OutputError` where T depends on more than φ and ξ."""
    problem = pair.generator.problem
    if problem.dimension > 2:
        why = f"T of {problem.dimension} variables is no function of phase and noise"
        raise OutputError(f"{why}; use `plot`, `tilted_density`, or a case, whose run writes files for ParaView")
    if why := problem.no_picture:
        raise OutputError(why)


def _z_lines(pair: PrincipalPair) -> FloatArray:
    """The lines of the ξ-cells; of polynomials the interval in which the noise lives along some paths, in noise units.

    Outside it P_s and the tilted density are below `FAINT` of their largest values.
    """
    xi, noise = cast("LineAxis", pair.space.xi), pair.generator.problem.coloured
    if pair.generator.chosen.noise.lines.size:
        return pair.generator.chosen.noise.lines
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


class EigenfunctionPlot:
    """A mixin of a `PrincipalPair`."""

    def plot(self, field: Field = "T", *, cylinder: bool = False, cmap: str = "viridis") -> Picture:
        """Draw an eigenfunction, or the tilted density, over phase and noise; for noise with states a line for each.

        Of more than two variables over directions, see `analysis.DirectionDensity`, as the functions of this pair have
        it: T as its mean, T* and T T* as densities.

        In space by pyvista where this machine can render, which takes some seconds to find out the first time; else in
        the plane by matplotlib.

        Args:
            field: "T", "T_adjoint", or their product "tilted_density".
            cylinder: whether φ goes around a cylinder; only where this machine can render.
            cmap: the colours, by matplotlib's names.

        Raises:
            ValueError: there is no such field, or a cylinder is wanted of more than two variables.
            OutputError: T depends on more than φ and ξ.
        """
        pair: PrincipalPair = self  # type: ignore[assignment]
        if pair.generator.problem.dimension > 2:
            if cylinder:
                raise ValueError("got cylinder = True, which is for functions of phase and noise; leave it out")
            return _picture_of_directions(pair, _known(field), cmap)
        surface = surface_of(pair, field)
        if surface.is_lines:
            return flat_picture(surface, cmap)
        if can_render():
            return picture_in_space(surface, cmap, cylinder=cylinder)
        if cylinder:
            warnings.warn(
                "this machine cannot render, so that the plane is drawn; to draw a cylinder install OpenGL, as "
                "by apt-get install libegl1 libgl1-mesa-dri",
                stacklevel=2,
            )
        return flat_picture(surface, cmap)


def _known(field: str) -> str:
    """The name of a field. Raises `ValueError`."""
    if field not in FIELDS:
        raise ValueError(f"got field = {shown(field)}; must be one of {', '.join(map(repr, FIELDS))}")
    return field


def title_of(pair: PrincipalPair) -> str:
    """p and Λ(p) in words."""
    return f"p = {pair.p:g}, Λ(p) = {round(pair.value, 14) + 0.0:.6g} (1/time)"


def _picture_of_directions(pair: PrincipalPair, field: str, cmap: str) -> Picture:
    """A function of directions in colours."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    found, (name, quantity), content = Directions(pair).fields, FIELDS[field], BytesIO()
    unit = quantity.unit if name == "right" else found.grid.unit
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        axes = figure.add_subplot()
        found.grid.draw(axes, getattr(found, name), {**quantity.attributes, "units": unit}, cmap=cmap)
        figure.suptitle(title_of(pair), parse_math=False)
        axes.set_title("\n".join(parameter_lines(pair.generator.problem.parameters)), fontsize=9, parse_math=False)
    figure.savefig(content, format="png", dpi=150)
    return Picture(content.getvalue())


def surface_of(pair: PrincipalPair, field: str) -> Surface:
    """A function of a pair where it is not negligible, with its words. Raises `ValueError`."""
    (name, quantity), problem = FIELDS[_known(field)], pair.generator.problem
    nodes, noise, is_lines = Nodes.of(pair, FINER).seen(pair), problem.noise_quantity, problem.noise.has_states
    unit = quantity.unit if name == "right" else "1/rad" if is_lines else density_unit(noise)
    xi = pair.space.xi.support if is_lines else nodes.unit * nodes.z
    values = getattr(nodes.fields(pair), name)
    about = {"phi": PHASE.attributes, "xi": noise.attributes, "values": {**quantity.attributes, "units": unit}}
    rays = {(jump.phase + turn) % (2 * math.pi) for jump in problem.system.jumps for turn in (0, math.pi)}
    return Surface(
        phi=nodes.phi,
        xi=xi,
        values=values[:, :: nodes.order + 1] if is_lines else values,
        about=about,
        name=quantity.symbol,
        title=title_of(pair),
        lines=parameter_lines(problem.parameters),
        impacts=sorted(rays),
        is_lines=is_lines,
    )
