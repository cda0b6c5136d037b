"""Simulation against finite elements over weak and strong noise: `python -m tests.agreement` prints the table.

90 combinations: ε = 0.1, 0.5, 1; r = 0.6, 0.8, 1; p = −1, ½, 1, 2, 4; the exact noise with r₀ = 0.9 and its reduction;
each by both estimators. The other parameters are those of Fig. 1 with D₀ = 0.5; the law of impact is that of Eq. (3).
Below it stands how far estimates of 64 seeds deviate, in their standard errors, which should be about 1, and their
mean from Λ(p); then the bias of a step and of half of it, beyond those that are allowed, of which a quarter, or less,
should be left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count, product
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    moment_lyapunov,
    simulate,
)
from fpsolve.arrays import FloatArray
from fpsolve.model import Noise
from fpsolve.simulation import MomentEstimate, estimators
from fpsolve.simulation.setup import default_step, largest_step, transient
from tests.simulation.problems import MODERATE, REDUCED, STRONG, exact

ORDERS = (-1.0, 0.5, 1.0, 2.0, 4.0)
NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9)
NOISES = {"reduced": NOISE.ou_reduction(), "exact": NOISE}
PATHS, LENGTH = 32_768, 16


@dataclass(frozen=True)
class Row:
    """One p of one parameter set: Λ(p) by finite elements and by simulation."""

    epsilon: float
    restitution: float
    noise: str
    p: float
    finite_elements: float
    simulated: MomentEstimate

    @property
    def deviation(self) -> float:
        """In standard errors; NaN where the estimator says that it has no estimate."""
        found = self.simulated
        if found.value is None or found.standard_error is None:
            return float("nan")
        return (found.value - self.finite_elements) / found.standard_error


Step = Callable[[VibroImpactOscillator, Noise], float]


def cheap_step(oscillator: VibroImpactOscillator, noise: Noise) -> float:
    """For Eq. (7) about the largest step that is allowed, which takes half the time; for other noise the default."""
    if not isinstance(noise, NonGaussianNoise) or noise.r0 == 1:
        return default_step(oscillator, noise)
    half_turn = math.pi / oscillator.omega
    return half_turn / math.ceil(half_turn / largest_step(oscillator, noise)[0])


SETS = tuple(product((0.1, 0.5, 1.0), (0.6, 0.8, 1.0), NOISES))
"""ε, r and the noise of all combinations but p."""


def rows(
    sets: Sequence[tuple[float, float, str]] = SETS,
    *,
    paths: int = PATHS,
    transients: int = LENGTH,
    first_seed: int = 0,
    step: Step = default_step,
) -> Iterator[Row]:
    """All p of some sets by both estimators, each simulation with a seed of its own."""
    seeds = count(first_seed)
    for epsilon, restitution, name in sets:
        noise = NOISES[name]
        oscillator = VibroImpactOscillator(
            omega=1.0, restitution=restitution, c1=0.1, epsilon=epsilon, impact="restitution"
        )
        exact = moment_lyapunov(Problem(oscillator, noise), ORDERS, rtol=1e-7).value
        time, h = transients * transient(oscillator, noise), step(oscillator, noise)
        for estimator in ("direct", "population"):
            found = simulate(
                Problem(oscillator, noise),
                ORDERS,
                estimator=estimator,
                paths=paths,
                time=time,
                step=h,
                seed=next(seeds),
            )
            for p, value, estimate in zip(ORDERS, exact, found.estimates, strict=True):
                yield Row(epsilon, restitution, name, p, float(value), estimate)


def scatter(estimator: str, paths: int, time: float, seeds: int) -> Iterator[tuple[str, FloatArray, float]]:
    """Of λ and of each Λ(p): its name, the estimates of all seeds beside their standard errors, and what is right."""
    orders = [1.0] if estimator == "population" else [-1.0, 0.5, 1.0]
    runs = [
        simulate(Problem(MODERATE, REDUCED), orders, estimator=estimator, paths=paths, time=time, seed=seed)
        for seed in range(seeds)
    ]
    exponent = ExponentSolver(Problem(MODERATE, REDUCED)).lyapunov_exponent().value
    yield "λ", np.array([(run.lyapunov_exponent, run.lyapunov_exponent_error) for run in runs]), exponent
    for k, value in enumerate(exact(MODERATE, REDUCED, orders)):
        found = [run.estimates[k] for run in runs]
        yield f"Λ({orders[k]:g})", np.array([(each.value, each.standard_error) for each in found], dtype=float), value


SCATTERED = (("direct", 2048, 100.0), ("population", 2048, 50.0))
"""Estimators, paths and times."""


STEPS = (
    (NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.9), 3.0, (0.2, 0.1), 16384, 200.0),
    (OrnsteinUhlenbeck(alpha=1.0, sigma=1.0), 1.0, (1.2, 0.6), 4096, None),
)
"""Noise, p, steps, paths and time."""


def biases(
    noise: Noise, p: float, steps: Sequence[float], paths: int, time: float | None
) -> Iterator[tuple[float, float]]:
    """The relative bias of Λ(p) of strong noise and its standard error for each step, however long."""
    [value] = exact(STRONG, noise, [p])
    with patch.object(estimators, "obstacles", lambda *_, **__: {}):
        for step in steps:
            found = simulate(
                Problem(STRONG, noise), [p], estimator="population", paths=paths, time=time, step=step, seed=4
            )
            [estimate] = found.estimates
            yield estimate.value / value - 1, estimate.standard_error / abs(value)


def main() -> None:
    table = Table("ε", "r", "noise", "p", "estimator", "finite elements", "simulation", "± s.e.", "deviation", "paths")
    for row in track(rows(), total=180, console=Console(stderr=True)):
        found = row.simulated
        numbers = ("none", "", "") if found.value is None else (
            f"{found.value:.6g}", f"{found.standard_error:.1e}", f"{row.deviation:+.1f}"
        )  # fmt: skip
        table.add_row(
            f"{row.epsilon:g}", f"{row.restitution:g}", row.noise, f"{row.p:g}", found.estimator,
            f"{row.finite_elements:.7g}", *numbers, f"{found.effective_paths:.3g}",
        )  # fmt: skip
    Console(width=120).print(table)
    for each in SCATTERED:
        for name, pairs, value in scatter(*each, seeds=64):
            values, errors = pairs.T
            scattered = np.std(values, ddof=1)
            off = (values.mean() - value) / (scattered / math.sqrt(values.size))
            wide = scattered / math.sqrt(np.mean(errors**2))
            print(f"{each[0]}, {name}: {wide:.2f} standard errors, the mean off by {off:+.1f} of its own")
    for noise, p, steps, paths, time in STEPS:
        found = list(biases(noise, p, steps, paths, time))
        written = ", ".join(f"{bias:+.5f} ± {error:.5f}" for bias, error in found)
        print(f"steps {steps}: bias {written}; {found[1][0] / found[0][0]:.3f} of it is left")


if __name__ == "__main__":
    main()
