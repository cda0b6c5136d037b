"""λ, Λ(1) and Λ(2) of random frames of two modes under noise in a load: how many come within 10 s each.

`python -m tests.random_frames [first last]` prints for each what is given, its error, and the processor time. A frame
is q̈ + 2ζω q̇ + ω²q + ξKq = 0 with damping of 0.5 % to 5 %, K symmetric, and noise of 10 % to 109 % of that for which
Λ(2) = 0: white, Ornstein-Uhlenbeck, telegraph, and a filter's.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np
from scipy.optimize import brentq

from fpsolve import Problem, lyapunov_exponent, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from fpsolve.model import CoefficientMatrix, LinearSystem
from fpsolve.theory.moments import even_moment
from tests.random_modes import KINDS, random_noise

FRAMES, RTOL, SECONDS = 20, 1e-4, 10.0
NUMBERS = {
    "λ": lambda problem, budget: lyapunov_exponent(problem, rtol=RTOL, budget=budget),
    "Λ(1)": lambda problem, budget: moment_lyapunov(problem, 1.0, rtol=RTOL, budget=budget),
    "Λ(2)": lambda problem, budget: moment_lyapunov(problem, 2.0, rtol=RTOL, budget=budget),
}


def frame(seed: int) -> tuple[str, Problem]:
    """What it is called, and the problem: kinds of noise in turn."""
    rng = np.random.default_rng([2027, seed])
    kind, frequencies = KINDS[seed % 4], np.array([1.0, rng.uniform(1.1, 3.0)])
    dampings = np.exp(rng.uniform(math.log(0.005), math.log(0.05), 2))
    load = rng.normal(size=(2, 2))
    share, noise, zero = rng.uniform(0.1, 1.09), random_noise(kind, rng), np.zeros((2, 2))
    steady = np.block([[zero, np.eye(2)], [-np.diag(frequencies**2), -2 * np.diag(dampings * frequencies)]])
    driven = np.block([[zero, zero], [-load - load.T, zero]]) / np.linalg.norm(load + load.T, 2)

    def problem(size: float) -> Problem:
        terms = CoefficientMatrix(0, steady.tolist()), CoefficientMatrix(1, (size * driven).tolist(), identity)
        return Problem(LinearSystem(terms), noise)

    bracket = next((size / 2, size) for size in 2.0 ** np.arange(-9, 9) if even_moment(problem(size), 2).value > 0)
    critical = brentq(lambda size: even_moment(problem(size), 2).value, *bracket, xtol=1e-6)
    return f"{kind}, {share:.0%} of critical, {critical:.3f}", problem(share * critical)


def main(first: int = 0, last: int = FRAMES - 1) -> None:
    """Print each number, and how many frames have all of them in time."""
    full = 0
    for seed in range(first, last + 1):
        kind, problem = frame(seed)
        print(f"{seed:3d} {kind}", flush=True)
        in_time = 0
        for name, solve in NUMBERS.items():
            started = time.process_time()
            try:
                made = solve(problem, Budget(seconds=SECONDS))
                told = f"{np.ravel(made.value)[0]:.8g} ± {np.ravel(made.error_estimate)[0]:.1e}"
            except FpsolveError as failure:
                told = f"refused: {' '.join(str(failure).split())[:250]}"
            spent = time.process_time() - started
            in_time += spent <= SECONDS and "refused" not in told
            print(f"      {name:5s} {spent:5.1f} s, {told}", flush=True)
        full += in_time == len(NUMBERS)
    print(f"{full} of {last - first + 1} frames with all three numbers in {SECONDS:g} s each")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
