"""The equations of even moments of fpsolve against those of the oracles, and the command that compares with them."""

import math
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT, CHECK_FAILED
from fpsolve.errors import NoHierarchy
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Filter,
    LinearSystem,
    MarkovChain,
    Noises,
    ParametricOscillator,
    Poisson,
    SineWiener,
    Telegraph,
    White,
)
from fpsolve.theory import even_moment, hierarchy_exponent
from fpsolve.theory.powers import moment_form
from tests import random_many
from tests.kit import chain_of_masses
from tests.oracles import filtered, moment_hierarchy, planar, two_noises

FREE, STIFFNESS = [[0.0, 1.0], [-1.0, -0.1]], [[0.0, 0.0], [-1.0, 0.0]]
SADDLE = ((-1.0115024817178828, 0.027976596819670015), (3.2543543385618436, -2.1504180261123937))
NODE = ((-0.5727022764659979, 0.03844029130717129), (-0.38124973260501926, 0.4070870137016061))
NODE_NOISE = ((0.4281962803847412, -0.8337860010391915), (-0.25061621100201587, -0.24215772694411056))
NODE_FILTER = (1.4957362099052074, 0.3305436240665941, 0.05885385917131965, 2.237226809621595, 0.9888121349393983)


def driven(free, matrix, noise):
    kind = PlaneSystem if len(free) == 2 else LinearSystem
    return Problem(kind([CoefficientMatrix(0, free), CoefficientMatrix(0, matrix, identity)]), noise)


def second_moment(free, white=(), matrix=None, alpha=1.0, deviation=0.0, count=1):
    """Λ(2) by E xxᵀ He_k(ξ/std) as vectors of n² numbers, with Stratonovich's white noises."""
    unit, ladder = np.eye(len(free)), np.diag(np.sqrt(np.arange(1.0, count)), 1)

    def both(a):
        return np.kron(a, unit) + np.kron(unit, a)

    steady = both(np.array(free)) + sum(0.5 * both(np.array(b)) @ both(np.array(b)) for b in white)
    total = np.kron(np.eye(count), steady) - np.kron(alpha * np.diag(np.arange(float(count))), np.eye(len(steady)))
    if matrix is not None:
        total += deviation * np.kron(ladder + ladder.T, both(np.array(matrix)))
    return float(np.max(np.linalg.eigvals(total).real))


@pytest.mark.parametrize(
    ("noise", "p", "expected"),
    [
        (noise, p, expected)
        for p in (2, 4)
        for noise, expected in (
            (
                OrnsteinUhlenbeck(1.0, 3.0),
                lambda p: moment_hierarchy.ornstein_uhlenbeck_exponent(FREE, STIFFNESS, 1.0, 3 / math.sqrt(2), p, 60),
            ),
            (
                SineWiener(0.8, 1.0),
                lambda p: moment_hierarchy.sine_wiener_exponent(FREE, STIFFNESS, 0.8, 1.0, p, 20),
            ),
            (
                Bounded(0.4, 2.0, 0.3),
                lambda p: moment_hierarchy.bounded_exponent(FREE, STIFFNESS, 0.4, 2.0, 0.3, p, 20),
            ),
            (
                Poisson(rate=1.0, sizes=(-0.5, 0.7), weights=(0.3, 0.7)),
                lambda p: moment_hierarchy.impulses_exponent(FREE, STIFFNESS, 1.0, (-0.5, 0.7), (0.3, 0.7), p),
            ),
            (
                Filter(1.5, 0.2, 0.4, 1.0, 0.3),
                lambda p: filtered.moment_lyapunov(FREE, STIFFNESS, (1.5, 0.2, 0.4, 1.0, 0.3), p, 16),
            ),
        )
    ],
)
def test_every_noise(noise, p, expected):
    value, error = hierarchy_exponent(driven(FREE, STIFFNESS, noise), p)
    assert value == pytest.approx(expected(p), abs=5e-13)
    assert error < 1e-11


@pytest.mark.slow
def test_many_functions_of_a_strong_slow_filter():
    """Rounding, 1e-7 of Λ(4) by 44 or 54 of them, does not put the search on the wrong side of it: as by 32."""
    noise = (0.62, 0.71, 0.28, 1.0, 2.3)
    drift, loaded = np.array([[0.0, 1.0], [-1.0, -1.4]]), np.array([[0.04, 0.9], [0.95, 0.1]])
    system = planar.Planar(drift, ((loaded, planar.filtered(*noise)),)).balanced()
    expected = planar.rightmost(system.generator(4.0, 2, 32)[0], near=1.87)[0].real
    problem = driven(drift, loaded, Filter(*noise))
    assert even_moment(problem, 4, most=8000).value == pytest.approx(expected, abs=1e-6)
    few = even_moment(problem, 4, most=2000)  # the last of these levels is off by more than the next functions tell
    assert abs(few.value - expected) < few.error


