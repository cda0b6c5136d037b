"""The rate function against its Legendre transform and published bounds, the law of growth against what is Gaussian."""

import math

import numpy as np
import pytest
import scipy.linalg
from scipy.stats import norm

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
    open_results,
    run,
)
from fpsolve.analysis import growth_law, rate_function
from fpsolve.analysis.growth import log_moment, prefactor
from fpsolve.arrays import identity
from fpsolve.errors import CaseError, NoSuchExponent, NotConverged
from fpsolve.messages import Code, Message
from fpsolve.model import CoefficientMatrix, Filter, White
from tests import random_growth
from tests.conftest import FIG1, FIG1_NOISE, sampled
from tests.growth_paths import SHEAR
from tests.kit import case_in, read_json

TURN = ((0.0, 1.0), (-1.0, 0.0))
UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
STRONG = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0), UNIT)


def uniform(a=-0.1, noise=UNIT):
    """ẋ = (J + aI + ξI)x: ln ‖x(t)‖ = at + ∫ξ is normal."""
    return Problem(
        PlaneSystem([CoefficientMatrix(0, ((a, 1.0), (-1.0, a))), CoefficientMatrix(1, np.eye(2), identity)]), noise
    )


def test_published_enclosures_hold():
    """dx = [[−1, 0], [5, −1]]x dt + Jx ∘ dW: arXiv 2408.12556 encloses I(0) and Λ″(0)."""
    found, centre = rate_function(SHEAR, 0.0, rtol=1e-10), ExponentSolver(SHEAR, rtol=1e-10).variance_rate()
    assert 0.0947750 < found.value[0] < 0.0947753
    assert 0.657787 < centre.value < 0.657789
    assert abs(found.value[0] - 0.0947751140996) <= found.error_estimate[0] + 5e-14
    assert abs(centre.value - 0.6577880800662) <= centre.error_estimate + 5e-14
    minimum = min(moment_lyapunov(SHEAR, found.p[0] + np.linspace(-1e-3, 1e-3, 5), rtol=1e-10).value)
    assert found.value[0] == pytest.approx(-minimum, abs=1e-11)


@pytest.mark.parametrize("problem", sampled(SHEAR, Problem(FIG1, FIG1_NOISE), STRONG, keep=2))
def test_the_legendre_transform_of_the_rate_function_is_the_exponent(problem):
    """sup_s (ps − I(s)) by a polynomial in s around the maximum; I ≥ 0, and 0 at λ alone."""
    for p in (-0.7, 1.6):
        exact, scale = moment_lyapunov(problem, p), ExponentSolver(problem).scale(p)
        ends = moment_lyapunov(problem, [p - 0.1, p + 0.1]).derivative
        s = ends.mean() + 0.5 * np.ptp(ends) * np.cos(np.pi * (np.arange(9) + 0.5) / 9)
        found = rate_function(problem, s)
        assert np.all(found.value > 0)
        values = np.polynomial.Chebyshev.fit(s, p * s - found.value, 8)
        assert values(np.linspace(*ends, 100_001)).max() == pytest.approx(exact.value[0], abs=1e-8 * scale)
    rate = ExponentSolver(problem).lyapunov_exponent()
    centre = rate_function(problem, rate.value)
    assert centre.value[0] <= 1e-15
    assert abs(centre.p[0]) <= rate.error_estimate / centre.second_derivative[0] + 1e-6


def test_a_gaussian_rate_function_is_a_parabola():
    a, spectrum = -0.1, 1.0
    s = np.array([-3.0, -0.5, -0.1 - 1e-7, -0.1, 0.0, 2.0])
    found = rate_function(uniform(a), s)
    np.testing.assert_allclose(found.value, (s - a) ** 2 / (2 * spectrum), rtol=1e-7, atol=1e-15)
    np.testing.assert_allclose(found.p, (s - a) / spectrum, rtol=1e-7, atol=1e-9)
    assert found.to_xarray().rate_function.sel(growth_rate=2.0).item() == found.value[-1]
    low, high = found.range((-2.0, 3.0))
    assert (low, high) == pytest.approx((a - 2.0, a + 3.0), rel=1e-9)


def test_the_prefactor_of_a_gaussian_law_is_known():
    """∫ξ has the variance 2 var τ(t − τ(1 − e^{−t/τ})), so that C = exp(−p² var τ²), from any start."""
    solver = ExponentSolver(uniform())
    for p in (-2.0, 0.0, 1.0, 3.0):
        for start in (0.0, 1.0, 4.0):
            assert prefactor(solver.pair(p), start) == pytest.approx(math.exp(-0.5 * p**2), rel=1e-8)


