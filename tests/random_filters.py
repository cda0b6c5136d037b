"""Λ(2) of random systems in the plane under random filtered noise, by moments and by simulation.

`python -m tests.random_filters [first last]` prints for each system how far the finite elements at rtol = 1e-6 are from
moments times Hermite polynomials of the filter, the stated error and the doubt of that oracle, its change from four
degrees fewer, unknowns and seconds of one processor. `python -m tests.random_filters simulate [first last]` compares
with the simulation, in its standard errors.
"""

import math
import sys
import time

import numpy as np

from fpsolve import PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, Filter
from tests.oracles import filtered
from tests.random_simulations import outcome

RTOL, DEGREES = 1e-6, (10, 14, 18, 22, 26)


def drawn(seed):
    """A₀, A₁ and (ω, ζ, s, c₀, c₁): half of the A₀ turn; ξ A₁ has the size 0.2 to 0.7."""
    rng = np.random.default_rng([28, seed])
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    if seed % 2:
        steady += rng.uniform(1.0, 3.0) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    omega, zeta = np.exp(rng.uniform(np.log([0.5, 0.1]), np.log([4.0, 2.0])))
    size, angle = rng.uniform(0.2, 0.7) / np.linalg.norm(driven, 2), rng.uniform(0, 2 * math.pi)
    output = math.cos(angle), math.sin(angle) / omega
    law = omega, zeta, filtered.strength(omega, zeta, *output, size), *output
    return steady, driven, tuple(map(float, law))


def problem_of(steady, driven, law):
    """ẋ = (A₀ + ξA₁)x under a filter."""
    terms = [CoefficientMatrix(0, steady.tolist()), CoefficientMatrix(1, driven.tolist(), identity)]
    return Problem(PlaneSystem(terms), Filter(*law))


def expected(steady, driven, law):
    """Λ(2) by the moments, with its doubt."""
    values = [math.inf]
    for count in DEGREES:
        values.append(filtered.moment_lyapunov(steady, driven, law, 2, count))
        if abs(values[-1] - values[-2]) < 1e-11:
            break
    return values[-1], abs(values[-1] - values[-2]) + 1e-12


def compared(seed):
    """The solution, the oracle's Λ(2) and its doubt, and the seconds that the solution took."""
    system = drawn(seed)
    started = time.process_time()
    solution = ExponentSolver(problem_of(*system), rtol=RTOL).solution(2.0)
    seconds = time.process_time() - started
    return solution, *expected(*system), seconds


def main(first: int = 1, last: int = 20) -> None:
    """Print what each system gives."""
    beyond, longest = 0, 0.0
    for seed in range(first, last + 1):
        solution, value, doubt, seconds = compared(seed)
        off, pair = abs(solution.pair.value - value), solution.pair
        is_beyond = off > solution.error + doubt
        beyond, longest = beyond + is_beyond, max(longest, seconds)
        print(
            f"{seed:4} {pair.value:14.10f} off {off:.1e} stated {solution.error:.1e} doubt {doubt:.1e} "
            f"{pair.right.size:6} unknowns {seconds:.2f} s{' !' * is_beyond}", flush=True,
        )  # fmt: skip
    print(f"{beyond} of {last - first + 1} beyond the stated error; the longest took {longest:.2f} s")


def simulated(first: int = 1, last: int = 10) -> None:
    """Print by how many standard errors the simulation of each system is off."""
    for seed in range(first, last + 1):
        found = outcome(problem_of(*drawn(seed)))
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
