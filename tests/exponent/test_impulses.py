"""Impulses at random times: Λ(p) against moment equations and Fourier series, limits, derivatives, simulation."""

import math

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    PlaneSystem,
    Problem,
    lyapunov_exponent,
    moment_lyapunov,
    prove,
    sensitivities,
    simulate,
)
from fpsolve.analysis import furstenberg_khasminskii
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump, ParametricOscillator, Poisson, White, noise_kind
from fpsolve.simulation.coefficients import coefficients
from fpsolve.simulation.setup import transient
from fpsolve.theory import hierarchy_exponent
from tests.oracles import moment_hierarchy, phase_circle

FREE, STIFFNESS = [[0.0, 1.0], [-1.0, -0.4]], [[0.0, 0.0], [-1.0, 0.0]]
WALL = Jump(math.pi / 2, math.log(0.8))


def of(noise, jumps=(), free=FREE, driven=STIFFNESS):
    return Problem(PlaneSystem([CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)], jumps), noise)


def even(size=1.0, rate=1.0):
    return Poisson(rate=rate, sizes=(-size, size))


def test_spectral_density_and_shares():
    noise = Poisson(rate=2.0, sizes=(1.0, -2.0), weights=(3.0, 1.0))
    assert noise_kind("poisson") is Poisson
    assert noise.spectral_density(0.0) == noise.spectral_density(7.0) == pytest.approx(2 * (0.75 + 0.25 * 4), rel=1e-15)
    np.testing.assert_allclose(noise.shares, [0.75, 0.25])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"sizes": (0.0,)}, "one size at least must differ from 0"),
        ({"sizes": ()}, "one size at least must differ from 0"),
        ({"sizes": (1.0,), "weights": (1.0, 2.0)}, "2 weights for 1 sizes"),
        ({"sizes": (1.0, 2.0), "weights": (1.0, -2.0)}, "weights must be >= 0"),
        ({"sizes": (math.inf,)}, "finite"),
        ({"rate": 0.0}, "rate: got 0"),
    ],
)
def test_refusals(given, told):
    with pytest.raises(ValueError, match=told):
        Poisson(**{"rate": 1.0, "sizes": (1.0,), **given})


def test_impulses_over_a_wall_and_too_large_ones_are_refused():
    with pytest.raises(ValueError, match="poisson noise moves the phase across the ray of a jump"):
        of(even(), [WALL], driven=[[0.0, 1.0], [0.0, 0.0]])
    with pytest.raises(ValueError, match="use smaller sizes"):
        of(even(1e3), driven=[[0.0, 0.0], [0.0, 1.0]])


def test_large_impulses_that_are_no_power():
    """The velocity jumps by ±1000x, so that x is multiplied by a polynomial."""
    noise = even(1e3)
    right = [
        moment_hierarchy.impulses_exponent(FREE, STIFFNESS, noise.rate, noise.sizes, noise.shares, p) for p in (2, 4)
    ]
    found = moment_lyapunov(of(noise), [2.0, 4.0])
    assert np.all(np.abs(found.value - right) <= found.error_estimate)
    assert np.all(found.error_estimate <= 1e-8 * found.value)


@pytest.mark.parametrize("noise", [even(), Poisson(rate=0.7, sizes=(1.5, -0.3, 0.2), weights=(1.0, 2.0, 3.0))])
def test_moments_and_the_lyapunov_exponent(noise):
    law = FREE, STIFFNESS, noise.rate, noise.sizes, noise.shares
    made = phase_circle.impulses(*law)
    found = moment_lyapunov(of(noise), [-0.5, 1.0, 2.0, 4.0])
    hierarchy = [moment_hierarchy.impulses_exponent(*law, p) for p in (2, 4)]
    circle = [phase_circle.moment_exponent(made, p, 60) for p in found.p]
    assert np.all(np.abs(found.value - circle) <= found.error_estimate + 1e-12)
    np.testing.assert_allclose(circle[2:], hierarchy, atol=1e-11)
    np.testing.assert_allclose([hierarchy_exponent(of(noise), p)[0] for p in (2, 4)], hierarchy, atol=1e-13)
    exponent = lyapunov_exponent(of(noise))
    assert abs(exponent.value - phase_circle.lyapunov_exponent(made, 60)) <= exponent.error_estimate + 1e-12


def test_the_oscillator_that_is_struck_once_in_a_unit_of_time():
    """Λ(2) by the largest eigenvalue of the 3 × 3 equations of the second moments."""
    found = moment_lyapunov(of(even()), 2.0)
    assert abs(found.value[0] - 0.09016467340593) <= found.error_estimate[0] + 1e-14


