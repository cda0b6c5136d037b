"""Kinds, parameters and coefficients as values: what a user gives is taken by what it is, not by who made it."""

import functools
import math
import pickle

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
    sensitivities,
)
from fpsolve.arrays import Constant, Linear
from fpsolve.model import CoefficientMatrix, Jump, ReducedNoise, noise_kind, system_kind
from fpsolve.model.kinds import NOISES, SYSTEMS
from fpsolve.model.plane import affine, coefficient, is_driven
from fpsolve.theory import second_order

ROTATION, STIFFNESS, DAMPING = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, -0.2))
NOISE = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)


class Gain:
    """A function that cannot be hashed, as it compares by value."""

    def __init__(self, size=1.0):
        self.size = size

    def __call__(self, xi):
        return self.size * xi

    def __eq__(self, other):
        return isinstance(other, Gain) and self.size == other.size


def scaled(xi, size):
    return size * xi


def driven(g, matrix=STIFFNESS):
    return PlaneSystem(
        [CoefficientMatrix(0, ROTATION), CoefficientMatrix(0, DAMPING), CoefficientMatrix(1, matrix, g)], epsilon=0.3
    )


@pytest.mark.parametrize(
    "g",
    [lambda xi: xi, functools.partial(scaled, size=1.0), Gain(), np.positive],
    ids=["lambda", "partial", "object", "u"],
)
def test_any_callable_is_the_coefficient_that_it_computes(g):
    expected = moment_lyapunov(Problem(driven(Linear()), NOISE), [1.0, 2.0])
    found = moment_lyapunov(Problem(driven(g), NOISE), [1.0, 2.0])
    np.testing.assert_allclose(found.value, expected.value, rtol=1e-14)
    [slopes], [others] = (sensitivities(Problem(driven(each), NOISE), 2.0).moments for each in (g, Linear()))
    assert slopes["noise.sigma"].value == pytest.approx(others["noise.sigma"].value, rel=1e-12)
    assert second_order(Problem(driven(g), NOISE)) == second_order(Problem(driven(Linear()), NOISE))
    if "lambda" not in repr(g):
        assert pickle.loads(pickle.dumps(found)).value[0] == found.value[0]


def test_a_constant_function_is_no_noise_and_a_factor_is_one():
    """g = 2ξ is g = ξ with twice the matrix, g = 3 a constant with three times the matrix."""
    own = PlaneSystem(
        [
            CoefficientMatrix(0, ROTATION),
            CoefficientMatrix(0, DAMPING, lambda xi: 3.0),
            CoefficientMatrix(1, STIFFNESS, lambda xi: 2 * xi),
        ],
        epsilon=0.3,
    )
    triple, double = (np.multiply(k, a).tolist() for k, a in ((3, DAMPING), (2, STIFFNESS)))
    plain = PlaneSystem(
        [CoefficientMatrix(0, ROTATION), CoefficientMatrix(0, triple), CoefficientMatrix(1, double, Linear())],
        epsilon=0.3,
    )
    one, other = (Problem(each, NOISE) for each in (own, plain))
    assert second_order(one).moment_exponent(2.0) == pytest.approx(second_order(other).moment_exponent(2.0), rel=1e-14)
    assert ExponentSolver(one).scale(2.0) == pytest.approx(ExponentSolver(other).scale(2.0), rel=1e-14)
    assert moment_lyapunov(one, 2.0).value[0] == pytest.approx(moment_lyapunov(other, 2.0).value[0], rel=1e-13)


@pytest.mark.parametrize(
    ("g", "line"),
    [
        (lambda xi: 1.5 - 0.5 * xi, (1.5, -0.5)),
        (Constant(2.0), (2.0, 0.0)),
        (Linear(), (0.0, 1.0)),
        (np.tanh, None),
        (np.abs, None),
        (lambda xi: np.clip(xi, -1e4, 1e4), None),
        (lambda xi: np.sqrt(1 - xi**2), None),
        (lambda xi: xi + 1e-9 * np.sin(xi), None),
    ],
)
def test_what_is_affine(g, line):
    found = affine(coefficient(g))
    assert (found is None) == (line is None)
    if line is not None:
        assert found == pytest.approx(line, rel=1e-14, abs=1e-15)
    assert is_driven(coefficient(g)) == (line is None or line[1] != 0)


def test_no_function_is_refused():
    with pytest.raises(TypeError, match=r"got g = 3\.0; must be a function of xi"):
        CoefficientMatrix(0, ROTATION, 3.0)


def pendulum(omega, damping, loss):
    """Powers and a wall, so that no derivative is that of a linear function."""
    free = CoefficientMatrix(0, ((0.0, omega), (-omega, 0.0)))
    return [
        free,
        CoefficientMatrix(0, ((0.0, 0.0), (0.0, -(damping**2)))),
        CoefficientMatrix(1, STIFFNESS, Linear()),
    ], [Jump(math.pi / 2, math.log(1 - loss))]


