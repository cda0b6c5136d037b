"""Stationary responses of systems with terms of degree 3: identities, limits, and other ways to write them."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from fpsolve import (
    ExponentSolver,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    stationary_response,
)
from fpsolve.simulation import simulated_response
from tests.kit import equations, rates
from tests.numbers.rows.response import BOUNCING, NOISE, SMOOTH, oscillator, solved

OSCILLATOR = {"omega": 1.3, "epsilon": 0.5, "c1": 0.4, "c2": 0.5, "c3": 0.2}
RATES = "x' = v; v' = -omega**2*x + epsilon**2*v*(c1 - c2*x**2 - c3*v**2) + epsilon*xi*v"
WALL = {"at": "x = 0", "restitution": "exp(-epsilon**2*(1 - r))"}
DUFFING = {"omega": 1.4, "zeta": 0.02, "k": 0.3, "c": 0.2, "d": 0.1}
ROUGH = oscillator(0.05, 0.5, **BOUNCING)


def duffing(**changes):
    force = "x' = v; v' = -omega**2*x + 2*zeta*omega*v - k*x**3 - c*x**2*v - d*v**3 - xi*x"
    return rates(force, NOISE, **{**DUFFING, **changes})


def written(walls=(), turned=False):
    first, second = RATES.split("; ")
    text = f"{second}; {first}" if turned else RATES
    return rates(text, NOISE, walls, **OSCILLATOR, **({"r": 0.9} if walls else {}))


def bouncing(r):
    return Problem(VibroImpactOscillator(**OSCILLATOR, restitution=r), NOISE)


SAME = {
    "equations": (written([WALL]), bouncing(0.9)),
    "order of variables": (written([WALL], True), bouncing(0.9)),
    "without a wall": (written(), bouncing(1.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("way", SAME)
def test_response_is_the_same_in_each_way_to_write_a_system(way):
    """With (v, x) the wall is at the second variable and the phase falls; with R = 1 it only turns the side of x."""
    one, other = (solved(each, rtol=0.1) for each in SAME[way])
    names = {"x_squared", "v_squared"} if way == "order of variables" else one.means
    for name in names:
        assert one.means[name].value == pytest.approx(other.means[name].value, rel=1e-9)
    x, v = np.array([0.2, 0.7, 1.0]), np.array([-0.5, 0.0, 0.9])
    of_one = one.joint_density(*((v, x) if way == "order of variables" else (x, v)))
    np.testing.assert_allclose(of_one * (2 if way == "without a wall" else 1), other.joint_density(x, v), rtol=1e-9)
    if way != "without a wall":
        assert one.impact_rate.value == pytest.approx(other.impact_rate.value, rel=1e-9)
        assert one.joint_density(*((0.6, -0.5) if way == "order of variables" else (-0.5, 0.6))) == 0


@pytest.mark.slow
def test_response_without_a_wall_is_alike_on_both_sides():
    found = solved(duffing(), rtol=0.1)
    assert found.impact_rate is None
    assert (found.moment(1, 0).value, found.moment(2, 1).value) == (0, 0)
    x, v = (np.linspace(-most, most, 81) for most in (3.0, 3.0 * found.problem.linear.aspect))
    density, cell = found.joint_density(x[:, None], v), (x[1] - x[0]) * (v[1] - v[0])
    np.testing.assert_allclose(density, density[::-1, ::-1], rtol=1e-9, atol=1e-12)
    density[40, 40] = 0  # at rest, where it vanishes
    assert density.sum() * cell == pytest.approx(1, abs=2e-3)
    assert np.sum(density * x[:, None] ** 2) * cell == pytest.approx(found.means["x_squared"].value, rel=5e-3)
    for n in (1, 3):  # E x² and E x⁴ do not change
        drift = found.moment(n, 1)
        assert abs(drift.value) <= min(drift.error_estimate, 1e-3 * drift.scale)


@pytest.mark.slow
def test_response_scales_with_the_unit_of_the_amplitude():
    """With x = sy terms of degree 3 are multiplied by s², and means divided by powers of s."""
    s, found = 1e25, solved(duffing(), rtol=0.1)
    other = solved(duffing(**{name: 1e25**2 * DUFFING[name] for name in "kcd"}), rtol=0.1)
    for name, power in (("amplitude", 1), ("amplitude_squared", 2), ("amplitude_fourth", 4), ("x_squared", 2)):
        assert other.means[name].value * s**power == pytest.approx(found.means[name].value, rel=1e-10)
    a = np.array([0.5, 1.5])
    np.testing.assert_allclose(other.amplitude_density(a / s) / s, found.amplitude_density(a), rtol=1e-9)


@pytest.mark.slow
def test_response_approaches_that_of_white_noise():
    """v̇ = −ω²x − kx³ + Dv − dv³ + ξv has ρ ∝ exp(−dH/D) in white noise, H = v²/2 + ω²x²/2 + kx⁴/4."""
    D, d, omega, k = 0.3, 0.5, 1.3, 0.5
    law = lambda x: math.exp(-d / D * (omega**2 * x**2 / 2 + k * x**4 / 4))  # noqa: E731
    square = quad(lambda x: x**2 * law(x), 0, 10)[0] / quad(law, 0, 10)[0]
    system = equations("x' = v; v' = -omega**2*x - k*x**3 + D*v - d*v**3 + xi*v", omega=omega, k=k, D=D, d=d)
    far = []
    for tau in (0.02, 0.01):
        problem = Problem(system, OrnsteinUhlenbeck(1 / tau, math.sqrt(2 * D) / tau))
        means = stationary_response(problem, rtol=1e-3).means
        far.append([means["x_squared"].value - square, means["v_squared"].value - D / d])
    assert np.log2(np.divide(*far)) == pytest.approx([1, 2], abs=0.12)


@pytest.mark.slow
def test_weak_noise_makes_a_gamma_law():
    """a² ~ Gamma(λ/s², s²/κ), s² = Λ″(0), κ = ε²(c₂ + 3ω²c₃)/8, up to the order ε²."""
    far = []
    for epsilon in (0.2, 0.1):
        found = stationary_response(oscillator(0.3, 0.5, **{**SMOOTH, "epsilon": epsilon}), rtol=1e-3)
        kappa, rate = epsilon**2 * (0.5 + 3 * 0.2) / 8, lyapunov_exponent(found.problem).value
        spread = ExponentSolver(found.problem).variance_rate().value
        square, fourth = (found.means[name].value for name in ("amplitude_squared", "amplitude_fourth"))
        far.append((square * kappa / rate - 1, (fourth - square**2) * kappa**2 / (rate * spread) - 1))
    mean, variance = np.log2(np.divide(*far))
    assert mean > 1.5  # ε⁴ counts here too, with the other sign: from 0.1 to 0.05 it is closer to 2
    assert variance == pytest.approx(2, abs=0.2)


def test_response_with_impacts_has_a_density_with_its_means():
    found = solved(ROUGH, rtol=1e-2)
    a = np.exp(np.linspace(found.interval[0] - 8, found.interval[1] + 1, 1000))
    rho = found.amplitude_density(a)
    for n, value in ((0, 1.0), *zip((1, 2, 4), (each.value for each in found.means.values()), strict=False)):
        assert np.trapezoid(rho * a ** (n + 1), np.log(a)) == pytest.approx(value, rel=1e-4)
    for n in (1, 3):  # x drifts nowhere
        drift = found.moment(n, 1)
        assert abs(drift.value) <= drift.error_estimate <= 1e-2 * drift.scale
    assert found.moment(2, 0).value == found.means["x_squared"].value
    assert abs(found.balance.value) <= found.balance.error_estimate


@pytest.mark.slow
def test_response_feeds_in_what_is_lost_at_impacts_and_has_the_means_of_paths():
    """E q + ln R times the flux of ρ at the impacts is 0, which the discrete equations do not imply."""
    own = {**BOUNCING, "omega": 1.4, "restitution": 0.85, "c1": 0.5, "epsilon": 0.6, "c2": 0.3, "c3": 0.2}
    found = solved(oscillator(0.1, 0.4, **own), rtol=1e-3)
    assert abs(found.balance.value) <= found.balance.error_estimate < 1e-2
    rate, spread = lyapunov_exponent(found.problem).value, ExponentSolver(found.problem).variance_rate().value
    by_paths = simulated_response(found.problem, rate, spread, paths=1024, time=200.0, step=0.02, seed=1).means
    for name, mean in found.means.items():
        if name in by_paths:
            value, error = by_paths[name]
            assert abs(mean.value - value) <= 4 * error + mean.error_estimate, name


@pytest.mark.slow
@pytest.mark.parametrize(("c1", "hump", "crater"), [(0.02, False, False), (0.12, True, False), (0.4, True, True)])
def test_response_near_rest_has_the_exponent_of_the_stability_index(c1, hump, crater):
    """ρ(a) ~ a^(−δ_p − 1), and the labels say which density vanishes there."""
    found = stationary_response(oscillator(0.3, 0.5, **{**SMOOTH, "c1": c1, "epsilon": 0.3}), rtol=1e-2)
    assert (found.has_hump, found.has_crater) == (hump, crater)
    a = math.exp(found.interval[0]) * np.array([1e-3, 1e-4])
    slope = np.diff(np.log(found.amplitude_density(a)))[0] / math.log(0.1)
    assert slope == pytest.approx(-found.stability_index - 1, abs=1e-4)
