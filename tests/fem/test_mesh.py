"""Meshes: what they must be, how they are made, written and read."""

import math

import meshio
import numpy as np
import pytest

from fpsolve import CylinderMesh, ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, make_mesh, moment_lyapunov
from fpsolve.errors import MeshError
from fpsolve.fem import Generator, read_mesh, write_mesh
from fpsolve.fem.mesh import MARKERS
from fpsolve.fem.space import Space
from fpsolve.model import CoefficientMatrix, Jump
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE, oracle_arguments
from tests.oracles import fourier_hermite

MESHES = {
    "default": {},
    "full circle": {"full_circle": True, "phi_cells": 3},
    "graded": {"xi_cells": 7, "grading": 4.0},
    "lopsided": {"xi_min": -3.0, "xi_max": 12.0, "phi_degree": 5, "xi_degree": 6},
}


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
@pytest.mark.parametrize("name", MESHES)
def test_a_written_mesh_is_read_back_exactly(tmp_path, name, ending):
    mesh = make_mesh(**MESHES[name])
    write_mesh(mesh, tmp_path / f"mesh{ending}")
    other = read_mesh(tmp_path / f"mesh{ending}")
    np.testing.assert_array_equal(other.phi_lines, mesh.phi_lines)
    np.testing.assert_array_equal(other.z_lines, mesh.z_lines)
    assert (other.phi_degree, other.xi_degree) == (mesh.phi_degree, mesh.xi_degree)
    assert [path.name for path in tmp_path.iterdir()] == [f"mesh{ending}"]


def test_lines_mark_impacts_seam_and_truncations(tmp_path):
    write_mesh(make_mesh(full_circle=True), tmp_path / "mesh.vtu")
    content = meshio.read(tmp_path / "mesh.vtu")
    lines, marker = content.cells_dict["line"], content.cell_data_dict["marker"]["line"]
    middle = content.points[lines].mean(axis=1)
    assert set(np.round(middle[marker == MARKERS["impact"], 0], 9)) == set(np.round([np.pi / 2, 3 * np.pi / 2], 9))
    assert set(np.round(middle[marker == MARKERS["seam"], 0], 9)) == {0, round(2 * np.pi, 9)}
    assert set(middle[marker == MARKERS["truncation"], 1]) == {-8, 8}
    assert np.all(content.cell_data_dict["marker"]["quad"] == MARKERS["domain"])


def test_gmsh_files_name_the_physical_groups(tmp_path):
    write_mesh(make_mesh(), tmp_path / "mesh.msh")
    assert set(meshio.read(tmp_path / "mesh.msh").field_data) == set(MARKERS)


def test_order_of_cells_and_points_in_a_file_does_not_matter(tmp_path, rng):
    mesh = make_mesh(xi_cells=5, grading=2.0)
    write_mesh(mesh, tmp_path / "mesh.vtu")
    content = meshio.read(tmp_path / "mesh.vtu")
    points, cells = rng.permutation(len(content.points)), rng.permutation(content.cells_dict["quad"])
    renumbered = np.argsort(points)[cells]
    meshio.Mesh(content.points[points], {"quad": renumbered[:, [2, 3, 0, 1]]}).write(tmp_path / "other.vtu")
    other = read_mesh(tmp_path / "other.vtu")
    np.testing.assert_array_equal(other.z_lines, mesh.z_lines)
    assert (other.phi_degree, other.xi_degree) == (make_mesh().phi_degree, make_mesh().xi_degree)


