"""Λ(p) by a reduced basis: against an independent code and solves, its errors, its derivatives, its spaces."""

from dataclasses import replace

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    MomentLyapunovFunction,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
)
from fpsolve.errors import NotConverged
from fpsolve.exponent.basis import Basis, Polynomials
from fpsolve.exponent.eigen import principal_pair
from fpsolve.model import Bounded, ParametricOscillator, SineWiener, Telegraph, White
from tests import random_planar
from tests.benchmarks.problem import CASES
from tests.benchmarks.references import REFERENCES
from tests.random_problems import RTOL, problems


@pytest.fixture(scope="module")
def strong():
    case = CASES["strong"]
    return MomentLyapunovFunction(Problem(case.oscillator, case.noise), (-3.0, 3.0), rtol=case.rtol)


@pytest.mark.parametrize(("low", "high"), [(-3.0, 2.0), (-1.0, 0.0), (0.0, 4.0), (1.0, 5.0)])
def test_polynomials_of_their_degree_are_exact(low, high):
    polynomials = Polynomials(low, high, 6)
    assert (0.0 in polynomials.points) == (low <= 0 <= high)
    p = np.linspace(low, high, 31)
    values = polynomials.points**6 - 2 * polynomials.points**3
    np.testing.assert_allclose(polynomials.at(p) @ values, p**6 - 2 * p**3, atol=1e-9)
    np.testing.assert_allclose(polynomials.at(p) @ polynomials.slopes @ values, 6 * p**5 - 6 * p**2, atol=1e-8)


def test_few_solves_in_strong_noise_against_a_fourier_hermite_code(strong):
    """An interpolation over p does not converge here: there are branch points beside the real axis."""
    case, truth = CASES["strong"], REFERENCES["strong"]
    assert strong.is_converged
    assert strong.nodes.size <= 15
    errors = np.abs(strong(case.p) - truth)
    assert np.all(errors <= strong.error_estimate(case.p) + 1e-9)
    assert case.relative_error(strong(case.p), truth) <= case.rtol


@pytest.mark.slow
def test_the_error_falls_with_the_fourth_power_of_the_distance_of_the_nodes():
    case = CASES["strong"]
    problem = Problem(case.oscillator, case.noise)
    p, lefts = np.linspace(0.5, 2.5, 41), []
    solver = ExponentSolver(problem, rtol=1e-9)
    exact = Basis(solver, 0.5, 2.5, 40)
    for most in (3, 5):
        few = Basis(ExponentSolver(problem, rtol=1e-9), 0.5, 2.5, most)
        lefts.append(np.max(np.abs(few.at(p).value - exact.at(p).value)))
        assert not few.is_converged
    assert lefts[1] < 2**-4 * lefts[0]


def test_slopes_and_curvatures_are_those_of_eigenvectors(strong):
    solver = ExponentSolver(strong.solver.problem, rtol=1e-8)
    for p in (-2.1, 0.3, 1.7):
        pair, step = solver.pair(p), 1e-3
        above, below = (principal_pair(pair.generator, p + way, start=pair).derivative for way in (step, -step))
        assert abs(strong.derivative(p) - pair.derivative) <= strong.derivative_error(p)
        assert strong.second_derivative(p) == pytest.approx((above - below) / (2 * step), rel=1e-4)


@pytest.mark.parametrize("number", range(0, 40, 5))
def test_random_problems_between_the_nodes(number):
    *_, drawn = problems(number + 1)
    problem, p = drawn.solved, np.array([-2.63, -1.4, -0.07, 0.61, 1.9, 2.87])
    function = MomentLyapunovFunction(problem, (-3.0, 3.0), rtol=RTOL)
    exact = ExponentSolver(problem, rtol=0.01 * RTOL)
    for each, value, error in zip(p.tolist(), function(p), function.error_estimate(p), strict=True):
        solution = exact.solution(each)
        assert abs(value - solution.pair.value) <= error + solution.error
        assert error <= RTOL * max(abs(value), function.solver.scale(each))


def test_where_an_eigenvalue_of_the_small_pencil_alone_passes():
    """Next to p = 4.84, where the basis has an eigenvalue that L has not, its error is 100 times that beside."""
    *_, drawn = problems(187)
    function = MomentLyapunovFunction(drawn.solved, (-3.0, 6.0), rtol=RTOL)
    exact = ExponentSolver(drawn.solved, rtol=0.01 * RTOL)
    for p in (4.75, 4.82, 4.84, 4.875):
        solution = exact.solution(p)
        assert abs(function(p) - solution.pair.value) <= function.error_estimate(p) + solution.error