@pytest.mark.parametrize("start", [0.0, 0.7, 3.0])
@pytest.mark.parametrize(
    ("free", "driven"),
    [(((-1.0, 0.0), (5.0, -1.0)), ((0.0, -1.0), (1.0, 0.0))), (((0.1, 3.0), (-1.0, -0.2)), ((0.0, 0.0), (-0.5, 0.0)))],
    ids=["as it stands", "in other coordinates"],
)
def test_the_prefactor_of_the_mean_square_follows_from_the_second_moments(free, driven, start):
    """S = E xxᵀ obeys dS/dt = KS + SKᵀ + BSBᵀ, K = A + ½B²: its largest eigenvalue is Λ(2)."""
    a, b = np.array(free), np.array(driven)
    problem = Problem(PlaneSystem([CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)]), White(s=1.0))
    assert (problem.frame is None) == (free[0][0] == -1.0)
    k, one = a + 0.5 * b @ b, np.eye(2)
    values, left, right = scipy.linalg.eig(np.kron(k, one) + np.kron(one, k) + np.kron(b, b), left=True)
    at = int(np.argmax(values.real))
    x = np.array([np.cos(start), -np.sin(start)])
    first, last = left[:, at].real @ np.kron(x, x), np.eye(2).ravel() @ right[:, at].real
    pair = ExponentSolver(problem).pair(2.0)
    assert pair.value == pytest.approx(values[at].real, rel=1e-8)
    assert prefactor(pair, start) == pytest.approx(first * last / (left[:, at].real @ right[:, at].real), rel=1e-7)


@pytest.mark.parametrize(("first", "start"), [(2.0, 0.0), *sampled((0.5, 1.0), keep=0)])
def test_the_law_of_a_gaussian_case_is_met_within_the_error(first, start):
    """Its saddle point is exact at any t: the variance of ∫ξ has the memory of the start."""
    a, times, s = -0.1, np.array([first, 40.0]), np.array([-0.7, -0.1, -0.05, 0.0, 0.2, 0.5])
    found = growth_law(uniform(a), times, s, start=start)
    spread = np.sqrt(times - (1 - np.exp(-times)))[:, None]
    z = (s - a) * times[:, None] / spread
    exact, below, density = norm.sf(z), norm.cdf(z), times[:, None] * norm.pdf(z) / spread
    assert np.all(np.abs(found.above - exact) <= found.probability_error + 1e-15)
    assert np.all(np.abs(found.below - below) <= found.probability_error + 1e-15)
    assert np.all(np.abs(found.density - density) <= found.density_error)
    assert np.all(found.probability_error < 1e-6)
    np.testing.assert_allclose(found.width, 1 / np.sqrt(times), rtol=1e-9)


@pytest.mark.parametrize(("kicked", "time"), [((-1.0, 0.0), 0.4), ((0.0, -1.0), 3.7), ((0.0, -1.0), 30.0)])
def test_moments_of_a_start_at_any_time(kicked, time):
    """E‖x(t)‖² by its moment equations: ẍ + 0.2ẋ + 2.6x = 0 with white noise in the stiffness or the damping."""
    free, driven, start = ((0.0, 1.0), (-2.6, -0.2)), ((0.0, 0.0), kicked), 0.7
    a, b, one = np.array(free), np.array(driven), np.eye(2)
    k, x = a + 0.5 * b @ b, np.array([np.cos(start), -np.sin(start)])
    system = PlaneSystem([CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)])
    moments = scipy.linalg.expm(time * (np.kron(k, one) + np.kron(one, k) + np.kron(b, b))) @ np.kron(x, x)
    pair = ExponentSolver(Problem(system, White(s=1.0))).pair(2.0)
    for each in log_moment(pair, start, time):
        assert each == pytest.approx(math.log(one.ravel() @ moments), abs=1e-8)


def test_the_law_within_one_turn_remembers_the_start():
    """ẍ + 0.195ẋ + 2.63x + ξẋ = 0: the share of 1e9 paths by an independent code is 0.5546438."""
    driven = CoefficientMatrix(1, ((0.0, 0.0), (0.0, -1.0)), identity)
    free = CoefficientMatrix(0, ((0.0, 1.0), (-2.6277309363797814, -0.19457420367493036)))
    problem = Problem(PlaneSystem([free, driven]), White(s=1.0992281821842693))
    found = growth_law(problem, 3.701355534551965, 0.0530514812946335)
    assert abs(found.above[0, 0] - 0.5546438) <= found.probability_error[0, 0] < 3e-3


@pytest.mark.parametrize("seed", sampled(0))
def test_random_oscillators_at_one_to_four_turns(seed):
    """All are in `python -m tests.random_growth`."""
    _, found, error, share, deviation = random_growth.compared(seed, 20_000)
    assert np.all(np.abs(found - share) <= 1.5 * error + 3.5 * deviation)


