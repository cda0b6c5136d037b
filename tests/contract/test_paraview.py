"""Files for ParaView: what pyvista, meshio and ParaView itself read from them."""

import json
import os
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree

import matplotlib.image
import meshio
import numpy as np
import pytest
import pyvista
import xarray
from vtkmodules.vtkCommonDataModel import vtkLagrangeQuadrilateral

import fpsolve
from fpsolve import (
    CylinderMesh,
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    make_mesh,
)
from fpsolve.fem import write_mesh
from fpsolve.model import MarkovChain, Telegraph, White
from fpsolve.results import write_density, write_eigenfunctions
from fpsolve.theory import first_order_eigenfunction
from tests.conftest import sampled
from tests.contract.test_cases import ROOT
from tests.kit import TEXT, case_in, files, rates, read_json, run

pytestmark = pytest.mark.slow

HARD = VibroImpactOscillator(omega=1.0, restitution=0.3, c1=0.1, epsilon=0.2)
UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
DEVIATION = np.sqrt(0.5)
FINE = {"phi_degree": 14, "xi_cells": 8}
MESHES = {
    "half circle": make_mesh(phi_cells=4, **FINE),
    "full circle": make_mesh(phi_cells=4, full_circle=True, **FINE),
    "half circle, seam at 7.2 pi": CylinderMesh(np.pi * np.array([7.2, 7.5, 7.9, 8.2]), np.linspace(-8, 8, 9), 14, 9),
}
COARSE = make_mesh(phi_cells=4, phi_degree=6, xi_cells=8)
MOMENTS = -1.0, 0.0, 2.0


def written(folder, solver, moments=MOMENTS, **options):
    """Eigenfunctions of a solver, read back: {p: grid}."""
    _, *paths = write_eigenfunctions(folder, [solver.pair(p) for p in moments], solver.pair(0.0), **options)
    return {float(grid.field_data["p"][0]): grid for grid in map(pyvista.read, paths)}


def integral(grid, name):
    """∫ of the Lagrange polynomials of an array, or of values, their nodes numbered by VTK's own function."""
    values = grid[name] if isinstance(name, str) else name
    k = round(np.sqrt(grid.cell_connectivity.size / grid.n_cells)) - 1
    order = [vtkLagrangeQuadrilateral.PointIndexFromIJK(i, j, [k, k]) for i in range(k + 1) for j in range(k + 1)]
    nodes = grid.cell_connectivity.reshape(grid.n_cells, -1)[:, order]
    rule = np.linalg.solve(np.vander(np.arange(k + 1) / k, increasing=True).T, 1 / np.arange(1, k + 2))
    areas = np.prod(np.ptp(grid.points[nodes], axis=1)[:, :2], axis=1)
    return areas @ values[nodes] @ np.outer(rule, rule).ravel()


@pytest.fixture(scope="module", params=sampled(*MESHES))
def solver(request):
    return ExponentSolver(Problem(HARD, UNIT), MESHES[request.param])


@pytest.fixture(scope="module")
def grids(solver, tmp_path_factory):
    return written(tmp_path_factory.mktemp("vtk"), solver)


def sides(grid, phi, name):
    """The values of an array at phi from the left and from the right, over ξ."""
    centers, cells = grid.cell_centers().points[:, 0], grid.cell_connectivity.reshape(grid.n_cells, -1)
    for side in (centers < phi, centers > phi):
        points = np.unique(cells[side])
        points = points[np.abs(grid.points[points, 0] - phi) < 1e-9]
        yield grid[name][points[np.argsort(grid.points[points, 1])]]


