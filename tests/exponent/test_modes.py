"""Λ(p) of systems of three and four variables: moment equations, the plane, other codes, and other coordinates."""

import gc
import math
import tracemalloc
import weakref
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    boundary,
    load_case,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    stability_index,
)
from fpsolve.analysis import Axis
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.exponent import principal_pair, spectrum
from fpsolve.exponent.eigen import PairDerivatives
from fpsolve.exponent.modes import SphereStart, first_directions, modal_coordinates, second_moments
from fpsolve.fem.generator import SMALL_P, Generator
from fpsolve.fem.space import Space, first_axis
from fpsolve.fem.sphere import SphereAxis
from fpsolve.model import CoefficientMatrix, Jump, LinearSystem, Poisson, Telegraph, White
from fpsolve.simulation import simulated_response
from tests import random_modes, random_units
from tests.conftest import sampled
from tests.oracles import kronecker

FREE = np.array([[0, 1, 0, 0], [-1, -0.1, 0, 0], [0, 0, 0, 1], [0, 0, -2.56, -0.16]])
"""Two modes, q̈₁ + 0.1 q̇₁ + q₁ and q̈₂ + 0.16 q̇₂ + 2.56 q₂."""


def stiffness(own, other):
    """Noise in the stiffness of both modes, and between them."""
    return -np.array([[0, 0, 0, 0], [own, 0, other, 0], [0, 0, 0, 0], [other, 0, own, 0]])


COUPLED = stiffness(0.5, 0.3)
OU = OrnsteinUhlenbeck(alpha=1.0, sigma=0.5 * math.sqrt(2))


def problem(noise, steady=FREE, driven=COUPLED):
    terms = (
        CoefficientMatrix(0, np.asarray(steady).tolist()),
        CoefficientMatrix(1, np.asarray(driven).tolist(), identity),
    )
    return Problem(LinearSystem(terms), noise)


def random_system(seed, n):
    """Damped, of rates about 1, with noise of a third of them in all entries."""
    rng = np.random.default_rng([30, seed])
    turn = rng.standard_normal((n, n))
    return turn - turn.T - 0.3 * np.diag(rng.uniform(0.3, 1.0, n)), 0.4 * rng.standard_normal((n, n))


@pytest.mark.parametrize(("seed", "n"), [(0, 3), (1, 3), (2, 4)])
@pytest.mark.parametrize("kind", ["white", "telegraph", "ornstein-uhlenbeck"])
def test_second_moments(seed, n, kind):
    """The growth rate of E‖x‖², with which coordinates are chosen, is that of Kronecker squares."""
    steady, driven = random_system(seed, n)
    noise, expected = {
        "white": (White(s=1.0), kronecker.white(steady, driven, 2)),
        "telegraph": (
            Telegraph(a=0.7, k=0.6),
            kronecker.chain(steady, driven, (-0.7, 0.7), ((0, 0.6), (0.6, 0)), 2),
        ),
        "ornstein-uhlenbeck": (
            OrnsteinUhlenbeck(alpha=1.5, sigma=0.5),
            kronecker.ornstein_uhlenbeck(steady, driven, 1.5, 0.5 / math.sqrt(3), 2, 12),
        ),
    }[kind]
    value, q, moments = second_moments(problem(noise, steady, driven))
    assert value == pytest.approx(expected, abs=1e-9)
    assert np.min(np.linalg.eigvalsh(q)) > 0
    assert np.min(np.linalg.eigvalsh(moments)) > 0
    if kind == "white":  # d E xxᵀ/dt = (A + ½B²) E xxᵀ + E xxᵀ (A + ½B²)ᵀ + B E xxᵀ Bᵀ
        drift = (steady + 0.5 * driven @ driven) @ moments
        rate = drift + drift.T + driven @ moments @ driven.T
        np.testing.assert_allclose(rate, expected * moments, atol=1e-9 * np.max(moments))


@pytest.mark.parametrize(("seed", "n"), sampled((0, 3), (2, 4)))
def test_even_moments_under_white_noise(seed, n):
    """By elements."""
    steady, driven = random_system(seed, n)
    solver = ExponentSolver(problem(White(s=1.0), steady, driven), rtol=1e-5)
    for p in (2, 4):
        found = solver.solution(p)
        assert abs(found.pair.value - kronecker.white(steady, driven, p)) <= found.error + 1e-14  # of 4⁴ equations
        assert found.error < 1e-3


