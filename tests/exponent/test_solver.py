"""Λ(p): reference values, identities that hold for any ε, and what is refused."""

import math

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    make_mesh,
    moment_lyapunov,
)
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent import principal_pair, second_derivative
from fpsolve.fem import Generator
from fpsolve.model import CoefficientMatrix
from fpsolve.model.plane import Harmonics
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE, oracle_arguments, sampled
from tests.oracles import fourier_hermite, perturbation

STRONG_MESH = make_mesh(phi_cells=12, phi_degree=10, xi_cells=8, xi_degree=10, xi_min=-8, xi_max=12)


def test_fig1_at_p_2(fig1_solver):
    assert fig1_solver.pair(2.0).value == pytest.approx(0.0141631436533, rel=1e-10)


def test_fig1_at_p_2_with_the_exact_noise():
    pair = ExponentSolver(Problem(FIG1, FIG1_NOISE)).pair(2.0)
    assert pair.value == pytest.approx(0.013021271922, rel=1e-9)
    arguments = {"D0": 1.0, "tau0": 0.5, "r0": 0.95, "omega": 1.0, "epsilon": 0.1, "c1": 0.1}
    oracle = fourier_hermite.moment_lyapunov_bounded_noise(
        **arguments, log_R=FIG1.log_impact_factor, p=2.0, harmonics=8, gegenbauer=24
    )
    assert pair.value == pytest.approx(oracle, rel=1e-11)


@pytest.mark.parametrize("p", np.linspace(-3, 7, 6))
@pytest.mark.parametrize("r0", [-1.0, 0.3, 0.7, 0.95])
def test_exact_noise_against_gegenbauer_polynomials(r0, p):
    noise = NonGaussianNoise(D0=0.8, tau0=0.7, r0=r0)
    oscillator = VibroImpactOscillator(omega=1.4, restitution=0.7, c1=-0.2, epsilon=0.3, impact="restitution")
    oracle = fourier_hermite.moment_lyapunov_bounded_noise(
        D0=0.8, tau0=0.7, r0=r0, omega=1.4, epsilon=0.3, c1=-0.2,
        log_R=oscillator.log_impact_factor, p=p, harmonics=12, gegenbauer=36,
    )  # fmt: skip
    result = moment_lyapunov(Problem(oscillator, noise), p)
    error = abs(result.value[0] - oracle)
    assert error <= 3 * result.error_estimate[0] + 1e-12
    assert error <= 1e-8 * max(abs(oracle), perturbation.moment_scale(oscillator, noise, p))


@pytest.mark.parametrize("law", ["delta", "restitution"])
@pytest.mark.parametrize("p", np.linspace(-3, 8, 7))
def test_weak_noise_against_fourier_hermite(p, law):
    """Λ meets its tolerance on the scale of Eq. (37), and the error estimate says so."""
    oscillator = VibroImpactOscillator(omega=2.0, restitution=0.7, c1=0.2, epsilon=0.15, impact=law)
    noise = OrnsteinUhlenbeck(alpha=1.5, sigma=1.2)
    oracle = fourier_hermite.moment_lyapunov(**oracle_arguments(oscillator, noise), p=p, harmonics=8, hermite=24)
    result = moment_lyapunov(Problem(oscillator, noise), p)
    assert not result.warnings
    error = abs(result.value[0] - oracle)
    assert error <= 1e-8 * perturbation.moment_scale(oscillator, noise, p)
    assert error <= 3 * result.error_estimate[0] + 1e-13


