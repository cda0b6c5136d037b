"""Λ(2) of random systems in the plane under every kind of noise, by moments, with walls by Fourier series.

`python -m tests.random_systems [first last]` prints for each system how far the two are apart, with the stated error
and the doubt of the oracle, its change from half as many functions; at the end how many are beyond both.
"""

import math
import sys

import numpy as np

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, SineWiener, Telegraph, White
from tests.comparison import Comparison, comparison, report
from tests.oracles import moment_hierarchy, phase_circle

KINDS = ("white", "ito", "telegraph", "chain", "ornstein-uhlenbeck", "sine-wiener")
WALLED = ("white", "ito", "telegraph", "chain")
SIZES = 24, 48


def drawn(seed):
    """A random system and its noise, what they are, and Λ(2) by two sizes of an oracle."""
    rng = np.random.default_rng(seed)
    kind, restitution = KINDS[seed % len(KINDS)], 1.0
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    size, rate = np.exp(rng.uniform(-1, 0.7, 2))
    if seed % 4 == 0 and kind in WALLED:  # at a wall that the phase passes forward, whatever the noise does
        steady[0, 1], driven[0, 1], restitution = abs(steady[0, 1]) + 0.5, 0.0, rng.uniform(0.6, 0.95)
        steady[1, 0] -= 4.0 if kind in ("telegraph", "chain") else 0.0  # it turns in all states, or T is not smooth
    if kind in ("white", "ito"):
        sense = "ito" if kind == "ito" else "stratonovich"
        noise, system = White(s=size, interpretation=sense), (steady, [size * driven])
        moments, made = (
            [moment_hierarchy.white_noise_exponent(*system, 2, sense)] * 2,
            phase_circle.white(*system, sense),
        )
    elif kind in ("telegraph", "chain"):
        noise = Telegraph(a=size, k=rate) if kind == "telegraph" else random_chain(rng, size, rate)
        system = [steady + xi * driven for xi in noise.states], noise.rates
        moments, made = [moment_hierarchy.moment_lyapunov(*system, 2)] * 2, phase_circle.chain(*system)
    elif kind == "ornstein-uhlenbeck":
        noise = OrnsteinUhlenbeck(alpha=rate, sigma=size * math.sqrt(2 * rate))
        law = steady, driven, rate, size
        moments = [moment_hierarchy.ornstein_uhlenbeck_exponent(*law, 2, 2 * count) for count in SIZES]
    else:
        noise = SineWiener(amplitude=size, sigma=math.sqrt(2 * rate))
        law = steady, driven, size, noise.sigma
        moments = [moment_hierarchy.sine_wiener_exponent(*law, 2, count // 2) for count in SIZES]
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity)]
    if restitution == 1:
        return Problem(PlaneSystem(terms), noise), kind, moments
    found = [phase_circle.moment_exponent(made, 2, modes, restitution) for modes in SIZES]
    return Problem(PlaneSystem(terms, [Jump(math.pi / 2, math.log(restitution))]), noise), f"{kind} and a wall", found


def random_chain(rng, size, rate):
    """Two to four states, of which the mean is not 0."""
    count = int(rng.integers(2, 5))
    rates = rate * rng.uniform(0.2, 2, (count, count))
    return MarkovChain(size * rng.uniform(-1, 1.5, count), rates - np.diag(np.diagonal(rates)))


def compared(seed: int) -> Comparison:
    """Λ(2) by both."""
    problem, kind, found = drawn(seed)
    return comparison(kind, problem, lambda _: found)


def main(first: int = 1, last: int = 200) -> None:
    """Print what each system gives."""
    report([(seed,) for seed in range(first, last + 1)], compared)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
