"""Linear motions by a compiled step: its order on given noise, jumps at rays, chains without an error; closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem, simulate
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, ParametricOscillator, White
from fpsolve.simulation.coefficients import coefficients
from fpsolve.simulation.kernels import advance
from fpsolve.simulation.motions import step_driven
from fpsolve.simulation.setup import largest_step, transient
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE, sampled
from tests.oracles import closed_forms, moment_hierarchy

A0, A1 = np.array([[0.3, 1.2], [-0.7, -0.4]]), np.array([[0.2, -0.5], [0.9, 0.1]])
J = ((0.0, -1.0), (1.0, 0.0))
WALL = Jump(math.pi / 2, math.log(0.8))


def plane(steady, driven, jumps=()):
    return PlaneSystem([CoefficientMatrix(0, np.array(steady).tolist()), CoefficientMatrix(1, driven, identity)], jumps)


def along(system, noise, h, x, means, rises):
    """ln‖x‖ and the direction of x after steps under given means and rises of ξ, shapes (steps, paths); crossings."""
    motion = coefficients(system, noise).motion(h)
    n = means.shape[1]
    state, logs, room = np.tile(np.array(x, dtype=float)[:, None], n), np.zeros(n), np.empty((3, n))
    crossed = 0
    for mean, rise in zip(means, rises, strict=True):
        crossed += step_driven(motion, h, *state, np.array(mean), np.array(rise), logs, *room)
    norm = np.hypot(*state)
    return logs + np.log(norm), state / norm, crossed


def test_the_step_has_order_four():
    """ξ = sin 2t: its means over steps are known, and the state by a Runge-Kutta method."""
    time = 3.0
    made = solve_ivp(lambda t, x: (A0 + math.sin(2 * t) * A1) @ x, (0, time), [1.0, 0.0], rtol=1e-11, atol=1e-13)
    x = made.y[:, -1]
    errors = []
    for steps in (12, 24, 48):
        t = np.linspace(0, time, steps + 1)
        mean, rise = -np.diff(np.cos(2 * t)) / (2 * time / steps), np.diff(np.sin(2 * t)) / 2
        # A₀ turns: its even coordinates are not the given ones, and ln‖x‖ is compared in them
        system = plane(A0, A1.tolist())
        even = even_coordinates(system)
        log, direction, _ = along(system, UNIT_NOISE, time / steps, even @ [1.0, 0.0], mean[:, None], rise[:, None])
        errors.append(np.abs(math.exp(log[0]) * direction[:, 0] - even @ x).max())
    assert errors[-1] < 1e-4
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.5)


def even_coordinates(system):
    """S of the coordinates in which the simulation moves paths, from what it makes of A₀ and A₁: S A = A′ S."""
    known = coefficients(system, UNIT_NOISE)
    rows = [
        np.kron(made, np.eye(2)) - np.kron(np.eye(2), given.T)
        for made, given in ((known.steady, A0), (known.driven, A1))
    ]
    s = np.linalg.svd(np.vstack(rows))[2][-1].reshape(2, 2)
    return s / s[0, 0]


def test_the_step_under_white_noise_has_strong_order_three_halves():
    """Steps of the same Brownian paths, 4 to 64 of them; weak order 2 follows from a mean that is exact to h²."""
    rng, paths, fine = np.random.default_rng(5), 400, 4096
    dw = rng.standard_normal((fine, paths)) / math.sqrt(fine)
    found = []
    for steps in (4, 8, 16, 32, 1024):
        h, part = 1 / steps, dw.reshape(steps, -1, paths)
        w = np.cumsum(part, axis=1)
        area = (w - 0.5 * part).sum(axis=1) / fine - 0.5 * h * w[:, -1]
        log, direction, _ = along(plane(A0, A1.tolist()), White(s=1.0), h, (1.0, 0.0), w[:, -1] / h, -6 * area / h**2)
        found.append(np.exp(log) * direction)
    errors = [math.sqrt(np.mean((each - found[-1]) ** 2)) for each in found[:-1]]
    assert errors[-1] < 2e-3
    assert np.log2(errors[0] / errors[-1]) / 3 == pytest.approx(1.5, abs=0.2)


def test_a_coarse_step_under_white_noise_keeps_the_mean_to_second_order():
    """E‖x‖² of one step, by quadrature over its two Gaussian numbers, against that of the moment equations."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(24)
    weights = np.outer(weights, weights).ravel() / (2 * math.pi)
    first, second = (each.ravel() for each in np.meshgrid(nodes, nodes, indexing="ij"))
    system = plane([[0.3, 1.2], [-1.2, 0.3]], A1.tolist())  # which is even
    lifted = [moment_hierarchy.rates_of_monomials(each, 2) for each in (np.array(system.terms[0].matrix), A1)]
    errors = []
    for h in (0.1, 0.05, 0.025):
        log, _, _ = along(
            system, White(s=1.0), h, (1.0, 0.0), first[None] / math.sqrt(h), second[None] * math.sqrt(3 / h)
        )
        moments = expm(h * (lifted[0] + 0.5 * lifted[1] @ lifted[1])) @ [0.0, 0.0, 1.0]
        errors.append(abs(weights @ np.exp(2 * log) - moments[0] - moments[2]))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 2.7)  # of one step: the scheme has one less


