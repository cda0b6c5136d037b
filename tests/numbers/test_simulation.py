"""Simulated exponents and responses, beside what is known otherwise, with standard errors that hold what they say."""

import math
import os
import re
import shutil
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import fpsolve
from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    moment_lyapunov,
    simulate,
)
from fpsolve.exponent import even_moment, impact_rate
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Filter,
    LinearSystem,
    MarkovChain,
    Noise,
    PlaneSystem,
    Poisson,
    SineWiener,
    Telegraph,
    White,
)
from fpsolve.simulation import simulated_response
from tests.conftest import sampled
from tests.kit import chain_of_masses, itself, matrices, rates
from tests.numbers.by_problem import by_moments
from tests.numbers.rows.blocks import TEXTS
from tests.oracles import closed_forms, phase_circle

COVERED = 4.0
"""Multiple of the standard error within which a number must be."""
NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9)
REDUCED = NOISE.ou_reduction()
FREE = np.array([[0, 1, 0, 0], [-1, -0.1, 0, 0], [0, 0, 0, 1], [0, 0, -2.56, -0.16]])
COUPLED = -np.array([[0, 0, 0, 0], [0.5, 0, 0.3, 0], [0, 0, 0, 0], [0.3, 0, 0.5, 0]])
TURN, VELOCITY, NEGATIVE = ((0.0, -1.0), (1.0, 0.0)), ((0.0, 0.0), (0.0, 1.0)), ((0.0, 1.0), (-1.0, 0.1))


def paper(epsilon: float = 0.5, noise: Noise = REDUCED, **more: float | str) -> Problem:
    """The oscillator of Eq. (3), of moderate noise, or at ε = 1 of strong noise."""
    given = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "impact": "restitution", **more}
    return Problem(VibroImpactOscillator(epsilon=epsilon, **given), noise)


def spring(noise, b: float = 0.05, k: float = 1.0, restitution: float = 1.0) -> Problem:
    walls = [{"at": "x = 0", "restitution": restitution}] if restitution < 1 else []
    return rates("x' = v; v' = -k*x - 2*b*v - xi*x", noise, walls, b=b, k=k)


def random_system(seed: int, n: int):
    """Damped, of rates about 1, with noise of a third of them in all entries."""
    rng = np.random.default_rng([30, seed])
    turn = rng.standard_normal((n, n))
    return turn - turn.T - 0.3 * np.diag(rng.uniform(0.3, 1.0, n)), 0.2 * rng.standard_normal((n, n))


def is_near(value: float, found: float, error: float, most: float) -> None:
    """Within its standard errors, and these are small."""
    assert abs(found - value) < COVERED * error, f"{found} ± {error}, off by {found - value}"
    assert error < most


@dataclass(frozen=True)
class Simulated:
    """A problem to simulate, and what is known of it: Λ by p, and λ under None."""

    problem: Problem
    known: dict[float | None, Callable[[], float] | float]
    most: float = 1e-3
    estimator: str | None = None
    paths: int = 4096
    time: float | None = None
    slow: bool = True


def elements(problem: Problem, *orders: float | None):
    """Λ by p by finite elements, closer than paths are."""

    def solved(p: float | None) -> float:
        if p is None:
            return lyapunov_exponent(problem, rtol=1e-4).value
        return float(moment_lyapunov(problem, p, rtol=1e-4).value[0])

    return {p: partial(solved, p) for p in orders}


def by_phase(made, p: float | None, R: float = 1.0):
    if p is None:
        return lambda: phase_circle.lyapunov_exponent(made, 40, R)
    return lambda: phase_circle.moment_exponent(made, p, 20, R)


STATES = [np.array([[0.0, 1.0], [-1.0 - xi, -0.1]]) for xi in (-0.5, 0.5)]
FLIP = [[-1.0, 1.0], [1.0, -1.0]]
ITO = White(s=0.5, interpretation="ito")
DAMPED = [phase_circle.white(NEGATIVE, [0.5 * np.array(VELOCITY)], sense) for sense in ("stratonovich", "ito")]
WALLED = phase_circle.white(((0.0, 1.0), (-1.0, -0.2)), [((0.0, 0.0), (-0.5, 0.0))])
VELOCITY_WALL = "x' = v; v' = -x + 0.1*v + xi*v"
WALL = [{"at": "x = 0", "restitution": 0.8}]
MASSES, STRETCH, _ = chain_of_masses(3, 0.2)
RARE = matrices(
    [[0.0, 1.0], [0.0, -0.005654434667604]],
    [[-0.947195882077613, -44.46489829714192], [-0.000470764470868, 0.265455967756086]],
    Poisson(0.002811606864821, (1.140477428600101, -0.302704343214471), (0.234378736233945, 0.712329916975077)),
)
"""Impulses so rare that the direction of x comes to rest between them."""
APART = rates(TEXTS["cascade"].replace("0.16*w", "1.2*w"), White(s=1.0))
"""Of which one block decays much sooner, so that paths forget it."""
DELAYED = rates("x' = v; v' = -x - 0.4*v + 0.3*x(t - 1.0) - xi*x(t - 1.0)", White(s=0.1))


