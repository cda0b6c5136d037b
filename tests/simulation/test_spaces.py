"""Motions of three and four variables by a compiled step: its order, moments of even order, the plane, other codes."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, simulate
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Filter, LinearSystem, MarkovChain, Telegraph, White
from fpsolve.simulation.coefficients import Coefficients, coefficients
from fpsolve.simulation.kernels import advance
from fpsolve.simulation.rays import Rays
from fpsolve.simulation.setup import transient
from fpsolve.simulation.spaces import step_driven_space
from tests.conftest import UNIT_NOISE, sampled
from tests.exponent.test_modes import COUPLED, FREE, OU, problem, random_system
from tests.oracles import kronecker

A0 = np.array([[0.3, 1.2, 0.1], [-0.7, -0.4, 0.5], [0.2, -0.6, -0.3]])
A1 = np.array([[0.2, -0.5, 0.3], [0.9, 0.1, 0.0], [-0.4, 0.2, 0.3]])
NO_RAYS = Rays(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0))


def along(noise, h, x, means, rises, matrices=(A0, A1)):
    """The state after steps under given means and rises of ξ, shapes (steps, paths), in the coordinates given."""
    motion = Coefficients(noise, *matrices, 0.0, 0.0, 1.0, NO_RAYS).motion(h)
    n = means.shape[1]
    state, logs = np.tile(np.array(x, dtype=float)[:, None], n), np.zeros(n)
    for mean, rise in zip(means, rises, strict=True):
        assert step_driven_space(motion, h, state[0], state[1:], np.array(mean), np.array(rise), logs) == 0
    return np.exp(logs) * state


@pytest.mark.slow
@pytest.mark.parametrize("start", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0, -1.0)], ids=["n = 3", "n = 4"])
def test_the_step_has_order_four(start):
    """ξ = sin 2t: its means over steps are known, and the state by a Runge-Kutta method. The last steps are small."""
    time, n = 3.0, len(start)
    steady, driven = (A0, A1) if n == 3 else (FREE, 2 * COUPLED)
    made = solve_ivp(lambda t, x: (steady + math.sin(2 * t) * driven) @ x, (0, time), start, rtol=1e-12, atol=1e-14)
    errors = []
    for steps in (2, 12, 24, 48):  # the first is taken in parts
        t = np.linspace(0, time, steps + 1)
        mean, rise = -np.diff(np.cos(2 * t)) / (2 * time / steps), np.diff(np.sin(2 * t)) / 2
        found = along(UNIT_NOISE, time / steps, start, mean[:, None], rise[:, None], (steady, driven))
        errors.append(np.abs(found[:, 0] - made.y[:, -1]).max())
    assert errors[-1] < 1e-4
    assert np.all(np.log2(np.array(errors[1:-1]) / errors[2:]) > 3.5)


@pytest.mark.slow
def test_the_step_under_white_noise_has_strong_order_three_halves():
    """Steps of the same Brownian paths, 4 to 32 of them."""
    rng, paths, fine = np.random.default_rng(5), 200, 2048
    dw = rng.standard_normal((fine, paths)) / math.sqrt(fine)
    found = []
    for steps in (4, 8, 16, 32, 512):
        h, part = 1 / steps, dw.reshape(steps, -1, paths)
        w = np.cumsum(part, axis=1)
        area = (w - 0.5 * part).sum(axis=1) / fine - 0.5 * h * w[:, -1]
        found.append(along(White(s=1.0), h, (1.0, 0.0, 0.5), w[:, -1] / h, -6 * area / h**2))
    errors = [math.sqrt(np.mean((each - found[-1]) ** 2)) for each in found[:-1]]
    assert errors[-1] < 2e-3
    assert np.log2(errors[0] / errors[-1]) / 3 == pytest.approx(1.5, abs=0.2)


@pytest.mark.slow
def test_a_coarse_step_under_white_noise_keeps_the_mean_to_second_order():
    """E xᵢxⱼ of one step, by quadrature over its two Gaussian numbers, against that of the moment equations."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(24)
    weights = np.outer(weights, weights).ravel() / (2 * math.pi)
    first, second = (each.ravel() for each in np.meshgrid(nodes, nodes, indexing="ij"))
    rate = kronecker.power(A0, 2) + 0.5 * kronecker.power(A1, 2) @ kronecker.power(A1, 2)
    errors = []
    for h in (0.1, 0.05, 0.025):
        x = along(White(s=1.0), h, (1.0, 0.0, 0.0), first[None] / math.sqrt(h), second[None] * math.sqrt(3 / h))
        found = np.einsum("in,jn,n->ij", x, x, weights)[np.triu_indices(3)]
        errors.append(np.abs(found - expm(h * rate)[:, 0]).max())
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 2.7)  # of one step: the scheme has one less


