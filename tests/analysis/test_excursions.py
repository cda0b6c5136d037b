"""Excursions: closed forms where the phase decouples, T by another method, and simulated paths."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator, lyapunov_exponent
from fpsolve.analysis import excursion
from fpsolve.analysis.excursions import Crossing
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget
from fpsolve.messages import Code
from fpsolve.model import Bounded, CoefficientMatrix, LinearSystem, MarkovChain, Poisson, Telegraph, White
from fpsolve.model.plane import matrix_at
from tests.excursion_paths import angle_paths, chain_paths
from tests.oracles.two_state_function import root_and_function

ONE, TURN = ((1.0, 0.0), (0.0, 1.0)), ((0.0, 1.0), (-1.0, 0.0))
LEVELS = np.array([2.0, 4.0, 8.0, 16.0, 32.0])
A, K = 0.8, 1.0
THREE = [
    CoefficientMatrix(0, ((-1.0, 1.0, 0.0), (-1.0, -1.2, 0.5), (0.0, -0.5, -1.5))),
    CoefficientMatrix(1, ((0.3, 0.8, 0.3), (-1.3, 0.9, 0.4), (-0.5, 0.6, 0.4)), identity),
]


def decoupled(noise, rate):
    """ẋ = (J + rate + ξ) x: d ln ‖x‖/dt = rate + ξ whatever the phase."""
    steady = ((rate, 1.0), (-1.0, rate))
    return Problem(PlaneSystem([CoefficientMatrix(0, steady), CoefficientMatrix(1, ONE, identity)]), noise)


def mathieu(noise, zeta=0.08):
    """ẍ + 2ζẋ + (1 + ξ)x = 0."""
    return Problem(PlaneSystem.of_equations(("x", "v"), ("v", "-x - 2*zeta*v - xi*x"), {"zeta": zeta}), noise)


@pytest.fixture(scope="module")
def telegraph():
    return mathieu(Telegraph(a=A, k=K))


def telegraph_matrices(zeta=0.08):
    return [np.array([[0.0, 1.0], [-(1 + s), -2 * zeta]]) for s in (-A, A)]


def test_white_noise_that_moves_the_length_alone_is_exact():
    """ln ‖x‖ = −γt + sW: P(sup ‖x‖ ≥ A) = A^(−2γ/s²), and T = 1."""
    found = excursion(decoupled(White(s=0.3), -0.2))
    assert found.stability_index.value == pytest.approx(2 * 0.2 / 0.3**2, rel=1e-8)
    low, high = found.bounds(LEVELS)
    exact = LEVELS ** -(0.4 / 0.09)
    assert np.all(low <= exact)
    assert np.all(exact <= high)
    assert high == pytest.approx(low, rel=1e-6)
    assert found.upcrossings is None  # there are infinitely many


def test_a_chain_that_moves_the_length_alone_is_exact():
    """‖x‖ grows in one state only, so that the bounds meet: P = T₀/T₊ A^−δ, δ = 2ka/(a² − s²), ξ = ±s."""
    a, s, k = -0.3, 0.5, 0.7
    delta = 2 * k * a / (a**2 - s**2)
    ratio = (k - delta * (a + s)) / k  # T₋/T₊
    for xi, start in (("stationary", (1 + ratio) / 2), (s, 1.0), (-s, ratio)):
        found = excursion(decoupled(Telegraph(a=s, k=k), a), xi=xi, phi=0.7)
        assert found.stability_index.value == pytest.approx(delta, rel=1e-8)
        low, high = found.bounds(LEVELS)
        exact = start * LEVELS**-delta
        assert np.all(low <= exact)
        assert np.all(exact <= high)
        assert high == pytest.approx(low, rel=1e-6)


def test_upcrossings_of_gaussian_noise_that_moves_the_length_alone():
    """T = e^(pξ/α), Λ = pa + p²S/2: all means are those of normal laws."""
    a, alpha, sigma = -0.2, 1.3, 0.8
    found = excursion(decoupled(OrnsteinUhlenbeck(alpha=alpha, sigma=sigma), a))
    square, spectral = sigma**2 / (2 * alpha), (sigma / alpha) ** 2
    p = -2 * a / spectral
    center, width = a + p * square / alpha, math.sqrt(square)
    upwards = center * norm.cdf(center / width) + width * norm.pdf(center / width)
    size = math.exp(0.5 * p**2 * square / alpha**2)
    exact = size * size * upwards / (-a * size**4)
    assert abs(found.upcrossings.value - exact) <= 2 * found.upcrossings.error_estimate + 1e-6 * exact
    assert found.expected_upcrossings(3.0) == pytest.approx(exact * 3.0**-p, rel=1e-5)
    assert [each.code for each in found.notes] == [Code.EXCURSION_UNBOUNDED]
    assert np.array_equal(found.bounds(LEVELS), [np.zeros(5), np.ones(5)])


def rounded(bounds):
    return [round(float(each), places) for each, places in zip(bounds, (3, 3, 3, 3, 4), strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_bounds_of_the_telegraph_case_by_another_method(telegraph, smooth, monkeypatch):
    """T in the coordinates (x, ẋ), though the solve turns them, with all phases, or those of growth."""
    if not smooth:
        monkeypatch.setattr(Crossing, "of", lambda problem: Crossing(1.0, False))
    found = excursion(telegraph)
    p, phi, function = root_and_function(telegraph_matrices(), K, 1.2, 1.4)
    assert p == pytest.approx(1.302367339, abs=1e-9)
    assert found.lyapunov_exponent.value == pytest.approx(-0.02962137244, abs=1e-11)
    assert abs(found.stability_index.value - p) <= max(found.stability_index.error_estimate, 1e-9)
    start = 0.5 * np.sum(function[phi.size // 2])
    e = np.stack([np.cos(phi), -np.sin(phi)])
    growth = np.stack([np.einsum("in,ij,jn->n", e, a, e) for a in telegraph_matrices()], axis=1)
    values = function[growth >= 0] if smooth else function
    for estimate, exact in ((found.lower, start / values.max()), (found.upper, start / values.min())):
        assert abs(estimate.value - exact) <= estimate.error_estimate + 1e-5  # of the points of the other method
    assert found.lower.value == pytest.approx(0.712, abs=5e-4)
    assert found.upper.value == pytest.approx(1.075 if smooth else 1.389, abs=5e-4)
    low, high = found.bounds(LEVELS)
    assert rounded(low) == [0.289, 0.117, 0.047, 0.019, 0.0078]
    if not smooth:
        assert rounded(high) == [0.563, 0.228, 0.093, 0.038, 0.0152]
        [low], [high] = excursion(telegraph, phi="uniform").bounds([2.0])
        assert (round(low, 3), round(high, 3)) == (0.302, 0.588)


def test_bounds_with_a_wall_by_another_method():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-0.5, epsilon=0.5)
    problem = Problem(oscillator, Telegraph(a=0.9, k=0.6))
    found = excursion(problem, phi=0.3, xi=0.9)
    matrices = [matrix_at(oscillator, np.array(each)) for each in (-0.9, 0.9)]
    near = found.stability_index.value
    p, phi, function = root_and_function(matrices, 0.6, 0.8 * near, 1.2 * near, oscillator.log_impact_factor)
    assert near == pytest.approx(p, rel=1e-7)
    start = np.interp(0.3, phi, function[:, 1])
    e = np.stack([np.cos(phi), -np.sin(phi)])
    growth = np.stack([np.einsum("in,ij,jn->n", e, a, e) for a in matrices], axis=1)
    values = function[growth >= 0]
    for estimate, exact in ((found.lower, start / values.max()), (found.upper, start / values.min())):
        assert abs(estimate.value - exact) <= estimate.error_estimate + 3e-5 * exact


def test_impulses_overshoot():
    """With T = 1 the bounds are (gA)^−δ and A^−δ, g the largest factor of an impulse."""
    found = excursion(decoupled(Poisson(rate=1.0, sizes=(-0.5, 0.4)), -0.1))
    assert found.upper.value == pytest.approx(1.0, rel=1e-9)
    assert found.lower.value == pytest.approx(math.exp(-0.4 * found.stability_index.value), rel=1e-8)
    assert found.upcrossings is None


def test_a_finer_solve_is_within_the_errors():
    """The paper's oscillator, whose noise ends: what rtol = 1e-6 says encloses what 1e-11 says."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-1.0, epsilon=0.3)
    noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.9)
    rough, fine = (excursion(Problem(oscillator, noise), rtol=rtol) for rtol in (1e-5, 1e-10))
    for name in ("lower", "upper", "upcrossings"):
        one, other = getattr(rough, name), getattr(fine, name)
        assert abs(one.value - other.value) <= one.error_estimate + other.error_estimate
    widest, narrow = rough.bounds(LEVELS), fine.bounds(LEVELS)
    assert np.all(widest[0] <= narrow[0] * (1 + 1e-9))
    assert np.all(narrow[1] <= widest[1] * (1 + 1e-9))