@pytest.mark.parametrize("noise", [White(s=1e-12), OrnsteinUhlenbeck(alpha=1.0, sigma=1e-12)])
def test_lines_are_counted_in_a_rotation(noise):
    """‖x‖ = Rⁿ after n half-turns, of which some steps have one and others none."""
    system = plane([[0.0, 2.0], [-2.0, 0.0]], A1.tolist(), (Jump(0.4, -0.3), Jump(1.3, 0.1)))
    if noise.is_white:
        system = plane([[0.0, 2.0], [-2.0, 0.0]], ((1.0, 0.0), (0.0, 1.0)), system.jumps)
    zero = np.zeros((1000, 1))
    log, _, crossed = along(system, noise, math.pi / 20.3, (1.0, 0.0), zero, zero)
    turns = math.ceil(1000 * 2 / 20.3)  # and a half: after the last whole one both lines are crossed
    assert crossed == 2 * turns
    assert log[0] == pytest.approx(-0.2 * turns, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "matrix",
    [((0.1, 2.0), (-1.0, 0.2)), ((0.5, 2.0), (1.0, -3.0)), ((0.3, 2.0), (0.0, 0.3)), ((0.0, 1.0), (-1.0, 0.0))],
)
def test_a_chain_that_does_not_jump_moves_by_the_exponential(matrix):
    """Two states of one matrix, so that jumps do not matter: steps of any length give exp(A t) x and its crossings."""
    system = PlaneSystem([CoefficientMatrix(0, matrix)], [Jump(0.7, -0.1)])
    chain = MarkovChain.telegraph(1.0, 0.5)
    known = coefficients(system, chain)
    x, rng = np.array([[0.3], [-0.9]]), np.random.default_rng(3)
    state, log, crossed = x.copy(), np.zeros(1), 0
    for h in (7.0, 0.01, 2.0):
        crossed += advance(known.motion(h), chain.step(h), h, *state, np.zeros(1), log, np.zeros(1), 1, 1, rng)
    part, fine = expm(known.steady[0] * 9.01 / 4000), [x[:, 0]]
    for _ in range(4000):
        fine.append(part @ fine[-1])
    side = np.array(fine) @ known.rays.across[0] >= 0
    assert crossed == np.count_nonzero(side[1:] != side[:-1])
    state *= np.sign(state[:, 0] @ fine[-1])  # half-turns are left out
    np.testing.assert_allclose(np.exp(log + 0.1 * crossed) * state[:, 0], fine[-1], rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_a_chain_has_its_law():
    """After a while the states have their probabilities, and of those left the next is drawn by the rates."""
    chain = MarkovChain([0.0, 1.0, 5.0], [[0, 1.0, 0.5], [2.0, 0, 1.0], [0.3, 0.1, 0]])
    motion = coefficients(plane(A0, A1.tolist()), chain).motion(1.0)
    n, rng = 20_000, np.random.default_rng(8)
    x, u, states, log, push = np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for time, probabilities in ((0.5, expm(0.5 * np.array(chain.rates))[0]), (30.0, chain.probabilities)):
        states[:] = 0
        advance(motion, chain.step(time), time, x, u, states, log, push, 1, 1, rng)
        counts = np.bincount(states.astype(int), minlength=3)
        assert np.all(np.abs(counts - n * probabilities) < 4.5 * np.sqrt(n * probabilities * (1 - probabilities)))


def parametric(b, R=1.0, k=1.0):
    return ParametricOscillator(stiffness=k, damping=b, restitution=R)


VELOCITY = plane([[0.0, 1.0], [-1.0, 0.1]], ((0.0, 0.0), (0.0, 1.0)), (WALL,))


@pytest.mark.parametrize(
    ("system", "noise", "exponent", "moments"),
    sampled(
        (parametric(0.05), MarkovChain.telegraph(0.5, 1.0), -0.0329794566817157, {2.0: -0.0332610990213474}),
        (parametric(0.1, 0.8), White(s=0.5), -0.13970934720001, {2.0: -0.212437199}),
        (VELOCITY, White(s=0.5), 0.0103221483130, {1.0: 0.0582175109649}),
        (VELOCITY, White(s=0.5, interpretation="ito"), -0.0523330808550, {}),
        (parametric(0.0, k=-1.0), White(s=1.0), closed_forms.white_stiffness(-1.0, 1.0), {}),
        (plane([[1.0, 0.0], [0.0, -1.0]], J), White(s=1.0), closed_forms.saddle_and_turning()[0], {}),
        keep=3,
    ),
)
def test_agrees_with_closed_forms(system, noise, exponent, moments):
    found = simulate(Problem(system, noise), list(moments), paths=8192, time=32 * transient(system, noise), seed=2)
    assert abs(found.lyapunov_exponent - exponent) < 4 * found.lyapunov_exponent_error
    assert found.lyapunov_exponent_error < 1e-3
    for estimate, value in zip(found.estimates, moments.values(), strict=True):
        assert abs(estimate.value - value) < 4 * estimate.standard_error
        assert estimate.standard_error < 1e-3


@pytest.mark.slow
def test_agrees_with_a_moment_hierarchy():
    """Of Ornstein-Uhlenbeck noise; for sine-Wiener noise see tests/model/test_sine_wiener.py."""
    system, noise = parametric(0.1), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)
    steady, driven = (np.array(term.matrix) for term in system.terms)
    value = moment_hierarchy.ornstein_uhlenbeck_exponent(steady, driven, noise.alpha, noise.standard_deviation, 2, 60)
    estimate = simulate(
        Problem(system, noise), [2.0], estimator="population", paths=8192, time=200.0, seed=3
    ).estimates[0]
    assert abs(estimate.value - value) < 4 * estimate.standard_error
    assert estimate.standard_error < 1e-3


