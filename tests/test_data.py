"""Results as data: what they hold, what xarray, pandas, netCDF, notebooks and figures get of it."""

import pickle
import subprocess
import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
import xarray
from matplotlib import pyplot
from matplotlib.colors import to_hex
from scipy.interpolate import RegularGridInterpolator

import fpsolve
from fpsolve import ExponentSolver, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.analysis import Axis, design, excursion, uncertainty
from fpsolve.case import Curve
from fpsolve.data import Result
from fpsolve.errors import FpsolveError
from fpsolve.exponent import INDICES, Budget, Estimate, Failure
from fpsolve.exponent.error import Absent
from fpsolve.model import CoefficientMatrix, LinearSystem, ParametricOscillator, Telegraph, White
from fpsolve.model.quantity import MOMENT
from fpsolve.nonlinear import stationary_response
from fpsolve.simulation import MomentEstimate, MonteCarlo, Response
from fpsolve.study import solve_curve
from fpsolve.study.solve import Numerics
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE
from tests.kit import case_text

matplotlib.use("Agg")
REDUCED = FIG1_NOISE.ou_reduction()
TURNING = Problem(
    LinearSystem(
        [
            CoefficientMatrix(0, ((-0.1, 1.0, 0.0), (-1.0, -0.2, 1.0), (0.0, -1.0, -0.1))),
            CoefficientMatrix(1, ((0.0, 0.3, 0.0), (-0.3, 0.0, 0.1), (0.0, 0.0, 0.2)), lambda xi: xi),
        ]
    ),
    White(s=1.0),
)
MEANS = "x", "x_squared", "v_squared", "amplitude", "energy"
SETTLING = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.4, epsilon=0.5, c2=0.5, c3=0.2)
FRAME = Axis("oscillator.omega", 0.5, 2.0, "log"), Axis("noise.D0", 0.01, 2.0, "log")
MAIN = {
    "moments": "moment",
    "one moment": "moment",
    "no moment": "moment",
    "function": "moment",
    "lyapunov_exponent": "lyapunov_exponent",
    "stability_index": "stability_index",
    "slope": "moment_by_noise.D0",
    "number": "value",
    "tilted": "density",
    "stationary": "density",
    "sensitivities": "moment_by_theta",
    "sensitivities of λ": "lyapunov_exponent_by_theta",
    "boundary": "x",
    "no branch": "x",
    "simulation": "moment",
    "no estimate": "moment",
    "response": "density",
    "stationary response": "density",
    "curve": "moment",
    "indices of a curve": "moment",
    "directions": "density",
    "design": "oscillator.c1",
    "uncertainty": "moment",
    "excursion": "level",
}
"""Results, by their names here, each with its main variable."""


def simulated(estimates):
    return MonteCarlo(
        estimates, 0.001, 0.0001, 0.005, 0.0002, paths=4096, time=400.0, step=0.02, seed=1, impacts=12345,
        warnings=("one", "another"), parameters=Problem(FIG1, REDUCED).values,
    )  # fmt: skip


def response():
    edges, decay = np.linspace(0, 3, 31), np.exp(-np.linspace(0, 3, 30))
    density = np.outer(decay, np.exp(-(np.linspace(-2, 2, 20) ** 2)))
    density[-1] = 0.0
    return Response(
        means={name: (i + 1.0, 0.1) for i, name in enumerate(MEANS)}, x_edges=edges, v_edges=np.linspace(-3, 3, 21),
        density=density, amplitude_edges=edges, amplitude_density=decay, amplitude_error=0.01 * decay,
        outside=1e-4, impact_rate=0.3, time=500.0,
    )  # fmt: skip


def curve(p, *indices):
    curve = Curve(Problem(FIG1, REDUCED).at({"noise.D0": 0.5}), {"noise.D0": 0.5})
    return solve_curve(
        curve, {"moment": {"p": p, "slopes": True}} | {name: {} for name in indices}, Numerics(1e-8, Budget(), None)
    ).result


