"""Identities without walls: Λ(p) about p = −1, and Λ(−2), for any matrices under every kind of noise.

Where the law of the noise is the same backwards and the trace of A is constant, Λ(p) − ½p tr A is even about p = −1, as
the paths run backwards belong to −A with the determinant inverted. Λ(−2) is the growth rate of E exp(−∫tr A dt).
"""

import math

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, MarkovChain, SineWiener, Telegraph, White
from tests.conftest import sampled

REVERSIBLE = MarkovChain((-1.0, 0.3, 0.8), ((0, 0.5, 1.0), (1.0, 0, 0.4), (1.0, 0.2, 0)))
"""In detailed balance with the probabilities 0.4, 0.2, 0.4."""
NOISES = [
    White(s=0.8),
    Telegraph(a=0.7, k=0.6),
    REVERSIBLE,
    OrnsteinUhlenbeck(alpha=0.9, sigma=0.8),
    SineWiener(amplitude=0.9, sigma=1.1),
]


def system(rng, traces):
    """Random matrices of order 0, which rotates, and 1 with these traces."""
    steady, driven = rng.uniform(-0.8, 0.8, (2, 2, 2))
    steady += np.array([[0, 1.2], [-1.2, 0]])
    for matrix, trace in zip((steady, driven), traces, strict=True):
        matrix += 0.5 * (trace - np.trace(matrix)) * np.eye(2)
    return PlaneSystem([CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity)])


@pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.kind)
@pytest.mark.parametrize("seed", sampled(*range(4), keep=1))
def test_it_is_even_about_minus_one(noise, seed):
    trace = -0.3
    solver = ExponentSolver(Problem(system(np.random.default_rng(seed), (trace, 0.0)), noise), rtol=1e-10)
    for q in (0.6, 2.5):
        one, other = (solver.solution(-1 + each) for each in (q, -q))
        gap = one.pair.value - other.pair.value - q * trace
        assert abs(gap) <= one.error + other.error + 1e-10 * solver.scale(q + 1)


def cumulant(noise, steady, driven):
    """The growth rate of E exp(−∫tr A dt)."""
    if noise.kind == "sine-wiener":  # cos kθ, between which cos θ shifts
        k = np.arange(40)
        shift = np.diag(np.ones(39), 1) + np.diag(np.ones(39), -1)
        shift[0, 1] = shift[1, 0] = math.sqrt(2)
        operator = np.diag(-0.5 * noise.sigma**2 * k**2) - 0.5 * driven * noise.amplitude * shift
        return -steady + np.linalg.eigvalsh(operator)[-1]
    if noise.kind in ("telegraph", "markov-chain"):
        return -steady + np.linalg.eigvals(np.array(noise.rates) - driven * np.diag(noise.states)).real.max()
    return -steady + 0.5 * driven**2 * noise.spectral_density(0.0)


@pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.kind)
@pytest.mark.parametrize("seed", sampled(*range(4), keep=1))
def test_the_moment_of_order_minus_two_is_that_of_the_area(noise, seed):
    traces = 0.2, -0.7
    solver = ExponentSolver(Problem(system(np.random.default_rng(seed), traces), noise), rtol=1e-10)
    found = solver.solution(-2.0)
    assert abs(found.pair.value - cumulant(noise, *traces)) <= found.error + 1e-10 * solver.scale(2.0)
