"""Waves of the phase under a filter, against elements, a dense matrix and another code."""

import numpy as np
import pytest

from fpsolve import Problem, lyapunov_exponent
from fpsolve.arrays import identity
from fpsolve.exponent.eigen import principal_pair
from fpsolve.fem.generator import Generator
from fpsolve.fem.pairs import PairAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.fem.waves import WaveAxis
from fpsolve.model import CoefficientMatrix, Filter, LinearSystem
from fpsolve.model.plane import Harmonics

LINES = np.array([0.0, np.pi])


def oscillator(omega, zeta):
    """ẍ + 0.1ẋ + (1 + ξ)x = 0 under a filter with the standard deviation 0.3."""
    noise = Filter(omega, zeta, 0.3 / Filter(omega, zeta, 1.0).standard_deviation)
    terms = CoefficientMatrix(0, [[0, 1], [-1, -0.1]]), CoefficientMatrix(1, [[0, 0], [-1, 0]], identity)
    return Problem(LinearSystem(terms), noise)


def on_waves(problem, waves, degree):
    return Generator(problem, Space((WaveAxis.of(LINES, np.array([waves])), PairAxis(problem.noise, degree))))


def test_matrices_are_those_of_the_products():
    axis, f, phi = WaveAxis.of(LINES, np.array([3])), Harmonics(0.7, 0.2, -0.4), np.linspace(0, np.pi, 400, False)
    values, step = axis.at(phi), 1e-6
    slopes = (axis.at(phi + step) - axis.at(phi - step)) / (2 * step)
    for found, trial in ((axis.mass(f), values), (axis.convection(f), slopes)):
        assert found == pytest.approx(values.T @ (f(phi)[:, None] * trial) * np.pi / 400, abs=1e-8)
    assert axis.mass() == pytest.approx(values.T @ values * np.pi / 400, abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("p", [1.0])
def test_waves_and_elements_agree(p):
    problem = oscillator(1.7, 0.3)
    elements = PhaseAxis.of(np.linspace(0, np.pi, 5), np.full(4, 12))
    other = principal_pair(Generator(problem, Space((elements, PairAxis(problem.noise, 16)))), p)
    found = principal_pair(on_waves(problem, 18, 16), p)
    assert found.value == pytest.approx(other.value, abs=1e-10)
    assert found.derivative == pytest.approx(other.derivative, abs=1e-9)


@pytest.mark.parametrize(
    ("omega", "zeta", "expected"),
    [(1.0, 0.1, -0.04512279), (2.0, 0.3, -0.032102237), (4.0, 0.05, -0.048999195)],
)
def test_filters_of_narrow_and_broad_bands(omega, zeta, expected):
    """λ by a code of its own: complex waves, and products of complex Hermite functions up to the degree 36."""
    found = lyapunov_exponent(oscillator(omega, zeta), rtol=1e-6)
    assert found.value == pytest.approx(expected, abs=found.error_estimate + 1e-8)
    assert found.error_estimate < 7e-8
