"""Where the upper end of the interval of ln a goes."""

from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve.nonlinear.adapt import Settled


def with_shares(*shares):
    """A density with these shares of E aⁿ in elements of length ½."""
    lines = 0.5 * np.arange(len(shares) + 1)
    return SimpleNamespace(height=SimpleNamespace(lines=lines), shares=lambda n: np.array(shares))


def fall(*densities):
    return Settled(with_shares(*densities[0]), tuple(with_shares(*each) for each in densities[1:])).fall(4)


def test_it_does_not_follow_waves_that_another_discretisation_does_not_have():
    """Shares that a van der Pol oscillator had on coarse discretisations, whose interval grew with its waves."""
    found = fall(
        (0.12, 0.65, 0.22, 5.6e-4, 6.2e-3), (0.12, 0.65, 0.23, 2.7e-4, 4.1e-3), (0.12, 0.65, 0.23, 4.4e-3, 7e-4)
    )
    assert found.end == 2.0
    assert found.ratio == pytest.approx(5.6e-4 / 0.22)
    assert found.top(1e-4) == 2.0


@pytest.mark.parametrize("last", [0.03, 0.01])
def test_it_follows_what_all_of_them_have(last):
    """A second hump, and what falls less and less fast."""
    found = fall((0.12, 0.65, 0.22, 0.01, last), (0.12, 0.65, 0.22, 0.011, 0.9 * last))
    assert found.end == 2.5
    assert found.top(1e-4) > 2.5
