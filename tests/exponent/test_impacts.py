"""λ is affine in ln R with the impact rate as its slope, and 0 at the critical R and r: closed forms, other solves."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import hankel1

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
)
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.exponent import INDICES, Budget, critical_impact_factor, critical_restitution, impact_rate
from fpsolve.exponent.error import Absent
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, Telegraph, White

STRONG = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
GAUSSIAN = NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.0).ou_reduction()
BOUNDED = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8)
HEAVY = NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.1)
NOISES = pytest.mark.parametrize("noise", [GAUSSIAN, BOUNDED, HEAVY], ids=["Gaussian", "bounded", "heavy tails"])
LAWS = pytest.mark.parametrize("law", ["delta", "restitution"])
ROTATION = ((0.0, 1.0), (-1.0, 0.0))


def solver(system, noise, rtol=None):
    return ExponentSolver(Problem(system, noise), rtol=rtol or (1e-6 if noise == HEAVY else 1e-9))


@pytest.mark.parametrize(
    ("noise", "factor", "p", "expected"),
    [
        (Telegraph(a=0.5, k=0.5), 0.2, 20.0, -7.726127144527),
        (Telegraph(a=0.5, k=0.5), 0.1, 10.0, -5.850081182888),
        (Telegraph(a=0.2, k=0.3), 0.2, -2.0, 1.136476716839),
        (White(s=0.05), 0.2, 20.0, -11.1134497872118),
        (White(s=0.05), 0.3, 12.0, -5.1566178569916),
    ],
)
def test_a_wall_that_takes_nearly_all(noise, factor, p, expected):
    """By transfer matrices, det(R^p Φ − 1) = 0, and by Fourier waves of T R^(−pφ/π): R^p is not rounded beside 1."""
    walls = [{"at": "x = 0", "restitution": factor}]
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v - xi*x"), walls=walls)
    found = moment_lyapunov(Problem(system, noise), p)
    assert abs(found.value[0] - expected) <= found.error_estimate[0] + 1e-12


@pytest.mark.slow
@LAWS
@NOISES
def test_the_exponent_is_affine_in_the_logarithm_of_the_impact_factor(noise, law):
    """Each r has a discretisation of its own."""
    slopes = []
    oscillators = [replace(STRONG, restitution=r, impact=law) for r in (1.0, 0.7, 0.2)]
    solvers = [solver(oscillator, noise) for oscillator in oscillators]
    exponents, rates = [each.lyapunov_exponent() for each in solvers], [impact_rate(each) for each in solvers]
    for i, j in ((0, 1), (1, 2), (0, 2)):
        change = oscillators[j].log_impact_factor - oscillators[i].log_impact_factor
        slopes.append((exponents[j].value - exponents[i].value) / change)
        error = sum(exponents[k].error_estimate for k in (i, j)) / abs(change)
        for k in (i, j):
            assert abs(rates[k].value - slopes[-1]) <= error + rates[k].error_estimate
    assert np.ptp(slopes) < (1e-5 if noise == HEAVY else 1e-7)


@LAWS
@NOISES
def test_the_exponent_is_zero_at_the_critical_restitution(noise, law):
    found = critical_restitution(solver(replace(STRONG, restitution=0.3, impact=law), noise))
    assert 0 < found.value < 1
    there = solver(replace(STRONG, restitution=found.value, impact=law), noise)
    exponent = there.lyapunov_exponent()
    assert abs(exponent.value) <= exponent.error_estimate + found.error_estimate
    assert found.error_estimate < (1e-5 if noise == HEAVY else 1e-7)
    factor = critical_impact_factor(there)
    assert abs(factor.value - there.problem.system.impact_factor()) <= factor.error_estimate + found.error_estimate


def test_white_noise_with_impacts_has_a_closed_form():
    """ẍ + ω²x − ε²c₁ẋ = εξẋ with white ξ of intensity 2D₀: the errors of λ, N and R_c are series in τ₀."""
    order, place = 0.1 / 0.125, 2 / 0.125  # c₁/D₀ and 2ω/(ε²D₀)
    exact = hankel1(order + 1, place) / hankel1(order, place)
    without_loss, rate = exact.real, -exact.imag / math.pi
    assert [without_loss, rate] == pytest.approx([0.0812971342774, 0.318068729956], abs=2e-13)
    assert without_loss + rate * math.log(0.8) == pytest.approx(0.0103221483130, abs=2e-13)
    critical = math.exp(-without_loss / rate)
    assert critical == pytest.approx(0.774454689945, abs=2e-12)

    oscillator = replace(STRONG, restitution=1 + math.log(0.8))
    assert oscillator.impact_factor() == pytest.approx(0.8, rel=1e-15)
    rows = []
    for tau in 0.1 / 2.0 ** np.arange(7):
        each = solver(oscillator, NonGaussianNoise(D0=0.125, tau0=tau, r0=1.0).ou_reduction(), rtol=1e-10)
        rows.append([each.lyapunov_exponent().value, impact_rate(each).value, critical_impact_factor(each).value])
    table = np.array(rows)
    for k in range(1, len(rows)):
        table = (2**k * table[1:] - table[:-1]) / (2**k - 1)  # without the error of order τ₀^k
    np.testing.assert_allclose(table[0], [without_loss + rate * math.log(0.8), rate, critical], rtol=0, atol=1e-11)


@pytest.mark.parametrize("c1", [0.5, -1.2, 1.9])
def test_without_noise_impacts_follow_the_damped_frequency(c1):
    """λ = c + (ω_d/π) ln R with c = ε²c₁/2, ω_d² = ω² − c²."""
    growth, frequency = c1 / 2, math.sqrt(1 - (c1 / 2) ** 2)
    each = solver(replace(STRONG, c1=c1), OrnsteinUhlenbeck(alpha=1.0, sigma=1e-5))
    assert impact_rate(each).value == pytest.approx(frequency / math.pi, abs=1e-8)
    assert each.lyapunov_exponent().value == pytest.approx(growth - 0.2 * frequency / math.pi, abs=1e-8)
    assert critical_impact_factor(each).value == pytest.approx(math.exp(-growth * math.pi / frequency), rel=1e-7)


def test_weak_noise_keeps_the_relative_accuracy_of_the_loss():
    """With ε = 1e-4, where R is 1 but for 2e-9, r_c is right to many digits."""
    oscillator, noise = replace(STRONG, epsilon=1e-4), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)
    theory = 1 - math.pi * (noise.spectral_density(2.0) / 8 + 0.05)
    for law in ("delta", "restitution"):
        found = critical_restitution(solver(replace(oscillator, impact=law), noise))
        assert found.error_estimate < 1e-7
        assert found.value == pytest.approx(theory, abs=1e-7)


@LAWS
def test_a_motion_that_is_stable_without_loss_has_no_critical_restitution(law):
    each = solver(replace(STRONG, c1=-0.5, impact=law), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5))
    absent = critical_restitution(each)
    assert isinstance(absent, Absent)
    said = re.fullmatch(r"almost surely stable for every r in \(0, 1\], as λ without loss is (-0\.\d+)", absent.reason)
    without_loss = solver(replace(STRONG, c1=-0.5, restitution=1.0), each.problem.noise).lyapunov_exponent().value
    assert float(said[1]) == pytest.approx(without_loss, rel=5e-3)
    gain = critical_impact_factor(each)
    assert gain.value > 1
    gaining = solver(
        PlaneSystem(STRONG.terms[:2] + replace(STRONG, c1=-0.5).terms[2:], [Jump(math.pi / 2, math.log(gain.value))]),
        each.problem.noise,
    )
    assert gaining.lyapunov_exponent().value == pytest.approx(0, abs=1e-7)


def test_a_motion_that_no_loss_makes_stable_has_no_critical_restitution():
    oscillator, noise = replace(STRONG, c1=1.5), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)
    absent = critical_restitution(solver(oscillator, noise))
    assert isinstance(absent, Absent)
    said = re.fullmatch(r"unstable for every r in \(0, 1\]: λ = 0 would need r = (-\d\.\d+)", absent.reason)
    least, most = (solver(replace(oscillator, restitution=r), noise).lyapunov_exponent().value for r in (1e-6, 1.0))
    assert 0 < least < most
    assert float(said[1]) == pytest.approx(-least / (most - least), rel=5e-3)  # the delta law is affine in r


def test_the_telegraph_with_a_wall():
    """Reference values of λ with and without the wall, which tests of chains have, by independent computations."""
    terms = [
        CoefficientMatrix(0, ROTATION),
        CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity),
        CoefficientMatrix(0, ((0.0, 0.0), (0.0, -0.1))),
    ]
    walled = PlaneSystem(terms, [Jump(math.pi / 2, math.log(0.9))])
    each = solver(walled, MarkovChain.telegraph(amplitude=0.5, rate=1.0), rtol=1e-11)
    rate = (-0.0659526129896 + 0.0329794566817) / math.log(0.9)
    assert impact_rate(each).value == pytest.approx(rate, abs=1e-11)
    assert critical_impact_factor(each).value == pytest.approx(math.exp(0.0329794566817 / rate), rel=1e-10)
    assert (
        "almost surely stable for every R in (0, 1], as λ without loss is -0.033" in critical_restitution(each).reason
    )


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_ray_is_crossed_in_the_direction_of_the_motion(turn):
    """N is the slope of λ in ln R, whichever way the phase runs, and wherever the ray is that no noise turns."""
    e = np.array([math.cos(0.7), -math.sin(0.7)])
    driven = 0.9 * np.outer(e, [0.4, -0.7]) - 0.3 * np.eye(2)  # whose eigenvector is e
    terms = [CoefficientMatrix(0, ((0.0, turn), (-turn, 0.0))), CoefficientMatrix(1, driven.tolist(), identity)]
    systems = [PlaneSystem(terms, [Jump(0.7, log)]) for log in (-0.1, 0.2)]
    noise = MarkovChain((-2.0, 0.1, 1.7), ((0, 1.0, 0.4), (0.7, 0, 0.3), (0.2, 0.9, 0)))
    solvers = [solver(system, noise) for system in systems]
    low, high = (each.lyapunov_exponent().value for each in solvers)
    for each in solvers:
        assert impact_rate(each).value == pytest.approx((high - low) / 0.3, rel=1e-7)


@pytest.mark.parametrize(("count", "words"), [(0, "no rays"), (2, "2 rays")])
def test_impacts_on_no_ray_or_several_have_no_rate(count, words):
    system = PlaneSystem(STRONG.terms, [Jump(phase, -0.1) for phase in (0.0, math.pi / 2)[:count]])
    absent = impact_rate(solver(system, GAUSSIAN))
    assert not absent
    assert words in absent.reason
    assert critical_impact_factor(solver(system, GAUSSIAN)) == absent


def test_rare_impacts_give_no_number_that_means_nothing():
    """Overdamped, the phase hardly ever turns; the noise is so weak that the impacts drown in rounding, or do not."""
    overdamped = replace(STRONG, c1=-3.0)
    drowned = solver(overdamped, NonGaussianNoise(D0=0.05, tau0=0.5, r0=1.0).ou_reduction(), rtol=1e-8)
    rate = impact_rate(drowned)
    assert abs(rate.value) <= rate.error_estimate < 1e-10
    for solve in (critical_impact_factor, critical_restitution):
        assert "cannot be distinguished from 0" in solve(drowned).reason
    told = solver(overdamped, NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.0).ou_reduction(), rtol=1e-8)
    assert 0 < impact_rate(told).value < 1e-6
    factor = 0.405 / impact_rate(told).value  # λ₀ is about that without any impact
    assert factor > 500
    said = re.fullmatch(r"its logarithm is (\S+), beyond ±500", critical_impact_factor(told).reason)
    assert float(said[1]) == pytest.approx(factor, rel=0.05)
    assert "stable for every r" in critical_restitution(told).reason
    for name in ("critical_impact_factor", "critical_restitution"):
        assert not math.isnan(INDICES[name].theory(Problem(replace(STRONG, c1=-1e4), GAUSSIAN)))  # nor an exception


def test_what_is_not_resolved_is_no_number():
    each = ExponentSolver(Problem(replace(STRONG, epsilon=2.0), GAUSSIAN), budget=Budget(unknowns=100))
    for solve in (impact_rate, critical_impact_factor, critical_restitution):
        with pytest.raises(NotConverged):
            solve(each)
