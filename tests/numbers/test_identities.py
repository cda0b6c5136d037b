"""What Λ(p) obeys whatever its numbers are: symmetries, limits, changes of units and coordinates, slopes, convexity."""

import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    boundary,
    load_case,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    sensitivities,
    stability_index,
    stationary_density,
)
from fpsolve.analysis import Axis
from fpsolve.exponent import (
    critical_impact_factor,
    critical_restitution,
    impact_rate,
    principal_pair,
    second_derivative,
)
from fpsolve.fem import Generator
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Jump,
    MarkovChain,
    ModalSystem,
    ParametricOscillator,
    Poisson,
    Telegraph,
    White,
)
from fpsolve.theory import second_order
from tests.conftest import sampled
from tests.kit import itself, matrices, rates
from tests.numbers.by_problem import by_moments, matrices_of
from tests.numbers.rows.blocks import TEXTS
from tests.numbers.rows.impulses_on_elements import spring as struck
from tests.numbers.rows.oscillator import PAPER, UNIT, WEAK, paper
from tests.numbers.rows.several_noises import BEAM, GAUSSIAN
from tests.numbers.rows.walls import walled

TELEGRAPH = Telegraph(a=0.5, k=1.0)
HEAVY = NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.1)
BOUNDED = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8)


def values(problem: Problem, p, rtol: float = 1e-10):
    return moment_lyapunov(problem, p, rtol=rtol).value


def value(problem: Problem, p: float = 2.0, rtol: float = 1e-8) -> float:
    """By eigenfunctions."""
    return ExponentSolver(problem, rtol=rtol).solution(p).pair.value


def solver_at(r: float, noise, law: str, c1: float = 0.1) -> ExponentSolver:
    return ExponentSolver(Problem(paper(1.0, r, c1, impact=law), noise), rtol=1e-6 if noise == HEAVY else 1e-9)


def changed(problem: Problem, change, unit: float = 1.0) -> Problem:
    """In the coordinates S x."""
    steady, driven = matrices_of(problem)
    turned = [change @ each @ np.linalg.inv(change) / unit for each in (steady, driven[""])]
    rays = [change @ [math.cos(each.phase), -math.sin(each.phase)] for each in problem.system.jumps]
    jumps = [Jump(math.atan2(-y, x), each.log_factor) for (x, y), each in zip(rays, problem.system.jumps, strict=True)]
    return matrices(*turned, problem.noise, **({"jumps": jumps} if jumps else {}))


def test_moments_with_a_wall_in_other_coordinates_are_the_same():
    base, change = walled(TELEGRAPH, 0.9), np.array([[1.0, 0.3], [-0.4, 1.2]])
    np.testing.assert_allclose(values(changed(base, change), [-1.0, 2.0]), values(base, [-1.0, 2.0]), atol=1e-10)


@pytest.mark.parametrize("name", TEXTS)
def test_moments_of_blocks_that_other_coordinates_hide_are_the_same(name):
    for noise in (White(s=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=0.7)):
        base = rates(TEXTS[name], noise)
        turn, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((base.dimension, base.dimension)))
        turn *= np.array([1.0, 1e3, 1.0, 1e-2])[: len(turn), None]
        found, known = (values(each, [1.0, 3.0], 1e-8) for each in (changed(base, turn), base))
        np.testing.assert_allclose(found, known, atol=1e-10)


def test_exponents_in_another_unit_of_time_are_the_same_at_a_wall():
    found = [
        value(
            walled(
                OrnsteinUhlenbeck(alpha=unit, sigma=0.5 * math.sqrt(unit)),
                math.exp(-0.2),
                "x' = v; v' = -w**2*x - 0.2*w*v - xi*(w**2*x + 0.1*w*v)",
                w=unit,
            )
        )
        / unit
        for unit in (1.0, 1e-6, 1e7)
    ]
    assert found == pytest.approx([found[0]] * 3, rel=1e-8)