def test_grading_is_the_ratio_of_outermost_to_innermost_cells():
    for cells in (4, 7):
        sizes = np.diff(make_mesh(xi_cells=cells, grading=3.0).z_lines)
        assert sizes[0] == pytest.approx(3 * sizes[cells // 2])
        np.testing.assert_allclose(sizes, sizes[::-1])


def test_the_default_mesh_file_is_the_default_mesh():
    mesh, other = make_mesh(), read_mesh("meshes/default.vtu")
    np.testing.assert_array_equal(other.phi_lines, mesh.phi_lines)
    np.testing.assert_array_equal(other.z_lines, mesh.z_lines)
    assert (other.phi_degree, other.xi_degree) == (mesh.phi_degree, mesh.xi_degree)


@pytest.mark.parametrize(("name", "tolerance"), [("coarse", 3e-5), ("default", 1e-11), ("fine", 5e-13)])
def test_mesh_files_keep_what_the_readme_says_of_them(name, tolerance):
    noise = FIG1_NOISE.ou_reduction()
    result = moment_lyapunov(Problem(FIG1, noise), [2.0, 6.0], mesh=read_mesh(f"meshes/{name}.vtu"))
    arguments = oracle_arguments(FIG1, noise)
    exact = [fourier_hermite.moment_lyapunov(**arguments, p=p, harmonics=8, hermite=32) for p in (2.0, 6.0)]
    errors = np.abs(result.value - exact)
    assert np.all(errors <= tolerance * np.array(exact))
    assert np.all(errors <= 3 * result.error_estimate + 1e-14)


def test_a_bounded_noise_cuts_the_mesh_off_at_its_support():
    mesh = make_mesh(xi_cells=8).within(3.1)
    np.testing.assert_allclose(mesh.z_lines, [-3.1, -2, 0, 2, 3.1])
    assert make_mesh().within(np.inf).z_lines[-1] == 8
    np.testing.assert_allclose(make_mesh(xi_cells=8).within(4.001).z_lines, [-4.001, -2, 0, 2, 4.001])


def test_enriched_spaces_are_finer_at_every_degree():
    for degree in (1, 9, 19, 20):
        chosen = Space.on(make_mesh(phi_degree=degree, xi_degree=degree), UNIT_NOISE)
        finer = chosen.enriched()
        assert finer.phi.size > chosen.phi.size
        assert finer.xi.size > chosen.xi.size
        assert set(chosen.phi.lines) <= set(finer.phi.lines)
        assert set(chosen.xi.lines) <= set(finer.xi.lines)


GOOD = {"phi_lines": [np.pi / 2, 3 * np.pi / 2], "z_lines": [-8.0, 0.0, 8.0], "phi_degree": 4, "xi_degree": 4}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"phi_lines": [np.pi / 2, 3.0]}, "the phase spans 1.4292.*half circle, pi, or the circle, 2 pi"),
        ({"phi_lines": [np.pi / 2, 4.0, 3.0, 3 * np.pi / 2]}, "phi_lines must increase"),
        ({"z_lines": [-8.0, np.nan]}, "z_lines must be at least two finite numbers"),
        ({"z_lines": [1.0]}, "z_lines must be at least two finite numbers"),
        ({"z_lines": [-8.0, 1.0, 1.0 + 1e-12, 8.0]}, "no cell may be thinner"),
        ({"phi_degree": 0}, "phi_degree is 0; it must be a whole number from 1 to 20"),
        ({"xi_degree": 2.5}, "xi_degree is 2.5; it must be a whole number from 1 to 20"),
    ],
)
def test_impossible_meshes_are_refused(change, message):
    with pytest.raises(MeshError, match=message):
        CylinderMesh(**(GOOD | change))


@pytest.mark.parametrize(
    ("phi_lines", "message"),
    [
        ([0, np.pi], r"1 impact line\(s\) expected at phi = pi/2 \+ k pi, 0 found"),
        ([0, np.pi / 2, 2 * np.pi], r"2 impact line\(s\) expected"),
    ],
)
def test_generators_need_a_line_at_every_impact(phi_lines, message):
    with pytest.raises(MeshError, match=message):
        Generator(Problem(FIG1, UNIT_NOISE), CylinderMesh(**(GOOD | {"phi_lines": phi_lines})))


def test_meshes_without_zero_noise_are_refused():
    with pytest.raises(MeshError, match=r"\[1, 8\] must contain 0 inside.*choose xi_min < 0 < xi_max"):
        make_mesh(xi_min=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"phi_cells": 0}, "phi_cells is 0; it must be a whole number from 1 to 1000"),
        ({"xi_cells": 1001}, "xi_cells is 1001"),
        ({"grading": -1.0}, "grading is -1.0; it must be a number from 0.01 to 100"),
    ],
)
def test_impossible_numbers_are_refused(change, message):
    with pytest.raises(MeshError, match=message):
        make_mesh(**change)


def write_raw(path, points, quads, **data):
    meshio.Mesh(np.array(points, dtype=float), {"quad": np.array(quads)}, **data).write(path)