KNOWN = {
    "telegraph": Simulated(
        spring(Telegraph(a=0.5, k=1.0)),
        {
            None: by_phase(phase_circle.chain(STATES, FLIP), None),
            2: lambda: by_moments(KNOWN["telegraph"].problem, 2),
        },
        slow=False,
    ),
    "white, a wall": Simulated(
        spring(White(s=0.5), 0.1, restitution=0.8),
        {None: lambda: closed_forms.white_stiffness(1.0, 0.5, 0.1, 0.8), 2: by_phase(WALLED, 2.0, 0.8)},
        paths=8192,
        slow=False,
    ),
    "white in the velocity, a wall": Simulated(
        rates(VELOCITY_WALL, White(s=0.5), WALL),
        {None: by_phase(DAMPED[0], None, 0.8), 1: by_phase(DAMPED[0], 1.0, 0.8)},
        slow=False,
    ),
    "Itô, a wall": Simulated(rates(VELOCITY_WALL, ITO, WALL), {None: by_phase(DAMPED[1], None, 0.8)}),
    "white, inverted": Simulated(
        spring(White(s=1.0), 0.0, -1.0), {None: lambda: closed_forms.white_stiffness(-1.0, 1.0)}
    ),
    "saddle": Simulated(
        matrices(((1.0, 0.0), (0.0, -1.0)), TURN, White(s=1.0)),
        {None: lambda: float(closed_forms.saddle_and_turning()[0])},
    ),
    "Gaussian, without loss": Simulated(
        paper(0.7, OrnsteinUhlenbeck(1.0, 1.0), restitution=1.0, c1=0.2),
        {-2: 0.49 * (0.5 - 0.2)},
        2e-3,
        "population",
        8192,
    ),
    "a phase that noise hardly disturbs": Simulated(
        matrices(
            [[0.4, 0.95], [-1.2, -0.1]],
            [[0.07, 0.09], [0.02, 0.32]],
            MarkovChain((-2.5, -1.4, -2.4), [[0.0, 0.075, 0.005], [2.9, 0.0, 1.1], [0.9, 0.2, 0.0]]),
        ),
        {2: lambda: by_moments(KNOWN["a phase that noise hardly disturbs"].problem, 2)},
        5e-4,
        "population",
        time=100.0,
    ),
    "two modes": Simulated(
        matrices(FREE, COUPLED, OrnsteinUhlenbeck(alpha=1.0, sigma=0.5 * math.sqrt(2))),
        {None: -0.0484034},
        3e-4,
        paths=2048,
    ),
    "two modes, white": Simulated(
        matrices(FREE, COUPLED, White(1.0)), {-1: 0.0314237}, estimator="population", time=100.0
    ),
    "two modes, impulses": Simulated(matrices(FREE, COUPLED, Poisson(1.0, [0.4])), {2: -0.0861990831}),
    "six variables, all alike": Simulated(
        matrices(MASSES, 0.5 * np.eye(6), White(s=0.2)),
        {
            p: lambda p=p: (p or 1) * float(np.linalg.eigvals(MASSES).real.max()) + (p or 0) ** 2 * 0.04 / 8
            for p in (None, 0.5, 1.0)
        },
        1e-2,
        paths=1024,
    ),
    "six variables": Simulated(
        matrices(MASSES, STRETCH, OrnsteinUhlenbeck(1.0, 0.5)),
        {2: lambda: float(moment_lyapunov(KNOWN["six variables"].problem, 2.0).value[0])},
        1e-2,
        paths=1024,
    ),
    "rare impulses": Simulated(RARE, elements(RARE, None), 2.7e-5, paths=64),
    "blocks": Simulated(APART, elements(APART, None, 1.0)),
    "a delay": Simulated(DELAYED, {2: lambda: even_moment(DELAYED, 2).value}, 5e-3, "population", 4096),
}


