"""Results as data: what they hold, and what xarray, pandas, netCDF, notebooks and figures get of it."""

import pickle
import re
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
import xarray
from matplotlib import pyplot
from matplotlib.colors import to_hex
from scipy.interpolate import RegularGridInterpolator

import fpsolve
from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.analysis import Axis, design, excursion, uncertainty
from fpsolve.exponent import SUMMARY_NUMBERS, Estimate, Failure
from fpsolve.model import Telegraph, White
from fpsolve.simulation import MomentEstimate, MonteCarlo, Response
from tests.contract.test_cases import CASES
from tests.kit import TEXT, case_in, matrices, rates

matplotlib.use("Agg")
OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
HIT = Problem(OSCILLATOR, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction())
SETTLING = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.4, epsilon=0.5, c2=0.5, c3=0.2)
TURNING = matrices(
    ((-0.1, 1.0, 0.0), (-1.0, -0.2, 1.0), (0.0, -1.0, -0.1)),
    ((0.0, 0.3, 0.0), (-0.3, 0.0, 0.1), (0.0, 0.0, 0.2)),
    White(s=1.0),
)
FRAME = Axis("oscillator.omega", 0.5, 2.0, "log"), Axis("noise.D0", 0.01, 2.0, "log")
EDGES, DECAY = np.linspace(0, 3, 31), np.exp(-np.linspace(0, 3, 30))
RESPONSE = Response(
    means={name: (i + 1.0, 0.1) for i, name in enumerate(("x", "x_squared", "v_squared", "amplitude", "energy"))},
    x_edges=EDGES, v_edges=np.linspace(-3, 3, 21), density=np.outer(DECAY, np.exp(-(np.linspace(-2, 2, 20) ** 2))),
    amplitude_edges=EDGES, amplitude_density=DECAY, amplitude_error=0.01 * DECAY, outside=1e-4, impact_rate=0.3,
    time=500.0,
)  # fmt: skip
ESTIMATES = MomentEstimate(1.0, 0.004, 1e-4, "direct", 6000.0), MomentEstimate(9.0, None, None, "direct", 3.0)
JUMPING = rates("x' = v; v' = -x - 0.16*v - xi*x", Telegraph(a=0.8, k=1.0))
MAIN = {
    "moments": ("moment", 3),
    "no moment": ("moment", 0),
    "function": ("moment", 201),
    "exponent": ("lyapunov_exponent", 1),
    "index": ("stability_index", 1),
    "slope": ("moment_by_noise.D0", 1),
    "number": ("value", 1),
    "tilted": ("density", None),
    "stationary": ("density", None),
    "sensitivities": ("moment_by_theta", 14),
    "boundary": ("x", None),
    "no branch": ("x", 0),
    "simulation": ("moment", 2),
    "no estimate": ("moment", 1),
    "response": ("density", 30),
    "settled": ("density", None),
    "set": ("moment", None),
    "directions": ("density", None),
    "design": ("oscillator.c1", None),
    "uncertain": ("moment", None),
    "excursion": ("level", None),
    "states": ("density", None),
}
"""Results, each with its main variable, and the rows of its table."""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    moments = fpsolve.moment_lyapunov(HIT, [2.0, -1.0, 0.0])
    empty = {name: np.zeros(0) for name in ("p", "value", "slope", "error_estimate", "residual")}
    slopes = fpsolve.sensitivities(HIT, [1.0, 2.0])
    line = fpsolve.boundary(HIT, "moment(2) = 0", *FRAME, nodes=5)
    simulated = MonteCarlo(
        ESTIMATES, 0.001, 0.0001, 0.005, 0.0002, paths=4096, time=400.0, step=0.02, seed=1, impacts=12345,
        warnings=("one", "another"), parameters=HIT.values,
    )  # fmt: skip
    case = case_in(tmp_path_factory.mktemp("case"), TEXT, ["output={ quantities=['moment', 'lyapunov_exponent'] }"])
    found = {
        "moments": moments,
        "no moment": replace(moments, failures=(Failure(9.0, "it is too large"),), **empty),
        "function": fpsolve.MomentLyapunovFunction(HIT, (-1.0, 2.0)),
        "exponent": fpsolve.lyapunov_exponent(HIT),
        "index": fpsolve.stability_index(HIT),
        "slope": slopes.moments[1]["noise.D0"],
        "number": Estimate(1.0, 0.25, 2.0, meaning="a number"),
        "tilted": fpsolve.tilted_density(moments.pairs[0]),
        "stationary": fpsolve.stationary_density(moments.pairs[2]),
        "sensitivities": slopes,
        "boundary": line,
        "no branch": replace(line, traces=()),
        "simulation": simulated,
        "no estimate": replace(simulated, estimates=()),
        "response": RESPONSE,
        "settled": fpsolve.stationary_response(Problem(SETTLING, OrnsteinUhlenbeck(alpha=2.0, sigma=0.9)), rtol=0.1),
        "set": fpsolve.run(case, case.path.parent)[0],
        "directions": fpsolve.tilted_density(fpsolve.ExponentSolver(TURNING, rtol=1e-3).pair(1.0)),
        "design": design(HIT, "moment(2) = 0.02", Axis("oscillator.c1", -2.0, 2.0)),
        "uncertain": uncertainty(HIT, {"noise.D0": 0.05}, [1.0, 2.0]),
        "excursion": excursion(JUMPING),
        "states": fpsolve.tilted_density(fpsolve.ExponentSolver(JUMPING).pair(2.0)),
    }
    assert set(found) == set(MAIN)
    return found