def test_even_moments_under_telegraph_noise():
    steady, driven = random_system(1, 3)
    found = moment_lyapunov(problem(Telegraph(a=0.7, k=0.6), steady, driven), [2.0, 4.0], rtol=1e-5)
    expected = [kronecker.chain(steady, driven, (-0.7, 0.7), ((0, 0.6), (0.6, 0)), p) for p in (2, 4)]
    assert np.all(np.abs(found.value - expected) <= found.error_estimate)


@pytest.mark.slow
def test_even_moments_take_no_elements_until_their_slopes_are_read():
    found = moment_lyapunov(problem(White(s=1.0)), [2.0, 4.0], rtol=1e-3)
    assert not found.solver.whole.known
    assert np.all(np.isnan(found.slope))
    low, high = (kronecker.white(FREE, COUPLED, p) for p in (2, 4))
    assert np.all(np.diff([low / 2, found.derivative[0], (high - low) / 2, found.derivative[1]]) > 0)  # Λ is convex


@pytest.mark.slow
def test_even_moments_of_two_modes():
    found = moment_lyapunov(problem(OU), [2.0, 4.0], rtol=1e-5)
    expected = [kronecker.ornstein_uhlenbeck(FREE, COUPLED, 1.0, 0.5, p, 2 + 6 * (6 - p)) for p in (2, 4)]
    assert np.all(np.abs(found.value - expected) <= found.error_estimate)


@pytest.mark.parametrize("noise", [White(s=1.0), OU], ids=["white", "ou"])
def test_even_moments_alone_are_solutions_of_moment_equations(noise):
    solver = ExponentSolver(problem(noise), rtol=1e-11)
    for p in (2, 4):
        if noise is OU:
            expected = kronecker.ornstein_uhlenbeck(FREE, COUPLED, 1.0, 0.5, p, 14)
        else:
            expected = kronecker.white(FREE, COUPLED, p)
        assert solver.even(float(p)).value == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("seed", range(21))
def test_even_moments_alone_have_all_digits(seed):
    """Polynomials of the state are harmonics times r^p, whatever layers other p have."""
    steady, driven = random_system(100 + seed, 3 + seed % 2)
    noise, expected = {
        0: (White(s=1.0), lambda p: kronecker.white(steady, driven, p)),
        1: (
            Telegraph(a=0.7, k=0.6),
            lambda p: kronecker.chain(steady, driven, (-0.7, 0.7), ((0, 0.6), (0.6, 0)), p),
        ),
        2: (
            OrnsteinUhlenbeck(alpha=1.5, sigma=1.0),
            lambda p: kronecker.ornstein_uhlenbeck(steady, driven, 1.5, 1 / math.sqrt(3), p, 24),
        ),
    }[seed % 3]
    solver = ExponentSolver(problem(noise, steady, driven), rtol=1e-10)
    for p in (2, 4):
        assert solver.even(float(p)).value == pytest.approx(expected(p), abs=1e-10)


@pytest.mark.parametrize(("noise", "driven"), sampled((White(s=1.0), COUPLED), (Telegraph(a=0.5, k=0.5), COUPLED)))
def test_what_finer_waves_change_is_told_to_first_order(noise, driven):
    """The value with the correction is nearer to that of a finer space by far, which has the next waves."""
    given = problem(noise, driven=driven)
    noises = [first_axis(each, 7) for each in given.coloured.parts.values()]
    coordinates, *_ = modal_coordinates(given)
    axes = [SphereAxis(coordinates, np.linspace(0, math.pi / 2, 3), 8, waves) for waves in (4, 6)]
    start, finer = (SphereStart(given, Space((axis, *noises))) for axis in axes)
    found = [principal_pair(each.generator, 1.0) for each in (start, finer)]
    change, solution = found[1].value - found[0].value, start.with_error(found[0], 1.0)
    assert solution.pair.value == pytest.approx(found[1].value, abs=0.1 * abs(change))
    assert abs(solution.pair.value - found[1].value) < solution.search
    assert start.refined(replace(solution, search=math.inf), 1.0, 1, 10**6).space.phi.waves == 6  # no other elements
    assert start.refined(solution, 1e-20, 1, 10**6).space.phi.waves == 2
    told = start.change(found[0])
    assert told == pytest.approx(found[1].value - found[0].value, rel=0.1)


@pytest.mark.parametrize(("seed", "count"), sampled((9, 8), (3, 3)))
def test_what_polynomials_of_the_noise_lack_is_told(seed, count):
    """It is more than what many others change, and less than 50 times that: effects of the highest are 100 times."""
    given = random_modes.drawn(seed)[1]
    (noise,) = given.coloured.parts.values()
    few = replace(first_axis(noise, 5), count=count)
    start, finer = (SphereStart(given, Space((first_directions(given), axis))) for axis in (few, few.enriched()))
    pair = start.pair(0.5, None)
    lacking = abs(finer.pair(0.5, pair).eigenvalue - pair.eigenvalue)
    assert lacking < start.with_error(pair, 1e-12).measured[1] < 50 * lacking


