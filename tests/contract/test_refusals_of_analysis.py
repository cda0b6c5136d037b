"""What calls of analysis and of stationary responses refuse, in the words that they say."""

import math

import pytest

from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    boundary,
    design,
    stationary_density,
    stationary_response,
)
from fpsolve.analysis import Axis, excursion, latin_hypercube, laws_of
from fpsolve.model import Bounded, CoefficientMatrix, CubicTerms, Jump, MarkovChain, PlaneSystem, Telegraph, White
from tests.kit import itself, rates

NOISE = OrnsteinUhlenbeck(alpha=2.0, sigma=1.5)
OSCILLATOR = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1}
CHAIN = MarkovChain(states=(-1.0, 1.0), rates=((-1.0, 1.0), (1.0, -1.0)))
OMEGA, C1 = Axis("oscillator.omega", 0.3, 4.0), Axis("oscillator.c1", -1.2, 0.8)


def oscillator(noise=NOISE, **values):
    return Problem(VibroImpactOscillator(**{**OSCILLATOR, **values}), noise)


def uniform(a=-0.3):
    return rates("x' = a*x + y + xi*x; y' = -x + a*y + xi*y", OrnsteinUhlenbeck(alpha=0.8, sigma=0.5), a=a)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": 2.0, "stop": 1.0}, "start = 2.0, stop = 1.0; must be start < stop, with .*; exchange the two"),
        ({"start": 1.0, "stop": 1.0}, "must be start < stop"),
        (
            {"start": 0.0, "stop": 1.0, "scale": "log"},
            'start: got 0.0; must be > 0 where scale = "log"; use a positive start, or scale = "linear"',
        ),
        (
            {"start": 0.0, "stop": 1.0, "at": (2.0,)},
            "at.0.: got 2.0; must be from start = 0.0 to stop = 1.0; remove it",
        ),
        ({"start": 0.0, "stop": math.inf}, "finite"),
        ({"start": math.nan, "stop": 1.0}, "finite"),
        ({"start": "0", "stop": 1.0}, "finite number"),
        ({"start": 0.0, "stop": 1.0, "scale": "cubic"}, 'must be one of "linear", "log"'),
        ({"start": 0.0, "stop": 1.0, "steps": 3}, "steps"),
    ],
)
def test_axes_that_are_none(change, words):
    with pytest.raises(ValueError, match=words):
        Axis("noise.D0", **change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x": Axis("oscillator.mass", 0.0, 1.0)}, 'x.key: got "oscillator.mass";.* must be one of .*epsilon'),
        ({"x": Axis("oscillator.c2", 0.0, 1.0)}, 'got "oscillator.c2";.* c2 and c3 are not in the linear theory'),
        ({"problem": oscillator(CHAIN), "x": Axis("noise.D0", 0.1, 1.0)}, 'got "noise.D0"; .*noise.rate_2_1; choose'),
        ({"x": C1}, 'got "oscillator.c1" for both axes; .*choose another for one of them'),
        ({"x": "oscillator.omega"}, 'x: got "oscillator.omega" as an axis; must be an Axis'),
        ({"x": Axis("oscillator.omega", 0.0, 1.0)}, "x.start: got 0.0; oscillator.omega must be .* >= 1e-15"),
        ({"x": Axis("oscillator.restitution", 0.5, 1.5)}, "x.stop: got 1.5; .* <= 1;"),
        *(
            ({"target": target}, "the order of a moment not 0")
            for target in ("lambda", "lyapunov_exponent", "moment(0) = 0", "moment(2) = x", 2.0, True, None)
        ),
        ({"step": 0.0}, "got step = 0; must be above 1e-05 and up to 0.1 sides of the frame"),
        ({"step": -0.1}, "got step = -0.1"),
        ({"step": 0.5}, "got step = 0.5"),
        ({"step": math.nan}, "step must be a finite number"),
        ({"nodes": 1}, "got nodes = 1; must be a whole number from 2"),
        ({"nodes": 2.5}, "got nodes = 2.5"),
    ],
)
def test_lines_that_are_none(change, words):
    call = {"problem": oscillator(), "target": "lyapunov_exponent = 0", "x": OMEGA, "y": C1, **change}
    with pytest.raises(ValueError, match=words) as caught:
        boundary(**call)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("target", "by", "more", "words"),
    [
        *(
            (target, "system.a", {}, 'must be "lyapunov_exponent')
            for target in (
                "",
                "moment = 2",
                "moment(0) = 1",
                "lambda = 0",
                "stability_index == 1",
                "moment(2) = 1e999",
                3,
            )
        ),
        ("moment(2) = 0", "system.b", {}, "must be one of system.a, noise.alpha, noise.sigma"),
        ("moment(2) = 0", [], {}, "must be 1 to 6"),
        ("moment(2) = 0", ["system.a", "system.a"], {}, "twice"),
        ("moment(2) = 0", Axis("noise.sigma", -1.0, 1.0), {}, "got -1.0; noise.sigma must be"),
        ("moment(2) = 0", "system.a", {"problem": uniform(0.0)}, "leaves its range open"),
    ],
)
def test_designs_that_are_none(target, by, more, words):
    with pytest.raises(ValueError, match=words):
        design(**{"problem": uniform(), "target": target, "by": by, **more})


