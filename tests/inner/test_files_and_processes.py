"""Internals of what lies in no room: roots of increasing functions, and signals that end or wait."""

import math
import signal

import numpy as np
import pytest

from fpsolve.roots import Missing, NoRoot, Value, increasing_root
from fpsolve.signals import is_interrupt, signals_held, sigterm_interrupts

FUNCTIONS = {
    "line": (lambda x: 3 * (x - 1.7), lambda x: 3.0, 1.7, 3),
    "steep": (lambda x: math.expm1(2 * (x - 6.0)), lambda x: 2 * math.exp(2 * (x - 6.0)), 6.0, 30),
    "flat": (lambda x: math.atan(5 * (x + 8.0)), lambda x: 5 / (1 + 25 * (x + 8.0) ** 2), -8.0, 20),
    "cubic": (lambda x: (x - 0.25) ** 3, lambda x: 3 * (x - 0.25) ** 2, 0.25, 120),
    "kinked": (lambda x: max(x - 2, 50 * (x - 2)), lambda x: 50.0 if x > 2 else 1.0, 2.0, 6),
    "at an end": (lambda x: x - 20.0, lambda x: 1.0, 20.0, 8),
}
ENDS = (-20.0, 20.0)


def counting(name, most=math.inf):
    """A function with values up to |x| = `most`, and the points at which it was taken."""
    (value, slope, _, _), points = FUNCTIONS[name], []

    def function(x):
        points.append(x)
        if abs(x) > most:
            raise Missing(x)
        return Value(value(x), slope(x), 0.0)

    return function, points


@pytest.mark.parametrize("start", [-20.0, -3.0, 0.0, 5.0, 20.0])
@pytest.mark.parametrize("reach", [4.0, math.inf])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_zero_of_an_increasing_function_is_found_in_few_values(name, start, reach):
    function, points = counting(name)
    *_, zero, most = FUNCTIONS[name]
    assert increasing_root(function, start, ENDS, reach=reach) == points[-1] == pytest.approx(zero, abs=1e-11)
    assert len(points) == len(set(points)) <= most


def test_zero_of_values_with_an_error_is_as_near_as_that():
    noise = iter(np.random.default_rng(0).uniform(-1e-6, 1e-6, 6).tolist())
    found = increasing_root(lambda x: Value(x - 0.5 + next(noise), 1.0, 1e-12, 1e-5), 3.0, ENDS)
    assert found == pytest.approx(0.5, abs=3e-6)


@pytest.mark.parametrize(("most", "end"), [(math.inf, 5.0), (0.5, 5.0), (3.0, 5.0), (5.9, 20.0)])
def test_values_of_one_sign_have_no_zero_as_far_as_there_are_any(most, end):
    function, points = counting("steep", most)
    with pytest.raises(NoRoot) as none:
        increasing_root(function, 0.0, (-20.0, end), reach=4.0)
    assert none.value.is_negative
    assert 0 <= none.value.last <= most
    assert none.value.last == end if most == math.inf else none.value.missing.args[0] > most
    assert len(points) <= 12


@pytest.mark.parametrize("most", [6.1, 19.0])
def test_zero_next_to_where_there_are_no_values_is_found(most):
    assert increasing_root(counting("steep", most)[0], 0.0, ENDS, reach=4.0) == pytest.approx(6.0, abs=1e-11)


def test_no_value_at_the_start_is_raised():
    with pytest.raises(Missing):
        increasing_root(counting("line", 0.1)[0], 1.0, ENDS)


def test_only_the_first_sigterm_interrupts_and_a_held_one_comes_after_the_body():
    calls = []

    def held():
        with signals_held():
            signal.raise_signal(signal.SIGTERM)
            calls.append("body")

    with sigterm_interrupts() as received:
        with pytest.raises(KeyboardInterrupt):
            held()
        signal.raise_signal(signal.SIGTERM)
    assert (received, calls) == ([signal.SIGTERM] * 2, ["body"])


def test_interrupt_is_known_in_the_disguise_of_an_import():
    disguised = RuntimeError()
    disguised.__cause__ = KeyboardInterrupt()
    assert (is_interrupt(disguised), is_interrupt(RuntimeError())) == (True, False)
