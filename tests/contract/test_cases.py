"""The cases that come with fpsolve: their own expectations, and what the paper says of its figures."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fpsolve import ExponentSolver, load_case, moment_lyapunov
from fpsolve.commands import check_case
from fpsolve.solve import compare
from tests.conftest import sampled
from tests.kit import run, solve_case
from tests.oracles import perturbation

ROOT = Path(__file__).parents[2]
CASES = ROOT / "cases"
SYSTEMS = [
    path for path in sorted((CASES / "systems").glob("*.toml")) if "[[expect]]" in path.read_text(encoding="utf-8")
]
FIGURES = ["fig1", "fig2a", "fig2b", "fig2c", "fig3", "fig4", "fig5", "fig6"]
OTHERS = ["minimal", "theorem", "chart", "strong", "heavy_tails", "response", "response_impacts"]
LONG = ("fig3", "fig5", "fig6", "strong", "heavy_tails", "response", "response_impacts")
NAMES = sorted([*FIGURES, *OTHERS], key=lambda name: name in LONG)
DIGITS = 2e-13
"""To which the expected values of systems are known."""
FEWER = {"delayed_mathieu": 5e-11, "rattling": 3 * 7e-5}
"""Where they are known to fewer: by semi-discretisation, and to three standard errors by paths."""


@cache
def solved(name, *overrides):
    """A case and its parameter sets, with what it compares and draws alone."""
    wanted = ["output.eigenfunctions=[]", "output.sensitivities=false", *overrides]
    case = load_case(CASES / f"{name}.toml", wanted)
    return case, solve_case(case)


def solved_sets(name):
    """p, Λ(p) of shape (sets, p) and the parameter sets, in the order of the varied values, which increase."""
    case, results = solved(name, *["mesh={}"] * (name in LONG))
    [values] = case.vary.columns.values()
    assert list(values) == sorted(values)
    return case.p, np.array([result.moments.value for result in results]), results


def test_there_is_a_case_for_every_figure_of_the_paper():
    assert {path.stem for path in CASES.glob("*.toml")} == {*NAMES}
    named = {load_case(CASES / f"{name}.toml").mesh.file for name in FIGURES}
    assert named == {None, "../meshes/default.vtu", "../meshes/fine.vtu"}


@pytest.mark.parametrize("name", sampled(*NAMES, keep=len(NAMES) - len(LONG)))
def test_case_of_the_paper_converges_and_meets_its_expectations(name):
    if name in LONG:  # what is expected alone
        checked = check_case(load_case(CASES / f"{name}.toml"))
        results, comparisons = checked.results, checked.comparisons
    else:
        case, results = solved(name)
        comparisons = compare(case, results)
    assert comparisons
    assert [each for each in comparisons if not each.met] == []
    assert [each for result in results for each in (*result.warnings, *result.failures)] == []


@pytest.mark.parametrize("path", sampled(*SYSTEMS, keep=4), ids=lambda path: path.stem)
def test_case_of_a_system_meets_its_expectations_within_the_stated_error(path):
    """They come from the second methods of `tests/oracles`."""
    case = load_case(path)
    checked = check_case(case)
    results, comparisons = checked.results, checked.comparisons
    assert len(comparisons) == len(case.expect) > 0
    assert [each for each in comparisons if not each.met] == []
    assert not checked.failures
    for each in comparisons:
        [result] = [result for result in results if result.parameter_set.varied == each.varied]
        if each.expectation.of_response:
            continue  # from paths, whose standard error is in its tolerance
        if each.expectation.p is None:
            error = result.estimates[each.expectation.quantity].error_estimate
        else:
            [error] = result.moments.error_estimate[result.moments.p == each.expectation.p]
        assert abs(each.value - each.expectation.value) <= error + FEWER.get(path.stem, DIGITS)


GUESS = '{ quantity = "moment", p = 2.0, value = 0.0012, atol = 1e-4, source = "a guess" }'


@pytest.mark.parametrize(
    ("case", "override", "code", "words"),
    [
        ("minimal", "title=Mine", 0, "2 of 2 ok"),
        ("minimal", "oscillator.c1=0.2", 1, "0 of 2 ok"),
        ("minimal", f"expect=[{GUESS}]", 0, "1 of 1 ok"),
        ("fig1", "expect=[]", 0, "the case expects no value"),
    ],
)
def test_check_of_a_case_tells_by_its_code_whether_expectations_are_met(tmp_path, case, override, code, words):
    done = run(tmp_path, "check", str(CASES / f"{case}.toml"), "--set", override)
    assert done.code == code
    assert words in done.out


CAPTIONS = {
    "fig1": {"epsilon": 0.1, "omega": 1, "restitution": 0.8, "c1": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig2a": {"epsilon": 0.1, "restitution": 0.8, "omega": math.pi, "c1": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig2b": {"epsilon": 0.1, "restitution": 0.8, "omega": math.pi, "c1": 0.1, "D0": 0.1, "tau0": 0.5},
    "fig2c": {"epsilon": 0.1, "restitution": 0.8, "omega": math.pi, "c1": 0.1, "D0": 0.1, "r0": 0.95},
    "fig3": {"epsilon": 0.1, "restitution": 0.8, "c1": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig4": {"epsilon": 0.1, "restitution": 0.8, "c1": 0.1, "D0": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig5": {"epsilon": 0.1, "omega": math.pi, "c1": 0.1, "D0": 0.1, "r0": 0.95, "tau0": 0.5},
    "fig6": {"epsilon": 0.01, "restitution": 0.8, "omega": math.pi, "D0": 0.1, "r0": 0.95, "tau0": 0.5},
}
VARIED = dict(zip(FIGURES, ("D0", "D0", "r0", "tau0", "D0 omega", "omega", "restitution", "c1"), strict=True))


@pytest.mark.parametrize("name", FIGURES)
def test_curves_of_a_figure_have_the_parameters_of_its_caption(name):
    case = load_case(CASES / f"{name}.toml")
    assert {key.partition(".")[2] for key in case.vary.keys} == set(VARIED[name].split())
    for parameter_set in case.sets():
        stated = {key.partition(".")[2]: value for key, value in parameter_set.parameters.items()}
        assert stated | CAPTIONS[name] == stated


@pytest.mark.parametrize("name", NAMES)
def test_expected_values_of_weak_noise_are_those_of_the_paper(name):
    """Eqs. (37)-(39) where the source says so; the others lie within O(ε⁴) of them."""
    case = load_case(CASES / f"{name}.toml")
    for each in (each for each in case.expect if not each.of_response):
        [parameter_set] = [parameter_set for parameter_set in case.sets() if each.selects(parameter_set.varied)]
        theory = getattr(perturbation, "moment_exponent" if each.quantity == "moment" else each.quantity)
        value = theory(parameter_set.problem.system, parameter_set.noise, *([] if each.p is None else [each.p]))
        is_theory = "second order" in each.source
        if case.system.epsilon <= 0.1:
            assert each.value == pytest.approx(value, rel=1e-9 if is_theory else 1.5e-3)
        else:
            assert not is_theory


def test_fig1_differs_little_from_perturbation_theory():
    """«the differences between analytical and numerical results are very small»"""
    p, values, results = solved_sets("fig1")
    np.testing.assert_allclose(p, np.arange(-2, 6.01, 0.25), atol=1e-14)
    theory = np.array([result.moments.perturbation for result in results])
    assert 1e-5 < np.max(np.abs(values - theory)) < 2e-3 * np.max(np.abs(theory))


TRENDS = {
    # «the stability region and stability index … gradually decrease with increasing of D0 and r0»
    "fig2a": (-1, 0, 1),
    "fig2b": (-1, 0, 1),
    # «the stochastic stability of the system is enhanced by the increase of correlation time τ0»
    "fig2c": (1, 0, -1),
    # «along with increasing the value of parameter ω, the value of stability index δp gradually becomes larger»
    "fig4": (1, 0, 0),
    # «the stability index δp gradually decreases with the increase of parameter r», and λ increases
    "fig5": (-1, 1, 0),
    # «the moment stability of the system is reduced with increasing the parameter c1», and λ increases
    "fig6": (-1, 1, 1),
}
"""How δ_p, λ and Λ(p), p > 0, go with the value that is varied, where the paper says so: up or down."""


@pytest.mark.parametrize("name", sampled(*TRENDS, keep=4))
def test_stability_goes_with_a_parameter_as_the_paper_says(name):
    """«δp > 0 indicates that the system is pth moment-stable as 0 < p < δp»"""
    p, values, results = solved_sets(name)
    indices = [result.stability_index.value for result in results]
    exponents = [result.lyapunov_exponent.value for result in results]
    for sign, numbers in zip(TRENDS[name], (indices, exponents, values[:, p > 0]), strict=True):
        assert sign == 0 or np.all(sign * np.diff(numbers, axis=0) > 0)
    if name in ("fig2a", "fig2b"):
        widths = np.count_nonzero(values[:, p > 0] < 0, axis=1)
        assert np.all(np.diff(widths) <= 0)
        assert widths[-1] < widths[0]
    for row, index in zip(values, indices, strict=True):
        if index > 0:
            assert np.all(row[(p > 1e-9) & (p < index - 1e-9)] < 0)
            assert np.all(row[p > index + 1e-9] > 0)


def test_fig2b_departure_from_gaussian_noise_matters_little_near_1():
    """«the effect of departure coefficient r0 on the stochastic stability is very small as r0 → 1»"""
    case = load_case(CASES / "fig2b.toml")
    near, nearer, gaussian = (
        moment_lyapunov(case.parameter_set({"noise.r0": r0}).problem, 2.0).value[0] for r0 in (0.98, 0.99, 1.0)
    )
    assert abs(nearer - gaussian) < min(0.02 * abs(gaussian), 0.55 * abs(near - gaussian))


def test_fig2c_short_correlation_times_nearly_coincide():
    """«for the case τ0 = 0.0001, 0.001 and 0.01, the … Λ(p) are almost identical»"""
    _, values, results = solved_sets("fig2c")
    times = [result.parameter_set.varied["noise.tau0"] for result in results]
    assert times[:3] == [1e-4, 1e-3, 1e-2] != times
    height = np.ptp(values)
    assert np.max(np.ptp(values[:3], axis=0)) < 0.01 * height
    assert np.max(np.abs(values[3:] - values[0])) > 0.1 * height


def test_fig3_frequency_lowers_and_noise_raises_the_largest_exponent():
    """«λ decreases significantly with the increase of ω»; «the noise intensity D0 significantly effects the stochastic
    stability …, especially in the situation of small value of natural frequency»"""
    case, results = solved("fig3")
    assert (case.figure.x, case.figure.y) == ("oscillator.omega", "lyapunov_exponent")
    keys = "oscillator.omega", "noise.D0"
    found = {
        tuple(result.parameter_set.varied[key] for key in keys): result.lyapunov_exponent.value for result in results
    }
    omegas, intensities = map(case.vary.values, keys)
    values = np.array([[found[omega, intensity] for intensity in intensities] for omega in omegas])
    spread = np.ptp(values, axis=1)
    assert np.all(np.diff(values, axis=0) < 0)
    assert np.all(np.diff(values, axis=1) > 0)
    assert np.all(np.diff(spread) < 0)
    assert spread[0] > 10 * spread[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "key"), [("fig5", "oscillator.restitution"), ("fig6", "oscillator.c1")])
def test_almost_sure_stability_ends_where_the_paper_says(name, key):
    """Stable for r < 1 − π(S(2ω) + 4c1)/8ω and for c1 < −S(2ω)/4 + 2ω(1 − r)/π, by Eq. (39)."""
    case = load_case(CASES / f"{name}.toml")
    oscillator = case.system
    strength = perturbation.reduced(case.noise).spectral_density(2 * oscillator.omega)
    end = {
        "fig5": 1 - math.pi * (strength + 4 * oscillator.c1) / (8 * oscillator.omega),
        "fig6": -strength / 4 + 2 * oscillator.omega * (1 - oscillator.restitution) / math.pi,
    }[name]
    for shift, sign in ((-0.01, -1), (0.01, 1)):
        assert sign * ExponentSolver(case.parameter_set({key: end + shift}).problem).lyapunov_exponent().value > 0
