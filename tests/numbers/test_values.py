"""Each number that is known otherwise is within the error that fpsolve states, which is as small as it must be."""

import pytest

from fpsolve import Problem
from tests.numbers.rows import ROWS
from tests.numbers.values import Row

ITEMS = [
    pytest.param(row, id=f"{row.quantity.name} {row.source}", marks=[pytest.mark.slow] if row.slow else [])
    for row in ROWS
]


@pytest.mark.parametrize("row", ITEMS)
def test_value_is_within_its_error(row: Row):
    problem = row.problem if isinstance(row.problem, Problem) else row.problem()
    value, error = row.quantity.solved(problem)
    right = row.value() if callable(row.value) else row.value
    assert abs(value - right) <= error + row.doubt, f"{value} ± {error}, off by {value - right}"
    assert error <= row.most
