"""Λ(p) as a curve over p: against an independent code and single solves, its errors, its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    MomentLyapunovFunction,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
)
from fpsolve.errors import NotConverged
from fpsolve.exponent.curve import Node, polynomial, values
from fpsolve.exponent.eigen import principal_pair
from fpsolve.model import Bounded, ParametricOscillator, SineWiener, Telegraph, White
from tests import random_planar
from tests.benchmarks.problem import CASES
from tests.benchmarks.references import REFERENCES
from tests.conftest import sampled
from tests.random_problems import RTOL, problems


@pytest.fixture(scope="module")
def strong():
    case = CASES["strong"]
    return MomentLyapunovFunction(Problem(case.oscillator, case.noise), (-3.0, 3.0), rtol=case.rtol)


def exact(function, error=1e-12):
    """Solves of Λ(p)/p, with p that are asked for, and no more of these than 17."""
    asked = []

    def solve(p):
        asked.append(p)
        return Node(float(function(p)), error, float(function(p)))

    return solve, asked


@pytest.mark.parametrize(("low", "high"), [(-3.0, 2.0), (-1.0, 0.0), (-1.0, -1e-5), (1.0, 5.0)])
def test_a_polynomial_of_few_degrees_is_exact(low, high):
    solve, asked = exact(lambda p: 1 + p - 0.3 * p**3)
    curve = polynomial(solve, low, high, lambda p: 1e-9)
    assert len(asked) == 9
    assert (0.0 in asked) == (low <= 0 and abs(high) < 1e-3)
    p = np.linspace(low, high, 31)
    found = values([curve], p)
    np.testing.assert_allclose(found.value, p + p**2 - 0.3 * p**4, atol=1e-13)
    np.testing.assert_allclose(found.derivative, 1 + 2 * p - 1.2 * p**3, atol=1e-11)
    np.testing.assert_allclose(found.second, 2 - 3.6 * p**2, atol=1e-9)
    assert np.all(found.error <= 1e-9 * np.abs(p))


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 1.0])
@pytest.mark.parametrize("corner", [-0.83, -0.4, 0.07, 0.31, 0.77])
def test_no_corner_is_passed_over(size, corner):
    """Of a convex function, however small: it is refused, or its error covers it."""
    solve, _ = exact(lambda p: np.exp(0.1 * p) + size * max(p - corner, 0.0))
    curve = polynomial(solve, -1.0, 1.0, lambda p: 1e-8)
    assert curve if size < 1e-8 else curve is None or size < 1e-5
    if curve:
        p = np.linspace(-1, 1, 501)
        right = p * (np.exp(0.1 * p) + size * np.maximum(p - corner, 0.0))
        assert np.all(np.abs(values([curve], p).value - right) <= values([curve], p).error + 1e-15)


@pytest.mark.slow
def test_strong_noise_against_a_fourier_hermite_code(strong):
    """No polynomial over p converges here: there are branch points beside the real axis."""
    case, truth = CASES["strong"], REFERENCES["strong"]
    errors = np.abs(strong(case.p) - truth)
    assert np.all(errors <= strong.error_estimate(case.p) + 1e-9)
    assert case.relative_error(strong(case.p), truth) <= case.rtol


@pytest.mark.slow
def test_slopes_and_curvatures_are_those_of_eigenvectors(strong):
    solver = ExponentSolver(strong.solver.problem, rtol=1e-8)
    for p in (-2.1, 0.3, 1.7):
        pair, step = solver.pair(p), 1e-3
        above, below = (principal_pair(pair.generator, p + way, start=pair).derivative for way in (step, -step))
        assert abs(strong.derivative(p) - pair.derivative) <= strong.derivative_error(p)
        assert strong.second_derivative(p) == pytest.approx((above - below) / (2 * step), rel=1e-2)


def unit_oscillator(c1):
    return VibroImpactOscillator(omega=1.0, restitution=1.0, c1=c1, epsilon=1.0)


BETWEEN = {
    "rtol 3e-4": (lambda: Problem(unit_oscillator(-0.14), OrnsteinUhlenbeck(1.0, 1.0)), (-2.5, 4.0), 3e-4, (0.25, 1.5)),
    "planar 8": (lambda: random_planar.drawn(8).problem, (-1.377060628, 5.592281396), 1e-4, (4.285529766891782,)),
    "drawn 186": (lambda: problems(187)[186].solved, (-3.0, 6.0), RTOL, (4.75, 4.84, 4.875)),
}
"""Curves that were off between nodes by up to 110 stated errors."""


@pytest.mark.parametrize("name", BETWEEN)
def test_between_the_nodes_of_hard_curves(name):
    make, interval, rtol, p = BETWEEN[name]
    problem = make()
    function, single = MomentLyapunovFunction(problem, interval, rtol=rtol), ExponentSolver(problem, rtol=0.01 * rtol)
    for each in p:
        solution = single.solution(each)
        assert abs(function(each) - solution.pair.value) <= function.error_estimate(each) + solution.error


@pytest.mark.slow
def test_a_range_that_ends_just_beyond_the_corner_of_a_saddle():
    """x′ = 0.5x + ξv, v′ = −0.5v + ξx: inner points alone accepted a polynomial that was 0.10 off at its end."""
    system = PlaneSystem.of_equations(("x", "v"), ("0.5*x + xi*v", "-0.5*v + xi*x"), {})
    problem, p = Problem(system, White(s=0.1)), np.linspace(-1.1, 6.0, 73)  # without −1, where T is a mixture
    found, single = moment_lyapunov(problem, p), ExponentSolver(problem)
    assert abs(found.value[0] + 0.454458439307) <= found.error_estimate[0] + 1e-12
    for i in range(0, 73, 8):
        solution = single.solution(float(p[i]))
        assert abs(found.value[i] - solution.pair.value) <= found.error_estimate[i] + solution.error


@pytest.mark.parametrize("high", [-1e-4, -0.02])
def test_slow_states_and_a_range_that_ends_just_below_zero(high):
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v - xi*x"), {})
    problem, p = Problem(system, Telegraph(a=0.3, k=0.05)), np.linspace(-0.6, high, 40)
    found, single = moment_lyapunov(problem, p), ExponentSolver(problem)
    for i in (0, 20, 37, 39):
        estimate = single.estimate(float(p[i]), single.solution(float(p[i])))
        assert abs(found.value[i] - estimate.value) <= found.error_estimate[i] + estimate.error_estimate


@pytest.mark.parametrize("number", sampled(*range(0, 40, 5), keep=2))
def test_random_problems_between_the_nodes(number):
    *_, drawn = problems(number + 1)
    problem, p = drawn.solved, np.array([-2.63, -1.4, -0.07, 0.61, 1.9, 2.87])
    function = MomentLyapunovFunction(problem, (-3.0, 3.0), rtol=RTOL)
    single = ExponentSolver(problem, rtol=0.01 * RTOL)
    for each, value, error in zip(p.tolist(), function(p), function.error_estimate(p), strict=True):
        solution = single.solution(each)
        assert abs(value - solution.pair.value) <= error + solution.error
        assert error <= RTOL * max(abs(value), function.solver.scale(each))


@pytest.mark.parametrize("noise", [Bounded(0.6, 1.3, 0.4), SineWiener(0.6, 1.1)], ids=repr)
def test_bounded_noise_between_the_nodes(noise):
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.2*v - xi*x"), {})
    problem = Problem(system, noise)
    function, single = MomentLyapunovFunction(problem, (-1.5, 3.5)), ExponentSolver(problem, rtol=1e-10)
    for p in (-1.21, 0.43, 2.9):
        solution = single.solution(p)
        assert abs(function(p) - solution.pair.value) <= function.error_estimate(p) + solution.error


@pytest.mark.slow
def test_near_zero_the_error_is_that_of_the_ratio(strong):
    """Λ(p)/p near p = 0 is λ."""
    exponent = ExponentSolver(strong.solver.problem, rtol=1e-9).lyapunov_exponent()
    for p in (1e-7, -1e-5, 1e-4):
        curvature = 0.5 * abs(p) * strong.second_derivative(0.0)
        allowed = strong.error_estimate(p) / abs(p) + curvature + exponent.error_estimate
        assert abs(strong(p) / p - exponent.value) <= 1.01 * allowed
    assert strong(0.0) == strong.error_estimate(0.0) == 0.0


@pytest.mark.parametrize("noise", [White(s=0.2), Telegraph(a=0.5, k=1.0)], ids=["layers", "cones"])
def test_a_saddle_has_a_corner(noise):
    """Λ(−2 − p) = Λ(p) + 2b(1 + p), as time reversed is v reversed; two eigenvalues meet at p = −1, or nearly do."""
    damping, p = 0.05, np.linspace(-2.0, 0.0, 12)
    found = moment_lyapunov(Problem(ParametricOscillator(stiffness=-1.5, damping=damping), noise), p, rtol=1e-6)
    of_mirror = found.value[::-1] + 2 * damping * (1 + p[::-1])
    assert np.all(np.abs(found.value - of_mirror) <= found.error_estimate + found.error_estimate[::-1])
    assert found.value[0] == pytest.approx(2 * damping, abs=found.error_estimate[0] + 1e-15)


@pytest.mark.parametrize("rtol", sampled(1e-5, 1e-8))
def test_at_the_corner(rtol):
    """Fourier series of 281 functions, eigenvalues of 48 digits."""
    problem = Problem(ParametricOscillator(stiffness=-1.5, damping=0.05), White(s=0.2))
    found = moment_lyapunov(problem, -1.0, rtol=rtol)
    assert abs(found.value[0] + 1.1690259121064) <= found.error_estimate[0]
    assert found.derivative_error[0] > 2.2  # from −1.22 to 1.12


@pytest.mark.slow
def test_at_a_corner_that_is_hardly_round():
    """Λ(−1) lies below the chord of its neighbours and above their tangents, and no slope there refuses it."""
    problem = Problem(ParametricOscillator(stiffness=-1.5, damping=0.05), Telegraph(a=0.5, k=1.0))
    found, step = moment_lyapunov(problem, -1.0), 1e-3
    sides = [moment_lyapunov(problem, -1.0 + side * step) for side in (-1, 1)]
    chord = float(np.mean([side.value[0] for side in sides]))
    tangent = max(
        float(side.value[0] - way * step * side.derivative[0]) for side, way in zip(sides, (-1, 1), strict=True)
    )
    assert tangent - found.error_estimate[0] <= found.value[0] <= chord + found.error_estimate[0]
    assert found.error_estimate[0] < 1e-4


def test_there_is_no_function_of_several_blocks():
    system = PlaneSystem.of_equations(("x", "v"), ("-x + 0.3*xi*x", "v*(-0.5 + xi)"), {})
    with pytest.raises(NotConverged, match=r"there is no function Λ\(p\) from p = 0\.5 to p = 3.*; ask for single p"):
        MomentLyapunovFunction(Problem(system, SineWiener(0.6, 1.1)), (0.5, 3.0))


def test_in_the_weakest_noise_few_p_are_solved_one_by_one():
    problem = Problem(replace(CASES["weak"].oscillator, epsilon=1e-4), CASES["weak"].noise)
    found = moment_lyapunov(problem, np.linspace(-2.0, 6.0, 12))
    assert not found.curves
    assert not found.warnings


@pytest.mark.parametrize("p", [1.04268799533869, 2.4876484873472053])
def test_rounding_of_white_growth_is_in_the_error(p):
    """Λ(p) = ½p(p − 1)s² of v̇ = −v Ẇ, Itô: the parts with p² and with p cancel beside p = 1."""
    problem = random_planar.drawn(13).problem
    found = moment_lyapunov(problem, p)
    assert abs(found.value[0] - 0.5 * p * (p - 1) * problem.noise.s**2) <= found.error_estimate[0] < 2e-15 * 5e3
