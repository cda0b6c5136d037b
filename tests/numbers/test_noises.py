"""Law, spectrum, generator and derivatives of every noise: each is what the others and closed forms make of it."""

import math

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csc_matrix, diags, eye
from scipy.sparse.linalg import spsolve

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model import (
    Bounded,
    Filter,
    MarkovChain,
    OrnsteinUhlenbeckByDeviation,
    OrnsteinUhlenbeckByIntensity,
    Poisson,
    ReducedNoise,
    SineWiener,
    Telegraph,
    White,
)

DEPARTURES = -5.0, -1.0, 0.5, 0.9, 1 - 1e-4, 1.0, 1 + 1e-4, 1.1, 1.3, 1.5
CHAIN = MarkovChain((-1.0, 0.5, 2.0), ((-1.0, 1.0, 0.0), (0.3, -0.7, 0.4), (0.0, 2.0, -2.0)))
RING = MarkovChain((0.0, 1.0, 3.0), ((0, 2.0, 0), (0, 0, 1.0), (0.5, 0, 0)))


def relaxing(variance, rate):
    return lambda w: 2 * variance * rate / (rate**2 + w**2)


def filtered(omega, zeta, s, c0, c1):
    return lambda w: (s * abs((c0 + 1j * c1 * w) / (omega**2 - w**2 + 2j * zeta * omega * w))) ** 2


LAWS = [  # a noise, its variance and its spectral density
    (OrnsteinUhlenbeck(alpha=2.0, sigma=1e-3), 2.5e-7, lambda w: 1e-6 / (4 + w**2)),
    (OrnsteinUhlenbeckByIntensity(D0=2.0, tau0=0.3), 2 / 0.3, relaxing(2 / 0.3, 1 / 0.3)),
    (OrnsteinUhlenbeckByDeviation(alpha=2.0, standard_deviation=0.3), 0.09, relaxing(0.09, 2.0)),
    (ReducedNoise(D0=0.7, tau0=1.3, r0=0.9), 1.1 * 2 * 0.7 / (1.3 * 2.3), relaxing(1.54 / 2.99, 2.3 / 2.2 / 1.3)),
    *((NonGaussianNoise(D0=0.7, tau0=1.3, r0=r0), 2 * 0.7 / (1.3 * (5 - 3 * r0)), None) for r0 in DEPARTURES),
    (SineWiener(amplitude=0.4, sigma=0.6), 0.08, relaxing(0.08, 0.18)),
    (
        Bounded(mu=0.4, nu=2.0, sigma=0.5),
        0.08,
        lambda w: 0.08 * 0.125 * sum(1 / (0.125**2 + (w + nu) ** 2) for nu in (2, -2)),
    ),
    (Filter(omega=2.0, zeta=0.1, s=0.5, c0=1.0, c1=0.3), 0.25 / 3.2 * 1.36, filtered(2.0, 0.1, 0.5, 1.0, 0.3)),
    (Filter(omega=2.0, zeta=1.0, s=0.5, c0=0.0, c1=0.3), 0.25 / 8 * 0.09, filtered(2.0, 1.0, 0.5, 0.0, 0.3)),
    (Filter(0.8, 2.5, 0.3, 0.0, -1.0), 0.09 / 8, filtered(0.8, 2.5, 0.3, 0.0, -1.0)),
    (Telegraph(a=0.5, k=1.0), 0.25, relaxing(0.25, 2.0)),
    (Telegraph(0.7, 1.9), 0.49, relaxing(0.49, 3.8)),
    (RING, 38 / 7 - 49 / 12.25, None),
    (CHAIN, None, None),
]


def law(noise, count=8001):
    """ξ, and P_s dξ at it: even in the angle of a short support, and in the logarithm of |ξ| far out."""
    short = noise.half_width < 30 * noise.standard_deviation
    t = (0.5 * math.pi if short else 16.0) * (2 * np.arange(count) + 1 - count) / count
    size, f, slope = (noise.half_width, np.sin, np.cos) if short else (noise.standard_deviation, np.sinh, np.cosh)
    xi, mass = size * f(t), noise.density(size * f(t)) * size * slope(t) * (t[1] - t[0])
    known = mass * (1 + (xi / noise.standard_deviation) ** 2) > 1e-20 * mass.max()
    return xi[known], mass[known]


def generator(noise):
    """f, L and g of C(t) = f·exp(Lt)g: of a diffusion by P_s and σ² alone, (σ²P_s u′)′/2P_s on the points of `law`."""
    if noise.basis == "states":
        deviations = np.array(noise.states) - noise.mean
        return noise.probabilities * deviations, np.array(noise.rates), deviations
    if noise.basis == "pairs":
        return noise.standard_deviation**2 * np.eye(2)[0], -np.array(noise.drift_matrix), np.eye(2)[0]
    if noise.basis == "waves":
        waves, k = np.fft.fft(noise.of_angle(2 * math.pi * np.arange(64) / 64)) / 64, np.fft.fftfreq(64, 1 / 64)
        return np.abs(waves) ** 2, np.diag(1j * noise.nu * k - 0.5 * noise.sigma**2 * k**2), np.ones(64)
    xi, mass = law(noise)
    middle = 0.5 * (xi[1:] + xi[:-1])
    flux = 0.5 * noise.squared_diffusion(middle) * noise.density(middle) / np.diff(xi)
    rates = diags([flux / mass[1:], -(np.append(flux, 0) + np.insert(flux, 0, 0)) / mass, flux / mass[:-1]], (-1, 0, 1))
    return mass * xi, rates, xi


