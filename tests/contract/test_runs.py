"""Numbers of `fpsolve run` and `fpsolve design` on cases of one's own, beside those of second methods."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
import pyvista
from scipy.integrate import simpson
from scipy.stats import norm

import fpsolve
from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, load_case, moment_lyapunov, simulate
from fpsolve.analysis import latin_hypercube
from fpsolve.model import Filter, White
from fpsolve.solve import compare
from tests.kit import case_in, case_text, files, read_csv, read_json, run, solve_case
from tests.numbers.second import LOAD, even, spring
from tests.oracles import planar

ONLY = '[output]\nquantities = ["moment"]\nfigure = false\n'
PLANE = 'title = "T"\nmoments.p = [2.0]\noutput = { quantities = ["moment"], figure = false }\n'
PLANE += '[system]\nvariables = ["x", "v"]\n'
GAUSSIAN = '[noise]\nkind = "ornstein-uhlenbeck"\nalpha = 2.0\nsigma = 1.5\n'
NON_GAUSSIAN = "[noise]\nD0 = 0.3\ntau0 = 0.7\nr0 = 0.42\n"
DAMPED = PLANE + 'drift = ["v", "-x - 0.2*v - xi*x"]\n'
CLOCK = """drift = ["v", "-2*zeta*v - (1 + clock + load)*x"]
parameters = { zeta = 0.05 }
noises = { clock = "noise.clock", load = "noise.load" }
walls = [{ at = "x = 0", restitution = 0.9 }]
[noise.clock]
kind = "bounded"
mu = 0.2
nu = 2.0
sigma = 0.0
[noise.load]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 0.3
"""
MODES = """title = "Two modes under filtered noise"
moments.p = [2.0]
output = { quantities = ["moment"], figure = false }
[system]
kind = "modes"
mass = [[1.0, 0.0], [0.0, 1.0]]
damping = [[0.1, 0.0], [0.0, 0.16]]
stiffness = [[1.0, 0.0], [0.0, 2.56]]
stiffness_noise = [[0.5, 0.3], [0.3, 0.5]]
[noise]
kind = "filter"
omega = 2.0
zeta = 0.1
s = 0.3
output = [1.0, 0.0]
"""
VOLTAGE = """title = "An oscillator with a voltage"
moments.p = [2.0]
output.quantities = ["moment"]
[system]
variables = ["x", "v", "u"]
drift = ["v", "-omega**2 * x - 2*zeta*omega * v + kappa * u - xi * x", "-kappa * v - u"]
parameters = { omega = 1.0, zeta = 0.05, kappa = 0.5 }
[noise]
kind = "white"
s = 0.8
"""


def parameter_sets(folder, text, *options, code=0):
    """What summary.json has of each parameter set."""
    done = run(folder, "run", "case.toml", "--jobs", "1", *options, case=text)
    assert done.code == code, done.err
    return read_json(folder / "results/case/summary.json")["sets"]


def gaussian(*rates):
    return even(2, ((0.0, 1.0), rates), (LOAD, OrnsteinUhlenbeck(2.0, 1.5)), count=40)


def by_polynomials():
    driven = LOAD, planar.between_ends(0.3, 0.7, 0.42)
    return planar.moment_exponent(planar.Planar(spring(1.0, 0.1), (driven,)), 2, 1)[0]


def by_reduction():
    return even(2, spring(1.0, 0.1), (LOAD, NonGaussianNoise(D0=0.3, tau0=0.7, r0=0.42).ou_reduction()), count=40)


def of_modes():
    steady, driven = np.zeros((4, 4)), np.zeros((4, 4))
    steady[[0, 2], [1, 3]] = 1.0
    steady[1, :2], steady[3, 2:] = (-1.0, -0.1), (-2.56, -0.16)
    driven[1, ::2], driven[3, ::2] = (-0.5, -0.3), (-0.3, -0.5)
    return even(2, steady, (driven, Filter(2.0, 0.1, 0.3, 1.0, 0.0)), count=6)


def of_voltage():
    return even(2, [[0, 1, 0], [-1, -0.1, 0.5], [0, -0.5, -1]], (np.pad(LOAD, (0, 1)), White(0.8)))


def of_clock():
    noises = planar.circle(0.2, 2.0, 0.0), planar.ornstein_uhlenbeck(1.0, 0.3 / math.sqrt(2))
    system = planar.Planar(spring(), tuple((LOAD, each) for each in noises), log_factor=math.log(0.9))
    found = planar.nearest(system.generator(2.0, 16, 12)[0], -0.07)
    return float(np.max(found[np.abs(found.imag) < 1e-8].real))


@pytest.mark.parametrize(
    ("text", "second", "most"),
    [
        pytest.param(DAMPED + NON_GAUSSIAN, by_polynomials, 1e-8, id="noise of Eq. (7)"),
        pytest.param(DAMPED + NON_GAUSSIAN + 'treatment = "ou-reduction"', by_reduction, 1e-8, id="its reduction"),
        pytest.param(
            PLANE + 'drift = ["v", "x - 0.4*v - xi*x"]\n' + GAUSSIAN, lambda: gaussian(1.0, -0.4), 1e-8, id="pendulum"
        ),
        pytest.param(
            PLANE + 'drift = ["v", "-x + 0.04*v - 0.3*x**3 - 0.2*v**3 - xi*x"]\n' + GAUSSIAN,
            lambda: gaussian(-1.0, 0.04),
            1e-8,
            id="Duffing-Rayleigh oscillator",
        ),
        pytest.param(VOLTAGE, of_voltage, 1e-5, id="three variables", marks=pytest.mark.slow),
        pytest.param(MODES, of_modes, 1e-4, id="two modes"),
        pytest.param(
            PLANE + CLOCK,
            of_clock,
            1e-5,
            id="clock, noise and wall",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_second_moment_of_a_case_of_equations_is_within_its_error(tmp_path, text, second, most):
    [parameter_set] = parameter_sets(tmp_path, text)
    [found] = parameter_set["moments"]
    assert abs(found["moment"] - second()) <= found["moment_error"] + 1e-9
    assert found["moment_error"] <= most


def test_a_moment_by_closed_equations_is_solved_on_no_elements(tmp_path):
    [parameter_set] = parameter_sets(tmp_path, MODES)
    assert (parameter_set["discretisation"], parameter_set["moments"][0]["moment_derivative"]) == (None, None)


def test_exact_noise_is_said_to_be_that_of_the_paper(tmp_path):
    out = run(tmp_path, "run", "case.toml", case=DAMPED + NON_GAUSSIAN).out
    assert out.startswith('T\nnoise.treatment = "exact": the noise is that of Eq. (7).\n')
    [parameter_set] = read_json(tmp_path / "results/case/summary.json")["sets"]
    assert parameter_set["parameters"]["noise.treatment"] == "exact"


@pytest.mark.slow
def test_three_variables_are_reported_and_proven_under_white_noise_alone(tmp_path):
    [parameter_set] = parameter_sets(tmp_path, VOLTAGE, "--report")
    assert parameter_set["discretisation"] is None  # Λ(2) is by closed equations
    folder = tmp_path / "results/case"
    assert "du/dt = −0.5 v − u" in (folder / "report.html").read_text(encoding="utf-8")
    for arguments in (["prove", "case.toml"], ["prove", "--check", str(folder / "proof.json")]):
        assert run(tmp_path, *arguments).code == 0
    coloured = VOLTAGE.replace('kind = "white"\ns = 0.8\n', 'kind = "ornstein-uhlenbeck"\nalpha = 1.0\nsigma = 0.5\n')
    done = run(tmp_path, "prove", "case.toml", case=coloured)
    assert (done.code, "3 variables under other noise than white, or with a delay" in done.err) == (2, True)


def test_modes_that_are_not_coupled_have_the_second_moment_of_one_whatever_their_units(tmp_path):
    text = 'title = "T"\nmoments.p = [2.0]\n[system]\nkind = "modes"\nmass = [[1e13, 0.0], [0.0, 1.0]]\n'
    text += "stiffness = [[4e13, 0.0], [0.0, 1.0]]\ndamping = [[9e12, 0.0], [0.0, 0.2]]\n"
    both = case_in(tmp_path, f"{text}stiffness_noise = [[0.0, 0.0], [0.0, 1.0]]\n{GAUSSIAN}").problem
    found = moment_lyapunov(both, 2.0, rtol=1e-6)
    assert abs(found.value[0] - gaussian(-1.0, -0.2)) <= found.error_estimate[0] <= 1e-5


VARIED = (
    DAMPED.replace("0.2*v - xi", "2*zeta*v - load") + 'parameters = { zeta = 0.1 }\nnoises = { load = "noise.axial" }\n'
)
VARIED += GAUSSIAN.replace("[noise]", "[noise.axial]")


def test_values_in_vary_and_in_set_are_solved_alike(tmp_path):
    both = parameter_sets(
        tmp_path, VARIED, "--set", "vary.system.zeta=[0.1, 0.2]", "--set", "vary.noise.axial.alpha=[2.0]"
    )
    assert [parameter_set["moments"][0]["moment"] for parameter_set in both] == pytest.approx(
        [gaussian(-1, -0.2), gaussian(-1, -0.4)], abs=1e-8
    )
    for options in ("system.zeta=0.2", "system.parameters.zeta=0.2"):
        [alone] = parameter_sets(tmp_path, VARIED, "--set", options)
        assert alone["moments"][0]["moment"] == both[1]["moments"][0]["moment"]


TRIANGULAR = """title = "Triangular"
moments.p = [0.0, 1.0, 2.0, 3.0]
output.quantities = ["moment", "lyapunov_exponent"]
[system]
variables = ["x", "y"]
drift = ["-0.3*x + 0.4*load*x", "0.5*x - 1.0*y - load*y"]
noises = { load = "noise.axial" }
[noise.axial]
kind = "ornstein-uhlenbeck"
alpha = 1.0
standard_deviation = 0.5
"""


def test_growth_on_and_across_a_ray_that_is_never_left_is_told_for_each(tmp_path):
    """S(0) = 2 · 0.25: p(−0.3) + ¼p²·0.16 across the ray x = 0, and −p + ¼p² on it; from records, too."""
    [parameter_set], again = (parameter_sets(tmp_path, TRIANGULAR) for _ in range(2))
    assert again == [parameter_set]
    assert [each["name"] for each in parameter_set["classes"]] == [
        f"{how} the ray at phi = 1.5708" for how in ("along", "across")
    ]
    p, total = (np.array([row[name] for row in parameter_set["moments"]]) for name in ("p", "moment"))
    for found, growth, strength in zip(parameter_set["classes"], (-1.0, -0.3), (1.0, 0.4), strict=True):
        assert abs(found["lyapunov_exponent"] - growth) < 1e-9
        expected = p * growth + 0.25 * p**2 * strength**2
        np.testing.assert_allclose([row["moment"] for row in found["moments"]], expected, atol=1e-9)
        assert np.all(total >= expected - 1e-9)


BLOCKS = """title = "Blocks"
moments.p = [-2.0, -0.5, 1.0, 2.0]
output.quantities = ["moment", "lyapunov_exponent", "stability_index", "sensitivities"]
[system]
variables = ["y", "x", "v"]
drift = ["-0.4*y", "v", "-x - 0.3*v - load*x + y"]
noises = { load = "noise.axial" }
[noise.axial]
kind = "white"
s = 0.8
"""


def test_blocks_of_variables_are_solved_one_by_one_and_told_by_name(tmp_path):
    done = run(tmp_path, "run", "case.toml", case=BLOCKS)
    said = " ".join(done.err.split())
    assert done.code == 3
    assert said.count("Λ(p) for p < 0 is not computed") == 1
    assert "(y), (x, v) do not all drive each other" in said
    [parameter_set] = read_json(tmp_path / "results/case/summary.json")["sets"]
    slow, own = parameter_set["classes"]
    assert [slow["name"], own["name"]] == ["y", "x, v"]
    assert slow["lyapunov_exponent"] == pytest.approx(-0.4, abs=1e-9)
    assert [row["moment"] for row in parameter_set["moments"]] == [row["moment"] for row in own["moments"]]
    second = even(2, spring(1.0, 0.15), (LOAD, White(0.8)))
    assert parameter_set["moments"][-1]["moment"] == pytest.approx(second, abs=1e-8)


EXACT = {"tau0": 1.0, "r0": 1.0, "treatment": "exact"}
TAILS = case_text("[moments]\np = [-0.4, 0.0]\n", noise=EXACT, epsilon=0.5, restitution=1.0, c1=0.0)


@pytest.mark.slow
def test_of_a_sweep_into_algebraic_tails_only_those_sets_lack_moments(tmp_path):
    wanted = 'output.quantities=["moment", "lyapunov_exponent", "stability_index", "variance_rate", "excursions"]'
    done = run(tmp_path, "run", "case.toml", "--set", wanted, "--set", 'vary."noise.r0"=[0.9, 1.1]', case=TAILS)
    assert done.code == 3
    said = " ".join(done.err.split())
    for name in ("Λ(-0.4)", "δ_p", "Λ″(0)"):
        assert f"{name} is not computed: for r0 > 1" in said
    light, heavy = read_json(tmp_path / "results/case/summary.json")["sets"]
    assert [[row["p"] for row in each["moments"]] for each in (light, heavy)] == [[-0.4, 0.0], [0.0]]
    assert light["stability_index"] is not None
    assert heavy["stability_index"] is None
    case = load_case(tmp_path / "case.toml", ["noise.r0=1.1", "moments.p=[0.0]"])
    paths = simulate(case.problem, [0.0], paths=4096, time=200.0)
    assert abs(heavy["lyapunov_exponent"] - paths.lyapunov_exponent) < 4 * paths.lyapunov_exponent_error


@pytest.mark.parametrize(
    ("vary", "options", "code", "status", "words"),
    [
        (
            '"oscillator.epsilon" = [0.1, 9.0, 0.2]',
            [],
            3,
            ["converged", "failed", "converged"],
            "epsilon = 9: the restitution law needs",
        ),
        (
            '"noise.D0" = [0.5]',
            ["budget.unknowns=100", "oscillator.epsilon=2.0", "oscillator.impact=delta", "moments.p=[9.0]"],
            3,
            ["failed"],
            "Λ(9) was not found",
        ),
    ],
)
def test_a_set_that_cannot_be_solved_fails_alone_and_is_told_once(tmp_path, vary, options, code, status, words):
    text = case_text(f"{ONLY}[moments]\np = [1.0]\n[vary]\n{vary}", impact="restitution")
    done = run(tmp_path, "run", "case.toml", "--jobs", "1", *(f"--set={each}" for each in options), case=text)
    assert done.code == code
    assert " ".join(done.err.split()).count(words) == 1
    assert [row["status"] for row in read_csv(tmp_path / "results/case/sets.csv")] == status
    for command in ("simulate", "prove") if "restitution" in words else ():
        assert words in run(tmp_path, command, "case.toml").err


@pytest.mark.slow
def test_a_set_of_a_file_that_overflows_is_told_with_its_line(tmp_path):
    rows = "noise.D0,oscillator.epsilon,oscillator.restitution\n"
    rows += "1,0.1,0.9\n1.1,1e4,1\n1.2,0.1,0.1\n1.3,1e3,0.5\n1.4,0.1,0.9\n"
    text = case_text(f'{ONLY}[moments]\np = [-1.0]\n[budget]\nseconds = 2.0\n[vary]\nfile = "sets.csv"', impact="delta")
    for line, header in ((5, ""), (6, "\n")):
        done = run(tmp_path, "run", "case.toml", "--jobs", "1", **{"case": text, "sets.csv": header + rows})
        assert (done.code, f"sets.csv:{line}: Eqs. (37)-(38) or R^p overflow; " in done.err) == (3, True)
        status = [row["status"] for row in read_csv(tmp_path / "results/case/sets.csv")]
        assert status[::2] + status[3:4] == ["converged"] * 3 + ["failed"]


@pytest.mark.slow
def test_a_stationary_density_that_is_not_resolved_is_not_written(tmp_path):
    slow = {"epsilon": 1.0930367, "omega": 0.07252887, "restitution": 0.57982, "c1": -0.338098, "impact": "restitution"}
    noise = {"D0": 0.09531017, "tau0": 49.143166, "r0": 0.61455889, "treatment": "exact"}
    done = run(tmp_path, "run", "case.toml", case=case_text("[moments]\np = [1.0]\nrtol = 1e-4\n", noise=noise, **slow))
    assert (done.code, [name for name in files(tmp_path) if name.endswith(".vtu")]) == (0, [])
    assert "the stationary density at p = 0 is not resolved" in " ".join(done.err.split())


NAMED = '[output]\nfigure = false\nquantities = ["lyapunov_exponent", "stability_index"]\n'
NO_INDEX = {"omega": 10.0, "c1": -1.0, "restitution": 0.5}


def test_orders_of_moments_may_be_left_out_and_a_run_that_finds_no_number_exits_with_3(tmp_path):
    [parameter_set] = parameter_sets(tmp_path, case_text(NAMED, noise={"D0": 0.1}, **NO_INDEX))
    assert (parameter_set["lyapunov_exponent"] < 0, "moments" in parameter_set) == (True, False)
    for name, code in (("moment", 2), ("stability_index", 3)):
        assert run(tmp_path, "run", "case.toml", "--set", f"output.quantities=['{name}']").code == code


RESPONSE = """[moments]
p = [1.0]
[output]
quantities = ["moment", "lyapunov_exponent", "response"]
figure = false
[response]
rtol = 0.1
grid = { amplitude = 40, phi = 49, xi = 12 }
"""
THIN = {"D0": 0.1, "tau0": 0.5, "r0": 1.0}
BOUNCING = {"epsilon": 0.5, "c1": 0.4, "c2": 0.5, "c3": 0.2, "restitution": 1.0}
EXPECTED = '[[expect]]\nquantity = "response.{}"\nvalue = {}\natol = 0.01\nsource = "another code"\n'


@pytest.fixture(scope="module")
def response(tmp_path_factory):
    """The folder of a run of a nonlinear oscillator that bounces off a wall."""
    folder = tmp_path_factory.mktemp("response")
    expected = EXPECTED.format("amplitude_squared", 1.54568) + EXPECTED.format("impact_rate", 1.0)
    parameter_sets(folder, case_text(RESPONSE + expected, noise=THIN, **BOUNCING))
    return folder


def test_means_of_a_stationary_response_agree_with_each_other_and_with_another_code(response):
    """a² = x² + ẋ²/ω², E = ω²a²/2, and an impact in each half-turn, nearly."""
    [parameter_set] = read_json(response / "results/case/summary.json")["sets"]
    found, x, v = parameter_set["response"], parameter_set["response_x_squared"], parameter_set["response_v_squared"]
    assert parameter_set["response_amplitude_squared"] == pytest.approx(x + v, rel=1e-12)
    assert parameter_set["response_energy"] == pytest.approx(0.5 * (x + v), rel=1e-12)
    assert parameter_set["response_impact_rate"] == pytest.approx(1 / math.pi, rel=0.02)
    assert abs(found["balance"]) <= found["balance_error"]
    assert (found["has_hump"], found["has_crater"]) == (True, True)
    case = load_case(response / "case.toml")
    results = fpsolve.run(case, response / "results")  # from its record
    assert [each.met for each in compare(case, results)] == [True, False]
    assert (
        abs(parameter_set["response_amplitude_squared"] - 1.54568) <= parameter_set["response_amplitude_squared_error"]
    )


def test_densities_of_a_response_in_all_files_are_one(response):
    folder = response / "results/case"
    [parameter_set] = read_json(folder / "summary.json")["sets"]
    a, density = np.loadtxt(folder / "response.csv", delimiter=",", skiprows=1).T
    step = a[1] - a[0]
    assert density.sum() * step == pytest.approx(1, abs=2e-3)  # 5e-4 of it is beyond the last amplitude
    assert (density * a**2).sum() * step == pytest.approx(parameter_set["response_amplitude_squared"], rel=5e-3)
    plane, whole = (pyvista.read(folder / f"response{name}.vtu") for name in ("", "_3d"))
    polar = plane["density"].reshape(49, 40).T * a[:, None]  # per amplitude and phase
    assert simpson(polar, dx=math.pi / 48, axis=1) == pytest.approx(density, rel=1e-3)
    table, xi = whole["density"].reshape(12, 49, 40).T, whole.points[::1960, 2]
    assert table.sum(axis=2) * (xi[1] - xi[0]) == pytest.approx(polar, abs=4e-3 * polar.max())
    x, v = plane.points[:, 0], plane.points[:, 1]
    assert (x >= 0).all()
    assert np.hypot(x, v) == pytest.approx(plane["amplitude"])
    assert np.arctan2(-v, x) == pytest.approx(plane["phi"])
    assert plane.compute_cell_sizes().get_array("Area").sum() == pytest.approx(0.5 * math.pi * a[-1] ** 2, rel=1e-2)
    assert (whole.compute_cell_sizes().get_array("Volume") > 0).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"c1": -0.4}, "is not positive, so that almost every path comes to rest"),
        ({"c2": 0.0, "c3": 0.0}, "in this linear system nothing limits the amplitude"),
        ({"noise": {**THIN, "r0": 1.1, "treatment": "exact"}}, "for r0 > 1"),
    ],
)
def test_why_there_is_no_response_is_told(tmp_path, changes, words):
    text = case_text(RESPONSE.replace("[1.0]", "[0.0]"), **{"noise": THIN, **BOUNCING, **changes})
    done = run(tmp_path, "run", "case.toml", case=text)
    assert (done.code, words in " ".join(done.err.split())) == (0, True), done.err
    assert read_json(tmp_path / "results/case/summary.json")["sets"][0]["response"] is None


CUBIC = """title = "A cubic oscillator"
moments.p = [1.0]
output.quantities = ["moment", "response"]
response = { rtol = 0.1, grid = { amplitude = 40, phi = 25, xi = 8 } }
monte_carlo = { paths = 256, time = 100.0 }
[system]
variables = ["q", "w"]
drift = ["w", "-omega**2 * q + 0.04*omega * w - k * q**3 - c * q**2 * w - xi * q"]
parameters = { omega = 2.0, k = 0.3, c = 0.4 }
[noise]
kind = "ornstein-uhlenbeck"
alpha = 2.0
sigma = 3.0
"""


@pytest.mark.slow
def test_response_of_equations_has_the_names_of_their_variables_and_agrees_with_paths(tmp_path):
    [parameter_set] = parameter_sets(tmp_path, CUBIC, "--monte-carlo")
    folder = tmp_path / "results/case"
    means = {
        name.removeprefix("response_"): each for name, each in parameter_set.items() if name.startswith("response_")
    }
    assert {"response.png", "response.pdf", "figure.png"} <= files(folder)
    names = ["amplitude", "amplitude_squared", "amplitude_fourth", "q_squared", "w_squared"]
    assert [*means] == [f"{name}{end}" for name in names for end in ("", "_error")]
    assert means["amplitude_squared"] == pytest.approx(means["q_squared"] + means["w_squared"] / 4, rel=1e-12)
    sample = read_json(folder / "monte_carlo.json")["response"]["means"]
    assert [*sample] == ["q_squared", "w_squared", "amplitude"]
    for name, mean in sample.items():
        assert abs(mean["value"] - means[name]) < 5 * mean["standard_error"]
    plane = pyvista.read(folder / "response.vtu")
    a, phi, density = (plane[name].reshape(-1, 40).T for name in ("amplitude", "phi", "density"))
    np.testing.assert_allclose(plane.points[:, 1], (-2 * a * np.sin(phi)).ravel("F"), atol=1e-12)
    assert phi[0, -1] - phi[0, 0] == pytest.approx(2 * math.pi)  # without a wall it is on both sides, alike
    np.testing.assert_array_equal(density[:, 1:25], density[:, 25:])
    share = 2 * np.trapezoid(density * a, dx=2 * math.pi / 48, axis=1).sum() * (a[1, 0] - a[0, 0])
    assert share == pytest.approx(1, abs=5e-3)
    damped = "system={ variables=['q', 'w'], drift=['w', '-q - w - w**3 - 0.1*xi*q'] }"
    done = run(tmp_path, "run", "case.toml", "--set", damped)
    assert "almost every path comes to rest" in " ".join(done.err.split())


UNIFORM = """title = "A uniform phase"
uncertain = { "system.a" = { sd = 0.05 } }
moments.p = [1.0, 2.0]
output = { quantities = ["moment", "lyapunov_exponent", "stability_index"], figure = false }
[system]
variables = ["x", "y"]
drift = ["a*x + y + xi*x", "-x + a*y + xi*y"]
parameters = { a = -0.3 }
[noise]
kind = "ornstein-uhlenbeck"
alpha = 0.8
sigma = 0.5
"""
WALL = case_text(
    '[moments]\np = [2.0]\n[output]\nquantities = ["moment", "lyapunov_exponent", "stability_index"]\n'
    '[uncertain]\n"noise.tau0" = 0.1\noscillator.restitution = { sd = 0.02 }\n',
    noise={"D0": 1.0, "r0": 0.9, "treatment": "exact"},
    epsilon=0.3,
    restitution=0.9,
    c1=-0.2,
)


def test_intervals_and_probabilities_of_an_uncertain_parameter_are_those_of_the_normal_law(tmp_path):
    """λ = a, Λ(p) = pa + p²S(0)/2 and δ_p = −2a/S(0), S(0) = σ²/α²."""
    strength, size = 0.25 / 0.64, norm.ppf(0.975) * 0.05
    [parameter_set] = parameter_sets(tmp_path, UNIFORM, "--report")
    found = parameter_set["uncertainty"]
    for name, value, spread in (
        ("lyapunov_exponent", -0.3, size),
        ("stability_index", 0.6 / strength, 2 * size / strength),
    ):
        assert [found[name][end] for end in ("low", "high")] == pytest.approx(
            [value - spread, value + spread], abs=1e-8
        )
    folder = tmp_path / "results/case"
    [row] = read_csv(folder / "sets.csv")
    assert float(row["lyapunov_exponent_low"]) == pytest.approx(-0.3 - size, abs=1e-9)
    first, second = read_csv(folder / "moments.csv")
    assert float(first["moment_high"]) == pytest.approx(-0.3 + strength / 2 + size, abs=1e-9)
    assert float(second["moment_low"]) == pytest.approx(-0.6 + 2 * strength - 2 * size, abs=1e-9)
    page = (folder / "report.html").read_text(encoding="utf-8").lower()
    share = f"{100 * norm.cdf((-0.6 + 2 * strength) / 0.1):.1f}"
    again = run(tmp_path, "run", "case.toml")
    for said in (page, again.out.lower()):
        assert f"the mean square grows with a probability of {share} %" in said
        assert "95% interval" in said
    assert "known from an earlier run" in again.out
    assert "fpsolve also computes" not in again.err


@pytest.mark.slow
def test_forty_samples_lie_in_the_intervals_as_stated(tmp_path):
    """By more than four standard errors of chance, 14 %, they are no others."""
    case = case_in(tmp_path, WALL)
    sets = latin_hypercube(case.uncertain.laws(case.problem), 40)
    rows = [",".join(sets), *(",".join(map(repr, map(float, row))) for row in zip(*sets.values(), strict=True))]
    (tmp_path / "sets.csv").write_text("\n".join(rows), encoding="utf-8")
    [parameter_set] = parameter_sets(tmp_path, WALL)
    text = WALL[: WALL.index("[uncertain]")]
    drawn = solve_case(case_in(tmp_path, text + '[vary]\nfile = "sets.csv"'))
    for name in ("lyapunov_exponent", "stability_index"):
        values = np.array([each.estimates[name].value for each in drawn])
        spread = parameter_set["uncertainty"][name]
        assert np.mean((values > spread["low"]) & (values < spread["high"])) == pytest.approx(0.95, abs=0.14)
        assert np.std(values) == pytest.approx((spread["high"] - spread["low"]) / (2 * norm.ppf(0.975)), rel=0.15)


def test_a_law_of_restitution_that_is_cut_at_1_lowers_the_interval_of_the_exponent(tmp_path):
    """Of r = 0.99 ± 0.02 more than half is cut off, so that its mean is below 0.99."""
    [parameter_set] = parameter_sets(
        tmp_path, WALL.replace('"noise.tau0" = 0.1\n', ""), "--set", "oscillator.restitution=0.99"
    )
    spread, value = parameter_set["uncertainty"]["lyapunov_exponent"], parameter_set["lyapunov_exponent"]
    assert spread["low"] < value
    assert spread["high"] - value < 0.8 * (value - spread["low"])


DESIGNED = """\
title = "The old oscillator"

