"""Estimates by simulation against the finite elements, and whether their standard errors mean what they say."""

import math

import numpy as np
import pytest

from tests.agreement import SCATTERED, cheap_step, rows, scatter
from tests.conftest import sampled


@pytest.mark.parametrize(
    ("epsilon", "restitution", "noise"), sampled((1.0, 0.8, "reduced"), (0.5, 0.6, "exact"), (0.1, 1.0, "exact"))
)
def test_agrees_with_finite_elements(epsilon, restitution, noise):
    """Strong noise that is reduced, and weaker noise as it stands; all 18 by `python -m tests.agreement`."""
    table = list(rows([(epsilon, restitution, noise)], paths=4096, transients=8, step=cheap_step))
    given = [row for row in table if row.simulated.value is not None]
    assert sum(row.simulated.estimator == "population" for row in given) >= 4
    assert sum(row.simulated.estimator == "direct" for row in given) >= 1
    assert np.max(np.abs([row.deviation for row in given])) <= 4
    assert np.max([row.simulated.standard_error for row in given]) < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("estimator", "paths", "time"), SCATTERED)
def test_standard_errors_are_honest(estimator, paths, time):
    """Estimates deviate by their standard error, and their mean is Λ(p); of 64 seeds `python -m tests.agreement`."""
    for _, pairs, reference in scatter(estimator, paths, time, seeds=20):
        values, errors = pairs.T
        deviation = np.std(values, ddof=1)
        assert deviation / math.sqrt(np.mean(errors**2)) == pytest.approx(1, abs=0.2 * math.sqrt(200 / len(pairs)))
        assert abs(values.mean() - reference) < 4 * deviation / math.sqrt(len(pairs)) + 0.1 * deviation
