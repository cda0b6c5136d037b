"""Estimates by simulation against the finite elements, and whether their standard errors mean what they say."""

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from fpsolve.errors import NoSuchExponent
from fpsolve.exponent.moments import moment_lyapunov
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.noise import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model.problem import Problem
from fpsolve.model.vibro_impact import VibroImpactOscillator
from fpsolve.simulation import batches, estimators
from fpsolve.simulation.estimators import simulate
from fpsolve.simulation.setup import largest_step, transient
from tests.agreement import rows
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE

MODERATE = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.5, impact="restitution")
STRONG = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0, impact="restitution")
NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9)
REDUCED = NOISE.ou_reduction()


def exact(oscillator, noise, p):
    return moment_lyapunov(oscillator, noise, p, rtol=1e-8).value


def test_agrees_with_finite_elements():
    """90 combinations by both estimators, see tests/agreement.py; those without an estimate say so themselves."""
    table = list(rows(paths=8192, transients=4))
    assert len(table) == 180
    given = [row for row in table if row.simulated.value is not None]
    assert sum(row.simulated.estimator == "population" for row in given) >= 78
    assert sum(row.simulated.estimator == "direct" for row in given) >= 50
    deviations = np.abs([row.deviation for row in given])
    assert np.mean(deviations <= 3) >= 0.95
    assert np.max(deviations) <= 5


@pytest.mark.parametrize(("estimator", "paths", "time"), [("direct", 2048, 100.0), ("population", 3072, 50.0)])
def test_standard_errors_are_honest(estimator, paths, time):
    """Over 200 seeds the estimates deviate by their standard error, within 20 %, and their mean is Λ(p)."""
    orders = [1.0] if estimator == "population" else [-1.0, 0.5, 1.0]
    reference = exact(MODERATE, REDUCED, orders)
    runs = [
        simulate(MODERATE, REDUCED, orders, estimator=estimator, paths=paths, time=time, seed=seed)
        for seed in range(200)
    ]
    exponent = ExponentSolver(Problem(MODERATE, REDUCED)).lyapunov_exponent().value
    check_standard_errors([(run.lyapunov_exponent, run.lyapunov_exponent_error) for run in runs], exponent)
    for k, value in enumerate(reference):
        check_standard_errors([(run.estimates[k].value, run.estimates[k].standard_error) for run in runs], value)


def check_standard_errors(pairs, reference):
    values, errors = np.array(pairs, dtype=float).T
    deviation = np.std(values, ddof=1)
    assert deviation / math.sqrt(np.mean(errors**2)) == pytest.approx(1, abs=0.2)
    assert abs(values.mean() - reference) < 4 * deviation / math.sqrt(200) + 0.1 * deviation


def test_population_succeeds_where_the_direct_estimator_fails():
    """Λ(4) at ε = 1 to 1 %, by as many paths."""
    reference = exact(STRONG, REDUCED, [4.0])[0]
    direct = simulate(STRONG, REDUCED, [4.0], paths=8192, seed=1)
    assert direct.estimates[0].value is None
    assert any("no estimate of Λ(p) at p = 4:" in text and "of the 5000" in text for text in direct.warnings)
    population = simulate(STRONG, REDUCED, [4.0], estimator="population", paths=8192, seed=1)
    assert not population.warnings
    assert population.estimates[0].value == pytest.approx(reference, rel=1e-2)
    assert population.estimates[0].standard_error < 2e-3 * reference


def test_three_digits_in_seconds():
    """At the default size a moment of strong noise is good to 1e-3."""
    reference = exact(STRONG, REDUCED, [1.0])[0]
    estimate = simulate(STRONG, REDUCED, [1.0], estimator="population").estimates[0]
    assert estimate.standard_error < 1e-3 * reference
    assert abs(estimate.value - reference) < 4 * estimate.standard_error


def biases(monkeypatch, oscillator, noise, p, steps, paths, time=None):
    """Relative bias of Λ(p) and its standard error for each step."""
    monkeypatch.setattr(estimators, "obstacles", lambda *_, **__: {})
    reference = exact(oscillator, noise, [p])[0]
    found = [
        simulate(oscillator, noise, [p], estimator="population", paths=paths, time=time, step=step, seed=4).estimates[0]
        for step in steps
    ]
    return [(estimate.value / reference - 1, estimate.standard_error / abs(reference)) for estimate in found]


