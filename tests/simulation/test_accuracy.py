"""How accurate simulations are: digits, and what they tell apart; for orders of steps `python -m tests.agreement`."""

import math

import pytest

from fpsolve.simulation.estimators import simulate
from tests.agreement import cheap_step
from tests.conftest import FIG1, FIG1_NOISE
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
