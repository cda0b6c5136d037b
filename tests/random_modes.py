"""λ, Λ(1) and Λ(−1) of random linear systems of three and four variables: finite elements against the simulation.

`python -m tests.random_modes [first last]` prints for each system what both give, how far they are from each other in
standard errors, and the errors stated; at last how many are given, refused and wrong. Damping is 0.1 % to 30 %, noise
weak to strong: white, Ornstein-Uhlenbeck, telegraph, and a filter's.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from fpsolve import OrnsteinUhlenbeck, Problem, lyapunov_exponent, moment_lyapunov, simulate
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from fpsolve.messages import Code
from fpsolve.model import CoefficientMatrix, Filter, LinearSystem, Noise, Telegraph, White
from fpsolve.simulation import MonteCarlo
from fpsolve.simulation.coefficients import coefficients
from fpsolve.simulation.setup import default_step, transient
from tests.random_simulations import Outcome

ORDERS = (1.0, -1.0)
RTOL, SECONDS, SYSTEMS, MOST = 1e-5, 60.0, 60, 4.0
KINDS = ("white", "ornstein-uhlenbeck", "telegraph", "filter")
PATH_STEPS = 3e7
"""Of one simulation, about: some seconds."""
FEWEST = 4096
"""Paths, however long they are."""


def drawn(seed: int) -> tuple[str, Problem]:
    """What it is called, and the problem: kinds and dimensions in turn."""
    rng = np.random.default_rng([2031, seed])
    kind, n = KINDS[seed % 4], 3 + seed // 4 % 2
    frequencies = np.cumprod([1.0, rng.uniform(1.1, 3.0)])
    dampings = np.exp(rng.uniform(math.log(1e-3), math.log(0.3), 2))
    steady, driven = np.zeros((n, n)), np.zeros((n, n))
    for k in range(n // 2):
        omega, at = frequencies[k], slice(2 * k, 2 * k + 2)
        steady[at, at] = [[0.0, omega], [-omega, -2 * dampings[k] * omega]]
    if n == 3:  # an oscillator with a current that it drives and that acts upon it
        decay, coupling = rng.uniform(0.2, 2.0), rng.uniform(0.05, 0.5)
        steady[2, 2], steady[2, 1], steady[1, 2] = -decay, coupling, -coupling
        driven[1::2, 0], driven[1, 2], driven[2] = 1.0, rng.normal() / 2, rng.normal(size=3) / 3
    else:
        driven[np.ix_((1, 3), (0, 2))] = rng.normal(size=(2, 2))
        driven[np.ix_((1, 3), (1, 3))] = rng.normal(size=(2, 2)) / 4
    driven *= math.exp(rng.uniform(math.log(0.05), math.log(0.8))) / np.linalg.norm(driven, 2)
    terms = CoefficientMatrix(0, steady.tolist()), CoefficientMatrix(1, driven.tolist(), identity)
    return f"{kind}, n = {n}", Problem(LinearSystem(terms), random_noise(kind, rng))


def random_noise(kind: str, rng: np.random.Generator) -> Noise:
    """Of a standard deviation of 1 and correlation times from 0.3 to 2, or s = 1."""
    memory = math.exp(rng.uniform(math.log(0.3), math.log(2.0)))
    match kind:
        case "white":
            return White(s=1.0)
        case "telegraph":
            return Telegraph(a=1.0, k=0.5 / memory)
        case "ornstein-uhlenbeck":
            return OrnsteinUhlenbeck(alpha=1 / memory, sigma=math.sqrt(2 / memory))
    omega, zeta = rng.uniform(0.7, 3.0), rng.uniform(0.2, 0.9)
    return Filter(omega, zeta, 1 / Filter(omega, zeta, 1.0).standard_deviation)


def by_simulation(
    problem: Problem,
    orders: Sequence[float] = ORDERS,
    *,
    path_steps: float = PATH_STEPS,
    fewest: int = FEWEST,
    seed: int = 1,
) -> MonteCarlo:
    """By populations, some 24 transients long, of `fewest` paths or as many as the path-steps allow."""
    parts = problem.system, problem.noise
    length = max(2 * transient(*parts), 24 * transient(*parts, is_mixed=False))
    steps = (length + 2 * coefficients(*parts).settling) / default_step(*parts)
    paths = min(32768, max(fewest, 32 * round(path_steps / steps / 32)))
    return simulate(problem, list(orders), estimator="population", paths=paths, time=length, seed=seed)


def by_elements(
    problem: Problem, orders: Sequence[float] = ORDERS, rtol: float = RTOL
) -> list[tuple[float, float] | str]:
    """λ and Λ(p) with the errors stated, or why there is none."""
    budget, found = Budget(seconds=SECONDS), list[tuple[float, float] | str]()
    try:
        rate = lyapunov_exponent(problem, rtol=rtol, budget=budget)
        found.append((rate.value, rate.error_estimate))
    except FpsolveError as failure:
        found.append(str(failure))
    for p in orders:
        try:
            made = moment_lyapunov(problem, p, rtol=rtol, budget=budget)
            found.append((float(made.value[0]), float(made.error_estimate[0])))
        except FpsolveError as failure:
            found.append(str(failure))
    return found


def outcomes(
    problem: Problem, orders: Sequence[float] = ORDERS, rtol: float = RTOL, **size: Any
) -> list[Outcome | str]:
    """λ and Λ(p) by both, or why the elements give none. A number that the simulation does not give is NaN.

    So is one of which it says that it still drifts, as its standard error then does not tell how far it is.
    """
    made = by_simulation(problem, orders, **size)
    drifting = {each.data["p"] for each in made.warnings if each.code is Code.DRIFTING}
    moments = [
        (math.nan, math.nan) if each.p in drifting else (each.value or math.nan, each.standard_error or math.nan)
        for each in made.estimates
    ]
    simulated = [(made.lyapunov_exponent, made.lyapunov_exponent_error), *moments]
    return [
        each if isinstance(each, str) else Outcome(*each, *pair)
        for each, pair in zip(by_elements(problem, orders, rtol), simulated, strict=True)
    ]


def compare(
    systems: Iterable[tuple[str, Problem]], orders: Sequence[float], both: Callable[[Problem], list[Outcome | str]]
) -> None:
    """Print a line for each number, and how many are given, refused and wrong; `both` as `outcomes`."""
    given = refused = wrong = unknown = complete = count = 0
    for name, problem in systems:
        started = time.process_time()
        found = both(problem)
        count += 1
        print(f"{name}, {time.process_time() - started:.1f} s", flush=True)
        for symbol, each in zip(("λ", *(f"Λ({p:g})" for p in orders)), found, strict=True):
            if isinstance(each, str):
                refused += 1
                print(f"      {symbol:6s} refused: {' '.join(each.split())[:200]}", flush=True)
                continue
            given += 1
            unknown += not math.isfinite(each.deviation)
            wrong += abs(each.deviation) > MOST
            sign = " WRONG" if abs(each.deviation) > MOST else ""
            print(f"      {symbol:6s} {each}, stated {each.stated:.1e}{sign}", flush=True)
        complete += not any(isinstance(each, str) for each in found)
    print(
        f"{complete} of {count} systems given in full; of the numbers {given} given, {refused} refused, "
        f"{wrong} wrong, beyond {MOST:g} standard errors, {unknown} without one by simulation"
    )


def numbered(draw: Callable[[int], tuple[str, Problem]], first: int, last: int) -> Iterator[tuple[str, Problem]]:
    """The systems of some numbers, with these before what they are called."""
    for seed in range(first, last + 1):
        kind, problem = draw(seed)
        yield f"{seed:3d} {kind}", problem


if __name__ == "__main__":
    compare(numbered(drawn, *map(int, sys.argv[1:] or (0, SYSTEMS - 1))), ORDERS, outcomes)
