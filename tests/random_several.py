"""Λ(2) and Λ(4) of random systems under two independent noises, by their moments.

`python -m tests.random_several [first last rtol]` prints for each system how far the two are apart, with the stated
error and the doubt of the oracle, its change from fewer functions, the unknowns and the time of the processor; at the
end how many are beyond both, and the longest time.
"""

import math
import sys

import numpy as np

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Telegraph, White
from tests.comparison import Comparison, comparison, report
from tests.oracles.moment_hierarchy import chain, gaussian, several_exponent

KINDS = (
    ("telegraph", "ornstein-uhlenbeck"),
    ("ornstein-uhlenbeck", "ornstein-uhlenbeck"),
    ("white", "ornstein-uhlenbeck"),
    ("white", "ito"),
    ("telegraph", "telegraph"),
    ("telegraph", "ito"),
)
COUNTS = 20, 32


def drawn(seed):
    """A random system that turns, its two noises, and Λ(p) by an oracle as a function of p and a number of functions.

    Returns:
        The problem, what the noises are, and the oracle.
    """
    rng = np.random.default_rng(seed)
    kinds = KINDS[seed % len(KINDS)]
    steady = np.array([[0.0, 1.0], [-1.0, -rng.uniform(0.0, 0.4)]])
    terms, noises, white, coloured = [CoefficientMatrix(0, steady)], {}, [], []
    for name, kind in zip(("axial", "lateral"), kinds, strict=True):
        matrix, size, rate = rng.uniform(-1, 1, (2, 2)), *np.exp(rng.uniform((-2.0, -0.7), (-0.5, 1.0)))
        terms.append(CoefficientMatrix(1, matrix, identity, name))
        if kind in ("white", "ito"):
            sense = "ito" if kind == "ito" else "stratonovich"
            noises[name] = White(s=size, interpretation=sense)
            white.append((size * matrix, sense))
        elif kind == "telegraph":
            noises[name] = Telegraph(a=size, k=rate)
            coloured.append(lambda _, a=matrix, law=noises[name]: chain(a, law.states, law.rates))
        else:
            noises[name] = OrnsteinUhlenbeck(alpha=rate, sigma=size * math.sqrt(2 * rate))
            coloured.append(lambda count, a=matrix, rate=rate, size=size: gaussian(a, rate, size, count))

    def oracle(p, count, first):
        return several_exponent(steady, [each(count) for each in coloured], white, p, first)

    return Problem(PlaneSystem(terms), noises), " and ".join(kinds), oracle


def compared(seed: int, p: float, rtol: float = 1e-8) -> Comparison:
    """Λ(p) by both."""
    problem, kinds, oracle = drawn(seed)
    return comparison(
        kinds, problem, lambda value: tuple(oracle(int(p), count, value + 1e-3) for count in COUNTS), p, rtol
    )


def main(first: int = 1, last: int = 20, rtol: float = 1e-8) -> None:
    """Print what each system gives."""
    report([(seed, p, rtol) for seed in range(int(first), int(last) + 1) for p in (2.0, 4.0)], compared)


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
