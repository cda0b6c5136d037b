"""The notes on theories outside their range: when they come, and that their numbers are right."""

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov
from fpsolve.theory.perturbation import weak_noise_note
from tests.conftest import FIG1, FIG1_NOISE
from tests.oracles import perturbation


@pytest.mark.parametrize("r0", [0.9, 0.95, 1.0, 1.05, 1.1])
def test_the_reduction_near_gaussian_noise_needs_no_note(r0):
    assert not NonGaussianNoise(D0=1.0, tau0=0.5, r0=r0).ou_reduction().remarks


@pytest.mark.parametrize("r0", [0.6, 1.3])
def test_the_variances_of_the_reduction_and_of_the_noise(r0):
    """The reduction has D₀τ₁/τ₀² = 2D₀(2 − r₀)/(τ₀(5 − 3r₀)), which is 2 − r₀ times Eq. (10)."""
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=r0)
    ou = noise.ou_reduction()
    assert ou.sigma**2 / (2 * ou.alpha) == pytest.approx((2 - r0) * noise.variance, rel=1e-12)
    [note] = ou.remarks
    assert (
        f"its variance is {(2 - r0) * noise.variance:.4g}, and that of the noise, Eq. (10), is {noise.variance:.4g}"
        in note
    )
    assert f"|r0 - 1| = {abs(r0 - 1):.3g} > 0.1" in note


def test_an_impossible_bounce_is_noted():
    assert not FIG1.remarks
    [note] = VibroImpactOscillator(omega=1.0, restitution=0.5, c1=0.0, epsilon=1.5).remarks
    assert "1 - epsilon^2 (1 - r) = -0.125 <= 0" in note
    assert "R = 0.325" in note


def test_weak_noise_needs_no_note_and_strong_noise_gets_its_size():
    p = np.array([-1.0, 0.0, 1.0, 2.0])
    weak, strong = FIG1, VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.6)
    noise = FIG1_NOISE.ou_reduction()
    values = [moment_lyapunov(Problem(oscillator, noise), p, rtol=1e-6).value for oscillator in (weak, strong)]
    assert weak_noise_note(Problem(weak, noise), p, values[0]) is None
    note = weak_noise_note(Problem(strong, noise), p, values[1])
    rest = values[1] - perturbation.moment_exponent(strong, noise, p)
    shares = np.abs(rest[p != 0]) / perturbation.moment_scale(strong, noise, p[p != 0])
    worst = shares.argmax()
    assert f"is largest at p = {p[p != 0][worst]:g}, {rest[p != 0][worst]:.3g}, which is {shares.max():.0%}" in note
