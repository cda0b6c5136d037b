"""ParaView files: what pyvista and ParaView itself read back from them, and the script that draws them."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
import pyvista
from vtkmodules.vtkCommonDataModel import vtkLagrangeQuadrilateral

from fpsolve.case.case import load_case
from fpsolve.exponent.eigen import principal_pair
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import CylinderMesh, make_mesh
from fpsolve.model.noise import NonGaussianNoise
from fpsolve.model.problem import Problem
from fpsolve.model.vibro_impact import VibroImpactOscillator
from fpsolve.output.vtk import copy_show_script, write_density, write_eigenfunctions, write_response
from fpsolve.study import sweep
from fpsolve.workflow import run
from tests.conftest import FIG1, UNIT_NOISE
from tests.oracles.perturbation import first_order_eigenfunction

HARD = VibroImpactOscillator(omega=1.0, restitution=0.3, c1=0.1, epsilon=0.2)
FINE = {"phi_degree": 14, "xi_cells": 8}
ROOT = Path(__file__).parents[2]
MOMENTS = (-1.0, 0.0, 2.0)
INSTALL = "apt-get install --no-install-recommends paraview python3-paraview xvfb xauth"
QUARTERS = np.pi * np.array([-0.3, 0.1, 0.5, 0.8, 1.2, 1.5, 1.7])
MESHES = {
    "half circle": make_mesh(phi_cells=4, **FINE),
    "half circle, cells across 0 and pi": make_mesh(phi_cells=3, **FINE),
    "full circle": make_mesh(phi_cells=4, full_circle=True, **FINE),
    "full circle, seam at -0.3 pi": CylinderMesh(QUARTERS, np.linspace(-8, 8, 9), 14, 9),
    "half circle, seam at 7.2 pi": CylinderMesh(np.pi * np.array([7.2, 7.5, 7.9, 8.2]), np.linspace(-8, 8, 9), 14, 9),
}
COARSE = make_mesh(phi_cells=4, phi_degree=6, xi_cells=8)
"""For pictures, which ParaView draws sooner."""


def written(folder, solver, moments=MOMENTS, **options):
    """Write eigenfunctions of a solver at some p, and read them back: {p: grid}."""
    pairs = [solver.pair(p) for p in moments]
    _, *files = write_eigenfunctions(folder, pairs, solver.pair(0.0), **options)
    return {float(grid.field_data["p"][0]): grid for grid in map(pyvista.read, files)}


@pytest.fixture(scope="module", params=MESHES)
def solver(request):
    return ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES[request.param])


@pytest.fixture(scope="module")
def grids(solver, tmp_path_factory):
    return written(tmp_path_factory.mktemp("vtk"), solver)


def sides(grid, phi, name):
    """The values of an array at phi from the left and from the right, over ξ."""
    left, right = (grid.cell_centers().points[:, 0] < phi), (grid.cell_centers().points[:, 0] > phi)
    found = []
    for side in (left, right):
        points = np.unique(grid.cell_connectivity.reshape(grid.n_cells, -1)[side])
        points = points[np.abs(grid.points[points, 0] - phi) < 1e-9]
        found.append(grid[name][points[np.argsort(grid.points[points, 1])]])
    return found


def integral(grid, name):
    """∫ of the Lagrange polynomials of an array, or of given values, their nodes numbered by VTK's own function."""
    values = grid[name] if isinstance(name, str) else name
    k = round(np.sqrt(grid.cell_connectivity.size / grid.n_cells)) - 1
    order = [vtkLagrangeQuadrilateral.PointIndexFromIJK(i, j, [k, k]) for i in range(k + 1) for j in range(k + 1)]
    nodes = grid.cell_connectivity.reshape(grid.n_cells, -1)[:, order]
    t = np.arange(k + 1) / k
    rule = np.linalg.solve(np.vander(t, increasing=True).T, 1 / np.arange(1, k + 2))
    areas = np.prod(np.ptp(grid.points[nodes], axis=1)[:, :2], axis=1)
    return areas @ values[nodes] @ np.outer(rule, rule).ravel()


