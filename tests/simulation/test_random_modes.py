"""Random systems of three and four variables: a sample of `python -m tests.random_modes`."""

import pytest

from tests.random_modes import MOST, drawn, outcomes
from tests.random_simulations import Outcome


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_a_random_system_is_simulated(seed):
    """Λ(p) and λ under white noise, n = 3 and 4."""
    for found in outcomes(drawn(seed)[1], path_steps=5e6):
        assert isinstance(found, Outcome)
        assert abs(found.deviation) < MOST
