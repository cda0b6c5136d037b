"""Bounded noise: its law, Λ(p) and λ against moment equations and Fourier series, its parameters, its limits."""

import math

import numpy as np
import pytest
from scipy.integrate import simpson

from fpsolve import ExponentSolver, PlaneSystem, Problem, moment_lyapunov, sensitivities
from fpsolve.arrays import identity
from fpsolve.errors import NoPerturbationTheory
from fpsolve.fem.circle import CircleAxis
from fpsolve.model import Bounded, CoefficientMatrix, ParametricOscillator, SineWiener, White, noise_kind
from fpsolve.model.noise import NoiseDerivative
from fpsolve.simulation.motions import draw
from fpsolve.theory import second_order
from tests import random_bounded
from tests.conftest import sampled
from tests.oracles import moment_hierarchy, phase_circle

DRIVEN = [[0.0, 0.0], [-1.0, 0.0]]


def steady(damping=0.05, stiffness=1.0):
    return [[0.0, 1.0], [-stiffness, -2 * damping]]


def of(mu=0.4, nu=2.0, sigma=0.3, damping=0.05, stiffness=1.0):
    return Problem(ParametricOscillator(stiffness, damping), Bounded(mu, nu, sigma))


def hierarchy(p=2, mu=0.4, nu=2.0, sigma=0.3, damping=0.05, stiffness=1.0, harmonics=10):
    return moment_hierarchy.bounded_exponent(steady(damping, stiffness), DRIVEN, mu, nu, sigma, p, harmonics)


def test_the_law():
    """S(ω) is the transform of ½μ² exp(−½σ²|t|) cos νt; without the diffusion there is no ω but ν."""
    noise = Bounded(mu=0.7, nu=1.4, sigma=0.9)
    assert noise_kind("bounded") is Bounded
    for omega in (0.0, 1.4, 3.0):
        pieces = [(math.exp(-0.405 * t), math.cos(1.4 * t) * math.cos(omega * t)) for t in np.linspace(0, 60, 60001)]
        transform = 0.7**2 * simpson(np.prod(pieces, axis=1), dx=1e-3)
        assert noise.spectral_density(omega) == pytest.approx(transform, rel=1e-8)
        assert Bounded(0.7, 0.0, 0.9).spectral_density(omega) == pytest.approx(
            SineWiener(0.7, 0.9).spectral_density(omega), rel=1e-15
        )
    assert [Bounded(0.7, 1.4, 0.0).spectral_density(omega) for omega in (1.4, 1.3)] == [math.inf, 0.0]
    assert noise.standard_deviation == 0.7 / math.sqrt(2)


def test_its_waves():
    """On 1, cos kθ, sin kθ: ν∂ + ½σ²∂² and cos θ."""
    axis = CircleAxis(Bounded(mu=0.7, nu=1.4, sigma=0.9), 3)
    cosine = np.zeros((7, 7))
    cosine[0, 1] = cosine[1, 0] = math.sqrt(0.5)
    cosine[[1, 3, 2, 4], [3, 5, 4, 6]] = cosine[[3, 5, 4, 6], [1, 3, 2, 4]] = 0.5
    np.testing.assert_allclose(axis.mass(identity), 0.7 * cosine, atol=1e-15)
    np.testing.assert_allclose(form_of(axis, np.ones(axis.measure.size)), axis.mass(), atol=1e-14)
    slopes = np.gradient(axis.values_at(np.linspace(0, 2 * math.pi, 20001)), 2 * math.pi / 20000, axis=0)[1:]
    values = axis.values_at(np.linspace(0, 2 * math.pi, 20001))[1:]
    expected = 1.4 * values.T @ slopes / 20000 - np.diag(0.5 * 0.9**2 * np.array([0, 1, 1, 4, 4, 9, 9]))
    np.testing.assert_allclose(axis.generator(), expected, atol=1e-3)
    change = NoiseDerivative(turning=1.0)
    np.testing.assert_allclose(axis.changed(change, None), (axis.generator() - axis.generator().T) / 2.8, atol=1e-15)


def form_of(axis, g):
    return (axis.values * (axis.measure * g)[:, None]).T @ axis.values


