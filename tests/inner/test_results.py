"""Numbers, units and times as text."""

from types import SimpleNamespace

import matplotlib.figure
import pytest

from fpsolve.data import plain_unit
from fpsolve.drawing import plain_numbers, typeset
from fpsolve.exponent.error import digits
from fpsolve.tell.numbers import bounds_text
from fpsolve.tell.text import sampled, sign_of


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.01234567, 9e-9, "0.0123457"),
        (0.01234567, 1e-6, "0.012346"),
        (-123.456, 0.1, "-123.5"),
        (1e-17, 1e-15, "0"),
        (2.0, 0.0, "2.000000000000"),
    ],
)
def test_digits_are_those_that_the_error_leaves(value, error, text):
    assert digits(value, error).startswith(text[:-1])
    assert float(digits(value, error)) == pytest.approx(value, abs=2 * error)


@pytest.mark.parametrize(("low", "high"), [(0.12345, 0.67891), (0.0999999, 0.9999), (0.01, 0.02)])
def test_bounds_are_rounded_outwards(low, high):
    found = SimpleNamespace(is_certain=False, bounds=lambda level: (low, high))
    down, up = map(float, bounds_text(found, 2.0).split("-"))
    assert down <= low <= high <= up
    assert up - down <= (high - low) + 0.011 * (low + high)


def test_a_sign_within_its_error_is_none():
    assert [sign_of(value, 0.1) for value in (-1.0, 0.05, 1.0)] == [-1, 0, 1]


@pytest.mark.parametrize(
    ("unit", "drawn_as", "said"),
    [
        ("1/time^(1/2)", "1/time$^{1/2}$", "1/sqrt(time)"),
        ("1/time^(3/2)", "1/time$^{3/2}$", "1/time^1.5"),
        ("$m^2$", "$m^2$", "$m^2$"),
    ],
)
def test_powers_in_units_are_typeset(unit, drawn_as, said):
    assert (typeset(unit), plain_unit(unit)) == (drawn_as, said)


@pytest.mark.parametrize(("start", "stop"), [(1.0, 4.0), (0.9, 4.5), (0.3, 0.5)])
def test_short_logarithmic_axes_have_round_ticks(pictures, start, stop):
    axes = matplotlib.figure.Figure().subplots()
    axes.set(xscale="log", xlim=(start, stop))
    plain_numbers(axes.xaxis)
    axes.figure.draw_without_rendering()
    inside = [tick for tick in axes.get_xticks() if start <= tick <= stop]
    assert len(inside) >= 3
    assert all(len(f"{tick:.6g}".replace(".", "").strip("0")) <= 2 for tick in inside)


@pytest.mark.parametrize(("value", "error", "text"), [(0.00123456, 1e-5, "0.001235"), (0.25, 0.0, "0.25")])
def test_a_sampled_number_has_two_digits_of_its_error(value, error, text):
    assert sampled(value, error) == text