@pytest.mark.parametrize(("noise", "variance", "spectrum"), LAWS, ids=lambda each: getattr(each, "kind", ""))
def test_law_spectrum_and_generator_of_a_noise_agree(noise, variance, spectrum):
    f, rates, g = generator(noise)
    std, is_diffusion = noise.standard_deviation, noise.basis in ("polynomials", "cells")
    far = getattr(noise, "r0", 0.0) > 1.4
    assert variance is None or std == pytest.approx(math.sqrt(variance), rel=1e-14)
    assert math.sqrt((f @ g).real) == pytest.approx(std, rel=1e-3 if far else 1e-6)
    for omega in np.array([0.3, 1.0, 3.0]) / noise.correlation_time:
        found = 2 * (f @ spsolve(1j * omega * eye(g.size, format="csc") - csc_matrix(rates), g + 0j)).real
        if not noise.approximates_spectrum:  # S(ω) = ∫C(t) cos ωt dt
            assert noise.spectral_density(omega) == pytest.approx(found, rel=1e-3 if is_diffusion else 1e-9)
        assert spectrum is None or noise.spectral_density(omega) == pytest.approx(spectrum(omega), rel=1e-13)
    if not is_diffusion:
        return
    xi, mass = law(noise)
    assert mass.sum() == pytest.approx(1.0, abs=1e-6)
    assert mass @ xi == pytest.approx(noise.mean, abs=1e-6 * std)
    inner = np.abs(xi) < min(0.9 * noise.half_width, 3 * std)
    if hasattr(noise, "drift"):
        assert_allclose((rates @ xi)[inner], noise.drift(xi[inner]), atol=1e-3 * std / noise.correlation_time)
    if isinstance(noise, NonGaussianNoise):  # −V′/τ₀ of V = −(D₀/τ₀) ln P_s
        at, h = xi[inner], 1e-5 * std
        slope = (noise.log_density(at + h) - noise.log_density(at - h)) / (2 * h)
        assert_allclose(noise.drift(at), slope * noise.D0 / 1.3**2, rtol=1e-7, atol=1e-8)
    for name in noise.differentiable:
        stated, h = noise.derivative(name), 1e-5 * abs(noise.values[name])
        if not h:
            continue
        ends = [(noise.at({name: noise.values[name] + d}), xi[inner] * math.exp(stated.log_scale * d)) for d in (h, -h)]
        fs = ([0.5 * np.log(n.squared_diffusion(x)) for n, x in ends], [n.log_density(x) for n, x in ends])
        (slope, logs), size = ((a - b) / (2 * h) for a, b in fs), 1e-10 / h
        assert_allclose(slope, stated.log_diffusion, rtol=1e-5, atol=size)
        own = stated.log_density(xi[inner]) - logs  # constant
        assert_allclose(own, own.mean(), rtol=0, atol=size * (1 + np.ptp(logs)))


@pytest.mark.parametrize("noise", [Filter(1.3, 0.4, 0.5, 0.7, -0.8), Filter(0.8, 2.5, 0.3, 0.0, -1.0)], ids=repr)
def test_state_of_a_filter_has_one_noise_and_derivatives_that_are_differences(noise):
    drift = noise.drift_matrix
    assert np.linalg.det(drift + drift.T) == pytest.approx(0, abs=1e-12)
    for name in noise.differentiable:
        h = 1e-6 * max(abs(noise.values[name]), 1.0)
        more, less = (noise.at({name: noise.values[name] + side * h}) for side in (1, -1))
        stated = noise.derivative(name)
        assert_allclose(stated.drift or np.zeros((2, 2)), (more.drift_matrix - less.drift_matrix) / (2 * h), atol=1e-8)
        logs = math.log(more.standard_deviation / less.standard_deviation) / (2 * h)
        assert stated.log_scale == pytest.approx(logs, abs=1e-8)


