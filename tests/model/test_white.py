"""White noise: Λ(p) and λ against closed forms and moment equations, both senses, its parameter, what is refused."""

import math
import pickle

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import iv

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator, sensitivities
from fpsolve.analysis import furstenberg_khasminskii
from fpsolve.arrays import identity
from fpsolve.exponent import impact_rate
from fpsolve.fem.phase import PhaseAxis
from fpsolve.model import CoefficientMatrix, Jump, White, noise_kind

STIFFNESS, DAMPING = ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, 1.0))
WALL = Jump(math.pi / 2, math.log(0.8))


def oscillator(stiffness=1.0, damping=0.0, s=1.0, driven=STIFFNESS, jumps=(), interpretation="stratonovich"):
    """ẍ + 2 damping ẋ + (stiffness + ξ) x = 0, or with ξ in another term."""
    free = CoefficientMatrix(0, ((0.0, 1.0), (-stiffness, -2 * damping)))
    system = PlaneSystem([free, CoefficientMatrix(1, driven, identity)], jumps)
    return Problem(system, White(s, interpretation))


def moments(problem, p, rtol=1e-10):
    found = ExponentSolver(problem, rtol=rtol).moments(p)
    assert not found.failures
    return found


def of_polynomials(a, p):
    """ẋ = a x on the homogeneous polynomials of degree p in x, by the monomials x₁^(p−k) x₂^k."""
    n = np.arange(p + 1)
    (a11, a12), (a21, a22) = a
    up, down = np.diag((p - n[:-1]) * a12, -1), np.diag(n[1:] * a21, 1)
    return np.diag((p - n) * a11 + n * a22) + up + down


def by_moments(problem, p):
    """Λ(p) of even p without jumps: d/dt E of the polynomials is by A + ½B² in the sense of Stratonovich."""
    drift = sum(np.array(term.matrix) for term in problem.motion.terms)
    (diffusion,) = (np.array(each.matrix) for each in problem.diffusions)
    b = of_polynomials(diffusion, p)
    return float(np.max(np.linalg.eigvals(of_polynomials(drift, p) + 0.5 * b @ b).real))


def test_the_registry_has_it():
    assert noise_kind("white") is White
    assert White(s=0.5).spectral_density(3.0) == 0.25


@pytest.mark.parametrize("stiffness", [1.0, 0.25, -1.0, 0.0])
def test_exponent_of_an_undamped_spring(stiffness):
    """λ by the integral over the stationary flux of v/x: with f(u) = exp(−2(u³/12 + k u)), λ = ½∫√u f/∫f/√u.

    L. Arnold, G. Papanicolaou and V. Wihstutz, SIAM J. Appl. Math. 46, 1986.
    """

    def mean(power):
        return quad(lambda u: 2 * u ** (2 * power + 1) * math.exp(-(u**6) / 6 - 2 * stiffness * u**2), 0, np.inf,
                    epsabs=0, epsrel=1e-12)[0]  # fmt: skip  # u² in place of u

    found = ExponentSolver(oscillator(stiffness), rtol=1e-9).lyapunov_exponent()
    expected = 0.5 * mean(0.5) / mean(-0.5)
    assert abs(found.value - expected) <= found.error_estimate < 1e-8


def test_moments_of_a_free_mass():
    """ẍ = ξ x: Λ(2) = (2s²)^⅓ and Λ(4) = (42 s²)^⅓ by its moments, and the derivatives of these."""
    problem = oscillator(0.0, s=0.7)
    found = moments(problem, [2.0, 4.0])
    expected = np.array([2 * 0.7**2, 42 * 0.7**2]) ** (1 / 3)
    assert np.all(np.abs(found.value - expected) <= found.error_estimate)
    np.testing.assert_allclose(found.value, expected, rtol=1e-9)
    slopes = sensitivities(problem, [2.0, 4.0]).moments
    np.testing.assert_allclose([each["noise.s"].value for each in slopes], expected * 2 / 3 / 0.7, rtol=1e-8)


