"""Λₙ of any order: closed forms, a Fourier-Hermite code extrapolated in ε, Λ itself, and how far its sums go."""

import math

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.errors import NoPerturbationTheory
from fpsolve.exponent import perturbation_series
from fpsolve.model import Bounded, CoefficientMatrix, Filter, Jump, MarkovChain, Poisson, SineWiener, Telegraph, White
from fpsolve.theory import second_order
from tests.conftest import keeping, sampled
from tests.oracles.fourier_hermite import moment_lyapunov as oracle

UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)


def oscillator(r=0.8, law="delta", epsilon=0.2, omega=1.0, c1=0.0):
    return VibroImpactOscillator(omega=omega, restitution=r, c1=c1, epsilon=epsilon, impact=law)


@pytest.mark.parametrize("sigma", [1.0, math.sqrt(2)])
def test_the_fourth_order_without_loss_is_a_closed_form(sigma):
    """Λ₄ = p(p + 2)/500 where the noise has the variance ½; it is in proportion to the square of the variance."""
    p = np.array([-3.0, -2.0, 0.0, 0.5, 1.0, 2.0, 6.0])
    found = perturbation_series(Problem(oscillator(r=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=sigma)), p, order=4)
    exact = p * (p + 2) / 500 * sigma**4
    np.testing.assert_allclose(found.coefficients[4], exact, rtol=1e-12, atol=1e-14)
    assert np.all(np.abs(found.coefficients[4] - exact) <= found.error_estimate[4] + 1e-16)


@pytest.mark.parametrize(("law", "value"), [("delta", 0.02237), ("restitution", 0.00963)])
def test_the_two_laws_of_impact_part_at_the_fourth_order(law, value):
    found = perturbation_series(Problem(oscillator(law=law), UNIT), 2.0, order=4)
    assert found.coefficients[4, 0] == pytest.approx(value, abs=5e-6)


def extrapolated(p, alpha, sigma, omega, c1, r, law):
    """Λ₂, Λ₄ and Λ₆ from Λ/ε² of the Fourier-Hermite code at Chebyshev points of ε², by a polynomial through them."""
    squares = 0.01 * (1 - np.cos(np.pi * (np.arange(9) + 0.5) / 9))
    losses = [squares * (1 - r), -np.log1p(-squares * (1 - r))][law == "restitution"]
    values = [
        oracle(
            alpha=alpha,
            sigma=sigma,
            omega=omega,
            epsilon=math.sqrt(square),
            c1=c1,
            log_R=-loss,
            p=p,
            harmonics=8,
            hermite=18,
        )
        / square
        for square, loss in zip(squares.tolist(), losses.tolist(), strict=True)
    ]
    return np.polynomial.Polynomial.fit(squares, values, 8, domain=(0.0, 0.02)).convert().coef[:3]


@pytest.mark.parametrize("law", ["delta", "restitution"])
@pytest.mark.parametrize(
    ("p", "alpha", "sigma", "omega", "c1", "r"),
    sampled(
        (2.0, 1.0, 1.0, 1.0, 0.0, 0.8),
        (1.0, 2.0, 1.5, 1.0, 0.1, 0.8),
        (-1.0, 1.0, 1.0, 2.0, -0.3, 0.6),
        (4.0, 1.5, 1.0, 0.7, 0.2, 0.9),
        (0.5, 0.8, 0.6, 1.3, 0.5, 0.5),
    ),
)
def test_orders_four_and_six_are_those_of_a_fourier_hermite_code(p, alpha, sigma, omega, c1, r, law):
    problem = Problem(oscillator(r, law, omega=omega, c1=c1), OrnsteinUhlenbeck(alpha=alpha, sigma=sigma))
    found = perturbation_series(problem, p, order=6).coefficients[[2, 4, 6], 0]
    other = extrapolated(p, alpha, sigma, omega, c1, r, law)
    # the points leave rounding of Λ/ε², some 1e-15/2e-4, times what a polynomial makes of it at 0
    assert np.all(np.abs(found - other) <= [1e-11, 1e-8, 1e-5]), found - other