def test_noise_of_eq_7():
    """By elements, and where it is all but Gaussian by the hierarchy of that."""
    for r0 in (0.9, -2.0):
        problem = driven(FREE, STIFFNESS, NonGaussianNoise(0.3, 0.7, r0))
        assert hierarchy_exponent(problem, 2)[0] == pytest.approx(
            ExponentSolver(problem).moments(2.0).value[0], abs=1e-9
        )
    near = driven(FREE, STIFFNESS, NonGaussianNoise(0.3, 0.7, 1 - 1e-11))
    gaussian = moment_hierarchy.ornstein_uhlenbeck_exponent(FREE, STIFFNESS, 1 / 0.7, math.sqrt(0.3 / 0.7), 4, 40)
    assert hierarchy_exponent(near, 4)[0] == pytest.approx(gaussian, abs=1e-9)


def test_a_harmonic_load_beside_noise():
    """By the multipliers of the periodic equations; the spectrum is Λ + ikν, and cut off it comes to lie right of Λ."""
    terms = [CoefficientMatrix(0, STIFFNESS, identity, name) for name in ("load", "noise")]
    system = PlaneSystem([CoefficientMatrix(0, FREE), *terms])
    problem = Problem(system, {"load": Bounded(0.4, 2.0, 0.0), "noise": White(0.3)})
    for p in (2, 4):
        expected = moment_hierarchy.harmonic_exponent(FREE, STIFFNESS, 0.4, 2.0, p, 0.3 * np.array(STIFFNESS))
        assert hierarchy_exponent(problem, p)[0] == pytest.approx(expected, abs=1e-11)


def test_the_eigenvalue_is_the_rightmost():
    """Saddles and nodes under two noises and a filter, where |x|^(p − k) |v|^k is nearly an eigenfunction, too."""
    laws = (37.431388258716034, 32.74906196496099), (32.63567554169098, 8.536346218849552)
    terms = [
        CoefficientMatrix(0, matrix, identity, name)
        for matrix, name in ((((0, 0), (1, 0)), "a"), (((0, 0), (0, 1)), "b"))
    ]
    noises = {name: OrnsteinUhlenbeck(*law) for name, law in zip("ab", laws, strict=True)}
    saddle = Problem(PlaneSystem([CoefficientMatrix(0, SADDLE), *terms]), noises)
    matrices, deviations = (SADDLE, ((0, 0), (1, 0)), ((0, 0), (0, 1))), [s / math.sqrt(2 * a) for a, s in laws]
    for p in (2, 4, 6):
        expected = two_noises.moment_lyapunov(matrices, [a for a, _ in laws], deviations, p, 6)
        assert hierarchy_exponent(saddle, p)[0] == pytest.approx(expected, abs=1e-9)
    assert hierarchy_exponent(saddle, 4)[0] == pytest.approx(-3.734143931469, abs=1e-12)
    node = driven(NODE, NODE_NOISE, Filter(*NODE_FILTER))
    for p, expected in ((2, 0.78527655968609), (4, 1.57063217231938)):
        assert hierarchy_exponent(node, p)[0] == pytest.approx(expected, abs=1e-13)
        assert filtered.moment_lyapunov(NODE, NODE_NOISE, NODE_FILTER, p, 8) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("n", [3, 4])