def driving(noises) -> tuple[Problem, Problem]:
    """An oscillator under two noises, and with z of ż = −z + x, which grows as x does."""
    shapes = ((0, 0), (-1, 0)), ((0, 0), (0, -1))

    def made(wider):
        return matrices(wider(((0, 1), (-1, -0.3)), 1), [wider(each, 0) for each in shapes], noises)

    return made(lambda matrix, _: matrix), made(lambda a, own: [[*row, 0.0] for row in a] + [[own, 0.0, -own]])


plane, more = driving([OrnsteinUhlenbeck(alpha=1.0, sigma=0.6), Telegraph(a=0.5, k=1.0)])
KNOWN["what an oscillator drives, two noises"] = Simulated(
    more, elements(plane, None, 1.0), 5e-3, "population", time=50.0
)
for r, name, noise in ((0.6, "exact", NOISE), (1.0, "reduced", REDUCED)):
    each = paper(0.5, noise, restitution=r)
    KNOWN[f"paper, {name}"] = Simulated(each, elements(each, None, -1.0, 0.5, 1.0, 2.0), 2e-3, time=100.0)
EACH = [pytest.param(name, id=name, marks=pytest.mark.slow if given.slow else ()) for name, given in KNOWN.items()]


@pytest.mark.parametrize("name", EACH)
def test_simulated_exponents_are_within_their_standard_errors(name):
    given = KNOWN[name]
    orders = [p for p in given.known if p is not None]
    found = simulate(given.problem, orders, estimator=given.estimator, paths=given.paths, time=given.time, seed=2)
    values = {each.p: (each.value, each.standard_error) for each in found.estimates}
    values[None] = found.lyapunov_exponent, found.lyapunov_exponent_error
    for p, value in given.known.items():
        is_near(value() if callable(value) else value, *values[p], given.most)


LAWS = (
    White(s=0.6),
    OrnsteinUhlenbeck(alpha=1.0, sigma=0.6),
    Telegraph(a=0.5, k=1.5),
    MarkovChain([0.0, 1.0, 5.0], [[0, 1.0, 0.5], [2.0, 0, 1.0], [0.3, 0.1, 0]]),
    NonGaussianNoise(D0=0.2, tau0=1.0, r0=0.5),
    NonGaussianNoise(D0=0.2, tau0=1.0, r0=0.95),
    NonGaussianNoise(D0=0.2, tau0=1.0, r0=1.2),
    SineWiener(0.8, 1.0),
    Bounded(mu=0.8, nu=0.7, sigma=1.0),
    Filter(1.5, 0.5, 0.8),
    Poisson(2.0, (0.3, -0.2), (0.5, 0.5)),
)


@pytest.mark.parametrize("noise", sampled(*LAWS, keep=2), ids=lambda noise: f"{type(noise).__name__}")
def test_a_load_on_both_variables_alike_grows_by_the_mean_and_the_spectrum_of_its_noise(noise):
    """Of ẋ = (A + ½ξ)x, A a rotation: λ = ½Eξ, Λ″(0) = ¼S(0), or as by elements, and none for algebraic tails."""
    problem = matrices(((0.0, 1.0), (-1.0, 0.0)), ((0.5, 0.0), (0.0, 0.5)), noise)
    found = simulate(problem, [], paths=2048, time=100.0, seed=3)
    mean, rate = 0.0, noise.spectral_density(0.0) / 4
    if isinstance(noise, NonGaussianNoise) and not noise.has_algebraic_tails:
        rate = ExponentSolver(problem, rtol=1e-4).variance_rate().value
    elif type(noise) is MarkovChain:
        mean = float(np.dot(noise.probabilities, noise.states))
    elif isinstance(noise, Poisson):
        mean = noise.rate * float(np.mean(noise.sizes))
    assert abs(found.lyapunov_exponent - mean / 2) < COVERED * found.lyapunov_exponent_error
    if not noise.has_algebraic_tails:
        assert abs(found.variance_rate - rate) < COVERED * found.variance_rate_error < 0.2 * rate


def test_transient_of_modes_that_a_load_moves_alike_does_not_depend_on_the_order_of_the_variables():
    """E xxᵀ has −2ζω and −2ζω ± 2iω as far to the right, of which the first counts: 3/(difference of ζω)."""
    slow, fast = np.unique(np.round(-np.linalg.eigvals(MASSES).real, 12))[:2]
    for order in np.random.default_rng(1).permuted(np.tile(np.arange(6), (20, 1)), axis=1):
        moved = matrices(MASSES[np.ix_(order, order)], 0.5 * np.eye(6), White(s=0.2))
        with pytest.raises(ValueError, match="two transients") as refused:
            simulate(moved, [], time=1e-6)
        least = float(re.search(r">= ([\d.e+]+)", str(refused.value))[1])
        assert 6 / (fast - slow) <= least <= 9 / (fast - slow)