def test_eigenfunctions_jump_at_impacts_alone(grids):
    """T(φ⁻) = R^p T(φ⁺) where the tilted density lives; T* jumps the other way, their product nowhere."""
    for p, grid in grids.items():
        corners = grid.points[grid.cell_connectivity.reshape(grid.n_cells, -1)[:, 0], 0]
        for phi in set(np.round(corners, 12)) - {0.0}:
            before, after = sides(grid, phi, "tilted_density")
            np.testing.assert_allclose(before, after, atol=1e-7)
        for phi in (np.pi / 2, 3 * np.pi / 2):
            living = (density := next(sides(grid, phi, "tilted_density"))) > 1e-4 * density.max()
            assert np.count_nonzero(living) > 60
            before, after = sides(grid, phi, "T")
            np.testing.assert_allclose((before / after)[living], HARD.impact_factor(p), rtol=1e-8)
            before, after = sides(grid, phi, "T_adjoint")
            np.testing.assert_allclose((after / before)[living], HARD.impact_factor(p), rtol=1e-6)


def test_eigenfunctions_cover_the_circle_once_and_are_scaled(solver, grids):
    for p, grid in grids.items():
        assert set(grid.celltypes) == {pyvista.CellType.LAGRANGE_QUADRILATERAL}
        np.testing.assert_allclose(grid.bounds[:4], [0, 2 * np.pi, -8 * DEVIATION, 8 * DEVIATION], rtol=1e-7)
        assert integral(grid, np.ones(grid.n_points)) == pytest.approx(32 * np.pi * DEVIATION, rel=1e-12)
        assert set(grid.point_data) == {"T", "T_adjoint", "tilted_density", "stationary_density", "z"}
        assert all(grid[name].dtype == np.float64 and np.isfinite(grid[name]).all() for name in grid.point_data)
        np.testing.assert_allclose(grid["z"], grid.points[:, 1] / DEVIATION)
        np.testing.assert_allclose(grid["tilted_density"], grid["T"] * grid["T_adjoint"])
        for values in (
            "tilted_density",
            "stationary_density",
            grid["T"] * UNIT.density(grid.points[:, 1]) / (2 * np.pi),
        ):
            assert integral(grid, values) == pytest.approx(1, abs=1e-6)
        assert set(grid.field_data) == {"p", "Lambda", "impacts", "along_y"}
        assert grid.field_data["impacts"] == pytest.approx([np.pi / 2, 3 * np.pi / 2])
        assert grid.field_data["Lambda"][0] == solver.pair(p).value
    np.testing.assert_allclose(grids[0.0]["T"], 1, rtol=1e-7)
    np.testing.assert_allclose(grids[0.0]["T_adjoint"], grids[2.0]["stationary_density"], atol=1e-14)
    at = np.stack(np.meshgrid(np.linspace(0.01, 3.1, 40), np.linspace(-2, 2, 9), [0.0]), axis=-1).reshape(-1, 3)
    one, other = (pyvista.PolyData(points).sample(grids[2.0])["T"] for points in (at, at + np.array([np.pi, 0, 0])))
    np.testing.assert_allclose(one, other, rtol=1e-4)


def test_density_file_has_both_marginals(tmp_path, solver):
    grid = pyvista.read(write_density(tmp_path / "density.vtu", solver.pair(0.0)))
    assert set(grid.point_data) == {"stationary_density", "phi_marginal", "xi_marginal", "z"}
    found = {name: float(values[0]) for name, values in grid.field_data.items() if values.size == 1}
    assert found == {"p": 0, "Lambda": 0, "lyapunov_exponent": solver.pair(0.0).derivative}
    assert integral(grid, "stationary_density") == pytest.approx(1, abs=1e-6)
    assert integral(grid, "phi_marginal") == pytest.approx(16 * DEVIATION, rel=1e-8)
    np.testing.assert_allclose(grid["xi_marginal"], UNIT.density(grid.points[:, 1]), atol=1e-10)


def test_eigenfunction_is_that_of_first_order_for_weak_noise(tmp_path):
    """T = 1 + ε T₁ + O(ε²), Eq. (33)."""
    errors = []
    for eps in (0.02, 0.01, 0.005):
        oscillator = VibroImpactOscillator(omega=1.0, restitution=0.5, c1=0.1, epsilon=eps)
        grid = written(tmp_path / str(eps), ExponentSolver(Problem(oscillator, UNIT)), [2.0])[2.0]
        near = np.abs(grid["z"]) < 3
        phi, xi, _ = grid.points[near].T
        errors.append(
            np.abs(grid["T"][near] - 1 - eps * first_order_eigenfunction(Problem(oscillator, UNIT), 2.0, phi, xi)).max()
        )
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.1)