PLACE = np.array([math.cos(0.7), -math.sin(0.7)])
CHAIN = MarkovChain((-2.0, 0.1, 1.7), ((0, 1.0, 0.4), (0.7, 0, 0.3), (0.2, 0.9, 0)))
TURN, SPRING = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0, 1.0], [-1.0, -0.2]])
KEPT = 0.9 * np.outer(PLACE, [0.4, -0.7]) - 0.3 * np.eye(2)
"""Of whose eigenvectors one lies on the ray of a wall."""
STRUCK = {
    "turns": ([(TURN, None), (KEPT, itself)], CHAIN, 0.7),
    "turns back": ([(-TURN, None), (KEPT, itself)], CHAIN, 0.7),
    "square of a telegraph": (
        [(SPRING, None), ([[0.0, 0.3], [-0.4, 0.0]], np.square), ([[0.0, 0.0], [-0.5, 0.0]], itself)],
        *(Telegraph(a=1.0, k=0.7), math.pi / 2),
    ),
    "two terms that do nothing together": (
        [(SPRING, None), ([[0.0, -0.3], [0.0, -0.1]], itself), ([[0.0, 0.3], [0.0, 0.0]], itself)],
        *(Telegraph(a=1.0, k=0.7), math.pi / 2),
    ),
}


@pytest.mark.parametrize("name", STRUCK)
def test_rate_of_impacts_is_the_slope_of_lambda_over_the_logarithm_of_the_factor(name):
    """λ = λ₀ + N ln R; λ is the mean growth under the stationary density, too."""
    terms, noise, phase = STRUCK[name]
    driven = [CoefficientMatrix(int(g is not None), matrix, g or (lambda xi: 1.0)) for matrix, g in terms]
    solvers = [
        ExponentSolver(Problem(PlaneSystem(driven, [Jump(phase, log)]), noise), rtol=1e-10) for log in (-0.1, 0.2)
    ]
    loss, gain = (each.lyapunov_exponent().value for each in solvers)
    for each in solvers:
        assert impact_rate(each).value == pytest.approx((gain - loss) / 0.3, abs=1e-8)


@pytest.mark.parametrize(("noise", "law"), sampled(*product((HEAVY, BOUNDED, WEAK), ("delta", "restitution")), keep=3))
def test_lambda_is_zero_at_the_critical_restitution(noise, law):
    found = critical_restitution(solver_at(0.3, noise, law))
    there = solver_at(found.value, noise, law)
    exponent, factor = there.lyapunov_exponent(), critical_impact_factor(there)
    assert abs(exponent.value) <= exponent.error_estimate + found.error_estimate
    assert found.error_estimate < (1e-5 if noise == HEAVY else 1e-7)
    off = abs(factor.value - there.problem.system.impact_factor())
    assert off <= factor.error_estimate + found.error_estimate