@pytest.mark.parametrize("value", [0, -0.1, True, "x", {"sd": 0}, {"s": 1.0}, math.inf, math.nan, None])
def test_deviations_that_are_none(value):
    with pytest.raises(ValueError, match="must be a share of the value"):
        laws_of(uniform(), {"system.a": value})


def spring(noise):
    return rates("x' = v; v' = -x - 0.16*v - xi*x", noise)


PAIR = ExponentSolver(oscillator()).pair
CALLS = {
    "must be one of system.a": lambda: laws_of(uniform(), {"system.b": 0.1}),
    "is 0, and so is a share": lambda: laws_of(uniform(0.0), {"system.a": 0.1}),
    "must be a whole number from 2": lambda: latin_hypercube(laws_of(uniform(), {"system.a": 0.1}), 1),
    "at p = 0, but the pair has p = 2": lambda: stationary_density(PAIR(2.0)),
    "one of the states, -0.8, 0.8": lambda: excursion(spring(Telegraph(a=0.8, k=1.0)), xi=0.7),
    "white noise has no value": lambda: excursion(spring(White(s=0.5)), xi=0.0),
    "does not tell how it goes on": lambda: excursion(spring(Bounded(mu=0.5, nu=1.0, sigma=0.3)), xi=0.1),
    "between -0.5 and 0.5": lambda: excursion(spring(Bounded(mu=0.5, nu=0.0, sigma=0.3)), xi=0.6),
    "phi must be a finite": lambda: excursion(spring(Telegraph(a=0.8, k=1.0)), phi=math.nan),
    "phi must be": lambda: excursion(spring(Telegraph(a=0.8, k=1.0)), phi="first"),
    "level = 1": lambda: excursion(uniform()).bounds(1.0),
    "got level": lambda: excursion(uniform()).bounds([2.0, 0.5]),
    "level must be|level": lambda: excursion(uniform()).bounds(math.nan),
}


@pytest.mark.parametrize("words", CALLS)
def test_calls_of_analysis_that_have_no_answer(words):
    with pytest.raises(ValueError, match=words):
        CALLS[words]()


def cubic(force, noise=NOISE, first="v", names="xv", **parameters):
    return rates(f"{names[0]}' = {first}; {names[1]}' = {force}", noise, **parameters)


SMOOTH = {"epsilon": 0.5, "restitution": 1.0, "c1": 0.4, "c2": 0.5, "c3": 0.2}


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (cubic("-x + 0.1*v - k*x**3 - xi*x", k=0.5), "hardly limit large amplitudes"),
        (cubic("-x + 0.1*v + k*x**3 - v**3 - xi*x", k=1e-3), "hardly limit large amplitudes"),  # softening
        (cubic("-x + 0.1*v + d*v**3 - xi*x", d=0.1), "hardly limit large amplitudes"),
        (cubic("-x - v - d*v**3 - xi*x", d=0.1), "comes to rest"),
        (cubic("-x + 0.1*v - d*v**3 - xi*x", d=0.0), "nothing limits the amplitude"),
        (cubic("-y + xi*y - y**3", first="x + xi*x - x**3", names="xy"), "the phase never leaves φ = 0"),
        (cubic("-xi*y - y**3", first="xi*x - x**3", names="xy"), "never leaves|hardly limit"),
        (cubic("-xi*y - y**3", first="xi*x - 0.1*x**2*y", names="xy"), "never leaves|hardly limit"),
        (oscillator(**{**SMOOTH, "c2": 0.0, "c3": 0.0}), "nothing limits"),
        (oscillator(OrnsteinUhlenbeck(2.0, 0.3), **{**SMOOTH, "c1": -0.4}), "comes to rest"),
        (oscillator(NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.1), **SMOOTH), "algebraic tails"),
    ],
)
def test_systems_without_a_stationary_response(problem, words):
    with pytest.raises(FpsolveError, match=words):
        stationary_response(problem, rtol=0.1)


@pytest.mark.parametrize("phases", [(0.0, math.pi / 2), (0.0,)])
def test_walls_that_a_response_is_not_for(phases):
    """Two of them, and one that the cubic terms move the phase across: v̇ = −x + 0.1 v − x³ − x²v − ξv."""
    terms = [CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.1))), CoefficientMatrix(1, ((0, 0), (0, -1.0)), itself)]
    cubic, jumps = CubicTerms(((0.0, 0.0, 0.0, 0.0), (-1.0, -1.0, 0.0, 0.0))), [Jump(phase, -0.1) for phase in phases]
    with pytest.raises(FpsolveError, match="There may be one wall"):
        stationary_response(Problem(PlaneSystem(terms, jumps, cubic=cubic), NOISE), rtol=0.1)