def test_moments_and_the_lyapunov_exponent():
    solver = ExponentSolver(of(), rtol=1e-10)
    for p, expected in ((2.0, 0.0778013340478035), (4.0, hierarchy(4))):
        found = solver.solution(p)
        assert abs(found.pair.value - expected) < found.error + 1e-13 < 2e-11
    exponent = solver.lyapunov_exponent()
    assert abs(exponent.value - 0.0372304328376) < exponent.error_estimate + 1e-13 < 1e-10
    made = phase_circle.bounded(steady(), DRIVEN, 0.4, 2.0, 0.3, 16)
    for p in (-0.5, 1.0):
        found = solver.solution(p)
        expected = phase_circle.moment_exponent(made, p, 60, start=found.pair.value + 1e-4)
        assert abs(found.pair.value - expected) < found.error + 1e-11 < 1e-10


@pytest.mark.parametrize("seed", sampled(*range(8), keep=2))
def test_moments_of_random_springs(seed):
    rng = np.random.default_rng(seed)
    names = ("damping", "stiffness", "mu", "nu", "sigma")
    theta = dict(zip(names, np.exp(rng.uniform(-1.2, 1.0, 5)), strict=True))
    p, solver = int(rng.choice([2, 4])), ExponentSolver(of(**theta))
    found = solver.solution(float(p))
    doubt = abs(hierarchy(p, **theta, harmonics=10) - (expected := hierarchy(p, **theta, harmonics=14)))
    assert abs(found.pair.value - expected) <= found.error + doubt + 1e-13


def test_without_a_mean_frequency_it_is_sine_wiener_noise():
    """With ν = 0 the numbers are the same; they go there as ν² does."""
    at, sine = of(nu=0.0), Problem(ParametricOscillator(1.0, 0.05), SineWiener(0.4, 0.3))
    own, other = (moment_lyapunov(each, [1.0, 2.0], rtol=1e-11) for each in (at, sine))
    np.testing.assert_allclose(own.value, other.value, rtol=1e-14)
    near = moment_lyapunov(of(nu=1e-6), [1.0, 2.0], rtol=1e-11)
    np.testing.assert_allclose(near.value, other.value, atol=1e-10)
    [slopes], [of_sine] = (sensitivities(each, 2.0).moments for each in (at, sine))
    assert slopes["noise.nu"].value == 0
    for name, same in (("mu", "amplitude"), ("sigma", "sigma")):
        assert slopes[f"noise.{name}"].value == pytest.approx(of_sine[f"noise.{same}"].value, rel=1e-12)


def test_sensitivities_are_differences_of_moment_equations():
    theta = {"mu": 0.4, "nu": 1.9, "sigma": 0.5, "damping": 0.05, "stiffness": 1.0}
    [found] = sensitivities(of(**theta), 2.0).moments
    for name, h in dict.fromkeys(theta, 1e-4).items():
        ahead, behind = (hierarchy(2, **{**theta, name: theta[name] + d}) for d in (h, -h))
        key = next(key for key in found if key.endswith(f".{name}"))
        assert found[key].value == pytest.approx((ahead - behind) / (2 * h), rel=1e-7), key


def test_a_harmonic_load_alone_is_refused():
    with pytest.raises(ValueError, match=r"^only the start of this noise is random.*Floquet"):
        of(sigma=0.0)
    with pytest.raises(ValueError, match="ξ would be constant"):
        Bounded(1.0, 0.0, 0.0)


def stochastic_mathieu(damping, mu, nu=2.0, sigma=0.0, s=0.3):
    """ẍ + 2·damping·ẋ + (1 + μ cos νt + s Ẇ) x = 0, the phase of the load diffusing by σ."""
    terms = [CoefficientMatrix(0, steady(damping)), *(CoefficientMatrix(1, DRIVEN, identity, name) for name in "lw")]
    return Problem(PlaneSystem(terms), {"l": Bounded(mu, nu, sigma), "w": White(s)})


@pytest.mark.parametrize(("damping", "mu", "expected"), [(0.05, 0.4, 0.1129960646376), (0.1, 0.3, -0.0352313732000)])
def test_a_harmonic_load_and_white_noise(damping, mu, expected):
    """Λ(2) by the multipliers of the moment equations, λ by Fourier series."""
    solver, white = ExponentSolver(stochastic_mathieu(damping, mu)), [[0.0, 0.0], [-0.3, 0.0]]
    found = solver.solution(2.0)
    assert abs(found.pair.value - expected) < found.error + 1e-13 < 1e-8
    at_four = moment_hierarchy.harmonic_exponent(steady(damping), DRIVEN, mu, 2.0, 4, white)
    assert abs((found := solver.solution(4.0)).pair.value - at_four) < found.error + 1e-12 < 1e-8
    exponent = solver.lyapunov_exponent()
    made = phase_circle.bounded(steady(damping), DRIVEN, mu, 2.0, 0.0, 24, white)
    assert abs(exponent.value - phase_circle.lyapunov_exponent(made, 60)) < exponent.error_estimate + 1e-12 < 1e-9


