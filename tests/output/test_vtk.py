"""ParaView files: what pyvista reads back from them."""

import functools
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import pyvista

from fpsolve.case.case import load_case
from fpsolve.exponent.eigen import principal_pair
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import make_mesh
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.parts.eigenfunctions import write_density, write_eigenfunctions
from fpsolve.study import solve
from fpsolve.workflow import run
from fpsolve.workflow.simulate import write_simulated_response
from tests.conftest import FIG1, UNIT_NOISE, sampled
from tests.kit import ALL
from tests.oracles.perturbation import first_order_eigenfunction
from tests.output.eigenfunctions import HARD, MESHES, MOMENTS, integral, written

ROOT = Path(__file__).parents[2]
NO_FIGURE = "output.figure=false"


@functools.cache
def solver_on(mesh):
    return ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES[mesh])


@pytest.fixture(scope="module", params=sampled(*list(MESHES)[:2]))
def solver(request):
    return solver_on(request.param)


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


@pytest.mark.slow
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


@pytest.mark.slow
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
        assert set(grid.field_data) == {"p", "Lambda", "impacts", "along_y"}
        assert grid.field_data["impacts"] == pytest.approx([np.pi / 2, 3 * np.pi / 2])
        assert grid.field_data["Lambda"][0] == solver.pair(p).value


def test_files_hold_parameters_and_say_what_is_shown_first(tmp_path, fig1_solver):
    """ParaView colours by the active scalars when it opens a file."""
    pair, parameters = fig1_solver.pair(0.0), {"oscillator.epsilon": 0.1, "oscillator.impact": "delta", "noise.D0": 1.0}
    _, file = write_eigenfunctions(tmp_path, [pair], pair, parameters=parameters)
    density = write_density(tmp_path / "density.vtu", pair, parameters)
    for path, shown in ((file, "T"), (density, "stationary_density")):
        found = pyvista.read(path).field_data
        assert {name: found[name][0] for name in found if "." in name} == {
            "oscillator.epsilon": 0.1,
            "oscillator.impact = delta": 1.0,
            "noise.D0": 1.0,
        }
        head, _, _ = path.read_text().partition("<AppendedData")
        assert f'<PointData Scalars="{shown}">' in head


def test_files_of_a_curve_hold_its_parameters(tmp_path):
    case = load_case(
        ROOT / "cases/minimal.toml", ["oscillator.omega=1.25", ALL, 'vary."noise.D0"=[0.5, 0.75]', NO_FIGURE]
    )
    run(case, tmp_path)
    files = sorted(tmp_path.rglob("*.vtu"))
    assert {file.parent.name for file in files} == {"eigenfunctions", "eigenfunctions-2", case.name}
    for file in files:
        data = pyvista.read(file).field_data
        assert data["noise.D0"][0] == (0.75 if file.parent.name == "eigenfunctions-2" else 0.5)
        assert data["oscillator.omega"][0] == 1.25
        assert data["noise.treatment = ou-reduction"][0] == 1
        assert data["curve"][0] == (2 if file.parent.name == "eigenfunctions-2" else 1)
        assert bytes(data["varied"]).decode() == f"noise.D0 = {data['noise.D0'][0]:g} (1/time)"
        assert bytes(data["held"]).decode().splitlines() == [
            "oscillator: omega = 1.25 (rad/time), restitution = 0.8, c1 = 0.1 (1/time), epsilon = 0.1,",
            "c2 = 0 (1/(time length^2)), c3 = 0 (time/length^2), impact = delta",
            "noise: tau0 = 0.5 (time), r0 = 0.95, treatment = ou-reduction",
        ]
        assert float(file.stem.removeprefix("p") if file.stem != "density" else 0) == data["p"][0]


TWO = 'vary."noise.D0"=[0.75, 0.5]'


@pytest.mark.slow
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
    case = load_case(
        ROOT / "cases/minimal.toml", ["moments.p=[-1.0, 1.5, 4.0]", "expect=[]", ALL, NO_FIGURE, *overrides]
    )
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


