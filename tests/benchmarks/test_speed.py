"""fpsolve against its peers, as ratios in one run: `pytest tests/benchmarks`."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.benchmarks.cpu import race, random_times
from tests.benchmarks.measure import Measurement, fpsolve_curve, measure, unavailable
from tests.benchmarks.problem import CASES
from tests.benchmarks.references import REFERENCES

FAST_PEERS = ("fourier_hermite", "ngsolve")
"""Those that reach the accuracy of the strong case."""


@cache
def measured(method: str, case: str) -> Measurement:
    """One measurement for all tests."""
    return measure(method, case)


@pytest.mark.parametrize("name", CASES)
def test_curve(benchmark, name):
    case = CASES[name]
    value, _ = benchmark.pedantic(fpsolve_curve, args=(case,), rounds=3 if name == "weak" else 1)
    assert case.relative_error(value, REFERENCES[name]) <= case.rtol


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("method", FAST_PEERS)
def test_peer_is_as_accurate(method, name):
    if (reason := unavailable(method)) is not None:
        pytest.skip(reason)
    assert measured(method, name).error <= CASES[name].rtol


@pytest.fixture(scope="module", params=CASES)
def race_of(request):
    return request.param, race(CASES[request.param])


def test_to_the_code_whose_size_is_tuned_with_the_answer_known(race_of):
    name, seconds = race_of
    assert seconds["fpsolve"] <= {"weak": 1.0, "strong": 2.0}[name] * seconds["tuned"]


def test_to_the_code_that_certifies_its_size(race_of):
    """Which must be a good one."""
    name, seconds = race_of
    assert seconds["certified"] <= {"weak": 4.0, "strong": 25.0}[name] * seconds["tuned"]
    assert seconds["fpsolve"] <= {"weak": 0.35, "strong": 0.8}[name] * seconds["certified"]


def test_random_problems_take_milliseconds():
    for seconds in random_times().values():
        assert np.median(seconds) <= 0.005
        assert seconds.max() <= 0.5


@pytest.mark.parametrize("name", CASES)
def test_memory(name):
    assert measured("fpsolve", name).peak_mb < 300