HALF = [[np.pi / 2, -8, 0], [3 * np.pi / 2, -8, 0], [3 * np.pi / 2, 8, 0], [np.pi / 2, 8, 0]]


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
@pytest.mark.parametrize("content", ["", "no mesh at all"])
def test_unreadable_files_are_refused(tmp_path, content, ending):
    path = tmp_path / f"bad{ending}"
    path.write_text(content)
    with pytest.raises(MeshError, match=rf"bad{ending} cannot be read as a {ending} mesh .*make one with `write_mesh`"):
        read_mesh(path)


def test_missing_files_folders_and_endings_are_refused(tmp_path):
    (tmp_path / "folder.vtu").mkdir()
    for name, message in (("no.vtu", "does not exist"), ("folder.vtu", "is not a file"), ("mesh.stl", 'ending ".stl"')):
        with pytest.raises(MeshError, match=message):
            read_mesh(tmp_path / name)
    with pytest.raises(MeshError, match=r"cannot be written.*choose another place"):
        write_mesh(make_mesh(), "/proc/none/mesh.vtu")


def test_meshes_of_other_shapes_are_refused(tmp_path):
    path = tmp_path / "mesh.vtu"
    meshio.Mesh(np.array(HALF), {"triangle": np.array([[0, 1, 2], [0, 2, 3]])}).write(path)
    with pytest.raises(MeshError, match=r"holds triangle; every cell must be a quadrilateral"):
        read_mesh(path)
    write_raw(path, [*HALF, [3.0, 0, 0]], [[0, 1, 2, 4]])
    with pytest.raises(MeshError, match=r"not the full tensor grid of 4 cells"):
        read_mesh(path)
    write_raw(path, np.array(HALF) + [[0.1, 0, 0]] * 4, [[0, 1, 2, 3]])
    with pytest.raises(MeshError, match="put a line of the mesh at each impact"):
        Generator(Problem(FIG1, UNIT_NOISE), read_mesh(path))
    write_raw(path, HALF, [[0, 1, 2, 3], [0, 1, 2, 3]])
    with pytest.raises(MeshError, match=r"2 quadrilaterals .* not the full tensor grid of 1 cells"):
        read_mesh(path)
    write_raw(path, HALF, [[0, 1, 2, 3]], point_data={"phi_degree": np.array([3, 3, 4, 3])})
    with pytest.raises(MeshError, match=r"phi_degree must be one whole number from 1 to 20 throughout"):
        read_mesh(path)


def test_cells_beyond_the_points_are_refused(tmp_path):
    path = tmp_path / "mesh.vtu"
    for corner in (-1, 4):
        write_raw(path, HALF, [[0, 1, 2, corner]])
        with pytest.raises(MeshError, match=f"a cell has the corner {corner}, but points are 0 to 3; make one with"):
            read_mesh(path)
    write_raw(path, [[np.nan, 0, 0], *HALF[1:]], [[0, 1, 2, 3]])
    with pytest.raises(MeshError, match="the points must be finite"):
        read_mesh(path)


@pytest.mark.parametrize("values", [np.full((4, 3), 5), np.full((4, 1), 5), np.full(4, 1e300), np.full(4, np.nan)])
def test_degrees_that_are_none_are_refused(tmp_path, values):
    path = tmp_path / "mesh.vtu"
    write_raw(path, HALF, [[0, 1, 2, 3]], point_data={"xi_degree": values})
    with pytest.raises(MeshError, match="xi_degree must be one whole number from 1 to 20 throughout"):
        read_mesh(path)


@pytest.mark.slow
def test_a_phase_that_turns_back_for_ordinary_noise_alone():
    """v̇ = −(1 − 3e^(−ξ²))x − 0.2v: the phase runs one way at both ends of the mesh and back between."""
    terms = (
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))),
        CoefficientMatrix(1, ((0.0, 0.0), (3.0, 0.0)), lambda xi: np.exp(-(xi**2))),
    )
    problem = Problem(PlaneSystem(terms, [Jump(math.pi / 2, math.log(0.8))]), OrnsteinUhlenbeck(alpha=1.0, sigma=0.7))
    own, meshed = (ExponentSolver(problem, mesh=mesh, rtol=1e-6).solution(2.0) for mesh in (None, make_mesh()))
    assert own.error < 1e-5
    assert abs(own.pair.value - meshed.pair.value) <= own.error + meshed.error
