"""Random parameter sets over the whole range that fpsolve is made for, each with an independent reference value.

`python -m tests.random_problems [first last]` prints the errors, the error estimates and the times.
"""

from __future__ import annotations

import itertools
import math
import sys
import time
from dataclasses import dataclass

import numpy as np

import fpsolve
from fpsolve import ExponentSolver, NonGaussianNoise, VibroImpactOscillator
from fpsolve.errors import NotConverged
from fpsolve.exponent import PrincipalPair, principal_pair
from fpsolve.model import Noise
from tests.oracles import fourier_hermite

RTOL = 1e-8
SIZES = ((8, 16), (12, 24), (18, 36), (27, 54), (40, 81), (60, 121))
"""Harmonics and polynomials of the oracle, tried until two agree."""


@dataclass(frozen=True)
class Problem:
    """One parameter set."""

    oscillator: VibroImpactOscillator
    noise: Noise
    p: float

    @property
    def solved(self) -> fpsolve.Problem:
        return fpsolve.Problem(self.oscillator, self.noise)


@dataclass(frozen=True)
class Outcome:
    """What fpsolve found for a problem, relative to max(|Λ|, the scale).

    Attributes:
        error: |value − reference|.
        estimate: the error estimate.
        doubt: how far the reference itself may be off.
        seconds: CPU time of the solve.
        reference: which code it came from.
    """

    problem: Problem
    error: float
    estimate: float
    doubt: float
    seconds: float
    reference: str


def problems(count: int, seed: int = 2026) -> list[Problem]:
    """ε, τ₀, D₀ log-uniform, the others uniform; either noise treatment as likely."""
    rng = np.random.default_rng(seed)

    def log_uniform(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    found = []
    for _ in range(count):
        epsilon, tau0, D0 = log_uniform(0.01, 2), log_uniform(1e-4, 20), log_uniform(0.01, 2)
        omega, r, c1, p, r0 = (
            float(rng.uniform(*ends)) for ends in ((0.3, 10), (0.5, 1), (-0.5, 0.5), (-3, 10), (0.6, 1))
        )
        original = NonGaussianNoise(D0=D0, tau0=tau0, r0=r0)
        noise = original if rng.random() < 0.5 else original.ou_reduction()
        found.append(Problem(VibroImpactOscillator(omega=omega, restitution=r, c1=c1, epsilon=epsilon), noise, p))
    return found


def solve(problem: Problem) -> Outcome | str:
    """The outcome, or why fpsolve refused."""
    started = time.thread_time()
    solver = ExponentSolver(problem.solved, rtol=RTOL)
    try:
        solution = solver.solution(problem.p)
    except NotConverged as failure:
        return str(failure)
    seconds = time.thread_time() - started
    size = max(abs(solution.pair.value), solver.scale(problem.p))
    known = _oracle(problem, size)
    name = "polynomials"
    if known is None:
        name, known = "finer mesh", _finer(solution.pair)
    value, doubt = known
    return Outcome(problem, abs(solution.pair.value - value) / size, solution.error / size, doubt / size, seconds, name)


def _oracle(problem: Problem, size: float) -> tuple[float, float] | None:
    """Λ by Fourier series and orthogonal polynomials, sought from the right; and its uncertainty, or None."""
    oscillator, noise = problem.oscillator, problem.noise
    common = {
        "omega": oscillator.omega, "epsilon": oscillator.epsilon, "c1": oscillator.c1,
        "log_R": oscillator.log_impact_factor, "p": problem.p,
    }  # fmt: skip
    last = math.inf
    for harmonics, order in SIZES:
        if isinstance(noise, NonGaussianNoise):
            own = {"D0": noise.D0, "tau0": noise.tau0, "r0": noise.r0, "gegenbauer": order}
            compute = fourier_hermite.moment_lyapunov_bounded_noise
        else:
            own = {"alpha": noise.alpha, "sigma": noise.sigma, "hermite": order}
            compute = fourier_hermite.moment_lyapunov
        try:
            value = compute(**common, **own, harmonics=harmonics)
        except (ValueError, ArithmeticError, RuntimeError):
            value = math.nan
        if abs(value - last) <= 1e-11 * size:
            return value, abs(value - last) + 1e-14 * size
        last = value
    return None


def _finer(pair: PrincipalPair) -> tuple[float, float]:
    """Λ with four degrees more each way, and its distance from that with two more."""
    generator, values = pair.generator, []
    for _ in range(2):
        generator = generator.enriched()
        values.append(principal_pair(generator, pair.p, start=pair).value)
    return values[1], abs(values[1] - values[0])


def main(first: int = 0, last: int = 299) -> None:
    """Print the outcomes of problems, the histogram of estimate over error, and the times."""
    outcomes = [solve(problem) for problem in problems(last + 1)[first:]]
    solved = [outcome for outcome in outcomes if isinstance(outcome, Outcome)]
    for text in outcomes:
        if isinstance(text, str):
            print("refused:", text)
    print(f"{len(solved)} solved; largest error {max(each.error for each in solved):.1e} of max(|Λ|, scale)")
    telling = [each for each in solved if each.error > 3 * each.doubt]
    ratios = np.array([each.estimate / each.error for each in telling])
    edges = (0, 1 / 3, 0.5, 0.9, 1.1, 2, 10, 100, 1000, math.inf)
    for low, high in itertools.pairwise(edges):
        print(f"estimate/error from {low:.2g} to {high:.2g}: {np.count_nonzero((ratios >= low) & (ratios < high))}")
    print(f"error below what the reference can tell: {len(solved) - len(telling)}")
    seconds = np.array([each.seconds for each in solved])
    print(f"time: median {np.median(seconds):.3f} s, largest {seconds.max():.2f} s")
    print(
        "checked by:", {name: sum(each.reference == name for each in solved) for name in ("polynomials", "finer mesh")}
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
