"""fpsolve against its peers, as ratios in one run: `pytest tests/benchmarks`."""

from __future__ import annotations

from functools import cache

import pytest

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


NOT_YET = pytest.mark.xfail(
    reason="the peers' sizes are tuned with the answer known, and they give no error estimate; they also borrow the "
    "tilt exp(s z), which makes 45 unknowns enough for weak noise",
    strict=True,
)


@NOT_YET
def test_weak_curve_takes_a_third_of_fourier_hermite():
    assert measured("fpsolve", "weak").seconds <= measured("fourier_hermite", "weak").seconds / 3


@NOT_YET
def test_strong_curve_is_ten_times_faster_than_any_peer():
    peers = [measured(method, "strong") for method in FAST_PEERS if unavailable(method) is None]
    fastest = min(peer.seconds for peer in peers if peer.error <= CASES["strong"].rtol)
    assert measured("fpsolve", "strong").seconds <= fastest / 10


@pytest.mark.parametrize("name", CASES)
def test_memory(name):
    assert measured("fpsolve", name).peak_mb < 300
