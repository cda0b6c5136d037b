"""The stated error is not below the true one, and not far above it, also at loose tolerances."""

from functools import partial

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    MomentLyapunovFunction,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
)
from fpsolve.exponent import Budget
from fpsolve.model import Poisson, SineWiener, Telegraph, White
from tests.kit import rates
from tests.numbers.rows.saddles import UNDER_FILTER
from tests.numbers.values import exponent, index, moment, slope, variance_rate
from tests.oracles import phase_fraction

GAUSSIAN = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.8), OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
)
BOUNDED = Problem(GAUSSIAN.system, NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9))
UNEVEN = Problem(
    VibroImpactOscillator(omega=4.525724, restitution=0.8319, c1=0.0509, epsilon=1.51756),
    NonGaussianNoise(D0=0.0702925, tau0=9.66294, r0=0.9534).ou_reduction(),
)
"""The two highest modes have 1/600 of the effect of four, but with two degrees more the error falls to 1/400."""
CANCELLING = Problem(
    VibroImpactOscillator(omega=1.79739, restitution=0.678619, c1=-0.427429, epsilon=1.740024),
    NonGaussianNoise(D0=0.01061148, tau0=11.099875, r0=0.624766),
)
"""At p = 0 the effect of two modes is 1/8 of that of one, as parts of it cancel."""
SLOW_FALL = rates("x' = v; v' = -x - 0.351*v - xi*x", OrnsteinUhlenbeck(alpha=0.2, sigma=3.0))
"""Slow, strong noise at p < 0, where each polynomial lowers the error by a tenth only."""
STRUCK = rates("x' = v; v' = -0.25*x - 0.358*v - xi*x", Poisson(rate=1.0, sizes=(-5.445,)))
COARSE = make_mesh(phi_cells=2, phi_degree=5, xi_cells=4, xi_degree=4, xi_min=-5, xi_max=5)
"""Wide enough for the bounded noise, too narrow for the other one."""


@pytest.mark.parametrize(
    ("problem", "of", "known", "median"),
    [
        *((problem, partial(moment, p), None, 300) for problem in (GAUSSIAN, BOUNDED) for p in (-1.0, 2.0)),
        *((problem, partial(slope, 2.0), None, 300) for problem in (GAUSSIAN, BOUNDED, CANCELLING)),
        *((problem, exponent, None, 300) for problem in (GAUSSIAN, BOUNDED, CANCELLING)),
        (GAUSSIAN, variance_rate, None, 1e5),
        (GAUSSIAN, index, None, 300),
        (UNEVEN, partial(moment, 9.472337), None, 30),
        (CANCELLING, partial(moment, 9.686645), None, 30),
        (SLOW_FALL, partial(moment, -0.5), 0.0006727, 10),  # by Fourier series and Hermite polynomials
        (STRUCK, exponent, 1.462376991, 100),  # by Fourier series, 400 waves
    ],
)
def test_stated_error_at_loose_tolerances_covers_the_true_one(problem, of, known, median):
    """Against the known value or a tight tolerance; the median is of stated over true errors."""
    right, doubt = (known, 5e-8) if known else of(rtol=1e-10).solved(problem)
    shares = []
    for rtol in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)[: 3 if known else 5]:
        value, stated = of(rtol=rtol).solved(problem)
        assert abs(value - right) <= stated + doubt, rtol
        shares.append(stated / max(abs(value - right), doubt))
    assert np.median(shares) <= median, shares


@pytest.mark.parametrize(
    ("problem", "p", "mesh", "low", "high"),
    [
        *((BOUNDED, p, COARSE, 0.9, 1.1) for p in (-1.0, 2.0)),
        *(
            (GAUSSIAN, -1.0, make_mesh(phi_cells=4, xi_cells=8, xi_min=low, xi_max=high), 0.7, 2.0)
            for low, high in ((-8, 4), (-8, 3), (-4, 8))
        ),
    ],
)
def test_stated_error_of_a_given_mesh_is_the_true_one(problem, p, mesh, low, high):
    """Of its elements, and of either end of its interval."""
    value, stated = moment(p, mesh=mesh).solved(problem)
    off = abs(value - moment(p, rtol=1e-11).solved(problem)[0])
    assert low * off <= stated <= high * off


@pytest.mark.parametrize("of", [partial(slope, 2.0), variance_rate])
def test_stated_error_of_derivatives_covers_what_a_given_interval_cuts_off(of):
    value, stated = of(mesh=make_mesh(xi_min=-5, xi_max=5)).solved(GAUSSIAN)
    off = abs(value - of(rtol=1e-10).solved(GAUSSIAN)[0])
    assert 1e-9 < off <= stated


