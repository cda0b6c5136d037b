"""Estimates by simulation: what they tell, refuse and keep, and which problems they reach."""

import math
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator, simulate
from fpsolve.simulation import batches, estimators
from fpsolve.simulation.setup import largest_step, transient
from tests.conftest import FIG1, UNIT_NOISE, sampled
from tests.simulation.problems import MODERATE, NOISE, REDUCED, STRONG, exact


@pytest.mark.slow
def test_slow_noise_carries_a_moment_in_two_places():
    """Λ(2) = 1.129 where the oscillator does not turn, 0.496 where it does: no population passes between them."""
    noise = NonGaussianNoise(D0=0.5, tau0=20.0, r0=1.0)
    found = simulate(Problem(STRONG, noise), [2.0], estimator="population", paths=8192, time=330.0, seed=1)
    estimate = found.estimates[0]
    assert estimate.value == pytest.approx(exact(STRONG, noise, [2.0])[0], abs=4 * estimate.standard_error)
    assert estimate.standard_error < 1e-3
    assert any("start in two places of the noise differ by 0.6" in text for text in found.warnings)


@pytest.mark.parametrize("paths", sampled(2048, 8192))
def test_variance_rate(paths):
    """Λ″(0) from the variance of ln‖x‖."""
    found = simulate(Problem(MODERATE, REDUCED), [], paths=paths, seed=2)
    reference = ExponentSolver(Problem(MODERATE, REDUCED)).variance_rate().value
    assert found.variance_rate == pytest.approx(reference, abs=4 * found.variance_rate_error + 0.02 * reference)


