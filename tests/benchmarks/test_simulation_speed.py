"""Path-steps a second of the simulation on all processors, after compilation: `pytest tests/benchmarks`."""

from __future__ import annotations

import time

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, simulate

OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
NOISE = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)
NOISES = {"reduced": NOISE.ou_reduction(), "exact": NOISE}
PATHS = 32_768
PEER_PATHS = 2000


@pytest.mark.parametrize("name", NOISES)
def test_path_steps_a_second(benchmark, name):
    """At least 3e7, with estimates of two moments; compilation, which a cache keeps, is apart."""
    simulate(Problem(OSCILLATOR, NOISES[name]), [1.0, 2.0], paths=64, time=30.0)
    found = benchmark.pedantic(
        simulate, args=(OSCILLATOR, NOISES[name], [1.0, 2.0]), kwargs={"paths": PATHS, "time": 400.0}, rounds=3
    )
    rate = found.paths * (found.time / found.step) / benchmark.stats.stats.min
    benchmark.extra_info["path-steps per second"] = rate
    assert rate > 3e7


def test_against_numpy(benchmark):
    """Faster than NumPy on whole arrays that makes an Euler step and seeks no impacts."""
    simulate(Problem(OSCILLATOR, NOISES["reduced"]), [], paths=64, time=30.0)
    found = benchmark.pedantic(
        simulate, args=(OSCILLATOR, NOISES["reduced"], []), kwargs={"paths": PATHS, "time": 200.0}, rounds=3
    )
    rate = found.paths * (found.time / found.step) / benchmark.stats.stats.min
    peer = _numpy_rate()
    benchmark.extra_info["times the rate of NumPy"] = rate / peer
    assert rate > peer


def _numpy_rate() -> float:
    """Path-steps a second of the least that a script would do: rotate, grow, reflect."""
    rng = np.random.default_rng(0)
    x, u, xi = rng.random((3, PEER_PATHS))
    steps, h = 500, 0.1
    cos, sin, alpha = np.cos(h), np.sin(h), NOISES["reduced"].alpha
    start = time.perf_counter()
    for _ in range(steps):
        xi += -alpha * xi * h + NOISE.diffusion * np.sqrt(h) * rng.standard_normal(PEER_PATHS)
        x, u = cos * x + sin * u, (cos * u - sin * x) * np.exp(OSCILLATOR.epsilon * xi * h)
        hit = x < 0
        x[hit], u[hit] = -x[hit], -OSCILLATOR.impact_factor() * u[hit]
    return PEER_PATHS * steps / (time.perf_counter() - start)