def test_with_a_wall():
    made = phase_circle.impulses(FREE, STIFFNESS, 1.0, (-1.0, 1.0), (0.5, 0.5))
    problem = of(even(), [WALL])
    found = moment_lyapunov(problem, [1.0, 2.0])
    circle = [phase_circle.moment_exponent(made, p, 60, 0.8) for p in found.p]
    assert np.all(np.abs(found.value - circle) <= found.error_estimate + 1e-12)
    exact = phase_circle.lyapunov_exponent(made, 60, 0.8)
    assert furstenberg_khasminskii(ExponentSolver(problem).pair(0.0)) == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_random_systems(seed):
    rng = np.random.default_rng([31, seed])
    free, driven = rng.uniform(-1, 1, (2, 2, 2))
    free += (1.0 + rng.random()) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    noise = Poisson(rate=rng.uniform(0.2, 3), sizes=tuple(rng.uniform(-1, 1, 3)), weights=tuple(rng.random(3)))
    law = free, driven, noise.rate, noise.sizes, noise.shares
    found = moment_lyapunov(of(noise, free=free.tolist(), driven=driven.tolist()), [2.0, 4.0])
    exact = [moment_hierarchy.impulses_exponent(*law, p) for p in (2, 4)]
    assert np.all(np.abs(found.value - exact) <= found.error_estimate + 1e-12)


def test_many_small_impulses_are_white_noise():
    """Of odd moments 0: what is left falls with the rate; at p = 2 nothing is, as A₁² = 0."""
    limit = moment_lyapunov(of(White(s=0.5)), [1.0, 4.0]).value
    rates = np.array([64.0, 128.0, 256.0])
    found = [moment_lyapunov(of(even(0.5 / math.sqrt(rate), rate)), [1.0, 4.0]).value for rate in rates]
    orders = -np.diff(np.log2(np.abs(np.array(found) - limit)), axis=0)
    np.testing.assert_allclose(orders, 1.0, atol=0.02)


def test_sensitivities_are_differences_of_moment_equations():
    theta = {"system.stiffness": 1.3, "system.damping": 0.2, "noise.rate": 0.8}
    sizes, shares = (1.0, -0.6), (0.5, 0.5)

    def exact(values):
        free = [[0.0, 1.0], [-values["system.stiffness"], -2 * values["system.damping"]]]
        return moment_hierarchy.impulses_exponent(free, STIFFNESS, values["noise.rate"], sizes, shares, 2)

    problem = Problem(ParametricOscillator(stiffness=1.3, damping=0.2), Poisson(rate=0.8, sizes=sizes))
    [found] = sensitivities(problem, 2.0).moments
    for key, value in theta.items():
        ahead, behind = (exact({**theta, key: value + d}) for d in (1e-4, -1e-4))
        assert found[key].value == pytest.approx((ahead - behind) / 2e-4, rel=1e-7), key


def test_sensitivity_to_what_the_impulses_multiply():
    """c in ẍ + 0.4 ẋ + x = −c ξ x, which changes exp(w A)."""

    spring = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.4*v - c*xi*x"), {"c": 0.8})
    law = 0.9, (1.0, -0.5), (0.5, 0.5), 2
    [found] = sensitivities(Problem(spring, Poisson(rate=0.9, sizes=(1.0, -0.5))), 2.0).moments
    ahead, behind = (
        moment_hierarchy.impulses_exponent(FREE, [[0.0, 0.0], [-c, 0.0]], *law) for c in (0.8 + 1e-4, 0.8 - 1e-4)
    )
    assert found["system.c"].value == pytest.approx((ahead - behind) / 2e-4, rel=1e-7)


def test_sizes_of_nothing_change_nothing():
    """Neither those that are 0 nor those that never come, where the simulation draws one of all."""
    plain, more = Poisson(rate=1.0, sizes=(0.5,)), Poisson(rate=2.0, sizes=(0.0, -3.0, 0.5), weights=(1.0, 0.0, 1.0))
    assert lyapunov_exponent(of(more)).value == pytest.approx(lyapunov_exponent(of(plain)).value, abs=1e-12)
    _, impulses, _ = coefficients(of(more).system, more).motion(0.1)
    assert len(impulses) == len(more.step(0.1).reached) == 3


def test_they_are_not_proven():
    with pytest.raises(TypeError, match="got Poisson"):
        prove(of(even()), 2.0)


@pytest.mark.slow
def test_a_simulation_waits_for_rare_impulses():
    """Between them the direction of x comes to rest; elements give λ, below Λ(2)/2 of the equations of the moments."""
    steady = ((0.0, 1.0), (0.0, -0.0056544346676048905))
    driven = ((-0.9471958820776134, -44.46489829714192), (-0.0004707644708683266, 0.26545596775608626))
    sizes, weights = (1.140477428600101, -0.30270434321447154), (0.23437873623394545, 0.712329916975077)
    noise = Poisson(rate=0.0028116068648218755, sizes=sizes, weights=weights)
    problem = Problem(PlaneSystem([CoefficientMatrix(0, steady), CoefficientMatrix(0, driven, identity)]), noise)
    found = simulate(problem, [], paths=64, seed=1, time=32 * transient(problem.system, noise))
    expected = lyapunov_exponent(problem).value
    assert expected < hierarchy_exponent(problem, 2.0)[0] / 2
    assert found.lyapunov_exponent == pytest.approx(expected, abs=4 * found.lyapunov_exponent_error)
    assert found.lyapunov_exponent_error < 0.1 * abs(expected)
