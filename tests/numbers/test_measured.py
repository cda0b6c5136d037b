"""Noises from measurements: known spectra and records give them back within their errors, and what these mean."""

import math

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.signal import welch

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.measured import (
    Record,
    Spectrum,
    fit_noise,
    named_spectrum,
    non_gaussian_from_record,
    verdict,
    weak_exponent,
    weak_moment,
)
from fpsolve.model import Bounded, Filter, ParametricOscillator
from tests.campaign.paths import of_eq_7

OMEGA = np.linspace(0.05, 20, 200)
OU = OrnsteinUhlenbeck(alpha=1.5, sigma=0.4)
PEAK = Filter(omega=3.0, zeta=0.2, s=0.5)
BOUNDED = Bounded(mu=0.4, nu=3.0, sigma=0.8)
NOISES = OU, PEAK, Filter(omega=3.0, zeta=0.2, s=0.5, c0=0.0, c1=1.0), BOUNDED


def exact(noise, omega=OMEGA, error=0.1):
    density = np.array([noise.spectral_density(each) for each in omega])
    return Spectrum(omega, density, np.full(omega.size, error))


DENSITY = exact(OU).density


def fitted(data, noise=OU, frequency=2.0, **options):
    return fit_noise(data, noise.kind, frequency=frequency, **options)


def gaussian(noise, n, step, rng):
    """A record of a linear noise, by its exact steps."""
    a, b = np.array([[-noise.alpha]]), np.array([[noise.sigma]])
    variance, move = solve_continuous_lyapunov(a, -b @ b.T), expm(a * step)
    root, y = np.linalg.cholesky(variance - move @ variance @ move.T), np.linalg.cholesky(variance) @ rng.normal(size=1)
    values = []
    for kick in rng.normal(size=(n, 1)) @ root.T:
        values.append(y[0])
        y = move @ y + kick
    return Record(np.array(values), step)


def coverage(make, seeds, frequency=2.0, noise=OU):
    """The share of seeds that have each parameter within 1.96 standard errors."""
    fits = [fitted(make(np.random.default_rng(seed)), noise, frequency) for seed in range(seeds)]
    off = [[(each.parameters[name] - noise.values[name]) / each.errors[name] for name in each.errors] for each in fits]
    return np.mean(np.abs(off) < 1.96, axis=0)


@pytest.mark.parametrize("noise", NOISES, ids=lambda noise: noise.kind)
def test_fit_of_an_exact_spectrum_is_the_noise(noise):
    fit = fitted(exact(noise), noise)
    assert fit.parameters == pytest.approx({name: noise.values[name] for name in fit.parameters}, rel=1e-3)
    assert fit.spectral_density(4.0) == pytest.approx(noise.spectral_density(4.0), rel=1e-4)


def test_fit_of_a_filter_without_a_peak_has_no_absurd_parameters():
    """σ²/(α² + ω²) is that of a filter whose second corner is far above, as far as ζ = 10 allows."""
    fit = fitted(exact(OU), PEAK)
    assert fit.parameters["zeta"] <= 10
    assert fit.parameters["omega"] < 1e3
    assert fit.spectral_density(4.0) == pytest.approx(OU.spectral_density(4.0), rel=1e-3)
    assert any("do not determine all parameters" in each for each in fit.messages)


def test_standard_errors_of_bounded_noise_are_those_of_its_phase():
    """That of ν is at least σ/√T, of the phase itself; that of μ is below μ/√(2Tσ²) of a Gaussian noise."""
    rng, step, n = np.random.default_rng(0), 0.1, 4000
    kicks = BOUNDED.sigma * math.sqrt(step) * rng.standard_normal(n)
    values = BOUNDED.mu * np.cos(rng.uniform(0, 2 * math.pi) + np.cumsum(BOUNDED.nu * step + kicks))
    fit = fitted(Record(values, step), BOUNDED)
    assert 1 < fit.errors["nu"] / (BOUNDED.sigma / math.sqrt(n * step)) < 1.5
    assert fit.errors["mu"] < 0.5 * BOUNDED.mu / math.sqrt(2 * n * step * BOUNDED.sigma**2)
    for name, value in fit.parameters.items():
        assert abs(value - BOUNDED.values[name]) < 4 * fit.errors[name], name


