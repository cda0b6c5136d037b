"""The steps of paths: their orders on given noise by the number of variables, and impacts between them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fpsolve.model import VibroImpactOscillator, White
from fpsolve.simulation.bounces import motion_of, move
from fpsolve.simulation.coefficients import Load
from fpsolve.simulation.estimators import population_estimates
from fpsolve.simulation.flows import step_driven
from fpsolve.simulation.walls import Rays
from tests.conftest import UNIT_NOISE
from tests.oracles import kronecker

A0, A1 = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 3, 3))
NO_RAYS = Rays(*map(np.zeros, ((0, 2), (0, 2), 0, 0)))
SIZES = pytest.mark.parametrize("n", [2, 3])


def along(noise, h, n, means, rises):
    """The state after steps under given means and rises of ξ, shapes (steps, paths)."""
    motion = Load(noise, 0, A1[:n, :n], A1, []).motion(A0[:n, :n], NO_RAYS, h, 0.0)
    state, logs = np.zeros((n, means.shape[1])), np.zeros(means.shape[1])
    state[0] = 1.0
    for mean, rise in zip(means, rises, strict=True):
        step_driven(motion.matrices, NO_RAYS, h, state, mean, rise, logs, np.zeros(2), None)
    return np.exp(logs) * state


@SIZES
def test_the_step_on_a_given_noise_has_order_four(n):
    """ξ = sin 2t: its means over steps are known, and the state by a Runge-Kutta method; large steps are in parts."""
    time, errors = 3.0, []
    made = solve_ivp(
        lambda t, x: (A0 + math.sin(2 * t) * A1)[:n, :n] @ x, (0, time), np.eye(n)[0], rtol=1e-12, atol=1e-14
    )
    for steps in (12, 24, 48):
        t = np.linspace(0, time, steps + 1)
        mean, rise = -np.diff(np.cos(2 * t)) / (2 * time / steps), np.diff(np.sin(2 * t)) / 2
        found = along(UNIT_NOISE, time / steps, n, mean[:, None], rise[:, None])
        errors.append(np.abs(found[:, 0] - made.y[:, -1]).max())
    assert errors[-1] < 1e-4
    assert np.all(np.diff(np.log2(errors)) < -3.5)


@SIZES
def test_a_coarse_step_under_white_noise_keeps_the_mean_to_second_order(n):
    """E xᵢxⱼ of one step, by quadrature over its two Gaussian numbers, against that of the moment equations."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(24)
    weights = np.outer(weights, weights).ravel() / (2 * math.pi)
    first, second = nodes.repeat(24), np.tile(nodes, 24)
    square = kronecker.power(A1[:n, :n], 2)
    rate, errors = kronecker.power(A0[:n, :n], 2) + 0.5 * square @ square, []
    for h in (0.1, 0.05, 0.025):
        x = along(White(s=1.0), h, n, first[None] / math.sqrt(h), second[None] * math.sqrt(3 / h))
        found = np.einsum("in,jn,n->ij", x, x, weights)[np.triu_indices(n)]
        errors.append(np.abs(found - expm(h * rate)[:, 0]).max())
    assert np.all(np.diff(np.log2(errors)) < -2.7)  # of one step: the scheme has one less


def moved(R, h, u, gain, steps):
    """x, ẋ and the impacts at a wall of ẍ + x = g ẋ, from x = 0 on."""
    m, _ = motion_of(VibroImpactOscillator(1.0, R, gain, 1.0, impact="restitution").linear(), None)
    y, none = np.array([[0.0], [u]]), np.zeros(1)
    count = sum(move(m, h, y, none, none) for _ in range(steps))
    return *np.copysign(1.0, y[0]) * y[:, 0], count


@pytest.mark.parametrize(("R", "h", "steps"), [(1.0, 0.3, 10475), (0.99, 0.7, 4490), (0.9, 20.3 * math.pi, 1)])
def test_free_bounces_are_exact(R, h, steps):
    """x = Rⁿ |sin t|, n the number of impacts."""
    n, angle = divmod(steps * h, math.pi)
    x, u, impacts = moved(R, h, 1.0, 0.0, steps)
    assert impacts == n
    assert (x / R**n, u / R**n) == pytest.approx((math.sin(angle), math.cos(angle)), abs=1e-10)


@pytest.mark.parametrize("gain", [-1.5, 0.4, 1.2])
def test_a_gain_between_impacts_has_order_four(gain):
    """x = e^(gt/2) sin Ωt between impacts π/Ω apart, Ω² = 1 − g²/4."""
    turn, errors = math.sqrt(1 - gain**2 / 4), []
    n, rest = divmod(10.0, math.pi / turn)
    scale = 0.8**n * math.exp(gain * 5.0)
    for steps in (200, 400, 800):
        x, _, impacts = moved(0.8, 10.0 / steps, turn, gain, steps)
        assert impacts == n
        errors.append(abs(x / scale - math.sin(turn * rest)))
    assert errors[-1] < 1e-8
    assert np.all(np.diff(np.log2(errors)) < -3.8)


def test_estimate_and_error_of_populations_are_those_of_normal_growth(rng):
    """Of growth in each slice as N(1, 4), Λ = 1 + 4/2: 400 times."""
    plan, off = SimpleNamespace(p=np.array([2.0]), length=1.0, estimator="population"), []
    for _ in range(400):
        grown = [np.array([each, np.full(64, 1e6)]) for each in rng.normal(1, 2, (32, 64))]
        [[value, error, _]], _ = population_estimates(plan, [SimpleNamespace(found=each, slices=64) for each in grown])
        off.append((value - 3) / error)
    assert 0.8 < np.mean(np.square(off)) < 1.25
