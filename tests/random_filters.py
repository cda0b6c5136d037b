"""Λ(2) of random systems in the plane under random filtered noise, by moments.

`python -m tests.random_filters [first last rtol]` prints for each system how far the finite elements at rtol = 1e-6 are
from moments times Hermite polynomials of the filter, the stated error and the doubt of that oracle, its change from
four degrees fewer, the number of functions and the seconds of the processor.
"""

import math
import sys

import numpy as np

from fpsolve import PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Filter
from tests.comparison import Comparison, comparison, report
from tests.oracles import filtered

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
    """Λ(2) by the moments of two degrees, the last of them."""
    values = [math.inf]
    for count in DEGREES:
        values.append(filtered.moment_lyapunov(steady, driven, law, 2, count))
        if abs(values[-1] - values[-2]) < 1e-11:
            break
    return values[-2], values[-1]


def compared(seed: int, rtol: float = RTOL) -> Comparison:
    """Λ(2) by both."""
    system = drawn(seed)
    return comparison("filter", problem_of(*system), lambda _: expected(*system), rtol=rtol)


def main(first: int = 1, last: int = 20, rtol: float = RTOL) -> None:
    """Print what each system gives."""
    report([(seed, rtol) for seed in range(int(first), int(last) + 1)], compared)


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
