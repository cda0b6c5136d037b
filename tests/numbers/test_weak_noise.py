"""Λ₂ of weak noise: the paper's Eqs. (33)-(39) are an instance, and Λ − ε²Λ₂ is of the order ε⁴."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
)
from fpsolve.model import Bounded, CoefficientMatrix, Jump, MarkovChain, White
from fpsolve.theory import FrozenNoise, first_order_eigenfunction, scale_of, second_order
from tests.conftest import keeping
from tests.kit import itself, matrices
from tests.numbers.second import LOAD, spring
from tests.oracles import perturbation

ROTATION = ((0.0, 1.0), (-1.0, 0.0))
GAUSSIAN = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
SKEWED = MarkovChain((-1.0, 0.5), ((0, 1.0), (0.5, 0)))
P = np.array([-2.0, -0.3, 0.0, 1.0, 5.0])


@pytest.mark.parametrize("law", ["delta", "restitution"])
@pytest.mark.parametrize("noise", [OrnsteinUhlenbeck(alpha=0.7, sigma=1.3), NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8)])
def test_second_order_of_the_papers_oscillator_is_eqs_33_to_39(noise, law):
    oscillator = VibroImpactOscillator(omega=1.7, restitution=0.6, c1=-0.2, epsilon=0.3, impact=law)
    theory = second_order(Problem(oscillator, noise))
    for ours, paper in (
        (theory.moment_exponent(P), perturbation.moment_exponent(oscillator, noise, P)),
        (theory.scale.moment(P), perturbation.moment_scale(oscillator, noise, P)),
        (theory.stability_index, perturbation.stability_index(oscillator, noise)),
        (theory.lyapunov_exponent, perturbation.lyapunov_exponent(oscillator, noise)),
        (theory.scale.linear, perturbation.lyapunov_scale(oscillator, noise)),
        (theory.variance_rate, perturbation.variance_rate(oscillator, noise)),
        (theory.impact_rate, perturbation.impact_rate(oscillator, noise)),
        (theory.critical_impact_factor, perturbation.critical_impact_factor(oscillator, noise)),
    ):
        assert_allclose(ours, paper, rtol=1e-13, atol=1e-16)
    phi, xi = np.linspace(0, 6, 7)[:, None], np.linspace(-2, 2, 5)
    ours = first_order_eigenfunction(Problem(oscillator, noise), 1.4, phi, xi)
    assert_allclose(ours, perturbation.first_order_eigenfunction(oscillator, noise, 1.4, phi, xi), rtol=1e-13)


@pytest.mark.parametrize(("noise", "order", "slack"), [(GAUSSIAN, 2, 0.05), (SKEWED, 1, 0.2)], ids=["OU", "chain"])
@pytest.mark.parametrize(("seed", "p"), [(0, -1.0), (5, 2.0), (6, 2.0)])
def test_what_the_second_order_lacks_of_any_motion_is_of_higher_order(seed, noise, order, slack, p):
    """Any matrices, a free motion on ellipses, damping of order 2, two rays. Symmetric noise leaves ε⁴, other ε³."""
    rng = np.random.default_rng(seed)
    ellipse = np.array([[0.3, 1.5], [-0.8, -0.3]])
    damped, driven = rng.uniform(-1, 1, (2, 2)), keeping(0.4, 1.9, rng.uniform(-1, 1, 2))
    rests = []
    for epsilon in (0.04, 0.02):
        jumps = [Jump(0.4, -0.3 * epsilon**2), Jump(1.9, 0.5 * epsilon**2)]
        terms = [CoefficientMatrix(0, ellipse), CoefficientMatrix(1, driven, itself), CoefficientMatrix(2, damped)]
        problem = Problem(PlaneSystem(terms, jumps, epsilon), noise)
        value = ExponentSolver(problem, rtol=1e-9).pair(p).value
        rests.append(abs(value - second_order(problem).moment_exponent(p)) / epsilon**2)
    assert math.log2(rests[0] / rests[1]) == pytest.approx(order, abs=slack)


@pytest.mark.parametrize("shift", [0.9, -3.0])
def test_mean_of_a_noise_is_a_part_of_the_drift_in_all_numbers(shift):
    """States moved by m and the drift by −εmA: ε²Λ₂ is about the drift with the mean."""
    driven, damped, epsilon = keeping(0.4, 2.0), ((0.0, 0.0), (0.0, -0.3)), 0.2
    rest = [CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, driven, itself), CoefficientMatrix(2, damped)]
    moved = CoefficientMatrix(0, -epsilon * shift * driven)
    chain = MarkovChain(tuple(state + shift for state in SKEWED.states), SKEWED.rates)
    plain = Problem(PlaneSystem(rest, [Jump(0.4, -0.02)], epsilon), SKEWED)
    other = Problem(PlaneSystem([*rest, moved], [Jump(0.4, -0.02)], epsilon), chain)
    assert (plain.noise.mean, other.noise.mean) == pytest.approx((0, shift), abs=1e-15)
    one, two = (ExponentSolver(each, rtol=1e-10) for each in (plain, other))
    for p in (-1.5, 2.0):
        assert two.pair(p).value == pytest.approx(one.pair(p).value, abs=1e-12)
        assert second_order(other).moment_exponent(p) == pytest.approx(
            second_order(plain).moment_exponent(p), rel=1e-12
        )
    assert two.lyapunov_exponent().value == pytest.approx(one.lyapunov_exponent().value, abs=1e-12)
    assert two.solution(2.0).error < 1e-10
    assert two.method.scale(2.0) == pytest.approx(one.method.scale(2.0), rel=1e-12)
    with pytest.raises(FpsolveError, match="T₁ is for noise of mean 0"):
        first_order_eigenfunction(other, 1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        ([CoefficientMatrix(0, ((1.0, 0.0), (0.0, -1.0)))], "that rotate without noise"),
        ([CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, ROTATION)], "a term of order 1 with g = 1"),
        ([CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, ROTATION, np.tanh)], "with g = tanh"),
    ],
)
def test_second_order_is_refused_where_it_is_none_and_errors_have_a_scale(terms, words):
    problem = Problem(PlaneSystem(terms, epsilon=0.5), GAUSSIAN)
    with pytest.raises(FpsolveError, match=words):
        second_order(problem)
    scale = scale_of(problem)
    assert 0 <= scale.quadratic <= scale.linear < math.inf


def test_second_order_is_refused_in_resonance_and_the_scale_of_errors_stays():
    """S(2ω) → ∞ as σ → 0, where ln ‖x‖ grows by no more than ½μ all the same."""
    for sigma in (0.3, 1e-3):
        assert 0.05 < ExponentSolver(matrices(spring(), LOAD, Bounded(0.4, 2.0, sigma))).method.scale(2.0) < 1.0
    with pytest.raises(FpsolveError, match="broad compared with its effect"):
        second_order(matrices(spring(), LOAD, Bounded(0.4, 2.0, 0.3)))
    assert second_order(matrices(spring(), LOAD, Bounded(0.4, 5.0, 0.1))).quadratic > 0
    loads = [LOAD, LOAD]
    pumped, noisy = (
        matrices(spring(1.69, 0.1), loads, [Bounded(0.5, 2.6, sigma), White(s=0.1)]) for sigma in (0.0, 2.0)
    )
    with pytest.raises(FpsolveError, match=r"harmonic|noise\.xi1"):
        second_order(pumped)
    assert scale_of(pumped).moment(2.0) < 3 * scale_of(noisy).moment(2.0)


@pytest.mark.parametrize("turn", [1.3, -1.3])
def test_first_order_eigenfunction_solves_eq_32_for_both_directions_of_rotation(turn):
    """L₀T₁ = −p q ξ."""
    terms = [
        CoefficientMatrix(0, ((0.0, turn), (-turn, 0.0))),
        CoefficientMatrix(1, ((0.2, -0.7), (0.4, 1.0)), itself),
    ]
    noise = OrnsteinUhlenbeck(alpha=0.7, sigma=1.0)
    phi, h = np.linspace(0, 3, 7), 1e-5
    at, after, before = (
        first_order_eigenfunction(Problem(PlaneSystem(terms), noise), 1.4, x, 0.9) for x in (phi, phi + h, phi - h)
    )
    residual = -0.7 * at + turn * (after - before) / (2 * h) + 1.4 * 0.9 * terms[1].q(phi)
    assert_allclose(residual, 0, atol=1e-8)
    more = Problem(PlaneSystem([*terms, CoefficientMatrix(1, ROTATION)]), noise)
    with pytest.raises(FpsolveError):
        first_order_eigenfunction(more, 1.4, phi, 0.9)


def test_slow_noise_is_looked_at_where_its_cube_carries_the_moment():
    """Of the stiffness 1 + 10ξ³ far out F = p(10|ξ|³)^½ − ξ²/2S(0), the largest at |ξ| = 22.5 p² S(0)²."""
    terms = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))), CoefficientMatrix(1, ((0.0, 0.0), (-10.0, 0.0)), cube)
    noise = OrnsteinUhlenbeck(alpha=1 / 30, sigma=0.1 * math.sqrt(2 / 30))
    z, _ = FrozenNoise(Problem(PlaneSystem(terms), noise)).peaks(2.0)
    assert -0.1 * z[0] == pytest.approx(22.5 * 2**2 * 0.6**2, rel=1e-2)


def cube(xi):
    return np.asarray(xi) ** 3
