"""Eqs. (7)-(16): the noise, its densities and its moments."""

import math
import pickle
import re

import mpmath
import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import quad

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model import OrnsteinUhlenbeckByDeviation, OrnsteinUhlenbeckByIntensity

DEPARTURES = [-5.0, -1.0, 0.0, 0.5, 0.9, 0.95, 1 - 1e-4, 1.0, 1 + 1e-4, 1.1, 1.3, 1.5]


def integral(noise, f):
    """∫ f P_s over the support; in the variable ξ = s t/(1 − t²) where this is the whole line."""
    s = noise.standard_deviation
    if math.isfinite(noise.half_width) and noise.half_width < 50 * s:
        return quad(lambda xi: f(xi) * noise.density(xi), -noise.half_width, noise.half_width, epsabs=1e-13)[0]

    def transformed(t):
        xi = s * t / (1 - t**2)
        return f(xi) * noise.density(xi) * s * (1 + t**2) / (1 - t**2) ** 2

    return quad(transformed, -1, 1, epsabs=1e-13, limit=200)[0]


@pytest.mark.parametrize("r0", DEPARTURES)
def test_density_is_normalised_and_has_the_variance_of_eq_10(r0):
    noise = NonGaussianNoise(D0=0.7, tau0=1.3, r0=r0)
    assert integral(noise, lambda xi: 1.0) == pytest.approx(1, abs=1e-10)
    assert integral(noise, lambda xi: xi**2) == pytest.approx(2 * 0.7 / (1.3 * (5 - 3 * r0)), rel=1e-8)


