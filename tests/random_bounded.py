"""Λ(2) of random systems in the plane under random bounded noise, by moments.

`python -m tests.random_bounded [first last]` prints for each system how far the finite elements are from moments times
Fourier series of the angle, the stated error and the doubt of that oracle, its change from half as many waves. Every
third has a harmonic load beside white noise.
"""

import sys

import numpy as np

from fpsolve import PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import Bounded, CoefficientMatrix, White
from tests.comparison import Comparison, comparison, report
from tests.oracles.moment_hierarchy import bounded_exponent

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


def compared(seed: int) -> Comparison:
    """Λ(2) by both."""
    steady, driven, white, law = drawn(seed)
    return comparison(
        "bounded" if white is None else "white and harmonic",
        problem_of(steady, driven, white, law),
        lambda _: tuple(bounded_exponent(steady, driven, *law, 2, count, white) for count in HARMONICS),
    )


def main(first: int = 1, last: int = 60) -> None:
    """Print what each system gives."""
    report([(seed,) for seed in range(first, last + 1)], compared)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