def test_two_noises_at_once():
    """Two telegraph noises that move the length alone: ‖x‖ grows only where both or the larger one push."""
    terms = [
        CoefficientMatrix(0, ((-0.3, 1.0), (-1.0, -0.3))),
        CoefficientMatrix(1, ONE, identity, "first"),
        CoefficientMatrix(1, ONE, identity, "second"),
    ]
    both = {"first": Telegraph(a=0.4, k=0.7), "second": Telegraph(a=0.3, k=0.5)}
    found = excursion(Problem(PlaneSystem(terms), both))
    states = np.array([[s, t] for s in (-0.4, 0.4) for t in (-0.3, 0.3)])
    flip = np.array([[-1.0, 1.0], [1.0, -1.0]])
    rates = np.kron(0.7 * flip, np.eye(2)) + np.kron(np.eye(2), 0.5 * flip)
    growth = states.sum(axis=1) - 0.3
    p = found.stability_index.value
    values, vectors = np.linalg.eig(rates + p * np.diag(growth))
    assert max(values.real) == pytest.approx(0.0, abs=1e-8)
    function = np.abs(vectors[:, np.argmax(values.real)].real)
    up = function[growth >= 0]
    assert found.lower.value == pytest.approx(function.mean() / up.max(), rel=1e-6)
    assert found.upper.value == pytest.approx(function.mean() / up.min(), rel=1e-6)


