"""Λ(2) of random linear systems in the plane by simulation, under every kind of noise, with and without a wall.

`python -m tests.random_simulations [first last]` prints for each system how far the simulation is from the finite
elements, in standard errors; `tests.random_systems` compares these with oracles.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.exponent.function import moment_lyapunov
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, SineWiener, White
from fpsolve.model.noise import Noise
from fpsolve.simulation.estimators import simulate
from fpsolve.simulation.setup import transient

P, RTOL, SYSTEMS = 2.0, 1e-6, 200
KINDS = ("white", "telegraph", "chain", "ornstein-uhlenbeck", "reduced", "sine-wiener", "non-gaussian")
PATHS, TRANSIENTS = 8192, 24
MOST, USUAL = 4.0, 3.0
"""Standard errors within which all shall be, and those beyond which 2 % may be."""


def drawn(seed: int) -> tuple[str, Problem]:
    """The kind of noise and the system: every kind in turn; half of the A₀ turn, half of the systems have a wall.

    White noise leaves the phase alone at a wall, as does other noise in half of the systems with one.
    """
    rng = np.random.default_rng([2027, seed])
    kind = KINDS[seed % len(KINDS)]
    steady = rng.standard_normal((2, 2))
    if rng.random() < 0.5:
        steady = 0.3 * steady + rng.uniform(0.5, 3.0) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    driven = rng.standard_normal((2, 2))
    driven *= rng.uniform(0.1, 1.0) / np.linalg.norm(driven, 2)
    jumps: tuple[Jump, ...] = ()
    if rng.random() < 0.5:
        phase = rng.uniform(0, math.pi)
        jumps = (Jump(phase, math.log(rng.uniform(0.6, 1.0))),)
        if kind == "white" or rng.random() < 0.5:
            along = np.array([math.cos(phase), -math.sin(phase)])
            across = np.array([along[1], -along[0]])
            driven -= np.outer(across, along) * (across @ driven @ along)
    terms = [CoefficientMatrix(0, steady.tolist()), CoefficientMatrix(1, driven.tolist(), identity)]
    return kind, Problem(PlaneSystem(terms, jumps), _noise(kind, rng))


def _noise(kind: str, rng: np.random.Generator) -> Noise:
    """Of a standard deviation about 1, and correlation times from 0.2 to 3."""
    time = float(np.exp(rng.uniform(math.log(0.2), math.log(3.0))))
    match kind:
        case "white":
            return White(s=1.0, interpretation=("stratonovich", "ito")[rng.integers(2)])
        case "telegraph":
            return MarkovChain.telegraph(1.0, 0.5 / time)
        case "chain":
            count = int(rng.integers(3, 6))
            rates = rng.exponential(1 / (count * time), (count, count)) * (1 - np.eye(count))
            return MarkovChain(rng.standard_normal(count).tolist(), rates.tolist())
        case "ornstein-uhlenbeck":
            return OrnsteinUhlenbeck(alpha=1 / time, sigma=math.sqrt(2 / time))
        case "sine-wiener":
            return SineWiener(amplitude=math.sqrt(2.0), sigma=math.sqrt(2 / time))
    known = NonGaussianNoise(D0=time, tau0=time, r0=float(rng.uniform(0.6, 0.95)))
    return known if kind == "non-gaussian" else known.ou_reduction()


@dataclass(frozen=True)
class Outcome:
    """What was found of a system; NaN where too few paths carry the moment.

    Attributes:
        value, stated: Λ(2) by the finite elements, and its error estimate.
        simulated, standard_error: Λ(2) by simulation.
    """

    value: float
    stated: float
    simulated: float = math.nan
    standard_error: float = math.nan

    @property
    def deviation(self) -> float:
        """Of the simulation from the finite elements, in standard errors."""
        return (self.simulated - self.value) / math.hypot(self.standard_error, self.stated)


def outcome(problem: Problem, *, paths: int = PATHS, transients: int = TRANSIENTS, seed: int = 1) -> Outcome:
    """Λ(2) by both; with four times the paths where too few of them carry it. Raises `FpsolveError`."""
    found = moment_lyapunov(problem, [P], rtol=RTOL)
    value, stated = float(found.value[0]), float(found.error_estimate[0])
    length = transients * transient(problem.system, problem.noise)
    for more in (1, 4):
        made = simulate(problem, [P], estimator="population", paths=more * paths, time=length, seed=seed)
        estimate = made.estimates[0]
        if estimate.value is not None and estimate.standard_error is not None:
            return Outcome(value, stated, estimate.value, estimate.standard_error)
    return Outcome(value, stated)


def main(first: int = 0, last: int = SYSTEMS - 1) -> None:
    """Print a line for each system, and how many agree."""
    deviations = []
    for seed in range(first, last + 1):
        kind, problem = drawn(seed)
        started = time.process_time()
        head = f"{seed:4d} {kind:18s} {'wall' if problem.system.jumps else '    '}"
        try:
            found = outcome(problem)
        except FpsolveError as failure:
            print(f"{head} {str(failure)[:150]}", flush=True)
            continue
        seconds = time.process_time() - started
        deviations.append(found.deviation)
        print(
            f"{head} {found.value:12.7g}, simulated {found.simulated:11.6g} ± {found.standard_error:.1e}, "
            f"{found.deviation:+.1f} standard errors, {seconds:.1f} s", flush=True,
        )  # fmt: skip
    sizes = np.abs(np.array(deviations)[np.isfinite(deviations)])
    print(
        f"{sizes.size} of {last - first + 1} have both; beyond {USUAL:g} standard errors: "
        f"{np.count_nonzero(sizes > USUAL)}, beyond {MOST:g}: {np.count_nonzero(sizes > MOST)}"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
