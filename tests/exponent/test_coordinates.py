"""Λ(p) does not depend on the coordinates in which a system is given, nor on the units."""

import math

import numpy as np
import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, moment_lyapunov, sensitivities
from fpsolve.arrays import identity
from fpsolve.exponent import critical_impact_factor, impact_rate
from fpsolve.model import CoefficientMatrix, ModalSystem, ParametricOscillator, Telegraph, White
from fpsolve.theory.perturbation import perturbed_moments
from tests.conftest import sampled
from tests.oracles import moment_hierarchy


def assert_right(problem, p, right, digits):
    """Λ(p) is within one and a half of its error, which is small."""
    found = moment_lyapunov(problem, p)
    value, error = found.value[0], found.error_estimate[0]
    assert error <= digits * max(abs(right), found.solver.scale(p))
    assert abs(value - right) <= 1.5 * error


@pytest.mark.parametrize(
    ("stiffness", "damping", "s", "p", "right"),
    [
        (900.0, 35.0, 600.0, 8.0, 383.117962647),
        (25e4, 1000.0, 1e5, 3.0, 2431.057834),
        (25e4, 1000.0, 1e5, 2.0, 1080.85946039),
        (0.2847996839106912, 1.033337807595426 / 2, 90.70639802418872, 12.0, 315.515562463),
        (0.0, 0.0, 1e6, 2.0, (2 * 1e12) ** (1 / 3)),  # E x², E xv, E v²: Λ³ = 2 s²
        (-1e4, 10.0, 1e3, 2.0, 202.257861168),
    ],
)
def test_white_noise_that_is_not_beside_a_rotation(stiffness, damping, s, p, right):
    problem = Problem(ParametricOscillator(stiffness, damping), White(s))
    assert_right(problem, p, right, 1e-8)
    free = ((0.0, 1.0), (-stiffness, -2 * damping))
    if p % 2 == 0:
        moments = moment_hierarchy.white_noise_exponent(free, [((0.0, 0.0), (-s, 0.0))], int(p))
        assert moments == pytest.approx(right, rel=1e-8)
    value, error = ExponentSolver(problem).ratio_alone(0.0)
    assert error <= 1e-6 * abs(value)


@pytest.mark.parametrize("seed", range(12))
def test_white_noise_in_any_coordinates(seed):
    rng = np.random.default_rng(seed)
    drift, noise = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)) * 10 ** rng.uniform(-1.5, 2)
    right = moment_hierarchy.white_noise_exponent(drift, [noise], 4)
    basis, rate = np.diag([1.0, 10 ** rng.uniform(-7, 7)]) @ rng.normal(size=(2, 2)), 10 ** rng.uniform(-9, 12)
    inverse = np.linalg.inv(basis)
    terms = [
        CoefficientMatrix(0, rate * basis @ drift @ inverse),
        CoefficientMatrix(1, math.sqrt(rate) * basis @ noise @ inverse, identity),
    ]
    assert_right(Problem(PlaneSystem(terms), White(1.0)), 4.0, rate * right, 1e-8)


@pytest.mark.parametrize("noise", [Telegraph(a=1.0, k=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)])
def test_overdamped_systems_in_fast_units(noise):
    """ẍ + 2bẋ + (k + ξ)x = 0 in units in which the noise is slow, in which it is of order 1, and in faster ones."""
    found = []
    for rate in (1e-3, 1.0, 30.0, 1e3, 1e6):
        if isinstance(noise, Telegraph):
            scaled = Telegraph(a=0.8 * rate**2, k=rate)
        else:
            scaled = OrnsteinUhlenbeck(alpha=rate, sigma=0.8 * rate**2.5)
        problem = Problem(ParametricOscillator(0.9 * rate**2, 10.0 * rate), scaled)
        found.append((moment_lyapunov(problem, [1.0, 2.0]), rate))
    first, _ = found[1]
    for each, rate in found:
        error = each.error_estimate / rate + first.error_estimate
        np.testing.assert_array_less(np.abs(each.value / rate - first.value), 1.5 * error)
        np.testing.assert_array_less(error, 1e-5)


RATES = np.diag([-1.0, -0.5]), np.diag([0.3, 0.6])


@pytest.mark.parametrize("coupling", [0.0, 0.7])
@pytest.mark.parametrize("noise", [OrnsteinUhlenbeck, White])
@pytest.mark.parametrize(
    ("rate", "basis"),
    [
        (1.0, np.eye(2)),
        (1.0, [[1.0, 0.5], [-0.75, 1.0]]),
        (1e7, np.diag([1.0, 2.0**12])),
        (1e-8, np.diag([2.0**20, 1.0])),
    ],
)
def test_rays_that_the_phase_never_leaves_in_any_units(coupling, noise, rate, basis):
    """Each y_i grows by itself, Λ_i(p) = a_i p + ½ b_i² S(0) p², and the second one drives the first."""
    made = White(1 / math.sqrt(rate)) if noise is White else OrnsteinUhlenbeck(rate, math.sqrt(rate))
    steady, driven = (each + np.array([[0.0, coupling], [0.0, 0.0]]) for each in RATES)
    basis = np.array(basis)
    terms = [
        CoefficientMatrix(0, rate * basis @ steady @ np.linalg.inv(basis)),
        CoefficientMatrix(1, rate * basis @ driven @ np.linalg.inv(basis), identity),
    ]
    solver = ExponentSolver(Problem(PlaneSystem(terms), made))
    value = solver.moments([1.0, 3.0]).value / rate
    np.testing.assert_allclose(value, [-0.5 + 0.18, -1.5 + 4.5 * 0.36], rtol=1e-12)
    assert solver.lyapunov_exponent().value / rate == pytest.approx(-0.5, rel=1e-12)
    assert len(solver.problem.invariant_rays) == (1 if coupling else 2)


