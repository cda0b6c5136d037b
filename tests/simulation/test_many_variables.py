"""Paths of more than four variables, beside closed forms and closed equations of moments."""

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, Problem, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.model import CoefficientMatrix, LinearSystem, Poisson, White
from fpsolve.simulation import simulate
from tests.kit import chain_of_masses

COVERED = 4.0
"""Multiple of the standard error within which a number must be."""


def problem(free, driven, noise):
    terms = CoefficientMatrix(0, free), CoefficientMatrix(0, driven, identity)
    return Problem(LinearSystem(terms), noise)


@pytest.mark.slow
def test_a_load_on_all_variables_alike():
    """ẋ = (A + ½ξ)x: λ is the largest real part, and Λ(p) = pλ + p²S/8."""
    free, _, _ = chain_of_masses(3, 0.2)
    found = simulate(problem(free, 0.5 * np.eye(6), White(s=0.2)), [0.5, 1.0], paths=1024, seed=1)
    growth = float(np.linalg.eigvals(free).real.max())
    assert abs(found.lyapunov_exponent - growth) < COVERED * found.lyapunov_exponent_error
    for each in found.estimates:
        assert abs(each.value - (each.p * growth + each.p**2 * 0.04 / 8)) < COVERED * each.standard_error


@pytest.mark.slow
def test_the_bounds_of_convexity():
    """λ and Λ(1) by paths are within those by Λ(2), which paths have, too."""
    free, driven, _ = chain_of_masses(3, 0.2)
    chain = problem(free, driven, OrnsteinUhlenbeck(1.0, 0.5))
    exact, found = moment_lyapunov(chain, 2.0).value[0], simulate(chain, [1.0, 2.0], paths=1024, seed=2)
    assert found.lyapunov_exponent - COVERED * found.lyapunov_exponent_error < exact / 2
    first, second = found.estimates
    assert first.value - COVERED * first.standard_error < exact / 2
    assert abs(second.value - exact) < COVERED * second.standard_error


def test_impulses_are_refused():
    free, driven, _ = chain_of_masses(2)
    with pytest.raises(FpsolveError, match="under impulses is for two variables, but there are 4"):
        simulate(problem(free, driven, Poisson(1.0, (0.1,))), 1.0)
