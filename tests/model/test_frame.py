"""Systems in coordinates in which their order 0 does not rotate uniformly, against the same in such as do."""

import math

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    make_mesh,
    sensitivities,
    stationary_density,
    tilted_density,
)
from fpsolve.analysis import furstenberg_khasminskii
from fpsolve.exponent import impact_rate
from fpsolve.exponent.fields import fields
from fpsolve.model import CoefficientMatrix, White

OU = OrnsteinUhlenbeck(alpha=1.0, sigma=0.7)


def of(unit, noise=OU, omega=10.0):
    """ẍ + 2 damping ẋ + (ω² + ωξ) x = 0 with a wall at x = 0, by the state (x, ẋ/unit)."""
    rates = "unit*v", "-omega**2/unit*x - 2*epsilon*damping*v - epsilon*omega/unit*xi*x"
    values = {"omega": omega, "damping": 0.1, "loss": 0.1, "unit": unit, "epsilon": 1.0}
    wall = {"at": "x = 0", "restitution": "exp(-loss)"}
    return Problem(PlaneSystem.of_equations(("x", "v"), rates, values, walls=[wall]), noise)


PLAIN, UNIFORM = of(1.0), of(10.0)


def test_which_coordinates():
    assert UNIFORM.frame is None
    assert PLAIN.frame.matrix == ((1.0, 0.0), (0.0, 10.0))
    assert of(1.0, OrnsteinUhlenbeck(alpha=1.0, sigma=30.0), omega=0.05).frame is None  # noise turns it, not stiffness


def test_phases_there_and_back(rng):
    problem = Problem(PlaneSystem([CoefficientMatrix(0, ((0.3, -2.0), (1.0, -0.4)))]), OU)
    phi = np.sort(rng.uniform(-7, 7, 500))
    psi = problem.frame.phase(phi)
    np.testing.assert_allclose(problem.frame.own_phase(psi), phi, atol=1e-13)
    assert np.all(np.diff(psi) > 0)
    np.testing.assert_allclose(
        problem.frame.phase(np.pi / 2 + np.pi * np.arange(-2, 3)), np.pi / 2 + np.pi * np.arange(-2, 3)
    )
    h = 1e-6
    slope = (problem.frame.phase(phi + h) - problem.frame.phase(phi - h)) / (2 * h)
    np.testing.assert_allclose(problem.frame.density(phi), slope, rtol=1e-7)
    (rotation,) = problem.motion.terms
    assert rotation.h.amplitude == rotation.q.amplitude == 0
    assert rotation.h.mean == pytest.approx(-math.sqrt(2.0 - 0.35**2))


@pytest.mark.parametrize("noise", [OU, White(0.7)])
def test_numbers_do_not_depend_on_coordinates(noise):
    solvers = [ExponentSolver(of(unit, noise), rtol=1e-10) for unit in (1.0, 10.0)]
    values, exponents = zip(
        *[(each.moments([-2.0, 3.0]).value, each.lyapunov_exponent().value) for each in solvers], strict=True
    )
    np.testing.assert_allclose(values[0], values[1], rtol=1e-10)
    assert exponents[0] == pytest.approx(exponents[1], rel=1e-9)
    assert impact_rate(solvers[0]).value == pytest.approx(impact_rate(solvers[1]).value, rel=1e-10)
    assert furstenberg_khasminskii(solvers[0].pair(0.0)) == pytest.approx(exponents[0], abs=1e-8)
    sizes = [each.pair(3.0).generator.size for each in solvers]
    assert sizes[0] == sizes[1]


