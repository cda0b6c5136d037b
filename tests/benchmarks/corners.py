"""Processor time of slow corners, on one thread: `python -m tests.benchmarks.corners [WORD …]`.

Each row is a function that returns what it measured, in seconds by name. Words choose the rows whose name has one of
them.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator
from fpsolve.analysis.sensitivity import solve_sensitivities
from fpsolve.errors import NotConverged
from fpsolve.exponent.root import nonzero_root
from tests.benchmarks.cpu import race
from tests.benchmarks.problem import CASES
from tests.benchmarks.rows import Row, print_rows

ROUNDS = 5
PROOFS = 100
OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
SLOWNESS, SIZES, MOMENTS = (1.0, 10.0, 100.0), (0.3, 1.0, 2.0), (-3.0, 1.0, 4.0)
"""τ₀, standard deviations and p of the 54 problems."""
LAYERED = (100.0, 2.0)
"""Their slowest and strongest noise."""
"""r₀ of algebraic tails."""


def seconds(solve: Callable[[], Any], rounds: int = 1) -> float:
    """The shortest time of several, negative where it does not converge."""
    found = []
    for _ in range(rounds):
        started, sign = time.thread_time(), 1
        try:
            solve()
        except (NotConverged, MemoryError):
            sign = -1
        found.append(sign * (time.thread_time() - started))
    return min(found, key=abs)


def slow_noise(tau0: float, std: float, r0: float = 0.8) -> NonGaussianNoise:
    """The noise of Eq. (7) with a standard deviation, Eq. (10)."""
    return NonGaussianNoise(D0=0.5 * std**2 * tau0 * (5 - 3 * r0), tau0=tau0, r0=r0)


def one_moment(noise: Any, p: float, oscillator: VibroImpactOscillator = OSCILLATOR) -> float:
    """Of Λ(p)."""
    return seconds(lambda: ExponentSolver(Problem(oscillator, noise)).solution(p))


def derivatives() -> dict[str, float]:
    """Everything that is asked of one parameter set, each with a solver of its own."""
    oscillator = VibroImpactOscillator(omega=1.7, restitution=0.9, c1=0.1, epsilon=0.6)
    problem = Problem(oscillator, NonGaussianNoise(D0=0.4, tau0=0.5, r0=0.9))
    p = np.array([-2.0, -1.0, 1.0, 2.0])
    values = {
        "four Λ(p)": lambda solver: solver.moments(p),
        "λ": lambda solver: solver.lyapunov_exponent(),
        "δ_p": nonzero_root,
        "Λ″(0)": lambda solver: solver.variance_rate(),
    }

    def everything(solver: ExponentSolver) -> dict[str, Any]:
        return {name: solve(solver) for name, solve in values.items()}

    def sensitivities(solver: ExponentSolver) -> None:
        root = everything(solver)["δ_p"].value
        solve_sensitivities(solver, p, problem.derivatives(), root=root)

    solves = {**values, "all four": everything, "with sensitivities": sensitivities}
    return {name: seconds(lambda solve=solve: solve(ExponentSolver(problem)), ROUNDS) for name, solve in solves.items()}


def resonance() -> dict[str, float]:
    """Slow noise of which paths that hold it make the phase come to rest."""
    return {"p = 1": one_moment(slow_noise(10.0, 0.3).ou_reduction(), 1.0)}


def layers() -> dict[str, float]:
    """Slow and strong noise."""
    return {f"p = {p:g}": one_moment(slow_noise(*LAYERED).ou_reduction(), p) for p in MOMENTS}


def nearly_gaussian() -> dict[str, float]:
    """Slow noise of D₀ = 1."""
    return {"p = 1": one_moment(NonGaussianNoise(D0=1.0, tau0=100.0, r0=0.95).ou_reduction(), 1.0)}


def all_slow() -> dict[str, float]:
    """The 54 problems: the longest times."""
    found = {}
    for tau0, std, p in itertools.product(SLOWNESS, SIZES, MOMENTS):
        exact = slow_noise(tau0, std)
        for treatment, noise in (("reduced", exact.ou_reduction()), ("exact", exact)):
            found[f"{treatment}, τ₀ = {tau0:g}, {std:g}, p = {p:g}"] = one_moment(noise, p)
    longest = sorted(found, key=lambda name: -abs(found[name]))[:8]
    return {name: found[name] for name in longest} | {"median": float(np.median(np.abs([*found.values()])))}


def strong() -> dict[str, float]:
    """33 moments by fpsolve and by peers that are as accurate."""
    found = race(CASES["strong"])
    return found | {"to tuned": found["fpsolve"] / found["tuned"]}


ROWS: Sequence[Row] = (
    Row("one set: ε = 0.6, ω = 1.7, r = 0.9, exact noise", "sensitivities as the values", derivatives),
    Row("reduced noise, τ₀ = 10, standard deviation 0.3", "1", resonance),
    Row("layers: reduced noise, τ₀ = 100, standard deviation 2", "2", layers),
    Row("reduced noise, τ₀ = 100, D₀ = 1, r₀ = 0.95", "2", nearly_gaussian),
    Row("54 problems of slow noise, the longest", "1", all_slow),
    Row("strong noise, 33 p, rtol 1e-6", "1.0 of the tuned code", strong),
)


if __name__ == "__main__":
    print_rows(ROWS, sys.argv[1:])