@pytest.mark.slow
def test_a_run_that_ends_early_lists_the_curves_that_are_there(tmp_path, monkeypatch):
    case = load_case(ROOT / "cases/minimal.toml", ["expect=[]", ALL, 'vary."noise.D0"=[0.5, 0.75, 1.0]'])
    run(case, tmp_path)
    series = tmp_path / case.name / "curves.pvd"
    assert len(pyvista.PVDReader(series).time_values) == 3
    original = solve.solve_curve

    def interrupted(curve, *arguments):
        if curve.number == 3:
            raise KeyboardInterrupt
        return original(curve, *arguments)

    monkeypatch.setattr(solve, "solve_curve", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(case, tmp_path, fresh=True)
    assert list(pyvista.PVDReader(series).time_values) == [0.5, 0.75]
    monkeypatch.undo()
    run(load_case(case.path, ["output.eigenfunctions=[]", "expect=[]"]), tmp_path)
    assert not series.exists()


def test_periodic_by_pi(grids):
    at = np.stack(np.meshgrid(np.linspace(0.01, 3.1, 40), np.linspace(-2, 2, 9), [0.0]), axis=-1).reshape(-1, 3)
    one, other = (pyvista.PolyData(points).sample(grids[2.0])["T"] for points in (at, at + np.array([np.pi, 0, 0])))
    np.testing.assert_allclose(one, other, rtol=1e-4)


def test_nodes_are_on_the_polynomials(tmp_path):
    """Values from the file against the elements evaluated at the middle of every mesh cell, in both half turns."""
    solver = ExponentSolver(Problem(HARD, UNIT_NOISE), make_mesh(phi_cells=3, phi_degree=4, xi_cells=6, xi_degree=4))
    pair, grid = solver.pair(1.0), written(tmp_path, solver, [1.0])[1.0]
    space, lines = pair.space, pair.space.xi.lines
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


@pytest.mark.slow
def test_stationary_pair_may_be_of_another_mesh(tmp_path):
    coarse, fine = map(solver_on, list(MESHES)[:2])
    _, own = write_eigenfunctions(tmp_path / "own", [coarse.pair(2.0)], coarse.pair(0.0))
    _, other = write_eigenfunctions(tmp_path / "other", [coarse.pair(2.0)], fine.pair(0.0))
    one, two = (pyvista.read(file)["stationary_density"] for file in (own, other))
    np.testing.assert_allclose(one, two, atol=1e-8)


@pytest.mark.parametrize("degree", sampled(3, 1, 7))
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
    assert all(file.stat().st_size < 400e3 for file in files)
    for s in sets:
        assert not Path(s.get("file")).is_absolute()
        assert pyvista.read(tmp_path / s.get("file")).field_data["p"][0] == float(s.get("timestep"))
    assert list(pyvista.PVDReader(files[0]).time_values) == sorted(set(moments))


def test_density_file(tmp_path, solver):
    grid = pyvista.read(write_density(tmp_path / "density.vtu", solver.pair(0.0)))
    assert set(grid.point_data) == {"stationary_density", "phi_marginal", "xi_marginal", "z"}
    found = {name: float(values[0]) for name, values in grid.field_data.items() if values.size == 1}
    assert found == {"p": 0, "Lambda": 0, "lyapunov_exponent": solver.pair(0.0).derivative}
    assert integral(grid, "stationary_density") == pytest.approx(1, abs=1e-6)
    width = 16 * UNIT_NOISE.standard_deviation
    assert integral(grid, "phi_marginal") == pytest.approx(width, rel=1e-8)
    np.testing.assert_allclose(grid["xi_marginal"], UNIT_NOISE.density(grid.points[:, 1]), atol=1e-10)


@pytest.mark.slow
def test_meshio_reads_what_has_been_written(tmp_path):
    """Eigenfunctions, densities over directions and of responses: the same numbers as VTK reads, and the parameters."""
    run(load_case(ROOT / "cases/minimal.toml", ["expect=[]", ALL, NO_FIGURE]), tmp_path)
    run(
        load_case(ROOT / "cases/response.toml", ["expect=[]", NO_FIGURE, "moments.p=[2.0]", "response.rtol=0.1"]),
        tmp_path,
    )
    run(load_case(ROOT / "cases/systems/coupled.toml", ["expect=[]", NO_FIGURE, "moments.p=[2.0]"]), tmp_path)
    files = sorted(tmp_path.rglob("*.vtu"))
    assert {"density.vtu", "response.vtu", "response_3d.vtu"} < {file.name for file in files}
    for file in files:
        found, own = meshio.read(file), pyvista.read(file)
        np.testing.assert_array_equal(found.points, own.points)
        assert sum(len(block.data) for block in found.cells) == own.n_cells
        for name in own.point_data:
            np.testing.assert_array_equal(found.point_data[name], own.point_data[name])
        assert found.field_data.keys() == set(own.field_data.keys())
        assert bytes(found.field_data["held"]).decode().startswith(("oscillator: ", "system: "))
        if "response" not in file.name:
            assert found.field_data["p"][0] == own.field_data["p"][0]


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
    write_simulated_response(simulated, tmp_path)
    grid = pyvista.read(tmp_path / "monte_carlo_response-2.vti")
    assert grid.bounds == pytest.approx((0, 3, -2, 2, 0, 0))
    np.testing.assert_array_equal(grid.cell_data["density"].reshape(80, 100).T, simulated.response.density)
    known = {name: values[0] for name, values in grid.field_data.items()}
    assert known.items() >= {k: v for k, v in simulated.curve.parameters.items() if not isinstance(v, str)}.items()
    assert bytes(grid.field_data["varied"]).decode() == "noise.D0 = 0.75 (1/time)"
    assert known["curve"] == 2
    assert (known["lyapunov_exponent"], known["lyapunov_exponent_error"]) == (-0.001, 1e-5)


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
def test_a_response_that_does_not_fit_on_the_disk_is_not_left_in_part(tmp_path, simulated):
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        with pytest.raises(OSError, match=r"monte_carlo_response-2\.vti"):
            write_simulated_response(simulated, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_writing_loads_nothing_that_draws(tmp_path):
    """It must work without display, OpenGL or EGL."""
    code = f"""
import sys
from pathlib import Path
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.problem import Problem
from fpsolve.parts.eigenfunctions import write_eigenfunctions
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
