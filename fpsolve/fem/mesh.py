"""The computational domain: a cylinder, φ around it and the noise ξ along it, cut into φ-lines × ξ-lines.

Lengths along ξ are in noise units, z = ξ/std, so that one mesh serves many cases. Meshes are written to and read from
files: .vtu for ParaView, .msh for Gmsh.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.arrays import FloatArray, IntArray, is_whole, real_number, shown
from fpsolve.errors import MeshError
from fpsolve.files import atomic
from fpsolve.messages import Code, Message, Remedy

if TYPE_CHECKING:
    import meshio

MAX_DEGREE = 20
"""Highest degree of the polynomials in a cell."""
MAX_CELLS = 1000
"""Largest number of cells along an axis of a mesh."""
SAME_LINE = 1e-9
"""Distance of two lines, over the length of the axis or in radians, up to which they are one."""
NO_ZERO = "the noise interval [{:g}, {:g}] must contain 0 inside, where the noise lives; choose xi_min < 0 < xi_max"
MARKERS = {"domain": 0, "impact": 1, "seam": 2, "truncation": 3}
"""Cell data `marker` of a .vtu; the physical groups of a .msh have the same names, and numbers greater by 1."""
FORMATS = {".vtu": "vtu", ".msh": "gmsh22"}


@dataclass(frozen=True, eq=False)
class CylinderMesh:
    """Tensor grid on the circle φ and the truncated noise axis z = ξ/std, with the degrees of its elements.

    >>> CylinderMesh([0.0, 3.141592653589793], [-8.0, 0.0, 8.0], phi_degree=6, xi_degree=6).z_lines
    array([-8.,  0.,  8.])

    Attributes:
        phi_lines: increasing φ, shape (m + 1,); they span π (a half circle, as everything in Eq. (19) is
            π-periodic) or 2π, the first and the last being one line, the seam. Generators need a line at every
            impact.
        z_lines: increasing z, shape (n + 1,); none for noise with states.
        phi_degree: degree of the discontinuous elements in φ.
        xi_degree: degree of the continuous elements in ξ.

    Raises:
        MeshError: the lines or degrees are not as stated.
    """

    phi_lines: FloatArray
    z_lines: FloatArray
    phi_degree: int
    xi_degree: int

    def __post_init__(self) -> None:
        for name in ("phi_lines", "z_lines"):
            lines = np.array(getattr(self, name), dtype=float)
            lines.flags.writeable = False
            object.__setattr__(self, name, lines)
            if name == "z_lines" and lines.size == 0:
                continue
            if lines.ndim != 1 or lines.size < 2 or not np.all(np.isfinite(lines)):
                raise MeshError(f"{name} must be at least two finite numbers")
            if not np.all(np.diff(lines) > SAME_LINE * np.ptp(lines)):
                raise MeshError(f"{name} must increase, and no cell may be thinner than 1e-9 of the whole")
        for name in ("phi_degree", "xi_degree"):
            degree = getattr(self, name)
            if not is_whole(degree, 1, MAX_DEGREE):
                raise MeshError(f"{name} is {shown(degree)}; it must be a whole number from 1 to {MAX_DEGREE}")
        turns = self.span / math.pi
        if not (abs(turns - 1) < SAME_LINE or abs(turns - 2) < SAME_LINE):
            raise MeshError(f"the phase spans {self.span:.9g}; it must span the half circle, pi, or the circle, 2 pi")

    @property
    def span(self) -> float:
        """π or 2π."""
        return float(self.phi_lines[-1] - self.phi_lines[0])

    def within(self, half_width: float) -> CylinderMesh:
        """This mesh cut off at |z| = half_width, the end of the noise's support, where it reaches beyond."""
        if not self.z_lines.size:
            return self
        lower, upper = max(self.z_lines[0], -half_width), min(self.z_lines[-1], half_width)
        if lower == self.z_lines[0] and upper == self.z_lines[-1]:
            return self
        sliver = 0.05 * (upper - lower) / (self.z_lines.size - 1)
        inside = self.z_lines[(self.z_lines > lower + sliver) & (self.z_lines < upper - sliver)]
        return replace(self, z_lines=np.concatenate([[lower], inside, [upper]]))


