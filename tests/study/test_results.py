"""Results of cases are plain values: they travel to other processes."""

import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.study.simulate import simulate_curves
from fpsolve.study.solve import compare, solve_curves

CASE = """
title = "A curve"
[oscillator]
epsilon = 0.5
omega = 1.0
restitution = 0.8
c1 = 0.8
c2 = 0.5
[noise]
D0 = 0.1
tau0 = 0.5
r0 = 0.95
[moments]
p = [1.0]
[monte_carlo]
paths = 640
time = 40.0
[[expect]]
quantity = "lyapunov_exponent"
value = 0.0
atol = 1.0
source = "a guess"
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = tmp_path_factory.mktemp("case") / "one.toml"
    path.write_text(CASE, encoding="utf-8")
    return load_case(path)


@pytest.fixture(scope="module")
def result(case):
    (found,) = solve_curves(case)
    return found


@pytest.mark.parametrize("has_pairs", [True, False])
def test_solved_curves_pickle(case, result, has_pairs):
    original = result if has_pairs else result.without_pairs()
    again = pickle.loads(pickle.dumps(original))
    np.testing.assert_array_equal(again.moments.value, result.moments.value)
    assert again.estimates == result.estimates
    assert again.curve == result.curve
    assert len(again.eigenpairs) == has_pairs
    assert compare(case, [again]) == compare(case, [result])


def test_comparisons_pickle(case, result):
    (comparison,) = compare(case, [result])
    assert comparison.met
    assert pickle.loads(pickle.dumps(comparison)) == comparison


def test_simulated_curves_pickle(case):
    (simulated,) = simulate_curves(case)
    again = pickle.loads(pickle.dumps(simulated))
    assert again.result == simulated.result
    assert again.estimates == simulated.estimates
    np.testing.assert_array_equal(again.response.density, simulated.response.density)


def test_results_are_frozen(result):
    with pytest.raises(FrozenInstanceError):
        result.failures = ()