@pytest.mark.slow
def test_identity_without_impact():
    """Λ(−2) = −ε²c₁ + ε²σ²/(2α²) for Ornstein-Uhlenbeck noise and r = 1."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.2, epsilon=0.7)
    found = simulate(Problem(oscillator, UNIT_NOISE), [-2.0], estimator="population", paths=8192, seed=8).estimates[0]
    assert found.value == pytest.approx(0.49 * (0.5 - 0.2), abs=4 * found.standard_error)
    assert found.standard_error < 2e-3


def test_moment_of_order_zero():
    for estimator in ("direct", "population"):
        found = simulate(Problem(FIG1, REDUCED), [0.0], estimator=estimator, paths=320, time=40.0).estimates[0]
        assert abs(found.value) < 1e-12
        assert found.standard_error < 1e-12


def small(seed, estimator="direct", orders=(-1.0, 1.0)):
    return simulate(Problem(MODERATE, NOISE), list(orders), estimator=estimator, paths=640, time=60.0, seed=seed)


@pytest.mark.parametrize("estimator", sampled("direct", "population"))
def test_seed_decides_whatever_the_threads(monkeypatch, estimator):
    found = small(3, estimator)
    for threads in (1, 3):
        monkeypatch.setattr(batches, "processors", lambda threads=threads: threads)
        assert small(3, estimator) == found
    assert small(4, estimator) != found


@pytest.mark.slow
def test_one_run_serves_all_orders():
    """The direct estimate of one p does not depend on which others are asked for; nor does λ."""
    alone, together = small(3, orders=(1.0,)), small(3, orders=(-1.0, 1.0, 2.0))
    assert alone.estimates[0] == together.estimates[1]
    assert alone.lyapunov_exponent == together.lyapunov_exponent


@pytest.mark.slow
def test_memory_does_not_grow_with_time():
    def peak(time):
        tracemalloc.start()
        simulate(Problem(MODERATE, REDUCED), [1.0], paths=3200, time=time)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(30.0)
    assert peak(800.0) < 1.3 * peak(100.0)


@pytest.mark.parametrize("estimator", sampled("direct", "population"))
def test_an_interrupt_keeps_what_is_done(estimator):
    calls = []

    def progress():
        calls.append(1)
        if len(calls) == 50:
            raise KeyboardInterrupt

    found = simulate(
        Problem(MODERATE, REDUCED), [1.0], estimator=estimator, paths=4096, time=400.0, seed=1, progress=progress
    )
    whole = simulate(Problem(MODERATE, REDUCED), [1.0], estimator=estimator, paths=4096, time=400.0, seed=1)
    assert found.interrupted
    assert 100 < found.time < 300
    assert "stopped early" in found.warnings[-1]
    estimate = found.estimates[0]
    assert estimate.value == pytest.approx(exact(MODERATE, REDUCED, [1.0])[0], abs=5 * estimate.standard_error)
    assert not whole.interrupted
    assert whole.time > 1.3 * found.time


def test_an_interrupt_before_there_is_anything():
    def progress():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(Problem(MODERATE, REDUCED), [1.0], paths=64, time=20.0, progress=progress)


def test_drift_is_noticed(monkeypatch):
    """With windows far shorter than the correlation time the slope depends on the window, and a warning says so."""
    slow = OrnsteinUhlenbeck(alpha=0.05, sigma=0.1)
    monkeypatch.setattr(estimators, "transient", lambda *_: 2.0)
    monkeypatch.setattr(estimators, "obstacles", lambda *_, **__: {})
    found = simulate(Problem(MODERATE, slow), [1.0], paths=8192, time=16.0, seed=2)
    assert any("still drifts" in text for text in found.warnings)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"step": 1.0}, "too large for the correlation time"),
        ({"step": -0.1}, "^step: got -0.1; must be > 0 and <= .*; make it positive"),
        ({"step": 0.0}, "make it positive"),
        *(({"step": step}, "^step must be a finite number, got") for step in (math.nan, "x", True, [0.1], 1j)),
        ({"time": 3.0}, "two transients"),
        *(({"time": time}, "^time must be a finite number, got") for time in (math.nan, math.inf, "x", False)),
        ({"time": 1e308}, "a million transients; reduce it"),
        ({"time": 10**5000}, "^time must be a finite number, got a number too long to show"),
        ({"paths": 10}, "32 to"),
        ({"seed": -1}, "seed = -1"),
        ({"estimator": "exact"}, "direct, population"),
        ({"paths": "64"}, "paths = '64', seed = 0; must be one of .* a whole number from 32 to"),
        ({"seed": 1.5}, "seed = 1.5"),
        ({"p": [math.nan]}, "^p must be a finite number or a list of finite numbers, got"),
        ({"p": ["2"]}, "^p must be a finite number or a list of finite numbers, got"),
        ({"p": [[1.0], [1.0, 2.0]]}, "^p must be a finite number or a list of finite numbers, got"),
        ({"p": np.ma.array([1.0, 2.0], mask=[False, True])}, "p must be a finite number"),
        ({"problem": Problem(MODERATE, NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.8))}, "must be finite"),
    ],
)
def test_bad_settings_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        simulate(**({"problem": Problem(MODERATE, NOISE), "p": [1.0]} | change))


@pytest.mark.slow
def test_a_single_order_may_stand_without_a_list():
    settings = {"paths": 64, "time": 2 * transient(MODERATE, NOISE), "seed": 1}
    assert simulate(Problem(MODERATE, NOISE), 0.5, **settings) == simulate(Problem(MODERATE, NOISE), [0.5], **settings)


def test_damping_too_small_for_a_number_limits_no_step():
    tiny = replace(MODERATE, c1=5e-324)
    assert largest_step(tiny, NOISE) == largest_step(replace(MODERATE, c1=0.0), NOISE)


def test_the_largest_good_step_is_named_and_good():
    largest, _ = largest_step(MODERATE, NOISE)
    with pytest.raises(ValueError, match=f"<= {largest:.4g}"):
        simulate(Problem(MODERATE, NOISE), [1.0], step=1.01 * largest)
    found = simulate(Problem(MODERATE, NOISE), [1.0], step=largest, paths=64, time=2 * transient(MODERATE, NOISE))
    assert found.step == largest


def test_noise_that_is_too_fast_is_refused():
    with pytest.raises(ValueError, match="takes"):
        simulate(Problem(MODERATE, NonGaussianNoise(D0=0.5, tau0=1e-7, r0=0.9)), [1.0])


@pytest.mark.slow
def test_populations_are_taken_where_too_few_paths_carry_the_mean():
    """As either estimator alone finds it; each p has the one that its estimate names."""
    problem, calls = Problem(MODERATE, REDUCED), []
    how = {"paths": 4096, "time": 200.0, "seed": 1}
    found = simulate(problem, [1.0, 12.0], progress=lambda: calls.append(1), **how)
    alone = {name: simulate(problem, [1.0, 12.0], estimator=name, **how) for name in ("direct", "population")}
    assert alone["direct"].estimates[1].value is None
    assert found.estimates[0] == alone["direct"].estimates[0]
    assert found.estimates[1].estimator == "population"
    assert len(calls) == 100


def test_the_error_of_a_population_has_that_of_its_variance(rng):
    """Of growth in each slice as N(1, σ²), Λ = 1 + σ²/2: 400 times, with σ so large that the variance matters."""
    plan, sigma, off = SimpleNamespace(p=np.array([2.0]), length=1.0, estimator="population"), 2.0, []
    for _ in range(400):
        populations = []
        for d in rng.normal(1.0, sigma, (estimators.BATCHES, 64)):
            sums = d.sum(), d @ d, d[1:] @ d[:-1], d @ np.arange(d.size)
            tallies = np.array([(d.size, *sums, 1e6, d[0], d[-1])], estimators.TALLIES)
            populations.append(SimpleNamespace(tallies=tallies, expected=0.0))
        ((found,), _) = estimators.population_estimates(plan, populations)
        off.append((found.value - 1 - sigma**2 / 2) / found.standard_error)
    assert 0.8 < np.mean(np.square(off)) < 1.25