RATES = np.array([[0.0, 1.0], [-1.0, -0.2]]), np.array([[0.0, 0.0], [-1.0, 0.0]])
"""Of ẍ + 0.2ẋ + (1 + ξ)x = 0, without the noise and with it."""
CHAIN = MarkovChain([0.4, -0.5, 0.4], [[-1.0, 0.4, 0.6], [0.2, -0.5, 0.3], [0.0, 2.0, -2.0]])


def form_of(noise):
    """Λ(2), and T(φ, ξ_i) = eᵀM_i e up to a factor, from AᵢᵀMᵢ + MᵢAᵢ + Σⱼ qᵢⱼMⱼ = ΛMᵢ, for white noise + s²BᵀMB."""
    (still, driven), one, count = RATES, np.eye(2), len(noise.states)
    total = np.kron(np.array(noise.rates), np.eye(4))
    for i, state in enumerate(noise.states):
        rate = still + state * driven
        block = (
            np.kron(rate.T, one)
            + np.kron(one, rate.T)
            + noise.is_white * getattr(noise, "s", 0.0) ** 2 * np.kron(driven.T, driven.T)
        )
        total[4 * i : 4 * i + 4, 4 * i : 4 * i + 4] += block
    values, vectors = np.linalg.eig(total)
    at = int(np.argmax(values.real))
    return values[at].real, vectors[:, at].real.reshape(count, 2, 2)


@pytest.mark.parametrize("noise", [Telegraph(a=0.5, k=1.0), White(s=0.5), CHAIN], ids=lambda noise: noise.kind)
def test_eigenfunctions_of_noise_with_states_are_quadratic_forms_on_strips(noise, tmp_path):
    solver = ExponentSolver(rates("x' = v; v' = -x - 0.2*v - xi*x", noise))
    grid = written(tmp_path, solver, [2.0])[2.0]
    value, forms = form_of(noise)
    assert grid.field_data["Lambda"][0] == pytest.approx(value, rel=1e-9)
    state = np.round(grid.points[:, 1]).astype(int) - 1
    assert sorted(set(state)) == list(range(len(noise.states)))
    e = np.stack([np.cos(grid.points[:, 0]), -np.sin(grid.points[:, 0])], axis=1)
    expected = np.einsum("ia,iab,ib->i", e, forms[state], e)
    np.testing.assert_allclose(grid["T"] / grid["T"].max(), expected / expected[grid["T"].argmax()], atol=1e-6)
    for name in ("tilted_density", "stationary_density"):
        assert integral(grid, name) == pytest.approx(0.8, abs=1e-4)  # a strip is 0.8 wide
    density = pyvista.read(write_density(tmp_path / "density.vtu", solver.pair(0.0)))
    assert integral(density, "phi_marginal") == pytest.approx(0.8 * len(noise.states), abs=1e-4)


def test_values_are_finite_at_the_ends_of_bounded_noise_far_out_and_for_any_degree(tmp_path):
    """For r₀ < 1 P_s vanishes at the ends."""
    noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=-1.0)
    grid = written(tmp_path / "a", ExponentSolver(Problem(HARD, noise)), [2.0])[2.0]
    assert np.abs(grid.points[:, 1]).max() == pytest.approx(noise.half_width)
    assert grid["T_adjoint"][np.abs(grid["z"]) == grid["z"].max()] == pytest.approx(0, abs=1e-6)
    wide = make_mesh(phi_degree=6, xi_cells=90, xi_degree=2, xi_min=-37, xi_max=8)
    far = written(tmp_path / "b", ExponentSolver(Problem(HARD, UNIT), wide), [0.0])[0.0]
    assert np.abs(far["T_adjoint"][far["z"] < -30]).max() < 1e-100
    cubic = make_mesh(phi_cells=9, phi_degree=3, xi_cells=9, xi_degree=3)
    rough = written(
        tmp_path / "c",
        ExponentSolver(Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1), UNIT), cubic),
        [1.0],
    )[1.0]
    assert integral(rough, "tilted_density") == pytest.approx(1, abs=2e-2)
    for each in (grid, far, rough):
        assert all(np.isfinite(each[name]).all() for name in each.point_data)