@pytest.mark.parametrize("phi", [np.pi / 2, 3 * np.pi / 2])
@pytest.mark.parametrize("p", MOMENTS)
def test_jump_at_the_impacts(grids, p, phi):
    """T(φ⁻) = R^p T(φ⁺) at every ξ where the tilted density lives; and T* jumps the other way."""
    (before, after), density = sides(grids[p], phi, "T"), sides(grids[p], phi, "tilted_density")[0]
    living = density > 1e-4 * density.max()
    assert np.count_nonzero(living) > 60
    np.testing.assert_allclose((before / after)[living], HARD.impact_factor(p), rtol=1e-8)
    before, after = sides(grids[p], phi, "T_adjoint")
    np.testing.assert_allclose((after / before)[living], HARD.impact_factor(p), rtol=1e-6)


def test_nothing_else_jumps(grids):
    grid = grids[2.0]
    corners = grid.points[grid.cell_connectivity.reshape(grid.n_cells, -1)[:, 0], 0]
    for phi in np.unique(np.round(corners, 12)):
        if abs(np.cos(phi)) > 1e-6 and phi > 0:
            before, after = sides(grid, phi, "tilted_density")
            np.testing.assert_allclose(before, after, atol=1e-7)


def test_full_circle_is_covered_once(grids):
    grid = grids[2.0]
    assert set(grid.celltypes) == {pyvista.CellType.LAGRANGE_QUADRILATERAL}
    np.testing.assert_allclose(grid.bounds[:2], [0, 2 * np.pi], rtol=1e-15)
    np.testing.assert_allclose(grid.bounds[2:4], np.array([-8, 8]) * UNIT_NOISE.standard_deviation)
    assert integral(grid, np.ones(grid.n_points)) == pytest.approx(
        2 * np.pi * 16 * UNIT_NOISE.standard_deviation, rel=1e-12
    )


@pytest.mark.parametrize("p", MOMENTS)
def test_point_data(grids, p):
    grid = grids[p]
    assert set(grid.point_data) == {"T", "T_adjoint", "tilted_density", "stationary_density", "z"}
    for name in grid.point_data:
        assert grid[name].dtype == np.float64
        assert np.all(np.isfinite(grid[name]))
    np.testing.assert_allclose(grid["z"], grid.points[:, 1] / UNIT_NOISE.standard_deviation)
    np.testing.assert_allclose(grid["tilted_density"], grid["T"] * grid["T_adjoint"])
    for name in ("tilted_density", "stationary_density"):
        assert integral(grid, name) == pytest.approx(1, abs=1e-6)
    weight = UNIT_NOISE.density(grid.points[:, 1]) / (2 * np.pi)
    assert integral(grid, grid["T"] * weight) == pytest.approx(1, abs=1e-6)


def test_at_p_zero(grids):
    np.testing.assert_allclose(grids[0.0]["T"], 1, rtol=1e-7)
    np.testing.assert_allclose(grids[0.0]["T_adjoint"], grids[2.0]["stationary_density"], atol=1e-14)


def test_field_data(solver, grids):
    for p, grid in grids.items():
        assert set(grid.field_data) == {"p", "Lambda"}
        assert grid.field_data["Lambda"][0] == solver.pair(p).value


def test_parameters_are_field_data(tmp_path, fig1_solver):
    pair, parameters = fig1_solver.pair(0.0), {"oscillator.epsilon": 0.1, "oscillator.impact": "delta", "noise.D0": 1.0}
    _, file = write_eigenfunctions(tmp_path, [pair], pair, parameters=parameters)
    for path in (file, write_density(tmp_path / "density.vtu", pair, parameters)):
        found = pyvista.read(path).field_data
        assert {name: found[name][0] for name in parameters} == parameters


def test_files_of_a_curve_hold_its_parameters(tmp_path):
    case = load_case(ROOT / "cases/minimal.toml", ["oscillator.omega=1.25", 'vary."noise.D0"=[0.5, 0.75]'])
    run(case, tmp_path)
    files = sorted(tmp_path.rglob("*.vtu"))
    assert {file.parent.name for file in files} == {"eigenfunctions", "eigenfunctions-2", case.name}
    for file in files:
        data = pyvista.read(file).field_data
        assert data["noise.D0"][0] == (0.75 if file.parent.name == "eigenfunctions-2" else 0.5)
        assert data["oscillator.omega"][0] == 1.25
        assert data["noise.treatment"][0] == "ou-reduction"
        assert data["curve"][0] == (2 if file.parent.name == "eigenfunctions-2" else 1)
        assert data["varied"][0] == f"noise.D0 = {data['noise.D0'][0]:g} (1/time)"
        assert data["held"][0].splitlines() == [
            "oscillator: omega = 1.25 (rad/time), restitution = 0.8, c1 = 0.1 (1/time), epsilon = 0.1,",
            "c2 = 0 (1/(time length^2)), c3 = 0 (time/length^2), impact = delta",
            "noise: tau0 = 0.5 (time), r0 = 0.95, treatment = ou-reduction",
        ]
        assert float(file.stem.removeprefix("p") if file.stem != "density" else 0) == data["p"][0]


