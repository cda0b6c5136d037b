"""Motions in the plane: h and q of a matrix, the paper's oscillator among them, and what is refused."""

import math

import numpy as np
import pytest

import fpsolve.analysis
import fpsolve.exponent
import fpsolve.measured
import fpsolve.nonlinear
import fpsolve.simulation
from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain
from fpsolve.model.plane import angular_frequency, growth_rate, matrix_at, phase_speed

PHI = np.linspace(0, 2 * np.pi, 33)
ROTATION = ((0.0, 1.3), (-1.3, 0.0))


def test_h_and_q_of_any_matrix(rng):
    matrix = rng.normal(size=(2, 2))
    term = CoefficientMatrix(1, matrix)
    e = np.stack([np.cos(PHI), -np.sin(PHI)])
    turned = np.stack([-np.sin(PHI), -np.cos(PHI)])
    np.testing.assert_allclose(term.q(PHI), np.einsum("in,ij,jn->n", e, matrix, e), atol=1e-14)
    np.testing.assert_allclose(term.h(PHI), np.einsum("in,ij,jn->n", turned, matrix, e), atol=1e-14)


def test_the_papers_functions_follow_from_its_matrices():
    """Eqs. (17)-(18)."""
    oscillator = VibroImpactOscillator(omega=1.3, restitution=0.8, c1=-0.4, epsilon=0.3)
    h1, q1 = oscillator.terms[1].h, oscillator.terms[1].q
    np.testing.assert_allclose(h1(PHI), 0.5 * np.sin(2 * PHI), atol=1e-15)
    np.testing.assert_allclose(q1(PHI), 0.5 * (1 - np.cos(2 * PHI)), atol=1e-15)
    np.testing.assert_allclose(oscillator.h2(PHI), -0.4 * h1(PHI), atol=1e-15)
    np.testing.assert_allclose(oscillator.q2(PHI), -0.4 * q1(PHI), atol=1e-15)
    xi = 2.5
    speed = 1.3 + 0.3 * h1(PHI) * xi + 0.3**2 * oscillator.h2(PHI)
    np.testing.assert_allclose(phase_speed(oscillator, xi)(PHI), speed, atol=1e-14)
    growth = 0.3 * q1(PHI) * xi + 0.3**2 * oscillator.q2(PHI)
    np.testing.assert_allclose(growth_rate(oscillator, xi)(PHI), growth, atol=1e-14)
    (jump,) = oscillator.jumps
    assert (jump.phase, jump.log_factor) == (math.pi / 2, oscillator.log_impact_factor)
    assert angular_frequency(oscillator) == 1.3


def test_polar_form_against_the_motion_itself(rng):
    """A small step of ẋ = A x moves φ by h dt and ln a by q dt."""
    system = PlaneSystem(
        [CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, rng.normal(size=(2, 2)), identity)], epsilon=0.7
    )
    xi, phi, dt = 0.9, 2.1, 1e-6
    x = np.array([math.cos(phi), -math.sin(phi)])
    moved = x + dt * matrix_at(system, xi) @ x
    assert (math.atan2(-moved[1], moved[0]) - phi) / dt == pytest.approx(float(phase_speed(system, xi)(phi)), rel=1e-5)
    assert math.log(np.linalg.norm(moved)) / dt == pytest.approx(float(growth_rate(system, xi)(phi)), rel=1e-5)


def test_the_unit_of_rates():
    assert angular_frequency(PlaneSystem([CoefficientMatrix(0, ((0, 2.0), (-0.5, 0)))])) == pytest.approx(1.0)
    assert angular_frequency(PlaneSystem([CoefficientMatrix(0, ((-0.1, 1.0), (-1.0, -0.3)))])) == pytest.approx(
        abs(np.linalg.eigvals([[-0.1, 1.0], [-1.0, -0.3]])[0].imag)
    )
    assert angular_frequency(PlaneSystem([CoefficientMatrix(0, ((0, 3.0), (0, 0)))])) == 3.0
    assert angular_frequency(PlaneSystem([CoefficientMatrix(1, ((0, 3.0), (0, 0)))], epsilon=0.5)) == 1.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CoefficientMatrix(0, ((1, 2), (3,))), "inhomogeneous|two rows of two finite numbers"),
        (lambda: CoefficientMatrix(0, ((1, 2), (3, math.nan))), "two rows of two finite numbers"),
        (lambda: CoefficientMatrix(-1, ROTATION), "a whole number >= 0"),
        (lambda: CoefficientMatrix(0.5, ROTATION), "a whole number >= 0"),
        (lambda: Jump(math.inf, 0.0), "both must be finite"),
        (lambda: Jump(0.0, -math.inf), "both must be finite"),
        (lambda: PlaneSystem([]), "needs one at least"),
        (lambda: PlaneSystem([CoefficientMatrix(0, ROTATION)], epsilon=0.0), "a positive number"),
        (
            lambda: PlaneSystem([CoefficientMatrix(0, ROTATION)], [Jump(0.1, 1), Jump(0.1 + math.pi, 1)]),
            "differ modulo pi",
        ),
    ],
)
def test_what_is_no_motion_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


