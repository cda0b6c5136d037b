"""Sine-Wiener noise: its law, Λ(p) against moment equations over its harmonics, its parameters, its simulation."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest

from fpsolve import (
    ExponentSolver,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    boundary,
    moment_lyapunov,
    sensitivities,
    simulate,
)
from fpsolve.analysis import Axis
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.model import SineWiener, noise_kind
from fpsolve.simulation.motions import draw
from tests.conftest import sampled
from tests.oracles.harmonics import moment_exponent, white_noise_exponent

UNIT = SineWiener(amplitude=1.0, sigma=1.0)


def of(damping=0.2, stiffness=1.0, amplitude=1.0, sigma=1.0):
    """ẍ + damping ẋ + (stiffness + ξ) x = 0."""
    values = {"damping": damping, "stiffness": stiffness}
    spring = PlaneSystem.of_equations(("x", "v"), ("v", "-stiffness*x - damping*v - xi*x"), values)
    return Problem(spring, SineWiener(amplitude, sigma))


def test_the_registry_has_it():
    assert noise_kind("sine-wiener") is SineWiener


def test_the_law():
    """P_s is normalised, has the variance ½A², and S(ω) is the transform of ½A² exp(−½σ²t)."""
    noise = SineWiener(amplitude=0.7, sigma=1.3)
    for power, expected in ((0, 1.0), (2, 0.5 * 0.7**2)):
        value = quad(lambda t, n=power: 0.7 * math.cos(t) * (0.7 * math.sin(t)) ** n * noise.density(0.7 * math.sin(t)),
                     -math.pi / 2, math.pi / 2)[0]  # fmt: skip
        assert value == pytest.approx(expected, rel=1e-10)
    assert noise.standard_deviation**2 == pytest.approx(0.5 * 0.7**2, rel=1e-15)
    for omega in (0.0, 2.0):
        transform = 0.7**2 * quad(lambda t, w=omega: math.exp(-0.5 * 1.3**2 * t) * math.cos(w * t), 0, 60)[0]
        assert noise.spectral_density(omega) == pytest.approx(transform, rel=1e-8)
    assert noise.density(0.8) == 0


def test_its_generator_is_diagonal():
    """L_ξ T_k = −½σ²k² T_k for the Chebyshev polynomials."""
    axis = PolynomialAxis(SineWiener(amplitude=0.7, sigma=1.3), 9)
    np.testing.assert_allclose(axis.generator(), np.diag(-0.5 * 1.3**2 * np.arange(9) ** 2), atol=1e-11)
    np.testing.assert_allclose(axis.mass(), np.eye(9), atol=1e-13)


@pytest.mark.parametrize(("p", "expected"), [(2.0, -0.0773243898649), (4.0, -0.0327771112216)])
def test_moments_of_a_spring(p, expected):
    assert moment_exponent(int(p), 0.2, 1.0, 1.0, 1.0) == pytest.approx(expected, abs=2e-12)
    found = moment_lyapunov(of(), p, rtol=1e-10)
    assert abs(found.value[0] - expected) < 1e-10
    assert found.error_estimate[0] < 1e-10


@pytest.mark.parametrize("seed", sampled(*range(6), keep=2))
def test_moments_of_random_springs(seed):
    rng = np.random.default_rng(seed)
    theta = dict(zip(("damping", "stiffness", "amplitude", "sigma"), np.exp(rng.uniform(-1.2, 1.0, 4)), strict=True))
    p = int(rng.choice([2, 4]))
    solver = ExponentSolver(of(**theta))
    found = solver.solution(float(p))
    assert abs(found.pair.value - moment_exponent(p, **theta)) <= max(2 * found.error, 1e-8 * solver.scale(p))


def test_fast_noise_is_white():
    """S(0) = 2A²/σ² fixed: from σ = 16 on Λ(2) comes nearer to that of white noise, as 1/σ² does."""
    white = white_noise_exponent(2, 0.2, 1.0, 0.5)
    gaps = [moment_lyapunov(of(amplitude=0.5 * s, sigma=s), 2.0).value[0] - white for s in (16.0, 32.0, 64.0, 128.0)]
    falls = [one / other for one, other in itertools.pairwise(gaps)]
    assert falls == sorted(falls)
    assert falls[-1] == pytest.approx(4, rel=0.01)


def test_sensitivities_are_differences_of_moment_equations():
    theta = {"damping": 0.2, "stiffness": 1.0, "amplitude": 1.0, "sigma": 1.0}
    [found] = sensitivities(of(**theta), 2.0).moments
    assert {key.partition(".")[2] for key in found} == {*theta}
    for name, h in dict.fromkeys(theta, 1e-4).items():
        ahead, behind = (moment_exponent(2, **{**theta, name: theta[name] + d}) for d in (h, -h))
        key = next(key for key in found if key.endswith(f".{name}"))
        assert found[key].value == pytest.approx((ahead - behind) / (2 * h), rel=1e-6)


@pytest.mark.slow
def test_a_chart_over_its_parameters():
    """On Λ(2) = 0 over damping and amplitude the moment equations have the eigenvalue 0."""
    frame = Axis("system.damping", 0.1, 0.6), Axis("noise.amplitude", 0.5, 2.0)
    found = boundary(of(), {"moment": 2.0}, *frame, nodes=5)
    [branch] = found.branches
    assert branch.x.size > 10
    for damping, amplitude in zip(branch.x[::5], branch.y[::5], strict=True):
        assert moment_exponent(2, damping, 1.0, amplitude, 1.0) == pytest.approx(0, abs=1e-9)


def test_a_step_has_the_transition_of_the_noise(rng):
    """ξ₁ and ξ̄ given ξ₀: E ξ₁ = ξ₀ e^{−½σ²h}, E ξ̄ = ξ₀ (1 − e^{−½σ²h})/(½σ²h) to O(h²), and P_s is kept."""
    noise, h, n = SineWiener(amplitude=0.8, sigma=1.1), 0.08, 400_000
    decay = math.exp(-0.5 * 1.1**2 * h)
    angles = np.where(rng.random(n) < 0.5, 1.0, -1.0) * math.acos(0.5 / 0.8)  # both of the same ξ
    xi, mean, end, push = np.stack([np.full(n, 0.5), angles]), np.empty(n), np.empty(n), np.zeros(n)
    draw(noise.step(h), xi, mean, end, push, rng)
    assert end.mean() == pytest.approx(0.5 * decay, abs=4 * end.std() / math.sqrt(n))
    assert mean.mean() == pytest.approx(0.5 * (1 - decay) / (0.5 * 1.1**2 * h), abs=4 * mean.std() / math.sqrt(n))
    start = noise.start(n, rng)
    draw(noise.step(1.0), start, mean, end, push, rng)
    assert kstest(end[::4], lambda x: 0.5 + np.arcsin(np.clip(x / 0.8, -1, 1)) / math.pi).pvalue > 1e-3
    assert np.max(np.abs(end)) <= 0.8


@pytest.mark.slow
@pytest.mark.parametrize(("sigma", "estimator", "paths"), [(2.0, "direct", 2048)])
def test_the_simulation_agrees(sigma, estimator, paths):
    """λ and Λ(1) of the oscillator with its wall within four standard errors."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-0.1, epsilon=0.6)
    problem = Problem(oscillator, SineWiener(amplitude=1.0, sigma=sigma))
    found = simulate(problem, 1.0, estimator=estimator, paths=paths, time=80.0, seed=3)
    solver = ExponentSolver(problem)
    exponent = solver.lyapunov_exponent().value
    assert found.lyapunov_exponent == pytest.approx(exponent, abs=4 * found.lyapunov_exponent_error)
    [moment] = found.estimates
    assert moment.value == pytest.approx(solver.pair(1.0).value, abs=4 * moment.standard_error)