def test_log_density_of_eq_9_is_exact_to_rounding_next_to_r0_1():
    for departure in (s * d for s in (-1, 1) for d in (1e-12, 9e-7, 1.1e-6, 1e-5, 1e-4, 1e-3, 9e-3, 1.1e-2, 0.1)):
        noise = NonGaussianNoise(D0=0.3, tau0=1.7, r0=1 + departure)
        with mpmath.workdps(40):
            D0, tau0, r0, half = map(mpmath.mpf, (noise.D0, noise.tau0, noise.r0, 0.5))
            a, curvature = 1 / abs(r0 - 1), tau0 * (r0 - 1) / (2 * D0)
            total = mpmath.beta(a + 1 if departure < 0 else a - half, half) / mpmath.sqrt(abs(curvature))
            xi = [x for x in (0.0, 0.1, 1.0, 5.0, 30.0, 1e6) if 1 + curvature * x**2 > 0]
            known = [float(-mpmath.log1p(curvature * mpmath.mpf(x) ** 2) / (r0 - 1) - mpmath.log(total)) for x in xi]
        assert_allclose(noise.log_density(xi), known, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("r0", [0.5, 0.9, 1 + 1e-9, 1.1, 1.5])
def test_derivative_of_eq_9_by_r0_is_exact_from_the_middle_to_far_out(r0):
    noise = NonGaussianNoise(D0=0.3, tau0=1.7, r0=r0)
    xi = np.array([1e-9, 1e-4, 0.01, 0.5, 0.99]) * noise.half_width if r0 < 1 else np.logspace(-9, 14, 24)
    with mpmath.workdps(60):
        u = [mpmath.mpf(0.5) * mpmath.mpf(noise.tau0) / mpmath.mpf(noise.D0) * mpmath.mpf(x) ** 2 for x in xi]
        q = [(mpmath.mpf(r0) - 1) * each for each in u]
        known = [float((mpmath.log1p(b) - b / (1 + b)) * (a / b) ** 2) for a, b in zip(u, q, strict=True)]
    assert_allclose(noise.derivative("r0").log_density(xi), known, rtol=1e-13, atol=0)


def test_density_and_drift_of_eq_7_at_r0_1_are_those_of_ornstein_uhlenbeck_noise():
    xi, limit = np.linspace(-4, 4, 9), OrnsteinUhlenbeck(alpha=2.0, sigma=math.sqrt(0.6) * 2)
    for r0 in (1 - 1e-12, 1.0, 1 + 1e-12):
        noise = NonGaussianNoise(D0=0.3, tau0=0.5, r0=r0)
        assert_allclose(noise.density(xi), limit.density(xi), rtol=1e-9)
        assert_allclose(noise.drift(xi), limit.drift(xi), rtol=1e-9)


def test_support_of_eq_7_is_bounded_for_r0_below_1_only():
    noise = NonGaussianNoise(D0=0.3, tau0=0.5, r0=0.7)
    assert noise.half_width == pytest.approx(2.0)
    assert_allclose(noise.density([-2.0, 2.02, 9.0]), 0, atol=0)
    assert noise.density(1.98) > 0
    assert math.isinf(NonGaussianNoise(D0=0.3, tau0=0.5, r0=1.2).half_width)
    assert NonGaussianNoise(D0=1.0, tau0=0.5, r0=2.0).variance == math.inf
    assert SineWiener(amplitude=0.7, sigma=1.3).density(0.8) == 0


def test_reduction_of_eq_7_has_the_numbers_of_eqs_12_to_14_and_notes_its_variance():
    for r0, is_near in ((0.9, True), (0.95, True), (1.1, True), (0.6, False), (1.3, False)):
        noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=r0)
        ou, share = noise.ou_reduction(), 2 * (2 - r0) / (5 - 3 * r0)
        assert ou.alpha == pytest.approx(2 / share, rel=1e-15)
        assert ou.sigma == pytest.approx(math.sqrt(2.0) * 2, rel=1e-15)
        assert ou.at({"treatment": "exact"}) == noise
        notes = [*ou.remarks]
        assert len(notes) == (not is_near)
        if notes:
            told = f"Its variance is {(2 - r0) * noise.variance:.4g}, and Eq. (10) gives"
            assert f"{told} {noise.variance:.4g}" in notes[0]
            assert f"|r0 - 1| = {abs(r0 - 1):.3g} > 0.1" in notes[0]


def test_spectral_density_of_noise_without_memory_and_of_a_harmonic_load():
    assert White(s=0.5).spectral_density(3.0) == 0.25
    assert Poisson(1.5, (-1.0, 2.0), (3.0, 1.0)).spectral_density(3.0) == pytest.approx(1.5 * 1.75)
    assert [Bounded(0.7, 1.4, 0.0).spectral_density(omega) for omega in (1.4, 1.3)] == [math.inf, 0.0]


def test_chain_has_probabilities_by_its_times_and_rates_without_their_diagonal():
    assert_allclose(RING.probabilities, np.array([0.5, 1.0, 2.0]) / 3.5, rtol=1e-14)
    assert RING.mean == pytest.approx(2.0)
    assert MarkovChain((1, 2), ((-3, 3), (4, -4))) == MarkovChain((1, 2), ((0, 3), (4, 0)))
    assert Filter(2.0, 5.0, 1.0, 1.0, 0.0).correlation_time == pytest.approx(1 / (10 - math.sqrt(96)), rel=1e-14)