TWO = 'vary."noise.D0"=[0.75, 0.5]'


@pytest.mark.parametrize(
    ("overrides", "times", "names"),
    [
        ([TWO], [0.5, 0.75], ["noise.D0 = 0.5, p = 1.5", "noise.D0 = 0.75, p = 1.5"]),
        (
            [TWO, 'vary."noise.treatment"=["ou-reduction"]'],
            [0.5, 0.75],
            [f"noise.D0 = {D0}, noise.treatment = ou-reduction, p = 1.5" for D0 in (0.5, 0.75)],
        ),
        (
            ['vary."noise.treatment"=["exact", "ou-reduction"]'],
            [1, 2],
            [f"curve {k}: noise.treatment = {name}, p = 1.5" for k, name in ((1, "exact"), (2, "ou-reduction"))],
        ),
    ],
)
def test_series_over_the_curves(tmp_path, overrides, times, names):
    """At the p next to 2; the time is the one number that is varied, or else the number of the curve."""
    case = load_case(ROOT / "cases/minimal.toml", ["moments.p=[-1.0, 1.5, 4.0]", "expect=[]", *overrides])
    run(case, tmp_path)
    series = tmp_path / case.name / "curves.pvd"
    sets = ElementTree.parse(series).findall("Collection/DataSet")
    assert [float(each.get("timestep")) for each in sets] == times
    assert [each.get("name") for each in sets] == names
    for time, each in zip(times, sets, strict=True):
        data = pyvista.read(series.parent / each.get("file")).field_data
        assert data["p"][0] == 1.5
        assert time in (data["noise.D0"][0], data["curve"][0])
    reader = pyvista.PVDReader(series)
    assert list(reader.time_values) == times
    for time in times:
        reader.set_active_time_value(time)
        [grid] = reader.read()
        assert time in (grid.field_data["noise.D0"][0], grid.field_data["curve"][0])


def test_a_run_that_ends_early_lists_the_curves_that_are_there(tmp_path, monkeypatch):
    case = load_case(ROOT / "cases/minimal.toml", ["expect=[]", 'vary."noise.D0"=[0.5, 0.75, 1.0]'])
    run(case, tmp_path)
    series = tmp_path / case.name / "curves.pvd"
    assert len(pyvista.PVDReader(series).time_values) == 3
    solve = sweep.solve_curve

    def interrupted(curve, *arguments):
        if curve.number == 3:
            raise KeyboardInterrupt
        return solve(curve, *arguments)

    monkeypatch.setattr(sweep, "solve_curve", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(case, tmp_path, fresh=True)
    assert list(pyvista.PVDReader(series).time_values) == [0.5, 0.75]
    monkeypatch.undo()
    run(load_case(case.path, ["output.eigenfunctions=[]", "expect=[]"]), tmp_path)
    assert not series.exists()


def test_what_is_shown_first(tmp_path, fig1_solver):
    """ParaView colours by the active scalars when it opens a file."""
    pair = fig1_solver.pair(0.0)
    _, file = write_eigenfunctions(tmp_path, [pair], pair)
    for path, name in ((file, "T"), (write_density(tmp_path / "density.vtu", pair), "stationary_density")):
        head, _, _ = path.read_text().partition("<AppendedData")
        assert f'<PointData Scalars="{name}">' in head


def test_periodic_by_pi(grids):
    at = np.stack(np.meshgrid(np.linspace(0.01, 3.1, 40), np.linspace(-2, 2, 9), [0.0]), axis=-1).reshape(-1, 3)
    one, other = (pyvista.PolyData(points).sample(grids[2.0])["T"] for points in (at, at + np.array([np.pi, 0, 0])))
    np.testing.assert_allclose(one, other, rtol=1e-4)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    return written(
        tmp_path_factory.mktemp("reference"), ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES["half circle"])
    )