def test_diagonal_drift_and_turning_noise():
    """dx = diag(1, −1)x dt + Jx∘dW: λ = I₁(1)/I₀(1), Λ(2) = √5 − 1."""
    drift, turn = CoefficientMatrix(0, ((1.0, 0.0), (0.0, -1.0))), ((0.0, -1.0), (1.0, 0.0))
    solver = ExponentSolver(Problem(PlaneSystem([drift, CoefficientMatrix(1, turn, identity)]), White(1.0)), rtol=1e-10)
    exponent, moment = solver.lyapunov_exponent(), solver.moments(2.0)
    assert abs(exponent.value - iv(1, 1.0) / iv(0, 1.0)) <= exponent.error_estimate < 1e-8
    assert abs(moment.value[0] - (math.sqrt(5) - 1)) <= moment.error_estimate[0] < 1e-8


@pytest.mark.parametrize("interpretation", ["stratonovich", "ito"])
@pytest.mark.parametrize("seed", range(8))
def test_random_systems_against_their_moments(seed, interpretation):
    """Also where the phase leaves a cone for ever: Λ(p) is that of the cone which grows more."""
    rng = np.random.default_rng([seed, 27])
    drift, driven = (rng.standard_normal((2, 2)) * 10 ** rng.uniform(low, 1) for low in (-1, -1.5))
    terms = CoefficientMatrix(0, drift.tolist()), CoefficientMatrix(1, driven.tolist(), identity)
    problem = Problem(PlaneSystem(terms), White(1.0, interpretation))
    found = moments(problem, [2.0, 4.0], rtol=1e-8)
    for value, error, p in zip(found.value, found.error_estimate, (2, 4), strict=True):
        assert abs(value - by_moments(problem, p)) <= error


def test_both_senses():
    """They are one for noise in the stiffness, as its matrix squared is 0, and ½s² of damping apart for noise in it."""
    same = [moments(oscillator(1.0, 0.1, 0.5, interpretation=each), 3.0).value[0] for each in ("stratonovich", "ito")]
    assert same[0] == pytest.approx(same[1], rel=1e-12)
    ito = moments(oscillator(1.0, 0.1, 0.5, DAMPING, interpretation="ito"), 3.0).value[0]
    assert ito == pytest.approx(moments(oscillator(1.0, 0.1 + 0.25 * 0.5**2, 0.5, DAMPING), 3.0).value[0], rel=1e-9)


@pytest.mark.parametrize("driven", [STIFFNESS, DAMPING])
def test_white_noise_is_the_limit_of_fast_noise(driven):
    """OU noise with S(0) = s² has Λ + aτ + bτ² + …, Λ that of white noise in Stratonovich's sense."""
    white = oscillator(1.0, 0.1, 0.5, driven, [WALL])
    fast = [
        moments(Problem(white.system, OrnsteinUhlenbeck(alpha=1 / tau, sigma=0.5 / tau)), 2.0, 1e-8).value[0]
        for tau in (0.016, 0.008, 0.004)
    ]
    expected = moments(white, 2.0).value[0]
    assert (8 * fast[2] - 6 * fast[1] + fast[0]) / 3 == pytest.approx(expected, abs=2e-6)
    assert fast[2] != pytest.approx(expected, abs=2e-5)


def test_growth_and_impacts_by_the_stationary_density():
    """λ by Furstenberg and Khasminskii, and N as the derivative of λ by ln R, from another solve."""
    problem = oscillator(1.0, -0.05, 0.5, DAMPING, [WALL], "ito")
    solver = ExponentSolver(problem, rtol=1e-10)
    exponent = solver.lyapunov_exponent()
    assert furstenberg_khasminskii(solver.pair(0.0)) == pytest.approx(exponent.value, abs=1e-8)
    softer = oscillator(1.0, -0.05, 0.5, DAMPING, [Jump(math.pi / 2, math.log(0.9))], "ito")
    change = ExponentSolver(softer, rtol=1e-10).lyapunov_exponent().value - exponent.value
    assert impact_rate(solver).value == pytest.approx(change / math.log(0.9 / 0.8), rel=1e-8)


def test_moments_of_negative_p_mirror_those_of_positive_p():
    """Λ(p) − ½p tr A is even about p = −1 where no noise changes volumes."""
    found = moments(oscillator(1.0, 0.1, 0.5), [1.0, -3.0, 2.5, -4.5]).value + 0.1 * np.array([1.0, -3.0, 2.5, -4.5])
    np.testing.assert_allclose(found[::2], found[1::2], atol=1e-9)


