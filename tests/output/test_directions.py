"""Files and figures of densities of directions: what is in them, and that ParaView's readers see the same numbers."""

from pathlib import Path

import numpy as np
import pytest
import pyvista
import xarray

from fpsolve import load_case, run
from fpsolve.parts.directions import PART

ROOT = Path(__file__).parents[2]
STATED = [
    "expect=[]",
    "system.coupling=0.6",
    "noise.s=0.3",  # of which few waves tell
    "moments.rtol=1e-2",
    "moments.p=[1.0]",
    "output={quantities=['moment', 'eigenfunctions'], eigenfunctions=[1.0], figure=false}",
]
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
[output]
quantities = ["moment", "eigenfunctions"]
figure = false
"""


@pytest.fixture(scope="module")
def modes(tmp_path_factory):
    case = load_case(ROOT / "cases/systems/coupled.toml", STATED)
    folder = tmp_path_factory.mktemp("modes")
    return case, run(case, folder), folder / "coupled"


@pytest.mark.slow
def test_files_of_two_modes(modes):
    """The netCDF file and those for ParaView hold the same; the rule of the file integrates all densities to 1."""
    _, [result], folder = modes
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*")}
    assert {"densities.nc", "density.vtu", "eigenfunctions.pvd", "eigenfunctions/p+1.0.vtu"} <= names
    assert "show.py" not in names
    with xarray.open_dataset(folder / "densities.nc", engine="h5netcdf") as found:
        found = found.load()
    assert result.discretisation["waves"] >= 4
    assert found.tilted_density.dims == ("p", "eta", "phase_difference")
    assert found.tilted_density.units == "1/rad^2"
    assert found.moment.values == pytest.approx(result.moments.value, rel=1e-15)
    for density in (found.stationary_density, found.tilted_density[0], found.T_adjoint[0]):
        assert float(found.eta_weights @ density @ found.phase_difference_weights) == pytest.approx(1, abs=1e-12)
    assert 0 < found.density_error < 0.02
    grid = pyvista.read(folder / "eigenfunctions/p+1.0.vtu")
    assert grid.bounds == pytest.approx((0, np.pi / 2, 0, 2 * np.pi, 0, 0))
    np.testing.assert_array_equal(grid["tilted_density"], found.tilted_density.values.ravel())
    np.testing.assert_allclose(grid["share"], np.sin(grid.points[:, 0]) ** 2, atol=1e-12)
    assert grid.active_scalars_name == "tilted_density"
    assert bytes(grid.field_data["along_x"]).decode() == "angle whose squared sine is the share of q2 (rad)"
    assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(np.pi**2)
    density = pyvista.read(folder / "density.vtu")
    np.testing.assert_array_equal(density["stationary_density"], found.stationary_density.values.ravel())


@pytest.mark.slow
def test_figure_of_two_modes(modes, tmp_path):
    case, results, folder = modes
    drawn = load_case(case.path, [*STATED[:-1], STATED[-1].replace("false", "true")])
    [figure] = PART.figures(drawn, results[0], folder, None)
    figure.draw([tmp_path / "densities.svg"], "")
    assert (tmp_path / "densities.svg").exists()
    assert not [*PART.figures(case, results[0], folder, None)]
    assert not (folder / "densities.png").exists()  # as the case wants no figures


@pytest.mark.slow
def test_files_are_removed_with_other_parameters(modes):
    case, _, folder = modes
    other = load_case(case.path, ["expect=[]", "moments.p=[2.0]", "output={quantities=['moment'], figure=false}"])
    run(other, folder.parent)
    assert not [*folder.rglob("*.vtu"), *folder.glob("densities*")]


@pytest.mark.slow
def test_a_sphere_of_three_variables(tmp_path):
    (tmp_path / "three.toml").write_text(THREE, encoding="utf-8")
    run(load_case(tmp_path / "three.toml"), tmp_path)
    grid = pyvista.read(tmp_path / "three/eigenfunctions/p+1.0.vtu")
    np.testing.assert_allclose(np.linalg.norm(grid.points, axis=1), 1, atol=1e-12)
    values = grid["tilted_density"].reshape(-1, len(np.unique(grid["latitude"])))
    half = len(values) // 2
    np.testing.assert_allclose(values[half:, ::-1], values[: half + 1], atol=1e-8 * values.max())  # −e is e
    sizes = grid.compute_cell_sizes()["Area"]
    middle = grid.point_data_to_cell_data()["tilted_density"]
    assert sizes @ middle == pytest.approx(1, abs=0.01)
    with xarray.open_dataset(tmp_path / "three/densities.nc", engine="h5netcdf") as found:
        assert found.tilted_density.dims == ("p", "longitude", "latitude")