@pytest.mark.slow
@pytest.mark.parametrize(
    ("epsilon", "p", "value", "rel"),
    [
        (1.0, 4.0, 6.938432719, 1e-7),
    ],
)
def test_strong_noise_finds_the_principal_eigenvalue(epsilon, p, value, rel):
    """α = σ = ω = 1, c₁ = 0, r = 1: the guess of Eq. (37) lies nearer to other eigenvalues."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=epsilon)
    pair = ExponentSolver(Problem(oscillator, UNIT_NOISE)).pair(p)
    assert pair.value == pytest.approx(value, rel=rel)
    assert min(pair.sign_defects) < 1e-10


@pytest.mark.parametrize("epsilon", sampled(0.5, 0.1, 0.3))
@pytest.mark.parametrize("c1", [-0.4, 0.3])
def test_identity_at_p_minus_2(epsilon, c1):
    """Λ(−2) = −ε²c₁ + ε²σ²/(2α²) for any ε without impact."""
    noise = OrnsteinUhlenbeck(alpha=1.3, sigma=0.8)
    oscillator = VibroImpactOscillator(omega=1.7, restitution=1.0, c1=c1, epsilon=epsilon)
    mesh = make_mesh(phi_cells=4, phi_degree=12, xi_cells=6, xi_degree=10, xi_min=-10, xi_max=8)
    value = ExponentSolver(Problem(oscillator, noise), mesh).pair(-2.0).value
    expected = epsilon**2 * (noise.sigma**2 / (2 * noise.alpha**2) - c1)
    assert value == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("law", ["delta", "restitution"])
@pytest.mark.parametrize("p", [-2.0, 1.0, 4.0])
def test_without_noise_only_the_impacts_are_left(p, law):
    """Λ = p ω ln R/π for c₁ = 0, the noise being too weak to matter."""
    noise = OrnsteinUhlenbeck(alpha=1.0, sigma=1e-9)
    oscillator = VibroImpactOscillator(omega=1.7, restitution=0.6, c1=0.0, epsilon=1.0, impact=law)
    value = ExponentSolver(Problem(oscillator, noise), make_mesh(phi_degree=14)).pair(p).value
    assert value == pytest.approx(p * 1.7 * oscillator.log_impact_factor / math.pi, rel=1e-10)


@pytest.mark.parametrize("p", sampled(-2.0, 4.0, 1.0, keep=2))
@pytest.mark.parametrize("restitution", sampled(0.8, 1.0))
def test_decoupled_phase_is_exactly_quadratic(monkeypatch, restitution, p):
    """h ≡ 0: Λ = p(ε²c₁/2 + ω ln R/π) + p²ε²(2S(0) + S(2ω))/16 for any ε."""
    turning = CoefficientMatrix.h.func

    def h(term):
        return turning(term) if term.order == 0 else Harmonics(0.0, 0.0, 0.0)

    monkeypatch.setattr(CoefficientMatrix, "h", property(h))
    noise = OrnsteinUhlenbeck(alpha=1.5, sigma=0.8)
    oscillator = VibroImpactOscillator(omega=1.2, restitution=restitution, c1=0.2, epsilon=0.4)
    mesh = make_mesh(phi_cells=2, phi_degree=16, xi_cells=6, xi_degree=12, xi_min=-9, xi_max=9)
    value = ExponentSolver(Problem(oscillator, noise), mesh).pair(p).value
    spread = 2 * noise.spectral_density(0.0) + noise.spectral_density(2 * 1.2)
    drift = 0.4**2 * 0.2 / 2 + 1.2 * oscillator.log_impact_factor / math.pi
    assert value == pytest.approx(p * drift + p**2 * 0.4**2 * spread / 16, rel=1e-10)


MESHES = {
    "coarsest": {"phi_cells": 1, "phi_degree": 1, "xi_cells": 1, "xi_degree": 1},
    "coarse": {"phi_cells": 2, "phi_degree": 2, "xi_cells": 3, "xi_degree": 2},
    "default": {},
    "graded out": {"xi_cells": 7, "grading": 5.0},
    "graded in": {"xi_cells": 7, "grading": 0.2},
    "lopsided": {"xi_min": -3.0, "xi_max": 9.0},
    "full circle": {"phi_cells": 3, "full_circle": True},
}


@pytest.mark.parametrize("noise", [FIG1_NOISE.ou_reduction(), FIG1_NOISE, NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.2)])
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("epsilon", [0.1, 1.0])
def test_zeroth_moment_is_conserved_on_every_mesh(name, noise, epsilon):
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=epsilon)
    generator = Generator(Problem(oscillator, noise), make_mesh(**MESHES[name]))
    pair = principal_pair(generator, 0.0)
    assert abs(pair.value) <= min(pair.rounding, 1e-13)
    change = pair.right - pair.space.constant
    assert change @ (generator.space(0.0).mass @ change) <= 1e-22


def test_a_tolerance_out_of_reach_harms_no_other():
    solver = ExponentSolver(Problem(FIG1, FIG1_NOISE.ou_reduction()))
    with pytest.raises(NotConverged, match="rounding alone"):
        solver.solution(2.0, lambda p, value: 1e-22)
    assert solver.pair(2.0).value == pytest.approx(0.0141631436533, rel=1e-10)


def test_half_and_full_circle_give_one_exponent():
    noise = FIG1_NOISE.ou_reduction()
    half, full = (ExponentSolver(Problem(FIG1, noise), make_mesh(full_circle=full)).pair(2.0) for full in (False, True))
    assert full.value == pytest.approx(half.value, rel=1e-12)
    assert full.derivative == pytest.approx(half.derivative, rel=1e-12)


def test_derivatives_match_differences_of_values(fig1_solver):
    h = 1e-2
    for p in (-1.0, 0.0, 3.0):
        left, pair, right = (fig1_solver.pair(p + k * h) for k in (-1, 0, 1))
        assert pair.derivative == pytest.approx((right.value - left.value) / (2 * h), rel=1e-5)
        assert second_derivative(pair) == pytest.approx((right.derivative - left.derivative) / (2 * h), rel=1e-5)


def test_convexity_along_p():
    p = np.linspace(-4, 8, 49)
    result = moment_lyapunov(Problem(FIG1, FIG1_NOISE.ou_reduction()), p)
    assert np.all(np.diff(result.value, 2) > 0)
    assert np.all(np.diff(result.derivative) > 0)


def test_result_keeps_the_order_asked_for_and_does_not_depend_on_it():
    noise = FIG1_NOISE.ou_reduction()
    p = [3.0, -1.0, 0.0, 3.0]
    result = moment_lyapunov(Problem(FIG1, noise), p)
    np.testing.assert_array_equal(result.p, p)
    alone = np.array([moment_lyapunov(Problem(FIG1, noise), k).value[0] for k in p])
    assert np.all(np.abs(result.value - alone) <= 1e-8 * perturbation.moment_scale(FIG1, noise, p) + 1e-15)
    again = moment_lyapunov(Problem(FIG1, noise), p)
    np.testing.assert_array_equal(result.value, again.value)
    backwards = moment_lyapunov(Problem(FIG1, noise), p[::-1])
    np.testing.assert_array_equal(result.value, backwards.value[::-1])


@pytest.mark.slow
def test_steps_in_p_do_not_lead_to_another_eigenvalue():
    """Slow noise tilts far: the second eigenfunction changes its sign where P_s is negligible, but T T* is not."""
    oscillator = VibroImpactOscillator(omega=10.0, restitution=0.8, c1=0.1, epsilon=0.1)
    noise = NonGaussianNoise(D0=1.0, tau0=20.0, r0=0.95).ou_reduction()
    mesh = make_mesh(phi_cells=2, phi_degree=12, xi_cells=24, xi_degree=8, xi_min=-8, xi_max=24)
    stepped = moment_lyapunov(Problem(oscillator, noise), [0.0, 5.0, 10.0, 15.0], mesh=mesh)
    alone = moment_lyapunov(Problem(oscillator, noise), 15.0, mesh=mesh)
    assert stepped.value[-1] == pytest.approx(alone.value[0], rel=1e-10)
    oracle = fourier_hermite.moment_lyapunov(**oracle_arguments(oscillator, noise), p=15.0, harmonics=8, hermite=200)
    assert alone.value[0] == pytest.approx(oracle, rel=1e-7)


def test_errors_of_a_lopsided_mesh_are_seen():
    with pytest.raises(NotConverged, match=r"use more cells .* a wider noise interval"):
        moment_lyapunov(Problem(FIG1, FIG1_NOISE.ou_reduction()), 2.0, mesh=make_mesh(xi_min=-0.01))


def test_indices_without_meaning_are_refused():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=5.0)
    solver = ExponentSolver(Problem(oscillator, UNIT_NOISE), make_mesh())
    for compute in (solver.lyapunov_exponent, solver.variance_rate):
        with pytest.raises(NotConverged):
            compute()


def test_numbers_beyond_floating_point_are_refused():
    with pytest.raises(NotConverged, match="beyond floating-point numbers"):
        moment_lyapunov(Problem(FIG1, FIG1_NOISE.ou_reduction()), -1e6)


def test_unresolved_mesh_is_said():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3)
    mesh = make_mesh(phi_cells=1, phi_degree=4, xi_cells=2, xi_degree=5)
    result = moment_lyapunov(Problem(oscillator, FIG1_NOISE.ou_reduction()), [0.0, 2.0], mesh=mesh)
    oracle = fourier_hermite.moment_lyapunov(
        **oracle_arguments(oscillator, FIG1_NOISE.ou_reduction()), p=2.0, harmonics=12, hermite=40
    )
    assert abs(result.value[1] - oracle) <= 2 * result.error_estimate[1]
    assert "rtol = 1e-08 is not met at 1 of 2 moments, worst at p = 2" in result.warnings[0]


def test_hopeless_mesh_raises_and_keeps_what_was_finished():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
    mesh = make_mesh(phi_cells=1, phi_degree=2, xi_cells=2, xi_degree=3)
    with pytest.raises(NotConverged, match=r"(?s)p = 6|Λ\(6\).*use more cells") as caught:
        moment_lyapunov(Problem(oscillator, FIG1_NOISE.ou_reduction()), [6.0, 0.0], mesh=mesh)
    np.testing.assert_array_equal(caught.value.partial.p, [0.0])


@pytest.mark.parametrize("p", [1.0, -1.5])
def test_moments_of_algebraic_tails_are_refused(p):
    noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.1)
    with pytest.raises(NoSuchExponent, match=rf"Λ\({p:g}\) is not computed: for r0 > 1"):
        moment_lyapunov(Problem(FIG1, noise), [0.0, p])


def test_infinite_variance_is_refused():
    with pytest.raises(NoSuchExponent, match="infinite variance"):
        moment_lyapunov(Problem(FIG1, NonGaussianNoise(D0=0.5, tau0=1.0, r0=2.0)), 0.0)


@pytest.mark.parametrize("p", [math.nan, math.inf, [], [[1.0]]])
def test_bad_p_is_refused(p):
    with pytest.raises(ValueError, match="p must be a finite number or a non-empty list"):
        moment_lyapunov(Problem(FIG1, UNIT_NOISE), p)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mesh": "x"}, "got mesh = 'x'; must be a CylinderMesh, or None"),
        ({"budget": "x"}, "got budget = 'x'; must be a Budget"),
        ({"rtol": "x"}, "got rtol = 'x'; must be a number such as 1e-8"),
        ({"rtol": None}, "got rtol = None; must be a number such as 1e-8"),
    ],
)
def test_arguments_of_another_kind_are_refused(change, words):
    with pytest.raises(TypeError) as raised:
        ExponentSolver(**({"problem": Problem(FIG1, UNIT_NOISE)} | change))
    assert str(raised.value) == words
