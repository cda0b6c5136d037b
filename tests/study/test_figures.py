"""The cases of the paper's figures: their own expectations, and every trend that the paper's text states."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.study.solve import Numerics, everything, solve_curve
from fpsolve.workflow import compare
from tests.conftest import sampled
from tests.oracles import perturbation

CASES = Path(__file__).parents[2] / "cases"
LONG = ("fig5", "fig6", "response", "response_impacts")
NAMES = sorted((path.stem for path in CASES.glob("*.toml")), key=lambda name: name in LONG)
SAMPLE = sampled(*NAMES, keep=len(NAMES) - len(LONG))


def without_pictures(asked):
    return {name: each for name, each in asked.items() if name not in ("sensitivities", "eigenfunctions", "directions")}


@cache
def solved(name):
    """The first curve on the mesh of the case, if it states one, the others on a far smaller one."""
    path = CASES / f"{name}.toml"
    case, other = load_case(path), load_case(path, ["mesh={}"])
    wanted = without_pictures(everything(case))
    first, *more = case.curves()
    asked = (first, Numerics.of(case)), *((curve, Numerics.of(other)) for curve in more)
    return case, [solve_curve(curve, wanted, numerics).result for curve, numerics in asked]


def index(result):
    return result.stability_index.value


def curves(name):
    """Moments, shape (curves, p), in the order of the varied values, which must increase."""
    case, results = solved(name)
    (values,) = case.vary.columns.values()
    assert list(values) == sorted(values)
    return case.p, np.array([result.moments.value for result in results]), results


def test_there_is_a_case_for_every_figure():
    figures = {"fig1", "fig2a", "fig2b", "fig2c", "fig3", "fig4", "fig5", "fig6"}
    assert set(NAMES) == figures | {
        "minimal",
        "strong",
        "heavy_tails",
        "response",
        "response_impacts",
        "chart",
        "theorem",
    }


@pytest.mark.parametrize("name", SAMPLE)
def test_every_case_meets_its_expectations(name):
    case, results = solved(name)
    comparisons = compare(case, results)
    assert comparisons
    assert [item for item in comparisons if not item.met] == []


@pytest.mark.parametrize("name", SAMPLE)
def test_every_case_converges_to_its_rtol(name):
    for result in solved(name)[1]:
        assert not result.warnings
        assert not result.failures


def test_fig1_differs_little_from_perturbation_theory():
    """«the differences between analytical and numerical results are very small»"""
    _, values, results = curves("fig1")
    theory = np.array([result.moments.perturbation for result in results])
    assert np.max(np.abs(values - theory)) < 2e-3 * np.max(np.abs(theory))
    assert np.max(np.abs(values - theory)) > 1e-5  # and yet they are there


# how δ_p, λ and Λ(p), p > 0, go with the value that is varied, where the paper says so: up or down
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


@pytest.mark.parametrize("name", sampled(*TRENDS, keep=4))
def test_trends_of_the_paper(name):
    p, values, results = curves(name)
    exponents = [result.lyapunov_exponent.value for result in results]
    for sign, numbers in zip(TRENDS[name], ([*map(index, results)], exponents, values[:, p > 0]), strict=True):
        assert sign == 0 or np.all(sign * np.diff(numbers, axis=0) > 0)
    if name in ("fig2a", "fig2b"):
        widths = np.count_nonzero(values[:, p > 0] < 0, axis=1)
        assert np.all(np.diff(widths) <= 0)
        assert widths[-1] < widths[0]


def test_fig2b_departure_matters_little_near_1():
    """«the effect of departure coefficient r0 on the stochastic stability is very small as r0 → 1»"""
    case, _ = solved("fig2b")
    at = {}
    for r0 in (0.98, 0.99, 1.0):
        curve = case.curve({"noise.r0": r0})
        at[r0] = ExponentSolver(curve.problem).pair(2.0).value
    assert abs(at[0.99] - at[1.0]) < 0.02 * abs(at[1.0])
    assert abs(at[0.99] - at[1.0]) < 0.55 * abs(at[0.98] - at[1.0])


def test_fig2c_short_correlation_times_nearly_coincide():
    """«for the case τ0 = 0.0001, 0.001 and 0.01, the … Λ(p) are almost identical»"""
    _, values, results = curves("fig2c")
    short = [k for k, result in enumerate(results) if result.curve.varied["noise.tau0"] <= 0.01]
    assert [results[k].curve.varied["noise.tau0"] for k in short] == [1e-4, 1e-3, 1e-2]
    height = np.ptp(values)
    assert np.max(np.ptp(values[short], axis=0)) < 0.01 * height
    others = [k for k in range(len(results)) if k not in short]
    assert np.max(np.abs(values[others] - values[0])) > 0.1 * height


def fig3():
    """λ by (ω, D0)."""
    case, results = solved("fig3")
    keys = "oscillator.omega", "noise.D0"
    assert set(case.vary.keys) == set(keys)
    found = {tuple(result.curve.varied[key] for key in keys): result.lyapunov_exponent.value for result in results}
    omegas, intensities = map(case.vary.values, keys)
    return np.array([[found[omega, intensity] for intensity in intensities] for omega in omegas])


def test_fig3_frequency_lowers_and_noise_raises_the_largest_exponent():
    """«λ decreases significantly with the increase of ω»; λ increases with S(2ω), so with D0"""
    values = fig3()
    assert np.all(np.diff(values, axis=0) < 0)
    assert np.all(np.diff(values, axis=1) > 0)


def test_fig3_noise_intensity_matters_most_at_small_frequency():
    """«the noise intensity D0 significantly effects the stochastic stability …, especially in the situation of small
    value of natural frequency»"""
    spread = np.ptp(fig3(), axis=1)
    assert np.all(np.diff(spread) < 0)
    assert spread[0] > 10 * spread[-1]


def threshold(case, key):
    """Where the paper says that λ changes sign: in r, in c1, and in S(2ω), by Eq. (39)."""
    curve = case.curve({})
    oscillator = curve.oscillator
    s2 = perturbation.reduced(curve.noise).spectral_density(2 * oscillator.omega)
    if key == "oscillator.restitution":
        return 1 - math.pi * (s2 + 4 * oscillator.c1) / (8 * oscillator.omega)
    return -s2 / 4 + 2 * oscillator.omega * (1 - oscillator.restitution) / math.pi


@pytest.mark.slow
@pytest.mark.parametrize(("name", "key"), [("fig5", "oscillator.restitution"), ("fig6", "oscillator.c1")])
def test_almost_sure_stability_ends_where_the_paper_says(name, key):
    """Stable for r < 1 − π(S(2ω) + 4c1)/8ω and for c1 < −S(2ω)/4 + 2ω(1 − r)/π."""
    case, _ = solved(name)
    signs = []
    for shift in (-0.01, 0.01):
        curve = case.curve({key: threshold(case, key) + shift})
        signs.append(np.sign(ExponentSolver(curve.problem).lyapunov_exponent().value))
    assert signs == [-1, 1]


@pytest.mark.parametrize("name", sampled(*TRENDS, keep=4))
def test_a_positive_stability_index_bounds_the_stable_moments(name):
    """«δp > 0 indicates that the system is pth moment-stable as 0 < p < δp»"""
    p, values, results = curves(name)
    for row, result in zip(values, results, strict=True):
        delta = index(result)
        if delta > 0:
            assert np.all(row[(p > 1e-9) & (p < delta - 1e-9)] < 0)
            assert np.all(row[p > delta + 1e-9] > 0)