WALL = [{"at": "x = 0", "restitution": 0.8}]
STIFF, TWICE = "x' = v; v' = -x - 0.1*v - xi*x", "x' = v; v' = -x - 0.1*v - xi1*x - xi2*x"
ONE_WALL = rates(STIFF, GAUSSIAN, WALL)
STRONG = paper(0.5)
SAME = {
    "two white noises of one term": (rates(TWICE, [White(s=0.3), White(s=0.4)]), rates(STIFF, White(s=0.5)), 1e-12),
    **{
        f"wall beside weak {weak.kind} noise": (rates(BEAM, [GAUSSIAN, weak], WALL), ONE_WALL, 1e-8)
        for weak in (White(s=1e-6), OrnsteinUhlenbeck(alpha=1.0, sigma=1e-6), Telegraph(a=1e-6, k=1.0))
    },
    "impulses of size 0 and of weight 0": (
        struck(Poisson(rate=2.0, sizes=(0.0, -3.0, 0.5), weights=(1.0, 0.0, 1.0))),
        *(struck(Poisson(rate=1.0, sizes=(0.5,))), 1e-12),
    ),
    "the paper's oscillator from its parts": (
        Problem(PlaneSystem(STRONG.terms, STRONG.jumps, STRONG.epsilon), UNIT),
        *(Problem(STRONG, UNIT), 0.0),
    ),
    "variables in another order": (
        rates("y' = w; x' = v; w' = -2.56*y - 0.16*w - 0.5*xi*y; v' = -x - 0.1*v - 0.5*xi*x", White(s=1.0)),
        *(rates(TEXTS["pairs"], White(s=1.0)), 1e-12),
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_moments_are_those_of_the_same_problem_stated_otherwise(name):
    first, second, error = SAME[name]
    assert value(first) == pytest.approx(value(second), rel=0, abs=error)


@pytest.mark.slow
def test_sign_of_slow_noise_is_of_no_matter():
    """The place that carries the moment may lie at ξ < 0 although p > 0; populations give 1.12902 ± 2e-5."""
    noise = OrnsteinUhlenbeck(alpha=0.05, sigma=0.05)
    found = [value(walled(noise, 0.8, "x' = v; v' = 0.1*v - x + s*xi*v", s=sign)) for sign in (1.0, -1.0)]
    assert found == pytest.approx([1.12906] * 2, rel=1e-4)
    assert found[0] == pytest.approx(found[1], rel=1e-7)


@pytest.mark.parametrize("noise", [White(s=0.2), TELEGRAPH], ids=["layers", "cones"])
def test_moments_of_a_saddle_mirror_at_p_minus_one(noise):
    """Λ(−2 − p) = Λ(p) + 2b(1 + p), as time reversed is v reversed; two eigenvalues meet at p = −1, or nearly do."""
    damping, p = 0.05, np.linspace(-2.0, 0.0, 12)
    found = moment_lyapunov(Problem(ParametricOscillator(stiffness=-1.5, damping=damping), noise), p, rtol=1e-6)
    mirrored = found.value[::-1] + 2 * damping * (1 + p[::-1])
    assert np.all(np.abs(found.value - mirrored) <= found.error_estimate + found.error_estimate[::-1])
    assert found.value[0] == pytest.approx(2 * damping, abs=found.error_estimate[0] + 1e-15)


MESHES = {
    "coarsest": {"phi_cells": 1, "phi_degree": 1, "xi_cells": 1, "xi_degree": 1},
    "default": {},
    "graded": {"xi_cells": 7, "grading": 5.0},
    "lopsided": {"xi_min": -3.0, "xi_max": 9.0},
    "full circle": {"phi_cells": 3, "full_circle": True},
}


@pytest.mark.parametrize("noise", [WEAK, PAPER, NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.2)])
@pytest.mark.parametrize("name", MESHES)
def test_zeroth_moment_is_conserved_on_every_mesh(name, noise):
    """Λ(0) = 0, where T = 1."""
    generator = Generator(Problem(paper(1.0), noise), make_mesh(**MESHES[name]))
    pair = principal_pair(generator, 0.0)
    assert abs(pair.value) <= min(pair.rounding, 1e-13)
    change = pair.right - pair.space.constant
    assert change @ (generator.space(0.0).mass @ change) <= 1e-22


def test_moments_on_a_half_and_a_full_circle_are_the_same():
    half, full = (
        ExponentSolver(Problem(paper(), WEAK), make_mesh(phi_degree=10, xi_degree=6, full_circle=each)).pair(2.0)
        for each in (False, True)
    )
    assert (full.value, full.derivative) == pytest.approx((half.value, half.derivative), rel=1e-12)


def test_slope_and_curvature_are_those_of_differences():
    solver, h = ExponentSolver(Problem(paper(), WEAK)), 1e-2
    for p in (-1.0, 0.0, 3.0):
        left, pair, right = (solver.pair(p + k * h) for k in (-1, 0, 1))
        assert pair.derivative == pytest.approx((right.value - left.value) / (2 * h), rel=1e-5)
        assert second_derivative(pair) == pytest.approx((right.derivative - left.derivative) / (2 * h), rel=1e-5)


def test_stability_index_near_zero_is_smooth():
    """λ changes its sign with c₁, and δ_p with it: about −2λ/Λ″(0)."""
    found = []
    for c1 in (-0.1172, -0.117, -0.1168):
        solver = ExponentSolver(Problem(paper(c1=c1), WEAK), rtol=1e-10)
        found.append(stability_index(solver.problem, rtol=1e-10).value)
        expected = -2 * solver.lyapunov_exponent().value / solver.variance_rate().value
        assert found[-1] == pytest.approx(expected, abs=1e-6)
    assert abs(np.diff(found, 2)[0]) < 4e-6


@pytest.mark.parametrize("seed", sampled(3, 0, 1, 2, 4, 5))
def test_stability_index_in_strong_noise_is_where_a_scan_changes_its_sign(seed):
    """δ_p may lie anywhere from -20 to 20, or beyond; the signs of Λ(p)/p tell between which p."""
    rng = np.random.default_rng(seed)
    damping, alpha, deviation = rng.uniform(0.05, 0.4), rng.uniform(0.5, 4.0), rng.uniform(0.3, 0.8)
    noise = OrnsteinUhlenbeck(alpha=alpha, sigma=deviation * math.sqrt(2 * alpha))
    problem = rates("x' = v; v' = -x - 2*zeta*v - xi*x", noise, zeta=damping)
    found, p = stability_index(problem, rtol=1e-6), np.array([-19.5, -2.5, -0.5, 0.5, 1.5, 3.5, 7.5, 13.5, 19.5])
    negative = np.array([value(problem, each, 1e-6) / each < 0 for each in p])
    assert np.all(np.diff(negative.astype(int)) <= 0)  # Λ(p)/p increases
    if not found:
        assert np.all(negative) or not np.any(negative)
        return
    assert np.all(negative == (p < found.value))
    there = moment_lyapunov(problem, found.value, rtol=1e-9)
    assert abs(there.value[0]) <= there.derivative[0] * found.error_estimate + 1e-8


def test_density_of_the_states_of_a_chain_is_their_stationary_law():
    chain = MarkovChain((-0.6, 0.3), ((0, 1.0), (0.5, 0)))
    density = stationary_density(ExponentSolver(rates(STIFF, chain)).pair(0.0))
    np.testing.assert_allclose(density.xi_marginal(), [1 / 3, 2 / 3], rtol=1e-10)
    assert density.mean(lambda phi, xi: xi) == pytest.approx(0.0, abs=1e-12)


def orders(of, steps, limit=0.0):
    """How fast something tends to a limit."""
    return np.diff(np.log(np.abs(np.array([of(each) for each in steps]) - limit))) / np.diff(np.log(steps))


def sum_of_telegraphs(n: float) -> Problem:
    up = np.arange(int(n) + 1)
    rate = np.diag((n - up[:-1]) * 1.0, 1) + np.diag(up[1:] * 1.0, -1)
    return rates("x' = v; v' = -x - 0.1*v - 0.3*xi*x", MarkovChain((2 * up - n) / math.sqrt(n), rate))


def both_noises(epsilon: float) -> Problem:
    text = "x' = v; v' = -x - e**2*0.1*v - e*xi1*x - e*xi2*v"
    return rates(text, [GAUSSIAN, White(s=0.2)], e=epsilon)


def test_sum_of_telegraphs_tends_to_gaussian_noise_by_its_number():
    limit = value(rates("x' = v; v' = -x - 0.1*v - 0.3*xi*x", OrnsteinUhlenbeck(2.0, 2.0)), rtol=1e-10)
    found = orders(lambda n: value(sum_of_telegraphs(n), rtol=1e-10), (4.0, 8.0, 16.0), limit)
    np.testing.assert_allclose(found, -1.0, atol=0.2)


def test_second_order_of_two_noises_leaves_a_fourth_order():
    found = orders(
        lambda e: value(both_noises(e), rtol=1e-10) - second_order(both_noises(e)).moment_exponent(2.0), (0.05, 0.1)
    )
    assert found[0] == pytest.approx(4.0, abs=0.14)


def chained():
    """A filter y drives an oscillator, which drives z; kappa would let z drive y."""
    text = "y' = -a*y - 0.3*xi*y + kappa*z; x' = v; v' = -x - 2*zeta*v - xi*x + c*y; z' = -b*z + x"
    return rates(text, White(0.6), a=0.5, zeta=0.1, b=1.0, kappa=0.0, c=0.5)


def turned_modes():
    """Modes of K = ((1, k), (k, 2)) with noise in all stiffness alike do not couple, but change with k."""
    matrix, damping = [[1.0, "k"], ["k", 2.0]], [[0.2, 0.0], [0.0, 0.2]]
    system = ModalSystem.of(np.eye(2).tolist(), matrix, damping, stiffness_noise=matrix, parameters={"k": 0.4})
    return Problem(system, White(s=0.6))


UNCLOCKED = "x' = v; v' = -x - 1.5*v - 0.3*cos(nu*t)*x - 0.1*xi*x; y' = w; w' = -y - 0.1*w - 0.3*xi*y"
IMPULSES = Poisson(rate=0.8, sizes=(1.0, -0.6))
SENSITIVE = {
    "non-Gaussian noise": (lambda: Problem(paper(0.5), BOUNDED), 1.7),
    "impulses": (lambda: rates("x' = v; v' = -k*x - 0.4*v - c*xi*x", IMPULSES, k=1.3, c=0.8), 2.0),
    "modes that turn": (turned_modes, 1.0),
    "blocks": (chained, 1.0),
    "a block without the clock": (lambda: rates(UNCLOCKED, Bounded(0.4, 2.0, 0.5), nu=1.3), 2.0),
    "two noises": (lambda: rates(BEAM.replace("0.1*v", "b*v"), [GAUSSIAN, Telegraph(a=0.2, k=0.7)], b=0.1), 2.0),
}


@pytest.mark.parametrize("name", sampled(*SENSITIVE, keep=2))
def test_sensitivities_are_differences(name):
    make, p = SENSITIVE[name]
    problem = make()
    found = sensitivities(problem, p, rtol=1e-9)
    [slopes] = found.moments
    assert slopes
    for key, slope in slopes.items():
        step = 1e-4 * problem.values[key]
        low, high = (problem.at({key: problem.values[key] + side * step}) for side in (-1, 1))
        difference = (values(high, p)[0] - values(low, p)[0]) / (2 * step)
        assert slope.value == pytest.approx(difference, rel=1e-6, abs=1e-6), key
        if name == "blocks":
            rate = found.summary_numbers["lyapunov_exponent"][key]
            ends = [lyapunov_exponent(each, rtol=1e-10).value for each in (low, high)]
            assert rate.value == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6, abs=1e-6), key


