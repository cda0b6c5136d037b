"""Saddles under weak noise: the phase hardly leaves the faster mode, and other pairs seem to have a positive T."""

import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem
from fpsolve.arrays import identity
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, Problem
from fpsolve.model.noises import SineWiener
from tests.conftest import sampled
from tests.oracles.moment_hierarchy import ornstein_uhlenbeck_exponent, sine_wiener_exponent

SADDLE, SKEW_SADDLE = ((1.0, 0.0), (0.0, -1.0)), ((0.5, 1.0), (0.3, -0.3))
ROTATION = ((0.0, -1.0), (1.0, 0.0))


def solver(steady, noise):
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, ROTATION, identity)]
    return ExponentSolver(Problem(PlaneSystem(terms), noise))


@pytest.mark.parametrize(
    ("steady", "rate", "deviation"),
    sampled((SADDLE, 0.1, 0.01), (SADDLE, 0.01, 0.1), (SKEW_SADDLE, 0.01, 0.01), (SKEW_SADDLE, 0.01, 0.03)),
)
def test_gaussian_noise(steady, rate, deviation):
    """About |x|²|v|² has no change of sign either; its eigenvalue is near 0 for the saddle, that of |x|⁴ near 4."""
    found = solver(steady, OrnsteinUhlenbeck(alpha=rate, sigma=deviation * (2 * rate) ** 0.5)).solution(4.0)
    expected = ornstein_uhlenbeck_exponent(steady, ROTATION, rate, deviation, 4, 24)
    assert abs(found.pair.value - expected) <= found.error + 1e-8


@pytest.mark.parametrize("steady", [SADDLE, SKEW_SADDLE])
def test_bounded_noise(steady):
    noise = SineWiener(amplitude=0.03, sigma=0.02**0.5)
    found = solver(steady, noise).solution(4.0)
    expected = sine_wiener_exponent(steady, ROTATION, noise.amplitude, noise.sigma, 4, 16)
    assert abs(found.pair.value - expected) <= found.error + 1e-10