def test_weak_order_of_the_exact_noise(monkeypatch):
    """Halving the step divides the bias by 4; the steps are four and two times the largest that is allowed."""
    noise = NonGaussianNoise(D0=1.0, tau0=1.0, r0=0.9)
    (coarse, error), (fine, fine_error) = biases(monkeypatch, STRONG, noise, 4.0, (0.2, 0.1), 28672, 400.0)
    assert abs(coarse) > 20 * error
    assert abs(fine) > 5 * fine_error
    assert coarse / fine == pytest.approx(4, abs=0.3 + 4 * (coarse / fine) * fine_error / fine)


def test_weak_order_of_ornstein_uhlenbeck_noise(monkeypatch):
    """The step is more than second order: from αh = 1.2 to 0.6 the bias falls by more than 4."""
    (coarse, error), (fine, fine_error) = biases(monkeypatch, STRONG, UNIT_NOISE, 1.0, (1.2, 0.6), 8192)
    assert abs(coarse) > 8 * error
    assert abs(fine) < abs(coarse) / 4 + 3 * fine_error


def test_gap_between_the_reduced_and_the_real_noise():
    """Fig. 1, D₀ = 1, r₀ = 0.95: the reduction (12)-(14) makes Λ(2) larger, by far more than 5 standard errors."""
    found = [
        simulate(FIG1, noise, [2.0], estimator="population", paths=8192, seed=5).estimates[0]
        for noise in (FIG1_NOISE.ou_reduction(), FIG1_NOISE)
    ]
    gap = found[0].value - found[1].value
    error = math.hypot(found[0].standard_error, found[1].standard_error)
    assert gap > 5 * error
    assert gap == pytest.approx(0.0141631436533 - 0.0130212719160, abs=4 * error)


def test_algebraic_tails():
    noise = NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.1)
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=0.5)
    reference = exact(oscillator, noise, [-0.4])[0]
    for estimator in ("direct", "population"):
        found = simulate(oscillator, noise, [-0.9, -0.4], estimator=estimator, paths=8192, seed=6)
        assert found.estimates[0].value is None
        assert any("no estimate of Λ(p) at p = -0.9: ‖x‖^p has no variance" in text for text in found.warnings)
        assert found.estimates[1].value == pytest.approx(reference, abs=4 * found.estimates[1].standard_error)
    with pytest.raises(NoSuchExponent, match="infinite"):
        simulate(oscillator, noise, [1.0])


def test_slow_noise_carries_a_moment_in_two_places():
    """Λ(2) = 1.129 where the oscillator does not turn, 0.496 where it does: no population passes between them."""
    noise = NonGaussianNoise(D0=0.5, tau0=20.0, r0=1.0)
    found = simulate(STRONG, noise, [2.0], estimator="population", paths=8192, time=330.0, seed=1)
    estimate = found.estimates[0]
    assert estimate.value == pytest.approx(exact(STRONG, noise, [2.0])[0], abs=4 * estimate.standard_error)
    assert estimate.standard_error < 1e-3
    assert any("start in two places differ by 0.6" in text for text in found.warnings)


def test_variance_rate():
    """Λ″(0) from the variance of ln‖x‖."""
    found = simulate(MODERATE, REDUCED, [], paths=8192, seed=2)
    reference = ExponentSolver(Problem(MODERATE, REDUCED)).variance_rate().value
    assert found.variance_rate == pytest.approx(reference, abs=4 * found.variance_rate_error + 0.02 * reference)


