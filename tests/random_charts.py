"""Points of lines of random charts: does the error estimate of F cover its error?

`python -m tests.random_charts [first last]` draws lines λ = 0, Λ(2) = 0 and δ_p = −1 of random oscillators over two
random parameters, and compares F at some points of each with the code of Fourier series and polynomials, for λ with a
tighter solve of its own.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator

import numpy as np

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator, boundary
from fpsolve.analysis import Axis, Boundary
from fpsolve.analysis.scan import Sample
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from tests import random_problems

ZEROS = "lyapunov_exponent", {"moment": 2.0}, {"stability_index": -1.0}
RANGES = {
    "oscillator.omega": (0.3, 4.0),
    "oscillator.c1": (-0.5, 1.0),
    "oscillator.restitution": (0.5, 1.0),
    "oscillator.epsilon": (0.02, 1.5),
    "noise.D0": (0.02, 2.0),
    "noise.tau0": (0.05, 5.0),
}
POINTS = 5
"""Of a line, evenly."""
TIGHT = 1e-10


def drawn(seed: int) -> Boundary:
    """A line of a random oscillator. Raises `FpsolveError`."""
    rng = np.random.default_rng(seed)
    values = {key: float(rng.uniform(*ends)) for key, ends in RANGES.items()}
    own = {name: values[f"oscillator.{name}"] for name in ("omega", "c1", "restitution", "epsilon")}
    noise = NonGaussianNoise(D0=values["noise.D0"], tau0=values["noise.tau0"], r0=float(rng.uniform(0.6, 1)))
    problem = Problem(VibroImpactOscillator(**own), noise if rng.random() < 0.5 else noise.ou_reduction())
    first, second = rng.choice(list(RANGES), 2, replace=False)
    axes = (Axis(str(key), *RANGES[str(key)]) for key in (first, second))
    budget = Budget(line_seconds=20.0)
    return boundary(problem, ZEROS[seed % len(ZEROS)], *axes, nodes=4, step=0.1, budget=budget)


def compared(found: Boundary, sample: Sample) -> tuple[float, float, float]:
    """How far F is from the reference, its estimate, and the doubt of the reference, all over the scale of F."""
    values = {axis.key: float(axis.value(share)) for axis, share in zip((found.x, found.y), sample.at, strict=True)}
    problem, p = found.problem.at(values), found.zero.p
    if p == 0:
        known, doubt = ExponentSolver(problem, rtol=TIGHT).ratio_alone(0.0)
    else:
        size = sample.scale * abs(p)
        own = random_problems.Problem(problem.system, problem.noise, p)
        known, doubt = random_problems._oracle(own, size) or random_problems._finer(
            ExponentSolver(problem, rtol=TIGHT).solution(p).pair
        )
        known, doubt = known / p, doubt / abs(p)
    return abs(sample.value - known) / sample.scale, sample.error / sample.scale, doubt / sample.scale


def samples(first: int, last: int) -> Iterator[tuple[int, Boundary, Sample]]:
    """Some points of each line."""
    for seed in range(first, last + 1):
        try:
            found = drawn(seed)
        except FpsolveError as failure:
            print(f"{seed:4d} no line: {str(failure)[:120]}", flush=True)
            continue
        for trace in found.traces:
            count = len(trace.points)
            for k in sorted({round(each) for each in np.linspace(0, count - 1, POINTS)}):
                yield seed, found, trace.points[k].sample


def main(first: int = 0, last: int = 39) -> None:
    """Print the points whose estimate does not cover the error, and a histogram of estimate over error."""
    ratios, count = list[float](), 0
    for seed, found, sample in samples(first, last):
        try:
            error, estimate, doubt = compared(found, sample)
        except FpsolveError as failure:
            print(f"{seed:4d} no reference: {str(failure)[:120]}", flush=True)
            continue
        count += 1
        if error > estimate + doubt:
            print(f"{seed:4d} {found.zero} at {sample.at}: error {error:.1e}, estimate {estimate:.1e}", flush=True)
        if error > 3 * doubt:
            ratios.append(estimate / error)
    print(f"{count} points; error below what the reference can tell: {count - len(ratios)}")
    edges = (0, 1 / 3, 0.5, 0.9, 1.1, 2, 10, 100, 1000, math.inf)
    for low, high in itertools.pairwise(edges):
        print(f"estimate/error from {low:.2g} to {high:.2g}: {sum(low <= each < high for each in ratios)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
