"""A random linear system by simulation: a sample of `python -m tests.random_simulations`."""

import math

from tests.random_simulations import MOST, drawn, outcome


def test_a_random_system_is_simulated():
    """Under Ornstein-Uhlenbeck noise, with a wall."""
    kind, problem = drawn(3)
    found = outcome(problem, paths=4096, transients=4)
    assert kind == "ornstein-uhlenbeck"
    assert problem.system.jumps
    assert math.isfinite(found.deviation)
    assert abs(found.deviation) < MOST