[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1# to be designed

[noise]
D0 = 2.0
tau0 = 0.5
r0 = 0.95 # near 1
treatment = "exact"

[moments]
p = [
    2.0, # first
]

[vary] # goes
"noise.D0" = [0.1, 1.0]
"""
BY_DAMPING = "--for", "stability_index = 1", "--by", "oscillator.c1", "--from", "-2", "--to", "0"


def design(folder, *arguments, text=DESIGNED):
    options = "--set", "vary={}", "--set", "noise.D0=1.0"
    done = run(folder, "design", "case.toml", *options, *arguments, case=text)
    return done, folder / "results/case"


def test_a_design_is_the_case_with_its_comments_and_meets_what_it_expects(tmp_path):
    done, folder = design(tmp_path, *BY_DAMPING)
    told = read_json(folder / "design.json")
    [by] = told["by"]
    assert (done.code, told["complete"], by["before"]) == (0, True, 0.1)
    assert told["solves"] <= 12
    text = (folder / "design.toml").read_text(encoding="utf-8")
    kept = (
        DESIGNED[: DESIGNED.index("[vary]")]
        .replace("c1 = 0.1#", f"c1 = {by['after']!r} # before 0.1:")
        .replace("D0 = 2.0", "D0 = 1.0")
    )
    assert text.startswith(kept.rstrip())
    checked = run(tmp_path, "check", str(folder / "design.toml"))
    assert (checked.code, "1 of 1 ok" in checked.out) == (0, True)
    problem = load_case(folder / "design.toml").problem
    assert abs(moment_lyapunov(problem, 1.0).value[0]) < 1e-12
    design(tmp_path, "--for", "moment(2) = 5", *BY_DAMPING[2:])
    assert not (folder / "design.toml").exists()


def test_a_design_writes_new_sections_in_their_order_and_names_a_mesh_from_its_place(tmp_path):
    changes = ["monte_carlo.seed=1", "budget.unknowns=50000", 'output.quantities="all"', "excursions.levels=[2.0]"]
    mesh = run(tmp_path, "mesh", "m.vtu")
    assert mesh.code == 0, mesh.err
    _, folder = design(tmp_path, *BY_DAMPING, *(f"--set={each}" for each in (*changes, 'mesh.file="m.vtu"')))
    text = (folder / "design.toml").read_text(encoding="utf-8")
    assert all(one < other for one, other in pairwise(text.index(f"[{each.partition('.')[0]}]") for each in changes))
    assert 'file = "../../m.vtu"' in text
    assert load_case(folder / "design.toml").cylinder_mesh()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--for", "moment(2) = 5", *BY_DAMPING[2:]], 1, "Λ(2) = 5 cannot be reached with oscillator.c1 from -2 to 0"),
        ([*BY_DAMPING, "--set", "budget={ unknowns = 100 }"], 3, "not converged: case: "),
    ],
)
def test_a_design_that_is_not_found_leaves_no_case(tmp_path, arguments, code, words):
    done, folder = design(tmp_path, *arguments)
    assert (done.code, words in done.err) == (code, True)
    assert not (folder / "design.toml").exists()
    assert not read_json(folder / "design.json")["complete"]


def test_a_design_by_several_parameters_is_the_nearest_by_a_metric_that_it_states(tmp_path):
    arguments = "--for", "stability_index = 0.2", "--by", "oscillator.restitution", "--by", "noise.D0"
    out = design(tmp_path, *arguments)[0].out
    assert "the nearest such point" in out
    assert "oscillator.restitution / 0.8, noise.D0 / 1" in out
    told = json.loads(design(tmp_path, *arguments, "--json")[0].out)
    changes = [(each["after"] - each["before"]) / each["unit"] for each in told["by"]]
    assert told["distance"] == pytest.approx(math.hypot(*changes), rel=1e-12)
    assert [(each["start"], each["stop"]) for each in told["by"]] == [(0.4, 1.0), (0.5, 2.0)]
