"""Λ₂ of any motion: the paper's Eqs. (36)-(39) are an instance, and Λ − ε²Λ₂ is of the order ε⁴."""

import math

import numpy as np
import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.arrays import identity
from fpsolve.errors import NoPerturbationTheory
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain
from fpsolve.theory import first_order_eigenfunction, scale_of, second_order
from tests.conftest import keeping
from tests.oracles import perturbation

ROTATION = ((0.0, 1.0), (-1.0, 0.0))
P = np.array([-2.0, -0.3, 0.0, 1.0, 5.0])


@pytest.mark.parametrize("law", ["delta", "restitution"])
@pytest.mark.parametrize("noise", [OrnsteinUhlenbeck(alpha=0.7, sigma=1.3), NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8)])
def test_the_papers_equations_are_an_instance(noise, law):
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
        np.testing.assert_allclose(ours, paper, rtol=1e-13, atol=1e-16)
    phi, xi = np.linspace(0, 6, 7)[:, None], np.linspace(-2, 2, 5)
    np.testing.assert_allclose(
        first_order_eigenfunction(Problem(oscillator, noise), 1.4, phi, xi),
        perturbation.first_order_eigenfunction(oscillator, noise, 1.4, phi, xi),
        rtol=1e-13,
    )


GAUSSIAN = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
SKEWED = MarkovChain((-1.0, 0.5), ((0, 1.0), (0.5, 0)))


@pytest.mark.parametrize("p", [-1.0, 2.0])
@pytest.mark.parametrize(("noise", "order", "slack"), [(GAUSSIAN, 2, 0.05), (SKEWED, 1, 0.2)], ids=["OU", "chain"])
@pytest.mark.parametrize("seed", [0, 5, 6])  # whose Λ₃ is not small
def test_what_is_left_out_is_of_higher_order(seed, noise, order, slack, p):
    """Any matrices, a free motion on ellipses, damping of order 2, two rays. Symmetric noise leaves ε⁴, other ε³."""
    rng = np.random.default_rng(seed)
    ellipse = np.array([[0.3, 1.5], [-0.8, -0.3]])
    damped, driven = rng.uniform(-1, 1, (2, 2)), keeping(0.4, 1.9, rng.uniform(-1, 1, 2))
    rests = []
    for epsilon in (0.04, 0.02):
        jumps = [Jump(0.4, -0.3 * epsilon**2), Jump(1.9, 0.5 * epsilon**2)]
        terms = [CoefficientMatrix(0, ellipse), CoefficientMatrix(1, driven, identity), CoefficientMatrix(2, damped)]
        problem = Problem(PlaneSystem(terms, jumps, epsilon), noise)
        value = ExponentSolver(problem, rtol=1e-9).pair(p).value
        rests.append(abs(value - second_order(problem).moment_exponent(p)) / epsilon**2)
    assert math.log2(rests[0] / rests[1]) == pytest.approx(order, abs=slack)


@pytest.mark.parametrize("shift", [0.9, -3.0])
def test_the_mean_of_a_noise_is_a_part_of_the_drift(shift):
    """States moved by m and the drift by −εmA: all numbers are the same, and ε²Λ₂ is about the drift with the mean."""
    driven, damped = keeping(0.4, 2.0), ((0.0, 0.0), (0.0, -0.3))
    epsilon = 0.2
    rest = [CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, driven, identity), CoefficientMatrix(2, damped)]
    moved = CoefficientMatrix(0, (-epsilon * shift * np.array(driven)).tolist())
    chain = MarkovChain(tuple(state + shift for state in SKEWED.states), SKEWED.rates)
    jumps = [Jump(0.4, -0.02)]
    plain = Problem(PlaneSystem(rest, jumps, epsilon), SKEWED)
    other = Problem(PlaneSystem([*rest, moved], jumps, epsilon), chain)
    assert plain.noise.mean == pytest.approx(0, abs=1e-15)
    assert other.noise.mean == pytest.approx(shift)
    one, two = (ExponentSolver(each, rtol=1e-10) for each in (plain, other))
    for p in (-1.5, 2.0):
        assert two.pair(p).value == pytest.approx(one.pair(p).value, abs=1e-12)
        assert second_order(other).moment_exponent(p) == pytest.approx(
            second_order(plain).moment_exponent(p), rel=1e-12
        )
    assert two.lyapunov_exponent().value == pytest.approx(one.lyapunov_exponent().value, abs=1e-12)
    assert two.solution(2.0).error < 1e-10
    assert two.scale(2.0) == pytest.approx(one.scale(2.0), rel=1e-12)
    with pytest.raises(NoPerturbationTheory, match="T₁ is for noise of mean 0"):
        first_order_eigenfunction(other, 1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("terms", "noise", "message"),
    [
        ([CoefficientMatrix(0, ((1.0, 0.0), (0.0, -1.0)))], None, "that rotate without noise"),
        ([CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, ROTATION)], None, "a term of order 1 with g = 1"),
        ([CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, ROTATION, np.tanh)], None, "with g = tanh"),
    ],
)
def test_where_the_theory_does_not_apply_it_says_so_and_errors_have_a_scale(terms, noise, message):
    problem = Problem(PlaneSystem(terms, epsilon=0.5), noise or OrnsteinUhlenbeck(alpha=1.0, sigma=1.0))
    with pytest.raises(NoPerturbationTheory, match=message):
        second_order(problem)
    scale = scale_of(problem)
    assert 0 <= scale.quadratic <= scale.linear < math.inf


@pytest.mark.parametrize("turn", [1.3, -1.3])
def test_the_first_order_eigenfunction_solves_its_equation(turn):
    """L₀T₁ = −p q ξ, Eq. (32), forward and backward rotation alike."""
    terms = [
        CoefficientMatrix(0, ((0.0, turn), (-turn, 0.0))),
        CoefficientMatrix(1, ((0.2, -0.7), (0.4, 1.0)), identity),
    ]
    problem = Problem(PlaneSystem(terms), OrnsteinUhlenbeck(alpha=0.7, sigma=1.0))
    phi, h = np.linspace(0, 3, 7), 1e-5
    at, after, before = (first_order_eigenfunction(problem, 1.4, x, 0.9) for x in (phi, phi + h, phi - h))
    residual = -0.7 * at + turn * (after - before) / (2 * h) + 1.4 * 0.9 * terms[1].q(phi)
    np.testing.assert_allclose(residual, 0, atol=1e-8)
    with pytest.raises(NoPerturbationTheory):
        first_order_eigenfunction(
            Problem(PlaneSystem([*terms, CoefficientMatrix(1, ROTATION)]), problem.noise), 1.4, phi, 0.9
        )
