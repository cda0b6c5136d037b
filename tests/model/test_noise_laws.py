"""Law, spectrum, generator and derivatives of every noise that has values: each is what the others make of it."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csc_matrix, diags, eye
from scipy.sparse.linalg import spsolve

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model import Bounded, Filter, MarkovChain, ReducedNoise, SineWiener, Telegraph

DIFFUSIONS = [
    OrnsteinUhlenbeck(alpha=2.0, sigma=1e-3),
    *(kind(2.0, 0.3) for kind in OrnsteinUhlenbeck.variants),
    ReducedNoise(D0=0.7, tau0=1.3, r0=0.9),
    *(NonGaussianNoise(D0=0.7, tau0=1.3, r0=r0) for r0 in (-1.0, 0.9, 1.0, 1.3)),
    SineWiener(amplitude=0.4, sigma=0.6),
]
CHAIN = MarkovChain((-1.0, 0.5, 2.0), ((-1.0, 1.0, 0.0), (0.3, -0.7, 0.4), (0.0, 2.0, -2.0)))
FILTERS = Filter(omega=2.0, zeta=0.1, s=0.5, c0=1.0, c1=0.3), Filter(omega=2.0, zeta=1.0, s=0.5, c0=0.0, c1=0.3)
OTHERS = [Bounded(mu=0.4, nu=2.0, sigma=0.5), *FILTERS, Telegraph(a=0.5, k=1.0), CHAIN]


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


@pytest.mark.parametrize("noise", [*DIFFUSIONS, *OTHERS], ids=lambda noise: noise.kind)
def test_a_noise_agrees_with_itself(noise):
    f, rates, g = generator(noise)
    std, omega = noise.standard_deviation, np.array([0.3, 1.0, 3.0]) / noise.correlation_time
    for each in () if noise.approximates_spectrum else omega:  # S(ω) = ∫C(t) cos ωt dt
        found = 2 * (f @ spsolve(1j * each * eye(g.size, format="csc") - csc_matrix(rates), g + 0j)).real
        assert noise.spectral_density(each) == pytest.approx(found, rel=1e-3)
    assert math.sqrt((f @ g).real) == pytest.approx(std, rel=1e-6)
    if noise not in DIFFUSIONS:
        return
    xi, mass = law(noise)
    assert mass.sum() == pytest.approx(1.0, abs=1e-6)
    assert mass @ xi == pytest.approx(noise.mean, abs=1e-6 * std)
    inner = np.abs(xi) < min(0.9 * noise.half_width, 3 * std)
    if hasattr(noise, "drift"):
        assert_allclose((rates @ xi)[inner], noise.drift(xi[inner]), atol=1e-3 * std / noise.correlation_time)
    for name in noise.differentiable:
        stated, h = noise.derivative(name), 1e-5 * abs(noise.values[name])
        ends = [(noise.at({name: noise.values[name] + d}), xi[inner] * math.exp(stated.log_scale * d)) for d in (h, -h)]
        fs = ([0.5 * np.log(n.squared_diffusion(x)) for n, x in ends], [n.log_density(x) for n, x in ends])
        (slope, logs), size = ((a - b) / (2 * h) for a, b in fs), 1e-10 / h
        assert_allclose(slope, stated.log_diffusion, rtol=1e-5, atol=size)
        own = stated.log_density(xi[inner]) - logs  # constant
        assert_allclose(own, own.mean(), rtol=0, atol=size * (1 + np.ptp(logs)))
