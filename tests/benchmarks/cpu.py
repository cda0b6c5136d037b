"""CPU time of fpsolve beside its best peers, in one process and on one thread: `python -m tests.benchmarks.cpu`.

All runs of a case take turns, so that whatever else the machine does harms them alike, and the shortest of each counts.
The time of fpsolve, and of the code that certifies its size, is that of everything, error estimates and the choice of a
discretisation too; the tuned code knows its size.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov
from tests.benchmarks.certified import CertifiedFourierHermite
from tests.benchmarks.fourier_hermite import TUNED, FourierHermite
from tests.benchmarks.problem import CASES, Case, FloatArray
from tests.benchmarks.references import REFERENCES
from tests.oracles.perturbation import moment_scale

FIG1 = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
ALONE = {
    "slow": (Problem(FIG1, NonGaussianNoise(D0=1.0, tau0=20.0, r0=1.0).ou_reduction()), np.linspace(-2, 6, 33)),
    "exact noise": (Problem(FIG1, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)), np.linspace(-2, 6, 33)),
}
"""Curves that no peer computes, at rtol = 1e-8."""
ROUNDS = {"weak": 15, "strong": 5}


def fpsolve_curve(problem: Problem, p: FloatArray, rtol: float) -> FloatArray:
    """Λ at every p."""
    return moment_lyapunov(problem, p, rtol=rtol).value


def contenders(case: Case) -> dict[str, Callable[[], FloatArray]]:
    """The curve of a case by fpsolve and by two Fourier-Hermite codes."""

    def tolerance(p: float, value: float) -> float:
        return case.rtol * max(abs(value), float(moment_scale(case.oscillator, case.noise, p)))

    return {
        "fpsolve": partial(fpsolve_curve, Problem(case.oscillator, case.noise), case.p, case.rtol),
        "tuned": lambda: FourierHermite(case.problem, TUNED[case.name]).moments(case.p),
        "certified": lambda: CertifiedFourierHermite(case.problem, tolerance).moments(case.p),
    }


def cpu_seconds(functions: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """The shortest CPU time of each function, called in turns."""
    best = dict.fromkeys(functions, float("inf"))
    with threadpool_limits(1):
        for _ in range(rounds):
            for name, function in functions.items():
                started = time.thread_time()
                function()
                best[name] = min(best[name], time.thread_time() - started)
    return best


def race(case: Case, reference: FloatArray, rounds: int) -> dict[str, float]:
    """CPU time of each contender, all of which must be as accurate as the case demands."""
    functions = contenders(case)
    for name, curve in functions.items():
        error = case.relative_error(curve(), reference)
        if error > case.rtol:
            raise ArithmeticError(f"{name} misses the accuracy of the {case.name} case: {error:.1e}")
    return cpu_seconds(functions, rounds)


def main() -> None:
    """Print everything."""
    table = Table("33 moments", "fpsolve / ms", "tuned / ms", "certified / ms", "to tuned", "to certified")
    for name, case in CASES.items():
        found = race(case, REFERENCES[name], ROUNDS[name])
        own = found["fpsolve"]
        ratios = (f"{own / found[peer]:.2f}" for peer in ("tuned", "certified"))
        table.add_row(f"{name}, rtol {case.rtol:g}", *(f"{1e3 * each:.1f}" for each in found.values()), *ratios)
    alone = {name: partial(fpsolve_curve, problem, p, 1e-8) for name, (problem, p) in ALONE.items()}
    for name, seconds in cpu_seconds(alone, 5).items():
        table.add_row(f"{name}, rtol 1e-08", f"{1e3 * seconds:.1f}", *[""] * 4)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