@pytest.mark.parametrize("p", [0.0, 1.5, -2.0])
def test_functions_are_those_of_the_own_coordinates(p):
    """|x|^p T(φ) is one function of the plane, but for a factor; T* and T T* change like densities of the phase."""
    phi, xi = np.linspace(0.03, math.pi + 1.4, 41), np.array([-0.6, 0.0, 0.9])
    psi = (
        phi
        - np.mod(phi + math.pi / 2, math.pi)
        + np.mod(np.arctan2(np.sin(phi), 10 * np.cos(phi)) + math.pi / 2, math.pi)
    )
    length = np.hypot(np.cos(phi), 0.1 * np.sin(phi))
    found = []
    for problem, at in ((PLAIN, phi), (UNIFORM, psi)):
        pair = ExponentSolver(problem, rtol=1e-10).pair(p)
        axis = pair.space.phi
        own = at if problem.frame is None else problem.frame.phase(at)
        turned = axis.lines[0] + np.mod(own - axis.lines[0], axis.span)
        found.append(fields(pair, at, axis.at(turned), pair.space.xi.at(xi / OU.standard_deviation)))
    slope = 0.1 / length**2
    for ratio in (
        found[0].right / (length**p)[:, None] / found[1].right,
        found[0].adjoint / (slope / length**p)[:, None] / found[1].adjoint,
        found[0].product / slope[:, None] / found[1].product,
    ):
        np.testing.assert_allclose(ratio, ratio.mean(), rtol=2e-6)
    np.testing.assert_allclose(found[0].product / slope[:, None], found[1].product, rtol=2e-6)


def test_normalisation_and_densities():
    solver = ExponentSolver(PLAIN, rtol=1e-10)
    pair = solver.pair(2.0)
    phi = 2 * math.pi * (np.arange(4000) + 0.5) / 4000
    axis, samples = pair.space.phi, pair.space.xi.samples()
    psi = PLAIN.frame.phase(phi)
    table = axis.at(axis.lines[0] + np.mod(psi - axis.lines[0], axis.span))
    right = fields(pair, phi, table, samples).right
    stationary = OU.density(samples.xi)
    weights = samples.measure * stationary / np.sum(samples.measure * stationary)
    assert np.mean(right @ weights) == pytest.approx(1.0, abs=2e-4)
    for density in (stationary_density(solver.pair(0.0)), tilted_density(pair)):
        assert density.phi_weights @ density.values @ density.xi_weights == pytest.approx(1.0, abs=1e-12)
        assert density.phi_weights.sum() == pytest.approx(2 * math.pi, rel=1e-6)  # by points that are even in ψ
    # a free rotation of (x, ẋ) with ω = 10 stays where ẋ is large in proportion to 1/(dφ/dt)
    still = ExponentSolver(of(1.0, OrnsteinUhlenbeck(alpha=1.0, sigma=1e-4)), rtol=1e-9).pair(0.0)
    marginal = stationary_density(still)
    speed = np.sin(marginal.phi) ** 2 + 100 * np.cos(marginal.phi) ** 2
    np.testing.assert_allclose(marginal.phi_marginal() * speed, 10 / (2 * math.pi), rtol=5e-2)


def test_derivatives():
    slopes = sensitivities(PLAIN, 2.0)
    assert slopes.moments[0]["system.unit"].value == pytest.approx(0.0, abs=1e-9)
    for name in ("omega", "damping", "loss"):
        theta, key = PLAIN.values[f"system.{name}"], f"system.{name}"
        h = 1e-3 * theta
        values = [ExponentSolver(UNIFORM.at({key: theta + k * h}), rtol=1e-12).pair(2.0).value for k in (-2, -1, 1, 2)]
        difference = (8 * (values[2] - values[1]) - (values[3] - values[0])) / (12 * h)
        assert slopes.moments[0][key].value == pytest.approx(difference, rel=1e-6)


def test_a_mesh_is_in_the_own_coordinates():
    found = ExponentSolver(PLAIN, make_mesh(phi_cells=8)).moments(2.0)
    exact = ExponentSolver(UNIFORM, rtol=1e-10).moments(2.0)
    assert abs(found.value[0] - exact.value[0]) <= found.error_estimate[0] < 1e-5