@pytest.mark.slow
@pytest.mark.parametrize(("estimator", "time"), [("direct", 100.0), ("population", 50.0)])
def test_estimates_of_many_seeds_scatter_as_their_standard_errors_say(estimator, time):
    seeds = 20
    given = paper()
    right = [lyapunov_exponent(given).value, float(moment_lyapunov(given, 0.5).value[0])]
    off = []
    for seed in range(seeds):
        found = simulate(given, [0.5], estimator=estimator, paths=2048, time=time, seed=seed)
        (moment,) = found.estimates
        pairs = (found.lyapunov_exponent, found.lyapunov_exponent_error), (moment.value, moment.standard_error)
        off.append([(value - known) / error for known, (value, error) in zip(right, pairs, strict=True)])
    squares = np.mean(np.square(off), axis=0)
    assert np.all(np.abs(squares - 1) < 4 * math.sqrt(2 / seeds))


@pytest.mark.slow
def test_a_population_finds_a_moment_that_too_few_direct_paths_carry():
    """Λ(4) at ε = 1, to 1 %."""
    strong = paper(1.0)
    reference = float(moment_lyapunov(strong, 4.0).value[0])
    direct = simulate(strong, 4.0, estimator="direct", paths=1024, seed=1)
    assert direct.estimates[0].value is None
    assert any("no estimate of Λ(p) at p = 4:" in text and "5000 are needed" in text for text in direct.warnings)
    population = simulate(strong, 4.0, estimator="population", paths=4096, seed=1)
    assert not population.warnings
    assert population.estimates[0].value == pytest.approx(reference, rel=1e-2)
    assert population.estimates[0].standard_error < 2e-3 * reference


@pytest.mark.slow
def test_populations_are_taken_unasked_where_too_few_paths_carry_the_mean():
    """As either estimator alone finds it; each p has the one that its estimate names."""
    calls, how = [], {"paths": 4096, "time": 200.0, "seed": 1}
    found = simulate(paper(), [1.0, 12.0], progress=lambda: calls.append(1), **how)
    direct = simulate(paper(), [1.0, 12.0], estimator="direct", **how)
    assert direct.estimates[1].value is None
    assert found.estimates[0] == direct.estimates[0]
    assert (found.estimates[1].estimator, len(calls)) == ("population", 100)


@pytest.mark.slow
def test_slow_noise_that_carries_a_moment_in_two_places_is_told():
    """Λ(2) = 1.129 where the oscillator does not turn, 0.496 where it does: no population passes between them."""
    slow = paper(1.0, NonGaussianNoise(D0=0.5, tau0=20.0, r0=1.0))
    found = simulate(slow, [2.0], estimator="population", paths=8192, time=330.0, seed=1)
    (estimate,) = found.estimates
    is_near(float(moment_lyapunov(slow, 2.0).value[0]), estimate.value, estimate.standard_error, 1e-3)
    assert any("start in two places of the noise differ by 0.6" in text for text in found.warnings)


@pytest.mark.parametrize("paths", sampled(2048, 8192))
def test_the_variance_rate_is_that_of_elements(paths):
    found = simulate(paper(), [], paths=paths, seed=2)
    reference = ExponentSolver(paper()).variance_rate().value
    assert found.variance_rate == pytest.approx(reference, abs=4 * found.variance_rate_error + 0.02 * reference)


def small(seed: int, estimator: str = "direct", orders: Sequence[float] = (-1.0, 1.0)):
    return simulate(paper(noise=NOISE), list(orders), estimator=estimator, paths=640, time=60.0, seed=seed)


@pytest.mark.parametrize("estimator", ["direct", "population"])
def test_a_moment_of_order_zero_does_not_grow(estimator):
    found = simulate(paper(0.1), [0.0], estimator=estimator, paths=320, time=40.0).estimates[0]
    assert (abs(found.value) < 1e-12, found.standard_error < 1e-12) == (True, True)


