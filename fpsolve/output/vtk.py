"""Eigenfunctions and densities as ParaView files: Lagrange quadrilaterals on the full circle, x = φ, y = ξ.

A file shows the elements' polynomials, not an interpolation through shared nodes: points are doubled at every
φ-line of the mesh and carry the one-sided limits there, so that the jump T(φ⁻) = R^p T(φ⁺) of an impact stands in
it. A half circle is repeated, as everything in Eq. (19) is π-periodic, and its cells are cut at φ = 0 and 2π.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.curves import Curve
from fpsolve.errors import OutputError
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.fields import Fields, fields, xi_marginal
from fpsolve.fem.noise_space import LineNoiseSpace, Samples
from fpsolve.fem.phase_space import PhaseSpace
from fpsolve.files import write_text
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import has_algebraic_tails
from fpsolve.process import signals_held
from fpsolve.study.results import SimulatedCurve, Solved

MAX_ORDER = 4
"""Largest degree of the quadrilaterals written; elements of a higher degree are cut into several of them."""
FAINT = 1e-6


Facts = Mapping[str, float | str]


def write_eigenfunctions(
    directory: Path,
    pairs: Sequence[PrincipalPair],
    stationary: PrincipalPair,
    stem: str = "eigenfunctions",
    parameters: Facts = MappingProxyType({}),
) -> list[Path]:
    """Write `<stem>.pvd`, a time series over p, and `<stem>/p….vtu`, one file for each p.

    Point data: `T`; `T_adjoint`, T*; `tilted_density`, T T*; `stationary_density`, T* at p = 0; `z` = ξ/std.
    T, which ParaView shows first, has mean 1 over P_s(ξ)/2π, see `fields`, and is cut off beyond e^±600;
    ∫T T* dφ dξ = 1. Field data: `p`; `Lambda`, Λ(p); and each of the parameters.

    Args:
        directory: the folder, made where it is missing.
        pairs: the eigenpairs, at most one of them written for each p.
        stationary: the pair at p = 0 of the same oscillator and noise, on any mesh.
        stem: name of the collection and of the folder of its files.
        parameters: of the oscillator and the noise, by dotted keys such as "noise.D0".

    Returns:
        The files written, the collection first.
    """
    names = {pair.p: f"{stem}/p{pair.p + 0.0:+}.vtu" for pair in sorted(pairs, key=lambda pair: pair.p)}
    for pair in pairs:
        grid = _Grid.of(pair)
        found = grid.fields(pair)
        data = {
            "T": found.right,
            "T_adjoint": found.adjoint,
            "tilted_density": found.product,
            "stationary_density": grid.fields(stationary).adjoint,
            "z": grid.z,
        }
        _write_grid(directory / names[pair.p], grid, data, {"p": pair.p, "Lambda": pair.value, **parameters})
    collection = directory / f"{stem}.pvd"
    write_text(collection, _collection(names))
    return [collection, *(directory / name for name in names.values())]


def write_density(path: Path, stationary: PrincipalPair, parameters: Facts = MappingProxyType({})) -> Path:
    """Write the stationary density of (φ, ξ), per radian and unit of ξ, with its marginals, to a `.vtu` file.

    Point data: `stationary_density`, which ParaView shows first, `phi_marginal`, `xi_marginal`, `z`. Field data:
    `lyapunov_exponent`, λ, and each of the parameters.
    """
    grid, space = _Grid.of(stationary), stationary.space
    over_xi = space.table(stationary.left) @ (space.xi.mass() @ space.xi.constant())
    data = {
        "stationary_density": grid.fields(stationary).adjoint,
        "phi_marginal": grid.phase_table(stationary) @ over_xi[:, None],
        "xi_marginal": space.turns * xi_marginal(stationary, grid.samples(stationary)),
        "z": grid.z,
    }
    _write_grid(path, grid, data, {"lyapunov_exponent": stationary.derivative, **parameters})
    return path


def write_functions(solved: Solved, curve: Curve, folder: Path) -> None:
    """Write the eigenfunctions of a curve; with the first curve the stationary density too."""
    stationary = solved.stationary
    if stationary is not None and curve.number == 1:
        write_density(folder / "density.vtu", stationary, curve.parameters)
    if stationary is not None and solved.eigenpairs:
        copy_show_script(folder)
        stem = f"eigenfunctions{curve.suffix}"
        write_eigenfunctions(folder, solved.eigenpairs, stationary, stem, curve.parameters)


def write_response(simulated: SimulatedCurve, folder: Path) -> None:
    """Write the joint density of x and ẋ, if there is one, as cell data `density` of response.vti."""
    response = simulated.response
    if response is None:
        return
    pyvista, writers = _libraries()
    path, x, v = folder / f"response{simulated.curve.suffix}.vti", response.x_edges, response.v_edges
    size, spacing = (x.size, v.size, 1), (x[1] - x[0], v[1] - v[0], 1.0)
    grid = pyvista.ImageData(dimensions=size, spacing=spacing, origin=(x[0], v[0], 0.0))
    grid.cell_data["density"] = response.density.ravel(order="F")
    _write_vtk(path, writers.vtkXMLImageDataWriter(), grid)


def copy_show_script(directory: Path) -> Path:
    """Put `show.py`, which draws the collection in ParaView, into the folder; it remembers which one that was."""
    target, text = directory / "show.py", files("fpsolve.output").joinpath("show.py").read_text(encoding="utf-8")
    write_text(target, text.replace('FOLDER = ""', f"FOLDER = {str(directory.resolve())!r}", 1))
    return target


@dataclass(frozen=True, eq=False)
class _Grid:
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
    def of(cls, pair: PrincipalPair) -> _Grid:
        """Nodes that show a pair; P_s in the adjoint also asks for low quadrilaterals.

        Raises:
            OutputError: the noise has states.
        """
        space, lines = pair.space, _z_lines(pair)
        degrees = int(np.max(space.phi.degrees)), int(np.max(space.xi.modes))
        order = min(MAX_ORDER, max(degrees))
        tall = math.ceil(np.max(np.diff(lines) / _resolution(pair, lines)) - 1e-9)
        phi = _nodes(_phi_breaks(space.phi), order, _parts(degrees[0], order))
        z = _nodes(lines, order, max(tall, _parts(pair.generator.chosen.xi_degree, order)))
        return cls(phi, z, pair.generator.problem.noise.standard_deviation, order)

    @property
    def z(self) -> FloatArray:
        """z of the nodes, each once."""
        return np.append(self.z_cells[:, :-1], self.z_cells[-1, -1])

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


def _phi_breaks(phi: PhaseSpace) -> FloatArray:
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
    if pair.generator.chosen.z_lines.size or isinstance(noise, MarkovChain):
        return pair.generator.chosen.z_lines
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
    if not has_algebraic_tails(pair.generator.problem.noise):
        return np.ones(lines.size - 1)
    return np.maximum(1.0, np.minimum(abs(lines[:-1]), abs(lines[1:])) / 6)


def _on_a_line(pair: PrincipalPair) -> LineNoiseSpace:
    """The functions of ξ of a pair. Raises `OutputError` where the noise has states."""
    if not isinstance(pair.space.xi, LineNoiseSpace):
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


def _write_grid(path: Path, grid: _Grid, data: Mapping[str, FloatArray], facts: Facts) -> None:
    """Write a .vtu file; arrays of point data broadcast to (φ-nodes, ξ-nodes), and the first is shown first."""
    pyvista, writers = _libraries()
    connectivity = grid.cells()
    count, size = connectivity.shape
    cells = np.column_stack([np.full(count, size), connectivity]).ravel()
    kinds = np.full(count, pyvista.CellType.LAGRANGE_QUADRILATERAL, dtype=np.uint8)
    output = pyvista.UnstructuredGrid(cells, kinds, grid.points())
    for name, values in data.items():
        output.point_data[name] = np.broadcast_to(values, (grid.phi.size, grid.z.size)).ravel()
    for name, value in facts.items():
        output.field_data[name] = [value]
    output.GetPointData().SetActiveScalars(next(iter(data)))
    _write_vtk(path, writers.vtkXMLUnstructuredGridWriter(), output)


def _write_vtk(path: Path, writer: Any, data: Any) -> None:
    """Write what a writer of VTK makes of data; as a text, for VTK itself is silent about a full disk."""
    writer.SetInputData(data)
    writer.WriteToOutputStringOn()
    writer.Write()
    write_text(path, writer.GetOutputString())


def _libraries() -> tuple[Any, Any]:
    """pyvista and the writers of VTK, whose import no signal interrupts; it takes half a second."""
    with signals_held():
        import pyvista
        from vtkmodules import vtkIOXML
    return pyvista, vtkIOXML


def _collection(names: Mapping[float, str]) -> str:
    """The XML of a ParaView collection: a file for each time, which is p."""
    sets = [f'    <DataSet timestep="{p}" file={quoteattr(name)}/>' for p, name in names.items()]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>'
    return "\n".join([head, *sets, "  </Collection>", "</VTKFile>", ""])
