"""Paths under several noises at once: the flow of each is exact."""

import math

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.model import Bounded, Telegraph, White
from fpsolve.simulation.coefficients import coefficients
from fpsolve.simulation.kernels import advance
from fpsolve.simulation.setup import default_step, largest_step, starting_state, transient
from tests.exponent.test_several_noises import NAMES, RATES, beam

GAUSSIAN = OrnsteinUhlenbeck(alpha=1.0, sigma=0.6)


SLOW = pytest.mark.slow  # each kind is compiled anew


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise",
    [
        White(s=0.4),
        pytest.param(Telegraph(a=0.5, k=1.5), marks=SLOW),
    ],
)
def test_a_flow_alone_is_exact(noise):
    """ẋ = ξx and ẏ = ηy: ln x and ln y are the integrals of the noises, with their means and variances."""
    rates = "load*x", "sway*v"
    system = PlaneSystem.of_equations(("x", "v"), rates, noises=NAMES)
    noises = Problem(system, {"axial": GAUSSIAN, "lateral": noise}).noise
    known, n, h = coefficients(system, noises), 20_000, 0.5
    rng = np.random.default_rng(7)
    x, u, state = np.ones(n), np.ones(n), noises.start(n, rng)
    log_norm, push = np.zeros((2, n))
    advance(known.motion(h), known.noise_step(h), h, x, u, state, log_norm, push, 4, 1, rng)
    for values, law in ((np.log(x) + log_norm, GAUSSIAN), (np.log(u) + log_norm, noise)):
        if law.is_white:
            variance, mean = 2.0 * law.spectral_density(0.0), 2.0 * sum(law.marks) / max(len(law.marks), 1)
            mean *= getattr(law, "rate", 0.0)
        else:
            tau = law.correlation_time
            variance, mean = 2 * law.standard_deviation**2 * tau * (2.0 - tau * -math.expm1(-2.0 / tau)), 0.0
        assert np.mean(values) == pytest.approx(mean, abs=4 * math.sqrt(variance / n))
        assert np.var(values) == pytest.approx(variance, rel=0.06)


def test_beside_a_harmonic_load_a_transient_is_whole_periods():
    """The load forgets nothing, and what repeats itself for ever goes out of ln E‖x‖^p in whole periods alone."""
    system, load = beam(GAUSSIAN, White(s=0.3)).system, Bounded(mu=0.4, nu=1.7, sigma=0.0)
    noises, period = Problem(system, {"axial": load, "lateral": White(s=0.3)}).noise, 2 * math.pi / 1.7
    found, h = transient(system, noises), default_step(system, noises)
    assert found / period == pytest.approx(round(found / period), rel=1e-14)
    assert found >= 2 * math.pi  # two half-turns, and until the phase has come to be that of the load
    assert found / h == pytest.approx(round(found / h), abs=1e-9)
    assert h <= largest_step(system, noises)[0] < 0.1 * math.pi / 1.7


@pytest.mark.slow
def test_impacts_at_a_wall_are_counted():
    wall = [{"at": "x = 0", "restitution": 0.9}]
    system = PlaneSystem.of_equations(("x", "v"), RATES, {"omega": 1.0, "zeta": 0.0}, noises=NAMES, walls=wall)
    noises = Problem(system, {"axial": OrnsteinUhlenbeck(1.0, 1e-9), "lateral": White(s=1e-9)}).noise  # compiled above
    rng, h = np.random.default_rng(1), default_step(system, noises)
    known = coefficients(system, noises)
    x, u, state = starting_state(noises, 8, rng)
    log_norm, push = np.zeros((2, 8))
    steps = round(20 * math.pi / h)
    count = advance(known.motion(h), known.noise_step(h), h, x, u, state, log_norm, push, steps, 4, rng)
    assert count == 8 * 20
    np.testing.assert_allclose(log_norm, 20 * math.log(0.9), atol=1e-6)
