"""Named densities by their formulas in another form, their integrals, and what a fit to one means."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from fpsolve import OrnsteinUhlenbeck, Problem
from fpsolve.exponent import Budget
from fpsolve.exponent.solver import solver_of
from fpsolve.measured import (
    Record,
    fit_noise,
    named_density,
    named_spectrum,
    of_relative_stiffness,
    read_spectrum,
    verdict,
    weak_exponent,
    weak_moment,
)
from fpsolve.measured.named import NAMED
from fpsolve.model import Filter, ParametricOscillator

WAVES, WIND, GROUND = {"Hs": 2.0, "Tp": 9.0}, {"sigma": 1.5, "L": 120.0, "U": 11.0}, {"S0": 0.01}
STATED = {"jonswap": WAVES, "pierson-moskowitz": WAVES, "von-karman": WIND, "kaimal": WIND, "kanai-tajimi": GROUND}


def one_sided_per_hertz(name, f):
    """G(f) of the sources in 30 digits, by other arrangements of their formulas."""
    f = mpmath.mpf(f)
    if name in ("jonswap", "pierson-moskowitz"):
        hs, fp, gamma = mpmath.mpf(2), 1 / mpmath.mpf(9), mpmath.mpf("3.3" if name == "jonswap" else 1)
        sigma = mpmath.mpf("0.07") if f <= fp else mpmath.mpf("0.09")
        base = mpmath.mpf(5) / 16 * hs**2 / fp * (fp / f) ** 5 * mpmath.exp(-mpmath.mpf("1.25") * (fp / f) ** 4)
        b = mpmath.exp(-((f / fp - 1) ** 2) / (2 * sigma**2))
        return (1 - mpmath.mpf("0.287") * mpmath.log(gamma)) * base * gamma**b
    if name == "kanai-tajimi":
        w, own, zeta = 2 * mpmath.pi * f, mpmath.mpf("15.6"), mpmath.mpf("0.6")
        gain = abs((own**2 + 2j * zeta * own * w) / (own**2 - w**2 + 2j * zeta * own * w)) ** 2
        return 2 * mpmath.pi * 2 * mpmath.mpf("0.01") * gain
    n = f * 120 / 11
    shape = (
        (1 + 6 * n) ** (-mpmath.mpf(5) / 3)
        if name == "kaimal"
        else (1 + mpmath.mpf("70.8") * n**2) ** (-mpmath.mpf(5) / 6)
    )
    return 4 * mpmath.mpf("1.5") ** 2 * (n / f) * shape


@pytest.mark.parametrize("name", NAMED)
def test_the_density_is_that_of_its_source(name):
    """S(2πf) = G(f)/2."""
    with mpmath.workdps(30):
        for f in ("0.06", "0.111", "0.12", "0.3", "2.5"):
            expected = float(one_sided_per_hertz(name, f) / 2)
            assert named_density(name, 2 * math.pi * float(f), **STATED[name]) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("name", "variance", "rtol"), [
    ("pierson-moskowitz", (2.0 / 4) ** 2, 1e-9),  # m₀ = (Hs/4)²
    ("jonswap", (2.0 / 4) ** 2, 0.02),  # as its factor 1 − 0.287 ln γ is a fit
    ("von-karman", 1.5**2, 2e-3), ("kaimal", 1.5**2, 1e-7),
])  # fmt: skip
def test_the_integral_is_the_variance(name, variance, rtol):
    found = quad(lambda x: math.exp(x) * float(named_density(name, math.exp(x), **STATED[name])) / math.pi, -25, 25,
                 limit=500, points=[math.log(2 * math.pi / 9)])[0]  # fmt: skip
    assert found == pytest.approx(variance, rel=rtol)


@pytest.mark.slow
@pytest.mark.parametrize("terms", [1, 2])
def test_the_sea_is_fitted_by_filters_with_a_stated_misfit(terms):
    """What the fit is off at 2ω is off in the averaged formulas of λ and Λ(2), too, to first order."""
    omega = math.pi / 9  # half of the peak, where waves act most
    spectrum = named_spectrum("jonswap", 2 * omega, **WAVES).scaled(0.1)
    fit = fit_noise(spectrum, "filter", frequency=omega, terms=terms)
    at = 2 * omega
    right, fitted = float(np.interp(at, spectrum.frequencies, spectrum.density)), fit.spectral_density(at)
    [misfit] = fit.misfit
    assert right / fitted - 1 == pytest.approx(misfit.relative, abs=0.25)  # that of a band 10 % wide each way
    for number in (weak_exponent, lambda *args: weak_moment(2.0, *args[:3], 0.0, args[3])):
        off = number(omega, 0.0, right, "stiffness") - number(omega, 0.0, fitted, "stiffness")
        assert off / number(omega, 0.0, fitted, "stiffness") == pytest.approx(right / fitted - 1, rel=1e-9)
    assert abs(misfit.relative) < (0.3 if terms == 1 else 0.1)


def test_break_points_are_joined_by_straight_lines_in_the_logarithms(tmp_path):
    (tmp_path / "a.csv").write_text("f (Hz),G (g^2/Hz)\n10,0.01\n50,0.04\n500,0.04\n2000,0.01\n", encoding="utf-8")
    found = read_spectrum(tmp_path / "a.csv", sided="one", of="acceleration", log_log=True)
    f, density = found.frequencies / (2 * math.pi), 2 * found.density / 9.80665**2
    assert np.interp(100.0, f, density) == pytest.approx(0.04)
    slope = math.log(0.04 / 0.01) / math.log(5)
    rising = f < 50
    assert density[rising] == pytest.approx(0.01 * (f[rising] / 10) ** slope, rel=1e-9)


@pytest.mark.parametrize(("parameters", "said"), [
    ({"Hs": 2.0}, "jonswap lacks Tp; its parameters are Hs: significant wave height, in m"),
    ({**WAVES, "U": 1.0}, "has no U"), ({**WAVES, "gamma": 0.5}, "got gamma = 0.5; must be from 1 to 7"),
    ({"Hs": -2.0, "Tp": 9.0}, "got Hs = -2; must be > 0"),
])  # fmt: skip
def test_what_a_named_density_must_state(parameters, said):
    with pytest.raises(ValueError, match=said):
        named_density("jonswap", 1.0, **parameters)


def path_of(noise, n, step, rng):
    """A stationary path of a linear noise, by its exact step."""
    from scipy.linalg import expm, solve_continuous_lyapunov

    if isinstance(noise, OrnsteinUhlenbeck):
        a, b = np.array([[-noise.alpha]]), np.array([[noise.sigma]])
    else:
        a = np.array([[0.0, 1.0], [-(noise.omega**2), -2 * noise.zeta * noise.omega]])
        b = np.array([[0.0], [noise.s]])
    variance, move = solve_continuous_lyapunov(a, -b @ b.T), expm(a * step)
    root = np.linalg.cholesky(variance - move @ variance @ move.T)
    y, kicks, values = np.linalg.cholesky(variance) @ rng.normal(size=len(a)), rng.normal(size=(n, len(a))) @ root.T, []
    for kick in kicks:
        values.append(y[0])
        y = move @ y + kick
    return np.array(values)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [20, 40])
def test_standard_errors_of_short_records_cover(seconds):
    """Of 100 records 95 ± 5 intervals of ±1.96 standard errors have the parameter, and ln S where it matters."""
    step, true = 0.02, OrnsteinUhlenbeck(3.0, 2.5)
    inside = []
    for seed in range(100):
        record = Record(path_of(true, int(seconds / step), step, np.random.default_rng(seed)), step)
        fit = fit_noise(record, "ornstein-uhlenbeck", frequency=2 * math.pi * 0.8)
        z = [(fit.parameters[key] - true.values[key]) / fit.errors[key] for key in list(fit.parameters)[:3]]
        inside.append([abs(each) < 1.96 for each in z])
    shares = np.mean(inside, axis=0)
    assert np.all((shares >= 0.90) & (shares <= 1.0)), shares


@pytest.mark.slow
def test_a_narrow_band_has_a_mean_square_where_the_exponent_takes_too_long():
    """Λ(2) by the equations of the moments, as by elements; λ is missing with its reason."""
    omega, noise = 2 * math.pi, Filter(4 * math.pi, 0.01, 8.0, 1.0, 0.0)
    fit = replace(
        fit_noise(named_spectrum("kanai-tajimi", 2 * omega, S0=1.0), "filter", frequency=omega),
        parts=(noise,),
        parameters={"omega": noise.omega, "zeta": noise.zeta, "s": noise.s},
        covariance=np.zeros((3, 3)),
    )
    problem = Problem(ParametricOscillator(stiffness=of_relative_stiffness(omega), damping=0.5), noise)
    found = verdict(problem, fit, rtol=1e-9, budget=Budget(seconds=0.5))
    assert found.exponent is None
    assert found.failure is not None
    elements = solver_of(problem, rtol=1e-6).solution(2.0)
    assert found.moment.value == pytest.approx(elements.pair.value, abs=3 * elements.error)
