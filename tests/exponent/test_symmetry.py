"""Identities of Λ(p) without walls: a mirror at p = −1, and Λ(−2) as the growth of E 1/det of the flow."""

import numpy as np
import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, MarkovChain, SineWiener, White

NOISES = {
    "OU": OrnsteinUhlenbeck(alpha=1.0, sigma=0.8),
    "Eq. (7)": NonGaussianNoise(D0=0.3, tau0=0.8, r0=0.7),
    "sine-Wiener": SineWiener(0.7, 1.0),
    "telegraph": MarkovChain.telegraph(0.5, 1.0),
    "cycle": MarkovChain((-0.6, 0.1, 0.7), ((0.0, 1.0, 0.2), (0.5, 0.0, 1.5), (0.1, 1.5, 0.0))),
    "white": White(0.7),
}
"""The cycle is out of detailed balance: to go round one way is likelier."""


def problem(noise, trace):
    """Random matrices whose order 0 rotates; the noise's has a trace."""
    rng = np.random.default_rng([1, 3])
    free = np.array([[0.0, 1.0], [-1.0, 0.0]]) + 0.3 * rng.standard_normal((2, 2))
    driven = rng.standard_normal((2, 2))
    driven += 0.5 * (trace - np.trace(driven)) * np.eye(2)
    terms = CoefficientMatrix(0, free.tolist()), CoefficientMatrix(1, driven.tolist(), identity)
    return Problem(PlaneSystem(terms), noise), float(np.trace(free))


def values(problem, p):
    found = ExponentSolver(problem, rtol=1e-7).moments(p)
    assert not found.failures
    return found.value, found.error_estimate


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_mirror(noise):
    """Λ(p) − ½p tr A is even about p = −1 where tr A is constant, whether paths have the same law backwards or not.

    For a flow M of det M = 1 ∫|Me|^(−2−p) dφ = ∫|M⁻¹e|^p dφ over all directions, and ‖M⁻¹‖ = ‖M‖.
    """
    own, trace = problem(noise, 0.0)
    p = np.array([0.5, 1.0, 2.5])
    right, left = (values(own, each) for each in (p, -2 - p))
    difference = right[0] - 0.5 * trace * p - (left[0] + 0.5 * trace * (2 + p))
    assert np.all(np.abs(difference) <= right[1] + left[1] + 1e-13)


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_determinant(noise):
    """Λ(−2) is the growth rate of E exp(−∫tr A dt): for Gaussian noise ½ tr₁² S(0) − tr₀, for chains an eigenvalue."""
    own, trace = problem(noise, 0.4)
    found, error = values(own, [-2.0])
    if noise in (NOISES["OU"], NOISES["white"]):
        expected = 0.5 * 0.4**2 * noise.spectral_density(0.0) - trace
    elif noise.has_states:
        rates = np.array(noise.rates) - np.diag(trace + 0.4 * np.array(noise.states))
        expected = np.max(np.linalg.eigvals(rates).real)
    else:
        turn = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0)))  # ‖x‖ of x′ = (J − ½ tr₁ξ) x is exp(−½∫tr₁ξ dt)
        scalar = PlaneSystem([turn, CoefficientMatrix(1, ((-0.2, 0.0), (0.0, -0.2)), identity)])
        expected = values(Problem(scalar, noise), [2.0])[0][0] - trace
    assert abs(found[0] - expected) <= error[0] + 1e-9
