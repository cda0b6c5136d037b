"""How accurate simulations are: the order of the step, digits in seconds, and what they tell apart."""

import math

import pytest

from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.simulation import estimators
from fpsolve.simulation.estimators import simulate
from tests.agreement import cheap_step
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE
from tests.simulation.problems import REDUCED, STRONG, exact


@pytest.mark.slow
def test_population_succeeds_where_the_direct_estimator_fails():
    """Λ(4) at ε = 1 to 1 %."""
    reference = exact(STRONG, REDUCED, [4.0])[0]
    direct = simulate(STRONG, REDUCED, [4.0], paths=1024, seed=1)
    assert direct.estimates[0].value is None
    assert any("no estimate of Λ(p) at p = 4:" in text and "of the 5000" in text for text in direct.warnings)
    population = simulate(STRONG, REDUCED, [4.0], estimator="population", paths=4096, seed=1)
    assert not population.warnings
    assert population.estimates[0].value == pytest.approx(reference, rel=1e-2)
    assert population.estimates[0].standard_error < 2e-3 * reference


@pytest.mark.slow
def test_an_eighth_of_the_default_paths():
    """A moment of strong noise is good to 2e-3."""
    reference = exact(STRONG, REDUCED, [1.0])[0]
    estimate = simulate(STRONG, REDUCED, [1.0], estimator="population", paths=4096).estimates[0]
    assert estimate.standard_error < 2e-3 * reference
    assert abs(estimate.value - reference) < 4 * estimate.standard_error


def biases(monkeypatch, oscillator, noise, p, steps, paths, time=None):
    """Relative bias of Λ(p) and its standard error for each step."""
    monkeypatch.setattr(estimators, "obstacles", lambda *_, **__: {})
    reference = exact(oscillator, noise, [p])[0]
    found = [
        simulate(oscillator, noise, [p], estimator="population", paths=paths, time=time, step=step, seed=4).estimates[0]
        for step in steps
    ]
    return [(estimate.value / reference - 1, estimate.standard_error / abs(reference)) for estimate in found]


@pytest.mark.slow
def test_weak_order_of_the_exact_noise(monkeypatch):
    """Halving the step divides the bias by 4; the steps are eight and four times the largest that is allowed."""
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.9)
    (coarse, error), (fine, fine_error) = biases(monkeypatch, STRONG, noise, 3.0, (0.2, 0.1), 16384, 200.0)
    assert abs(coarse) > 20 * error
    assert abs(fine) > 5 * fine_error
    assert coarse / fine == pytest.approx(4, abs=0.3 + 4 * (coarse / fine) * fine_error / fine)


@pytest.mark.slow
def test_weak_order_of_ornstein_uhlenbeck_noise(monkeypatch):
    """The step is more than second order: from αh = 1.2 to 0.6 the bias falls by more than 4."""
    (coarse, error), (fine, fine_error) = biases(monkeypatch, STRONG, UNIT_NOISE, 1.0, (1.2, 0.6), 4096)
    assert abs(coarse) > 8 * error
    assert abs(fine) < abs(coarse) / 4 + 3 * fine_error


@pytest.mark.slow
def test_gap_between_the_reduced_and_the_real_noise():
    """Fig. 1, D₀ = 1, r₀ = 0.95: the reduction (12)-(14) makes Λ(2) larger, by far more than 5 standard errors."""
    found = [
        simulate(
            FIG1, noise, [2.0], estimator="population", paths=8192, step=cheap_step(FIG1, noise), seed=5
        ).estimates[0]
        for noise in (FIG1_NOISE.ou_reduction(), FIG1_NOISE)
    ]
    gap = found[0].value - found[1].value
    error = math.hypot(found[0].standard_error, found[1].standard_error)
    assert gap > 5 * error
    assert gap == pytest.approx(0.0141631436533 - 0.0130212719160, abs=4 * error)
