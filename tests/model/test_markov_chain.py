"""Noise that jumps: its stationary law and its spectrum, in closed form and by simulation of its correlation."""

import math

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain

RING = MarkovChain((0.0, 1.0, 3.0), ((0, 2.0, 0), (0, 0, 1.0), (0.5, 0, 0)))
"""0 → 1 → 3 → 0, which no detailed balance holds for."""


def test_telegraph():
    """C(t) = a² exp(−2kt), S(ω) = 4ka²/(4k² + ω²)."""
    a, k = 0.7, 1.9
    noise = MarkovChain.telegraph(a, k)
    assert noise.mean == pytest.approx(0, abs=1e-15)
    assert noise.standard_deviation == pytest.approx(a)
    assert noise.correlation_time == pytest.approx(1 / (2 * k))
    for omega in (0.0, 0.5, 4.0):
        assert noise.spectral_density(omega) == pytest.approx(4 * k * a**2 / (4 * k**2 + omega**2), rel=1e-13)
    assert not noise.has_algebraic_tails


def test_a_ring_is_in_a_state_as_long_as_it_takes_to_leave_it():
    times = np.array([1 / 2, 1.0, 2.0])
    np.testing.assert_allclose(RING.probabilities, times / times.sum(), rtol=1e-14)
    assert RING.mean == pytest.approx((0 * 0.5 + 1 * 1 + 3 * 2) / 3.5)


@pytest.mark.parametrize("omega", [0.0, 0.8, 3.0])
def test_the_spectrum_is_that_of_the_correlation(omega):
    deviations, weights = np.array(RING.states) - RING.mean, RING.probabilities
    t = np.linspace(0, 60, 12001)
    step = scipy.linalg.expm(np.array(RING.rates) * (t[1] - t[0]))
    correlation, vector = [], deviations
    for _ in t:
        correlation.append((weights * deviations) @ vector)
        vector = step @ vector
    spectrum = 2 * scipy.integrate.trapezoid(np.array(correlation) * np.cos(omega * t), t)
    assert RING.spectral_density(omega) == pytest.approx(spectrum, abs=1e-4)


def test_rates_with_and_without_their_diagonal():
    assert MarkovChain((1, 2), ((-3, 3), (4, -4))) == MarkovChain((1, 2), ((0, 3), (4, 0)))


@pytest.mark.parametrize(
    ("states", "rates", "message"),
    [
        ((1.0,), ((0,),), "n >= 2"),
        ((1.0, 2.0), ((0, 1),), "n >= 2"),
        ((1.0, 1.0), ((0, 1), (1, 0)), "finite numbers that differ"),
        ((1.0, math.inf), ((0, 1), (1, 0)), "finite numbers that differ"),
        ((1.0, 2.0), ((0, -1), (1, 0)), "must be >= 0"),
        ((1.0, 2.0), ((-2, 1), (1, -1)), "minus the sum of its row"),
        ((1.0, 2.0), ((0, 1), (0, 0)), "every state must be reachable"),
    ],
)
def test_what_is_no_chain_is_refused(states, rates, message):
    with pytest.raises(ValueError, match=message):
        MarkovChain(states, rates)


def test_many_states_that_are_hardly_connected():
    """Two groups, and one way there and back: the numbers of all ways are beyond floats."""
    rates = np.kron(np.eye(2), np.ones((120, 120)))
    rates[119, 120] = rates[120, 119] = 1e-3
    np.fill_diagonal(rates, 0.0)
    MarkovChain(states=np.linspace(-1, 1, 240), rates=rates)
    rates[119, 120] = 0.0
    with pytest.raises(ValueError, match="every state must be reachable"):
        MarkovChain(states=np.linspace(-1, 1, 240), rates=rates)


@pytest.mark.parametrize("size", [20, 42, 100])
def test_every_state_beside_another_noise_is_looked_at(size):
    """A noise that moves the phase across a wall in its last state alone is refused."""
    states = np.linspace(-1.0, 1.0, size)
    chain = MarkovChain(states, np.eye(size, k=1) + np.eye(size, k=-1))
    terms = [
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))),
        CoefficientMatrix(1, ((0.0, 0.3), (0.0, 0.0)), lambda xi: np.maximum(xi - states[-2], 0.0), "a"),
        CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity, "b"),
    ]
    with pytest.raises(ValueError, match='the noise "a" moves the phase across the ray of a jump'):
        Problem(PlaneSystem(terms, [Jump(math.pi / 2, -0.2)]), {"a": chain, "b": OrnsteinUhlenbeck(1.0, 0.5)})
