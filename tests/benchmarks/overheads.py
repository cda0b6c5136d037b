"""Processor time beside single solves: starts, sweeps, charts, proofs: `python -m tests.benchmarks.overheads [WORD …]`.

Each row is a function that returns what it measured by name. Words choose the rows whose name has one of them. Compiled
files of Python are kept in a folder of their own, so that a first import does not count.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, boundary, load_case, prove
from fpsolve.analysis import Axis
from fpsolve.pool import parallel
from fpsolve.theory import scale_of
from fpsolve.workflow import run_case
from tests.benchmarks.rows import Row, print_rows
from tests.kit import case_text
from tests.random_proofs import SHARES, drawn

ROUNDS, PROOFS = 5, 100
FIRST = """
from fpsolve import NonGaussianNoise, VibroImpactOscillator, moment_lyapunov
oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
moment_lyapunov(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction(), 2.0)
"""
WEAK = """[moments]
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


def used(whose: int) -> float:
    """Processor time of this process, or of those that it started and that have ended."""
    found = resource.getrusage(whose)
    return found.ru_utime + found.ru_stime


def shortest(commands: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """Processor time of commands of Python, called in turns."""
    best = dict.fromkeys(commands, float("inf"))
    with tempfile.TemporaryDirectory() as folder:
        settings = {**os.environ, "PYTHONPYCACHEPREFIX": folder, "OPENBLAS_NUM_THREADS": "1"}
        settings.pop("PYTHONDONTWRITEBYTECODE", None)
        for _ in range(ROUNDS):
            for name, command in commands.items():
                before = used(resource.RUSAGE_CHILDREN)
                subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL, env=settings)
                best[name] = min(best[name], used(resource.RUSAGE_CHILDREN) - before)
    return best


def starts() -> dict[str, float]:
    """The command line and the first number beside the packages that they need."""
    cyclopts, packages = "import cyclopts", "import skfem, pydantic"
    found = shortest(
        {"fpsolve --help": ["-m", "fpsolve", "--help"]}
        | {name: ["-c", name] for name in (cyclopts, packages)}
        | {"first Λ(2)": ["-c", FIRST]}
    )
    ratios = {
        "help to cyclopts": found["fpsolve --help"] / found[cyclopts],
        "first Λ(2) to packages": found["first Λ(2)"] / found[packages],
    }
    return found | ratios


def swept(size: int) -> tuple[int, float, float]:
    """The sets of a sweep in weak noise by two processes, the time of this one, and that of both."""
    with tempfile.TemporaryDirectory() as name:
        (place := Path(name) / "weak.toml").write_text(case_text(WEAK.format(size=size)), encoding="utf-8")
        case, own, others = load_case(place), used(resource.RUSAGE_SELF), used(resource.RUSAGE_CHILDREN)
        run_case(case, name, pool=parallel(2, case.planned))
        return case.planned, used(resource.RUSAGE_SELF) - own, used(resource.RUSAGE_CHILDREN) - others


def sweep() -> dict[str, float]:
    """What another set costs, of which this process writes the tables."""
    (few, *before), (many, *after) = map(swept, SIZES)
    own, others = ((late - early) / (many - few) for early, late in zip(before, after, strict=True))
    return {"all, ms": 1e3 * (own + others), "main process, ms": 1e3 * own, "share of it": own / (own + others)}


def chart(alpha: tuple[float, float], sigma: tuple[float, float]) -> dict[str, float]:
    """Λ(2) = 0 of ẍ + 0.2ẋ + (1 + ξ)x = 0 under Ornstein-Uhlenbeck noise."""
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 2*zeta*v - xi*x"), {"zeta": 0.1})
    problem = Problem(system, OrnsteinUhlenbeck(alpha=1.0, sigma=1.0))
    started = time.process_time()
    found = boundary(problem, {"moment": 2.0}, Axis("noise.alpha", *alpha), Axis("noise.sigma", *sigma))
    return {"seconds": time.process_time() - started, "points": sum(len(trace.points) for trace in found.traces)}


def proofs() -> dict[str, float]:
    """Of random problems, to 1e-8 of the scale."""
    found = []
    for seed in range(PROOFS):
        problem, p = drawn(seed)
        scale = max(abs(ExponentSolver(problem).moments([p]).value[0]), float(scale_of(problem).moment(p)))
        started = time.process_time()
        prove(problem, p, width=SHARES[0] * scale)
        found.append(time.process_time() - started)
    return {"median, seconds": float(np.median(found)), "at most": max(found)}


ROWS: Sequence[Row] = (
    Row("starts, seconds", "1.3 and 1.1", starts),
    Row("another set in a sweep by two processes, one p in weak noise", "2.0 ms, of it 5 % by the main process", sweep),
    Row("chart of a damped oscillator, α 0.5-2, σ 0.1-1", "3 s", partial(chart, (0.5, 2.0), (0.1, 1.0))),
    Row("the same, α 0.1-2, σ 0.1-2", "8 s", partial(chart, (0.1, 2.0), (0.1, 2.0))),
    Row("prove, 100 random problems", "0.3 s", proofs),
)


if __name__ == "__main__":
    print_rows(ROWS, sys.argv[1:])
