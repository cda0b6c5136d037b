"""Λ(2) of random systems of 1 to 4 variables with delays under white and coloured noise, by a discretised segment.

`python -m tests.random_delays [first last simulated]` prints for each system how far `segments` with three numbers of
nodes are from `even_moment`, the order at which they come nearer, the stated error and the seconds of the processor,
and for simulated = 1 how many standard errors a simulation is away. Delays are one, or two in the ratio 1 : 2 or 2 : 3;
noises multiply the state and its past.
"""

import math
import sys
import time

import numpy as np
from numpy.polynomial.hermite_e import hermegauss, hermeval

from fpsolve import OrnsteinUhlenbeck, Problem
from fpsolve.model import MarkovChain, White
from fpsolve.model.systems.equations import EquationSystem
from fpsolve.simulation import simulate
from fpsolve.simulation.setup import simulated_parts, transient
from fpsolve.theory import even_moment
from tests.oracles.segments import Segment, written

KINDS = "white", "two white", "stratonovich", "gaussian", "chain", "chain and white"
POINTS = 14
"""Values that stand for Gaussian noise."""


def gaussian(alpha: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Values of Gaussian noise at the points of a rule, and the generator on functions through these."""
    z, weights = hermegauss(POINTS)
    weights /= weights.sum()
    table = np.array([hermeval(z, np.eye(POINTS)[k]) / math.sqrt(math.factorial(k)) for k in range(POINTS)])
    return size * z, -alpha * (table.T * np.arange(POINTS)) @ table * weights


def drawn(seed: int):
    """A random system, what it is in words, and a discretised segment of it as a function of the number of nodes."""
    rng = np.random.default_rng([56, seed])
    n, kind = 1 + seed // len(KINDS) % 4, KINDS[seed % len(KINDS)]
    tau, count = math.exp(rng.uniform(-1.0, 1.2)), rng.integers(1, 4)
    delays = [(tau,), (tau / 2, tau), (2 * tau / 3, tau)][count - 1]

    def terms(size: float):
        parts = rng.standard_normal((1 + len(delays), n, n)) * size / math.sqrt(n)
        return list(zip((0.0, *delays), parts, strict=True))

    size = math.exp(rng.uniform(-1.5, 0.0))
    drift, load, other = terms(1.0), terms(size), terms(size)
    drift[0] = 0.0, drift[0][1] - rng.uniform(0.5, 2.0) * np.eye(n)
    names, free = "xyzu"[:n], [("", drift), ("w*", load)]
    states, rates, still = np.zeros(1), np.zeros((1, 1)), drift
    noises = {"w": White(s=1.0, interpretation="stratonovich" if kind == "stratonovich" else "ito")}
    white, coloured = [load], []
    if kind == "two white":
        white, noises["v"] = [load, other], White(s=1.0, interpretation="ito")
        free.append(("v*", other))
    elif kind == "stratonovich":  # A + ½α², B + ½αβ
        still = [(delay, a + 0.5 * load[0][1] @ c) for (delay, a), (_, c) in zip(drift, load, strict=True)]
    elif kind != "white":
        rate = math.exp(rng.uniform(-0.5, 1.0))
        if kind == "gaussian":
            noises["w"], (states, rates) = OrnsteinUhlenbeck(rate, 0.5 * math.sqrt(2 * rate)), gaussian(rate, 0.5)
        else:
            rates = rng.uniform(0.1, 1.5, (3, 3)) + np.array([[0, 2, 0], [0, 0, 2], [2, 0, 0]])
            states = rng.uniform(-1.5, 1.5, 3)
            np.fill_diagonal(rates, 0.0)
            noises["w"] = MarkovChain(states, rates)
            rates = rates - np.diag(rates.sum(axis=1))
        white, coloured = [], load
        if kind == "chain and white":
            white, noises["v"] = [other], White(s=1.0, interpretation="ito")
            free.append(("v*", other))
    sections = tuple((name, f"noise.{name}" if len(noises) > 1 else "noise") for name in noises)
    system = EquationSystem(tuple(names), written(free, names), (), sections)
    problem = Problem(system, noises if len(noises) > 1 else noises["w"])
    words = f"{kind}, n = {n}, {len(delays)} delays"
    return problem, words, lambda nodes: Segment(still, coloured, white, states, rates, nodes)


def compared(seed: int, sizes=(6, 12, 24)) -> tuple[bool, str]:
    """Whether segments come nearer with more nodes, and a line that says it."""
    problem, words, segment = drawn(seed)
    started = time.process_time()
    found = even_moment(problem, 2, rtol=1e-9)
    seconds = time.process_time() - started
    start = found.value + 0.5 * (1 + abs(found.value))
    off = [segment(size).exponent(start) - found.value for size in sizes]
    order = math.log(abs(off[0] / off[-1])) / math.log(sizes[-1] / sizes[0])
    is_near = abs(off[-1]) <= max(found.error + 1e-9, abs(off[0]) * (sizes[0] / sizes[-1]) ** 0.8)
    told = f"{found.value:13.9f} off {' '.join(f'{each:8.1e}' for each in off)} order {order:4.1f}"
    return is_near, f"{seed:4} {words:33} {told} stated {found.error:.0e} {seconds:.2f} s{' !' * (not is_near)}"


def simulated(seed: int, paths: int = 65_536, transients: int = 4) -> float:
    """How many standard errors a simulation is away; NaN where too few paths carry the mean square."""
    problem, _, _ = drawn(seed)
    time = transients * transient(*simulated_parts(problem))
    (found,) = simulate(problem, 2.0, estimator="population", paths=paths, time=time, seed=seed).estimates
    if found.value is None:
        return math.nan
    return (found.value - even_moment(problem, 2, rtol=1e-6).value) / found.standard_error


def main(first: int = 1, last: int = 24, is_simulated: int = 0) -> None:
    """Print what each system gives."""
    wrong = 0
    for seed in range(first, last + 1):
        is_near, line = compared(seed)
        away = simulated(seed) if is_simulated else 0.0
        wrong += not is_near or abs(away) > 4
        print(line, f"{away:5.1f} standard errors" if is_simulated else "", flush=True)
    print(wrong, "differ")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