@pytest.fixture(params=MAIN)
def name(request):
    yield request.param
    pyplot.close("all")


def test_result_becomes_xarray_netcdf_pandas_a_line_a_table_and_a_picture(pictures, results, name, tmp_path):
    """Each variable says what it is and its unit; an error has the unit of its number."""
    result = results[name]
    found = result.to_xarray()
    for each, variable in found.variables.items():
        assert variable.attrs["long_name"], each
        assert variable.attrs["units"], each
        if f"{each}_error" in found:
            error = found[f"{each}_error"]
            assert (error.attrs["units"], error.dims) == (variable.attrs["units"], variable.dims)
    assert (bool(found.attrs["title"]), found.attrs["fpsolve_version"]) == (True, fpsolve.__version__)
    found.to_netcdf(tmp_path / "result.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as read:
        xarray.testing.assert_identical(read.load(), found)
    text = repr(result)
    assert re.fullmatch(rf"{type(result).__name__}\((?!.*array).{{,98}}\)", text)
    assert len(text) <= 100
    main, rows = MAIN[name]
    assert main in result._repr_html_()
    if rows is not None:
        assert len(result.to_pandas()) == rows
    figure, (left, right) = pyplot.subplots(1, 2)
    assert result.plot(ax=right) is right
    assert (pyplot.get_fignums(), left.has_data(), right.get_title()) == ([figure.number], False, "")
    figure.draw_without_rendering()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("exponent", "Estimate(λ = 0.00108756975"),
        ("index", "Estimate(δ_p = -0.362912134"),
        ("slope", "Estimate(∂Λ(2)/∂noise.D0 = "),
        ("moments", "MomentLyapunov(3 p from -1 to 2, Λ(0) = 0 "),
        ("boundary", "Boundary(Λ(2) = 0: 1 branch over oscillator.omega and noise.D0)"),
    ],
)
def test_a_line_says_the_numbers(results, name, text):
    assert repr(results[name]).startswith(text)


def test_a_missing_number_says_why():
    still = fpsolve.stability_index(rates("x' = v; v' = -x - 0.1*v - xi*x", OrnsteinUhlenbeck(alpha=1.0, sigma=0.001)))
    assert not still
    assert repr(still).startswith("Absent(")
    assert still._repr_html_().startswith("<p>none: ")


def test_nobody_writes_into_the_arrays_of_results(results):
    found = [each for result in (*results.values(), results["set"].moments) for each in vars(result).values()]
    assert {each.flags.writeable for each in found if isinstance(each, np.ndarray)} == {False}


def same(found, name, values, error=None):
    np.testing.assert_array_equal(found[name], values)
    if error is not None:
        np.testing.assert_array_equal(found[f"{name}_error"], error)