@pytest.mark.parametrize("name", ["T", "T_adjoint", "stationary_density"])
def test_every_mesh_shows_the_same_field(grids, reference, name):
    """Interpolated by VTK itself, at random points."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(0, 2 * np.pi, 300), rng.uniform(-2, 2, 300), np.zeros(300)])
    one, other = (pyvista.PolyData(points).sample(grid[2.0])[name] for grid in (grids, reference))
    np.testing.assert_allclose(one, other, atol=2e-4 * np.abs(other).max())


def test_nodes_are_on_the_polynomials(tmp_path):
    """Values from the file against the elements evaluated at the middle of every mesh cell, in both half turns."""
    solver = ExponentSolver(Problem(HARD, UNIT_NOISE), make_mesh(phi_cells=3, phi_degree=4, xi_cells=6, xi_degree=4))
    pair, grid = solver.pair(1.0), written(tmp_path, solver, [1.0])[1.0]
    space, lines = pair.space, pair.generator.chosen.z_lines
    phi, z = 0.5 * (space.phi.lines[1:] + space.phi.lines[:-1]), 0.5 * (lines[1:] + lines[:-1])
    at_xi = space.xi.at(z)
    values = space.evaluate(pair.right, space.phi.at(phi), at_xi.values)
    for turn in (0, np.pi):
        x, y = np.meshgrid((phi + turn) % (2 * np.pi), at_xi.xi, indexing="ij")
        points = pyvista.PolyData(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3))
        np.testing.assert_allclose(points.sample(grid)["T"].reshape(values.shape), values, rtol=1e-7)


def test_first_order_eigenfunction(tmp_path):
    """T = 1 + ε T₁ + O(ε²), Eq. (33)."""
    errors = []
    for eps in (0.02, 0.01, 0.005):
        oscillator = VibroImpactOscillator(omega=1.0, restitution=0.5, c1=0.1, epsilon=eps)
        grid = written(tmp_path / str(eps), ExponentSolver(Problem(oscillator, UNIT_NOISE)), [2.0])[2.0]
        near = np.abs(grid["z"]) < 3
        phi, xi, _ = grid.points[near].T
        first = first_order_eigenfunction(oscillator, UNIT_NOISE, 2.0, phi, xi)
        errors.append(np.abs(grid["T"][near] - 1 - eps * first).max())
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.1)


def test_stationary_pair_may_be_of_another_mesh(tmp_path):
    coarse, fine = (ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES[k]) for k in list(MESHES)[:2])
    _, own = write_eigenfunctions(tmp_path / "own", [coarse.pair(2.0)], coarse.pair(0.0))
    _, other = write_eigenfunctions(tmp_path / "other", [coarse.pair(2.0)], fine.pair(0.0))
    one, two = (pyvista.read(file)["stationary_density"] for file in (own, other))
    np.testing.assert_allclose(one, two, atol=1e-8)


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 11])
def test_any_degree(tmp_path, degree):
    solver = ExponentSolver(
        Problem(FIG1, UNIT_NOISE), make_mesh(phi_cells=9, phi_degree=degree, xi_cells=9, xi_degree=degree)
    )
    grid = written(tmp_path, solver, [1.0])[1.0]
    assert np.all(np.isfinite(grid["T"]))
    assert integral(grid, "tilted_density") == pytest.approx(1, abs=2e-2)


def test_bounded_noise(tmp_path):
    """r₀ < 1: P_s vanishes at the ends, and nothing is undefined there."""
    noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=-1.0)
    grid = written(tmp_path, ExponentSolver(Problem(HARD, noise)), [2.0])[2.0]
    assert np.abs(grid.points[:, 1]).max() == pytest.approx(noise.half_width)
    assert all(np.all(np.isfinite(grid[name])) for name in grid.point_data)
    assert grid["T_adjoint"][np.abs(grid["z"]) == grid["z"].max()] == pytest.approx(0, abs=1e-6)


def test_far_out_where_the_density_is_tiny(tmp_path):
    mesh = make_mesh(phi_degree=6, xi_cells=90, xi_degree=2, xi_min=-37, xi_max=8)
    pair = principal_pair(Generator(Problem(FIG1, UNIT_NOISE), mesh), 0.0)
    grid = pyvista.read(write_eigenfunctions(tmp_path, [pair], pair)[1])
    assert all(np.all(np.isfinite(grid[name])) for name in grid.point_data)
    assert np.abs(grid["T_adjoint"][grid["z"] < -30]).max() < 1e-100


def test_collection(tmp_path, fig1_solver):
    """Valid XML over increasing p, one file for each p however close, and nothing else in the folder."""
    moments = [2.0, 0.1 + 0.2, 0.3, -1.0, 1e-7, 0.3]
    pairs = [fig1_solver.pair(p) for p in moments]
    files = write_eigenfunctions(tmp_path, pairs, fig1_solver.pair(0.0), "eigenfunctions-2")
    assert files[0] == tmp_path / "eigenfunctions-2.pvd"
    assert len(files[0].read_text().splitlines()) == 5 + len(files) - 1
    sets = ElementTree.parse(files[0]).findall("Collection/DataSet")
    assert [float(s.get("timestep")) for s in sets] == sorted(set(moments))
    assert [tmp_path / s.get("file") for s in sets] == files[1:]
    assert {k for k in tmp_path.rglob("*") if k.is_file()} == set(files)
    for s in sets:
        assert not Path(s.get("file")).is_absolute()
        assert pyvista.read(tmp_path / s.get("file")).field_data["p"][0] == float(s.get("timestep"))
    assert list(pyvista.PVDReader(files[0]).time_values) == sorted(set(moments))


def test_files_are_small(tmp_path, fig1_solver):
    _, file = write_eigenfunctions(tmp_path, [fig1_solver.pair(2.0)], fig1_solver.pair(0.0))
    assert file.stat().st_size < 400e3


def test_density_file(tmp_path, solver):
    grid = pyvista.read(write_density(tmp_path / "density.vtu", solver.pair(0.0)))
    assert set(grid.point_data) == {"stationary_density", "phi_marginal", "xi_marginal", "z"}
    found = {name: float(values[0]) for name, values in grid.field_data.items()}
    assert found == {"p": 0, "Lambda": 0, "lyapunov_exponent": solver.pair(0.0).derivative}
    assert integral(grid, "stationary_density") == pytest.approx(1, abs=1e-6)
    width = 16 * UNIT_NOISE.standard_deviation
    assert integral(grid, "phi_marginal") == pytest.approx(width, rel=1e-8)
    np.testing.assert_allclose(grid["xi_marginal"], UNIT_NOISE.density(grid.points[:, 1]), atol=1e-10)


@pytest.fixture
def simulated():
    """A simulated curve with a joint density of x and v."""
    edges, density = np.linspace(0, 3, 101), np.random.default_rng(0).random((100, 80))
    response = SimpleNamespace(x_edges=edges, v_edges=np.linspace(-2, 2, 81), density=density)
    case = load_case(ROOT / "cases/minimal.toml", ["expect=[]", 'vary."noise.D0"=[0.5, 0.75]', "oscillator.c2=0.1"])
    _, curve = case.curves()
    found = SimpleNamespace(lyapunov_exponent=-0.001, lyapunov_exponent_error=1e-5)
    return SimpleNamespace(response=response, curve=curve, result=found)


def test_response_file(tmp_path, simulated):
    write_response(simulated, tmp_path)
    grid = pyvista.read(tmp_path / "response-2.vti")
    assert grid.bounds == pytest.approx((0, 3, -2, 2, 0, 0))
    np.testing.assert_array_equal(grid.cell_data["density"].reshape(80, 100).T, simulated.response.density)
    known = {name: values[0] for name, values in grid.field_data.items()}
    assert known.items() >= simulated.curve.parameters.items()
    assert (known["varied"], known["curve"]) == ("noise.D0 = 0.75 (1/time)", 2)
    assert (known["lyapunov_exponent"], known["lyapunov_exponent_error"]) == (-0.001, 1e-5)


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
def test_a_response_that_does_not_fit_on_the_disk_is_not_left_in_part(tmp_path, simulated):
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        with pytest.raises(OSError, match=r"response-2\.vti"):
            write_response(simulated, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


def test_writing_loads_nothing_that_draws(tmp_path):
    """It must work without display, OpenGL or EGL."""
    code = f"""