@pytest.fixture(scope="module")
def results(fig1_solver):
    moments = fpsolve.moment_lyapunov(Problem(FIG1, REDUCED), [2.0, -1.0, 0.0])
    empty = {name: np.zeros(0) for name in ("p", "value", "slope", "error_estimate", "residual")}
    estimates = MomentEstimate(1.0, 0.004, 1e-4, "direct", 6000.0), MomentEstimate(9.0, None, None, "direct", 3.0)
    slopes = fpsolve.sensitivities(Problem(FIG1, REDUCED), [1.0, 2.0])
    line = fpsolve.boundary(Problem(FIG1, REDUCED), {"moment": 2.0}, *FRAME, nodes=5)
    found = {
        "moments": moments,
        "one moment": fpsolve.moment_lyapunov(Problem(FIG1, REDUCED), 2.0),
        "no moment": replace(moments, failures=(Failure(9.0, "it is too large"),), **empty),
        "function": fpsolve.MomentLyapunovFunction(Problem(FIG1, REDUCED), (-1.0, 2.0)),
        "lyapunov_exponent": fig1_solver.lyapunov_exponent(),
        "stability_index": fpsolve.stability_index(Problem(FIG1, REDUCED)),
        "slope": slopes.moments[1]["noise.D0"],
        "number": Estimate(1.0, 0.1, 2.0, meaning="a number"),
        "tilted": fpsolve.tilted_density(moments.pairs[0]),
        "stationary": fpsolve.stationary_density(moments.pairs[2]),
        "sensitivities": slopes,
        "sensitivities of λ": replace(slopes, p=np.zeros(0), moments=()),
        "boundary": line,
        "no branch": replace(line, traces=()),
        "simulation": simulated(estimates),
        "no estimate": simulated(()),
        "response": response(),
        "stationary response": stationary_response(
            Problem(SETTLING, OrnsteinUhlenbeck(alpha=2.0, sigma=0.9)), rtol=0.1
        ),
        "curve": curve([-1.0, 2.0], "lyapunov_exponent"),
        "indices of a curve": curve([], "lyapunov_exponent", "stability_index"),
        "directions": fpsolve.tilted_density(ExponentSolver(TURNING, rtol=1e-3).pair(1.0)),
        "design": design(Problem(FIG1, REDUCED), "moment(2) = 0.02", Axis("oscillator.c1", -2.0, 2.0)),
        "uncertainty": uncertainty(Problem(FIG1, REDUCED), {"noise.D0": 0.05}, [1.0, 2.0]),
        "excursion": excursion(Problem(ParametricOscillator(stiffness=1.0, damping=0.08), Telegraph(a=0.8, k=1.0))),
    }
    assert set(found) == set(MAIN)
    return found


@pytest.fixture(params=MAIN)
def result(request, results):
    return results[request.param]


@pytest.fixture(autouse=True)
def closed():
    yield
    pyplot.close("all")


def subclasses(kind):
    return {each for direct in kind.__subclasses__() for each in (direct, *subclasses(direct))}


def test_every_class_is_among_the_results(results):
    assert {type(each) for each in results.values()} == subclasses(Result)


def test_every_variable_says_what_it_is_and_in_which_unit(result):
    found = result.to_xarray()
    for name, variable in found.variables.items():
        assert variable.attrs["long_name"], name
        assert variable.attrs["units"], name
    for name in found.data_vars:
        if f"{name}_error" in found:
            assert found[f"{name}_error"].attrs["units"] == found[name].attrs["units"]
            assert found[f"{name}_error"].dims == found[name].dims
    assert found.attrs["title"]
    assert found.attrs["fpsolve_version"] == fpsolve.__version__
    assert all(isinstance(value, str | int | float) for value in found.attrs.values())


