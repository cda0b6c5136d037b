"""Λ(p) of random systems is the same in all units."""

import pytest

from tests.conftest import sampled
from tests.random_units import compared


@pytest.mark.parametrize("seed", sampled(0, 2, 8, 12, 13, 14, 57, 105, 4, *range(20, 29, 2), 31, 34, keep=4))
def test_random_units(seed):
    """Many more: `python -m tests.random_units`."""
    found = compared(seed)
    assert found.is_good, found