@pytest.mark.slow
def test_sensitivities_to_a_harmonic_load():
    problem, white = stochastic_mathieu(0.05, 0.4, 1.9), [[0.0, 0.0], [-0.3, 0.0]]
    [found] = sensitivities(problem, 2.0).moments

    def of_load(mu, nu):
        return moment_hierarchy.harmonic_exponent(steady(0.05), DRIVEN, mu, nu, 2, white)

    assert found["noise.l.mu"].value == pytest.approx((of_load(0.4001, 1.9) - of_load(0.3999, 1.9)) / 2e-4, rel=1e-6)
    assert found["noise.l.nu"].value == pytest.approx((of_load(0.4, 1.9001) - of_load(0.4, 1.8999)) / 2e-4, rel=1e-6)
    assert found["noise.l.sigma"].value == 0


@pytest.mark.parametrize("sigma", [0.03, 0.001])
def test_a_narrow_band_is_almost_harmonic(sigma):
    found = ExponentSolver(of(sigma=sigma)).solution(2.0)
    load = moment_hierarchy.harmonic_exponent(steady(), DRIVEN, 0.4, 2.0, 2)
    assert abs(found.pair.value - load) < sigma**2
    assert abs(found.pair.value - hierarchy(sigma=sigma)) < found.error + 1e-12


@pytest.mark.slow
def test_fast_noise_is_white():
    """μ²/σ² fixed: S(0) = 2μ²/σ², and Λ(2) comes nearer to that of white noise as 1/σ² does."""
    white = moment_hierarchy.white_noise_exponent(steady(), [[[0.0, 0.0], [-math.sqrt(0.5), 0.0]]], 2)
    sizes = np.array([64.0, 128.0, 256.0])
    gaps = [moment_lyapunov(of(mu=0.5 * s, sigma=s), 2.0).value[0] - white for s in sizes]
    assert -np.diff(np.log(np.abs(gaps))) / math.log(2) == pytest.approx(2.0, abs=0.02)


def test_a_step_has_the_transition_of_the_noise(rng):
    """Given θ₀: E ξ₁ = μ e^{−½σ²h} cos(θ₀ + νh), E ξ̄ is its mean over the step, and θ stays uniform."""
    noise, h, n = Bounded(mu=0.8, nu=2.5, sigma=1.1), 0.05, 400_000
    state, mean, end = np.array([np.full(n, 0.8 * math.cos(0.4)), np.full(n, 0.4)]), np.empty(n), np.empty(n)
    draw(noise.step(h), state, mean, end, np.zeros(n), rng)
    power = complex(-0.5 * 1.1**2, 2.5)
    expected = 0.8 * np.exp(0.4j) * np.array([np.exp(power * h), (np.exp(power * h) - 1) / (power * h)])
    assert end.mean() == pytest.approx(expected[0].real, abs=4 * end.std() / math.sqrt(n))
    assert mean.mean() == pytest.approx(expected[1].real, abs=4 * mean.std() / math.sqrt(n) + 1e-6)
    np.testing.assert_allclose(end, 0.8 * np.cos(state[1]), atol=1e-14)
    state = noise.start(n, rng)
    np.testing.assert_allclose(state[0], 0.8 * np.cos(state[1]), atol=1e-14)
    draw(noise.step(1.0), state, mean, end, np.zeros(n), rng)
    assert abs(np.exp(1j * state[1]).mean()) < 4 / math.sqrt(n)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_random_systems(seed):
    """Sixty: `python -m tests.random_bounded`."""
    assert (found := random_bounded.compared(seed)).is_within, found


def test_in_resonance_perturbation_theory_measures_no_errors():
    """S(2ω) → ∞ as σ → 0, where ln ‖x‖ grows by no more than ½μ all the same."""
    for sigma in (0.3, 1e-3):
        scale = ExponentSolver(of(sigma=sigma)).scale(2.0)
        assert 0.05 < scale < 1.0
    with pytest.raises(NoPerturbationTheory, match="broad compared with its effect"):
        second_order(of(sigma=0.3))
    assert second_order(of(nu=5.0, sigma=0.1)).quadratic > 0