def test_sensitivities_to_what_would_join_blocks_are_left_out():
    found = sensitivities(chained(), 1.0)
    assert set(found.theta) == {"system.a", "system.zeta", "system.b", "system.c", "noise.s"}
    assert [note for note in found.notes if "system.kappa" in note and "any other value" in note]


FLUTTER = load_case(Path(__file__).parents[2] / "cases/systems/flutter.toml")
LINES = {
    "flutter": (FLUTTER.problem, FLUTTER.chart.x, Axis("noise.standard_deviation", 1e-4, 0.3), 5),
    "blocks": (chained(), Axis("system.zeta", 0.05, 0.2), Axis("noise.s", 0.3, 0.8), 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_line_of_stable_second_moments_is_that_of_their_equations(name):
    problem, x, y, nodes = LINES[name]
    [branch] = boundary(problem, "moment(2) = 0", x, y, nodes=nodes).branches
    for k in range(0, branch.x.size, 5):
        assert by_moments(problem.at({x.key: branch.x[k], y.key: branch.y[k]}), 2) == pytest.approx(0.0, abs=1e-9)
    if name == "flutter":  # it begins where the deck flutters without turbulence

        def growth(u):
            return np.linalg.eigvals(matrices_of(problem.at({x.key: u}))[0]).real.max()

        assert branch.x[np.argmin(branch.y)] == pytest.approx(brentq(growth, 40.0, 56.0), abs=1e-4)
