"""Peaks of memory that take half a minute each to reach."""

import sys

import pytest

from tests.test_budget import LONG, assert_peak_is_foreseen


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="sizes of Linux")
@pytest.mark.parametrize("name", LONG)
def test_the_peak_of_memory_is_foreseen(name):
    assert_peak_is_foreseen(name)
