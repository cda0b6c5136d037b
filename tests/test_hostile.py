"""A sample of the files and records that `python -m tests.hostile` tries by the hundred."""

import pytest

from tests.conftest import sampled
from tests.hostile import tried


@pytest.mark.parametrize(("kind", "count"), sampled(("netcdf", 2), ("records", 4)))
def test_nothing_ends_in_a_traceback_or_is_lost(kind, count):
    ended, wrong = tried(kind, 7, count)
    assert not wrong
    assert ended.total() == count
