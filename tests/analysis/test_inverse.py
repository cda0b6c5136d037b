"""Designs against closed forms, a scan, and the conditions of a constrained minimum."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    stability_index,
)
from fpsolve.analysis import Axis, design
from fpsolve.analysis.target import target_of
from fpsolve.messages import Code
from fpsolve.model import SineWiener, Telegraph
from tests.conftest import sampled


def uniform(a=-0.3, sigma=0.5, alpha=0.8):
    """ẋ = (J + a + ξ) x: the phase turns uniformly, and Λ(p) = pa + p² S(0)/2 with S(0) = σ²/α²."""
    system = PlaneSystem.of_equations(("x", "y"), ("a*x + y + xi*x", "-x + a*y + xi*y"), {"a": a})
    return Problem(system, OrnsteinUhlenbeck(alpha=alpha, sigma=sigma))


@pytest.mark.parametrize(
    ("target", "axis", "value"),
    [
        ("stability_index = 1", Axis("system.a", -2.0, 0.0), -0.5 * 0.5**2 / 0.8**2),
        ("stability_index = 3", Axis("noise.sigma", 0.01, 4.0), math.sqrt(0.2) * 0.8),
        ("stability_index = 3", Axis("noise.alpha", 0.05, 40.0, "log"), 0.5 / math.sqrt(0.2)),
        ("stability_index = -0.5", Axis("system.a", -2.0, 2.0), 0.25 * 0.5**2 / 0.8**2),
        ("moment(2) = 0", Axis("noise.sigma", 0.01, 4.0), math.sqrt(0.3) * 0.8),
        ("moment(-1.5) = 0.7", Axis("system.a", -2.0, 2.0), -(0.7 - 1.125 * 0.5**2 / 0.8**2) / 1.5),
        ("lyapunov_exponent = 0.25", Axis("system.a", -2.0, 2.0), 0.25),
        ("stability_index = 0", Axis("system.a", -2.0, 1.0), 0.0),
    ],
)
def test_one_parameter_has_the_value_of_the_closed_form(target, axis, value):
    found = design(uniform(), target, axis)
    [estimate] = found.values.values()
    assert estimate.value == pytest.approx(value, abs=1e-9)
    assert abs(estimate.value - value) <= 10 * estimate.error_estimate + 1e-12
    assert found.found.value == pytest.approx(found.target.value, abs=1e-9)
    assert found.problem.values[axis.key] == estimate.value
    assert found.solves <= 12


def test_the_oscillator_of_the_guide_takes_few_solves():
    oscillator = VibroImpactOscillator(epsilon=0.1, omega=1.0, restitution=0.8, c1=0.1, impact="delta")
    problem = Problem(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95))
    found = design(problem, "stability_index = 1", Axis("oscillator.c1", -2.0, 0.0))
    assert found.values["oscillator.c1"].value == pytest.approx(-0.65415415855, abs=5e-12)
    assert found.solves <= 8
    assert stability_index(found.problem).value == pytest.approx(1.0, abs=1e-8)


@pytest.mark.slow
def test_what_turns_back_is_found_and_what_it_does_not_reach_is_told():
    """Λ(2) = 2a + 2σ²/α² with a = b² has its least value at b = 0, within the range."""
    system = PlaneSystem.of_equations(("x", "y"), ("b**2*x + y + xi*x", "-x + b**2*y + xi*y"), {"b": 0.9})
    problem, least = Problem(system, OrnsteinUhlenbeck(alpha=1.0, sigma=0.4)), 2 * 0.4**2
    frame = Axis("system.b", -0.93, 1.0)
    close = design(problem, f"moment(2) = {least + 2e-4}", frame)  # between two points of a scan
    assert abs(close.values["system.b"].value) == pytest.approx(1e-2, rel=1e-6)
    beyond = design(problem, f"moment(2) = {least - 1e-3}", frame)
    assert not beyond
    assert beyond.reason.code is Code.UNREACHED
    assert beyond.reason.data["least"] == pytest.approx(least, abs=1e-6)
    assert beyond.reason.data["most"] == pytest.approx(least + 2.0, abs=1e-9)


def test_a_stability_index_out_of_reach_is_on_one_side():
    found = design(uniform(), "stability_index = 9", Axis("system.a", -1.0, 0.0))  # -2a/S(0) is 5.12 at most
    assert found.reason.code is Code.UNREACHED
    assert found.reason.data["side"] == "δ_p < 9"
    assert "nearest at system.a = -1" in found.reason


@pytest.mark.parametrize("a", [-0.3, -0.05])
def test_two_parameters_are_the_nearest_point(a):
    """δ_p = 1 is a = −σ²/(2α²), along which the distance is minimised."""
    problem, alpha = uniform(a=a), 0.8
    frame = [Axis("system.a", -2.0, 2.0), Axis("noise.sigma", 0.01, 4.0)]
    found = design(problem, "stability_index = 1", frame)

    def distance(sigma):
        return math.hypot((-(sigma**2) / (2 * alpha**2) - a) / a, (sigma - 0.5) / 0.5)

    best = minimize_scalar(distance, bounds=(0.01, 4.0), method="bounded", options={"xatol": 1e-10})
    assert found.distance == pytest.approx(best.fun, rel=1e-9)
    assert found.values["noise.sigma"].value == pytest.approx(best.x, rel=1e-6)
    assert found.found.value == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
def test_units_and_ends_of_ranges_count():
    """As a costs nothing it alone moves, up to the end of its range; then σ does the rest."""
    frame = [Axis("system.a", -0.31, 0.0), Axis("noise.sigma", 0.3, 2.0)]
    found = design(uniform(), "stability_index = 1", frame, units={"system.a": 1e3, "noise.sigma": 1.0})
    assert found.values["system.a"].value == pytest.approx(-0.5 * 0.5**2 / 0.8**2, abs=1e-5)
    held = [Axis("system.a", -0.31, -0.29), Axis("noise.sigma", 0.3, 2.0)]
    found = design(uniform(), "stability_index = 1", held, units={"system.a": 1e3, "noise.sigma": 1.0})
    assert found.values["system.a"].value == -0.29
    assert found.values["noise.sigma"].value == pytest.approx(0.8 * math.sqrt(0.58), abs=1e-9)
    assert not design(uniform(), "stability_index = 9", held)


def test_several_parameters_obey_the_conditions_of_lagrange():
    """x + μ ∇F = 0 where a parameter is free, with ∇F by differences of λ; and no point of F = 0 close by is nearer."""
    oscillator = VibroImpactOscillator(epsilon=0.1, omega=1.0, restitution=0.8, c1=0.1, impact="delta")
    problem = Problem(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95))
    keys = "oscillator.restitution", "noise.tau0", "oscillator.omega"
    frame = [Axis(key, *ends) for key, ends in zip(keys, ((0.3, 1.0), (0.05, 5.0), (0.5, 2.0)), strict=True)]
    found = design(problem, "lyapunov_exponent = -0.001", frame)
    start = np.array([problem.values[key] for key in keys])
    x = np.array([found.values[key].value for key in keys]) / start - 1
    assert found.distance == pytest.approx(float(np.linalg.norm(x)), rel=1e-12)

    def exponent(x):
        at = dict(zip(keys, ((1 + x) * start).tolist(), strict=True))
        return lyapunov_exponent(problem.at(at), rtol=1e-10).value + 0.001

    assert abs(exponent(x)) < 1e-11
    slope = np.array([exponent(x + 1e-4 * step) - exponent(x - 1e-4 * step) for step in np.eye(3)]) / 2e-4
    assert x - (x @ slope) / (slope @ slope) * slope == pytest.approx(np.zeros(3), abs=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(5):
        other = x + 0.02 * rng.standard_normal(3)
        for _ in range(3):
            other = other - exponent(other) / (slope @ slope) * slope
        assert abs(exponent(other)) < 1e-6
        assert np.linalg.norm(other) > found.distance - 1e-6


QUANTITIES = (
    lambda problem: lyapunov_exponent(problem).value,
    lambda problem: ExponentSolver(problem).pair(2.0).value,
    lambda problem: getattr(stability_index(problem), "value", math.nan),
)


def drawn(seed):
    """A system of the plane, what is wanted of it, and by which parameter; the wanted value may be out of reach."""
    rng = np.random.default_rng(seed)
    noises = (
        OrnsteinUhlenbeck(alpha=rng.uniform(0.5, 2), sigma=rng.uniform(0.3, 1)),
        NonGaussianNoise(D0=rng.uniform(0.1, 0.5), tau0=rng.uniform(0.2, 1), r0=rng.uniform(0.6, 0.98)),
        SineWiener(amplitude=rng.uniform(0.2, 0.6), sigma=rng.uniform(0.5, 1.5)),
        Telegraph(a=rng.uniform(0.2, 0.6), k=rng.uniform(0.5, 2)),
    )
    if seed % 2:
        sizes = {"epsilon": rng.uniform(0.1, 0.6), "c1": rng.uniform(-0.5, 0.5), "restitution": rng.uniform(0.7, 0.98)}
        system = VibroImpactOscillator(omega=rng.uniform(0.7, 2), **sizes)
    else:
        named = {"zeta": rng.uniform(0.02, 0.3), "k": rng.uniform(0.5, 2.0)}
        system = PlaneSystem.of_equations(("x", "v"), ("v", "-k*x - 2*zeta*v - xi*x"), named)
    problem = Problem(system, noises[seed % 4 if seed % 2 else rng.integers(4)])
    keys = [key for key in problem.differentiable if key not in ("oscillator.epsilon",)]
    key, kind = str(rng.choice(keys)), seed % 3
    value = float(problem.values[key])
    axis = Axis(key, *sorted((0.6 * value, 1.5 * value if key not in ("oscillator.restitution", "noise.r0") else 1.0)))
    ends = [QUANTITIES[kind](problem.at({key: end})) for end in (axis.start, axis.stop)]
    share = rng.uniform(-0.15, 1.1)  # of the way from one end to the other
    wanted = ends[0] + share * (ends[1] - ends[0]) if all(map(np.isfinite, ends)) else rng.uniform(-2, 3)
    target = f"{('lyapunov_exponent', 'moment(2)', 'stability_index')[kind]} = {wanted:.6g}"
    return problem, target, axis


def measured(problem, target):
    """λ or Λ(p), or Λ(p)/p at the wanted δ_p, by a solver of its own, less what is wanted."""
    wanted = target_of(target)
    if wanted.kind == "lyapunov_exponent":
        return lyapunov_exponent(problem, rtol=1e-10).value - wanted.value
    value = ExponentSolver(problem, rtol=1e-10).pair(wanted.order).value
    return value / wanted.order if wanted.kind == "stability_index" else value - wanted.value


@pytest.mark.parametrize("seed", sampled(*range(5), keep=1))
def test_random_designs_are_met_or_a_scan_shows_that_they_cannot_be(seed):
    problem, target, axis = drawn(seed)
    found = design(problem, target, axis)
    if found:
        assert abs(measured(found.problem, target)) <= 1e-9
        return
    assert found.reason.code is Code.UNREACHED
    signs = {measured(problem.at({axis.key: float(at)}), target) > 0 for at in np.linspace(axis.start, axis.stop, 24)}
    assert len(signs) == 1


def test_more_than_two_variables():
    """All of three variables grow by the same noise, two of them faster: Λ(p) = pa + p² S(0)/2."""
    drift = ("a*x + y + xi*x", "-x + a*y + xi*y", "(a - 1)*z + xi*z")
    system = PlaneSystem.of_equations(("x", "y", "z"), drift, {"a": -0.3})
    found = design(
        Problem(system, OrnsteinUhlenbeck(alpha=0.8, sigma=0.5)), "moment(2) = 0", Axis("system.a", -1.0, 0.0)
    )
    assert found.values["system.a"].value == pytest.approx(-(0.5**2) / 0.8**2, abs=1e-8)


def test_a_phase_that_stays_on_a_ray():
    """Λ(2) = 2a + 2S(0) is that of x, as y has −2 + 2S(0)."""
    system = PlaneSystem.of_equations(("x", "y"), ("a*x + xi*x", "0.3*x - y + xi*y"), {"a": 0.1})
    problem = Problem(system, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0))
    found = design(problem, "moment(2) = 1", Axis("system.a", -1.0, 1.0))
    assert found.values["system.a"].value == pytest.approx(-0.5, abs=1e-9)


@pytest.mark.parametrize(
    "text", ["", "moment = 2", "moment(0) = 1", "lambda = 0", "stability_index == 1", "moment(2) = 1e999", 3]
)
def test_a_target_that_is_none_is_refused(text):
    with pytest.raises(ValueError, match='must be "lyapunov_exponent'):
        target_of(text)


@pytest.mark.parametrize(
    ("by", "said"),
    [
        ("system.b", "must be one of system.a, noise.alpha, noise.sigma"),
        ([], "must be 1 to 6"),
        (["system.a", "system.a"], "twice"),
        (Axis("noise.sigma", -1.0, 1.0), "noise.sigma with start = -1"),
    ],
)
def test_parameters_that_are_none_are_refused(by, said):
    with pytest.raises(ValueError, match=said):
        design(uniform(), "moment(2) = 0", by)
    with pytest.raises(ValueError, match="leaves its range open"):
        design(uniform(a=0.0), "moment(2) = 0", "system.a")
    with pytest.raises(ValueError, match="no parameter of the design"):
        design(uniform(), "moment(2) = 0", "system.a", units={"noise.sigma": 1.0})


def test_a_range_beyond_which_there_is_no_moment():
    """For r₀ > 1 there is no Λ(2), where the first step leads: the nearest point is that of a narrower range."""
    system = VibroImpactOscillator(epsilon=0.3, omega=1.0, restitution=0.9, c1=0.1)
    problem = Problem(system, NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9))
    for other in (Axis("noise.tau0", 0.3, 0.8), Axis("oscillator.c1", -0.5, 0.5)):
        wide, narrow = (
            design(problem, "moment(2) = 0.0708", [Axis("noise.r0", 0.5, end), other]) for end in (1.3, 1.0)
        )
        assert wide.distance == pytest.approx(narrow.distance, rel=1e-7)
        assert wide.solves <= 30
