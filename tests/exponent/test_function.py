"""Λ as a function of p: interpolation against solves, its derivatives against the eigenvectors, roots, convexity."""

import math
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
    make_mesh,
    moment_lyapunov,
    stability_index,
)
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent import Estimate, second_derivative
from fpsolve.exponent.adapt import WholeProblem
from fpsolve.exponent.error import Absent
from fpsolve.exponent.root import nonzero_root
from fpsolve.exponent.solver import broken_convexity, solver_of
from fpsolve.messages import Code, Message
from fpsolve.model import ParametricOscillator, Telegraph, White
from tests import random_tolerances
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE, oracle_arguments, sampled
from tests.oracles import fourier_hermite, perturbation

STRONG = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
WEAK_NOISE = FIG1_NOISE.ou_reduction()


@pytest.fixture(scope="module")
def weak():
    return MomentLyapunovFunction(Problem(FIG1, WEAK_NOISE), (-2.0, 6.0))


@pytest.fixture(scope="module")
def strong():
    return MomentLyapunovFunction(Problem(STRONG, UNIT_NOISE), (-1.5, 3.0), rtol=1e-5)


@pytest.mark.parametrize("p", [-1.83, -0.4, 1.1, 3.3, 5.9])
def test_between_the_nodes_against_fourier_hermite(weak, p):
    oracle = fourier_hermite.moment_lyapunov(**oracle_arguments(FIG1, WEAK_NOISE), p=p, harmonics=10, hermite=30)
    error = abs(weak(p) - oracle)
    assert error <= 1e-8 * perturbation.moment_scale(FIG1, WEAK_NOISE, p)
    assert error <= 3 * weak.error_estimate(p) + 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("p", [-1.37, 2.71])
def test_strong_noise_between_the_nodes_against_solves(strong, p):
    exact = ExponentSolver(Problem(STRONG, UNIT_NOISE), rtol=1e-10).pair(p).value
    error, scale = abs(strong(p) - exact), perturbation.moment_scale(STRONG, UNIT_NOISE, p)
    assert error <= 1e-5 * max(abs(exact), scale)
    assert error <= 3 * strong.error_estimate(p)


def test_few_solves_make_many_points(weak):
    p = np.linspace(-2, 6, 200)
    assert weak.nodes.size <= 15
    values = weak(p)
    assert values.shape == (200,)
    assert np.all(np.diff(values, 2) > 0)
    assert weak(0.0) == 0


def curvature_error(function, p):
    """Markov's bounds on what errors of Λ(p)/p = g make of Λ″ = 2g′ + p g″, for a polynomial of degree n."""
    n, half = function.nodes.size - 1, np.ptp(function.nodes) / 2
    error = 3 * np.max(function.error_estimate(function.nodes[[0, -1]]) / np.abs(function.nodes[[0, -1]]))
    return error * (2 * n**2 / half + abs(p) * n**2 * (n**2 - 1) / 3 / half**2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["weak", "strong"])
def test_derivatives_of_the_interpolant_and_of_the_eigenvectors_agree(name, request):
    function = request.getfixturevalue(name)
    for p in function.nodes[1:-1]:
        pair = function.solver.pair(float(p))
        assert function.derivative(p) == pytest.approx(pair.derivative, rel=1e-5, abs=1e-7)
        assert function.second_derivative(p) == pytest.approx(second_derivative(pair), abs=curvature_error(function, p))


def test_exponents_at_zero_are_the_slope_and_the_curvature(weak):
    assert weak.lyapunov_exponent().value == pytest.approx(float(weak.derivative(0.0)), rel=1e-7)
    assert weak.variance_rate().value == pytest.approx(float(weak.second_derivative(0.0)), rel=1e-6)


NO_NUMBERS = [
    *("1", ["1"], True, [True, 1.0], [[True, 1.0]], np.array([True]), 1j, None, [[1], [1, 2]], np.nan),
    np.ma.array([1.0, 2.0], mask=[False, True]),
]


@pytest.mark.parametrize("p", NO_NUMBERS, ids=repr)
def test_arguments_that_are_no_numbers_are_refused(weak, p):
    for function in (weak, weak.derivative, weak.second_derivative, weak.error_estimate):
        with pytest.raises(ValueError, match=r"^p must be a finite number or an array of finite numbers, got .+$"):
            function(p)