def test_identity_without_impact():
    """Λ(−2) = −ε²c₁ + ε²σ²/(2α²) for Ornstein-Uhlenbeck noise and r = 1."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.2, epsilon=0.7)
    found = simulate(oscillator, UNIT_NOISE, [-2.0], estimator="population", paths=8192, seed=8).estimates[0]
    assert found.value == pytest.approx(0.49 * (0.5 - 0.2), abs=4 * found.standard_error)
    assert found.standard_error < 2e-3


def test_moment_of_order_zero():
    for estimator in ("direct", "population"):
        found = simulate(FIG1, REDUCED, [0.0], estimator=estimator, paths=320, time=40.0).estimates[0]
        assert abs(found.value) < 1e-12
        assert found.standard_error < 1e-12


def small(seed, estimator="direct", orders=(-1.0, 1.0)):
    return simulate(MODERATE, NOISE, list(orders), estimator=estimator, paths=640, time=60.0, seed=seed)


@pytest.mark.parametrize("estimator", ["direct", "population"])
def test_seed_decides_whatever_the_threads(monkeypatch, estimator):
    found = small(3, estimator)
    for threads in (1, 2, 3):
        monkeypatch.setattr(batches, "processors", lambda threads=threads: threads)
        assert small(3, estimator) == found
    assert small(4, estimator) != found


def test_one_run_serves_all_orders():
    """The direct estimate of one p does not depend on which others are asked for; nor does λ."""
    alone, together = small(3, orders=(1.0,)), small(3, orders=(-1.0, 1.0, 2.0))
    assert alone.estimates[0] == together.estimates[1]
    assert alone.lyapunov_exponent == together.lyapunov_exponent


def test_memory_does_not_grow_with_time():
    def peak(time):
        tracemalloc.start()
        simulate(MODERATE, REDUCED, [1.0], paths=3200, time=time)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(30.0)
    assert peak(800.0) < 1.3 * peak(100.0)


@pytest.mark.parametrize("estimator", ["direct", "population"])
def test_an_interrupt_keeps_what_is_done(estimator):
    calls = []

    def progress():
        calls.append(1)
        if len(calls) == 50:
            raise KeyboardInterrupt

    found = simulate(MODERATE, REDUCED, [1.0], estimator=estimator, paths=4096, time=400.0, seed=1, progress=progress)
    whole = simulate(MODERATE, REDUCED, [1.0], estimator=estimator, paths=4096, time=400.0, seed=1)
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
        simulate(MODERATE, REDUCED, [1.0], paths=64, time=20.0, progress=progress)


def test_drift_is_noticed(monkeypatch):
    """With windows far shorter than the correlation time the slope depends on the window, and a warning says so."""
    slow = OrnsteinUhlenbeck(alpha=0.05, sigma=0.1)
    monkeypatch.setattr(estimators, "transient", lambda *_: 2.0)
    monkeypatch.setattr(estimators, "obstacles", lambda *_, **__: {})
    found = simulate(MODERATE, slow, [1.0], paths=8192, time=16.0, seed=2)
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
        ({"paths": 10}, "32 to"),
        ({"seed": -1}, "seed = -1"),
        ({"estimator": "exact"}, "direct, population"),
        ({"paths": "64"}, "paths = '64', seed = 0; must be one of .* a whole number from 32 to"),
        ({"seed": 1.5}, "seed = 1.5"),
        ({"p": [math.nan]}, "^p must be a finite number or a list of finite numbers, got"),
        ({"p": ["2"]}, "^p must be a finite number or a list of finite numbers, got"),
        ({"p": [[1.0], [1.0, 2.0]]}, "^p must be a finite number or a list of finite numbers, got"),
        ({"p": np.ma.array([1.0, 2.0], mask=[False, True])}, "p must be a finite number"),
        ({"noise": NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.8)}, "must be finite"),
    ],
)
def test_bad_settings_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        simulate(**({"oscillator": MODERATE, "noise": NOISE, "p": [1.0]} | change))


def test_a_single_order_may_stand_without_a_list():
    settings = {"paths": 64, "time": 2 * transient(MODERATE, NOISE), "seed": 1}
    assert simulate(MODERATE, NOISE, 0.5, **settings) == simulate(MODERATE, NOISE, [0.5], **settings)


def test_damping_too_small_for_a_number_limits_no_step():
    tiny = replace(MODERATE, c1=5e-324)
    assert largest_step(tiny, NOISE) == largest_step(replace(MODERATE, c1=0.0), NOISE)


def test_the_largest_good_step_is_named_and_good():
    largest, _ = largest_step(MODERATE, NOISE)
    with pytest.raises(ValueError, match=f"<= {largest:.4g}"):
        simulate(MODERATE, NOISE, [1.0], step=1.01 * largest)
    found = simulate(MODERATE, NOISE, [1.0], step=largest, paths=64, time=2 * transient(MODERATE, NOISE))
    assert found.step == largest


def test_noise_that_is_too_fast_is_refused():
    with pytest.raises(ValueError, match="takes"):
        simulate(MODERATE, NonGaussianNoise(D0=0.5, tau0=1e-7, r0=0.9), [1.0])
