"""Λ(2), and Λ(4) up to six variables, of random systems of 3 to 12 variables under all kinds of noise, by moments.

`python -m tests.random_many [first last p]` prints for each system how far `even_moment` is from the moments of
`oracles.kronecker`, the stated error, the numbers of functions of the noises and the seconds of the processor. Every
second system has its second moments as matrices, as more variables have, the others as one vector.
"""

import math
import sys
import time
from unittest import mock

import numpy as np

from fpsolve import OrnsteinUhlenbeck, Problem
from fpsolve.arrays import identity
from fpsolve.model import Bounded, CoefficientMatrix, Filter, LinearSystem, MarkovChain, Poisson, SineWiener, White
from fpsolve.theory import even_moment
from tests.oracles import filtered, kronecker

KINDS = "white", "ito", "gaussian", "chain", "sine-wiener", "bounded", "filter", "poisson", "both"
COUNTS = {"gaussian": 40, "both": 60, "sine-wiener": 16, "bounded": 16, "filter": 14}


def noise_of(kind, rng, size):
    """A noise of about this size, and what the oracle takes of it: its rates and ξ for some functions."""
    rate = math.exp(rng.uniform(-0.5, 1.0))
    match kind:
        case "gaussian":
            noise = OrnsteinUhlenbeck(alpha=rate, sigma=size * math.sqrt(2 * rate))
            return noise, lambda count: kronecker.gaussian(rate, size, count)
        case "chain":  # one that is not reversible
            rates = rng.uniform(0.1, 1.5, (3, 3)) + np.array([[0, 2, 0], [0, 0, 2], [2, 0, 0]])
            states = size * rng.uniform(-1.5, 1.5, 3)
            np.fill_diagonal(rates, 0.0)
            return MarkovChain(states, rates), lambda _: kronecker.jumping(states, rates)
        case "sine-wiener":
            return SineWiener(1.4 * size, rate), lambda count: kronecker.turning(1.4 * size, 0.0, rate, count, True)
        case "bounded":
            return Bounded(1.4 * size, 2.0, rate), lambda count: kronecker.turning(1.4 * size, 2.0, rate, count, False)
    omega, zeta, outputs = 1.5 * rate, 1.0 if rng.uniform() < 0.3 else rng.uniform(0.1, 1.5), rng.uniform(-1, 1, 2)
    law = omega, zeta, filtered.strength(omega, zeta, *outputs, size), *outputs
    return Filter(*map(float, law)), lambda count: kronecker.filtering(law, count)


def drawn(seed):
    """A random system, what its noise is, and Λ(p) by the oracle as a function of p and of Λ(p) about.

    A sixth has two equal eigenvalues and one eigenvector of them, and all are about as large as the rate of the noise.
    """
    rng = np.random.default_rng([55, seed])
    n, kind = 3 + seed // len(KINDS) % 10, KINDS[seed % len(KINDS)]
    free = rng.standard_normal((n, n)) / math.sqrt(n) + rng.uniform(0, 2) * np.triu(rng.uniform(-1, 1, (n, n)), 1)
    if seed % 6 == 0:
        free[:2], free[:, 1] = 0.0, 0.0
        free[0, :2], free[1, 1] = (-0.3, 1.0), -0.3
    free -= (np.linalg.eigvals(free).real.max() + rng.uniform(0.02, 0.5)) * np.eye(n)
    load, other = rng.standard_normal((2, n, n)) / math.sqrt(n)
    if seed % 4 == 0:
        load = np.outer(load[0], load[1]) * math.sqrt(n)
    size, strong = np.exp(rng.uniform((-3.0, -3.0), (0.0, 0.0)))
    white, coloured, impulses, terms = [], [], [], [CoefficientMatrix(0, free.tolist())]
    if kind in ("white", "ito", "poisson"):
        sense = "ito" if kind == "ito" else "stratonovich"
        noise = Poisson(1.5, (-size, 0.5 * size)) if kind == "poisson" else White(s=size, interpretation=sense)
        if kind == "poisson":
            impulses = [(0.75, -size * load), (0.75, 0.5 * size * load)]
        else:
            white = [(size * load, sense)]
        terms.append(CoefficientMatrix(0, load.tolist(), identity))
    elif kind == "both":
        own, of_own = noise_of("chain" if n > 6 else "gaussian", rng, size)
        noise, white, coloured = {"a": own, "b": White(s=strong)}, [(strong * other, "stratonovich")], [(load, of_own)]
        terms += [CoefficientMatrix(0, each.tolist(), identity, name) for each, name in ((load, "a"), (other, "b"))]
    else:
        noise, of_own = noise_of(kind, rng, size)
        coloured = [(load, of_own)]
        terms.append(CoefficientMatrix(0, load.tolist(), identity))

    def oracle(p, near):
        own = [(matrix, *of_own(COUNTS.get(kind, 30) if n < 9 else 30)) for matrix, of_own in coloured]
        return kronecker.several(free, own, white, impulses, p, near)

    return Problem(LinearSystem(terms), noise), f"{kind}, n = {n}", oracle


def compared(seed: int, p: int = 2) -> tuple[bool, str]:
    """Whether both agree within the stated error and rounding, and a line that says it."""
    problem, kind, oracle = drawn(seed)
    started = time.process_time()
    with mock.patch("fpsolve.theory.moments.MOST_AS_POWERS", 0 if seed % 2 else 10**6):
        found = even_moment(problem, p)
    seconds, expected = time.process_time() - started, oracle(p, found.value)
    off = abs(found.value - expected)
    is_within = off <= found.error + 1e-12 * found.scale
    told = f"{found.value:14.10f} off {off:.1e} stated {found.error:.1e} {tuple(found.counts)} {seconds:.2f} s"
    return is_within, f"{seed:4} {kind:20} {type(found.equations.state).__name__:9} {told}{' !' * (not is_within)}"


def main(first: int = 1, last: int = 200, p: int = 2) -> None:
    """Print what each system gives."""
    wrong = 0
    for seed in range(int(first), int(last) + 1):
        if p == 4 and 3 + seed // len(KINDS) % 10 > 6:
            continue
        is_within, line = compared(seed, int(p))
        wrong += not is_within
        print(line, flush=True)
    print(wrong, "beyond what is stated")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