def odd(seed: int):
    """A set of strong and slow noise, heavy impacts, and p from −8 to 30."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    oscillator = VibroImpactOscillator(
        omega=between(0.05, 50), restitution=rng.uniform(0.05, 1), c1=rng.uniform(-0.5, 0.5), epsilon=between(0.02, 3)
    )
    noise = NonGaussianNoise(D0=between(0.01, 2), tau0=between(1e-3, 1e3), r0=rng.uniform(0, 1.6))
    is_exact = noise.r0 < 1 and rng.random() < 0.7
    return Problem(oscillator, noise if is_exact else noise.ou_reduction()), rng.uniform(-8, 30)


def by_fraction(problem, p: float, start: float, tilt: float, scale: float) -> tuple[float, float]:
    """Λ(p) by a continued fraction, and how far it may be off; the doubt is infinite where it does not settle."""
    found = []
    for harmonics, polynomials in ((12, 20), (24, 36), (36, 48), (54, 60)):
        sizes = {"harmonics": harmonics, "polynomials": polynomials, "tilt": tilt}
        found.append(phase_fraction.moment_lyapunov(problem.system, problem.noise, p, start, **sizes))
        steps = np.abs(np.diff(found[-3:]))
        if len(found) > 2 and np.max(steps) < 1e-9 * scale:
            return found[-1], float(np.max(steps)) + 1e-14 * harmonics * problem.system.omega
    return found[-1], np.inf


@pytest.mark.parametrize("sets", [8, pytest.param(14, marks=pytest.mark.slow)])
def test_stated_error_of_odd_sets_covers_the_true_one(sets):
    compared = solved = 0
    for seed in range(sets):
        problem, p = odd(seed)
        solver = ExponentSolver(problem, budget=Budget(unknowns=15_000))
        try:
            found = solver.solution(p)
        except NotConverged:
            continue
        solved += 1
        value, scale = found.pair.value, max(abs(found.pair.value), solver.method.scale(p))
        known, doubt = by_fraction(problem, p, value * (1 + 1e-6), found.pair.space.xi.tilt, scale)
        if np.isfinite(doubt):
            compared += 1
            assert abs(value - known) <= found.error + 3 * doubt, seed
    assert solved >= 0.85 * sets
    assert compared >= 0.75 * sets


@pytest.mark.parametrize(
    ("problem", "p", "h", "rtol"),
    [
        *(
            pytest.param(rates("x' = v; v' = -x - 0.2*v - xi*x", noise), p, *rest, marks=marks)
            for noise, rest, marks in (
                (OrnsteinUhlenbeck(1.0, 1.0), (0.02, 1e-9), ()),
                (White(s=0.5), (0.02, 1e-9), ()),
                (SineWiener(3.0, 0.6), (0.02, 1e-9), pytest.mark.slow),
                (Telegraph(3.0, 1.0), (0.02, 1e-9), ()),
            )
            for p in (-2.0, 1.0)
        ),
        pytest.param(UNDER_FILTER, 2.0, 0.1, 1e-6, marks=pytest.mark.slow),
    ],
)
def test_stated_error_of_the_slope_covers_that_of_differences(problem, p, h, rtol):
    """Also where a space has T, and so Λ(2), to the last digit."""
    found, solver = moment_lyapunov(problem, p), ExponentSolver(problem, rtol=rtol)
    near = {k: solver.solution(p + k * h) for k in (-2, -1, 1, 2)}
    value = {k: each.pair.value for k, each in near.items()}
    difference = (8 * (value[1] - value[-1]) - (value[2] - value[-2])) / (12 * h)
    rounding = 1.5 * max(each.error for each in near.values()) / h
    assert abs(found.derivative[0] - difference) <= 1.5 * found.derivative_error[0] + rounding + 1e-7 + 5e-5 * (h > 0.1)


def test_stated_error_of_slopes_of_an_interpolant_covers_the_true_one():
    problem, p = rates("x' = v; v' = -x - 0.2*v - xi*x", OrnsteinUhlenbeck(1.0, 0.3)), np.linspace(-1.5, 3.0, 7)
    function, solver = MomentLyapunovFunction(problem, (-1.5, 3.0)), ExponentSolver(problem, rtol=1e-10)
    slopes = np.array([solver.pair(each).derivative for each in p])
    assert np.all(np.abs(function.derivative(p) - slopes) <= function.derivative_error(p))
    assert np.max(function.derivative_error(p)) < 1e-3


@pytest.mark.slow
def test_stated_error_among_tails_covers_what_lies_beyond_a_mesh():
    """Far out noise is slow beside the motion, and ‖x‖ grows at the largest rate of each ξ, to 2 %."""
    noise = NonGaussianNoise(D0=0.5, tau0=0.4, r0=1.35)
    problem = rates("x' = v; v' = -x - 0.1*v - 0.6*xi*v", noise)
    mesh = make_mesh(phi_cells=6, phi_degree=9, xi_cells=12, xi_degree=9, xi_min=-40, xi_max=40, grading=3.0)
    inside, xi = lyapunov_exponent(problem, mesh=mesh), 40 * noise.standard_deviation * np.exp(np.linspace(0, 16, 4001))
    beyond = 0.0
    for side in (-1, 1):
        growth = [np.linalg.eigvals([[0, 1], [-1, -0.1 - 0.6 * side * each]]).real.max() for each in xi]
        beyond += np.trapezoid((np.array(growth) - inside.value) * np.exp(noise.log_density(side * xi)), xi)
    assert 0.99 * beyond <= inside.error_estimate < 2 * beyond
    for rtol in (1e-2, 1e-6):
        solved = lyapunov_exponent(problem, rtol=rtol)
        assert abs(solved.value - inside.value - beyond) <= solved.error_estimate + 0.02 * beyond
