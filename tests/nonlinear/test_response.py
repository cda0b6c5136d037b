"""The stationary response against identities, and another code's values."""

import math

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    stability_index,
)
from fpsolve.errors import FpsolveError
from fpsolve.fem.factors import one_thread
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.nonlinear import stationary_response
from fpsolve.nonlinear.elimination import Tail, solved
from fpsolve.nonlinear.operator import Elements, Flow, Plane
from tests.random_responses import distances, drawn

SMOOTH = {"omega": 1.0, "epsilon": 0.5, "restitution": 1.0, "c1": 0.4, "c2": 0.5, "c3": 0.2}
BOUNCING = {"omega": 1.0, "epsilon": 1.0, "restitution": 0.9, "c1": 0.3, "c2": 0.1, "c3": 0.1, "impact": "delta"}


def noise_of(D0, tau0):
    return OrnsteinUhlenbeck(alpha=1 / tau0, sigma=math.sqrt(2 * D0) / tau0)


def response(system, D0, tau0, rtol):
    return stationary_response(Problem(VibroImpactOscillator(**system), noise_of(D0, tau0)), rtol=rtol)


def agrees(mean, value, doubt=0.0):
    return abs(mean.value - value) <= mean.error_estimate + doubt


@pytest.fixture(scope="module")
def smooth():
    return response(SMOOTH, 0.1, 0.5, 1e-4)


@pytest.fixture(scope="module")
def rough():
    return response(BOUNCING, 0.05, 0.5, 1e-2)


@pytest.mark.slow
def test_density_of_amplitude_has_the_means(rough):
    a = np.exp(np.linspace(rough.interval[0] - 8, rough.interval[1] + 1, 1000))
    rho = rough.amplitude_density(a)
    for n, name in ((1, "amplitude"), (2, "amplitude_squared"), (4, "amplitude_fourth")):
        assert np.trapezoid(rho * a ** (n + 1), np.log(a)) == pytest.approx(rough.means[name].value, rel=1e-4)
    assert np.trapezoid(rho * a, np.log(a)) == pytest.approx(1, abs=1e-4)


def test_x_drifts_nowhere(rough):
    """E ẋ = 0 and E xẋ = 0, as x and x² are continuous at impacts: the discrete equations do not imply it."""
    for n in (0, 1):
        assert agrees(rough.moment(n, 1), 0)
        assert rough.moment(n, 1).error_estimate <= 1e-2 * rough.moment(n, 1).scale


@pytest.mark.slow
def test_moments_have_errors_and_values_of_two_other_codes_with_impacts(rough):
    assert rough.moment(2, 0).value == rough.means["x_squared"].value
    finer = response(BOUNCING, 0.05, 0.5, 1e-4)
    for n, m in ((1, 0), (3, 1), (0, 6)):
        assert agrees(rough.moment(n, m), finer.moment(n, m).value, finer.moment(n, m).error_estimate)
    assert agrees(finer.means["amplitude"], 1.539962, 1e-6)
    assert agrees(finer.means["amplitude_squared"], 2.510536, 1e-6)


@pytest.mark.slow
def test_without_an_imposed_tail_the_density_falls_as_that_of_the_linear_system():
    """On a deep interval, with any inflow from below, ln ρ = −δ_p u + b e^{2u} + … far from its lower end."""
    system = VibroImpactOscillator(omega=1.0, epsilon=0.5, restitution=0.97, c1=0.1, c2=0.5, c3=0.2)
    problem = Problem(system, noise_of(0.3, 0.5))
    plane = Plane(
        Flow(problem), Elements(Flow(problem).phases(3), 12, is_closed=True), PolynomialAxis(problem.coloured, 12)
    )
    any_inflow = Tail(1.0, plane.constant[None])
    with one_thread():
        found = solved(plane, Elements(np.linspace(-10, 1.8, 40), 7), any_inflow)
    u = np.linspace(-5.5, -3, 101)
    logs = np.log(found.at(u) @ plane.unit @ plane.constant)
    shapes = np.stack([np.ones_like(u), u, np.exp(2 * u), np.exp(4 * u)], axis=1)
    sizes = np.linalg.norm(shapes, axis=0)
    slope = (np.linalg.lstsq(shapes / sizes, logs, rcond=None)[0] / sizes)[1]
    assert slope == pytest.approx(-stability_index(problem).value, abs=1e-6)


