"""Proven bounds: as close as they should be, and around values that are known otherwise."""

import itertools
import math
import time

import pytest

import fpsolve
from fpsolve import prove
from fpsolve.errors import NoSuchExponent
from fpsolve.exponent import Budget
from fpsolve.proofs import objection, prove_lyapunov_exponent, prove_stability_index, search
from fpsolve.proofs.statement import statement_of
from tests import random_proofs

FIG1 = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1, "D0": 1.0, "tau0": 0.5, "r0": 0.95}
MIDDLE = {"omega": 1.3, "restitution": 0.75, "c1": -0.1, "epsilon": 0.5, "D0": 0.4, "tau0": 0.6, "r0": 0.9}
STRONG = FIG1 | {"epsilon": 1.0, "r0": 0.7}


def problem(*, reduced=False, impact="delta", **numbers):
    """An oscillator and its noise, by the names of a case file."""
    noise = fpsolve.NonGaussianNoise(*(numbers[name] for name in ("D0", "tau0", "r0")))
    names = ("omega", "restitution", "c1", "epsilon")
    oscillator = fpsolve.VibroImpactOscillator(**{name: numbers[name] for name in names}, impact=impact)
    return fpsolve.Problem(oscillator, noise.ou_reduction() if reduced else noise)


@pytest.mark.parametrize(
    ("numbers", "p", "value", "half_width"),
    [
        (FIG1, 2.0, 0.013021271916, 8e-8),
        pytest.param(MIDDLE, -1.0, 0.05373157261, 9.2e-9, marks=pytest.mark.slow),
        pytest.param(STRONG, -3.0, 1.051181765, 1e-2, marks=pytest.mark.slow),
        (FIG1 | {"reduced": True}, 2.0, 0.014163143653, 1e-9),
        pytest.param(
            FIG1 | {"epsilon": 1.0, "D0": 0.3, "reduced": True}, 1.0, 0.1243172991, 1e-5, marks=pytest.mark.slow
        ),
    ],
)
def test_bounds_are_close_and_hold_what_a_spectral_code_of_its_own_finds(numbers, p, value, half_width):
    """The values come from Fourier series with Hermite functions, or polynomials, apart from this program."""
    found = prove(problem(**numbers), p, width=2 * half_width)
    assert found.is_met
    assert found.width <= 2 * half_width
    assert found.lower - 1e-11 <= value <= found.upper + 1e-11
    assert not objection(found.certificate)


@pytest.mark.parametrize(
    ("numbers", "value"),
    [
        pytest.param(FIG1, 0.0142930811487, marks=pytest.mark.slow),
        (FIG1 | {"reduced": True}, 0.0154347905379),
        pytest.param(FIG1 | {"epsilon": 1.0}, 2.198165797704, marks=pytest.mark.slow),
    ],
)
def test_without_loss_the_second_moment_is_that_of_the_moment_hierarchy(numbers, value):
    found = prove(problem(**numbers | {"restitution": 1.0}), 2.0)
    assert found.is_met
    assert found.lower < value < found.upper


@pytest.mark.parametrize("epsilon", [0.2])
def test_the_second_negative_moment_is_known_without_loss_for_gaussian_noise(epsilon):
    """Λ(−2) = −ε²c₁ + ε²σ²/(2α²), exactly."""
    given = problem(**FIG1 | {"restitution": 1.0, "epsilon": epsilon, "D0": 0.2, "reduced": True})
    found = prove(given, -2.0)
    expected = epsilon**2 * (given.noise.sigma**2 / (2 * given.noise.alpha**2) - 0.1)
    assert found.is_met
    assert found.lower <= expected <= found.upper


@pytest.mark.slow
def test_the_lyapunov_exponent_agrees_with_the_slope_of_the_moments():
    """Λ is convex and Λ(0) = 0, so that −Λ(−h)/h ≤ λ ≤ Λ(h)/h; both laws differ by more than the bounds."""
    given = problem(**MIDDLE, impact="restitution")
    found = prove_lyapunov_exponent(given)
    above, below = (prove(given, p, width=1e-8).upper / p for p in (1e-3, -1e-3))
    assert found.is_met
    assert below < found.lower < found.upper < above
    assert above - below < 1e-3
    other = prove_lyapunov_exponent(problem(**MIDDLE))
    assert other.lower > found.upper