def resonator(rate, restitution=1.0, noise=0.5):
    """ẍ + 0.2ẋ + (1 + ξ)x = 0 in other units of time: at 1e7 a resonator of MHz in seconds."""
    law = OrnsteinUhlenbeck(alpha=rate, sigma=noise * rate**2.5)
    return Problem(ParametricOscillator(rate**2, 0.1 * rate, restitution), law)


def test_a_fast_resonator():
    found = moment_lyapunov(resonator(1e7), [2.0])
    free, driven = [[0.0, 1.0], [-1.0, -0.2]], [[0.0, 0.0], [-1.0, 0.0]]
    right = moment_hierarchy.ornstein_uhlenbeck_exponent(
        np.array(free), np.array(driven), 1.0, 0.5 / math.sqrt(2), 2, 40
    )
    assert abs(found.value[0] / 1e7 - right) <= 1.5 * found.error_estimate[0] / 1e7 < 1e-8
    assert found.notes == ()
    assert resonator(1e7).invariant_rays == ()
    white = moment_lyapunov(Problem(ParametricOscillator(1e14, 1e6), White(0.5 * 1e7**1.5)), [2.0])
    moments = moment_hierarchy.white_noise_exponent(free, [0.5 * np.array(driven)], 2)
    assert white.value[0] / 1e7 == pytest.approx(moments, rel=1e-8)


@pytest.mark.parametrize("rate", [1e-7, 4.0**5, 1e7 / 3])
def test_all_numbers_of_a_resonator_with_a_wall(rate):
    own, other = (ExponentSolver(resonator(each, 0.8, 0.3)) for each in (1.0, rate))

    def numbers(solver, unit):
        problem, time = solver.problem, 1 / unit
        changes = sensitivities(problem, 2.0).moments[0]
        scales = {"system.stiffness": unit, "system.damping": 1.0, "system.restitution": time, "noise.alpha": 1.0}
        return [
            *time * solver.moments([-1.0, 2.0]).value,
            *time * perturbed_moments(problem, np.array([-1.0, 2.0])),
            time * solver.lyapunov_exponent().value,
            time * solver.variance_rate().value,
            time * impact_rate(solver).value,
            critical_impact_factor(solver).value,
            *(scale * changes[key].value for key, scale in scales.items()),
        ]

    np.testing.assert_allclose(numbers(other, rate), numbers(own, 1.0), rtol=1e-11)


@pytest.mark.parametrize("rate", sampled(1e6, 1e-6))
def test_two_modes_in_any_unit_of_time(rate):
    """In SI units and in those of the slower mode, by positions and velocities."""

    def solver(unit):
        stiffness = unit**2 * np.array([[1.0, 0.2], [0.2, 4.0]])
        system = ModalSystem.of(
            np.eye(2).tolist(),
            stiffness.tolist(),
            (unit * np.diag([0.1, 0.2])).tolist(),
            stiffness_noise=(unit**2 * np.array([[0.5, 0.3], [0.3, 0.8]])).tolist(),
        )
        return ExponentSolver(Problem(system, White(0.6 / math.sqrt(unit))), rtol=1e-3)

    own, other = solver(1.0).moments([1.0]), solver(rate).moments([1.0])
    assert abs(own.value[0] - other.value[0] / rate) <= 1.5 * (own.error_estimate[0] + other.error_estimate[0] / rate)
    assert other.error_estimate[0] / rate <= 1e-3 * own.solver.scale(1.0)
    assert other.solver.scale(1.0) / rate == pytest.approx(own.solver.scale(1.0), rel=0.5)


@pytest.mark.parametrize("p", [[2.0], [-0.5, 1.0, 2.0, 4.0], [4.0, 2.0]])
def test_noise_that_is_nearly_white(p):
    """τω = 2.5e-13: the limit is white noise with the same S(0), to order τ."""
    alpha, sigma, damping = 4062377457933.0483, 4531886108703.288, 0.30232299121798145
    found = moment_lyapunov(Problem(ParametricOscillator(1.0, damping), OrnsteinUhlenbeck(alpha, sigma)), p)
    right = moment_lyapunov(Problem(ParametricOscillator(1.0, damping), White(sigma / alpha)), p)
    np.testing.assert_array_less(np.abs(found.value - right.value), 1.5 * found.error_estimate)
    np.testing.assert_array_less(found.error_estimate, 1e-8)
    np.testing.assert_allclose(found.derivative, right.derivative, rtol=1e-6)