def test_more_variables(rng, n):
    free, matrix = rng.standard_normal((2, n, n))
    white = driven(free, matrix, White(s=0.7, interpretation="stratonovich"))
    found = even_moment(white, 2)
    assert found.value == pytest.approx(second_moment(free, [0.7 * matrix]), abs=1e-11)
    assert hierarchy_exponent(driven(free, matrix, OrnsteinUhlenbeck(2.0, 0.8)), 2)[0] == pytest.approx(
        second_moment(free, (), matrix, 2.0, 0.4, 14), abs=1e-10
    )
    steady = driven(free, 1e-9 * matrix, White(s=1.0))  # p times the largest real part
    assert hierarchy_exponent(steady, 6)[0] == pytest.approx(6 * np.linalg.eigvals(free).real.max(), abs=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("most", [0, 1000], ids=["as matrices", "as one vector"])
@pytest.mark.parametrize("moved", [0.02, 3.0])
def test_beside_a_known_one(monkeypatch, most, moved):
    """The rightmost one, too, where the known one is of a block, and another that it does not move now grows faster."""
    monkeypatch.setattr("fpsolve.theory.moments.MOST_AS_POWERS", most)
    rng, noise = np.random.default_rng(3), OrnsteinUhlenbeck(1.0, 0.7)
    free, load = rng.standard_normal((2, 5, 5))
    free[:2, 2:] = free[2:, :2] = load[:2, 2:] = load[2:, :2] = 0.0
    first, second = (even_moment(driven(free[at, at], load[at, at], noise), 2) for at in (slice(0, 2), slice(2, 5)))
    free[:2, :2] += 0.5 * (second.value + 0.01 - first.value) * np.eye(2)
    known = even_moment(driven(free, load, noise), 2)
    assert known.value == pytest.approx(second.value + 0.01, abs=1e-11)
    free[2:, 2:] += 0.5 * moved * np.eye(3)
    found = even_moment(driven(free, load, noise), 2, near=known)
    assert found.value == pytest.approx(second.value + moved, abs=1e-11)


@pytest.mark.slow
def test_the_last_functions_move_with_the_next_ones():
    """By far more of them: to first order alone the next ones of this filter have the other sign."""
    problem, _, _ = random_many.drawn(42)
    equations = even_moment(problem, 2).equations
    exact = equations.moment([12], 20_000).eigenvalue
    for count, share in ((4, 0.05), (6, 0.05), (8, 0.3)):
        level = equations.moment([count], 20_000)
        assert level.value == pytest.approx(exact, abs=share * abs(level.effects[0]))


@pytest.mark.parametrize("seed", [2, 24, 33, 43, 81, 85, 86, pytest.param(161, id="next to skew matrices")])
def test_random_systems(seed):
    """One for each kind, as one vector or as matrices: `python -m tests.random_many`."""
    is_within, told = random_many.compared(seed)
    assert is_within, told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "p"),
    [(seed, 2) for seed in range(1, 27, 4)] + [(90, 2), (106, 2), (5, 4)],
)
def test_more_random_systems(seed, p):
    """All kinds of up to six variables; `python -m tests.random_many` has others, of up to twelve, too."""
    is_within, told = random_many.compared(seed, p)
    assert is_within, told


def test_moments_of_order_4(rng):
    """Six variables under a chain."""
    is_within, told = random_many.compared(30, 4)
    assert is_within, told


@pytest.mark.parametrize("count", [10, 30, 60])
def test_bounds_of_many_variables(rng, count):
    """μ₋X ≤ L(X) ≤ μ₊X for a positive X bounds Λ(2) of white noise from both sides, as L is positive.

    That is of Collatz and Wielandt. L is written here, and X alone is that of the program.
    """
    free, matrix = rng.standard_normal((2, count, count)) / math.sqrt(count)
    found = even_moment(driven(free - np.eye(count), matrix, White(s=0.7)), 2)
    x = moment_form(found.moments, count, 2)
    x = np.linalg.cholesky(x * np.sign(np.trace(x)))
    steady = free - np.eye(count) + 0.5 * 0.49 * matrix @ matrix
    image = (half := steady @ x @ x.T) + half.T + 0.49 * matrix @ x @ x.T @ matrix.T
    growth = np.linalg.eigvalsh(np.linalg.solve(x, np.linalg.solve(x, image).T))
    assert growth.max() - growth.min() < 1e-3
    assert growth.min() - 1e-12 < found.value < growth.max() + 1e-12


@pytest.mark.slow
def test_many_variables_under_coloured_noise():
    """A chain of six masses has the same Λ(2) as matrices, and as one vector of 78 numbers for each function."""
    free, matrix, _ = chain_of_masses(6)
    problem = driven(free, matrix, OrnsteinUhlenbeck(1.0, 0.4 * math.sqrt(2)))
    found = even_moment(problem, 2)
    with mock.patch("fpsolve.theory.moments.MOST_AS_POWERS", 10**6):
        other = even_moment(problem, 2)
    assert abs(found.value - other.value) <= found.error + other.error
    assert found.error < 1e-10