def test_the_end_of_the_spectrum_takes_no_array_of_all_directions():
    given = problem(Telegraph(a=0.5, k=0.5))
    noises = [first_axis(each, 7) for each in given.coloured.parts.values()]
    lines = [np.linspace(0, math.pi / 2, count) for count in (2, 40)]
    few, many = (Space((SphereAxis(modal_coordinates(given)[0], each, 6, 2), *noises)) for each in lines)
    generator = SphereStart(given, few).generator
    assert generator.at(-1.0).numerical_abscissa >= spectrum(generator, -1.0, 1)[0].real
    pencil = SphereStart(given, many).generator.at(-1.0)
    assert math.isfinite(pencil.matrix.norm)  # the matrices are made
    tracemalloc.start()
    assert math.isfinite(pencil.numerical_abscissa)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2 * pencil.space.phi.size**2


@pytest.mark.slow
def test_a_sign_takes_a_smaller_space():
    """λ within 0.3 of itself, and within its stated error of that at a tighter rtol."""
    given = load_case(Path(__file__).parents[2] / "cases/systems/coupled_ou.toml").problem
    tight, rough = (ExponentSolver(given, rtol=1e-4, of_value=share) for share in (0.0, 0.3))
    (value, error), (found, doubt) = tight.ratio_alone(0.0), rough.ratio_alone(0.0)
    assert abs(found - value) <= error + doubt <= 0.31 * abs(found)
    assert rough.around_zero.pair.right.size < tight.around_zero.pair.right.size


def test_waves_are_added_until_the_slope_has_settled():
    """And where a space has no principal pair."""
    given = problem(White(s=1.0))
    noises = [first_axis(each, 7) for each in given.coloured.parts.values()]
    start = SphereStart(given, Space((first_directions(given), *noises)))

    def of(slope, p=1.0):
        return SimpleNamespace(pair=SimpleNamespace(derivative=slope, p=p))

    later = replace(start, before=(of(1.0),))
    assert not start.is_enough(of(1.0))
    assert not later.is_enough(of(1.01))
    assert later.is_enough(of(1.001))
    assert start.is_enough(of(1.0, SMALL_P))
    assert start.doubled(None).space.size > start.space.size


@pytest.mark.slow
def test_eigenfunctions_change_as_the_equations_say_where_factors_are_rough():
    """(L − Λ)T′ = −(L′ − Λ′)T for single-precision factors beside Λ, whose own eigenvalue is elsewhere."""
    case = load_case(Path(__file__).parents[2] / "cases/systems/flutter.toml")
    given = case.problem.at({"system.U": 54.0, "noise.standard_deviation": 0.15})
    directions = replace(first_directions(given), degree=6, waves=4)
    pair = principal_pair(Generator(given, Space((directions, first_axis(given.noise, 16)))), 0.0)
    slope = pair.generator.matrix(0.0, derivative=1).shifted(pair.derivative) @ pair.right
    rest = slope + pair.generator.at(0.0).matrix.shifted(pair.eigenvalue) @ PairDerivatives(pair).by_p
    assert np.linalg.norm(rest) <= 1e-13 * np.linalg.norm(slope)


@pytest.mark.parametrize("seed", [7, 18, 29, 161])
def test_coordinates_of_directions_are_those_of_the_system(seed):
    """The layers of two modes are the same in other units and coordinates, so that a solve costs the same."""
    _, problem, units = random_units.drawn(seed)
    _, places = modal_coordinates(problem(random_units.Units(1.0, 1.0, np.eye(4))))
    _, places_there = modal_coordinates(problem(units))
    assert places_there == pytest.approx(places, rel=1e-3)


# by elements and by harmonics of the sphere of another code, to the last digit written
WHITE = {1.0: -0.00081016, 3.0: 0.1124463, -1.0: 0.0314237}
WEAK = {0.5: -0.0248041093, 1.0: -0.0495297287, 3.0: -0.147647323}