SYSTEM = PlaneSystem([CoefficientMatrix(0, ROTATION)])
AXES = fpsolve.analysis.Axis("noise.alpha", 0.5, 2.0), fpsolve.analysis.Axis("noise.sigma", 0.5, 2.0)


@pytest.mark.parametrize(
    "call",
    [
        lambda of: fpsolve.moment_lyapunov(of, 2.0),
        lambda of: fpsolve.lyapunov_exponent(of),
        lambda of: fpsolve.stability_index(of),
        lambda of: fpsolve.ExponentSolver(of),
        lambda of: fpsolve.MomentLyapunovFunction(of, (1.0, 2.0)),
        lambda of: fpsolve.boundary(of, "lyapunov_exponent", *AXES),
        lambda of: fpsolve.sensitivities(of, 2.0),
        lambda of: fpsolve.simulate(of, 2.0),
        lambda of: fpsolve.prove(of, 2.0),
        lambda of: fpsolve.analysis.design(of, "lyapunov_exponent = 0", "noise.sigma"),
        lambda of: fpsolve.analysis.excursion(of),
        lambda of: fpsolve.analysis.uncertainty(of, {"noise.sigma": 0.1}),
        lambda of: fpsolve.nonlinear.stationary_response(of),
        lambda of: fpsolve.simulation.simulated_response(of, 0.1, 0.1, paths=32, time=1.0, step=0.1, seed=1),
        lambda of: fpsolve.measured.verdict(of, None),
    ],
)
def test_a_system_alone_is_no_problem(call):
    for wrong in (SYSTEM, "x"):
        with pytest.raises(TypeError, match=r"^got problem = .*; must be a Problem, .*: Problem\(system, noise\)$"):
            call(wrong)


@pytest.mark.parametrize("wrong", ["x", None, 2.0, VibroImpactOscillator, OrnsteinUhlenbeck], ids=repr)
def test_problems_are_made_of_a_motion_and_a_noise(wrong):
    noise = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=0.1)
    for halves, kind in (((wrong, noise), "motion"), ((oscillator, wrong), "noise")):
        with pytest.raises(TypeError, match=rf"^got .* as a {kind}; must be a system and a noise: "):
            Problem(*halves)


@pytest.mark.parametrize(
    "g",
    [
        lambda x: np.zeros(3),
        lambda x: np.zeros((2, *np.shape(x))),
        lambda x: [[1.0], [2.0, 3.0]],
        lambda x: None,
        lambda x: "x",
        lambda x: x + 1j,
    ],
)
def test_a_coefficient_of_another_shape_is_one_sentence(g):
    system = PlaneSystem([CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), g)])
    with pytest.raises(ValueError, match=r"^g returned .* for an array of shape \(\d+,\); must be [^\n]*$"):
        fpsolve.moment_lyapunov(Problem(system, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)), 2.0)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: CoefficientMatrix(True, ROTATION), "^got order = True and matrix = .*; must be a whole number >= 0"),
        (lambda: CoefficientMatrix(0, [[True, 1.0], [0.0, 1.0]]), "must be .* two rows of two finite numbers"),
        (lambda: CoefficientMatrix(0, [["0", "1"], ["1", "0"]]), "must be .* two rows of two finite numbers"),
        (lambda: CoefficientMatrix(0, ROTATION, np.zeros((2, 2))), r"^got g = array\(.*; must be a function of xi$"),
        (lambda: Jump(True, 0.0), "got phase = True, log_factor = 0.0; both must be finite"),
        (lambda: Jump(0.0, "x"), "both must be finite"),
        (lambda: Jump(0.0, 0.0, math.nan), "and leading, here nan"),
        (lambda: PlaneSystem([True]), r"^got terms = \[True\]; must be a list, each a CoefficientMatrix$"),
        (lambda: PlaneSystem([CoefficientMatrix(0, ROTATION)], 3.0), "^got jumps = 3.0; must be a list, each a Jump$"),
        (lambda: PlaneSystem([CoefficientMatrix(0, ROTATION)], epsilon=True), "epsilon must be a finite number"),
        (
            lambda: MarkovChain.telegraph(0.5, 1e300),
            r"^got rates of sizes up to 1e\+300; must be from 1e-15",
        ),
        (lambda: MarkovChain.telegraph(1e-300, 1.0), "^got states of sizes up to 1e-300; must be from"),
        (lambda: MarkovChain.telegraph(True, 1.0), "^amplitude must be a finite number, got True$"),
    ],
)
def test_numbers_that_are_none_are_one_sentence(make, said):
    with pytest.raises((ValueError, TypeError), match=said):
        make()


def test_a_tolerance_is_a_number():
    system = PlaneSystem([CoefficientMatrix(0, ROTATION)])
    with pytest.raises(TypeError, match=r"^got rtol = True; must be a number"):
        fpsolve.lyapunov_exponent(Problem(system, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)), rtol=True)
