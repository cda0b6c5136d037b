"""Λ(p) next to p = 0: it is λp + ½Λ″(0)p² there, with errors that fall with p, and no p is lost."""

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
    sensitivities,
    simulate,
)
from fpsolve.arrays import identity
from fpsolve.exponent.eigen import pair_at_zero, principal_pair
from fpsolve.exponent.solver import TINY_P
from fpsolve.fem.generator import SMALL_P
from fpsolve.model import CoefficientMatrix, White
from tests.exponent.test_modes import problem, random_system
from tests.exponent.test_rate_function import SHEAR, UNIT, uniform

TINY = np.array([-2.2e-16, 1e-9, -1e-12, 5e-324, -1e-300, -1e-9, 0.0, 3e-7])
STRONG = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0), UNIT)
RAY = Problem(PlaneSystem([CoefficientMatrix(0, ((-1, 1), (0, -2))), CoefficientMatrix(1, np.eye(2), identity)]), UNIT)


@pytest.mark.parametrize(
    "system",
    [uniform(), SHEAR, STRONG, RAY, problem(White(s=1.0), *random_system(0, 3))],
    ids=["uniform", "white", "strong", "classes", "three variables"],
)
def test_all_p_next_to_zero_are_given(system):
    solver = ExponentSolver(system, rtol=system.usual_rtol)
    far = -0.1 if system.moments[0] < 0 else 0.1
    exponent, found = solver.lyapunov_exponent(), moment_lyapunov(system, np.append(TINY, far))
    assert found.p.tolist() == [*TINY, far]
    assert np.array_equal(found.value[:-1][TINY == 0], [0.0])
    bend = np.abs(TINY) * (abs(found.value[-1] - far * exponent.value) / 0.01)  # at least ½Λ″(0)
    off = np.abs(found.value[:-1] - exponent.value * TINY)
    assert np.all(off <= found.error_estimate[:-1] + np.abs(TINY) * (exponent.error_estimate + 2 * bend) + 5e-324)
    allowed = 1e-5 * max(abs(exponent.value), exponent.scale)
    assert np.all(found.error_estimate[:-1] <= np.abs(TINY) * (allowed + bend))


@pytest.mark.slow
def test_four_variables():
    system = problem(White(s=1.0))
    exponent = ExponentSolver(system, rtol=1e-3).lyapunov_exponent()
    found = moment_lyapunov(system, [-2.2e-16, 1e-9], rtol=1e-3)
    np.testing.assert_allclose(found.value, exponent.value * found.p, rtol=1e-5)


@pytest.mark.parametrize("count", [7, 25])
def test_a_range_with_a_rounded_zero(count):
    """Solved one by one, and interpolated."""
    p = np.linspace(-2, 0.4, count)
    near = np.argmin(np.abs(p))
    assert 0 < abs(p[near]) < 1e-15
    found, exact = moment_lyapunov(uniform(), p), -0.1 * p + 0.5 * p**2
    assert found.p.size == count
    assert np.all(np.abs(found.value - exact) <= found.error_estimate)
    assert found.value[near] == pytest.approx(-0.1 * p[near], rel=1e-7)


@pytest.mark.parametrize("system", [SHEAR, STRONG], ids=["white", "strong"])
def test_ratios_on_both_sides_of_the_smallest_p(system):
    """Against a polynomial through Λ(p)/p at larger p."""
    solver, x = ExponentSolver(system, rtol=1e-10), 0.3 * np.cos(np.pi * (np.arange(14) + 0.5) / 14)
    exact = np.polynomial.Chebyshev.fit(x, [solver.pair(p).value / p for p in x], 13)
    slope = exact.deriv()
    p = TINY_P * np.array([-1.001, -0.999, -0.3, 0.01, 0.999, 1.001])
    for each, (ratio, by_p, error) in zip(p, map(ExponentSolver(system).ratio, p), strict=True):
        assert abs(ratio - exact(each)) <= error
        assert by_p == pytest.approx(slope(each), rel=5e-7)


def test_sensitivities_next_to_zero_are_those_of_the_exponent():
    found = sensitivities(STRONG, [1e-9, -2.2e-16])
    for p, moments in zip(found.p, found.moments, strict=True):
        for key, exponent in found.indices["lyapunov_exponent"].items():
            doubt = moments[key].error_estimate + abs(p) * exponent.error_estimate
            assert moments[key].value == pytest.approx(p * exponent.value, rel=1e-7, abs=doubt)
            assert doubt < 1e-6 * abs(p)


def test_simulated_moments_next_to_zero():
    found = simulate(STRONG, [-2.2e-16, 1e-12, 5e-324], paths=64, time=100.0, seed=1)
    for each in found.estimates:
        assert each.value == each.p * found.lyapunov_exponent
        assert each.standard_error == abs(each.p) * found.lyapunov_exponent_error
    assert not any(message.code.name == "DRIFTING" for message in found.warnings)


@pytest.mark.parametrize(
    "system", [STRONG, problem(White(s=1.0), *random_system(0, 3))], ids=["oscillator", "three variables"]
)
def test_the_pair_at_zero_by_factors_of_a_small_p_is_that_of_a_solve(system):
    near = ExponentSolver(system, rtol=1e-5).whole.solution(SMALL_P).pair
    found, solved = pair_at_zero(near), principal_pair(near.generator, 0.0, start=near)
    assert found.derivative == pytest.approx(solved.derivative, abs=1e-12 * system.unit_rate)
    np.testing.assert_allclose(found.left, solved.left, atol=1e-9 * np.abs(solved.left).max())
    assert found.residual < 1e-13
