"""Λ(p) at a range of p with one next to 0, and by simulation there."""

import numpy as np
import pytest

from fpsolve import moment_lyapunov, simulate
from tests.numbers.rows.small_p import STRONG, UNIFORM


@pytest.mark.parametrize("count", [7, 25])
def test_moments_of_a_range_with_a_rounded_zero_are_those_of_the_normal_law(count):
    """Solved one by one, and interpolated."""
    p = np.linspace(-2, 0.4, count)
    near = np.argmin(np.abs(p))
    assert 0 < abs(p[near]) < 1e-15
    found, exact = moment_lyapunov(UNIFORM, p), -0.1 * p + 0.5 * p**2
    assert found.p.size == count
    assert np.all(np.abs(found.value - exact) <= found.error_estimate)
    assert found.value[near] == pytest.approx(-0.1 * p[near], rel=1e-7)


def test_simulated_moments_next_to_zero_are_those_of_lambda():
    found = simulate(STRONG, [-2.2e-16, 1e-12, 5e-324], paths=64, time=100.0, seed=1)
    for each in found.estimates:
        assert each.value == each.p * found.lyapunov_exponent
        assert each.standard_error == abs(each.p) * found.lyapunov_exponent_error
    assert not any(message.code.name == "DRIFTING" for message in found.warnings)