@pytest.mark.slow
def test_a_chain_that_does_not_jump_moves_by_the_exponential():
    """Two states of one matrix, so that jumps do not matter: steps of any length give exp(A t) x."""
    system, chain = LinearSystem([CoefficientMatrix(0, FREE.tolist())]), MarkovChain.telegraph(1.0, 0.5)
    known, rng = coefficients(system, chain), np.random.default_rng(3)
    x = np.array([[0.3], [-0.9], [0.4], [0.1]])
    state, log = x.copy(), np.zeros(1)
    for h in (7.0, 0.01, 20.0):
        advance(known.motion(h), chain.step(h), h, state[0], state[1:], np.zeros(1), log, np.zeros(1), 1, 1, rng)
    np.testing.assert_allclose(np.exp(log) * state[:, 0], expm(27.01 * known.steady[0]) @ x[:, 0], rtol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_coordinates_of_the_modes(seed):
    """Free motion has blocks in them, α + ω((0, 1), (−1, 0)) for each mode, whatever the coordinates given were."""
    rng = np.random.default_rng(seed)
    scales = np.diag(10.0 ** rng.uniform(-2, 2, 4))
    steady = scales @ FREE @ np.linalg.inv(scales)
    given = problem(White(s=1.0), steady, scales @ COUPLED @ np.linalg.inv(scales))
    known = coefficients(given.system, given.noise)
    assert known.half_turn == pytest.approx(math.pi / math.sqrt(2.56 - 0.08**2), rel=1e-9)
    np.testing.assert_allclose(np.linalg.eigvals(known.steady.T + known.steady).max(), -0.1, rtol=1e-6)
    assert np.linalg.norm(known.driven, 2) < 1.0


def test_modes_that_are_nearly_parallel_keep_their_coordinates():
    steady = np.array([[-0.1, 1e-3, 0.0], [-1e-9, -0.1, 1.0], [0.0, 0.0, -0.1]])
    known = coefficients(problem(White(s=0.1), steady, np.eye(3)).system, White(s=0.1))
    assert np.isfinite(known.steady).all()
    np.testing.assert_allclose(np.diag(known.driven), 0.1)


def outcome(given, p, estimator="population", **settings):
    """λ and Λ(p) of a simulation, with their errors."""
    made = simulate(given, p, estimator=estimator, **{"paths": 8192, "seed": 2, **settings})
    return made, [(each.value, each.standard_error) for each in made.estimates]


@pytest.mark.parametrize(
    ("noise", "n", "seed", "paths"),
    sampled(
        (Telegraph(a=0.7, k=0.6), 3, 1, 4096),
        (OrnsteinUhlenbeck(1.5, 0.5), 4, 3, 4096),
        keep=0,
    ),
    ids=lambda value: getattr(value, "kind", None),
)
def test_even_moments(noise, n, seed, paths):
    steady, driven = random_system(seed, n)
    driven = 0.5 * driven
    expected = [
        {
            "white": lambda p: kronecker.white(steady, driven, p),
            "telegraph": lambda p: kronecker.chain(steady, driven, (-0.7, 0.7), ((0, 0.6), (0.6, 0)), p),
            "ornstein-uhlenbeck": lambda p: kronecker.ornstein_uhlenbeck(
                steady, driven, 1.5, noise.standard_deviation, p, 8
            ),
        }[noise.kind](p)
        for p in (2, 4)
    ]
    given = problem(noise, steady, driven)
    _, found = outcome(given, [2.0, 4.0], paths=paths, time=max(100.0, 2 * transient(given.system, noise)))
    for (value, error), exact in zip(found, expected, strict=True):
        assert abs(value - exact) < 4 * error
        assert error < 2e-3


@pytest.mark.slow
def test_two_white_noises():
    """They add the halves of their squares."""
    steady, driven = random_system(2, 4)
    driven = 0.5 * driven
    other = np.roll(driven, 1, axis=0)
    terms = [
        CoefficientMatrix(0, steady.tolist()),
        CoefficientMatrix(1, driven.tolist(), identity, "a"),
        CoefficientMatrix(1, other.tolist(), identity, "b"),
    ]
    rates = kronecker.power(steady, 2) + 0.5 * sum(
        kronecker.power(b, 2) @ kronecker.power(b, 2) for b in (driven, other)
    )
    given = Problem(LinearSystem(terms), {"a": White(s=1.0), "b": White(s=1.0)})
    _, [(value, error)] = outcome(given, [2.0], paths=4096, time=2 * transient(given.system, given.noise))
    assert abs(value - np.max(np.linalg.eigvals(rates).real)) < 4 * error
    assert error < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise",
    [
        Filter(1.5, 0.3, 0.8),
        {"a": OrnsteinUhlenbeck(alpha=1.0, sigma=0.6), "b": Telegraph(a=0.5, k=1.0)},
    ],
    ids=["filter", "two"],
)
def test_an_oscillator_with_what_it_drives(noise):
    """z of ż = −z + x grows as x does: λ and Λ(p) are those of the plane, which elements give."""
    names = tuple(noise) if isinstance(noise, dict) else ("",)
    shapes = [((0, 0), (-1, 0)), ((0, 0), (0, -1))][: len(names)]

    def terms(embed):
        driven = [
            CoefficientMatrix(1, embed(each, 0), identity, name) for name, each in zip(names, shapes, strict=True)
        ]
        return [CoefficientMatrix(0, embed(((0, 1), (-1, -0.3)), 1)), *driven]

    def wider(matrix, own):
        return [[*row, 0.0] for row in matrix] + [[own, 0.0, -own]]

    plane = ExponentSolver(Problem(PlaneSystem(terms(lambda matrix, own: matrix)), noise), rtol=1e-4)
    made, [(value, error)] = outcome(Problem(LinearSystem(terms(wider)), noise), [1.0], time=50.0, paths=4096)
    assert abs(value - plane.pair(1.0).value) < 4 * error
    assert error < 5e-3
    assert abs(made.lyapunov_exponent - plane.lyapunov_exponent().value) < 4 * made.lyapunov_exponent_error
    assert made.impacts == 0


@pytest.mark.parametrize(
    ("noise", "expected"),
    sampled((OU, -0.0484034), keep=0),
    ids=["ou"],
)
def test_the_lyapunov_exponent_of_two_modes(noise, expected):
    """As by elements and by harmonics of the sphere of another code."""
    made, _ = outcome(problem(noise), [], "direct", paths=2048)
    assert abs(made.lyapunov_exponent - expected) < 4 * made.lyapunov_exponent_error
    assert made.lyapunov_exponent_error < 3e-4


@pytest.mark.slow
def test_a_negative_moment_of_two_modes():
    _, [(value, error)] = outcome(problem(White(s=1.0)), [-1.0], paths=4096, time=100.0)
    assert abs(value - 0.0314237) < 4 * error
    assert error < 1e-3