def test_standard_errors_of_spectra_cover():
    """25 seeds of means of 16 periodograms: fewer than 19 has a probability below 1e-3."""

    def scattered(rng):
        return Spectrum(OMEGA, DENSITY * rng.gamma(16, 1 / 16, OMEGA.size), np.full(OMEGA.size, 0.25))

    assert np.all(coverage(scattered, 25) >= 19 / 25)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "n", "step", "seeds", "least", "frequency"),
    [
        (OU, 8000, 0.1, 25, 19 / 25, 2.0),
        (OrnsteinUhlenbeck(3.0, 2.5), 1000, 0.02, 100, 0.90, 2 * math.pi * 0.8),
        (OrnsteinUhlenbeck(3.0, 2.5), 2000, 0.02, 100, 0.90, 2 * math.pi * 0.8),
    ],
)
def test_standard_errors_of_records_cover(noise, n, step, seeds, least, frequency):
    """Of 100 records 95 ± 5."""
    assert np.all(coverage(lambda rng: gaussian(noise, n, step, rng), seeds, frequency, noise) >= least)


@pytest.mark.slow
@pytest.mark.parametrize("r0", [0.7, 0.95])
def test_noise_of_eq_7_from_a_record_has_its_parameters_and_exponents(r0):
    noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=r0)
    fit = non_gaussian_from_record(of_eq_7(noise, 40_000, 0.04, 5))
    for name, value in fit.parameters.items():
        assert abs(value - noise.values[name]) < 4 * fit.errors[name], name
    system, scaled = VibroImpactOscillator(1.0, 0.9, -0.4, 1.0, impact="restitution"), fit.scaled(0.5)
    found = verdict(Problem(system, scaled.noise), scaled, rtol=1e-5)
    truth = ExponentSolver(Problem(system, noise.at({"D0": 0.25 * noise.D0})))
    for spread, right in (
        (found.exponent, truth.lyapunov_exponent().value),
        (found.moment, truth.solution(2.0).pair.value),
    ):
        assert abs(spread.value - right) < 4 * spread.deviation


def test_r0_of_eq_7_follows_from_the_kurtosis_of_a_record():
    """κ = 3(2a + 3)/(2a + 5) with a = 1/(1 − r₀), of two sines of random walks."""
    walks = np.cumsum(0.3 * np.random.default_rng(0).normal(size=(8000, 2)), axis=0)
    values = np.sin(walks).sum(axis=1)
    kurtosis = np.mean((values - values.mean()) ** 4) / np.var(values) ** 2
    a = 1 / (1 - non_gaussian_from_record(Record(values, 0.02)).parameters["r0"])
    assert 3 * (2 * a + 3) / (2 * a + 5) == pytest.approx(kurtosis, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "factor"),
    [(("Hz", "one"), 2), (("Hz", "two"), 1), (("rad/s", "one"), 1 / math.pi), (("rad/s", "two"), 0.5 / math.pi)],
)
def test_density_of_one_side_or_two_per_hertz_or_radian_is_converted(options, factor):
    f = OMEGA / (2 * math.pi) if options[0] == "Hz" else OMEGA
    spectrum = Spectrum.from_columns(f, factor * DENSITY, *options, averages=16)
    assert spectrum.density == pytest.approx(DENSITY)
    assert spectrum.relative_error == pytest.approx(0.25)