def test_derivatives_by_named_parameters():
    system = PlaneSystem.of(pendulum, omega=1.3, damping=0.4, loss=0.1)
    [rotation], none = system.derivative("omega")
    np.testing.assert_allclose(rotation.matrix, [[0, 1], [-1, 0]], atol=1e-12)
    assert none == ()
    [damping], _ = system.derivative("damping")
    np.testing.assert_allclose(damping.matrix, [[0, 0], [0, -0.8]], atol=1e-12)
    nothing, [slope] = system.derivative("loss")
    assert nothing == ()
    assert slope == pytest.approx(-1 / 0.9, rel=1e-11)


@pytest.mark.slow
def test_sensitivities_to_named_parameters_are_differences():
    theta = {"omega": 1.3, "damping": 0.4, "loss": 0.1}
    [found] = sensitivities(Problem(PlaneSystem.of(pendulum, **theta), NOISE), 1.5).moments
    for name, h in dict.fromkeys(theta, 1e-4).items():
        ahead, behind = (
            moment_lyapunov(
                Problem(PlaneSystem.of(pendulum, **{**theta, name: theta[name] + d}), NOISE), 1.5, rtol=1e-11
            ).value[0]
            for d in (h, -h)
        )
        assert found[f"system.{name}"].value == pytest.approx((ahead - behind) / (2 * h), rel=1e-6)


def test_terms_that_carry_their_parameters():
    terms = [
        ("", CoefficientMatrix(0, ROTATION)),
        ("c", CoefficientMatrix(0, ((0.0, 0.0), (0.0, -1.0)))),
        ("s", CoefficientMatrix(1, STIFFNESS, Linear())),
    ]
    system = PlaneSystem.of_terms(terms, c=0.2, s=1.0, epsilon=0.3)
    assert (
        moment_lyapunov(Problem(system, NOISE), 2.0).value[0]
        == moment_lyapunov(Problem(driven(Linear()), NOISE), 2.0).value[0]
    )
    assert system.at({"c": 0.5}).terms[1].matrix == ((0.0, 0.0), (0.0, -0.5))
    assert dict(system.at({"epsilon": 0.1}).values) == {"epsilon": 0.1, "c": 0.2, "s": 1.0}
    assert pickle.loads(pickle.dumps(system)) == system
    with pytest.raises(ValueError, match=r"got values of \['c'\]; must be of \['c', 's'\]"):
        PlaneSystem.of_terms(terms, c=0.2)
    with pytest.raises(ValueError, match="got mass; the parameters are epsilon, c, s"):
        system.at({"mass": 1.0})
    with pytest.raises(ValueError, match="got c = nan; must be a finite number"):
        PlaneSystem.of_terms(terms, c=math.nan, s=1.0)


def test_a_problem_knows_its_parameters():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
    problem = Problem(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction())
    told = problem.parameters
    assert told["noise.D0"].value == 1.0
    assert told["noise.D0"].quantity.title == "noise intensity $D_0$ (1/time)"
    assert told["noise.treatment"].value == "ou-reduction"
    assert set(problem.differentiable) == {key for key in told if not isinstance(told[key].value, str)} - {
        "oscillator.c2", "oscillator.c3",
    }  # fmt: skip
    other = problem.at({"noise.D0": 2.0, "noise.treatment": "exact", "oscillator.omega": 3.0})
    assert other.noise == NonGaussianNoise(D0=2.0, tau0=0.5, r0=0.95)
    assert other.system.omega == 3.0
    assert problem.derivative("oscillator.c1").theta == 0.1
    for wrong, text in (("noise.x", "unknown"), ("mass.m", "got mass.m; the parameters are oscillator.omega")):
        with pytest.raises(ValueError, match=text):
            problem.at({wrong: 1.0})
    with pytest.raises(ValueError, match=r"got oscillator\.c2; the parameters to differentiate by are"):
        problem.derivative("oscillator.c2")


def test_a_reduced_noise_knows_what_it_replaces():
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.9)
    reduced = noise.ou_reduction()
    assert isinstance(reduced, ReducedNoise)
    assert reduced.replaces == noise
    assert (reduced.D0, reduced.tau0, reduced.r0) == (1.0, 0.5, 0.9)
    assert reduced.sigma == math.sqrt(2.0) / 0.5
    assert reduced.alpha == pytest.approx((5 - 2.7) / (2 * 1.1 * 0.5), rel=1e-15)
    assert reduced.at({"treatment": "exact"}) == noise


def test_kinds_are_found_by_their_names_and_others_refused():
    assert [system_kind(name).kind for name in SYSTEMS] == [*SYSTEMS]
    assert [noise_kind(name).kind for name in NOISES] == [*NOISES]
    with pytest.raises(ValueError, match=r'got kind = "pink"; must be one of non-gaussian, ou-reduction'):
        noise_kind("pink")
