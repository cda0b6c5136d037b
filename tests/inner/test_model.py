"""Steps and coordinates that numbers see too little of: transitions of noises, affine coefficients, phases, chains."""

import math
from typing import Annotated

import numpy as np
import pytest
from pydantic.dataclasses import dataclass
from scipy.linalg import expm

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, sensitivities
from fpsolve.model import Bounded, CoefficientMatrix, Filter, SineWiener
from fpsolve.model.noise import NoiseDerivative
from fpsolve.model.noises.markov_chain import Chain
from fpsolve.model.parameters import parameter
from fpsolve.model.plane import affine, coefficient
from fpsolve.simulation.motions import draw
from tests.kit import itself, rates
from tests.numbers.second import LOAD, slope_of, spring
from tests.numbers.test_noises import generator
from tests.oracles import moment_hierarchy

MIXED = Filter(omega=1.3, zeta=0.4, s=0.5, c0=0.7, c1=-0.8)


@pytest.mark.parametrize(
    "noise",
    [OrnsteinUhlenbeck(1.2, 0.8), SineWiener(0.8, 1.1), Bounded(0.8, 2.5, 1.1), MIXED],
    ids=lambda each: each.kind,
)
def test_step_of_a_noise_has_the_correlations_of_its_generator(noise, rng):
    n, h = 100_000, 0.5 * min(noise.largest_step, 1.0)
    state, (mean, end, push) = noise.start(n, rng), np.zeros((3, n))
    before = (state[0] if state.ndim > 1 else state).copy()
    draw(noise.step(h), state, mean, end, push, rng)
    if noise.basis == "polynomials":
        drop = noise.alpha if hasattr(noise, "alpha") else 0.5 * noise.sigma**2
        f, own, g = noise.standard_deviation**2 * np.ones(1), -drop * np.eye(1), np.ones(1)
    else:
        f, own, g = generator(noise)

    def correlation(t):
        return (f @ expm(own * t) @ g).real

    t = (np.arange(8) + 0.5) / 8 * h
    across = np.mean([correlation(each) for each in t])
    inside = 2 / h * np.mean([(1 - each / h) * correlation(each) for each in t]) * h
    for found, expected in (
        (end * end, correlation(0)),
        (before * end, correlation(h)),
        (before * mean, across),
        (mean * end, across),
        (mean * mean, inside),
    ):
        assert found.mean() == pytest.approx(expected, abs=4 * found.std() / math.sqrt(n) + 2e-3 * correlation(0) * h)


@dataclass(frozen=True)
class Ring(Chain):
    """Three states, one of which moves and is left faster with θ; without detailed balance, so that π changes too."""

    theta: Annotated[float, parameter("θ", "theta = 0.3")]

    @property
    def states(self):
        return -0.5, self.theta, 0.7

    @property
    def rates(self):
        half, more = 0.5 * self.theta, 1 + self.theta
        return (-2.0, 2.0, 0.0), (half, -half - more, more), (0.5, 0.0, -0.5)

    def derivative(self, name):
        return NoiseDerivative(states=(0.0, 1.0, 0.0), rates=((0.0,) * 3, (0.5, -1.5, 1.0), (0.0,) * 3))


def test_sensitivity_to_states_and_rates_of_any_chain():
    def at(theta):
        ring = Ring(theta)
        return moment_hierarchy.moment_lyapunov([spring(1.0, 0.1) + xi * LOAD for xi in ring.states], ring.rates, 2)

    [found] = sensitivities(rates("x' = v; v' = -x - 0.2*v - xi*x", Ring(0.3)), 2.0).moments
    assert found["noise.theta"].value == pytest.approx(slope_of(at, "theta", theta=0.3), rel=1e-6)


def test_coefficients_that_are_affine_are_seen():
    for g, line in ((lambda xi: 1.5 - 0.5 * xi, (1.5, -0.5)), (itself, (0.0, 1.0)), (lambda xi: 2.0, (2.0, 0.0))):
        assert affine(coefficient(g)) == pytest.approx(line, rel=1e-14, abs=1e-15)
    for g in (np.tanh, np.abs, lambda xi: np.clip(xi, -1e4, 1e4), lambda xi: xi + 1e-9 * np.sin(xi)):
        assert affine(coefficient(g)) is None


def test_polar_form_and_frequency_of_a_system_are_those_of_its_motion(rng):
    """A small step of ẋ = A x moves φ by h dt and ln a by q dt."""
    driven = CoefficientMatrix(1, rng.normal(size=(2, 2)), itself)
    system = PlaneSystem([CoefficientMatrix(0, [[0.0, 1.3], [-1.3, 0.0]]), driven], epsilon=0.7)
    xi, phi, dt = 0.9, 2.1, 1e-6
    x = np.array([math.cos(phi), -math.sin(phi)])
    moved = x + dt * system.matrix_at(xi) @ x
    assert (math.atan2(-moved[1], moved[0]) - phi) / dt == pytest.approx(float(system.phase_speed(xi)(phi)), rel=1e-5)
    assert math.log(np.linalg.norm(moved)) / dt == pytest.approx(float(system.growth_rate(xi)(phi)), rel=1e-5)
    for order, matrix, expected in (
        (0, ((0, 2), (-0.5, 0)), 1.0),
        (0, ((0, 3), (0, 0)), 3.0),
        (1, ((0, 3), (0, 0)), 0.0),
    ):
        system = PlaneSystem([CoefficientMatrix(order, matrix)], epsilon=0.5)
        assert system.angular_frequency() == pytest.approx(expected)