def test_a_chain_of_two_masses():
    """Under noise in the first spring, by an independent program."""
    free, matrix, _ = chain_of_masses(2)
    coloured = driven(free, matrix, OrnsteinUhlenbeck(1.0, 0.1 * math.sqrt(2)))
    assert hierarchy_exponent(coloured, 2)[0] == pytest.approx(-0.0394544357, abs=1e-10)
    white = driven(free, matrix, White(s=math.sqrt(coloured.noise.spectral_density(2.0))))
    assert hierarchy_exponent(white, 2)[0] == pytest.approx(-0.0389353938, abs=1e-10)


@pytest.mark.parametrize("unit", [1e-9, 1e6])
def test_the_unit_of_time_and_of_the_state(rng, unit):
    """Λ is that of the system in units of its own, over the unit of time, to the stated error."""
    free, matrix = rng.standard_normal((2, 4, 4))
    own = hierarchy_exponent(driven(free, matrix, OrnsteinUhlenbeck(1.0, 0.5)), 2)
    scale = np.diag(unit ** np.array([0.0, 1.0, -0.5, 0.3]))
    other, load = (scale @ each @ np.linalg.inv(scale) / unit for each in (free, matrix))
    value, error = hierarchy_exponent(driven(other, load, OrnsteinUhlenbeck(1 / unit, 0.5 / math.sqrt(unit))), 2)
    assert abs(value * unit - own[0]) <= 10 * (own[1] + error * unit)
    assert error * unit < 1e-10


def test_the_error_is_met(rng):
    """That of few functions, against many; it is no more than a few hundred times too large."""
    for _ in range(3):
        problem = driven(*rng.standard_normal((2, 2, 2)), OrnsteinUhlenbeck(1.0, 1.0))
        exact = even_moment(problem, 4).value
        for tolerance in (1e-2, 1e-7):
            found = even_moment(problem, 4, tolerance)
            assert abs(found.value - exact) <= found.error <= tolerance


@pytest.mark.parametrize("p", [2, 4, 10])
def test_any_matrices_with_any_chain(rng, p):
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    states, rates = rng.uniform(-1, 1, 3), rng.uniform(0.2, 2, (3, 3))
    chain = MarkovChain(states, rates - np.diag(np.diagonal(rates)))
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity)]
    expected = moment_hierarchy.moment_lyapunov([steady + 0.4 * xi * driven for xi in states], chain.rates, p)
    value, error = hierarchy_exponent(Problem(PlaneSystem(terms, epsilon=0.4), chain), p)
    assert abs(value - expected) <= error + 1e-14 * abs(expected)
    assert error < 1e-10


@pytest.mark.parametrize("sense", ["stratonovich", "ito"])
def test_any_matrices_with_white_noise(rng, sense):
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity)]
    problem = Problem(PlaneSystem(terms, epsilon=0.4), White(s=1.3, interpretation=sense))
    for p in (2, 6):
        expected = moment_hierarchy.white_noise_exponent(steady, [0.4 * 1.3 * driven], p, sense)
        assert hierarchy_exponent(problem, p)[0] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(
    ("system", "noise", "p", "words"),
    [
        (ParametricOscillator(1.0, 0.1), White(0.5), 3.0, "even p > 0 only"),
        (ParametricOscillator(1.0, 0.1), White(0.5), 0.0, "even p > 0 only"),
        (ParametricOscillator(1.0, 0.1, 0.9), White(0.5), 2.0, "where a wall changes the state"),
        (ParametricOscillator(1.0, 0.1), NonGaussianNoise(1.0, 1.0, 1.2), 2.0, "algebraic tails; take r0 <= 1"),
        (ParametricOscillator(1.0, 0.1), Telegraph(0.5, 1.0), 1e6, "1000001 moments are more than 1000"),
        (ParametricOscillator(1.0, 0.1), OrnsteinUhlenbeck(1e-3, 1.0), 4.0, "noise so strong or slow"),
    ],
)
def test_what_does_not_close_is_refused(system, noise, p, words):
    with pytest.raises(NoHierarchy, match=words):
        hierarchy_exponent(Problem(system, noise), p)