@pytest.mark.slow
def test_noise_whose_ends_are_reached():
    """For r₀ < 0; both kinds of trial functions and the finite elements agree."""
    given = problem(**FIG1 | {"epsilon": 0.6, "r0": -1.0})
    found, estimate = prove(given, 1.5), fpsolve.moment_lyapunov(given, [1.5])
    assert found.is_met
    assert found.lower - estimate.error_estimate[0] <= estimate.value[0] <= found.upper + estimate.error_estimate[0]


@pytest.mark.slow
def test_the_stability_index_lies_between_two_signs():
    given = problem(**FIG1)
    found, estimate = prove_stability_index(given), fpsolve.stability_index(given)
    assert found.lower < estimate.value < found.upper
    assert found.upper - found.lower < 2e-6
    assert [each.sign for _, each in found.moments] in ([1, -1], [-1, 1])


def test_the_limit_of_gaussian_noise():
    """r₀ = 1 is the Ornstein-Uhlenbeck process, whichever treatment names it."""
    numbers = FIG1 | {"r0": 1.0, "D0": 0.2}
    exact, reduced = (prove(problem(**numbers, reduced=each), 1.0) for each in (False, True))
    assert exact.lower == pytest.approx(reduced.lower, abs=2 * exact.width)


def test_nothing_moves_at_p_zero():
    found = prove(problem(**FIG1), 0.0)
    assert (found.lower, found.upper, found.width) == (0.0, 0.0, 0.0)
    assert not objection(found.certificate)


def test_a_bound_takes_no_longer_than_stated(monkeypatch):
    """By a clock that each look sets forward by a second: a trial is foreseen to take as long as the last one."""
    seconds, told, motion = itertools.count(), [], problem(**FIG1 | {"reduced": True})
    monkeypatch.setattr(search.time, "process_time", lambda: next(seconds))
    timer = search.Timer(8.0)
    found = search.enclose(statement_of(motion), 1.0, 1e-30, 0.014, timer, lambda: told.append(next(seconds)))
    assert found.is_proven
    assert len(told) > 1
    assert 8 <= next(seconds) <= 11


@pytest.mark.slow
@pytest.mark.parametrize("p", [1e6, "delta"])
def test_what_cannot_be_proven_ends_with_its_time(p):
    """An index has twice the time, for both of its bounds; before, each of eight had a minute and a half."""
    hard, started = problem(**FIG1 | {"epsilon": 1.0, "D0": 1.0, "reduced": True}), time.process_time()
    budget = Budget(seconds=0.4)
    found = prove_stability_index(hard, budget=budget) if p == "delta" else prove(hard, p, budget=budget)
    assert not found.is_proven
    assert time.process_time() - started < (3.0 if p == "delta" else 1.5)


def test_algebraic_tails_are_refused():
    with pytest.raises(NoSuchExponent, match="algebraic tails"):
        prove(problem(**FIG1 | {"r0": 1.1}), -0.5)


@pytest.mark.parametrize(
    ("p", "width"), [(math.nan, None), (math.inf, None), (1.0, 0.0), (1.0, -1e-9), (1.0, math.nan)]
)
def test_numbers_that_are_none_are_refused(p, width):
    with pytest.raises(ValueError, match="must be"):
        prove(problem(**FIG1), p, width=width)


@pytest.mark.parametrize("seed", [103])
def test_random_problems(seed):
    """A hundred others: `python -m tests.random_proofs`."""
    found = random_proofs.outcome(seed)
    assert found.found.is_proven
    assert found.width < 1e-6
    assert found.off <= 1


@pytest.mark.slow
def test_a_width_beyond_reach_is_told_and_a_shift_next_to_an_eigenvalue_ends_the_search():
    """p = 1e-300: the matrix shifted by Λ(p) is singular but for what underflows."""
    found = prove(problem(**FIG1 | {"epsilon": 0.05, "D0": 0.1}, reduced=True), 1e-300, width=1e-30)
    assert found.lower < 0 < found.upper
    assert found.is_proven
    assert not found.is_met
    assert found.width < 1e-12
