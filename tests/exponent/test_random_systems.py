"""Λ(2) of random systems under every kind of noise within the stated error of the oracles."""

import pytest

from tests.conftest import sampled
from tests.random_systems import compared


@pytest.mark.parametrize("seed", sampled(7, 9, 12, 192, *range(1, 7), 8, 10, 11, 14, keep=4))
def test_random_systems(seed):
    """Many more: `python -m tests.random_systems`."""
    assert (found := compared(seed)).is_within, found