def test_derivatives_by_every_parameter():
    values = {"epsilon": 1.0, "stiffness": 1.2, "damping": 0.1, "loss": 0.2}
    rates, wall = ("v", "-stiffness*x - 2*damping*v + epsilon*xi*v"), {"at": "x = 0", "restitution": "exp(-loss)"}
    problem = Problem(PlaneSystem.of_equations(("x", "v"), rates, values, walls=[wall]), White(0.5, "ito"))
    slopes = sensitivities(problem, 2.0)
    assert {*slopes.theta} == {*(f"system.{name}" for name in ("epsilon", "stiffness", "damping", "loss")), "noise.s"}
    for key, theta in slopes.theta.items():
        h = 1e-3 * theta
        values = [moments(problem.at({key: theta + k * h}), 2.0, 1e-12).value[0] for k in (-2, -1, 1, 2)]
        difference = (8 * (values[2] - values[1]) - (values[3] - values[0])) / (12 * h)
        assert slopes.moments[0][key].value == pytest.approx(difference, rel=1e-7)


def test_the_paper_oscillator_under_white_noise():
    """Weak white noise has Λ₂ of Eq. (37) with S = s², and Λ − ε²Λ₂ is O(ε⁴) at least."""
    rest = []
    for epsilon in (0.2, 0.1):
        solver = ExponentSolver(Problem(VibroImpactOscillator(2.0, 0.9, 0.1, epsilon), White(0.6)), rtol=1e-11)
        second = epsilon**2 * (2.0 * (0.1 / 2 - (2.0 / math.pi) * 0.1 + 0.6**2 / 8) + 4.0 * 3 / 16 * 0.6**2)
        rest.append(abs(solver.moments(2.0).value[0] - second))
    assert rest[1] < rest[0] / 12 < 1e-6


def test_diffusion_is_exact_for_polynomials(rng):
    """∫ w D_a D_b T of trigonometric T, w that elements of a high degree resolve."""
    axis = PhaseAxis(np.linspace(0.3, 0.3 + math.pi, 5), np.full(4, 14))
    a, b = (CoefficientMatrix(0, rng.standard_normal((2, 2)).tolist()) for _ in range(2))
    at, weights, p = axis.points, axis.weights, 1.7
    w, t, slope, curve = np.cos(2 * at), np.sin(2 * at + 0.4), 2 * np.cos(2 * at + 0.4), -4 * np.sin(2 * at + 0.4)
    inner = b.h(at) * slope + p * b.q(at) * t
    inner_slope = b.h.slope(at) * slope + b.h(at) * curve + p * (b.q.slope(at) * t + b.q(at) * slope)
    exact = float(weights @ (w * (a.h(at) * inner_slope + p * a.q(at) * inner)))
    values = axis.values * weights[:, None]
    parts = axis.diffusion(a, b)
    assert (values.T @ w) @ sum(p**k * part for k, part in enumerate(parts)) @ (values.T @ t) == pytest.approx(exact)


def test_refused():
    terms = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0))), CoefficientMatrix(1, STIFFNESS, np.sin)
    with pytest.raises(ValueError, match=r"g = sin\(ξ\) of it has no meaning"):
        Problem(PlaneSystem(terms), White(1.0))
    with pytest.raises(ValueError, match="moves the phase across the ray of a jump"):
        oscillator(jumps=[Jump(0.0, -0.1)])
    with pytest.raises(ValueError, match="interpretation"):
        White(1.0, "backwards")


def test_it_pickles():
    problem = pickle.loads(pickle.dumps(oscillator(1.0, 0.1, 0.5)))
    assert problem == oscillator(1.0, 0.1, 0.5)
    assert problem.diffusions


def test_its_unit_is_that_of_the_noise():
    """The oscillator's ξ is in 1/time; what another system multiplies is not known, nor the unit of s."""
    assert (
        Problem(VibroImpactOscillator(2.0, 0.9, 0.1, 0.1), White(0.6)).parameters["noise.s"].quantity.unit
        == "1/time^(1/2)"
    )
    assert oscillator().parameters["noise.s"].quantity.unit == "unknown"
