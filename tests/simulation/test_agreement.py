"""Estimates by simulation against the finite elements; of their standard errors `python -m tests.agreement`."""

import numpy as np
import pytest

from tests.agreement import cheap_step, rows
from tests.conftest import sampled


@pytest.mark.parametrize(("epsilon", "restitution", "noise"), sampled((0.5, 0.6, "exact"), keep=0))
def test_agrees_with_finite_elements(epsilon, restitution, noise):
    """Strong noise that is reduced, and weaker noise as it stands; all 18 by `python -m tests.agreement`."""
    table = list(rows([(epsilon, restitution, noise)], paths=4096, transients=8, step=cheap_step))
    given = [row for row in table if row.simulated.value is not None]
    assert sum(row.simulated.estimator == "population" for row in given) >= 4
    assert sum(row.simulated.estimator == "direct" for row in given) >= 1
    assert np.max(np.abs([row.deviation for row in given])) <= 4
    assert np.max([row.simulated.standard_error for row in given]) < 2e-3