@pytest.mark.parametrize("estimator", sampled("direct", "population"))
def test_the_seed_decides_whatever_the_number_of_processors(monkeypatch, estimator):
    found = small(3, estimator)
    monkeypatch.setenv("FPSOLVE_PROCESSORS", "1")
    assert small(3, estimator) == found
    assert small(4, estimator) != found


@pytest.mark.slow
def test_one_simulation_serves_all_orders_and_one_order_needs_no_list():
    alone, together = small(3, orders=(1.0,)), small(3, orders=(-1.0, 1.0, 2.0))
    assert alone.estimates[0] == together.estimates[1]
    assert alone.lyapunov_exponent == together.lyapunov_exponent
    assert simulate(paper(noise=NOISE), 1.0, estimator="direct", paths=640, time=60.0, seed=3) == alone


@pytest.mark.slow
def test_memory_does_not_grow_with_time():
    def peak(time):
        tracemalloc.start()
        simulate(paper(), [1.0], paths=3200, time=time)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(30.0)
    assert peak(800.0) < 1.3 * peak(100.0)


@pytest.mark.parametrize("estimator", sampled("direct", "population"))
def test_an_interrupted_simulation_gives_the_estimates_of_what_is_done(estimator):
    calls, how = [], {"estimator": estimator, "paths": 4096, "time": 400.0, "seed": 1}

    def progress():
        calls.append(1)
        if len(calls) == 50:
            raise KeyboardInterrupt

    found = simulate(paper(), [1.0], progress=progress, **how)
    assert found.interrupted
    assert 100 < found.time < 300
    assert "stopped early" in found.warnings[-1]
    (estimate,) = found.estimates
    is_near(float(moment_lyapunov(paper(), 1.0).value[0]), estimate.value, estimate.standard_error, 1e-2)


def test_an_interrupt_before_two_transients_is_raised():
    def progress():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(paper(), [1.0], paths=64, time=20.0, progress=progress)


@pytest.mark.slow
def test_steps_and_times_are_in_the_unit_of_the_system():
    """ẍ + 2bωẋ + ω²(1 + ξ)x = 0 at ω = 10 takes the step of ω = 1 over 10; a time is whole periods of a load."""
    one, ten = (
        simulate(
            rates("x' = v; v' = -k*x - 2*b*v - k*xi*x", OrnsteinUhlenbeck(w, math.sqrt(w)), b=0.1 * w, k=w * w),
            [],
            paths=32,
            time=200.0 / w,
        )
        for w in (1.0, 10.0)
    )
    assert one.step == pytest.approx(10 * ten.step, rel=1e-12)
    assert one.time == pytest.approx(10 * ten.time, rel=1e-12)
    loads = [Bounded(mu=0.4, nu=1.7, sigma=0.0), White(s=0.3)]
    found, period = simulate(rates("x' = v; v' = -x - 0.1*v - xi1*x - xi2*v", loads), [], paths=32), 2 * math.pi / 1.7
    assert found.time / period == pytest.approx(round(found.time / period), rel=1e-12)
    assert period / found.step == pytest.approx(round(period / found.step), rel=1e-12)


@pytest.mark.slow
def test_chatter_is_the_same_in_every_unit_of_time():
    """A mass that a second one presses to a wall: in units of 1 µs the stiffness is 10¹² times larger."""
    text = "q' = v; v' = -k*q - d*v - 1.5*k*y - k*xi*y; y' = w; w' = -2*k*y - d*w - k*xi*q"
    wall = [{"at": "q = 0", "restitution": 0.5}]
    one, *others = (
        unit * simulate(
            rates(text, Telegraph(0.5, 0.7 / unit), wall, k=unit**-2, d=0.2 / unit), [], paths=32, time=160 * unit
        ).lyapunov_exponent
        for unit in (1.0, 1e-6, 1e5)
    )  # fmt: skip
    assert others == pytest.approx([one, one], rel=1e-9)


def test_the_largest_good_step_is_named_and_good():
    with pytest.raises(ValueError, match="must be > 0 and <= ") as refused:
        simulate(paper(), [1.0], step=0.9)
    largest = float(str(refused.value).split("<= ")[1].split(";")[0])
    found = simulate(paper(), [1.0], step=0.999 * largest, paths=64, time=60.0)
    assert found.step == 0.999 * largest
    tiny, none = (simulate(paper(c1=c1), [1.0], paths=32, time=60.0).step for c1 in (5e-324, 0.0))
    assert tiny == none


@dataclass(frozen=True)
class NoPaths(Noise):
    """Something that looks like a noise."""

    level: float = 1.0
    standard_deviation = correlation_time = 1.0

    def spectral_density(self, omega):
        return self.level


