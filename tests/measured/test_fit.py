"""Fits of known noises, what they mean for stability, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.measured import (
    Record,
    Spectrum,
    fit_noise,
    non_gaussian_from_record,
    of_relative_stiffness,
    of_stability_height,
    of_support_acceleration,
    verdict,
    weak_exponent,
    weak_moment,
)
from fpsolve.measured.kinds import KINDS
from fpsolve.model import ParametricOscillator
from tests.random_fits import NOISES, coverage, fitted, record_of, spectrum_of

OMEGA = np.linspace(0.05, 20, 200)


def exact(noise, omega=OMEGA):
    return np.array([noise.spectral_density(each) for each in omega])


@pytest.mark.parametrize("noise", NOISES, ids=lambda noise: f"{noise.kind}")
def test_a_fit_of_an_exact_spectrum_is_the_noise(noise):
    fit = fitted(Spectrum(OMEGA, exact(noise), np.full(OMEGA.size, 0.1)), noise.kind)
    for name, value in fit.parameters.items():
        assert value == pytest.approx(noise.values[name], rel=1e-3), name
    assert fit.spectral_density(4.0) == pytest.approx(noise.spectral_density(4.0), rel=1e-4)


def test_the_kinds_have_the_covariance_and_density_of_the_noises():
    """C(0) is the variance, and 2∫ C cos ωt dt over t > 0 the density."""
    t = np.linspace(0, 200, 200_001)
    for families in KINDS.values():
        for family in families:
            theta = np.array([1.3, 0.4, 0.7, 0.8][: len(family.names)])
            noise, c = family.make(*theta.tolist()), family.covariance(t, theta)
            assert c[0] == pytest.approx(noise.standard_deviation**2)
            for omega in (0.3, 2.0):
                assert family.density(np.array([omega]), theta)[0] == pytest.approx(noise.spectral_density(omega))
                transform = 2 * trapezoid(c * np.cos(omega * t), t)
                assert transform == pytest.approx(noise.spectral_density(omega), rel=1e-4)


def test_a_filter_without_a_peak_has_no_absurd_parameters():
    """σ²/(α² + ω²) is that of a filter whose second corner is far above, as far as ζ = 10 allows."""
    fit = fitted(Spectrum(OMEGA, exact(NOISES[0]), np.full(OMEGA.size, 0.1)), "filter")
    assert fit.parameters["zeta"] <= 10
    assert fit.parameters["omega"] < 1e3
    assert fit.spectral_density(4.0) == pytest.approx(NOISES[0].spectral_density(4.0), rel=1e-3)
    assert any("do not tell all parameters" in each for each in fit.messages)


def test_standard_errors_of_bounded_noise_are_those_of_its_phase():
    """That of ν is at least σ/√T, of the phase itself; that of μ is below μ/√(2Tσ²) of a Gaussian noise."""
    bounded, T = NOISES[3], 400.0
    fit = fitted(record_of(bounded, np.random.default_rng(0), 4000), "bounded")
    assert 1 < fit.errors["nu"] / (bounded.sigma / math.sqrt(T)) < 1.5
    assert fit.errors["mu"] < 0.5 * bounded.mu / math.sqrt(2 * T * bounded.sigma**2)
    for name, value in fit.parameters.items():
        assert abs(value - bounded.values[name]) < 4 * fit.errors[name], name


def test_standard_errors_of_spectra():
    """25 seeds: 95 % within 1.96 errors; fewer than 19 has a probability below 1e-3."""
    shares, others, _ = coverage(
        NOISES[0],
        lambda noise, rng: spectrum_of(noise, rng, omega=OMEGA),
        lambda data: fitted(data, NOISES[0].kind),
        25,
    )
    assert others == 0
    assert np.all(shares >= 19 / 25)


@pytest.mark.slow
def test_standard_errors_of_records():
    noise = NOISES[0]
    shares, others, _ = coverage(
        noise, lambda n, rng: record_of(n, rng, 8000), lambda data: fitted(data, noise.kind), 25
    )
    assert others == 0
    assert np.all(shares >= 19 / 25)


@pytest.mark.slow
@pytest.mark.parametrize("r0", [0.7, 0.95])
def test_noise_of_eq_7_from_a_record(r0):
    noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=r0)
    fit = non_gaussian_from_record(record_of(noise, np.random.default_rng(0), 40_000, 0.04))
    for name, value in fit.parameters.items():
        assert abs(value - noise.values[name]) < 4 * fit.errors[name], name
    system, scaled = VibroImpactOscillator(1.0, 0.9, -0.4, 1.0, impact="restitution"), fit.scaled(0.5)
    found = verdict(Problem(system, scaled.noise), scaled, rtol=1e-5)
    truth = ExponentSolver(Problem(system, noise.at({"D0": 0.25 * noise.D0})))
    for spread, value in (
        (found.exponent, truth.lyapunov_exponent().value),
        (found.moment, truth.solution(2.0).pair.value),
    ):
        assert abs(spread.value - value) < 4 * spread.deviation


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            np.random.default_rng(1).uniform(-1, 1, 400),
            r"the steps of the record are 1, too long .* below 0\.1\d*, 0\.3 of",
        ),
        (np.sin(0.02 * np.arange(1000)), "kurtosis of the record is 1.5"),
        (np.random.default_rng(1).standard_t(3, 400), "has one between 1.8 and 3; fit another kind"),
    ],
)
def test_what_is_no_noise_of_eq_7_is_refused(values, said):
    with pytest.raises(ValueError, match=said):
        non_gaussian_from_record(Record(values, 1.0))


@pytest.mark.parametrize(
    ("options", "factor"),
    [(("Hz", "one"), 2), (("Hz", "two"), 1), (("rad/s", "one"), 1 / math.pi), (("rad/s", "two"), 0.5 / math.pi)],
)
def test_sides_and_units(options, factor):
    noise = NOISES[0]
    f = OMEGA / (2 * math.pi) if options[0] == "Hz" else OMEGA
    spectrum = Spectrum.from_columns(f, factor * exact(noise), *options, averages=16)
    assert spectrum.density == pytest.approx(exact(noise))
    assert spectrum.relative_error == pytest.approx(0.25)


def test_wrong_sides_are_told_by_the_variance():
    omega = np.linspace(0.001, 400, 100_000)
    density, variance = exact(NOISES[0], omega), NOISES[0].standard_deviation ** 2
    assert Spectrum(omega, density, variance=variance).covered_variance == pytest.approx(variance, rel=1e-2)
    with pytest.raises(ValueError, match=r"some 2 times as much; state another sided"):
        Spectrum(omega, 2 * density, variance=variance)
    with pytest.raises(ValueError, match=r"state another per"):
        Spectrum(omega, 2 * math.pi * density, variance=variance)
    with pytest.raises(ValueError, match=r"9\d\.\d times that of the record.*correct the unit"):
        Spectrum(omega, 9.80665**2 * density, variance=variance)
    assert Spectrum(omega, 0.02 * density, variance=variance).covered_variance < variance  # as of a narrow band


@pytest.mark.parametrize(
    ("frequencies", "density", "said"),
    [
        (OMEGA, -exact(NOISES[0]), r"row 1 is -.*must be > 0"),
        (OMEGA[::-1], exact(NOISES[0]), "sort the rows"),
        (OMEGA - 1, exact(NOISES[0]), "row 1 is negative; remove such rows"),
        (OMEGA[:3], exact(NOISES[0])[:3], "at least 5"),
        (OMEGA, exact(NOISES[0])[:-1], "one for each"),
        (OMEGA, np.where(OMEGA > 3, np.nan, 1.0), "value nan at row"),
    ],
)
def test_broken_spectra_are_refused(frequencies, density, said):
    with pytest.raises(ValueError, match=said):
        Spectrum(frequencies, density)


def test_nothing_near_what_matters_is_refused():
    spectrum = Spectrum(OMEGA, exact(NOISES[0]))
    with pytest.raises(ValueError, match="nothing was measured near 2ω = 100"):
        fit_noise(spectrum, frequency=50.0)
    gap = (OMEGA < 3) | (OMEGA > 5)
    with pytest.raises(ValueError, match="nothing was measured near 2ω = 4"):
        fit_noise(Spectrum(OMEGA[gap], exact(NOISES[0])[gap]), frequency=2.0)
    with pytest.raises(ValueError, match="nothing was measured near 0"):
        fit_noise(Spectrum(OMEGA[20:], exact(NOISES[0])[20:]), frequency=2.0, noise_in="damping")
    fit = fit_noise(Spectrum(OMEGA[gap], exact(NOISES[0])[gap]), frequency=1.0)
    assert any("from" in str(each) and "nothing was measured" in str(each) for each in fit.messages)


def test_units_of_signals():
    """ω²ξ = a/ℓ for a pendulum, ω² = g/ℓ."""
    assert of_relative_stiffness(3.0) * of_support_acceleration() == pytest.approx(9.0 / 9.80665)
    assert of_stability_height(0.5) == 2.0
    with pytest.raises(ValueError, match="omega = -1"):
        of_relative_stiffness(-1)


def test_a_fit_scales_with_the_signal():
    spectrum = Spectrum(OMEGA, exact(NOISES[1]), np.full(OMEGA.size, 0.1))
    fit, other = fitted(spectrum, "filter").scaled(4.0), fitted(spectrum.scaled(4.0), "filter")
    assert fit.parameters == pytest.approx(other.parameters, rel=1e-3)
    assert fit.noise.spectral_density(4.0) == pytest.approx(16 * NOISES[1].spectral_density(4.0), rel=1e-3)
    assert fit.errors == pytest.approx(other.errors, rel=1e-2)


def test_verdict_has_the_weak_noise_limit():
    """With S known up to a share e at 2ω, Λ(2) = −2ζω + ω²S/2 has the error ω²S e/2."""
    omega, zeta = 2.0, 0.01
    noise = OrnsteinUhlenbeck(alpha=1.5, sigma=0.05)
    fit = fitted(Spectrum(OMEGA, exact(noise), np.full(OMEGA.size, 0.25)), noise.kind).scaled(
        of_relative_stiffness(omega)
    )
    found = verdict(Problem(ParametricOscillator(stiffness=omega**2, damping=zeta * omega), fit.noise), fit)
    at_double = noise.spectral_density(2 * omega)
    assert found.exponent.value == pytest.approx(weak_exponent(omega, zeta, at_double, "stiffness"), abs=1e-5)
    assert found.moment.value == pytest.approx(weak_moment(2, omega, zeta, at_double, 0, "stiffness"), abs=1e-5)
    alpha, sigma = fit.parameters.values()
    slope = np.array([-2 * alpha / (alpha**2 + 16), 2 / sigma])
    share = math.sqrt(slope @ fit.covariance @ slope)
    assert found.moment.deviation == pytest.approx(omega**2 * at_double / 2 * share, rel=0.02)
    assert found.moment.below > 0.99


@pytest.mark.slow
def test_von_karman_by_filters():
    """S ~ 1/(1 + (ω/2)²)^(5/6): more filters do better at 2ω, and with it λ and Λ(2) by the averaged formulas."""
    omega = np.geomspace(0.05, 30, 120)
    density = 0.01 / (1 + (omega / 2) ** 2) ** (5 / 6)
    truth = 0.01 / (1 + 4) ** (5 / 6)
    spectrum = Spectrum(omega, density, np.full(omega.size, 0.1))
    fits = [fit_noise(spectrum, "filter", frequency=2.0, terms=terms) for terms in (1, 2)]
    errors = [abs(fit.spectral_density(4.0) / truth - 1) for fit in fits]
    assert errors[0] < 0.05
    assert errors[1] < 0.02
    fit = fits[0].scaled(4.0)
    found = verdict(Problem(ParametricOscillator(stiffness=4.0, damping=0.02), fit.noise), fit)
    assert found.exponent.value == pytest.approx(weak_exponent(2.0, 0.01, truth, "stiffness"), abs=5e-4)


def test_what_is_no_argument_is_refused():
    spectrum = Spectrum(OMEGA, exact(NOISES[0]))
    for options, said in (
        ({"kind": "pink"}, "kind"),
        ({"terms": 3}, "terms"),
        ({"noise_in": "mass"}, "noise_in"),
    ):
        with pytest.raises(ValueError, match=said):
            fit_noise(spectrum, **{"frequency": 2.0, **options})
    with pytest.raises(TypeError, match="Spectrum or a Record"):
        fit_noise([1, 2], frequency=2.0)
    with pytest.raises(ValueError, match="at least 64"):
        Record(np.arange(10.0), 0.1)