@pytest.mark.parametrize("estimator", ["direct", "population"])
def test_an_oscillator_written_as_matrices_gives_the_same_numbers(estimator):
    """Term by term, with the wall in its place: the same random numbers give the same estimates."""
    written = PlaneSystem(FIG1.terms, FIG1.jumps, FIG1.epsilon)
    settings = {"estimator": estimator, "paths": 640, "time": 20.0, "seed": 4}
    noise = FIG1_NOISE.ou_reduction()
    one, other = (simulate(Problem(system, noise), [1.0], **settings) for system in (FIG1, written))
    assert (one.step, one.impacts, one.lyapunov_exponent) == (other.step, other.impacts, other.lyapunov_exponent)
    assert one.estimates == other.estimates
    assert one.impacts == pytest.approx(640 * one.time / math.pi, rel=0.02)


def test_time_is_measured_by_the_system():
    """ẍ + 2bωẋ + ω²(1 + ξ)x = 0 at ω = 10 takes the step of ω = 1 over 10, though x and ẋ differ by a factor of 10."""
    steps = [
        omega * largest_step(plane([[0, 1], [-(omega**2), -0.2 * omega]], ((0.0, 0.0), (-(omega**2), 0.0))), noise)[0]
        for omega, noise in ((1.0, OrnsteinUhlenbeck(1.0, 1.0)), (10.0, OrnsteinUhlenbeck(10.0, math.sqrt(10.0))))
    ]
    assert steps[0] == pytest.approx(steps[1], rel=1e-12)


@pytest.mark.slow
def test_a_phase_that_noise_hardly_disturbs():
    """It keeps its order; time is counted in half-turns of the mean motion, or the growth goes up and down."""
    steady, driven = np.array([[0.4, 0.95], [-1.2, -0.1]]), np.array([[0.07, 0.09], [0.02, 0.32]])
    states, rates = (-2.5, -1.4, -2.4), np.array([[-0.08, 0.075, 0.005], [2.9, -4.0, 1.1], [0.9, 0.2, -1.1]])
    noise = MarkovChain(states, rates.tolist())
    terms = [CoefficientMatrix(0, steady.tolist()), CoefficientMatrix(1, driven.tolist(), identity)]
    mean = steady + (noise.probabilities @ states) * driven
    known = coefficients(PlaneSystem(terms), noise)
    assert known.half_turn == pytest.approx(math.pi / abs(np.linalg.eigvals(mean)[0].imag), rel=1e-12)
    made = simulate(Problem(PlaneSystem(terms), noise), 2.0, estimator="population", paths=4096, time=100.0, seed=1)
    expected = moment_hierarchy.moment_lyapunov([steady + xi * driven for xi in states], rates, 2)
    [found] = made.estimates
    assert found.value == pytest.approx(expected, abs=4 * found.standard_error)
    assert found.standard_error < 5e-4


@pytest.mark.slow
def test_a_function_of_a_chain_is_simulated():
    """g(ξ) = ξ³ of states ±½ is ξ/4."""
    one, other = (
        simulate(Problem(PlaneSystem([CoefficientMatrix(0, A0.tolist()), term]), chain), [1.0], paths=64, time=60.0)
        for chain in [MarkovChain.telegraph(0.5, 1.0)]
        for term in (
            CoefficientMatrix(1, A1.tolist(), lambda xi: xi**3),
            CoefficientMatrix(1, (0.25 * A1).tolist(), identity),
        )
    )
    assert one.lyapunov_exponent == pytest.approx(other.lyapunov_exponent, rel=1e-12)
