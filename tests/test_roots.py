"""Newton's method in a bracket, against zeros in closed form, with a count of the values it takes."""

import math

import numpy as np
import pytest

from fpsolve.roots import Missing, NoRoot, Value, increasing_root

FUNCTIONS = {
    "line": (lambda x: 3 * (x - 1.7), lambda x: 3.0, 1.7, 3),
    "steep": (lambda x: math.expm1(2 * (x - 6.0)), lambda x: 2 * math.exp(2 * (x - 6.0)), 6.0, 30),
    "flat": (lambda x: math.atan(5 * (x + 8.0)), lambda x: 5 / (1 + 25 * (x + 8.0) ** 2), -8.0, 20),
    "cubic": (lambda x: (x - 0.25) ** 3, lambda x: 3 * (x - 0.25) ** 2, 0.25, 120),
    "kinked": (lambda x: max(x - 2, 50 * (x - 2)), lambda x: 50.0 if x > 2 else 1.0, 2.0, 6),
    "at an end": (lambda x: x - 20.0, lambda x: 1.0, 20.0, 8),
}


def counted(name, most=math.inf):
    """A function with values up to |x| = `most`, and the points at which it was taken."""
    value, slope, _, _ = FUNCTIONS[name]
    points = []

    def function(x):
        points.append(x)
        if abs(x) > most:
            raise Missing(x)
        return Value(value(x), slope(x), 0.0)

    return function, points


@pytest.mark.parametrize("start", [-20.0, -3.0, 0.0, 5.0, 20.0])
@pytest.mark.parametrize("reach", [4.0, math.inf])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_zeros_in_few_values(name, start, reach):
    function, points = counted(name)
    *_, zero, most = FUNCTIONS[name]
    found = increasing_root(function, start, (-20.0, 20.0), reach=reach)
    assert found == points[-1] == pytest.approx(zero, abs=1e-11)
    assert len(points) <= most
    assert len(set(points)) == len(points)


def test_what_is_close_counts_where_steps_do_not_get_shorter():
    """Values have an error of 1e-6, beside which no step leads nearer."""
    noise = iter(np.random.default_rng(0).uniform(-1e-6, 1e-6, 99).tolist())
    points = []

    def function(x):
        points.append(x)
        return Value(x - 0.5 + next(noise), 1.0, 1e-12, 1e-5)

    assert increasing_root(function, 3.0, (-20.0, 20.0)) == pytest.approx(0.5, abs=3e-6)
    assert len(points) <= 5


def test_one_sign_up_to_an_end():
    function, points = counted("steep")
    with pytest.raises(NoRoot) as none:
        increasing_root(function, 0.0, (-20.0, 5.0))
    assert (none.value.last, none.value.is_negative, none.value.missing) == (5.0, True, None)
    assert max(points) == 5.0


@pytest.mark.parametrize("most", [0.5, 3.0, 5.9])
def test_one_sign_as_far_as_there_are_values(most):
    function, points = counted("steep", most)
    with pytest.raises(NoRoot) as none:
        increasing_root(function, 0.0, (-20.0, 20.0), reach=4.0)
    assert none.value.is_negative
    assert 0 <= none.value.last <= most
    assert none.value.missing.args[0] > most
    assert len(points) <= 12


@pytest.mark.parametrize("most", [6.1, 19.0])
def test_a_zero_next_to_where_there_are_no_values(most):
    function, points = counted("steep", most)
    assert increasing_root(function, 0.0, (-20.0, 20.0), reach=4.0) == pytest.approx(6.0, abs=1e-11)
    assert len(points) <= 30


def test_no_value_at_the_start_or_between_both_signs():
    with pytest.raises(Missing):
        increasing_root(counted("line", 0.1)[0], 1.0, (-20.0, 20.0))

    def function(x):
        if 1.6 < x < 1.8:
            raise Missing(x)
        return Value(x - 1.7, 1.0, 0.0)

    with pytest.raises(Missing):
        increasing_root(function, 1.0, (1.0, 2.0), known=(1.0, 2.0))