def test_collection_lists_each_p_once_in_order(tmp_path):
    """Valid XML, one file for each p however close, and nothing else in the folder."""
    moments = [2.0, 0.1 + 0.2, 0.3, -1.0, 1e-7, 0.3]
    solver = ExponentSolver(Problem(HARD, UNIT), COARSE)
    pair = solver.pair(0.0)
    facts = {"oscillator.epsilon": 0.1, "noise.D0": 1.0}
    series, *paths = write_eigenfunctions(tmp_path, [solver.pair(p) for p in moments], pair, "eigenfunctions-2", facts)
    assert series == tmp_path / "eigenfunctions-2.pvd"
    sets = ElementTree.parse(series).findall("Collection/DataSet")
    assert (
        [float(each.get("timestep")) for each in sets]
        == sorted(set(moments))
        == list(pyvista.PVDReader(series).time_values)
    )
    assert [tmp_path / each.get("file") for each in sets] == paths
    assert files(tmp_path) == {str(each.relative_to(tmp_path)) for each in (series, *paths)}
    density = write_density(tmp_path / "density.vtu", pair, facts)
    for path, shown in ((paths[0], "T"), (density, "stationary_density")):  # ParaView colours by the active scalars
        found = pyvista.read(path).field_data
        assert {name: found[name][0] for name in found if "." in name} == facts
        assert f'<PointData Scalars="{shown}">' in path.read_text().partition("<AppendedData")[0]


DRAWN = "output={ quantities=['moment', 'eigenfunctions'], eigenfunctions=[1.5], figure=false }"


