"""The stationary response against identities, a Markov chain, and another code's values."""

import math

import numpy as np
import pytest

from fpsolve.errors import FpsolveError
from fpsolve.model import NonGaussianNoise, OrnsteinUhlenbeck, VibroImpactOscillator
from fpsolve.nonlinear import stationary_response
from tests.oracles.upwind_chain import Chain

SMOOTH = {"omega": 1.0, "epsilon": 0.5, "restitution": 1.0, "c1": 0.4, "c2": 0.5, "c3": 0.2}
BOUNCING = {"omega": 1.0, "epsilon": 1.0, "restitution": 0.9, "c1": 0.3, "c2": 0.1, "c3": 0.1, "impact": "delta"}


def noise_of(D0, tau0):
    return OrnsteinUhlenbeck(alpha=1 / tau0, sigma=math.sqrt(2 * D0) / tau0)


def response(system, D0, tau0, rtol):
    return stationary_response(VibroImpactOscillator(**system), noise_of(D0, tau0), rtol=rtol)


def agrees(mean, value, doubt=0.0):
    return abs(mean.value - value) <= mean.error_estimate + doubt


@pytest.fixture(scope="module")
def rough():
    return response(BOUNCING, 0.05, 0.5, 1e-2)


def test_density_of_amplitude_has_the_means(rough):
    a = np.exp(np.linspace(rough.interval[0] - 8, rough.interval[1] + 1, 1000))
    rho = rough.amplitude_density(a)
    for n, name in ((1, "amplitude"), (2, "amplitude_squared"), (4, "amplitude_fourth")):
        assert np.trapezoid(rho * a ** (n + 1), np.log(a)) == pytest.approx(rough.means[name].value, rel=1e-4)
    assert np.trapezoid(rho * a, np.log(a)) == pytest.approx(1, abs=1e-4)


def test_x_drifts_nowhere(rough):
    """E ẋ = 0 and E xẋ = 0, as x and x² are continuous at impacts: the discrete equations do not imply it."""
    size = math.sqrt(rough.means["v_squared"].value)
    assert abs(rough.moment(0, 1)) <= 1e-2 * size
    assert abs(rough.moment(1, 1)) <= 1e-2 * size**2


@pytest.mark.slow
def test_a_chain_approaches_it_with_the_first_order():
    """The chain's law is positive, and its differences are halved with its steps."""
    means = response(SMOOTH, 0.1, 0.5, 1e-3).means
    chain = Chain(1.0, 0.5, 0.4, 0.5, 0.2, 0.0, 2.0, math.sqrt(0.2) / 0.5)
    coarse, fine = (chain.means((-2.5, 1.6), (20 * n, 16 * n, 10 * n)) for n in (1, 2))
    assert min(coarse["minimum"], fine["minimum"]) >= 0
    for name in ("amplitude_squared", "x_squared", "v_squared"):
        first, second = (each[name] - means[name].value for each in (coarse, fine))
        assert 0.8 < math.log2(first / second) < 1.3


def test_what_has_no_response_is_refused():
    with pytest.raises(FpsolveError, match="nothing limits"):
        response({**SMOOTH, "c2": 0.0, "c3": 0.0}, 0.1, 0.5, 1e-2)
    with pytest.raises(FpsolveError, match="comes to rest"):
        response({**SMOOTH, "c1": -0.4}, 0.01, 0.5, 1e-2)
    with pytest.raises(FpsolveError, match="algebraic tails"):
        stationary_response(VibroImpactOscillator(**SMOOTH), NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.1), rtol=1e-2)


@pytest.mark.slow
def test_values_of_two_other_codes():
    means = response(SMOOTH, 0.1, 0.5, 1e-4).means
    assert agrees(means["amplitude_squared"], 1.54568, 1e-5)
    assert agrees(means["x_squared"], 0.776597, 4e-6)
    assert agrees(means["v_squared"], 0.769092, 4e-6)


@pytest.mark.slow
def test_values_of_two_other_codes_with_impacts():
    means = response(BOUNCING, 0.05, 0.5, 1e-4).means
    assert agrees(means["amplitude"], 1.539962, 1e-6)
    assert agrees(means["amplitude_squared"], 2.510536, 1e-6)


@pytest.mark.slow
def test_phase_turns_by_half_a_circle_from_impact_to_impact():
    """E φ̇ = π times the impacts in unit time, which the discrete equations do not imply."""
    found = response(BOUNCING, 0.05, 0.5, 1e-3)
    solution = found.solution
    flow, phi = solution.plane.flow, solution.plane.circle.points
    turning = sum(solution.mean(0, each.h(phi), each.g) for each in flow.linear)
    turning += solution.mean(2, flow.cubic.h(phi), lambda xi: np.ones_like(xi))
    assert abs(turning / math.pi - found.impact_rate.value) <= found.impact_rate.error_estimate