def test_what_has_no_response_is_refused():
    with pytest.raises(FpsolveError, match="nothing limits"):
        response({**SMOOTH, "c2": 0.0, "c3": 0.0}, 0.1, 0.5, 1e-2)
    with pytest.raises(FpsolveError, match="comes to rest"):
        response({**SMOOTH, "c1": -0.4}, 0.01, 0.5, 1e-2)
    with pytest.raises(FpsolveError, match="algebraic tails"):
        stationary_response(
            Problem(VibroImpactOscillator(**SMOOTH), NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.1)), rtol=1e-2
        )


@pytest.mark.slow
def test_values_of_two_other_codes(smooth):
    means = smooth.means
    assert agrees(means["amplitude_squared"], 1.54568, 1e-5)
    assert agrees(means["x_squared"], 0.776597, 4e-6)
    assert agrees(means["v_squared"], 0.769092, 4e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_what_the_noise_feeds_in_is_lost_at_impacts(seed):
    """E q + ln R times the flux of ρ at the impacts is 0, which the discrete equations do not imply."""
    rng = np.random.default_rng(seed)
    system = {**BOUNCING, "omega": rng.uniform(0.7, 2), "restitution": rng.uniform(0.8, 1), "c1": rng.uniform(0.3, 0.6)}
    system |= {"epsilon": rng.uniform(0.4, 0.8), "c2": rng.uniform(0.05, 0.5), "c3": rng.uniform(0.05, 0.5)}
    found = response(system, rng.uniform(0.05, 0.15), rng.uniform(0.3, 0.6), 1e-3)
    assert abs(found.balance.value) <= found.balance.error_estimate


@pytest.mark.slow
@pytest.mark.parametrize("seed", [6])
def test_the_simulation_has_the_same_means(seed):
    """Two of the twenty that `python -m tests.random_responses` compares."""
    far = distances(drawn(seed), seed, rtol=1e-3, paths=1024)
    assert max(map(abs, far.values())) < 4


@pytest.mark.slow
def test_weak_noise_makes_a_gamma_law():
    """a² ~ Gamma(λ/s², s²/κ), s² = Λ″(0), κ = ε²(c₂ + 3ω²c₃)/8, up to the order ε²: E a² = λ/κ, Var a² = λs²/κ²."""
    far = []
    for epsilon in (0.2, 0.1):
        found = response({**SMOOTH, "epsilon": epsilon}, 0.3, 0.5, 1e-3)
        problem, kappa = found.problem, epsilon**2 * (0.5 + 3 * 0.2) / 8
        rate, spread = lyapunov_exponent(problem).value, ExponentSolver(problem).variance_rate().value
        square, fourth = (found.means[name].value for name in ("amplitude_squared", "amplitude_fourth"))
        far.append((square * kappa / rate - 1, (fourth - square**2) * kappa**2 / (rate * spread) - 1))
    mean, variance = np.log2(np.divide(*far))
    assert mean > 1.5  # ε⁴ counts here too, with the other sign: from 0.1 to 0.05 it is closer to 2
    assert variance == pytest.approx(2, abs=0.2)


@pytest.mark.slow
def test_hump_and_crater():
    """Near rest ρ(a) ~ a^(−δ_p − 1), and the labels say which density vanishes there."""
    for c1, hump, crater in ((0.02, False, False), (0.12, True, False), (0.4, True, True)):
        found = response({**SMOOTH, "c1": c1, "epsilon": 0.3}, 0.3, 0.5, 1e-2)
        assert (found.has_hump, found.has_crater) == (hump, crater)
        a = math.exp(found.interval[0]) * np.array([1e-3, 1e-4])
        slope = np.diff(np.log(found.amplitude_density(a)))[0] / math.log(0.1)
        assert slope == pytest.approx(-found.stability_index - 1, abs=1e-4)