@pytest.mark.parametrize(
    ("vary", "times", "names"),
    sampled(
        ("vary={ noise.D0=[0.75, 0.5] }", [0.5, 0.75], ["noise.D0 = 0.5, p = 1.5", "noise.D0 = 0.75, p = 1.5"]),
        (
            'vary={ noise.treatment=["exact", "ou-reduction"] }',
            [1, 2],
            [f"noise.treatment = {name}, p = 1.5" for name in ("exact", "ou-reduction")],
        ),
    ),
)
def test_series_over_the_sets_has_files_with_their_parameters(tmp_path, vary, times, names):
    """The time is the one number that is varied, or else the number of the parameter set."""
    sets = [vary, DRAWN, "moments.p=[1.5]", "oscillator.omega=1.25"]
    assert run(tmp_path, "run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in sets), case=TEXT).code == 0
    series = tmp_path / "results/case/sets.pvd"
    listed = ElementTree.parse(series).findall("Collection/DataSet")
    assert [float(each.get("timestep")) for each in listed] == times == list(pyvista.PVDReader(series).time_values)
    assert [each.get("name") for each in listed] == names
    for time, each in zip(times, listed, strict=True):
        data = pyvista.read(series.parent / each.get("file")).field_data
        assert time in (data["noise.D0"][0], data["set"][0])
        assert (data["oscillator.omega"][0], data["p"][0]) == (1.25, 1.5)
        if "noise.D0" in vary:
            assert bytes(data["varied"]).decode() == f"noise.D0 = {time:g} (1/time)"
            assert bytes(data["fixed"]).decode().splitlines() == [
                "oscillator: omega = 1.25 (rad/time), restitution = 0.8, c1 = 0.1 (1/time), epsilon = 0.1, "
                "c2 = 0 (1/(time length^2)), c3 = 0 (time/length^2), impact = delta",
                "noise: tau0 = 0.5 (time), r0 = 0.95, treatment = ou-reduction",
            ]
    assert run(tmp_path, "run", "case.toml", "--set=output={figure=false,eigenfunctions=[]}").code == 0
    assert not series.exists()


@pytest.mark.parametrize(
    ("system", "noise", "along"),
    [
        ("", 'kind = "telegraph"\na = 0.5\nk = 1.0', "states; xi = -0.5; xi = 0.5"),
        ("", 'kind = "white"\ns = 0.5\ninterpretation = "ito"', "white noise"),
        (
            'walls = [{ at = "x = 0", restitution = 0.95 }]',
            'kind = "telegraph"\na = 0.5\nk = 1.0',
            "states; xi = -0.5; xi = 0.5",
        ),
    ],
)
def test_files_of_an_own_system_say_what_is_along_y_and_where_impacts_are(tmp_path, system, noise, along):
    text = f'title = "mine"\n[system]\nvariables = ["x", "v"]\ndrift = ["v", "-x - 0.2*v - xi*x"]\n{system}\n'
    text += f"[noise]\n{noise}\n[moments]\np = [2.0]\n"
    fpsolve.run(case_in(tmp_path, text, [DRAWN.replace("1.5", "2.0")]), tmp_path)
    facts = pyvista.read(tmp_path / "test/eigenfunctions/p+2.0.vtu").field_data
    assert bytes(facts["along_y"]).decode() == along
    np.testing.assert_allclose(facts["impacts"], [np.pi / 2, 1.5 * np.pi] if system else [np.nan], atol=1e-11)
    assert (tmp_path / "test/density.vtu").is_file()


TWO_MODES = [
    "expect=[]", "system.coupling=0.6", "noise.s=0.3", "moments.rtol=1e-2", "moments.p=[1.0]",
    "output={quantities=['moment', 'eigenfunctions'], eigenfunctions=[1.0], figure=true}",
]  # fmt: skip


@pytest.mark.slow
def test_densities_over_directions_of_two_modes_are_the_same_in_netcdf_and_for_paraview(tmp_path, request):
    case = fpsolve.load_case(request.config.rootpath / "cases/systems/coupled.toml", TWO_MODES)
    [result], folder = fpsolve.run(case, tmp_path), tmp_path / "coupled"
    assert {"densities.nc", "density.vtu", "eigenfunctions.pvd", "densities.png"} <= files(folder)
    with xarray.open_dataset(folder / "densities.nc", engine="h5netcdf") as found:
        found = found.load()
    assert result.discretisation["waves"] >= 4
    assert (found.tilted_density.dims, found.tilted_density.units) == (("p", "eta", "phase_difference"), "1/rad^2")
    assert found.moment.values == pytest.approx(result.moments.value, rel=1e-15)
    for density in (found.stationary_density, found.tilted_density[0], found.T_adjoint[0]):
        assert float(found.eta_weights @ density @ found.phase_difference_weights) == pytest.approx(1, abs=1e-12)
    assert 0 < found.density_error < 0.02
    grid, density = (pyvista.read(folder / name) for name in ("eigenfunctions/p+1.0.vtu", "density.vtu"))
    assert grid.bounds == pytest.approx((0, np.pi / 2, 0, 2 * np.pi, 0, 0))
    np.testing.assert_array_equal(grid["tilted_density"], found.tilted_density.values[0].ravel("F"))
    np.testing.assert_array_equal(density["stationary_density"], found.stationary_density.values.ravel("F"))
    np.testing.assert_allclose(grid["share"], np.sin(grid.points[:, 0]) ** 2, atol=1e-12)
    assert grid.active_scalars_name == "tilted_density"
    assert bytes(grid.field_data["along_x"]).decode() == "angle whose squared sine is the share of q2 (rad)"
    assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(np.pi**2)
    fpsolve.run(
        fpsolve.load_case(case.path, ["expect=[]", "moments.p=[2.0]", "output={quantities=['moment'], figure=false}"]),
        tmp_path,
    )
    assert not [*folder.rglob("*.vtu"), *folder.glob("densities*")]


THREE = """
title = "Three variables"
[system]
variables = ["x", "y", "z"]
drift = ["-0.1*x + xi*y + 0.4*z", "-0.2*y - xi*x + 0.5*x", "-0.15*z - 0.6*x + xi*x"]
[noise]
kind = "telegraph"
a = 1.0
k = 1.0
[moments]
p = [1.0]
rtol = 1e-3
"""


@pytest.mark.slow
def test_density_over_directions_of_three_variables_is_on_a_sphere(tmp_path):
    fpsolve.run(case_in(tmp_path, THREE, [DRAWN.replace("1.5", "1.0")]), tmp_path)
    grid = pyvista.read(tmp_path / "test/eigenfunctions/p+1.0.vtu")
    np.testing.assert_allclose(np.linalg.norm(grid.points, axis=1), 1, atol=1e-12)
    values = grid["tilted_density"].reshape(len(np.unique(grid["latitude"])), -1).T
    half = len(values) // 2
    np.testing.assert_allclose(values[half:, ::-1], values[: half + 1], atol=1e-8 * values.max())  # −e is e
    sizes, middle = grid.compute_cell_sizes()["Area"], grid.point_data_to_cell_data()["tilted_density"]
    assert sizes @ middle == pytest.approx(1, abs=0.01)


@pytest.mark.slow
def test_meshio_reads_the_numbers_that_vtk_reads(tmp_path, request):
    """Eigenfunctions, densities over directions, and of responses, solved and simulated."""
    cases = request.config.rootpath / "cases"
    few = ["--set", "expect=[]", "--set", "moments.p=[2.0]", "--set", "output.figure=false"]
    assert run(tmp_path, "run", f"{cases}/minimal.toml", "--all", *few).code == 0
    response = [f"{cases}/response.toml", *few, "--set=monte_carlo={ paths=64, time=100.0 }", "--set=response.rtol=0.1"]
    assert run(tmp_path, "run", *response, "--monte-carlo").code in (0, 3)
    assert run(tmp_path, "run", f"{cases}/systems/coupled.toml", *few).code == 0
    paths = sorted(tmp_path.rglob("*.vtu"))
    assert {"density.vtu", "response.vtu", "response_3d.vtu"} < {file.name for file in paths}
    for file in paths:
        found, own = meshio.read(file), pyvista.read(file)
        np.testing.assert_array_equal(found.points, own.points)
        assert sum(len(block.data) for block in found.cells) == own.n_cells
        for name in own.point_data:
            np.testing.assert_array_equal(found.point_data[name], own.point_data[name])
        assert found.field_data.keys() == set(own.field_data.keys())
        assert bytes(found.field_data["fixed"]).decode().startswith(("oscillator: ", "system: "))
    grid = pyvista.read(tmp_path / "results/response/monte_carlo_response.vti")
    simulated = read_json(tmp_path / "results/response/monte_carlo.json")
    assert grid.cell_data["density"] @ grid.compute_cell_sizes()["Area"] == pytest.approx(1, abs=0.01)
    assert grid.field_data["lyapunov_exponent"][0] == simulated["lyapunov_exponent"]["value"]


@pytest.fixture(scope="module")
def paraview():
    """Runs a script of ParaView's Python in a folder, on a virtual display that says when it is ready."""
    server = shutil.which("Xvfb")
    if not (server and shutil.which("pvpython")):
        message = "ParaView is missing: apt-get install --no-install-recommends paraview python3-paraview xvfb xauth"
        if os.environ.get("FPSOLVE_REQUIRE_PARAVIEW"):
            pytest.fail(message)
        pytest.skip(message)
    ready, tell = os.pipe()
    options = ["-displayfd", str(tell), "-noreset", "-screen", "0", "1280x1024x24"]
    with subprocess.Popen([server, *options], pass_fds=[tell]) as process:
        os.close(tell)
        with os.fdopen(ready) as stream:
            display = f":{stream.readline().strip()}"
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")} | {
            "DISPLAY": display
        }

        def call(folder, *arguments):
            command = ["pvpython", *map(str, arguments)]
            return subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=300
            )

        yield call
        process.terminate()


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
single = {}
for path in sys.argv[2:]:
    data = servermanager.Fetch(simple.XMLUnstructuredGridReader(FileName=[path]))
    of_points, of_cells = data.GetPointData(), data.GetCellData()
    parts = [(part, k) for part in (of_points, of_cells) for k in range(part.GetNumberOfArrays())]
    single[path] = {part.GetArrayName(k): part.GetArray(k).GetRange() for part, k in parts}
