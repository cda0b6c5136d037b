"""Random linear systems by simulation: a sample of `python -m tests.random_simulations`, one of each kind of path."""

import math

import pytest

from tests.conftest import sampled
from tests.random_simulations import MOST, drawn, outcomes

SEEDS = {
    3: "ornstein-uhlenbeck",
    225: "bounded",
}


@pytest.mark.parametrize("seed", sampled(*SEEDS))
def test_a_random_system_is_simulated(seed):
    """In the first a wall."""
    kind, problem = drawn(seed)
    found = outcomes(problem, paths=2048 if " and " in kind else 4096, transients=2)
    assert kind == SEEDS[seed]
    assert problem.system.jumps or seed != 3
    for each in found:
        assert math.isfinite(each.deviation)
        assert abs(each.deviation) < MOST