CASE = """\
title = "hierarchy"
[system]
kind = "parametric"
stiffness = 1.0
damping = 0.05
[noise]
kind = "telegraph"
a = 0.5
k = 1.0
[moments]
p = [-1.0, 1.0, 2.0, 4.0]
[vary]
"noise.k" = [0.5, 1.0]
"""


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "hierarchy.toml"
    path.write_text(CASE, encoding="utf-8")
    command = ["check", "--hierarchy", str(path), "--jobs", "1"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "4 of 4 ok" in said
    assert "moment, p = 4" in said
    assert "-0.0332610990213" in said
    monkeypatch.setattr("fpsolve.workflow.check.hierarchy_exponent", lambda problem, p: (0.1, 1e-12))
    assert main([*command, "--quiet"]) == CHECK_FAILED
    assert capsys.readouterr().out == "hierarchy: 0 of 4 ok\n"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("system.restitution=0.9", "with noise.k = 0.5: the equations of the moments do not close where a wall"),
        ("moments.p=[1.0, 3.0]", "moments.p: has no even p > 0, and the hierarchy is for these; add 2.0"),
    ],
)
def test_the_command_refuses_what_does_not_close(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], override: str, words: str
) -> None:
    path = tmp_path / "hierarchy.toml"
    path.write_text(CASE, encoding="utf-8")
    assert main(["check", "--hierarchy", str(path), "--set", override]) == BAD_INPUT
    assert words in " ".join(capsys.readouterr().err.split())


def test_slopes_by_parameters(rng):
    """Against differences of Λ(2); that of r₀ at its largest value, and that by a noise which moves others."""
    free, matrix = rng.standard_normal((2, 3, 3))
    cases = [
        (driven(free, matrix, OrnsteinUhlenbeck(1.0, 0.7)), ("noise.alpha", "noise.sigma")),
        (driven(FREE, STIFFNESS, NonGaussianNoise(0.3, 0.7, 0.5)), ("noise.r0", "noise.tau0")),
        (Problem(ParametricOscillator(1.0, 0.1), Filter(*NODE_FILTER)), ("system.damping", "noise.omega", "noise.c1")),
    ]
    for problem, keys in cases:
        found = even_moment(problem, 2)
        for key in keys:
            at, step = problem.values[key], 1e-4 * problem.values[key]
            ahead, behind = (even_moment(problem.at({key: at + each}), 2).value for each in (step, -step))
            assert found.slope(key)[0] == pytest.approx((ahead - behind) / (2 * step), rel=1e-5, abs=1e-9)
    last = Problem(ParametricOscillator(1.0, 0.1), NonGaussianNoise(0.3, 0.7, 1.0))
    found = even_moment(last, 2)
    near, far = (even_moment(last.at({"noise.r0": 1 - each}), 2).value for each in (1e-4, 2e-4))
    assert found.slope("noise.r0")[0] == pytest.approx((1.5 * found.value - 2 * near + 0.5 * far) / 1e-4, rel=1e-5)
    with pytest.raises(KeyError):
        found.slope("noise.none")


@pytest.mark.parametrize(
    ("n", "mu", "delta", "square"),
    [(2, -0.8554694689402464, 9.993744373604739e-05, 1.7072315886796916), (4, -0.7269131714, 1.33646e-6, 1.4052498279)],
)
def test_rounding_of_what_moves_the_state_is_in_the_error(n, mu, delta, square):
    """Patches x_i′ = μx_i + δΣ(x_j − x_i) + σx_i ξ_i in Itô's sense: E x_i² and E x_i x_j obey two equations."""
    exchange = delta * (np.ones((n, n)) - n * np.eye(n))
    terms = [CoefficientMatrix(0, mu * np.eye(n) + exchange)]
    terms += [CoefficientMatrix(0, np.diag(np.eye(n)[i]), identity, f"w{i}") for i in range(n)]
    noises = Noises({f"w{i}": White(math.sqrt(square), interpretation="ito") for i in range(n)})
    found = even_moment(Problem((PlaneSystem if n == 2 else LinearSystem)(terms), noises), 2)
    own, other = 2 * mu + square - 2 * (n - 1) * delta, 2 * mu - 2 * delta
    expected = 0.5 * (own + other) + math.hypot(0.5 * (own - other), 2 * delta * math.sqrt(n - 1))
    assert abs(found.value - expected) <= found.error <= 1e-13


def test_the_error_is_what_few_functions_lack():
    """At a coarse tolerance, against the value with many functions."""
    given = driven(FREE, STIFFNESS, OrnsteinUhlenbeck(1.0, 1.0))
    exact, found = even_moment(given, 4).value, even_moment(given, 4, 1e-3)
    assert found.error == pytest.approx(abs(found.eigenvalue - exact), rel=0.2)


def test_a_start_that_is_the_answer():
    """ẋ = (−1 + ξ)x of 12 variables: Λ(2) = −2 + 2s², and all laws are alike."""
    found = even_moment(driven(-np.eye(12), np.eye(12), White(s=0.5)), 2)
    assert found.value == pytest.approx(-1.5, abs=1e-12)