def test_beside_a_node_of_another_space_something_is_left():
    """T at p = 0.884 is carried from a smaller space: what is left does not fall to 0 there."""
    noise = NonGaussianNoise(D0=0.4767069628987092, tau0=1.8373750078619977, r0=1.0).ou_reduction()
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.887332067461866, c1=0.0, epsilon=1.0)
    problem = Problem(oscillator, noise)
    function, exact = MomentLyapunovFunction(problem, (-2.5, 4.0), rtol=1e-5), ExponentSolver(problem, rtol=1e-10)
    for p in (0.875, 0.893, 0.9):
        solution = exact.solution(p)
        assert abs(function(p) - solution.pair.value) <= function.error_estimate(p) + solution.error


@pytest.mark.parametrize("noise", [Bounded(0.6, 1.3, 0.4), SineWiener(0.6, 1.1)], ids=repr)
def test_bounded_noise_between_the_nodes(noise):
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.2*v - xi*x"), {})
    problem = Problem(system, noise)
    function, exact = MomentLyapunovFunction(problem, (-1.5, 3.5)), ExponentSolver(problem, rtol=1e-10)
    for p in (-1.21, 0.43, 2.9):
        solution = exact.solution(p)
        assert abs(function(p) - solution.pair.value) <= function.error_estimate(p) + solution.error


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


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_at_the_corner(rtol):
    """Fourier series of 281 functions, eigenvalues of 48 digits."""
    problem = Problem(ParametricOscillator(stiffness=-1.5, damping=0.05), White(s=0.2))
    found = moment_lyapunov(problem, -1.0, rtol=rtol)
    assert abs(found.value[0] + 1.1690259121064) <= found.error_estimate[0]
    assert found.derivative_error[0] > 2.2  # from −1.22 to 1.12


def test_what_to_ask_where_the_eigenfunctions_at_the_corner_are_mixed():
    problem = Problem(ParametricOscillator(stiffness=-1.5, damping=0.05), Telegraph(a=0.5, k=1.0))
    with pytest.raises(NotConverged, match=r"ask for p = -0\.99 and p = -1\.01 instead"):
        moment_lyapunov(problem, -1.0)


def test_there_is_no_function_of_several_blocks():
    system = PlaneSystem.of_equations(("x", "v"), ("-x + 0.3*xi*x", "v*(-0.5 + xi)"), {})
    with pytest.raises(NotConverged, match=r"there is no function Λ\(p\) from p = 0\.5 to p = 3.*; ask for single p"):
        MomentLyapunovFunction(Problem(system, SineWiener(0.6, 1.1)), (0.5, 3.0))


def test_in_the_weakest_noise_each_p_is_solved_as_a_basis_rounds_more():
    problem = Problem(replace(CASES["weak"].oscillator, epsilon=1e-4), CASES["weak"].noise)
    found = moment_lyapunov(problem, np.linspace(-2.0, 6.0, 12))
    assert found.function is None
    assert not found.warnings


def test_nodes_added_elsewhere_may_leave_more_between_others():
    """A gap that was resolved with fewer nodes is looked at again."""
    system = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=-0.14, epsilon=1.0)
    problem = Problem(system, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0))
    function = MomentLyapunovFunction(problem, (-2.5, 4.0), rtol=3e-4)
    for p in (0.25, 1.5):
        single = ExponentSolver(problem, rtol=1e-7).solution(p)
        assert abs(function(p) - single.pair.value) <= function.error_estimate(p) + single.error


def test_what_is_left_between_nodes_is_told_where_parts_of_it_cancel_at_the_next_node():
    """There the inverse at this node alone says a twentieth."""
    problem, p = random_planar.drawn(8).problem, 4.285529766891782
    function = MomentLyapunovFunction(problem, (-1.3770606280419302, 5.59228139649187), rtol=1e-4)
    single = ExponentSolver(problem, rtol=1e-8).solution(p)
    assert abs(function(p) - single.pair.value) <= function.error_estimate(p) + single.error


@pytest.mark.parametrize("p", [1.04268799533869, 2.4876484873472053])
def test_rounding_of_white_growth_is_in_the_error(p):
    """Λ(p) = ½p(p − 1)s² of v̇ = −v Ẇ, Itô: the parts with p² and with p cancel beside p = 1."""
    problem = random_planar.drawn(13).problem
    found = moment_lyapunov(problem, p)
    assert abs(found.value[0] - 0.5 * p * (p - 1) * problem.noise.s**2) <= found.error_estimate[0] < 2e-15 * 5e3


@pytest.mark.parametrize("p", [3.75, 3.82])
def test_what_is_left_aside_of_the_middle_of_a_gap_is_seen(p):
    """Another eigenvalue of the small pencil passed at 3.82: off by 110 times the error by the middle alone."""
    system = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=1.0)
    problem = Problem(system, NonGaussianNoise(D0=0.2505936168136361, tau0=1.0, r0=1.0).ou_reduction())
    function = MomentLyapunovFunction(problem, (-2.5, 4.0), rtol=3e-4)
    single = ExponentSolver(problem, rtol=1e-7).solution(p)
    assert abs(function(p) - single.pair.value) <= function.error_estimate(p) + single.error