def test_growth_is_certain():
    found = excursion(mathieu(Telegraph(a=A, k=K), zeta=0.01))
    assert found.is_certain
    assert np.array_equal(found.bounds(LEVELS), [np.ones(5), np.ones(5)])
    assert "= 1" in repr(found)


def test_a_border_of_stability_is_left_open():
    noise = Telegraph(a=A, k=K)
    border = brentq(lambda zeta: lyapunov_exponent(mathieu(noise, zeta)).value, 0.04, 0.06, xtol=1e-15)
    found = excursion(mathieu(noise, border))
    assert [each.code for each in found.notes] == [Code.EXCURSION_OPEN]
    assert not found.is_certain


@pytest.mark.parametrize(
    ("problem", "code"),
    [
        (mathieu(White(s=0.02)), Code.EXCURSION_BEYOND),
        (
            Problem(
                PlaneSystem([CoefficientMatrix(0, ((-0.5, 0.0), (0.0, -1.0))), CoefficientMatrix(1, ONE, identity)]),
                Telegraph(a=0.8, k=1.0),
            ),
            Code.EXCURSION_RAY,
        ),
        pytest.param(
            Problem(LinearSystem(THREE), White(s=0.9)), Code.EXCURSION_PLANE, marks=pytest.mark.slow, id="three"
        ),
    ],
)
def test_what_is_not_known_is_told(problem, code):
    found = excursion(problem, rtol=1e-3 if problem.dimension > 2 else 1e-8)
    assert code in [each.code for each in found.notes]
    low, high = found.bounds(LEVELS)
    assert np.all(low == 0)
    assert np.all(high == 1)
    assert np.isnan(found.expected_upcrossings(2.0))


@pytest.mark.parametrize(
    ("noise", "start", "words"),
    [
        (Telegraph(a=A, k=K), {"xi": 0.7}, "one of the states, -0.8, 0.8"),
        (White(s=0.5), {"xi": 0.0}, "white noise has no value"),
        (Bounded(mu=0.5, nu=1.0, sigma=0.3), {"xi": 0.1}, "does not tell how it goes on"),
        (Bounded(mu=0.5, nu=0.0, sigma=0.3), {"xi": 0.6}, "between -0.5 and 0.5"),
        (Telegraph(a=A, k=K), {"phi": math.nan}, "phi"),
        (Telegraph(a=A, k=K), {"phi": "first"}, "phi"),
    ],
)
def test_a_start_that_there_is_not(noise, start, words):
    with pytest.raises(ValueError, match=words):
        excursion(mathieu(noise), **start)


