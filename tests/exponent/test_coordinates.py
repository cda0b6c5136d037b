"""Λ(p) does not depend on the coordinates in which a system is given, nor on the units."""

import math

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, ParametricOscillator, Problem, Telegraph, White
from tests.oracles import moment_hierarchy


def assert_right(problem, p, right, digits):
    """Λ(p) is within one and a half of its error, which is small."""
    found = moment_lyapunov(problem, p)
    value, error = found.value[0], found.error_estimate[0]
    assert error <= digits * max(abs(right), found.solver.scale(p))
    assert abs(value - right) <= 1.5 * error


@pytest.mark.parametrize(
    ("stiffness", "damping", "s", "p", "right"),
    [
        (900.0, 35.0, 600.0, 8.0, 383.117962647),
        (25e4, 1000.0, 1e5, 3.0, 2431.057834),
        (25e4, 1000.0, 1e5, 2.0, 1080.85946039),
        (0.2847996839106912, 1.033337807595426 / 2, 90.70639802418872, 12.0, 315.515562463),
        (0.0, 0.0, 1e6, 2.0, (2 * 1e12) ** (1 / 3)),  # E x², E xv, E v²: Λ³ = 2 s²
        (-1e4, 10.0, 1e3, 2.0, 202.257861168),
    ],
)
def test_white_noise_that_is_not_beside_a_rotation(stiffness, damping, s, p, right):
    problem = Problem(ParametricOscillator(stiffness, damping), White(s))
    assert_right(problem, p, right, 1e-8)
    free = ((0.0, 1.0), (-stiffness, -2 * damping))
    if p % 2 == 0:
        moments = moment_hierarchy.white_noise_exponent(free, [((0.0, 0.0), (-s, 0.0))], int(p))
        assert moments == pytest.approx(right, rel=1e-8)
    value, error = ExponentSolver(problem).ratio_alone(0.0)
    assert error <= 1e-6 * abs(value)


@pytest.mark.parametrize("seed", range(12))
def test_white_noise_in_any_coordinates(seed):
    rng = np.random.default_rng(seed)
    drift, noise = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)) * 10 ** rng.uniform(-1.5, 2)
    right = moment_hierarchy.white_noise_exponent(drift, [noise], 4)
    basis, rate = np.diag([1.0, 10 ** rng.uniform(-7, 7)]) @ rng.normal(size=(2, 2)), 10 ** rng.uniform(-9, 12)
    inverse = np.linalg.inv(basis)
    terms = [
        CoefficientMatrix(0, rate * basis @ drift @ inverse),
        CoefficientMatrix(1, math.sqrt(rate) * basis @ noise @ inverse, identity),
    ]
    assert_right(Problem(PlaneSystem(terms), White(1.0)), 4.0, rate * right, 1e-8)


@pytest.mark.parametrize("noise", [Telegraph(a=1.0, k=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)])
def test_overdamped_systems_in_fast_units(noise):
    """ẍ + 2bẋ + (k + ξ)x = 0 in units in which the noise is slow, in which it is of order 1, and in faster ones."""
    found = []
    for rate in (1e-3, 1.0, 30.0, 1e3, 1e6):
        if isinstance(noise, Telegraph):
            scaled = Telegraph(a=0.8 * rate**2, k=rate)
        else:
            scaled = OrnsteinUhlenbeck(alpha=rate, sigma=0.8 * rate**2.5)
        problem = Problem(ParametricOscillator(0.9 * rate**2, 10.0 * rate), scaled)
        found.append((moment_lyapunov(problem, [1.0, 2.0]), rate))
    first, _ = found[1]
    for each, rate in found:
        error = each.error_estimate / rate + first.error_estimate
        np.testing.assert_array_less(np.abs(each.value / rate - first.value), 1.5 * error)
        np.testing.assert_array_less(error, 1e-5)
