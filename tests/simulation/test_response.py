"""The stationary response against stochastic averaging, which is exact for weak noise."""

import math

import numpy as np
import pytest
from scipy.stats import gamma

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator
from fpsolve.simulation import batches, simulated_response
from fpsolve.simulation.setup import default_step

NOISE = NonGaussianNoise(D0=0.3, tau0=0.5, r0=0.9).ou_reduction()


def averaged(oscillator):
    """λ, s² = Λ″(0) and κ of the averaged amplitude: d ln A = (λ − κA²) dt + s dW."""
    solver = ExponentSolver(Problem(oscillator, NOISE))
    kappa = oscillator.epsilon**2 * (oscillator.c2 + 3 * oscillator.omega**2 * oscillator.c3) / 8
    return solver.lyapunov_exponent().value, solver.variance_rate().value, kappa


@pytest.fixture(scope="module")
def weak():
    oscillator = VibroImpactOscillator(
        omega=1.3, restitution=0.95, c1=0.5, epsilon=0.15, c2=0.4, c3=0.2, impact="restitution"
    )
    exponent, s_square, _ = averaged(oscillator)
    step = default_step(oscillator, NOISE)
    return oscillator, simulated_response(
        Problem(oscillator, NOISE), exponent, s_square, paths=512, time=100.0, step=step, seed=1
    )


@pytest.mark.slow
def test_mean_square_of_the_amplitude(weak):
    """⟨A²⟩ = λ/κ up to ε²."""
    oscillator, response = weak
    exponent, _, kappa = averaged(oscillator)
    value = response.means["x_squared"][0] + response.means["v_squared"][0] / oscillator.omega**2
    error = 2 * response.means["energy"][1] / oscillator.omega**2
    assert value == pytest.approx(exponent / kappa, abs=4 * error + oscillator.epsilon**2 * value)


@pytest.mark.slow
def test_density_of_the_amplitude(weak):
    """A² has a Gamma law with the shape λ/s² and the mean λ/κ, up to ε²."""
    oscillator, response = weak
    exponent, s_square, kappa = averaged(oscillator)
    theory = gamma(exponent / s_square, scale=s_square / kappa)
    expected = np.diff(theory.cdf(response.amplitude_edges**2)) / np.diff(response.amplitude_edges)
    tolerance = 5 * response.amplitude_error + 2 * oscillator.epsilon**2 * expected.max()
    assert np.all(np.abs(response.amplitude_density - expected) <= tolerance)


@pytest.mark.slow
def test_histograms_are_densities(weak):
    _, response = weak
    dx, dv = np.diff(response.x_edges)[0], np.diff(response.v_edges)[0]
    inside = 1 - response.outside
    assert response.outside < 1e-3
    assert response.density.sum() * dx * dv == pytest.approx(inside, rel=1e-12)
    assert np.sum(response.amplitude_density * np.diff(response.amplitude_edges)) == pytest.approx(inside, rel=1e-12)
    middle = (response.x_edges[1:] + response.x_edges[:-1]) / 2
    mean = np.sum(response.density * middle[:, None]) * dx * dv
    assert mean == pytest.approx(response.means["x"][0], rel=2e-3)


@pytest.mark.slow
def test_impacts_come_twice_a_turn(weak):
    oscillator, response = weak
    assert response.impact_rate == pytest.approx(oscillator.omega / math.pi, rel=0.02)


def test_energy_is_that_of_x_and_v(weak):
    oscillator, response = weak
    mean = {name: value for name, (value, _) in response.means.items()}
    energy = (mean["v_squared"] + oscillator.omega**2 * mean["x_squared"]) / 2
    assert mean["energy"] == pytest.approx(energy, rel=1e-12)


@pytest.mark.slow
def test_seed_decides_whatever_the_threads(weak, monkeypatch):
    oscillator, _ = weak
    arguments, found = (Problem(oscillator, NOISE), 0.05, 0.01), []
    for threads, seed in ((1, 1), (2, 1), (2, 2)):
        monkeypatch.setattr(batches, "processors", lambda threads=threads: threads)
        found.append(simulated_response(*arguments, paths=32, time=50.0, step=0.1, seed=seed))
    first, again, other = found
    assert first.means == again.means != other.means
    np.testing.assert_array_equal(first.density, again.density)