def test_data_hold_the_numbers_of_python(results):
    moments, found = results["moments"], results["moments"].to_xarray()
    same(found, "p", [2.0, -1.0, 0.0])
    same(found, "moment", moments.value, moments.error_estimate)
    same(found, "moment_derivative", moments.derivative)
    same(found, "residual", moments.residual)
    assert (found.attrs["oscillator.omega"], found.attrs["oscillator.impact"], found.attrs["noise.D0"]) == (
        1.0,
        "delta",
        HIT.noise.D0,
    )
    assert moments.to_pandas().loc[2.0, "moment"] == moments.value[0]
    assert results["no moment"].to_xarray().attrs["failures"] == "it is too large"
    function, p = results["function"], np.array([0.5, 1.5])
    found = function.to_xarray(p)
    same(found, "moment", function(p), function.error_estimate(p))
    same(found, "moment_derivative", function.derivative(p))
    same(found, "moment_second_derivative", function.second_derivative(p))
    assert function.to_xarray().p.values[[0, -1]].tolist() == [-1.0, 2.0]
    density, found = results["tilted"], results["tilted"].to_xarray()
    same(found, "density", density.values)
    same(found, "phi", density.phi)
    same(found, "xi", density.xi)
    assert float((found.density * found.phi_weights * found.xi_weights).sum()) == pytest.approx(1.0)
    assert (found.density.attrs["units"], found.attrs["title"]) == (
        "time/rad",
        "tilted density at p = 2 by finite elements",
    )
    [branch], found = results["boundary"].branches, results["boundary"].to_xarray()
    for name in ("x", "y", "width"):
        same(found, name, getattr(branch, name))
    assert ({*found.line.values}, {*found.branch.values}, found.label.values.tolist()) == (
        {"moment(2) = 0"},
        {1},
        list(branch.labels),
    )
    assert (found.attrs["noise.r0"], found.x.attrs["key"], "noise.D0" in found.attrs) == (
        0.95,
        "oscillator.omega",
        False,
    )
    found = results["simulation"].to_xarray()
    same(found, "p", [1.0, 9.0])
    same(found, "moment", [0.004, np.nan], [1e-4, np.nan])
    same(found, "effective_paths", [6000.0, 3.0])
    same(found, "lyapunov_exponent", 0.001, 0.0001)
    same(found, "variance_rate", 0.005, 0.0002)
    assert {
        "paths": 4096,
        "step": 0.02,
        "seed": 1,
        "estimator": "direct",
        "warnings": "one\nanother",
    }.items() <= found.attrs.items()
    found = RESPONSE.to_xarray()
    same(found, "density", RESPONSE.density)
    same(found, "amplitude_density", DECAY, 0.01 * DECAY)
    np.testing.assert_allclose(found.x, (EDGES[1:] + EDGES[:-1]) / 2)
    same(found, "mean_x_squared", 2.0, 0.1)
    assert found.mean_energy.attrs["units"] == "length²/time²"


@pytest.mark.parametrize("name", SUMMARY_NUMBERS)
def test_a_summary_number_knows_what_it_is(name):
    estimate = SUMMARY_NUMBERS[name].solve(fpsolve.ExponentSolver(HIT))
    found = estimate.to_xarray()
    assert found[name].attrs == SUMMARY_NUMBERS[name].attributes
    same(found, name, estimate.value, estimate.error_estimate)


def test_sensitivities_are_by_parameter_with_units_of_a_ratio(results):
    slopes, found = results["sensitivities"], results["sensitivities"].to_xarray()
    for p, row in zip(slopes.p, slopes.moments, strict=True):
        for key, estimate in row.items():
            here = found.sel(p=p, parameter=key)
            same(here, "moment_by_theta", estimate.value, estimate.error_estimate)
            assert (here.theta.item(), slopes.to_pandas().loc[(p, key), "moment_by_theta"]) == (
                slopes.theta[key],
                estimate.value,
            )
    for name, row in slopes.summary_numbers.items():
        for key, estimate in row.items():
            same(found.sel(parameter=key), f"{name}_by_theta", estimate.value, estimate.error_estimate)
    units = {key: each.quantity.unit for key, each in slopes.summary_numbers["lyapunov_exponent"].items()}
    assert [units[f"oscillator.{name}"] for name in ("omega", "c1", "epsilon")] == ["1/time/(rad/time)", "1", "1/time"]
    assert found.theta_unit.sel(parameter="oscillator.omega").item() == "rad/time"
    missing = replace(slopes, moments=({}, slopes.moments[1])).to_xarray()
    assert np.isnan(missing.moment_by_theta[0]).all()
    same(missing, "moment_by_theta", np.stack([missing.moment_by_theta[0], found.moment_by_theta[1]]))


def test_results_are_values(results):
    """They pickle, compare and cannot be changed; a simulation is itself whatever its parameters are."""
    for name in ("exponent", "tilted", "sensitivities", "boundary", "response", "function"):
        again = pickle.loads(pickle.dumps(results[name]))
        xarray.testing.assert_identical(again.to_xarray(), results[name].to_xarray())
    estimate = results["exponent"]
    again = Estimate(estimate.value, estimate.error_estimate, estimate.scale)
    assert (again, hash(again)) == (estimate, hash(estimate))
    with pytest.raises(AttributeError):
        estimate.value = 2.0
    found = fpsolve.simulate(HIT, [1.0], paths=32, time=30.0)
    assert found.parameters == HIT.values
    assert (found, hash(found)) == (other := replace(found, parameters={}), hash(other))