NOISES = {
    "Ornstein-Uhlenbeck": UNIT,
    "chain": MarkovChain((-1.0, 0.5), ((0, 1.0), (0.5, 0))),
    "chain with a mean": MarkovChain((0.1, 1.6), ((0, 1.0), (0.5, 0))),
    "sine-Wiener": SineWiener(amplitude=1.0, sigma=1.2),
    "bounded": Bounded(mu=1.0, nu=1.0, sigma=0.7),
    "filter": Filter(omega=2.0, zeta=0.3, s=1.0, c0=1.0, c1=0.2),
    "exact": NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8),
    "white": White(s=0.7),
    "Itô": White(s=0.7, interpretation="ito"),
}


def system(epsilon, free, *, jumps):
    driven, damped = np.random.default_rng(0).uniform(-1, 1, (2, 2, 2)).tolist()
    rays = [Jump(0.4, -0.3 * epsilon**2), Jump(1.9, 0.5 * epsilon**2)] if jumps else []
    driven = keeping(0.4, 1.9, (0.5, -0.6)) if jumps else driven
    terms = [CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity), CoefficientMatrix(2, damped)]
    return PlaneSystem(terms, rays, epsilon)


@pytest.mark.parametrize("free", [((0.3, 1.5), (-0.8, -0.3)), ((-0.02, -1.5), (0.8, 0.02))], ids=["forward", "back"])
@pytest.mark.parametrize("name", sampled(*NOISES, keep=3))
def test_what_is_left_of_a_sum_is_of_the_next_order(name, free):
    """Any matrices, on ellipses, with two rays: what the orders up to ε⁷ leave is ε⁸."""
    noise, p, rests = NOISES[name], np.array([2.0, -1.0]), []
    for epsilon in (0.1, 0.05):
        problem = Problem(system(epsilon, free, jumps=not noise.is_white), noise)
        series = perturbation_series(problem, p, order=7)
        exact = moment_lyapunov(problem, p, rtol=1e-12).value
        rests.append(exact - series.partial_sums()[7])
    assert np.all(np.abs(np.log2(rests[0] / rests[1]) - 8) < 0.4)
    if name in ("Ornstein-Uhlenbeck", "white"):
        expected = second_order(problem).moment_exponent(p)
        np.testing.assert_allclose(series.partial_sums()[2], expected, rtol=1e-13)


def test_two_noises_are_one_tensor_product():
    free, first, second = ((0.3, 1.5), (-0.8, -0.3)), ((0.2, -0.7), (0.4, 1.0)), ((0.3, 0.1), (-0.6, 0.2))
    terms = [
        CoefficientMatrix(0, free),
        CoefficientMatrix(1, first, identity, noise="load"),
        CoefficientMatrix(1, second, identity, noise="sway"),
    ]
    problem = Problem(PlaneSystem(terms, [], 0.1), {"load": UNIT, "sway": Telegraph(a=1.0, k=1.0)})
    series = perturbation_series(problem, [2.0, -1.0], order=12)
    exact = moment_lyapunov(problem, series.p, rtol=1e-10)
    assert np.all(np.abs(series.value() - exact.value) <= series.value_error() + exact.error_estimate)


def errors(problem, p, order):
    series, exact = perturbation_series(problem, p, order=order), moment_lyapunov(problem, p, rtol=1e-12)
    return series, np.abs(series.partial_sums() - exact.value), exact.error_estimate


@pytest.mark.parametrize("law", ["delta", "restitution"])
def test_partial_sums_at_a_fifth_fall_until_rounding_is_reached(law):
    """As of an asymptotic series whose smallest term lies far below it: every order gains, by about the next term."""
    p = [2.0, 1.0, -1.0]
    series, error, known = errors(Problem(oscillator(law=law), UNIT), p, 16)
    for column, terms, least in zip(error.T, np.abs(series.terms()).T, known, strict=True):
        seen = [n for n in range(2, 15, 2) if terms[n + 2] > 100 * least]
        assert len(seen) >= 3
        for n in seen:
            assert 0.3 * terms[n + 2] < column[n] < 3 * terms[n + 2]