BENT = Problem(PlaneSystem([CoefficientMatrix(0, VELOCITY, np.sin)]), NOISE)
STOPPED = "q' = v; v' = -q - xi*q - 0.1*cos(t)*y; y' = w; w' = -y"


@pytest.mark.parametrize(
    ("problem", "change", "words"),
    [
        (paper(noise=NOISE), {"step": 1.0}, "too large for the correlation time"),
        (paper(omega=1e4, noise=NOISE), {"step": 1.0}, "too large for the frequency"),
        (paper(1.0, OrnsteinUhlenbeck(1.0, 50.0)), {"step": 1.0}, "too large for the strength of the noise"),
        (paper(), {"step": -0.1}, "^step: got -0.1; must be > 0 and <= .*; make it positive"),
        (paper(), {"step": 0.0}, "make it positive"),
        *((paper(), {"step": step}, "^step must be a finite number, got") for step in (math.nan, "x", True, [0.1], 1j)),
        (paper(), {"time": 3.0}, "two transients"),
        *((paper(), {"time": time}, "^time must be a finite number, got") for time in (math.nan, math.inf, "x", False)),
        (paper(), {"time": 1e308}, "a million transients; reduce it"),
        (paper(), {"time": 10**5000}, "^time must be a finite number, got a number too long to show"),
        (paper(), {"paths": 10}, "32 to"),
        (paper(), {"seed": -1}, "seed = -1"),
        (paper(), {"seed": 1.5}, "seed = 1.5"),
        (paper(), {"estimator": "exact"}, "direct, population"),
        (paper(), {"paths": "64"}, "paths = '64', seed = 0; must be one of .* a whole number from 32 to"),
        *(
            (paper(), {"p": p}, "^p must be a finite number or a list of finite numbers, got")
            for p in ([math.nan], ["2"], [[1.0], [1.0, 2.0]], np.ma.array([1.0, 2.0], mask=[False, True]))
        ),
        (paper(noise=NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.8)), {}, "must be finite"),
        (paper(noise=NonGaussianNoise(D0=0.5, tau0=1e-7, r0=0.9)), {}, "takes"),
        (
            paper(noise=NoPaths()),
            {},
            "is for noise that states a step of its paths, but this is a NoPaths",
        ),
        (
            BENT,
            {},
            r"is for terms that are a \+ b\*xi under a NonGaussianNoise, but one has g = sin\(ξ\); use the",
        ),
        (
            rates(STOPPED, Telegraph(0.5, 0.7), [{"at": "q = 0", "restitution": 0.5}]),
            {},
            "for one noise, without periodic terms",
        ),
    ],
)
def test_problems_and_settings_that_are_not_simulated_are_refused(problem, change, words):
    with pytest.raises((FpsolveError, ValueError), match=words):
        simulate(problem, **{"p": [1.0]} | change)


@pytest.mark.slow
def test_a_function_of_a_chain_is_simulated():
    """g(ξ) = ξ³ of states ±½ is ξ/4."""
    loads = CoefficientMatrix(1, TURN, lambda xi: xi**3), CoefficientMatrix(1, (0.25 * np.array(TURN)).tolist(), itself)
    one, other = (
        simulate(
            Problem(LinearSystem([CoefficientMatrix(0, NEGATIVE), load]), Telegraph(0.5, 1.0)),
            [1.0],
            paths=64,
            time=60.0,
        )
        for load in loads
    )
    assert one.lyapunov_exponent == pytest.approx(other.lyapunov_exponent, rel=1e-12)


def at_stop(noise, restitution: float) -> Problem:
    """A mass at a wall that drives another one, which is damped more."""
    text = "q' = v; v' = -q - 0.1*v - xi*q; y' = w; w' = -3*y - 1.5*w - xi*y + 0.4*q"
    return rates(text, noise, [{"at": "q = 0", "restitution": restitution}])


