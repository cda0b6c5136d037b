"""P(ln ‖x(t)‖ ≥ ts) at t of one to four turns of random oscillators, beside paths: `python -m tests.random_growth`.

`python -m tests.random_growth [first last [paths]]` prints for each how far `growth_law` is from the share of paths, in
the sum of 1.5 of its stated error and three standard errors. Paths are made here: half of the drift, the exact kick by
∫ξ over a step, half of the drift, of weak order 2.
"""

from __future__ import annotations

import math
import sys

import numpy as np
import scipy.linalg

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.analysis import growth_law
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.model import CoefficientMatrix, SineWiener, White

STEPS_PER_TURN = 120
KINDS = ("white", "ornstein-uhlenbeck", "sine-wiener")


def drawn(seed):
    """A problem with its drift, kicked column and noise, a start, a time, and ω."""
    rng = np.random.default_rng([7, seed])
    stiffness, kind, column = rng.uniform(0.4, 4.0), KINDS[seed % 3], int(rng.integers(2))
    omega = math.sqrt(stiffness)
    damping, size = rng.uniform(-0.1, 0.3) * omega, rng.uniform(0.2, 1.0)
    size *= omega ** (1.5 if column == 0 else 0.5)
    rate = omega * rng.uniform(0.5, 4.0)
    noise = {
        "white": lambda: White(s=size),
        "ornstein-uhlenbeck": lambda: OrnsteinUhlenbeck(alpha=rate, sigma=size * rate),
        "sine-wiener": lambda: SineWiener(amplitude=size * math.sqrt(rate), sigma=math.sqrt(rate)),
    }[kind]()
    drift = ((0.0, 1.0), (-stiffness, -damping))
    kicked = ((0.0, 0.0), (-1.0, 0.0) if column == 0 else (0.0, -1.0))
    problem = Problem(PlaneSystem([CoefficientMatrix(0, drift), CoefficientMatrix(1, kicked, identity)]), noise)
    start = float(rng.choice([0.0, rng.uniform(0, math.pi)]))
    return problem, drift, column, noise, start, rng.uniform(1, 4 if seed % 2 else 2) * 2 * math.pi / omega, omega


def rates_of_paths(seed, paths):
    """s_t = ln ‖x(t)‖/t of so many paths, shape (paths,)."""
    _, drift, column, noise, start, time, omega = drawn(seed)
    rng = np.random.default_rng([8, seed])
    steps = math.ceil(time * omega / (2 * math.pi) * STEPS_PER_TURN)
    h = time / steps
    half = scipy.linalg.expm(np.array(drift) * h / 2)
    x, v = np.full(paths, math.cos(start)), np.full(paths, -math.sin(start))
    if isinstance(noise, OrnsteinUhlenbeck):
        xi = noise.sigma / math.sqrt(2 * noise.alpha) * rng.standard_normal(paths)
    elif isinstance(noise, SineWiener):
        xi = rng.uniform(0, 2 * math.pi, paths)
    for _ in range(steps):
        if isinstance(noise, White):
            kick = noise.s * math.sqrt(h) * rng.standard_normal(paths)
        elif isinstance(noise, OrnsteinUhlenbeck):  # both are normal: ξ₁ and ∫ξ given ξ₀
            a, s2 = noise.alpha, noise.sigma**2
            e = math.exp(-a * h)
            own, both = s2 / (2 * a) * (1 - e * e), s2 / (2 * a * a) * (1 - e) ** 2
            of_sum = s2 / a**2 * (h - 2 * (1 - e) / a + (1 - e * e) / (2 * a))
            root = np.linalg.cholesky([[own, both], [both, of_sum]])
            first, second = rng.standard_normal((2, paths))
            kick = xi * (1 - e) / a + root[1, 0] * first + root[1, 1] * second
            xi = e * xi + root[0, 0] * first
        else:
            turn = noise.sigma * math.sqrt(h / 2)
            middle = xi + turn * rng.standard_normal(paths)
            end = middle + turn * rng.standard_normal(paths)
            kick = noise.amplitude * h / 6 * (np.sin(xi) + 4 * np.sin(middle) + np.sin(end))
            xi = end
        x, v = half[0, 0] * x + half[0, 1] * v, half[1, 0] * x + half[1, 1] * v
        v = v - kick * x if column == 0 else np.exp(-kick) * v
        x, v = half[0, 0] * x + half[0, 1] * v, half[1, 0] * x + half[1, 1] * v
    return np.log(np.hypot(x, v)) / time


def compared(seed, paths):
    """s, P(s_t ≥ s), its error, the share of paths, and its standard error, at the quantiles of paths."""
    problem, *_, start, time, _ = drawn(seed)
    rates = rates_of_paths(seed, paths)
    s = np.quantile(rates, [0.02, 0.2, 0.5, 0.8, 0.98])
    try:
        law = growth_law(problem, time, s, start=start)
    except NotConverged:  # near the largest rate of bounded noise p(s) is beyond the interval
        law = growth_law(problem, time, s := s[1:-1], start=start)
    deviation = np.sqrt(law.above[0] * law.below[0] / paths)
    return s, law.above[0], law.probability_error[0], np.mean(rates >= s[:, None], axis=1), deviation


def main(first: int = 0, last: int = 35, paths: int = 400_000) -> None:
    """Print what is furthest off."""
    beyond = 0
    for seed in range(first, last + 1):
        _, found, error, share, deviation = compared(seed, paths)
        off = np.abs(found - share)
        of_both = off / (1.5 * error + 3 * deviation)
        k = int(np.argmax(of_both))
        beyond += bool(of_both[k] > 1)
        print(
            f"{seed:3d} {KINDS[seed % 3]:20s} {of_both[k]:5.2f}: P = {found[k]:.5f}, off {off[k]:.1e}, error "
            f"{error[k]:.1e}, s.e. {deviation[k]:.1e}; largest error {error.max():.1e}",
            flush=True,
        )
    print(f"{beyond} of {last - first + 1} are beyond 1.5 of the error and three standard errors")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
