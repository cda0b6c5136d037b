"""Processor time of what performance.md states beside cpu.py, on one thread: `python -m tests.benchmarks.pages [WORD]`.

Each row is a function that returns what it measured by name. Words choose the rows whose name has one of them. Files of
Python that a first command compiles are kept, so that this does not count.
"""

from __future__ import annotations

import itertools
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    boundary,
    moment_lyapunov,
    prove,
    sensitivities,
    stability_index,
)
from fpsolve.analysis import Axis
from tests.kit import case_text, rates

ROUNDS = 5
OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
FIRST = """
from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov
oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
moment_lyapunov(Problem(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()), 2.0)
"""
SWEEP = """[moments]
p = [2.0]
[vary]
"noise.D0" = {{ start = 0.1, stop = 1.0, num = {size} }}
"oscillator.omega" = {{ start = 0.5, stop = 3.0, num = {size} }}
[output]
figure = false
quantities = ["moment"]
"""
SIZES = 30, 60
"""Values of each key of a sweep; the difference of two sweeps is what a set costs in a long one."""


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


def one_moment(noise: Any, p: float) -> float:
    """Of Λ(p)."""
    return seconds(lambda: moment_lyapunov(Problem(OSCILLATOR, noise), p))


def numbers_of_a_set(rounds: int = ROUNDS) -> dict[str, float]:
    """What is asked of one parameter set."""
    oscillator = VibroImpactOscillator(omega=1.7, restitution=0.9, c1=0.1, epsilon=0.6)
    problem = Problem(oscillator, NonGaussianNoise(D0=0.4, tau0=0.5, r0=0.9))
    p = np.array([-2.0, -1.0, 1.0, 2.0])

    def together() -> None:
        solver = ExponentSolver(problem)
        moment_lyapunov(problem, p)
        solver.lyapunov_exponent()
        stability_index(problem)
        solver.variance_rate()

    solves = {"four Λ(p), λ, δ_p, Λ″(0)": together, "their derivatives": lambda: sensitivities(problem, p)}
    return {name: seconds(solve, rounds) for name, solve in solves.items()}


def slow(tau0: float, std: float, moments: Sequence[float]) -> dict[str, float]:
    """Reduced noise that is slow, and weak or strong."""
    return {f"p = {p:g}": one_moment(slow_noise(tau0, std).ou_reduction(), p) for p in moments}


def all_slow(taus: Sequence[float] = (1.0, 10.0, 100.0), sizes: Sequence[float] = (0.3, 1.0, 2.0)) -> dict[str, float]:
    """The median and the longest of 54 problems: p = −3, 1, 4, exact and reduced."""
    noises = [slow_noise(tau0, std) for tau0, std in itertools.product(taus, sizes)]
    every = [abs(one_moment(each, p)) for noise in noises for each in (noise, noise.ou_reduction()) for p in (-3, 1, 4)]
    return {"median": float(np.median(every)), "longest": max(every)}


def used(whose: int) -> float:
    """Processor time of this process, or of those that it started and that have ended."""
    found = resource.getrusage(whose)
    return found.ru_utime + found.ru_stime


def shortest(commands: Mapping[str, Sequence[str]], rounds: int) -> dict[str, float]:
    """Processor time of commands of Python, called in turns."""
    best = dict.fromkeys(commands, float("inf"))
    settings = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    settings.pop("PYTHONDONTWRITEBYTECODE", None)
    for _ in range(rounds):
        for name, command in commands.items():
            before = used(resource.RUSAGE_CHILDREN)
            subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL, env=settings)
            best[name] = min(best[name], used(resource.RUSAGE_CHILDREN) - before)
    return best


def starts(rounds: int = ROUNDS) -> dict[str, float]:
    """The command line and the first number beside the packages that they need."""
    cyclopts, packages = "import cyclopts", "import skfem, pydantic"
    commands = {"fpsolve --help": ["-m", "fpsolve", "--help"], "first Λ(2)": ["-c", FIRST]}
    found = shortest(commands | {name: ["-c", name] for name in (cyclopts, packages)}, rounds)
    ratios = found["fpsolve --help"] / found[cyclopts], found["first Λ(2)"] / found[packages]
    return found | dict(zip(("help to cyclopts", "first Λ(2) to packages"), ratios, strict=True))


def sweep(sizes: tuple[int, int] = SIZES) -> dict[str, float]:
    """What another set costs, by one process."""
    found = []
    for size in (sizes[0], *sizes):
        with tempfile.TemporaryDirectory() as folder:
            (place := Path(folder) / "weak.toml").write_text(case_text(SWEEP.format(size=size)), encoding="utf-8")
            command = ["-m", "fpsolve", "run", str(place), "--out", folder, "--jobs", "1"]
            found.append(shortest({"run": command}, 1)["run"])
    return {"ms": 1e3 * (found[2] - found[1]) / (sizes[1] ** 2 - sizes[0] ** 2)}


def chart(alpha: tuple[float, float], sigma: tuple[float, float], **options: Any) -> dict[str, float]:
    """Λ(2) = 0 of ẍ + 0.2ẋ + (1 + ξ)x = 0 under Ornstein-Uhlenbeck noise."""
    problem = rates("x' = v; v' = -x - 2*zeta*v - xi*x", OrnsteinUhlenbeck(alpha=1.0, sigma=1.0), zeta=0.1)
    axes = Axis("noise.alpha", *alpha), Axis("noise.sigma", *sigma)
    return {"seconds": seconds(lambda: boundary(problem, "moment(2) = 0", *axes, **options))}


def proofs(count: int = 50) -> dict[str, float]:
    """Of the paper's oscillator in noise from weak to strong, to the width that it has by default."""
    found = []
    for epsilon in np.geomspace(0.05, 1.0, count):
        oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=float(epsilon))
        problem = Problem(oscillator, NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.95).ou_reduction())
        found.append(seconds(lambda problem=problem: prove(problem, 1.0)))
    return {"median": float(np.median(found)), "at most": max(found)}


ROWS: Mapping[str, Callable[[], Mapping[str, float]]] = {
    "one set: ε = 0.6, ω = 1.7, r = 0.9, exact noise": numbers_of_a_set,
    "reduced noise, τ₀ = 10, standard deviation 0.3": partial(slow, 10.0, 0.3, (1.0,)),
    "layers: reduced noise, τ₀ = 100, standard deviation 2": partial(slow, 100.0, 2.0, (-3.0, 1.0, 4.0)),
    "54 problems of slow noise": all_slow,
    "starts": starts,
    "another set in a sweep, one p in weak noise": sweep,
    "chart of a damped oscillator, α 0.1-2, σ 0.1-2": partial(chart, (0.1, 2.0), (0.1, 2.0)),
    "prove": proofs,
}


def main(*words: str) -> None:
    """Print the rows whose name has one of some words, or all without words, each as it is measured."""
    for name, row in ROWS.items():
        if words and not any(word in name for word in words):
            continue
        table = Table(name, "seconds", min_width=70)
        with threadpool_limits(1):
            for what, each in row().items():
                table.add_row(what, f"{each:.3g}" if each >= 0 else f"not converged after {-each:.3g}")
        Console(width=100).print(table)


if __name__ == "__main__":
    main(*sys.argv[1:])