def test_values_have_the_shape_of_the_arguments(weak):
    p = np.array([[-1.0, 0.0, 1.0], [2.0, 3.0, 4.0]])
    np.testing.assert_array_equal(weak(p.tolist()), weak(p.ravel()).reshape(2, 3))
    assert np.shape(weak(2)) == ()
    assert weak([]).shape == (0,)


def test_arguments_outside_the_interval_are_refused(weak):
    with pytest.raises(ValueError, match=r"p must lie in \[-2, 6\]"):
        weak(6.5)
    with pytest.raises(ValueError, match="its ends must increase"):
        MomentLyapunovFunction(Problem(FIG1, WEAK_NOISE), (2.0, 2.0))


def test_infinite_moments_in_the_interval_are_refused():
    with pytest.raises(NoSuchExponent, match=r"Λ\(1\) is not computed: for r0 > 1"):
        MomentLyapunovFunction(Problem(FIG1, NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.1)), (0.0, 1.0))


def test_an_interval_on_one_side_of_zero():
    function = MomentLyapunovFunction(Problem(FIG1, WEAK_NOISE), (1.0, 3.0))
    assert function.root() is None
    assert function.stability_index().value == pytest.approx(-0.3629121344, rel=1e-6)


@pytest.mark.parametrize("wrong", [0, 4321, 14_999])
def test_of_many_moments_one_that_breaks_convexity_is_found(wrong):
    p = np.linspace(-2.0, 6.0, 15_000)
    value, slope, errors = 0.3 * p**2 - 0.1 * p, 0.6 * p - 0.1, np.full(p.size, 1e-9)
    assert broken_convexity(p, value, slope, errors, lambda: errors) is None
    value[wrong] += 1e-4
    assert broken_convexity(p, value, slope, errors, lambda: errors).data["p"] in p[[max(wrong - 1, 0), wrong]]


@pytest.mark.parametrize(
    ("noise", "rate"),
    [
        (White(s=0.5), 0.0),
        (White(s=0.5, interpretation="ito"), 0.125),
        (OrnsteinUhlenbeck(alpha=1.0, sigma=0.5), 0.0),
        (Telegraph(a=0.5, k=0.5), 0.0),
    ],
)
def test_where_noise_turns_alone_there_is_no_index(noise, rate):
    """Kubo's oscillator keeps ‖x‖, which in Itô's sense grows as exp(½s²t)."""
    problem = Problem(PlaneSystem.of_equations(("x", "y"), ("-(1.3 + xi)*y", "(1.3 + xi)*x")), noise)
    for p in (-1.5, 3.0):
        found = moment_lyapunov(problem, p)
        assert abs(found.value[0] - rate * p) <= found.error_estimate[0]
    found = stability_index(problem)
    assert not found
    assert found.reason.code is Code.LINEAR
    assert found.reason.data["value"] == pytest.approx(rate, abs=1e-12)


@pytest.mark.parametrize(("seed", "expected"), sampled((10, 0.3961547429919089), (14, 0.007141316415369082)))
def test_the_error_of_the_curvature_is_no_single_change(seed, expected):
    """Λ″(0) of random problems, which at rtol = 1e-13 has these digits; one change was six times too small."""
    found = solver_of(random_tolerances.drawn(seed).problem).variance_rate()
    assert abs(found.value - expected) <= found.error_estimate < 1e-6 * expected


@pytest.mark.slow
def test_a_wrong_eigenvalue_breaks_convexity(monkeypatch):
    true = WholeProblem.solution

    def fooled(self, p, tolerance=None):
        solution = true(self, p, tolerance)
        if 0.6 < p < 2.9:
            object.__setattr__(solution.pair, "correction", 1e-3)
        return solution

    monkeypatch.setattr(WholeProblem, "solution", fooled)
    with pytest.raises(NotConverged, match=r"Λ\(p\) is not convex .*; use a smaller rtol$"):
        MomentLyapunovFunction(Problem(FIG1, WEAK_NOISE), (0.5, 3.0), rtol=1e-3)


