"""Each program of tests/benchmarks runs, here with small sizes."""

from dataclasses import replace

import numpy as np
import pytest

from tests.benchmarks import pages, references
from tests.benchmarks.cpu import race
from tests.benchmarks.problem import CASES


@pytest.mark.slow
def test_race_of_five_moments_is_won_by_codes_that_are_accurate():
    case = CASES["weak"]
    found = race(replace(case, p=case.p[::8]), references.REFERENCES["weak"][::8], 1)
    assert {*found} == {"fpsolve", "tuned", "certified"}
    assert min(found.values()) > 0


@pytest.mark.slow
def test_references_agree_with_a_smaller_truncation():
    value, smaller = (references.compute("weak", size) for size in references.SIZES["weak"])
    assert CASES["weak"].relative_error(smaller, value) <= 1e-12
    np.testing.assert_allclose(value, references.REFERENCES["weak"], rtol=1e-11, atol=1e-15)


SMALL = {
    "set": lambda: pages.numbers_of_a_set(1),
    "slow noise": lambda: pages.slow(1.0, 0.3, (1.0,)),
    "all slow noise": lambda: pages.all_slow((1.0,), (0.3,)),
    "starts": lambda: pages.starts(1),
    "sweep": lambda: pages.sweep((2, 3)),
    "chart": lambda: pages.chart((0.9, 1.1), (0.5, 0.6), nodes=3),
    "proofs": lambda: pages.proofs(1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_rows_of_the_pages_are_measured(name):
    found = SMALL[name]()
    assert found
    assert all(np.isfinite(each) for each in found.values())