import sys
from pathlib import Path
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.problem import Problem
from fpsolve.output.vtk import write_eigenfunctions
from tests.conftest import FIG1, UNIT_NOISE
assert "pyvista" not in sys.modules
pair = ExponentSolver(Problem(FIG1, UNIT_NOISE)).pair(0.0)
write_eigenfunctions(Path({str(tmp_path)!r}), [pair], pair)
print([name for name in sys.modules if "vtkRendering" in name])
"""
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=True, env=environment, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    assert done.stdout.strip() == "[]"


def test_script_needs_only_the_standard_library_and_paraview(tmp_path):
    script = copy_show_script(tmp_path)
    imports = [
        node for node in ast.walk(ast.parse(script.read_text())) if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    names = {getattr(node, "module", None) or node.names[0].name for node in imports}
    assert names - {"paraview"} <= sys.stdlib_module_names
    assert f"FOLDER = {str(tmp_path)!r}" in script.read_text()


@pytest.fixture(scope="module")
def paraview():
    """Runs a script in ParaView's Python, on a virtual display that says when it is ready."""
    server, python = shutil.which("Xvfb"), shutil.which("pvpython")
    if not (server and python):
        message = f"ParaView is missing: {INSTALL}"
        if os.environ.get("FPSOLVE_REQUIRE_PARAVIEW"):
            pytest.fail(message)
        pytest.skip(message)
    ready, tell = os.pipe()
    display = subprocess.Popen(
        [server, "-displayfd", str(tell), "-noreset", "-screen", "0", "1280x1024x24"], pass_fds=[tell]
    )
    os.close(tell)
    with os.fdopen(ready) as stream:
        number = stream.readline().strip()
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["DISPLAY"] = f":{number}"

    def run(folder, *arguments):
        words = [python, *map(str, arguments)]
        return subprocess.run(words, capture_output=True, text=True, cwd=folder, env=environment, timeout=300)

    yield run
    display.terminate()
    display.wait()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    written(folder, ExponentSolver(Problem(HARD, UNIT_NOISE), COARSE))
    copy_show_script(folder)
    return folder