print(json.dumps({"single": single, "jumps": jumps, "fields": fields, "kinds": sorted(kinds)}))
"""


@pytest.mark.slow
def test_paraview_reads_a_series_a_density_and_a_mesh(paraview, tmp_path):
    solver = ExponentSolver(Problem(HARD, UNIT), MESHES["half circle"])
    written(tmp_path, solver)
    (tmp_path / "read.py").write_text(READ)
    write_density(tmp_path / "density.vtu", solver.pair(0.0))
    write_mesh(COARSE, tmp_path / "mesh.vtu")
    done = paraview(tmp_path, "read.py", "eigenfunctions.pvd", "density.vtu", "mesh.vtu")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    density = found["single"]["density.vtu"]
    low, high = density["stationary_density"]
    assert -1e-6 * high < low < high
    assert density["phi_marginal"][1] > 1 / (2 * np.pi) > density["phi_marginal"][0] > 0
    assert found["single"]["mesh.vtu"] == {"phi_degree": [6, 6], "xi_degree": [9, 9], "marker": [0, 3]}
    assert [float(p) for p in found["jumps"]] == list(MOMENTS)
    assert found["kinds"] == [70]  # VTK_LAGRANGE_QUADRILATERAL
    for p, jumps in found["jumps"].items():
        assert found["fields"][p] == pytest.approx([float(p), solver.pair(float(p)).value], abs=1e-14)
        lines, ratios = np.transpose(jumps)
        assert {int(k) for k in lines} == {2, 5}  # π/2 and 3π/2, rounded
        assert ratios.size > 120
        np.testing.assert_allclose(ratios, HARD.impact_factor(float(p)), rtol=1e-8)


@pytest.mark.slow
def test_script_of_the_docs_draws_a_field_and_refuses_what_is_not_there(paraview, tmp_path):
    """White around, and of many colours inside; what is read stays as it is."""
    sets = ["vary={}", DRAWN.replace("[1.5]", "[-1.0, 2.0]"), "oscillator.restitution=0.3", "moments.p=[-1.0, 2.0]"]
    fpsolve.run(case_in(tmp_path, TEXT, sets), tmp_path)
    folder = tmp_path / "test"
    before = {file: file.read_bytes() for file in folder.rglob("*.[pv][vt][du]")}
    script = ROOT / "docs/paraview_picture.py"
    done = paraview(folder, script, "--collection", "eigenfunctions.pvd", "--field", "T_adjoint", "--p", "2")
    assert done.returncode == 0, done.stderr
    picture = matplotlib.image.imread(folder / "eigenfunctions-T_adjoint.png")[:, :, :3]
    assert picture.shape == (1000, 1600, 3)
    assert 0.3 < np.mean(np.all(picture == 1, axis=2)) < 0.95
    assert np.unique((picture * 255).astype(int) @ [65536, 256, 1]).size > 300
    red = (picture[..., 0] > 0.6) & (picture[..., 1] < 0.5) & (picture[..., 2] < 0.5)
    assert 1e-3 < np.mean(red) < 0.02  # the impacts
    assert {file: file.read_bytes() for file in before} == before
    for name, told in (("eigenfunctions.pvd", "choose one of -1, 2"), ("none.pvd", "none.pvd")):
        done = paraview(folder, script, "--collection", name, "--p", 1.9)
        assert done.returncode == 2
        assert told in done.stderr