@pytest.mark.slow
def test_chance_to_be_above_the_start_under_impacts():
    """Weak noise remembers the phase of its start for long, which the error tells."""
    found = growth_law(Problem(FIG1, FIG1_NOISE), [10.0, 1e4], [0.0, 0.002])
    assert np.all(found.probability_error[1] < 0.02)
    assert np.all((found.above > 0) & (found.above < 1))
    np.testing.assert_allclose(found.above + found.below, 1, atol=1e-12)


def test_what_is_out_of_reach_is_refused_and_the_rest_is_kept():
    with pytest.raises(NotConverged, match="choose s on this side of") as caught:
        rate_function(SHEAR, [0.0, 9.0], interval=(-2.0, 4.0))
    assert [each.code for each in caught.value.message.data["reasons"]] == [Code.GROWTH_BEYOND]
    assert caught.value.partial.growth.tolist() == [0.0]


@pytest.mark.parametrize("reach", [1.0, 2.5])
def test_growth_that_is_reached_where_moments_are_not_solved_is_refused_soon(monkeypatch, reach):
    """Λ′(p) = a + p here, so that s = 3.3 is reached at p = 3.4."""
    ratio, asked = ExponentSolver.ratio, []

    def within_reach(self, p, tolerance=None):
        asked.append(p)
        if abs(p) > reach:
            raise NotConverged(Message(Code.NOT_CONVERGED, p=p, reason="far out"))
        return ratio(self, p, tolerance)

    monkeypatch.setattr(ExponentSolver, "ratio", within_reach)
    with pytest.raises(NotConverged, match=r"beyond it Λ\(p\) is not solved: Λ\(3.4\) did not converge") as caught:
        rate_function(uniform(), [0.5, 3.3])
    assert [each.code for each in caught.value.message.data["reasons"]] == [Code.GROWTH_BEYOND]
    np.testing.assert_allclose(caught.value.partial.p, [0.6], rtol=1e-8)
    assert len(asked) <= 9


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (Problem(FIG1, NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.1)), "the law of growth is not computed: for r0 > 1"),
        (
            Problem(
                PlaneSystem([CoefficientMatrix(0, ((-1, 1), (0, -2))), CoefficientMatrix(1, np.eye(2), identity)]), UNIT
            ),
            "may have a kink",
        ),
    ],
)
def test_exponents_with_kinks_are_refused(problem, message):
    with pytest.raises(NoSuchExponent, match=message):
        rate_function(problem, 0.0)


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="got t = "):
        growth_law(SHEAR, [1.0, 0.0], 0.0)
    with pytest.raises(ValueError, match="one below 0 and one above"):
        rate_function(SHEAR, 0.0, interval=(1.0, 2.0))
    filtered = Problem(FIG1, Filter(omega=2.0, zeta=0.3, s=1.0, c0=1.0, c1=0.0))
    with pytest.raises(NoSuchExponent, match="not for filtered noise"):
        growth_law(filtered, 1.0, 0.0)


def test_results_are_labelled_and_drawn():
    found = growth_law(SHEAR, [2.0, 4.0], [0.0, 0.5, 1.0])
    table = found.to_xarray()
    assert table.probability.sel(time=4.0, growth_rate=0.5).item() == found.above[1, 1]
    assert {f"{name}_error" for name in ("probability", "density", "prefactor")} <= set(table.data_vars)
    assert len(found.plot().lines) == 2
    assert found.rate.plot() is not None


CASE = """
title = "T"
[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1
[noise]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 1.0
[moments]
p = [-1.0, 0.0, 2.0]
[output]
quantities = ["moment", "rate_function"]
"""


def test_a_case_writes_the_rate_function(tmp_path):
    path = tmp_path / "rates.toml"
    path.write_text(CASE, encoding="utf-8")
    [result] = run(path, tmp_path)
    folder, done = tmp_path / "rates", result.moments
    exact = rate_function(result.curve.problem, done.derivative)
    np.testing.assert_allclose(done.rate_function, exact.value, atol=1e-12)
    rows = read_json(folder / "summary.json")["curves"][0]["moments"]
    assert [row["rate_function"] for row in rows] == done.rate_function.tolist()
    head, first, *_ = (folder / "moments.csv").read_text(encoding="utf-8").splitlines()
    assert dict(zip(head.split(","), first.split(","), strict=True))["rate_function"] == str(done.rate_function[0])
    assert open_results(folder).rate_function.sel(p=2.0).item() == done.rate_function[2]
    assert {path.name for path in folder.glob("rate_function.*")} == {"rate_function.png", "rate_function.pdf"}


def test_a_case_needs_the_moments_for_it(tmp_path):
    with pytest.raises(CaseError, match=r'output.quantities\[0\]: got "rate_function", which follows'):
        case_in(tmp_path, CASE.replace('"moment", ', ""), name="rates")