@pytest.mark.parametrize("interval", [(-2.0, 2.0), (0.0, 4.0), (-1.0, 0.0)])
def test_zero_as_a_node_is_no_fault(interval):
    function = MomentLyapunovFunction(Problem(FIG1, WEAK_NOISE), interval, rtol=1e-6)
    assert np.any(function.nodes == 0)


def test_an_estimate_is_printed_with_its_error():
    assert str(Estimate(-0.37345849855446, 1.04e-12, 1.0)) == "-0.373458498554 ± 1e-12"
    assert str(Estimate(math.nan, math.nan, 1.0)) == "nan ± nan"


@pytest.mark.parametrize("value", [0.00637, -1.44561121e-05, 1e300, 0.5])
def test_no_error_is_below_the_rounding_of_its_number(value):
    found = Estimate(value, 1e-30 * abs(value), 1.0)
    assert found.error_estimate == 0.5 * math.ulp(value)
    text, _, error = str(found).partition(" ± ")
    assert abs(float(text) - value) <= 2 * float(error)  # the digits follow the error
    assert Estimate(0.0, 0.0, 1.0).error_estimate == 0.0


def test_no_error_of_a_moment_is_below_its_rounding():
    found = moment_lyapunov(Problem(FIG1, FIG1_NOISE), [0.0, 2.0], rtol=1e-6)
    fewer = replace(found, error_estimate=np.zeros(2))
    assert fewer.error_estimate.tolist() == [0.0, 0.5 * math.ulp(found.value[1])]


def test_moments_one_by_one_are_checked_for_convexity(monkeypatch):
    true = ExponentSolver.solution

    def fooled(self, p, tolerance=None):
        solution = true(self, p, tolerance)
        if p == 2.0 and abs(solution.pair.value) < 0.02:
            object.__setattr__(solution.pair, "correction", 0.01)
        return solution

    monkeypatch.setattr(ExponentSolver, "solution", fooled)
    with pytest.raises(NotConverged, match=r"Λ\(p\) is not convex .*; use a smaller rtol$") as caught:
        moment_lyapunov(Problem(FIG1, WEAK_NOISE), [1.9, 2.0, 2.1])
    np.testing.assert_array_equal(caught.value.partial.p, [1.9, 2.0, 2.1])


def test_a_coarse_mesh_gives_a_coarse_function_with_honest_errors():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3)
    coarse = MomentLyapunovFunction(
        Problem(oscillator, WEAK_NOISE), (-1.0, 3.0), make_mesh(phi_cells=1, phi_degree=6, xi_cells=2, xi_degree=8)
    )
    fine = MomentLyapunovFunction(Problem(oscillator, WEAK_NOISE), (-1.0, 3.0), rtol=1e-10)
    p = np.linspace(-1, 3, 50)
    assert np.all(np.abs(coarse(p) - fine(p)) <= 3 * coarse.error_estimate(p) + 1e-12)
    assert coarse.moments(p).warnings


def test_stability_index_is_a_root_and_lambda_the_slope():
    for c1 in (-0.2, 0.1, 0.4):
        oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=c1, epsilon=0.1)
        solver = ExponentSolver(Problem(oscillator, WEAK_NOISE), rtol=1e-11)
        index = nonzero_root(solver)
        assert abs(solver.pair(index.value).value) < 1e-14
        assert math.copysign(1, index.value) == -math.copysign(1, solver.lyapunov_exponent().value)


def test_stability_index_near_zero():
    """λ changes sign with c₁, and δ_p with it, smoothly."""
    indices = []
    for c1 in np.linspace(-0.1172, -0.1168, 5):
        oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=float(c1), epsilon=0.1)
        solver = ExponentSolver(Problem(oscillator, WEAK_NOISE), rtol=1e-10)
        indices.append(nonzero_root(solver).value)
        expected = -2 * solver.lyapunov_exponent().value / solver.variance_rate().value
        assert indices[-1] == pytest.approx(expected, abs=1e-6)
    assert np.all(np.abs(np.diff(indices, 2)) < 1e-6)


def test_without_a_stability_index_within_the_interval_there_is_a_reason():
    oscillator = VibroImpactOscillator(omega=10.0, restitution=0.5, c1=-1.0, epsilon=0.1)
    index = nonzero_root(ExponentSolver(Problem(oscillator, OrnsteinUhlenbeck(alpha=1.0, sigma=0.3))))
    assert index == Absent("Λ(p) has no root p ≠ 0 in [-20, 20]")


