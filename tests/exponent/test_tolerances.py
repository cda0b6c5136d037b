"""Error estimates at coarse tolerances, against tighter ones and second methods."""

import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, Problem
from fpsolve.model import ParametricOscillator, Poisson
from tests.conftest import sampled
from tests.random_tolerances import MOST, compared


@pytest.mark.parametrize("seed", sampled(272, 380, 1486, 491, 2, 12, keep=3))
def test_random_tolerances(seed):
    """Many more: `python -m tests.random_tolerances`. In the first four a layer of T lay within a cell of φ."""
    assert (found := compared(seed)).share <= MOST, found


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4])
def test_effects_that_fall_slowly(rtol):
    """Slow, strong noise in the stiffness at p < 0, where each polynomial lowers the error by a tenth only.

    The value is by Fourier series and Hermite polynomials, `phase_circle.ornstein_uhlenbeck`.
    """
    problem = Problem(ParametricOscillator(stiffness=1.0, damping=0.1755), OrnsteinUhlenbeck(alpha=0.2, sigma=3.0))
    found = ExponentSolver(problem, rtol=rtol).solution(-0.5)
    assert abs(found.pair.value - 0.0006727) <= MOST * found.error


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4, 1e-5])
def test_impulses(rtol):
    """The value is by Fourier series, `phase_circle.impulses`, 400 waves."""
    problem = Problem(ParametricOscillator(stiffness=0.25, damping=0.179), Poisson(rate=1.0, sizes=(-5.445,)))
    found = ExponentSolver(problem, rtol=rtol).lyapunov_exponent()
    assert abs(found.value - 1.462376991) <= MOST * found.error_estimate
