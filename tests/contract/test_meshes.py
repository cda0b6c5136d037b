"""Meshes of the phase and the noise: how they are made, written, read, and printed with what stands on them."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator, make_mesh, moment_lyapunov
from fpsolve.fem import Generator, read_mesh, write_mesh
from fpsolve.model import CoefficientMatrix, Jump, PlaneSystem
from tests.oracles.planar import series

SHIPPED = Path(__file__).parents[2] / "meshes"
FIG1 = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1),
    NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction(),
)
MESHES = {
    "default": {},
    "full circle": {"full_circle": True, "phi_cells": 3},
    "graded": {"xi_cells": 7, "grading": 4.0},
    "lopsided": {"xi_min": -3.0, "xi_max": 12.0, "phi_degree": 5, "xi_degree": 6},
}


def check_same(mesh, other):
    np.testing.assert_array_equal(other.phi_lines, mesh.phi_lines)
    np.testing.assert_array_equal(other.z_lines, mesh.z_lines)
    assert (other.phi_degree, other.xi_degree) == (mesh.phi_degree, mesh.xi_degree)


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
@pytest.mark.parametrize("options", MESHES.values(), ids=MESHES)
def test_written_mesh_is_read_back_exactly(tmp_path, options, ending):
    write_mesh(make_mesh(**options), tmp_path / f"mesh{ending}")
    check_same(make_mesh(**options), read_mesh(tmp_path / f"mesh{ending}"))
    assert [path.name for path in tmp_path.iterdir()] == [f"mesh{ending}"]


def test_shipped_default_mesh_is_that_of_make_mesh():
    check_same(make_mesh(), read_mesh(SHIPPED / "default.vtu"))


def test_written_mesh_marks_impacts_seam_and_truncations(tmp_path):
    for ending in ("vtu", "msh"):
        write_mesh(make_mesh(full_circle=True), tmp_path / f"mesh.{ending}")
    marks = {name: number - 1 for name, (number, _) in meshio.read(tmp_path / "mesh.msh").field_data.items()}
    assert set(marks) == {"impact", "seam", "truncation", "domain"}
    content = meshio.read(tmp_path / "mesh.vtu")
    lines, marker = content.cells_dict["line"], content.cell_data_dict["marker"]
    middle = content.points[lines].mean(axis=1)
    for name, axis, places in (
        ("impact", 0, {np.pi / 2, 3 * np.pi / 2}),
        ("seam", 0, {0, 2 * np.pi}),
        ("truncation", 1, {-8, 8}),
    ):
        assert {*middle[marker["line"] == marks[name], axis].round(9)} == {*np.round([*places], 9)}, name
    assert np.all(marker["quad"] == marks["domain"])


def test_order_of_cells_and_points_in_a_mesh_file_does_not_matter(tmp_path, rng):
    mesh = make_mesh(xi_cells=5, grading=2.0)
    write_mesh(mesh, tmp_path / "mesh.vtu")
    content = meshio.read(tmp_path / "mesh.vtu")
    points, cells = rng.permutation(len(content.points)), rng.permutation(content.cells_dict["quad"])
    renumbered = np.argsort(points)[cells]
    meshio.Mesh(content.points[points], {"quad": renumbered[:, [2, 3, 0, 1]]}).write(tmp_path / "other.vtu")
    check_same(mesh, read_mesh(tmp_path / "other.vtu"))


def test_grading_is_the_ratio_of_outermost_to_innermost_cells():
    for cells in (4, 7):
        sizes = np.diff(make_mesh(xi_cells=cells, grading=3.0).z_lines)
        assert sizes[0] == pytest.approx(3 * sizes[cells // 2])
        np.testing.assert_allclose(sizes, sizes[::-1])


def test_bounded_noise_cuts_a_mesh_off_at_its_support():
    mesh = make_mesh(xi_cells=8)
    for end in (3.1, 4.001):
        np.testing.assert_allclose(mesh.within(end).z_lines, [-end, -2, 0, 2, end])
    assert mesh.within(np.inf).z_lines[-1] == 8


@pytest.mark.parametrize(
    ("name", "tolerance"), [("coarse", 3e-5), ("default", 1e-11), pytest.param("fine", 5e-13, marks=pytest.mark.slow)]
)
def test_error_on_a_shipped_mesh_is_what_the_readme_says(name, tolerance):
    p = [2.0, 6.0]
    found = moment_lyapunov(FIG1, p, mesh=read_mesh(SHIPPED / f"{name}.vtu"))
    exact = np.array([series(FIG1, each, 8, 32) for each in p])
    errors = np.abs(found.value - exact)
    assert np.all(errors <= tolerance * exact)
    assert np.all(errors <= 3 * found.error_estimate + 1e-14)


@pytest.mark.slow
def test_moments_on_a_mesh_are_those_without_where_the_phase_turns_back_for_ordinary_noise_alone():
    """The phase runs one way at both ends of the mesh and back between."""
    terms = (
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))),
        CoefficientMatrix(1, ((0.0, 0.0), (3.0, 0.0)), lambda xi: np.exp(-(xi**2))),
    )
    wall = Jump(0.5 * np.pi, np.log(0.8))
    problem = Problem(PlaneSystem(terms, [wall]), OrnsteinUhlenbeck(alpha=1.0, sigma=0.7))
    own, meshed = (moment_lyapunov(problem, 2.0, rtol=1e-6, mesh=mesh) for mesh in (None, make_mesh()))
    assert own.error_estimate[0] < 1e-5
    assert abs(own.value[0] - meshed.value[0]) <= own.error_estimate[0] + meshed.error_estimate[0]


def test_generator_prints_its_terms():
    text = str(Generator(Problem(FIG1.system, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)), make_mesh()))
    for line in (
        "L_ξ, the generator of the noise",
        "1 ∂φ",
        "ε ξ (0.5 sin 2φ) ∂φ",
        "p ε ξ (0.5 − 0.5 cos 2φ)",
        "ε² (0.05 sin 2φ) ∂φ",
        "p ε² (0.05 − 0.05 cos 2φ)",
        "(R^p − 1) |dφ/dt| δ(φ − 1.5708 mod π), R = 0.998002",
    ):
        assert line in text, text