@pytest.mark.parametrize("reach", [0.3, 4.0, 8.0, 10.0, 19.0])
def test_stability_index_is_looked_for_as_far_as_the_moments_are_resolved(monkeypatch, reach):
    """Here it is 8.70683; beyond its reach Λ(p) is not solved, which is no failure of δ_p, and no root is made up."""
    solver = ExponentSolver(Problem(ParametricOscillator(stiffness=1.0, damping=0.2), OrnsteinUhlenbeck(1.0, 0.5)))
    ratio = ExponentSolver.ratio

    def within_reach(self, p, tolerance=None):
        if abs(p) > reach:
            raise NotConverged(Message(Code.NOT_CONVERGED, p=p, reason="far out"))
        return ratio(self, p, tolerance)

    monkeypatch.setattr(ExponentSolver, "ratio", within_reach)
    index = nonzero_root(solver)
    if index:
        assert reach > 8.70683
        assert index.value == pytest.approx(8.70683239, abs=1e-6)
        return
    told = index.reason
    assert (told.code, told.data["low"]) == (Code.NO_ROOT_REACHED, -20.0)
    assert 0 <= told.data["high"] <= min(reach, 8.70683)
    assert f"no δ_p was found in [-20, {told.data['high']:g}]; beyond, Λ(" in told


@pytest.mark.parametrize("epsilon", [1e-2, 1e-4, 1e-5])
def test_stability_index_of_the_weakest_noise(epsilon):
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-0.3, epsilon=epsilon)
    index = nonzero_root(ExponentSolver(Problem(oscillator, WEAK_NOISE)))
    theory = perturbation.stability_index(oscillator, WEAK_NOISE)
    assert abs(index.value - theory) <= index.error_estimate + 10 * epsilon**2
    assert index.error_estimate < 1e-5


def test_stability_index_where_newton_steps_run_in_circles():
    """Λ(p)/p bends from flat to steep here, and each Newton step leads from one end of the bracket to the other."""
    system = PlaneSystem.of_equations(
        ("theta", "omega"),
        ("omega", "-2*zeta*sqrt(g/l)*omega - (g + xi)/l*theta"),
        {"g": 9.81, "l": 1.2, "zeta": 0.0871052631579},
    )
    solver = ExponentSolver(Problem(system, OrnsteinUhlenbeck(alpha=3.0, sigma=3.625 * math.sqrt(6.0))))
    for guess in (None, 0.5, 18.0):
        index = nonzero_root(solver, guess=guess)
        assert index.value == pytest.approx(7.067497956, abs=2e-9)  # of an interpolant from -1 to 9
        assert index.relative_error <= 1e-8
    below, above = (solver.solution(index.value * share).pair.value for share in (1 - 1e-8, 1 + 1e-8))
    assert below < 0 < above


@pytest.mark.parametrize("seed", range(6))
def test_stability_index_in_strong_noise_is_where_a_scan_changes_its_sign(seed):
    """δ_p may lie anywhere from -20 to 20, or beyond; the signs of Λ(p)/p tell between which p."""
    rng = np.random.default_rng(seed)
    damping, alpha, deviation = rng.uniform(0.05, 0.4), rng.uniform(0.5, 4.0), rng.uniform(0.3, 0.8)
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 2*zeta*v - xi*x"), {"zeta": damping})
    noise = OrnsteinUhlenbeck(alpha=alpha, sigma=deviation * math.sqrt(2 * alpha))
    solver = ExponentSolver(Problem(system, noise), rtol=1e-6)
    index = nonzero_root(solver)
    p = np.array([-19.5, -8.5, -2.5, -0.5, 0.5, 1.5, 3.5, 7.5, 13.5, 19.5])
    negative = np.array([solver.solution(each).pair.value / each < 0 for each in p])
    count = np.count_nonzero(negative)
    assert np.all(negative[:count])  # Λ(p)/p increases
    if not index:
        assert count in (0, p.size)
        return
    assert (p[count - 1] if count else -20) < index.value < (p[count] if count < p.size else 20)
    assert abs(solver.solution(index.value).pair.value) <= 1e-6 * solver.scale(index.value) + 1e-10