def test_parameters_have_names_units_and_values():
    known = HIT.parameters | Problem(OSCILLATOR, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)).parameters
    assert known["noise.D0"].quantity.title == "noise intensity $D_0$ (1/time)"
    units = {key: known[key].quantity.unit for key in ("noise.sigma", "noise.treatment", "oscillator.omega")}
    assert units == {"noise.sigma": "1/time^(3/2)", "noise.treatment": "unknown", "oscillator.omega": "rad/time"}
    plane = Problem(fpsolve.PlaneSystem(OSCILLATOR.terms, OSCILLATOR.jumps, epsilon=0.5), White(s=1.0))
    assert (plane.values["system.epsilon"], plane.noise_quantity.unit) == (0.5, "unknown")
    named = [f"noise.axial.{each}" for each in ('unit="m/s^2"', 'symbol="u"', 'words="gust"')]
    gusty = fpsolve.load_case(CASES / "systems/own_equation.toml", named).problem.at({"noise.axial.sigma": 2.0})
    assert gusty.noise_quantity.title == "gust $u$ (m/s$^{2}$)"
    assert gusty.parameters["noise.axial.sigma"].quantity.unit == "m/s^2*time^(-1/2)"


UNITS = {
    "moments": ("$p$", "(1/time)", []),
    "function": ("$p$", "(1/time)", []),
    "exponent": ("", "(1/time)", []),
    "slope": ("", r"$\partial \Lambda(2)/\partial D_0$", []),
    "index": ("", r"$\delta_p$", []),
    "tilted": ("(rad)", "(1/time)", ["density (time/rad)"]),
    "sensitivities": ("(1/time)", "", []),
    "boundary": ("(rad/time)", "(1/time)", []),
    "simulation": ("$p$", "(1/time)", []),
    "response": ("(length)", "(length/time)", [r"density of $(x, \dot{x})$ (time/length²)"]),
}
"""What the labels of the axes end in, and the labels of colour bars."""


@pytest.mark.parametrize("name", UNITS)
def test_picture_of_a_result_names_units_on_the_canvas(pictures, results, name):
    axes = results[name].plot()
    *ends, bars = UNITS[name]
    labels = axes.xaxis.label, axes.yaxis.label
    for label, end in zip(labels, ends, strict=True):
        assert (label.get_text().endswith(end), bool(label.get_text())) == (True, bool(end)), label
    assert [each.get_ylabel() for each in axes.figure.axes if each is not axes] == bars
    axes.figure.draw_without_rendering()
    for label in (*labels, axes.title):
        assert (
            not label.get_text()
            or axes.figure.bbox.padded(0.1).count_contains(label.get_window_extent().get_points()) == 2
        )
    pyplot.close("all")


def test_pictures_show_the_numbers(results):
    moments, axes = results["moments"], results["moments"].plot()
    np.testing.assert_array_equal(
        axes.lines[0].get_xydata(), np.stack([moments.p, moments.value], axis=1)[np.argsort(moments.p)]
    )
    tilted, axes = results["tilted"], results["tilted"].plot()
    shown = axes.collections[0].get_array()
    between = RegularGridInterpolator(
        (tilted.phi, tilted.xi), tilted.values.copy(), bounds_error=False, fill_value=None
    )
    phi, xi = np.linspace(0, 2 * np.pi, shown.shape[1]), np.linspace(*axes.get_ylim(), shown.shape[0])
    np.testing.assert_allclose(shown, between(tuple(np.meshgrid(phi, xi))), atol=1e-12)
    [branch] = results["boundary"].branches
    np.testing.assert_array_equal(results["boundary"].plot().lines[0].get_data(), [branch.x, branch.y])
    for name, low, high in (("simulation", 0.0038, 0.0042), ("number", 0.75, 1.25)):
        [bars] = results[name].plot().containers
        np.testing.assert_allclose(bars.lines[2][0].get_segments()[0][:, 1], [low, high])
    assert not results["no estimate"].plot().containers
    band = RESPONSE.plot_amplitude().collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx(1.02)
    slopes = results["sensitivities"]
    bars = slopes.plot().containers
    for bar, row in zip(bars, (slopes.summary_numbers["lyapunov_exponent"], *slopes.moments), strict=True):
        assert [patch.get_width() for patch in bar] == pytest.approx(
            [slopes.theta[key] * row[key].value for key in slopes.theta]
        )
    pyplot.close("all")


def test_curves_in_one_picture_are_told_apart(results):
    axes = results["moments"].plot()
    assert axes.get_legend() is None
    results["simulation"].plot(axes)
    results["function"].plot(axes, label="exact", linestyle="--")
    texts = {text.get_text() for text in axes.get_legend().get_texts()}
    assert texts == {"finite elements", "Monte Carlo ± 2 standard errors", "exact"}
    handles, _ = axes.get_legend_handles_labels()
    assert len({to_hex(getattr(each, "lines", [each])[0].get_color()) for each in handles}) == 3
    assert results["moments"].plot(c="red").lines[0].get_color() == "red"
    pyplot.close("all")
