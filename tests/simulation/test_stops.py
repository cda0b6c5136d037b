"""Paths at a wall of one of several variables: closed forms, other codes, systems that are known otherwise."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, simulate
from fpsolve.errors import FpsolveError
from fpsolve.exponent import impact_rate
from fpsolve.model import Telegraph, White
from fpsolve.simulation.stops import SwitchedStop, _flown

COVERED = 4.0
"""Multiple of the standard error within which a number must be."""
PAIR = np.array([[0, 1, 0, 0], [-1, -0.1, -0.5, 0.2], [0, 0, 0, 1], [-0.5, 0, -3, -0.1]])
TELEGRAPH = Telegraph(a=0.5, k=0.7)


def flown(matrix, state, t, restitution, steps=1):
    """y(t) of ẏ = A y, with the impacts and the time at rest."""
    matrix, state, n = np.array(matrix, dtype=float), np.array(state, dtype=float), len(state)
    m = SwitchedStop(matrix[None], np.linalg.norm(matrix, 2, (0, 1))[None], restitution, 1e-3 * (np.arange(n) > 1))
    series = np.empty((25, n + 1))
    return state, sum(_flown(m, matrix, t / steps, m.sizes[0], state, series) for _ in range(steps))


@pytest.mark.slow
def test_a_ball_bounces_until_it_rests():
    """q̈ = −1 from q = 1: impacts at the speeds √2 Rᵏ, the last after √2 (1 + R)/(1 − R)."""
    state, found = flown([[0, 1, 0], [0, 0, 1], [0, 0, 0]], [1, 0, -1], 5.0, 0.5)
    assert_allclose(state, [0, 0, -1])
    assert found.imag == pytest.approx(5 - 3 * math.sqrt(2), abs=1e-5)
    assert found.real == 11  # √2/2¹⁰ is above 0.001


@pytest.mark.slow
def test_a_mass_leaves_the_wall_with_its_force():
    """q̈ = −cos t, at rest until ½π, and then q = t − ½π + cos t."""
    turn = [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, -1, 0]]
    state, found = flown(turn, [0, 0, -1, 0], 3.0, 0.5, steps=7)
    rest = math.pi / 2
    assert found.imag == pytest.approx(rest, abs=1e-13)
    assert_allclose(state, [3 - rest + math.cos(3), 1 - math.sin(3), -math.cos(3), math.sin(3)], atol=1e-12)


@pytest.mark.parametrize("restitution", [1.0, 0.4])
def test_impacts_are_those_of_another_code(restitution):
    def at_wall(t, y):
        return y[0]

    at_wall.terminal, at_wall.direction = True, -1
    t, y, count = 0.0, np.array([0.5, -0.3, 1.0, 0.4]), 0
    while t < 12:
        part = solve_ivp(lambda _, y: PAIR @ y, (t, 12), y, "DOP853", events=at_wall, rtol=1e-13, atol=1e-15)
        t, y = part.t[-1], part.y[:, -1]
        if t < 12:
            count, y = count + 1, y * [0, -restitution, 1, 1]
    for steps in (1, 41):
        state, found = flown(PAIR, [0.5, -0.3, 1.0, 0.4], 12.0, restitution, steps)
        assert_allclose(state, y, atol=1e-10)
        assert found == count


def problem(noise, restitution, coupling=0.0):
    """A mass at a wall that drives another one, which is damped more."""
    rates = "v", "-q - 0.1*v - xi*q - k*y", "w", "-3*y - 1.5*w - xi*y + 0.4*q - k*q"
    wall = [{"at": "q = 0", "restitution": restitution}]
    return Problem(PlaneSystem.of_equations(("q", "v", "y", "w"), rates, {"k": coupling}, walls=wall), noise)


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "restitution"), [(OrnsteinUhlenbeck(1.0, 0.5), 0.6), (White(s=0.4), 1.0)])
def test_a_mass_that_nothing_drives_has_the_exponents_of_an_oscillator(noise, restitution):
    """λ, Λ(1) and the impacts N = ∂λ/∂ln R of the oscillator with a wall by elements; for R = 1 λ, without one."""
    walls = [{"at": "q = 0", "restitution": restitution}] if restitution < 1 else ()
    alone = PlaneSystem.of_equations(("q", "v"), ("v", "-q - 0.1*v - xi*q"), walls=walls)
    exact = ExponentSolver(Problem(alone, noise))
    paths, time, p = (1024, 200.0, [1.0]) if restitution < 1 else (512, 100.0, [])
    found = simulate(problem(noise, restitution), p, paths=paths, time=time, seed=4, estimator="direct")
    pairs = [(exact.lyapunov_exponent().value, found.lyapunov_exponent, found.lyapunov_exponent_error)]
    if restitution < 1:
        (moment,) = found.estimates
        pairs.append((exact.pair(1.0).value, moment.value, moment.standard_error))
        pairs.append((impact_rate(exact).value, *found.wall["fast_impact_rate"]))
    for known, value, error in pairs:
        assert abs(value - known) < COVERED * error < 0.01


def test_periodic_terms_at_a_wall_are_refused():
    rates = "v", "-q - xi*q - 0.1*cos(t)*y", "w", "-y"
    wall = [{"at": "q = 0", "restitution": 0.5}]
    system = PlaneSystem.of_equations(("q", "v", "y", "w"), rates, walls=wall)
    with pytest.raises(FpsolveError, match="for one noise, without periodic terms"):
        simulate(Problem(system, TELEGRAPH), 1.0)
