"""Eqs. (33)-(39): closed forms, and the finite elements as ε tends to 0."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.arrays import identity
from fpsolve.exponent.fields import fields
from fpsolve.messages import Code
from fpsolve.model import Bounded, CoefficientMatrix, White
from fpsolve.theory import scale_of
from fpsolve.theory.perturbation import perturbed_moments, weak_noise_note
from tests.oracles import perturbation

OU = OrnsteinUhlenbeck(alpha=1.7, sigma=0.9)
OSCILLATOR = VibroImpactOscillator(omega=1.3, restitution=0.8, c1=0.1, epsilon=0.2)
h1, q1 = OSCILLATOR.terms[1].h, OSCILLATOR.terms[1].q


def partial(f, x, h=1e-5):
    return (f(x + h) - f(x - h)) / (2 * h)


def test_first_order_eigenfunction_solves_eq_32(rng):
    phi, xi, p = rng.uniform(0, 2 * np.pi, 30), rng.normal(size=30), 2.5

    def t1(phi, xi):
        return perturbation.first_order_eigenfunction(OSCILLATOR, OU, p, phi, xi)

    # T₁ is linear in ξ, so its second derivative in ξ vanishes
    np.testing.assert_allclose(t1(phi, 2 * xi), 2 * t1(phi, xi), rtol=1e-14)
    l0_t1 = -OU.alpha * xi * partial(lambda x: t1(phi, x), xi) + OSCILLATOR.omega * partial(lambda x: t1(x, xi), phi)
    np.testing.assert_allclose(l0_t1, -p * q1(phi) * xi, atol=1e-9)


@pytest.mark.parametrize("p", [-2.0, 0.5, 3.0])
def test_eq_36_is_the_solvability_integral_of_eq_35(p):
    """Λ₂ = ⟨p q₂⟩ + ⟨L₁T₁⟩ by quadrature, the impacts adding p(r − 1) ω/π to ⟨p q₂⟩."""
    phi = 2 * np.pi * np.arange(64) / 64
    z, weights = hermegauss(12)
    xi = OU.standard_deviation * z

    def t1(phi):
        return perturbation.first_order_eigenfunction(OSCILLATOR, OU, p, phi[:, None], xi)

    l1_t1 = xi * (h1(phi)[:, None] * partial(t1, phi) + p * q1(phi)[:, None] * t1(phi))
    noise_part = np.mean(l1_t1 @ weights / weights.sum())
    impact_part = p * (OSCILLATOR.restitution - 1) * OSCILLATOR.omega / np.pi
    expected = p * OSCILLATOR.c1 / 2 + impact_part + noise_part
    value = perturbation.moment_exponent(OSCILLATOR, OU, p) / OSCILLATOR.epsilon**2
    assert value == pytest.approx(expected, rel=1e-8)


def test_indices_follow_from_the_moment_exponent():
    p = perturbation.stability_index(OSCILLATOR, OU)
    assert perturbation.moment_exponent(OSCILLATOR, OU, p) == pytest.approx(0, abs=1e-16)
    slope = partial(lambda x: perturbation.moment_exponent(OSCILLATOR, OU, x), 0.0)
    assert perturbation.lyapunov_exponent(OSCILLATOR, OU) == pytest.approx(slope, rel=1e-9)
    values = perturbation.moment_exponent(OSCILLATOR, OU, [-1.0, 0.0, 1.0])
    assert perturbation.variance_rate(OSCILLATOR, OU) == pytest.approx(np.diff(values, 2)[0], rel=1e-12)


def test_scale_is_never_less_than_the_moment_exponent():
    p = np.linspace(-5, 5, 21)
    assert np.all(perturbation.moment_scale(OSCILLATOR, OU, p) >= abs(perturbation.moment_exponent(OSCILLATOR, OU, p)))


SETS = {
    "fig1": ({"omega": 1.0, "restitution": 0.8, "c1": 0.1}, OrnsteinUhlenbeck(alpha=2.047619, sigma=2.828427)),
    "fast": ({"omega": 3.0, "restitution": 0.7, "c1": -0.2}, OrnsteinUhlenbeck(alpha=8.0, sigma=6.0)),
    "slow": ({"omega": 2.0, "restitution": 0.9, "c1": 0.3}, OrnsteinUhlenbeck(alpha=0.7, sigma=0.8)),
}


@pytest.mark.parametrize("p", [-2.0, 1.0, 4.0])
@pytest.mark.parametrize("name", SETS)
def test_finite_elements_leave_second_order_theory_by_epsilon_to_the_fourth(name, p):
    parameters, noise = SETS[name]
    constants = []
    for epsilon in (0.2, 0.1, 0.05, 0.025):
        oscillator = VibroImpactOscillator(**parameters, epsilon=epsilon)
        value = ExponentSolver(Problem(oscillator, noise), rtol=1e-12).pair(p).value
        difference = value - perturbation.moment_exponent(oscillator, noise, p)
        constants.append(difference / epsilon**4)
    # the next term is ε⁶: each halving of ε divides the distance to the limit by four
    steps = np.abs(np.diff(constants))
    assert abs(constants[-1]) > 1e-6
    limits = [(4 * fine - coarse) / 3 for coarse, fine in pairwise(constants)]
    assert limits[2] == pytest.approx(limits[1], rel=2e-3)
    np.testing.assert_allclose(steps[:-1] / steps[1:], 4, rtol=0.25)


@pytest.mark.parametrize("p", [-1.0, 2.0])
def test_eigenfunction_tends_to_1_plus_epsilon_T1(p):
    """On [π/2, 3π/2], where the impact adds a sawtooth of order ε² only."""
    errors = []
    phi, xi = np.linspace(np.pi / 2, 3 * np.pi / 2, 41)[1:-1], OU.standard_deviation * np.linspace(-3, 3, 31)
    for epsilon in (0.04, 0.02, 0.01):
        oscillator = VibroImpactOscillator(omega=1.3, restitution=0.8, c1=0.1, epsilon=epsilon)
        space = (pair := ExponentSolver(Problem(oscillator, OU)).pair(p)).space
        t1 = perturbation.first_order_eigenfunction(oscillator, OU, p, phi[:, None], xi)
        values = fields(pair, phi, space.phi.at(phi), space.xi.at(xi / OU.standard_deviation)).right
        errors.append(np.max(np.abs(values - 1 - epsilon * t1)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2, atol=0.15)


@pytest.mark.parametrize("detuning", [0.0, 1e-15, 0.3])
def test_no_theory_stands_beside_a_harmonic_load(detuning):
    """Its S is 0 at all frequencies but one, as if it did not pump; the note names it, and not strong noise."""
    terms = [
        CoefficientMatrix(0, ((0.0, 1.0), (-1.69, -0.2))),
        *(CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity, name) for name in ("pump", "sway")),
    ]
    pumped = Problem(PlaneSystem(terms), {"pump": Bounded(0.5, 2.6 + detuning, 0.0), "sway": White(s=0.1)})
    p, value = np.array([1.0, 2.0]), np.array([0.3, 0.6])
    assert np.all(np.isnan(perturbed_moments(pumped, p)))
    note = weak_noise_note(pumped, p, value)
    assert note.code is Code.LOAD_LEFT_OUT
    assert "noise.pump with sigma = 0 is" in str(note)
    random = Problem(PlaneSystem(terms), {"pump": Bounded(0.5, 2.6, 2.0), "sway": White(s=0.1)})
    assert np.all(np.isfinite(perturbed_moments(random, p)))
    assert weak_noise_note(random, p, value).code is Code.STRONG_NOISE
    assert scale_of(pumped).moment(2.0) < 3 * scale_of(random).moment(2.0)