READ = """
import json, math, sys
from paraview import servermanager, simple
reader = simple.PVDReader(FileName=sys.argv[1])
jumps, fields = {}, {}
for p in reader.TimestepValues:
    reader.UpdatePipeline(p)
    grid = servermanager.Fetch(reader)
    values = grid.GetPointData().GetArray("T")
    density = grid.GetPointData().GetArray("tilted_density")
    fields[p] = [grid.GetFieldData().GetArray(name).GetValue(0) for name in ("p", "Lambda")]
    sides = {}
    for k in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(k)
        low, high = cell.GetBounds()[:2]
        for m in range(cell.GetNumberOfPoints()):
            phi, xi = cell.GetPoints().GetPoint(m)[:2]
            i = cell.GetPointId(m)
            if abs(math.cos(phi)) < 1e-12 and density.GetValue(i) > 1e-5:
                sides.setdefault((round(phi), xi), {})["left" if phi == high else "right"] = values.GetValue(i)
    jumps[p] = [(phi, pair["left"] / pair["right"]) for (phi, xi), pair in sides.items()]
kinds = {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())}
print(json.dumps({"jumps": jumps, "fields": fields, "kinds": sorted(kinds)}))
"""


def test_paraview_reads_the_collection(paraview, tmp_path):
    solver = ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES["half circle"])
    written(tmp_path, solver)
    script = tmp_path / "read.py"
    script.write_text(READ)
    done = paraview(tmp_path, script, tmp_path / "eigenfunctions.pvd")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [float(p) for p in found["jumps"]] == list(MOMENTS)
    assert found["kinds"] == [70]  # VTK_LAGRANGE_QUADRILATERAL
    for p, jumps in found["jumps"].items():
        assert found["fields"][p] == pytest.approx([float(p), solver.pair(float(p)).value], abs=1e-14)
        lines, ratios = np.transpose(jumps)
        assert {int(k) for k in lines} == {2, 5}  # π/2 and 3π/2, rounded
        assert ratios.size > 120
        np.testing.assert_allclose(ratios, HARD.impact_factor(float(p)), rtol=1e-8)


