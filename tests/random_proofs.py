"""Bounds on Λ(p) of random parameter sets, weak and strong, and whether what the finite elements find is within them.

`python -m tests.random_proofs` prints for a hundred sets how close the bounds are, and the processor time;
`python -m tests.random_proofs 100 systems` for systems with random matrices, half of them with a wall, under each
noise, and whether the independent checker accepts them.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass

import numpy as np

import fpsolve
from fpsolve import prove
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, Noise, SineWiener, Telegraph, White
from fpsolve.proofs import Enclosure
from fpsolve.theory import scale_of
from tests.oracles import certificate_checker

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


def drawn_system(seed: int) -> tuple[fpsolve.Problem, float]:
    """An oscillator with normal changes of all coefficients and normal factors of the noise, of each kind in turn."""
    rng = np.random.default_rng(seed)
    omega, damping = rng.uniform(0.5, 2), rng.uniform(-0.1, 0.3)
    free = np.array([[0, 1], [-(omega**2), -2 * damping * omega]]) + 0.2 * rng.normal(size=(2, 2))
    driven = rng.uniform(0.1, 0.8) * rng.normal(size=(2, 2))
    jumps = [Jump(math.pi / 2, math.log(rng.uniform(0.6, 1.2)))] if rng.random() < 0.5 else []
    if jumps:
        driven[0, 1] = 0  # leaves the phase at the wall alone
    kind, states = seed % 5, int(rng.integers(2, 6))
    rates = rng.uniform(0.1, 2, (states, states)) * (1 - np.eye(states))
    noise: Noise = [
        lambda: White(rng.uniform(0.2, 1), interpretation="ito" if rng.random() < 0.5 else "stratonovich"),
        lambda: Telegraph(rng.uniform(0.2, 1), rng.uniform(0.3, 3)),
        lambda: SineWiener(rng.uniform(0.2, 0.8), rng.uniform(0.5, 2)),
        lambda: fpsolve.OrnsteinUhlenbeck(rng.uniform(0.5, 2), rng.uniform(0.1, 0.4)),
        lambda: MarkovChain(0.5 * rng.normal(size=states), rates),
    ][kind]()
    terms = [CoefficientMatrix(0, free.tolist()), CoefficientMatrix(1, driven.tolist(), identity)]
    return fpsolve.Problem(fpsolve.PlaneSystem(terms, jumps), noise), round(rng.uniform(-3, 4), 2)


def is_accepted(found: Enclosure, p: float) -> bool:
    """Whether the independent checker accepts a proof."""
    assert found.certificate is not None
    certificate = found.certificate.model_dump(mode="json")
    entry = {"p": p, "lower": found.lower, "upper": found.upper, "certificate": certificate}
    return certificate_checker.check(entry) == ""


def outcome(seed: int, *, is_system: bool = False) -> Outcome:
    """Prove Λ(p) of a set, to 1e-8 of its scale if that can be done, and compare."""
    problem, p = (drawn_system if is_system else drawn)(seed)
    estimate = fpsolve.moment_lyapunov(problem, [p])
    value, error = float(estimate.value[0]), float(estimate.error_estimate[0])
    scale = max(abs(value), float(scale_of(problem).moment(p)))
    begun = time.process_time()
    found = prove(problem, p, width=SHARES[0] * scale)
    seconds = time.process_time() - begun
    if is_system and not is_accepted(found, p):
        raise AssertionError(f"the independent checker refuses the proof of seed {seed}")
    return Outcome(found, found.width / scale, max(found.lower - value, value - found.upper, 0.0) / error, seconds)


def main(count: int, *, is_system: bool) -> None:
    """Print a line for each set, and the shares."""
    found = []
    for seed in range(count):
        found.append(outcome(seed, is_system=is_system))
        each = found[-1]
        print(f"{seed:4d} width {each.width:.1e} off {each.off:.2f} {each.seconds:5.1f} s", flush=True)
    for share in SHARES:
        print(f"{sum(each.width <= share for each in found)} of {count} within {share:g} of the scale")
    seconds = np.array([each.seconds for each in found])
    agree = sum(each.off <= 1 for each in found)
    print(f"{agree} of {count} agree; {np.median(seconds):.1f} s each, {seconds.max():.1f} at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100, is_system="systems" in sys.argv)
