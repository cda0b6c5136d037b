"""How often λ and Λ(1) by simulation of six variables are within their standard errors, for many seeds.

`python -m tests.random_coverage [first last]` prints for each seed how many standard errors both are from the known
numbers, and in the end which share of them is within the quantile of Student's law that belongs to 95 %: 95 ± 3 % of
200. Two modes and two lag states under a filter are told from another basis: the first mode drives all others, which
decay faster, so that λ, Λ(1) and Λ(2) are those of the first mode by itself.
"""

import sys

import numpy as np
from scipy.stats import t as student

from fpsolve import Problem, lyapunov_exponent, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Filter, LinearSystem, PlaneSystem
from fpsolve.simulation import simulate
from fpsolve.simulation.setup import BATCHES
from fpsolve.theory import even_moment

NOISE = Filter(omega=1.6, zeta=0.4, s=0.6)
FREE, DRIVEN = np.zeros((2, 6, 6))
FREE[:2, :2], FREE[2:4, 2:4] = [[0.0, 1.0], [-1.0, -0.1]], [[0.0, 1.0], [-2.2, -0.5]]
FREE[4, 4], FREE[5, 5], FREE[3, 0], FREE[4, 0], FREE[4, 3], FREE[5, 2] = -0.4, -0.8, 0.3, 0.4, 0.2, 0.5
DRIVEN[1, 0], DRIVEN[3, 2], DRIVEN[3, 0] = -1.0, -0.8, 0.3
PATHS = 4096


def problem_of(free, driven):
    kind = PlaneSystem if len(free) == 2 else LinearSystem
    terms = CoefficientMatrix(0, free.tolist()), CoefficientMatrix(1, driven.tolist(), identity)
    return Problem(kind(terms), NOISE)


def mixed():
    """The six variables in another basis, and λ, Λ(1) and Λ(2)."""
    basis = np.eye(6) + 0.3 * np.random.default_rng(1).standard_normal((6, 6))
    back, first = np.linalg.inv(basis), problem_of(FREE[:2, :2], DRIVEN[:2, :2])
    exact = lyapunov_exponent(first).value, *moment_lyapunov(first, [1.0, 2.0]).value
    return problem_of(basis @ FREE @ back, basis @ DRIVEN @ back), exact


def distances(problem, exact, seed):
    """How far λ and Λ(1) are from the exact ones, in standard errors."""
    found = simulate(problem, 1.0, paths=PATHS, seed=seed)
    [moment] = found.estimates
    told = (found.lyapunov_exponent, found.lyapunov_exponent_error), (moment.value, moment.standard_error)
    return [(value - right) / error for (value, error), right in zip(told, exact, strict=False)]


def main(first: int = 1, last: int = 200) -> None:
    """Print what each seed gives."""
    problem, exact = mixed()
    even = even_moment(problem, 2)
    print(f"λ = {exact[0]:.8f}, Λ(1) = {exact[1]:.8f}, Λ(2) = {exact[2]:.10f} and by moments {even.value:.10f}")
    rows = []
    for seed in range(int(first), int(last) + 1):
        rows.append(distances(problem, exact, seed))
        print(f"{seed:4} λ {rows[-1][0]:6.2f}, Λ(1) {rows[-1][1]:6.2f}", flush=True)
    shares = np.mean(np.abs(rows) <= student.ppf(0.975, BATCHES - 1), axis=0)
    print(f"{shares[0]:.1%} and {shares[1]:.1%} of {len(rows)} within; means {np.mean(rows, axis=0)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
