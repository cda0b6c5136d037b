"""A sample of the calls of tests/odd_calls.py."""

import pytest

from tests.odd_calls import CALLS, faults

HEAVY = ("boundary", "run", "sensitivities", "simulate", "prove")
LIGHT = [name for name in CALLS if name not in HEAVY]


@pytest.mark.parametrize("seed", range(2))
def test_odd_calls_return_or_raise_one_sentence(seed):
    assert faults(seed, 3 * len(LIGHT), LIGHT) == []


@pytest.mark.slow
def test_many_odd_calls_return_or_raise_one_sentence():
    """Two of each; hundreds by `python -m tests.odd_calls`."""
    assert faults(7, 2 * len(CALLS)) == []