@pytest.mark.parametrize(
    ("noise", "epsilon", "p"),
    [
        (OrnsteinUhlenbeck(alpha=1.0, sigma=4.0), 0.2, 1.0),  # the smallest error is inside
        *sampled(
            (OrnsteinUhlenbeck(alpha=1.0, sigma=4.0), 0.2, 2.0),
            (OrnsteinUhlenbeck(alpha=1.0, sigma=2.0), 0.3, 3.0),
            (UNIT, 0.6, 2.0),
            keep=0,
        ),
    ],
)
def test_the_order_of_smallest_error_is_the_right_one(noise, epsilon, p):
    """Of neighbours the largest error counts, as a sum may meet Λ by chance where the terms change their sign."""
    series, error, known = errors(Problem(oscillator(0.7, "restitution", epsilon, c1=0.1), noise), p, 24)
    best, even = series.best_order()[0], error[2::2, 0]
    around = np.maximum(even, np.maximum(np.append(even[1:], 0.0), np.append(even[0], even[:-1])))
    assert around[best // 2 - 1] <= 2 * around.min() + known[0]
    assert 0.3 * error[best, 0] <= series.value_error()[0] <= 10 * error[best, 0]
    if noise.sigma == 4.0 and p == 1.0:
        assert 4 < best < 24


def test_pade_goes_further():
    problem = Problem(oscillator(0.8, "restitution", 0.6, c1=0.1), UNIT)
    series, error, _ = errors(problem, [2.0, 4.0], 24)
    assert np.all(np.abs(series.pade() - moment_lyapunov(problem, series.p).value) < 0.2 * error[-1])
    assert np.all(series.pade(0.0) == 0)


def test_second_order_serves_up_to_a_stated_size():
    series = perturbation_series(Problem(oscillator(), UNIT), [2.0, 1.0], order=10)
    reach = series.second_order_range()
    for column, epsilon in enumerate(reach.tolist()):
        problem = Problem(oscillator(epsilon=epsilon), UNIT)
        exact = moment_lyapunov(problem, series.p[column], rtol=1e-10).value[0]
        assert abs(exact / second_order(problem).moment_exponent(series.p[column]) - 1) == pytest.approx(0.01, rel=1e-2)
    assert f"up to epsilon = {reach[0]:.3g}" in str(series)
    assert f"at order {series.best_order()[0]}" in str(series)


def test_a_result_is_labelled_and_drawn():
    series = perturbation_series(Problem(oscillator(), UNIT), [2.0, 1.0], order=6)
    found = series.to_xarray()
    assert found.coefficient.sel(order=4, p=2.0).item() == series.coefficients[4, 0]
    assert {"coefficient", "coefficient_error"} == set(found.data_vars)
    assert len(series.plot().lines) == 2


@pytest.mark.parametrize(
    ("terms", "noise", "message"),
    [
        ([CoefficientMatrix(0, ((1.0, 0.0), (0.0, -1.0)))], UNIT, "that rotate without noise"),
        ([CoefficientMatrix(0, ((0, 1), (-1, 0)), identity)], UNIT, "a term of order 0 is driven by noise"),
        (
            [CoefficientMatrix(0, ((0, 1), (-1, 0))), CoefficientMatrix(1, ((0, 0), (1, 0)), identity)],
            NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.1),
            "algebraic tails",
        ),
        (
            [CoefficientMatrix(0, ((0, 1), (-1, 0))), CoefficientMatrix(1, ((0, 0), (1, 0)), identity)],
            Poisson(rate=1.0, sizes=(1.0,), weights=(1.0,)),
            "not for impulses",
        ),
    ],
)
def test_what_has_no_series_is_refused(terms, noise, message):
    with pytest.raises(NoPerturbationTheory, match=message):
        perturbation_series(Problem(PlaneSystem(terms, epsilon=0.5), noise), 2.0)


@pytest.mark.parametrize("order", [0, 41, 2.0, True])
def test_an_order_out_of_range_is_refused(order):
    with pytest.raises(ValueError, match="must be a whole number from 1 to 40"):
        perturbation_series(Problem(oscillator(), UNIT), 2.0, order=order)