def make_mesh(
    *,
    phi_cells: int = 2,
    phi_degree: int = 10,
    xi_cells: int = 4,
    xi_degree: int = 9,
    xi_min: float = -8.0,
    xi_max: float = 8.0,
    grading: float = 1.0,
    full_circle: bool = False,
) -> CylinderMesh:
    """A mesh with equal φ-cells between impacts, and ξ-cells uniform or graded.

    >>> make_mesh(phi_cells=2, xi_cells=4).z_lines
    array([-8., -4.,  0.,  4.,  8.])

    Args:
        phi_cells: cells on the half circle from one impact to the next.
        phi_degree, xi_degree: degrees of the elements.
        xi_cells: cells along the noise axis.
        xi_min, xi_max: the noise interval in noise units, z = ξ/std; −8 and 8 leave 1e-15 of a Gaussian outside.
        grading: ratio of the outermost ξ-cells to the innermost ones; 1 is uniform.
        full_circle: mesh [0, 2π] with its seam at φ = 0, otherwise [π/2, 3π/2] with its seam at the impact.

    Raises:
        MeshError: a number is out of its range.
    """
    for name, count in (("phi_cells", phi_cells), ("xi_cells", xi_cells)):
        if not is_whole(count, 1, MAX_CELLS):
            raise MeshError(f"{name} is {shown(count)}; it must be a whole number from 1 to {MAX_CELLS}")
    try:
        xi_min, xi_max = real_number(xi_min, "xi_min"), real_number(xi_max, "xi_max")
    except ValueError as fault:
        raise MeshError(f"{fault}; the ends of the noise are in standard deviations") from None
    try:
        is_graded = 0.01 <= real_number(grading, "grading") <= 100
    except ValueError:
        is_graded = False
    if not is_graded:
        raise MeshError(f"grading is {shown(grading)}; it must be a number from 0.01 to 100, and 1 is uniform")
    if full_circle:
        quarter = np.linspace(0, np.pi / 2, -(-phi_cells // 2) + 1)[:-1]
        half = np.linspace(np.pi / 2, 3 * np.pi / 2, phi_cells + 1)
        phi = np.concatenate([quarter, half, 2 * np.pi - quarter[::-1]])
    else:
        phi = np.linspace(np.pi / 2, 3 * np.pi / 2, phi_cells + 1)
    if not xi_min < 0 < xi_max:
        raise MeshError(NO_ZERO.format(xi_min, xi_max))
    middle = np.abs(np.linspace(-1, 1, 2 * xi_cells + 1)[1::2])
    sizes = grading ** ((middle - middle.min()) / max(np.ptp(middle), 1e-300))
    z = xi_min + (xi_max - xi_min) * np.concatenate([[0], np.cumsum(sizes)]) / np.sum(sizes)
    return CylinderMesh(phi, z, phi_degree, xi_degree)


def write_mesh(mesh: CylinderMesh, path: str | Path, impact: float = math.pi / 2) -> None:
    """Write quadrilaterals with points (φ, z, 0) to a .vtu or, for Gmsh, a .msh file, by its ending.

    Line cells mark the impacts, at φ = `impact` mod π, the seam and the truncations; a seam at an impact has both. The
    marks are the cell data `marker` in a .vtu, see `MARKERS`, and named physical groups in a .msh. The point data
    `phi_degree` and `xi_degree` hold the degrees.

    Raises:
        MeshError: an unknown ending, or a folder that cannot be written to.
    """
    path = Path(path)
    _check_format(path)
    try:
        with atomic(path) as temporary:
            _as_meshio(mesh, impact, path.suffix == ".msh").write(temporary, file_format=FORMATS[path.suffix])
    except OSError as failure:
        raise MeshError(f"{path} cannot be written: {failure.strerror}; choose another place") from failure


def read_mesh(path: str | Path) -> CylinderMesh:
    """Read a mesh that `write_mesh` or another program wrote; without degrees in it, those of `make_mesh`.

    Raises:
        MeshError: the file is missing, unreadable, no full tensor grid of quadrilaterals in (φ, z), or does
            not cover the circle or half circle.
    """
    import meshio

    path = Path(path)
    _check_format(path)
    if not path.is_file():
        raise MeshError(f"{path} {'is not a file' if path.exists() else 'does not exist'}; name a mesh file")
    try:
        content = meshio.vtu.read(path) if path.suffix == ".vtu" else meshio.gmsh.read(path)
    except Exception as failure:  # meshio raises whatever its parsers do
        why = str(failure) or type(failure).__name__
        raise MeshError(f"{path} cannot be read as a {path.suffix} mesh ({why})", Remedy.MESH_FILE) from failure
    quads = content.cells_dict.get("quad")
    others = {block.type for block in content.cells} - {"quad", "line", "vertex"}
    if quads is None or others:
        raise MeshError(
            f"{path} holds {', '.join(sorted(others)) or 'no quadrilaterals'}; every cell must be a quadrilateral"
        )
    try:
        points = content.points
        if points.ndim != 2 or points.shape[1] < 2 or not np.all(np.isfinite(points)):
            raise MeshError("the points must be finite (phi, xi) or (phi, xi, 0)", Remedy.MESH_FILE)
        if not np.all((quads >= 0) & (quads < len(points))):
            strange = quads[(quads < 0) | (quads >= len(points))][0]
            raise MeshError(f"a cell has the corner {strange}, but points are 0 to {len(points) - 1}", Remedy.MESH_FILE)
        phi, z = (_grid_lines(points[:, k]) for k in (0, 1))
        _check_tensor_grid((phi[1] * z[0].size + z[1])[quads], phi[0].size, z[0].size)
        degrees = {name: _degree(content, name) for name in ("phi_degree", "xi_degree")}
        if not z[0][0] < 0 < z[0][-1]:
            raise MeshError(NO_ZERO.format(z[0][0], z[0][-1]))
        return CylinderMesh(phi[0], z[0], **degrees)
    except MeshError as failure:
        raise MeshError(Message(Code.PLACED, place=str(path), reason=failure.message)) from failure


def _check_format(path: Path) -> None:
    if path.suffix not in FORMATS:
        raise MeshError(f'{path} has the ending "{path.suffix}"; it must be one of {", ".join(FORMATS)}')


def _as_meshio(mesh: CylinderMesh, impact: float, gmsh: bool) -> meshio.Mesh:
    """The mesh with its marked lines, as meshio holds it."""
    import meshio

    m, n = mesh.phi_lines.size, mesh.z_lines.size
    node, quads = np.arange(m * n).reshape(m, n), _cells(m, n)
    impacts = [("impact", node[i]) for i in np.flatnonzero(np.abs(np.sin(mesh.phi_lines - impact)) < SAME_LINE)]
    edges = [*impacts, *(("seam", node[i]) for i in (0, -1)), *(("truncation", node[:, i]) for i in (0, -1))]
    lines = np.concatenate([np.stack([nodes[:-1], nodes[1:]], axis=1) for _, nodes in edges])
    tags = np.concatenate([np.full(nodes.size - 1, MARKERS[name]) for name, nodes in edges])
    markers = [np.full(len(quads), MARKERS["domain"], dtype=np.int32), tags.astype(np.int32)]
    tags_of = {name: [tag + 1 for tag in markers] for name in ("gmsh:physical", "gmsh:geometrical")}
    degrees = {name: np.full(m * n, getattr(mesh, name), dtype=np.int32) for name in ("phi_degree", "xi_degree")}
    phi, z = np.meshgrid(mesh.phi_lines, mesh.z_lines, indexing="ij")
    points = np.stack([phi.ravel(), z.ravel(), np.zeros(m * n)], axis=1)
    names = {name: np.array([tag + 1, 2 if name == "domain" else 1]) for name, tag in MARKERS.items()}
    return meshio.Mesh(
        points,
        [("quad", quads), ("line", lines)],
        point_data=degrees,
        cell_data=tags_of if gmsh else {"marker": markers},
        field_data=names if gmsh else None,
    )


def _grid_lines(coordinates: FloatArray) -> tuple[FloatArray, IntArray]:
    """The distinct values among coordinates, and for each point the index of its own."""
    order = np.argsort(coordinates)
    steps = np.diff(coordinates[order]) > SAME_LINE * max(np.ptp(coordinates), 1e-300)
    index = np.empty(order.size, dtype=int)
    index[order] = np.concatenate([[0], np.cumsum(steps)])
    return coordinates[order][np.concatenate([[True], steps])], index


def _cells(m: int, n: int) -> IntArray:
    """The four corners of each cell of a grid of m × n nodes, which are numbered row by row."""
    node = np.arange(m * n).reshape(m, n)
    return np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)


def _check_tensor_grid(quads: IntArray, m: int, n: int) -> None:
    """Every cell of a grid of m × n nodes must be one quadrilateral, with the cell's four corners."""
    found, wanted = ({*map(tuple, np.sort(each, axis=1).tolist())} for each in (quads, _cells(m, n)))
    if found != wanted or len(quads) != len(wanted):
        raise MeshError(
            f"{len(quads)} quadrilaterals on {m} phi-lines and {n} xi-lines are not the full "
            f"tensor grid of {len(wanted)} cells; every phi-line must cross every xi-line"
        )


def _degree(content: meshio.Mesh, name: str) -> int:
    values = content.point_data.get(name)
    if values is None:
        return int(getattr(make_mesh(), name))
    degree = np.asarray(values).flat[0] if np.size(values) else 0
    if np.ndim(values) != 1 or not (np.all(values == degree) and 1 <= degree <= MAX_DEGREE and degree % 1 == 0):
        raise MeshError(f"the point data {name} must be one whole number from 1 to {MAX_DEGREE} throughout")
    return int(degree)
