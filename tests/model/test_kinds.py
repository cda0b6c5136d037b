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
from fpsolve.model import CoefficientMatrix, ReducedNoise, noise_kind, system_kind
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


def test_a_system_by_terms_has_one_parameter():
    system = driven(Linear())
    assert dict(system.at({"epsilon": 0.1}).values) == {"epsilon": 0.1}
    assert pickle.loads(pickle.dumps(system)) == system
    with pytest.raises(ValueError, match="got mass; the parameter is epsilon"):
        system.at({"mass": 1.0})


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
