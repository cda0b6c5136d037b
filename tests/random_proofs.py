"""Bounds on Λ(p) of random parameter sets, weak and strong, and whether what the finite elements find is within them.

`python -m tests.random_proofs` prints for a hundred sets how close the bounds are, and the processor time.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np

import fpsolve
from fpsolve.proofs import Enclosure, prove
from fpsolve.theory.perturbation import scale_of

SHARES = (1e-8, 1e-6, 1e-3)
"""Widths, as shares of the scale of Λ(p), by which bounds are told apart."""


@dataclass(frozen=True)
class Outcome:
    """What became of a set.

    Attributes:
        width: of the bounds, as a share of the scale of Λ(p).
        off: how far the finite elements' value is outside the bounds, in its error estimates; 0 inside.
        seconds: processor time of the proof.
    """

    found: Enclosure
    width: float
    off: float
    seconds: float


def drawn(seed: int) -> tuple[fpsolve.Problem, float]:
    """ε, D₀ and τ₀ log-uniform, the others uniform, all to three digits; r₀ < 1 as it stands, or reduced."""
    rng = np.random.default_rng(seed)

    def number(low: float, high: float, *, is_log: bool = False) -> float:
        value = np.exp(rng.uniform(np.log(low), np.log(high))) if is_log else rng.uniform(low, high)
        return float(f"{value:.3g}")

    noise = fpsolve.NonGaussianNoise(
        D0=number(0.05, 1.5, is_log=True), tau0=number(0.1, 3, is_log=True), r0=number(0, 0.97)
    )
    oscillator = fpsolve.VibroImpactOscillator(
        omega=number(0.3, 3),
        restitution=number(0.6, 1),
        c1=number(-0.3, 0.3),
        epsilon=number(0.02, 1, is_log=True),
        impact="delta" if rng.random() < 0.5 else "restitution",
    )
    p = float(rng.choice([-1, 1])) * number(0.3, 5)
    return fpsolve.Problem(oscillator, noise if rng.random() < 0.6 else noise.ou_reduction()), p


def outcome(seed: int) -> Outcome:
    """Prove Λ(p) of a set, to 1e-8 of its scale if that can be done, and compare."""
    problem, p = drawn(seed)
    estimate = fpsolve.moment_lyapunov(problem, [p])
    value, error = float(estimate.value[0]), float(estimate.error_estimate[0])
    scale = max(abs(value), float(scale_of(problem).moment(p)))
    begun = time.process_time()
    found = prove(problem, p, width=SHARES[0] * scale)
    seconds = time.process_time() - begun
    return Outcome(found, found.width / scale, max(found.lower - value, value - found.upper, 0.0) / error, seconds)


def main(count: int) -> None:
    """Print a line for each set, and the shares."""
    found = []
    for seed in range(count):
        found.append(outcome(seed))
        each = found[-1]
        print(f"{seed:4d} width {each.width:.1e} off {each.off:.2f} {each.seconds:5.1f} s", flush=True)
    for share in SHARES:
        print(f"{sum(each.width <= share for each in found)} of {count} within {share:g} of the scale")
    seconds = np.array([each.seconds for each in found])
    agree = sum(each.off <= 1 for each in found)
    print(f"{agree} of {count} agree; {np.median(seconds):.1f} s each, {seconds.max():.1f} at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