def test_levels_are_above_the_start(telegraph):
    found = excursion(telegraph)
    for level in (1.0, [2.0, 0.5], math.nan):
        with pytest.raises(ValueError, match="level"):
            found.bounds(level)
    assert found.to_xarray([2.0, 3.0]).least_probable.dims == ("level",)


def test_a_budget_that_does_not_suffice():
    with pytest.raises(NotConverged, match="budget"):
        excursion(mathieu(Bounded(mu=1.0, nu=0.0, sigma=1.0)), budget=Budget(unknowns=100))


def reached(tops, levels):
    """P(sup ‖x‖ ≥ A) of paths, and its standard error."""
    share = np.mean(tops[:, None] >= np.log(levels), axis=0)
    return share, np.sqrt(share * (1 - share) / tops.size)


@pytest.mark.slow
def test_simulated_paths_of_the_telegraph_case(telegraph):
    """P within the bounds, and the number of upcrossings near C A^−δ."""
    found = excursion(telegraph)
    delta = found.stability_index.value
    law = [[-K, K], [K, -K]], [0.5, 0.5]
    tops, mean, error = chain_paths(telegraph_matrices(), *law, delta, LEVELS, paths=10_000)
    low, high = found.bounds(LEVELS)
    share, doubt = reached(tops, LEVELS)
    assert np.all(low - 4 * doubt <= share)
    assert np.all(share <= high + 4 * doubt)
    assert found.upcrossings.value == pytest.approx(4.10, abs=0.005)
    asymptotic = found.expected_upcrossings(LEVELS)
    assert np.all(np.abs(mean - asymptotic)[1:] <= 4 * error[1:])


def random_oscillator(seed):
    """An oscillator with a wall under a chain or bounded noise that decays, and δ_p from 0.7 to 4."""
    rng = np.random.default_rng([31, seed])
    while True:
        oscillator = VibroImpactOscillator(
            omega=float(rng.uniform(0.7, 2.0)),
            restitution=float(rng.uniform(0.5, 0.95)),
            c1=float(rng.uniform(-1.5, 1.0)),
            epsilon=float(rng.uniform(0.3, 0.7)),
        )
        if seed % 2:
            n = int(rng.integers(2, 5))
            rates = rng.uniform(0.2, 1.5, (n, n))
            np.fill_diagonal(rates, 0.0)
            np.fill_diagonal(rates, -rates.sum(axis=1))
            noise = MarkovChain(states=tuple(np.sort(rng.uniform(-2, 2, n)).tolist()), rates=rates.tolist())
        else:
            mu, nu, sigma = rng.uniform([0.8, 0.0, 0.5], [2.0, 1.0, 1.5]).tolist()
            noise = Bounded(mu=mu, nu=nu * (seed % 4 == 0), sigma=sigma)
        problem = Problem(oscillator, noise)
        found = excursion(problem)
        index = found.stability_index
        if index and 0.7 < index.value < 4 and found.lyapunov_exponent.value < -0.03:
            return problem, found


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_simulated_paths_of_random_oscillators_with_walls(seed):
    """P within the bounds for all A that 100 paths should reach."""
    problem, found = random_oscillator(seed)
    system, noise, delta = problem.system, problem.noise, found.stability_index.value
    factor, paths = system.impact_factor(), 2000
    still, other = (matrix_at(system, np.array(each)) for each in (0.0, 1.0))
    if noise.has_states:
        matrices = [matrix_at(system, np.array(each)) for each in noise.states]
        tops, _, _ = chain_paths(
            matrices, noise.rates, noise.probabilities, delta, LEVELS, paths=paths, factor=factor, seed=seed
        )
    else:
        law = noise.mu, noise.nu, noise.sigma
        tops = angle_paths(still, other - still, *law, delta, paths=paths, factor=factor, seed=seed)
    levels = np.array([1.1, 1.25, 1.5, *LEVELS])
    low, high = found.bounds(levels)
    share, doubt = reached(tops, levels)
    is_seen = low * paths >= 100
    assert np.count_nonzero(is_seen) >= 2
    assert np.all((low - 4 * doubt <= share)[is_seen])
    assert np.all((share <= high + 4 * doubt)[is_seen])
