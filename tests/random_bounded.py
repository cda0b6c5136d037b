"""Λ(2) of random systems in the plane under random bounded noise, by moments and by simulation.

`python -m tests.random_bounded [first last]` prints for each system how far the finite elements are from moments times
Fourier series of the angle, the stated error and the doubt of that oracle, its change from half as many waves. Every
third has a harmonic load beside white noise. `python -m tests.random_bounded simulate [first last]` compares with the
simulation, in its standard errors; there all loads diffuse.
"""

import sys
import time

import numpy as np

from fpsolve import PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import Bounded, CoefficientMatrix, White
from tests.oracles.moment_hierarchy import bounded_exponent
from tests.random_simulations import outcome

HARMONICS = 12, 24


def drawn(seed):
    """A₀, A₁ and B as rows, and (μ, ν, σ): half of the A₀ turn."""
    rng = np.random.default_rng([29, seed])
    steady, driven, white = rng.uniform(-1, 1, (3, 2, 2))
    if seed % 2:
        steady += rng.uniform(1.0, 3.0) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    mu, nu, sigma = np.exp(rng.uniform(np.log([0.2, 0.3, 0.2]), np.log([1.5, 5.0, 1.5]))).tolist()
    return steady, driven, 0.3 * white if seed % 3 == 0 else None, (mu, nu, 0.0 if seed % 3 == 0 else sigma)


def problem_of(steady, driven, white, law):
    """dx = (A₀ + ξA₁)x dt + Bx∘dW, B = 0 for None."""
    terms = [CoefficientMatrix(0, steady.tolist()), CoefficientMatrix(1, driven.tolist(), identity, "load")]
    if white is None:
        return Problem(PlaneSystem(terms), Bounded(*law))
    terms.append(CoefficientMatrix(1, white.tolist(), identity, "white"))
    return Problem(PlaneSystem(terms), {"load": Bounded(*law), "white": White(1.0)})


def compared(seed):
    """The solution, the oracle's Λ(2), its doubt, and the seconds that the solution took."""
    steady, driven, white, law = drawn(seed)
    started = time.process_time()
    solution = ExponentSolver(problem_of(steady, driven, white, law)).solution(2.0)
    seconds = time.process_time() - started
    coarse, fine = (bounded_exponent(steady, driven, *law, 2, count, white) for count in HARMONICS)
    return solution, fine, abs(fine - coarse) + 1e-12 * max(1.0, abs(fine)), seconds


def main(first: int = 1, last: int = 60) -> None:
    """Print what each system gives."""
    beyond = 0
    for seed in range(first, last + 1):
        try:
            solution, value, doubt, seconds = compared(seed)
        except FpsolveError as failure:
            print(f"{seed:4} {failure}", flush=True)
            continue
        off, pair = abs(solution.pair.value - value), solution.pair
        is_beyond = off > solution.error + doubt
        beyond += is_beyond
        print(
            f"{seed:4} {pair.value:14.10f} off {off:.1e} stated {solution.error:.1e} doubt {doubt:.1e} "
            f"{pair.right.size:6} unknowns {seconds:.2f} s{' !' * is_beyond}", flush=True,
        )  # fmt: skip
    print(f"{beyond} of {last - first + 1} beyond the stated error")


def simulated(first: int = 1, last: int = 10) -> None:
    """Print by how many standard errors the simulation of each system is off."""
    for seed in range(first, last + 1):
        steady, driven, _, (mu, nu, sigma) = drawn(seed)
        found = outcome(problem_of(steady, driven, None, (mu, nu, sigma or 0.5)))
        print(
            f"{seed:4} {found.value:12.7f}, simulated {found.simulated:10.6f} ± {found.standard_error:.1e}, "
            f"{found.deviation:+.1f} standard errors", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    words = sys.argv[1:]
    if words[:1] == ["simulate"]:
        simulated(*map(int, words[1:]))
    else:
        main(*map(int, words))