def test_netcdf_keeps_all(result, tmp_path):
    found = result.to_xarray()
    found.to_netcdf(tmp_path / "result.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as read:
        xarray.testing.assert_identical(read.load(), found)


def test_repr_is_one_short_line(result, results):
    pairs = results["moments"].pairs
    for each in (result, *pairs, *results["boundary"].branches, Absent("why " * 100)):
        text = repr(each)
        assert text.startswith(f"{type(each).__name__}(")
        assert text.endswith(")")
        assert len(text) <= 100
        assert "\n" not in text
        assert "array" not in text


def test_repr_says_the_numbers(results):
    exponent = results["lyapunov_exponent"]
    assert repr(exponent) == f"Estimate(λ = {exponent}, in 1/time)"
    assert repr(results["stability_index"]) == f"Estimate(δ_p = {results['stability_index']})"
    assert repr(results["slope"]).startswith("Estimate(∂Λ(2)/∂noise.D0 = ")
    assert repr(results["moments"]).startswith("MomentLyapunov(3 p from -1 to 2, Λ(0) = 0 ")
    assert repr(results["boundary"]) == "Boundary(Λ(2) = 0: 1 branch over oscillator.omega and noise.D0)"
    assert repr(Absent("unstable")) == "Absent(unstable)"


def test_notebooks_show_a_table(result, results):
    text = result._repr_html_()
    assert "xarray" in text
    names = {id(each): name for name, each in results.items()}
    assert MAIN[names[id(result)]] in text
    assert Absent("r < 1")._repr_html_() == "<p>none: r &lt; 1</p>"


def same(found, name, values, error=None):
    np.testing.assert_array_equal(found[name], values)
    if error is not None:
        np.testing.assert_array_equal(found[f"{name}_error"], error)


def test_numbers_of_moments(results):
    moments = results["moments"]
    found = moments.to_xarray()
    same(found, "p", [2.0, -1.0, 0.0])
    same(found, "moment", moments.value, moments.error_estimate)
    same(found, "moment_derivative", moments.derivative)
    same(found, "residual", moments.residual)
    assert found.attrs["oscillator.omega"] == 1.0
    assert found.attrs["oscillator.impact"] == "delta"
    assert found.attrs["noise.D0"] == REDUCED.D0
    assert found.moment.attrs == {**MOMENT.attributes, "equation": "(1), (19)", "units": "1/time"}
    assert results["no moment"].to_xarray().attrs["failures"] == "it is too large"


def test_numbers_of_a_function(results):
    function = results["function"]
    p = np.array([0.5, 1.5])
    found = function.to_xarray(p)
    same(found, "p", p)
    same(found, "moment", function(p), function.error_estimate(p))
    same(found, "moment_derivative", function.derivative(p))
    same(found, "moment_second_derivative", function.second_derivative(p))
    assert function.to_xarray().p.values[[0, -1]].tolist() == [-1.0, 2.0]


@pytest.mark.parametrize("name", INDICES)
def test_estimates_know_what_they_are(name, fig1_solver):
    estimate = INDICES[name].solve(fig1_solver, None)
    found = estimate.to_xarray()
    assert found[name].attrs == INDICES[name].attributes
    assert (found[name].item(), found[f"{name}_error"].item()) == (estimate.value, estimate.error_estimate)
    assert found.scale.item() == estimate.scale


def test_numbers_of_a_density(results):
    density = results["tilted"]
    found = density.to_xarray()
    same(found, "density", density.values)
    same(found, "phi", density.phi)
    same(found, "xi", density.xi)
    mass = (found.density * found.phi_weights * found.xi_weights).sum()
    assert mass.item() == pytest.approx(1.0)
    assert found.density.attrs["units"] == "time/rad"
    assert found.attrs["title"] == "tilted density at p = 2 by finite elements"
    assert results["stationary"].to_xarray().attrs["title"] == "stationary density at p = 0 by finite elements"


def test_numbers_of_sensitivities(results):
    slopes = results["sensitivities"]
    found = slopes.to_xarray()
    for i, p in enumerate(slopes.p):
        for key, estimate in slopes.moments[i].items():
            place = {"p": p, "parameter": key}
            assert found.moment_by_theta.sel(place).item() == estimate.value
            assert found.moment_by_theta_error.sel(place).item() == estimate.error_estimate
            assert found.theta.sel(parameter=key).item() == slopes.theta[key]
    for name, row in slopes.indices.items():
        for key, estimate in row.items():
            assert found[f"{name}_by_theta"].sel(parameter=key).item() == estimate.value
            assert found[f"{name}_by_theta_error"].sel(parameter=key).item() == estimate.error_estimate
    assert found.theta_unit.sel(parameter="oscillator.omega").item() == "rad/time"
    missing = replace(slopes, moments=({}, slopes.moments[1])).to_xarray()
    assert np.all(np.isnan(missing.moment_by_theta[0]))
    np.testing.assert_array_equal(missing.moment_by_theta[1], found.moment_by_theta[1])


def test_derivatives_have_the_unit_of_a_ratio(results):
    slopes = results["sensitivities"]
    exponent, index = slopes.indices["lyapunov_exponent"], slopes.indices["stability_index"]
    assert exponent["oscillator.omega"].quantity.unit == "1/time/(rad/time)"
    assert exponent["oscillator.c1"].quantity.unit == "1"
    assert exponent["oscillator.epsilon"].quantity.unit == "1/time"
    assert index["noise.tau0"].quantity.unit == "1/time"


def test_points_of_a_boundary(results):
    line = results["boundary"]
    (branch,) = line.branches
    found = line.to_xarray()
    same(found, "x", branch.x)
    same(found, "y", branch.y)
    same(found, "width", branch.width)
    assert found.label.values.tolist() == list(branch.labels)
    assert set(found.line.values) == {"moment 2"}
    assert set(found.branch.values) == {1}
    assert found.attrs["noise.r0"] == 0.95
    assert found.attrs["noise.treatment"] == "ou-reduction"
    assert "noise.D0" not in found.attrs
    assert (found.x.attrs["key"], found.x.attrs["units"]) == ("oscillator.omega", "rad/time")
    twice = replace(line, traces=line.traces * 2).to_xarray()
    np.testing.assert_array_equal(twice.branch, np.repeat([1, 2], branch.x.size))


def test_numbers_of_a_simulation(results):
    found = results["simulation"].to_xarray()
    same(found, "p", [1.0, 9.0])
    same(found, "moment", [0.004, np.nan], [1e-4, np.nan])
    same(found, "effective_paths", [6000.0, 3.0])
    same(found, "lyapunov_exponent", 0.001, 0.0001)
    same(found, "variance_rate", 0.005, 0.0002)
    wanted = {"paths": 4096, "time": 400.0, "step": 0.02, "seed": 1, "estimator": "direct", "warnings": "one\nanother"}
    assert wanted.items() <= found.attrs.items()


def test_simulations_know_their_parameters():
    noise = FIG1_NOISE.ou_reduction()
    found = fpsolve.simulate(Problem(FIG1, noise), [1.0], paths=32, time=30.0)
    assert found.parameters == Problem(FIG1, noise).values
    assert found == replace(found, parameters={})
    assert hash(found) == hash(replace(found, parameters={}))


def test_numbers_of_a_response(results):
    of, found = results["response"], results["response"].to_xarray()
    same(found, "density", of.density)
    same(found, "amplitude_density", of.amplitude_density, of.amplitude_error)
    for name, edges in (("x", of.x_edges), ("v", of.v_edges), ("amplitude", of.amplitude_edges)):
        same(found, f"{name}_edges", edges)
        np.testing.assert_allclose(found[name], (edges[1:] + edges[:-1]) / 2)
    for i, name in enumerate(MEANS):
        same(found, f"mean_{name}", i + 1.0, 0.1)
    assert found.mean_energy.attrs["units"] == "length²/time²"


def test_tables(results):
    rows = {
        "moments": 3, "no moment": 0, "function": 201, "lyapunov_exponent": 1, "sensitivities": 14, "simulation": 2,
        "sensitivities of λ": 7, "no estimate": 1, "response": 30, "boundary": results["boundary"].branches[0].x.size,
        "tilted": results["tilted"].values.size,
    }  # fmt: skip
    for name, count in rows.items():
        assert len(results[name].to_pandas()) == count, name
    moments = results["moments"]
    assert moments.to_pandas().loc[2.0, "moment"] == moments.value[0]
    slopes = results["sensitivities"]
    table = slopes.to_pandas()
    assert table.loc[(2.0, "noise.D0"), "moment_by_theta"] == slopes.moments[1]["noise.D0"].value
    assert results["stability_index"].to_pandas().stability_index.tolist() == [results["stability_index"].value]


def test_a_table_without_pandas_names_what_to_install(results, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(FpsolveError, match=r"pip install 'fpsolve\[pandas\]'"):
        results["moments"].to_pandas()


UNITS = {
    "moments": ("$p$", "(1/time)"),
    "function": ("$p$", "(1/time)"),
    "lyapunov_exponent": ("", "(1/time)"),
    "slope": ("", r"$\partial \Lambda(2)/\partial D_0$"),
    "stability_index": ("", r"$\delta_p$"),
    "tilted": ("(rad)", "(1/time)"),
    "sensitivities": ("(1/time)", ""),
    "boundary": ("(rad/time)", "(1/time)"),
    "simulation": ("$p$", "(1/time)"),
    "response": ("(length)", "(length/time)"),
}
"""What the labels of the axes end in."""
BARS = {"tilted": ["density (time/rad)"], "response": [r"density of $(x, \dot{x})$ (time/length²)"]}
"""The labels of colour bars."""


@pytest.mark.parametrize("name", UNITS)
def test_pictures_name_units(pictures, results, name):
    axes = results[name].plot()
    labels = axes.get_xlabel(), axes.get_ylabel()
    assert all(label.endswith(unit) for label, unit in zip(labels, UNITS[name], strict=True)), labels
    assert [bool(label) for label in labels] == [bool(unit) for unit in UNITS[name]]
    bars = [each.get_ylabel() for each in axes.figure.axes if each is not axes]
    assert bars == BARS.get(name, [])
    axes.figure.draw_without_rendering()
    box = axes.figure.bbox
    for label in filter(lambda label: label.get_text(), (axes.xaxis.label, axes.yaxis.label, axes.title)):
        extent = label.get_window_extent()
        assert box.x0 <= extent.x0
        assert extent.x1 <= box.x1
        assert box.y0 <= extent.y0
        assert extent.y1 <= box.y1


def test_every_result_is_drawn_where_it_is_told(pictures, result):
    figure, (left, right) = pyplot.subplots(1, 2)
    assert result.plot(ax=right) is right
    assert pyplot.get_fignums() == [figure.number]
    assert not left.has_data()
    assert right.get_title() == ""
    figure.draw_without_rendering()


def test_what_is_drawn(results):
    moments = results["moments"]
    axes = moments.plot()
    order = np.argsort(moments.p)
    np.testing.assert_array_equal(axes.lines[0].get_xydata(), np.stack([moments.p, moments.value], axis=1)[order])
    tilted, axes = results["tilted"], results["tilted"].plot()
    places, shown = (tilted.phi, tilted.xi), axes.collections[0].get_array()
    between = RegularGridInterpolator(places, tilted.values.copy(), bounds_error=False, fill_value=None)
    phi, xi = np.linspace(0, 2 * np.pi, shown.shape[1]), np.linspace(*axes.get_ylim(), shown.shape[0])
    np.testing.assert_allclose(shown, between(tuple(np.meshgrid(phi, xi))), atol=1e-12)
    x, y = results["boundary"].plot().lines[0].get_data()
    np.testing.assert_array_equal(x, results["boundary"].branches[0].x)
    np.testing.assert_array_equal(y, results["boundary"].branches[0].y)
    (dots,) = results["simulation"].plot().containers
    segments = dots.lines[2][0].get_segments()
    np.testing.assert_allclose(segments[0][:, 1], [0.004 - 2e-4, 0.004 + 2e-4])
    slopes = results["sensitivities"]
    bars = slopes.plot().containers
    keys = list(slopes.theta)
    for bar, row in zip(bars, (slopes.indices["lyapunov_exponent"], *slopes.moments), strict=True):
        widths = [patch.get_width() for patch in bar]
        assert widths == pytest.approx([slopes.theta[key] * row[key].value for key in keys])


def test_the_band_is_the_error():
    wide = Estimate(1.0, 0.25, 1.0)
    (bars,) = wide.plot().containers
    np.testing.assert_allclose(bars.lines[2][0].get_segments()[0][:, 1], [0.75, 1.25])
    axes = response().plot_amplitude()
    band, of = axes.collections[0].get_paths()[0].vertices[:, 1], response()
    assert band.max() == pytest.approx(np.max(of.amplitude_density + 2 * of.amplitude_error))


def test_curves_in_one_picture_are_told_apart(results):
    axes = results["moments"].plot()
    assert axes.get_legend() is None
    results["simulation"].plot(axes)
    results["function"].plot(axes, label="exact", linestyle="--")
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert set(texts) == {"finite elements", "Monte Carlo ± 2 standard errors", "exact"}
    colours = [to_hex(line.get_color()) for line in axes.lines if len(line.get_xdata()) > 1 and line.get_gid() is None]
    assert len(colours) >= 3
    handles, _ = axes.get_legend_handles_labels()
    assert len({to_hex(getattr(each, "lines", [each])[0].get_color()) for each in handles}) == 3
    (line,) = results["moments"].plot(c="red").lines[:1]
    assert line.get_color() == "red"


def test_results_stay_values(results):
    estimate = results["lyapunov_exponent"]
    again = pickle.loads(pickle.dumps(estimate))
    assert again == estimate
    assert again == Estimate(estimate.value, estimate.error_estimate, estimate.scale)
    assert hash(again) == hash(estimate)
    assert again.quantity.name == "lyapunov_exponent"
    for name in ("tilted", "sensitivities", "boundary", "response", "function"):
        xarray.testing.assert_identical(
            pickle.loads(pickle.dumps(results[name])).to_xarray(), results[name].to_xarray()
        )
    with pytest.raises(AttributeError):
        estimate.value = 2.0


def test_parameters():
    known = Problem(FIG1, REDUCED).parameters | Problem(FIG1, UNIT_NOISE).parameters
    assert known["noise.D0"].quantity.title == "noise intensity $D_0$ (1/time)"
    assert known["oscillator.restitution"].quantity.attributes["units"] == "1"
    assert known["noise.sigma"].quantity.unit == "1/time^(3/2)"
    assert known["noise.treatment"].quantity.unit == "unknown"
    strong = VibroImpactOscillator(omega=2.0, restitution=0.9, c1=0.0, epsilon=1.0)
    values = Problem(strong, UNIT_NOISE).values
    assert values["oscillator.omega"] == 2.0
    assert {"noise.alpha": 1.0, "noise.sigma": 1.0}.items() <= values.items()
    plane = fpsolve.PlaneSystem(strong.terms, strong.jumps, epsilon=0.5)
    assert Problem(plane, UNIT_NOISE).values["system.epsilon"] == 0.5
    assert Problem(plane, UNIT_NOISE).noise_quantity.unit == "unknown"


START = """
import sys
import fpsolve, fpsolve.cli, fpsolve.workflow.cases
fpsolve.VibroImpactOscillator, fpsolve.ExponentSolver, fpsolve.tilted_density, fpsolve.sensitivities, fpsolve.boundary
slow = {"xarray", "pandas", "matplotlib", "IPython", "numba"}
print(sorted({*slow, "h5netcdf", "h5py"} & set(sys.modules)))
fpsolve.cli.main(["run", "test.toml", "--quiet"])
print(sorted({*slow, "pyvista"} & set(sys.modules)))
"""
QUICK = '[moments]\np = [1.0]\n[output]\nfigure = false\nquantities = ["moment"]\n'


def test_nothing_that_takes_long_is_imported_at_the_start(tmp_path):
    """Nor by a run without figures."""
    (tmp_path / "test.toml").write_text(case_text(QUICK), encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", START], capture_output=True, text=True, check=True, cwd=tmp_path)
    before, written, after = done.stdout.splitlines()
    assert (before, after) == ("[]", "[]")
    assert written.startswith("written: ")
    assert (tmp_path / "results/test/results.nc").is_file()
