"""Λ′(p) lies within its stated error of differences of Λ, also where a space has T, and so Λ, to the last digit."""

import numpy as np
import pytest

from fpsolve import ExponentSolver, MomentLyapunovFunction, OrnsteinUhlenbeck, PlaneSystem, Problem, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Filter, LinearSystem, SineWiener, Telegraph, White
from tests.exponent.test_rightmost import DRIVEN, LAW, SADDLE

OSCILLATOR = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.2*v - xi*x"), {})
DAMPED = ((-1.5612, -0.6549, -0.6816), (0.8191, 0.4922, -0.262), (-0.3801, -0.9241, -1.4047))
MOVED = ((0.2466, 0.2531, 0.2606), (-0.0608, -0.1893, 0.7478), (0.3586, -0.1471, -0.1528))
THREE = Problem(LinearSystem((CoefficientMatrix(0, DAMPED), CoefficientMatrix(0, MOVED, identity))), White(s=1.0))
FILTERED = Problem(
    PlaneSystem([CoefficientMatrix(0, SADDLE), CoefficientMatrix(0, DRIVEN, identity)]),
    Filter(**dict(zip(("omega", "zeta", "s", "c0", "c1"), LAW, strict=True))),
)


def differences(problem, p, h, rtol):
    """Λ′ to the order h⁴, and what the errors of Λ change in it at most."""
    solver = ExponentSolver(problem, rtol=rtol)
    found = {k: solver.solution(p + k * h) for k in (-2, -1, 1, 2)}
    value = {k: each.pair.value for k, each in found.items()}
    slope = (8 * (value[1] - value[-1]) - (value[2] - value[-2])) / (12 * h)
    return slope, 1.5 * max(each.error for each in found.values()) / h


@pytest.mark.parametrize(
    "noise", [OrnsteinUhlenbeck(1.0, 1.0), White(s=0.5), SineWiener(3.0, 0.6), Telegraph(3.0, 1.0)]
)
@pytest.mark.parametrize("p", [-2.0, 1.0])
def test_slopes_of_an_oscillator(noise, p):
    found = moment_lyapunov(problem := Problem(OSCILLATOR, noise), p)
    slope, rounding = differences(problem, p, 0.02, 1e-9)
    assert found.derivative[0] == pytest.approx(slope, abs=1.5 * found.derivative_error[0] + rounding + 1e-7)


@pytest.mark.slow
def test_slopes_at_even_moments_of_three_variables():
    """Harmonics of degree 2 have a slope of 0.516; differences of Λ(2 ± 0.3) and Λ(2 ± 0.6) to 1e-6 say 0.5640."""
    found = moment_lyapunov(THREE, 2.0)
    assert found.derivative[0] == pytest.approx(0.5640, abs=1.5 * found.derivative_error[0] + 5e-5)
    assert found.derivative_error[0] < 3e-3


@pytest.mark.slow
def test_slopes_at_even_moments_under_a_filter():
    """0.39266, where the space that has Λ(2) has a slope of 0.3924: no reason to refuse Λ(2)."""
    found = moment_lyapunov(FILTERED, 2.0)
    slope, rounding = differences(FILTERED, 2.0, 0.1, 1e-6)
    assert rounding < 1e-4
    assert found.value[0] == pytest.approx(0.78527655968609, abs=1.5 * found.error_estimate[0])
    assert found.derivative[0] == pytest.approx(slope, abs=1.5 * found.derivative_error[0] + rounding)


def test_slopes_of_an_interpolant():
    problem = Problem(OSCILLATOR, OrnsteinUhlenbeck(1.0, 0.3))
    function = MomentLyapunovFunction(problem, (-1.5, 3.0))
    p = np.linspace(-1.5, 3.0, 7)
    slopes = np.array([ExponentSolver(problem, rtol=1e-10).solution(each).pair.derivative for each in p])
    assert np.all(np.abs(function.derivative(p) - slopes) <= function.derivative_error(p))
    assert np.max(function.derivative_error(p)) < 1e-3