@pytest.mark.slow
def test_the_usual_error_is_that_of_cases():
    found = moment_lyapunov(problem(White(s=1.0), driven=0.1 * COUPLED), 1.0)
    assert abs(found.value[0] - WEAK[1.0]) <= found.error_estimate[0] + 1e-9
    assert found.error_estimate[0] <= 1e-5 * abs(WEAK[1.0])
    assert problem(White(s=1.0)).usual_rtol == 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("driven", "expected", "unit"),
    [(COUPLED, WHITE, 1e-7), (0.1 * COUPLED, WEAK, 1e-9)],
    ids=["strong", "weak"],
)
def test_odd_moments_of_two_modes(driven, expected, unit):
    found = moment_lyapunov(problem(White(s=1.0), driven=driven), list(expected), rtol=1e-4)
    off = np.abs(found.value - [expected[p] for p in found.p])
    assert found.p.size == 3
    assert np.all(off <= found.error_estimate + unit)
    assert not found.warnings  # each error is within rtol


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "driven", "expected", "unit"),
    [
        (White(s=1.0), COUPLED, -0.01687416, 1e-8),
        (OU, COUPLED, -0.0484034, 1e-7),
        (White(s=1.0), 0.1 * COUPLED, -0.0496867093, 1e-10),
    ],
    ids=["white", "ornstein-uhlenbeck", "weak"],
)
def test_the_lyapunov_exponent_of_two_modes(noise, driven, expected, unit):
    found = lyapunov_exponent(problem(noise, driven=driven), rtol=1e-4)
    assert abs(found.value - expected) <= found.error_estimate + unit


def test_the_stability_index():
    """Λ(δ_p) = 0: at δ_p = 2 where the damping is such that Λ(2) = 0 by the moments."""
    steady, driven = random_system(1, 3)
    steady = steady - 0.5 * kronecker.white(steady, driven, 2) * np.eye(3)
    found = stability_index(problem(White(s=1.0), steady, driven), rtol=1e-4)
    assert abs(found.value - 2) <= found.error_estimate


def test_what_is_refused():
    terms = [CoefficientMatrix(0, FREE.tolist())]
    with pytest.raises(ValueError, match="jumps are for two variables only"):
        LinearSystem(terms, [Jump(0.0, -0.1)])
    with pytest.raises(ValueError, match="take LinearSystem"):
        PlaneSystem(terms)
    with pytest.raises(ValueError, match="the same for all terms"):
        LinearSystem([*terms, CoefficientMatrix(0, [[0.0, 1.0], [-1.0, 0.0]])])
    with pytest.raises(FpsolveError, match="in other linear systems nothing limits the amplitude"):
        simulated_response(problem(OU), 0.1, 0.1, paths=32, time=1.0, step=0.1, seed=0)
    heavy = NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.2)
    with pytest.raises(ValueError, match="is for two variables only"):
        problem(heavy)
    with pytest.raises(NoSuchExponent, match=r"Λ\(1\) is not computed: of 4 variables under impulses"):
        moment_lyapunov(problem(Poisson(1.0, (0.1,), (1.0,))), 1.0)
    with pytest.raises(ValueError, match="got a mesh"):
        moment_lyapunov(problem(OU), 1.0, mesh=make_mesh())
    with pytest.raises(ValueError, match="two rows"):
        CoefficientMatrix(0, np.eye(201).tolist())


@pytest.mark.slow
def test_flutter_of_a_bridge_deck():
    """Λ(2) = 0 over wind and turbulence, by the moment hierarchy at its points; it begins where the deck flutters."""
    case = load_case(Path(__file__).parents[2] / "cases/systems/flutter.toml")
    wind, turbulence = case.chart.x.axis, Axis("noise.standard_deviation", 1e-4, 0.3)
    [branch] = boundary(case.problem, {"moment": 2.0}, wind, turbulence, nodes=5).branches

    def matrices(u):
        terms = case.problem.at({"system.U": u}).motion.terms
        steady, driven = (sum((t.g(xi) - t.g(0.0) * xi) * np.array(t.matrix) for t in terms) for xi in (0.0, 1.0))
        return steady, driven

    for k in range(0, branch.x.size, 10):
        expected = kronecker.ornstein_uhlenbeck(*matrices(branch.x[k]), 0.5, branch.y[k], 2, 16)
        assert expected == pytest.approx(0.0, abs=1e-9)
    flutters = brentq(lambda u: np.linalg.eigvals(matrices(u)[0]).real.max(), 40.0, 56.0)
    assert branch.x[np.argmin(branch.y)] == pytest.approx(flutters, abs=1e-4)


@pytest.mark.slow
def test_matrices_are_freed_with_the_solver():
    """They may take a gigabyte: nothing waits for the search for cycles."""
    gc.disable()
    try:
        solver = ExponentSolver(problem(White(s=1.0)), rtol=1e-3)
        left = weakref.ref(solver.solution(1.0).pair.generator)
        del solver
        assert left() is None
    finally:
        gc.enable()