@pytest.mark.parametrize(
    ("noise", "restitution", "paths"),
    sampled(
        (OrnsteinUhlenbeck(1.0, 0.5), 0.6, 128),
        (OrnsteinUhlenbeck(1.0, 0.5), 0.6, 2048),
        (White(s=0.4), 1.0, 512),
        keep=0,
    ),
)
def test_a_mass_at_a_wall_that_nothing_drives_has_the_exponents_of_an_oscillator(noise, restitution, paths):
    """λ, Λ(½) and the impacts N = ∂λ/∂ln R of the oscillator with a wall by elements; for R = 1 λ, without one."""
    exact = ExponentSolver(spring(noise, restitution=restitution))
    p = [0.5] if restitution < 1 and paths > 500 else []
    found = simulate(at_stop(noise, restitution), p, paths=paths, time=100.0, seed=4, estimator="direct")
    pairs = [(exact.lyapunov_exponent().value, found.lyapunov_exponent, found.lyapunov_exponent_error)]
    if restitution < 1:
        pairs.append((impact_rate(exact).value, *found.wall["fast_impact_rate"]))
        pairs += [(exact.pair(each.p).value, each.value, each.standard_error) for each in found.estimates]
    for known, value, error in pairs:
        is_near(known, value, error, 1e-2)


WEAK = {"omega": 1.3, "restitution": 0.95, "c1": 0.5, "c2": 0.4, "c3": 0.2, "epsilon": 0.15}
WEAK_NOISE = NonGaussianNoise(D0=0.3, tau0=0.5, r0=0.9).ou_reduction()


@pytest.fixture(scope="module")
def weak():
    """A response to weak noise, and λ, s² = Λ″(0) and κ of the averaged amplitude: d ln A = (λ − κA²) dt + s dW."""
    problem = paper(noise=WEAK_NOISE, **WEAK)
    solver, motion = ExponentSolver(problem), problem.system
    exponent, square = solver.lyapunov_exponent().value, solver.variance_rate().value
    kappa = motion.epsilon**2 * (motion.c2 + 3 * motion.omega**2 * motion.c3) / 8
    step = simulate(problem, [], paths=32, time=20.0).step
    found = simulated_response(problem, exponent, square, paths=512, time=100.0, step=step, seed=1)
    return motion, found, (exponent, square, kappa)


@pytest.mark.slow
def test_the_amplitude_of_a_weak_response_has_the_law_of_averaging(weak):
    """A² has a Gamma law with the shape λ/s² and the mean λ/κ, up to ε²."""
    from scipy.stats import gamma

    motion, response, (exponent, square, kappa) = weak
    value = response.means["x_squared"][0] + response.means["v_squared"][0] / motion.omega**2
    error = 2 * response.means["energy"][1] / motion.omega**2
    assert value == pytest.approx(exponent / kappa, abs=4 * error + motion.epsilon**2 * value)
    theory = gamma(exponent / square, scale=square / kappa)
    expected = np.diff(theory.cdf(response.amplitude_edges**2)) / np.diff(response.amplitude_edges)
    tolerance = 5 * response.amplitude_error + 2 * motion.epsilon**2 * expected.max()
    assert np.all(np.abs(response.amplitude_density - expected) <= tolerance)


@pytest.mark.slow
def test_histograms_and_means_of_a_response_fit_together(weak):
    """Impacts come twice a turn, and the energy is that of x and v."""
    motion, response, _ = weak
    dx, dv = np.diff(response.x_edges)[0], np.diff(response.v_edges)[0]
    assert response.outside < 1e-3
    assert response.density.sum() * dx * dv == pytest.approx(1 - response.outside, rel=1e-12)
    radial = np.sum(response.amplitude_density * np.diff(response.amplitude_edges))
    assert radial == pytest.approx(1 - response.outside, rel=1e-12)
    middle = (response.x_edges[1:] + response.x_edges[:-1]) / 2
    mean = {name: value for name, (value, _) in response.means.items()}
    assert np.sum(response.density * middle[:, None]) * dx * dv == pytest.approx(mean["x"], rel=2e-3)
    assert mean["energy"] == pytest.approx((mean["v_squared"] + motion.omega**2 * mean["x_squared"]) / 2, rel=1e-12)
    assert response.impact_rate == pytest.approx(motion.omega / math.pi, rel=0.02)


CUBIC = {"x": "v", "v": "-2*x + 0.2*v - 0.3*x**3 - 0.2*x**2*v - xi*x"}
OWN = {"x": "v", "v": "-omega**2*x + epsilon**2*v*(c1 - c2*x**2 - c3*v**2) + epsilon*xi*v"}
FORCED = OrnsteinUhlenbeck(alpha=2.0, sigma=1.5)


def responding(rates_of: dict[str, str], noise, names: str = "xv", walls=(), seed: int = 1, **parameters: float):
    """The response of rates with either order of the variables."""
    system = PlaneSystem.of_equations(tuple(names), [rates_of[each] for each in names], parameters, walls=walls)
    settings = {"exponent": 0.2, "variance_rate": 0.1, "paths": 32, "time": 100.0, "step": 0.05, "seed": seed}
    return simulated_response(Problem(system, noise), **settings)


