"""Stationary, adjoint and tilted densities."""

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    make_mesh,
    stationary_density,
    tilted_density,
)
from fpsolve.analysis import adjoint_density, furstenberg_khasminskii
from fpsolve.exponent.fields import fields
from tests.conftest import FIG1, FIG1_NOISE

PROBLEMS = {
    "fig1": (FIG1, FIG1_NOISE.ou_reduction(), {}),
    "fig1 exact": (FIG1, FIG1_NOISE, {}),
    "full circle": (FIG1, FIG1_NOISE.ou_reduction(), {"full_circle": True}),
    "strong": (
        VibroImpactOscillator(omega=1.0, restitution=0.7, c1=-0.2, epsilon=1.0, impact="restitution"),
        OrnsteinUhlenbeck(alpha=1.0, sigma=0.7),
        {"phi_cells": 4},
    ),
    "square-root ends": (
        VibroImpactOscillator(omega=2.0, restitution=0.6, c1=0.2, epsilon=0.5),
        NonGaussianNoise(D0=0.5, tau0=1.0, r0=-1.0),
        {},
    ),
}


@pytest.fixture(params=PROBLEMS, scope="module")
def solver(request):
    oscillator, noise, mesh = PROBLEMS[request.param]
    return ExponentSolver(Problem(oscillator, noise), make_mesh(**mesh))


def test_stationary_density_integrates_to_1(solver):
    density = stationary_density(solver.pair(0.0))
    assert density.mean(lambda phi, xi: 1.0) == pytest.approx(1, abs=1e-13)
    assert density.phi_marginal() @ density.phi_weights == pytest.approx(1, abs=1e-13)
    assert density.phi_weights.sum() == pytest.approx(2 * np.pi)


def test_phase_runs_once_around_the_circle(solver):
    density = stationary_density(solver.pair(0.0))
    assert 0 <= density.phi[0] < 0.1
    assert 2 * np.pi - 0.1 < density.phi[-1] < 2 * np.pi
    assert np.all(np.diff(density.phi) > 0)


@pytest.mark.parametrize("name", ["adjoint", "product"])
def test_values_and_weights_belong_to_their_phase(solver, name):
    """Against the elements, looked up at each phase in the half circle of the mesh."""
    pair = solver.pair(2.0)
    density = {"adjoint": adjoint_density, "product": tilted_density}[name](pair)
    phi, span = pair.space.phi, pair.space.phi.span
    at_phi = phi.at(phi.lines[0] + (density.phi - phi.lines[0]) % span)
    expected = getattr(fields(pair, density.phi, at_phi, pair.space.xi.samples()), name)
    expected = expected / (density.phi_weights @ expected @ density.xi_weights)
    np.testing.assert_allclose(density.values, expected, atol=1e-11 * expected.max())
    assert density.phi_weights @ density.phi == pytest.approx(2 * np.pi**2)


def test_noise_marginal_is_the_stationary_density_of_the_noise(solver):
    density = stationary_density(solver.pair(0.0))
    expected = solver.problem.noise.density(density.xi)
    np.testing.assert_allclose(density.xi_marginal(), expected, rtol=0, atol=1e-10 * expected.max())
    assert np.abs(density.xi_marginal() - expected) @ density.xi_weights < 1e-10
    variance = density.mean(lambda phi, xi: xi**2)
    assert variance == pytest.approx(solver.problem.noise.standard_deviation**2, rel=1e-10)


def test_furstenberg_khasminskii_integral_is_the_slope_at_zero(solver):
    pair = solver.pair(0.0)
    scale = max(abs(pair.derivative), solver.problem.system.epsilon**2)
    assert furstenberg_khasminskii(pair) == pytest.approx(pair.derivative, abs=1e-10 * scale)


def test_phase_flux_is_the_same_through_every_phase(solver):
    """∂φ of the flux ∫(ω + ε h₁ξ + ε² h₂) ρ dξ vanishes, tested with cos 2kφ and sin 2kφ."""
    density = stationary_density(solver.pair(0.0))
    eps, oscillator = solver.problem.system.epsilon, solver.problem.system

    def speed(phi, xi):
        return oscillator.omega + eps * oscillator.terms[1].h(phi) * xi + eps**2 * oscillator.h2(phi)

    for k in (1, 2):
        for wave in (np.cos, np.sin):
            assert density.mean(lambda phi, xi, k=k, f=wave: speed(phi, xi) * f(2 * k * phi)) == pytest.approx(
                0, abs=2e-8
            )


@pytest.mark.parametrize("p", [-1.0, 2.0])
def test_tilted_mean_of_the_derivative_of_the_generator_is_the_slope(fig1_solver, p):
    """Λ′(p) = E_tilted[ε q₁ξ + ε² q₂] + ln R × (impacts per unit time); here without impact."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.1, epsilon=0.2)
    pair = ExponentSolver(Problem(oscillator, FIG1_NOISE.ou_reduction())).pair(p)
    density = tilted_density(pair)
    eps = oscillator.epsilon
    slope = density.mean(lambda phi, xi: eps * xi * oscillator.terms[1].q(phi) + eps**2 * oscillator.q2(phi))
    assert slope == pytest.approx(pair.derivative, rel=1e-10)
    assert density.mean(lambda phi, xi: 1.0) == pytest.approx(1, abs=1e-13)


def test_tilt_moves_the_noise_towards_the_sign_of_p(fig1_solver):
    means = [tilted_density(fig1_solver.pair(p)).mean(lambda phi, xi: xi) for p in (-2.0, 0.0, 2.0)]
    assert means[0] < -0.01 < abs(means[1]) + 0.005 < means[2]
    assert means[1] == pytest.approx(0, abs=1e-12)


def test_adjoint_density_at_zero_is_the_stationary_one(fig1_solver):
    pair = fig1_solver.pair(0.0)
    np.testing.assert_array_equal(adjoint_density(pair).values, stationary_density(pair).values)
    assert np.all(adjoint_density(fig1_solver.pair(2.0)).values >= 0)


def test_stationary_density_wants_the_pair_at_zero(fig1_solver):
    with pytest.raises(ValueError, match="at p = 0, but the pair has p = 2"):
        stationary_density(fig1_solver.pair(2.0))