@pytest.mark.parametrize("departure", [1e-12, 9e-7, 1.1e-6, 1e-5, 1e-4, 1e-3, 9e-3, 1.1e-2, 0.1])
@pytest.mark.parametrize("sign", [-1, 1])
def test_the_logarithm_of_the_density_is_exact_to_rounding_next_to_1(departure, sign):
    """Against Eq. (9) in forty digits."""
    noise = NonGaussianNoise(D0=0.3, tau0=1.7, r0=1 + sign * departure)
    with mpmath.workdps(40):
        D0, tau0, r0, half = map(mpmath.mpf, (noise.D0, noise.tau0, noise.r0, 0.5))
        a, curvature = 1 / abs(r0 - 1), tau0 * (r0 - 1) / (2 * D0)
        total = mpmath.beta(a + 1 if sign < 0 else a - half, half) / mpmath.sqrt(abs(curvature))
        xi = [x for x in (0.0, 0.1, 1.0, 5.0, 30.0, 1e6) if 1 + curvature * x**2 > 0]
        known = [float(-mpmath.log1p(curvature * mpmath.mpf(x) ** 2) / (r0 - 1) - mpmath.log(total)) for x in xi]
    np.testing.assert_allclose(noise.log_density(xi), known, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("r0", DEPARTURES)
def test_drift_by_the_density_and_by_the_potential(r0):
    """½σ² (ln P_s)′ = −V′/τ₀."""
    noise = NonGaussianNoise(D0=0.7, tau0=1.3, r0=r0)
    xi = 0.7 * min(noise.half_width, 3 * noise.standard_deviation) * np.linspace(-1, 1, 11)
    h = 1e-5 * noise.standard_deviation
    slope, gradient = ((f(xi + h) - f(xi - h)) / (2 * h) for f in (lambda x: np.log(noise.density(x)), noise.potential))
    np.testing.assert_allclose(noise.drift(xi), 0.5 * noise.diffusion**2 * slope, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(noise.drift(xi), -gradient / 1.3, rtol=1e-7, atol=1e-8)


def test_r0_to_1_is_the_ornstein_uhlenbeck_process_with_variance_D0_over_tau0():
    xi = np.linspace(-4, 4, 9)
    limit = OrnsteinUhlenbeck(alpha=2.0, sigma=math.sqrt(2 * 0.3) * 2)
    assert limit.standard_deviation**2 == pytest.approx(0.3 / 0.5)
    for r0 in (1 - 1e-12, 1.0, 1 + 1e-12):
        noise = NonGaussianNoise(D0=0.3, tau0=0.5, r0=r0)
        np.testing.assert_allclose(noise.density(xi), limit.density(xi), rtol=1e-9)
        np.testing.assert_allclose(noise.drift(xi), limit.drift(xi), rtol=1e-9)
        assert noise.ou_reduction().alpha == pytest.approx(2.0)


def test_support_is_bounded_for_r0_below_1_only():
    noise = NonGaussianNoise(D0=0.3, tau0=0.5, r0=0.7)
    assert noise.half_width == pytest.approx(math.sqrt(2 * 0.3 / (0.5 * 0.3)))
    np.testing.assert_array_equal(noise.density([-noise.half_width, 1.01 * noise.half_width, 9.0]), 0)
    assert noise.density(0.99 * noise.half_width) > 0
    assert np.isnan(noise.potential(1.01 * noise.half_width))
    assert math.isinf(NonGaussianNoise(D0=0.3, tau0=0.5, r0=1.2).half_width)


def test_reduction_follows_eqs_12_to_14():
    tau1 = 2 * (2 - 0.95) / (5 - 3 * 0.95) * 0.5
    D1 = (2 * (2 - 0.95) / (5 - 3 * 0.95)) ** 2 * 1.0
    ou = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
    assert ou.alpha == pytest.approx(1 / tau1, rel=1e-15)
    assert ou.sigma == pytest.approx(math.sqrt(2 * D1) / tau1, rel=1e-15)


def test_spectral_density_is_the_fourier_transform_of_the_correlation():
    ou = OrnsteinUhlenbeck(alpha=1.7, sigma=0.6)
    variance = 0.6**2 / (2 * 1.7)
    for omega in (0.0, 0.4, 3.0):
        transform = 2 * quad(lambda t, w=omega: variance * np.exp(-1.7 * t) * np.cos(w * t), 0, 30, limit=300)[0]
        assert ou.spectral_density(omega) == pytest.approx(transform, rel=1e-9)


@pytest.mark.parametrize("r0", [math.nextafter(5 / 3, 0), 5 / 3, 2.0])
def test_no_reduction_where_the_variance_is_infinite(r0):
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=r0)
    assert noise.variance == noise.correlation_time == math.inf
    with pytest.raises(ValueError, match=r"r0 = .* choose r0 < 5/3"):
        noise.ou_reduction()


@pytest.mark.parametrize(
    ("name", "value"),
    [("D0", 0.0), ("D0", -1.0), ("tau0", math.inf), ("tau0", "1"), ("r0", 3.0), ("r0", math.nan), ("D0", True)],
)
def test_bad_parameters_are_refused_by_name(name, value):
    with pytest.raises(ValidationError) as refused:
        NonGaussianNoise(**({"D0": 1.0, "tau0": 0.5, "r0": 0.95} | {name: value}))
    said = rf"NonGaussianNoise: {name}: got {re.escape(repr(value))}; must be a finite number >= \S+ and <=? \S+ \(.+\)"
    assert re.fullmatch(said, str(refused.value))


def test_each_fault_has_a_sentence_with_its_unit():
    size = "must be a finite number >= 1e-15 and <= 1e15"
    for arguments, named, said in (
        ((), {"D0": -1.0, "tau0": math.nan, "r0": 0.9}, [
            f"D0: got -1.0; {size} (noise intensity, in 1/time)", f"tau0: got nan; {size} (correlation time, in time)",
        ]),
        ((), {"tau0": 1.0, "r0": 0.9, "DO": 1.0}, [
            f"D0: missing; {size} (noise intensity, in 1/time)", "DO: unknown; the parameters are D0, tau0, r0",
        ]),
        ((10**5000, 1.0, 0.9), {}, [f"D0: got a number too long to show; {size} (noise intensity, in 1/time)"]),
        ((1.0, [0.5] * 99, 0.9), {}, [f"tau0: got [{'0.5, ' * 11}0...; {size} (correlation time, in time)"]),
        ((1.0, 0.0, 0.9), {}, [f"tau0: got 0.0; {size} (correlation time, in time)"]),
        ((1.0, 1.0, 0.9, 2.0), {}, ["argument 4: unknown; the parameters are D0, tau0, r0"]),
    ):  # fmt: skip
        with pytest.raises(ValidationError) as refused:
            NonGaussianNoise(*arguments, **named)
        assert str(refused.value).splitlines() == [f"NonGaussianNoise: {sentence}" for sentence in said]
        assert refused.value.__context__ is None
        assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)


@pytest.mark.parametrize(
    "stated",
    [
        lambda noise: OrnsteinUhlenbeckByIntensity(D0=0.5 * noise.spectral_density(0.0), tau0=1 / noise.alpha),
        lambda noise: OrnsteinUhlenbeckByDeviation(alpha=noise.alpha, standard_deviation=noise.standard_deviation),
    ],
)
def test_ornstein_uhlenbeck_noise_by_other_numbers(stated):
    """The same law, and derivatives that are differences."""
    from fpsolve import Problem, VibroImpactOscillator, sensitivities
    from fpsolve.exponent.solver import ExponentSolver

    noise = OrnsteinUhlenbeck(alpha=0.7, sigma=0.9)
    other = stated(noise)
    assert (other.alpha, other.sigma) == pytest.approx((0.7, 0.9), rel=1e-15)
    problem = Problem(VibroImpactOscillator(omega=1.0, restitution=0.9, c1=0.1, epsilon=0.4), other)
    [found] = sensitivities(problem, 1.5).moments
    for name, value in other.values.items():
        key, h = f"noise.{name}", 1e-4 * value
        ahead, behind = (ExponentSolver(problem.at({key: value + d}), rtol=1e-11).pair(1.5).value for d in (h, -h))
        assert found[key].value == pytest.approx((ahead - behind) / (2 * h), rel=1e-6)