@pytest.mark.slow
def test_densities_without_a_wall_are_over_both_variables_in_either_order():
    """On both sides of 0 there is the same; the names are those of the variables."""
    sides = [responding(CUBIC, FORCED, names) for names in ("xv", "vx")]
    for response, (first, second) in zip(sides, ("xv", "vx"), strict=True):
        assert [*response.means] == [f"{first}_squared", f"{second}_squared", "amplitude"]
        assert response.impact_rate is None
        assert (response.x_edges[0], response.v_edges[0]) == (-response.x_edges[-1], -response.v_edges[-1])
        np.testing.assert_array_equal(response.density, response.density[::-1, ::-1])
        cell = np.diff(response.x_edges)[0] * np.diff(response.v_edges)[0]
        middle = (response.x_edges[1:] + response.x_edges[:-1]) / 2
        square = np.sum(response.density * middle[:, None] ** 2) * cell
        assert square == pytest.approx(response.means[f"{first}_squared"][0], rel=5e-3)
        assert response.to_xarray().density.dims == (first, second)
    (one, _), (other, error) = (response.means["x_squared"] for response in sides)
    assert one == pytest.approx(other, abs=4 * math.sqrt(2) * error)


@pytest.mark.slow
@pytest.mark.parametrize("names", ["xv", "vx"])
def test_equations_of_an_oscillator_respond_as_the_oscillator_does(names):
    """With its wall, step by step, whatever the number of processors; another seed gives another response."""
    numbers = {"omega": 1.3, "epsilon": 0.5, "c1": 0.4, "c2": 0.5, "c3": 0.2}
    factor = VibroImpactOscillator(**numbers, restitution=0.9).log_impact_factor
    walls = [{"at": "x = 0", "restitution": math.exp(factor)}]
    written, other = (responding(OWN, WEAK_NOISE, names, walls, seed, **numbers) for seed in (1, 2))
    settings = {"exponent": 0.2, "variance_rate": 0.1, "paths": 32, "time": 100.0, "step": 0.05, "seed": 1}
    own = simulated_response(paper(noise=WEAK_NOISE, **{**numbers, "restitution": 0.9, "impact": "delta"}), **settings)
    for name in ("x", "x_squared", "v_squared"):
        assert written.means[name] == pytest.approx(own.means[name], rel=1e-6)
        assert written.means[name] != other.means[name]


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (rates("x' = v; v' = -x + 0.2*v - 0.1*x**3 - xi*x", FORCED), "hardly limit large amplitudes"),
        (spring(NOISE), "nothing limits the amplitude"),
        (paper(c2=0.3, noise=Telegraph(0.5, 1.0)), "no white noise, impulses or chains"),
        (paper(c2=0.3, noise=NoPaths()), "but this is a NoPaths"),
    ],
)
def test_problems_without_a_simulated_response_are_refused(problem, words):
    with pytest.raises(FpsolveError, match=words):
        simulated_response(problem, 0.1, 0.1, paths=32, time=1.0, step=0.1, seed=0)


CODE = """
import fpsolve
found = fpsolve.simulate(fpsolve.Problem(fpsolve.VibroImpactOscillator(1.0, 0.8, 0.1, 0.1), fpsolve.OrnsteinUhlenbeck(
    1.0, 1.0)), [], paths=32, time=40.0)
print(fpsolve.__file__, found.lyapunov_exponent)
"""


@pytest.mark.slow
def test_without_a_place_for_a_cache_the_loops_are_compiled_all_the_same(tmp_path):
    """A package, a home and a cache that nobody can write to, as in a container."""
    package, nowhere = tmp_path / "fpsolve", tmp_path / "file"
    shutil.copytree(Path(fpsolve.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for file in (nowhere, package / "simulation" / "__pycache__"):
        file.write_text("a file where a folder is sought", encoding="utf-8")
    folders = dict.fromkeys(["HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "LOCALAPPDATA"], str(nowhere / "below"))
    variables = os.environ | folders | {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", CODE], env=variables, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    file, value = done.stdout.split()
    assert Path(file).is_relative_to(package)
    same = paper(0.1, OrnsteinUhlenbeck(1.0, 1.0), impact="delta")
    assert float(value) == pytest.approx(simulate(same, [], paths=32, time=40.0).lyapunov_exponent, rel=1e-9)