def test_spectrum_of_a_record_is_that_of_welch():
    """Hann's window, half of the segments overlapping."""
    record = Record(np.random.default_rng(1).normal(size=4096).cumsum() % 7, 0.02)
    length = 128
    found = record.spectrum(length)
    f, density = welch(record.values, 50.0, nperseg=length, noverlap=length // 2, detrend="constant")
    at = 8 * math.pi
    right = np.interp(at, 2 * math.pi * f, density)
    assert np.interp(at, found.frequencies, 2 * found.density) == pytest.approx(right, rel=1e-9)


BAND = (OMEGA < 3) | (OMEGA > 5)
AROUND = exact(OU, OMEGA[BAND])
REFUSED = [
    (lambda: Spectrum(OMEGA, -DENSITY), r"row 1 is -.*must be > 0"),
    (lambda: Spectrum(OMEGA[::-1], DENSITY), "sort the rows"),
    (lambda: Spectrum(OMEGA - 1, DENSITY), "row 1 is negative; remove such rows"),
    (lambda: Spectrum(OMEGA[:3], DENSITY[:3]), "at least 5"),
    (lambda: Spectrum(OMEGA, DENSITY[:-1]), "one for each"),
    (lambda: Spectrum(OMEGA, np.where(OMEGA > 3, np.nan, 1.0)), "value nan at row"),
    (lambda: Record(np.arange(10.0), 0.1), "at least 64"),
    (lambda: fitted(exact(OU), frequency=50.0), "nothing was measured near 2ω = 100"),
    (lambda: fitted(AROUND), "nothing was measured near 2ω = 4"),
    (lambda: fitted(exact(OU, OMEGA[20:]), noise_in="damping"), "nothing was measured near 0"),
    (lambda: fit_noise(exact(OU), "pink", frequency=2.0), "kind"),
    (lambda: fitted(exact(OU), terms=3), "terms"),
    (lambda: fitted(exact(OU), noise_in="mass"), "noise_in"),
    (lambda: fitted([1, 2]), "Spectrum or a Record"),
    *[
        (lambda values=values: non_gaussian_from_record(Record(values, 1.0)), said)
        for values, said in (
            (np.random.default_rng(1).uniform(-1, 1, 400), r"the steps .* are 1, too long .* below 0\.1\d*, 0\.3 of"),
            (np.sin(0.02 * np.arange(1000)), "kurtosis of the record is 1.5"),
            (np.random.default_rng(1).standard_t(3, 400), "has one between 1.8 and 3; fit another kind"),
        )
    ],
]


@pytest.mark.parametrize(("make", "said"), REFUSED)
def test_measurement_that_tells_no_noise_is_refused(make, said):
    with pytest.raises((ValueError, TypeError), match=said):
        make()


def test_fit_of_a_scaled_signal_is_the_scaled_fit():
    fit, other = fitted(exact(PEAK), PEAK).scaled(4.0), fitted(exact(PEAK).scaled(4.0), PEAK)
    assert fit.parameters == pytest.approx(other.parameters, rel=1e-3)
    assert fit.noise.spectral_density(4.0) == pytest.approx(16 * PEAK.spectral_density(4.0), rel=1e-3)
    assert fit.errors == pytest.approx(other.errors, rel=1e-2)


def test_verdict_has_the_error_of_weak_noise():
    """With S known up to a share e at 2ω, Λ(2) = −2ζω + ω²S/2 has the error ω²S e/2."""
    omega, zeta, noise = 2.0, 0.01, OrnsteinUhlenbeck(alpha=1.5, sigma=0.05)
    fit = fitted(exact(noise, error=0.25)).scaled(omega**2)
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
def test_verdict_of_von_karman_turbulence_by_filters_is_that_of_its_density():
    """S ~ 1/(1 + (ω/2)²)^(5/6): more filters do better at 2ω, and with it λ by the averaged formula."""
    omega = np.geomspace(0.05, 30, 120)
    spectrum, truth = Spectrum(omega, 0.01 / (1 + (omega / 2) ** 2) ** (5 / 6), np.full(120, 0.1)), 0.01 / 5 ** (5 / 6)
    fits = [fitted(spectrum, PEAK, terms=terms) for terms in (1, 2)]
    assert abs(fits[0].spectral_density(4.0) / truth - 1) < 0.05
    assert abs(fits[1].spectral_density(4.0) / truth - 1) < 0.02
    fit = fits[0].scaled(4.0)
    found = verdict(Problem(ParametricOscillator(stiffness=4.0, damping=0.02), fit.noise), fit)
    assert found.exponent.value == pytest.approx(weak_exponent(2.0, 0.01, truth, "stiffness"), abs=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("terms", "most"), [(1, 0.3), (2, 0.1)])
def test_fit_of_the_sea_by_filters_states_its_misfit(terms, most):
    omega = math.pi / 9  # half of the peak, where waves act most
    spectrum = named_spectrum("jonswap", 2 * omega, Hs=2.0, Tp=9.0).scaled(0.1)
    fit = fitted(spectrum, PEAK, omega, terms=terms)
    [misfit] = fit.misfit
    right = float(np.interp(2 * omega, spectrum.frequencies, spectrum.density))
    # that of a band 10 % wide each way
    assert right / fit.spectral_density(2 * omega) - 1 == pytest.approx(misfit.relative, abs=0.25)
    assert abs(misfit.relative) < most
