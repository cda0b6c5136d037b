"""Saddles under weak noise: the phase hardly leaves the faster mode, and other pairs seem to have a positive T."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import eigs

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.exponent import principal_pair
from fpsolve.messages import Code
from fpsolve.model import CoefficientMatrix, MarkovChain, SineWiener
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


def test_a_neighbour_does_not_lead_to_another_pair():
    """From a p beside it, with the vectors of |x|²|v|², which seem positive: the value misses the tangent of Λ."""
    beside = solver(SADDLE, OrnsteinUhlenbeck(alpha=0.1, sigma=0.01 * 0.2**0.5)).solution(3.9).pair
    matrix, mass = beside.generator.matrix(4.0).tocsc(), beside.generator.space(4.0).mass.tocsc()
    start = np.ones(beside.right.size)
    (value,), right = eigs(matrix, k=1, M=mass, sigma=1e-4, v0=start)
    _, left = eigs(matrix.T, k=1, M=mass.T, sigma=1e-4, v0=start)
    assert abs(value) < 0.01  # that of |x|⁴ is near 4
    other = replace(beside, right=right[:, 0].real, left=left[:, 0].real)
    found = principal_pair(beside.generator, 4.0, start=other)
    assert found.value == pytest.approx(ornstein_uhlenbeck_exponent(SADDLE, ROTATION, 0.1, 0.01, 4, 24), abs=1e-8)


@pytest.mark.parametrize("steady", [SADDLE, SKEW_SADDLE])
def test_bounded_noise(steady):
    noise = SineWiener(amplitude=0.03, sigma=0.02**0.5)
    found = solver(steady, noise).solution(4.0)
    expected = sine_wiener_exponent(steady, ROTATION, noise.amplitude, noise.sigma, 4, 16)
    assert abs(found.pair.value - expected) <= found.error + 1e-10


@pytest.mark.parametrize("noise", sampled(MarkovChain.telegraph(0.3, 1.0), SineWiener(amplitude=0.3, sigma=1.0)))
def test_starts_matter_below_minus_one(noise):
    """A constant trace makes Λ even about −1, where another class takes over: that of starts around the slower mode."""
    own = solver(SADDLE, noise)
    found = own.moments([-3.0, -1.5, -0.5])
    assert found.value[0] == pytest.approx(own.solution(1.0).pair.value, abs=1e-7)
    assert found.value[1] == pytest.approx(found.value[2], abs=1e-7)
    assert [note.code for note in found.notes] == [Code.START_MATTERS]
    assert own.moments([-0.5]).notes == ()


def test_phases_that_noise_turns_round_have_no_cones():
    """|ξ| > 1 makes A a rotation; Gaussian noise is not bounded."""
    assert not solver(SADDLE, SineWiener(amplitude=1.1, sigma=1.0)).problem.has_cones
    assert solver(SADDLE, SineWiener(amplitude=0.9, sigma=1.0)).problem.has_cones
    assert not solver(SADDLE, OrnsteinUhlenbeck(alpha=1.0, sigma=0.1)).problem.has_cones