def assert_picture(file):
    """Not blank, and neither noise: white around, and many colours inside."""
    picture = matplotlib.image.imread(file)[:, :, :3]
    assert picture.shape == (1000, 1600, 3)
    assert 0.3 < np.mean(np.all(picture == 1, axis=2)) < 0.95
    assert len(np.unique((picture * 255).astype(int).reshape(-1, 3), axis=0)) > 300


@pytest.mark.parametrize(
    ("arguments", "picture"),
    [
        ([], "eigenfunctions.png"),
        (["--field", "T_adjoint"], "eigenfunctions-T_adjoint.png"),
        (["--cylinder", "--field", "tilted_density"], "eigenfunctions-tilted_density-cylinder.png"),
        (["--cylinder", "--p", "2", "--output", "cylinder.png"], "cylinder.png"),
    ],
)
def test_show_script(paraview, results, arguments, picture):
    """Every field and shape has a picture of its own."""
    before = {file: file.read_bytes() for file in results.rglob("*.[pv][vt][du]")}
    for old in results.glob("*.png"):
        old.unlink()
    done = paraview(results, "show.py", *arguments)
    assert done.returncode == 0, done.stderr
    assert "p = 2: " in done.stdout
    assert [file.name for file in results.glob("*.png")] == [picture]
    assert_picture(results / picture)
    assert {file: file.read_bytes() for file in before} == before


@pytest.mark.parametrize("p", ["17", "1.9", "nan"])
def test_show_script_refuses_a_p_that_is_not_there(paraview, results, p):
    done = paraview(results, "show.py", "--p", p, "--output", "refused.png")
    assert done.returncode != 0
    assert f"--p {p}: " in done.stderr
    assert "choose one of -1, 0, 2" in done.stderr
    assert not (results / "refused.png").exists()


WORDS = """
import json, sys
sys.argv = [{script!r}, *{arguments!r}]
exec(open({script!r}).read(), {{"__name__": "__main__", "__file__": {script!r}}})
from paraview import servermanager, simple
view, scene, found = simple.GetActiveView(), simple.GetAnimationScene(), []
for time in {times!r}:
    captions, titles = [], []
    scene.AnimationTime = time or scene.AnimationTime
    simple.Render(view)
    for source in simple.GetSources().values():
        display, kind = simple.GetDisplayProperties(source, view), source.GetXMLName()
        if kind == "TextSource":
            captions.append([source.Text, list(display.BillboardPosition)])
        elif kind == "PythonCalculator":
            lowest = simple.GetColorTransferFunction("scaled").RGBPoints[0]
        elif kind == "PythonAnnotation":
            titles.append(servermanager.Fetch(source).GetRowData().GetAbstractArray(0).GetVariantValue(0).ToString())
    found.append([titles, captions, [view.AxesGrid.XTitle, view.AxesGrid.YTitle], lowest])
print(json.dumps(found))
"""


def words(paraview, folder, *arguments, times=(0,)):
    """What show.py writes into a picture, at its own time and if need be at others: above and below it, its captions
    with their places, the titles of the axes grid, and the lowest value of the colours."""
    script = folder / "words.py"
    arguments = [*arguments, "--output", "words.png"]
    script.write_text(WORDS.format(script=str(folder / "show.py"), arguments=arguments, times=times))
    done = paraview(folder, script)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def named_results(tmp_path_factory):
    """One p only, with parameters."""
    folder, solver = tmp_path_factory.mktemp("named"), ExponentSolver(Problem(HARD, UNIT_NOISE), COARSE)
    parameters = {"oscillator.omega": 1.0, "oscillator.impact": "delta", "noise.D0": 0.5}
    written(folder, solver, [1.0], parameters=parameters, varied=["noise.D0"])
    copy_show_script(folder)
    return folder


def test_words_of_the_picture(paraview, named_results):
    [((title, parameters), captions, grid, lowest)] = words(paraview, named_results)
    assert title.startswith("noise.D0 = 0.5 (1/time)\np = 1 ")
    assert title.endswith(" (1/time)")
    assert 0 < lowest < 1
    assert parameters.splitlines() == ["oscillator: omega = 1 (rad/time), impact = delta"]
    assert [text for text, _ in captions].count("impact") == 2
    at = {text: place[0] for text, place in captions}
    ticks = [at[text] for text in ("0", "pi/2", "pi", "3 pi/2", "2 pi")]
    assert np.diff(ticks) == pytest.approx([ticks[4] / 4] * 4)
    assert "phase phi (rad)" in at
    assert [word.strip() for word in grid] == ["", "noise xi (1/time)"]


def test_the_stationary_density_is_that_at_p_0(paraview, named_results):
    [((title, _), *_, lowest)] = words(paraview, named_results, "--field", "stationary_density")
    assert title.splitlines() == ["noise.D0 = 0.5 (1/time)", "stationary density (p = 0)"]
    assert lowest == 0


@pytest.fixture(scope="module")
def several_curves(tmp_path_factory):
    folder = tmp_path_factory.mktemp("several")
    run(load_case(ROOT / "cases/minimal.toml", ["expect=[]", 'vary."noise.D0"=[0.5, 0.75]']), folder)
    return folder / "minimal"


def test_the_title_follows_the_curves(paraview, several_curves):
    titles = [
        title
        for options, times in (([], (0, 0.75)), (["--time", "0.75"], (0,)))
        for title, *_ in words(paraview, several_curves, "--collection", "curves.pvd", *options, times=times)
    ]
    assert [title.splitlines()[0] for title, _ in titles] == [f"noise.D0 = {D0} (1/time)" for D0 in (0.5, 0.75, 0.75)]
    assert titles[1] == titles[2]
    assert titles[0][0] != titles[1][0]


@pytest.mark.parametrize(
    ("option", "remedy"),
    [
        (["--p", "2"], "choose one with --time"),
        (["--time", "0.6"], "choose one of 0.5, 0.75"),
        (["--time", "0.5", "--p", "2"], "leave one out"),
    ],
)
def test_show_script_refuses_a_curve_that_is_not_there(paraview, several_curves, option, remedy):
    done = paraview(several_curves, "show.py", "--collection", "curves.pvd", *option, "--output", "refused.png")
    assert done.returncode != 0
    assert remedy in done.stderr
    assert not (several_curves / "refused.png").exists()


def test_words_around_the_cylinder(paraview, named_results):
    """Near the rim, whose radius is between 1 and 1.5."""
    [(_, captions, *_)] = words(paraview, named_results, "--cylinder")
    texts = [text for text, _ in captions]
    assert texts[:4] == ["phase phi = 0", "impact: pi/2", "pi", "impact: 3 pi/2"]
    assert len(texts) == 6
    assert all(re.fullmatch(r"noise xi = \S+ \(1/time\)", text) for text in texts[4:])
    for _, (x, y, _) in captions:
        assert 1 < np.hypot(x, y) < 1.7


def test_the_command_without_a_display_is_the_same_everywhere():
    """Without -noreset the virtual display restarts under ParaView now and then."""
    for file in ("README.md", "fpsolve/output/show.py"):
        commands = re.findall("xvfb-run[^`\n]*", (ROOT / file).read_text(encoding="utf-8"))
        assert commands == ["xvfb-run -a -s -noreset pvpython show.py"], file


MENU = """
import sys
sys.argv = [""]
exec(open({script!r}).read(), {{"__name__": "__vtkconsole__"}})
print("and ParaView goes on")
"""


def test_show_script_from_the_menu(paraview, results, tmp_path):
    """There neither the script's file nor its folder is known, and an error must not end ParaView."""
    menu = tmp_path / "menu.py"
    menu.write_text(MENU.format(script=str(results / "show.py")))
    (results / "eigenfunctions.png").unlink(missing_ok=True)
    done = paraview(tmp_path, menu)
    assert "and ParaView goes on" in done.stdout, done.stderr
    assert_picture(results / "eigenfunctions.png")
    lost = tmp_path / "lost" / "show.py"
    lost.parent.mkdir()
    menu.write_text(MENU.format(script=str(copy_show_script(lost.parent))))
    done = paraview(tmp_path, menu)
    assert "there is no" in done.stdout
    assert "and ParaView goes on" in done.stdout, done.stderr


def test_show_script_refuses(paraview, tmp_path):
    done = paraview(tmp_path, copy_show_script(tmp_path))
    assert done.returncode != 0
    assert f"there is no {tmp_path / 'eigenfunctions.pvd'}; name the collection with --collection" in done.stderr
