"""Λ(p) of random noise with algebraic tails, r₀ from 1 + 1e-12 to 1.6 and p from −1 to 0, against other codes.

`python -m tests.random_heavy_tails [first last]` prints for each set how far both are apart. The other code is that of
finite differences (asinh_grid), on three grids, finer ones where they leave it open; where r₀ − 1 < 1e-6 it is that of
Fourier series and Hermite polynomials at r₀ = 1. Far out, where the phase rests, T is too steep for a grid of all φ,
and there is one of a part of them. What is refused is told.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov
from fpsolve.errors import FpsolveError
from fpsolve.exponent.adapt import Budget
from fpsolve.theory import far_places
from fpsolve.theory.perturbation import scale_of
from tests.oracles import asinh_grid, fourier_hermite

RTOL, BUDGET = 1e-6, Budget(unknowns=20_000, seconds=10.0)
GAUSSIAN = 1e-6
"""r₀ − 1 below which the limit is compared with, from which Λ is not further away than the scale times this."""
GRIDS = ((48, 250), (96, 250), (96, 500)), ((96, 400), (192, 400), (192, 800))
"""Points in φ and in ξ; those of the second kind where the first leave it open, or disagree."""
HELD = (48, 400), (96, 400), (48, 800), (48, 1600)
"""Points in φ and in ξ where the phase rests."""
WORST = 0.02
"""How far grids may be apart, as a share of Λ, for their limit to be a reference."""


def drawn(seed: int) -> tuple[Problem, float]:
    """D₀, τ₀ and ε log-uniform; r₀ − 1 to 0.6 from 1e-12, or each second from 0.02; the others uniform."""
    rng = np.random.default_rng(seed)

    def log_uniform(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    noise = NonGaussianNoise(
        D0=log_uniform(0.2, 2.0), tau0=log_uniform(0.3, 3.0), r0=1 + log_uniform((1e-12, 0.02)[seed % 2], 0.6)
    )
    own = {"epsilon": log_uniform(0.05, 0.5), "restitution": rng.uniform(0.6, 1.0), "c1": rng.uniform(-0.5, 0.3)}
    return Problem(VibroImpactOscillator(omega=1.0, **own), noise), float(rng.uniform(-1, 0))


def by_differences(
    case: Problem, p: float, value: float, grids: Sequence[tuple[int, int]] = GRIDS[0]
) -> tuple[float, float]:
    """Λ(p) extrapolated from the grids, and its doubt."""
    unit = case.noise.standard_deviation
    lower = min([-30.0, *(3 * place.lower for place in far_places(case, p) if place.rate > 0.2 * value)]) * unit
    rough, coarse, fine = (
        asinh_grid.moment_lyapunov(
            case.system, case.noise, p, phases=phases, steps=steps, lower=lower, upper=15 * unit, above=1.02 * value
        )
        for phases, steps in grids
    )
    changes = (coarse - rough) / 7, (fine - coarse) / 3
    return fine + sum(changes), sum(map(abs, changes))


def by_rest(case: Problem, p: float) -> tuple[float, float] | None:
    """The same from grids on which the phase rests, and its doubt; None where it does not rest far out."""
    (epsilon, omega), unit = (case.system.epsilon, case.system.omega), case.noise.standard_deviation
    turning = 2.05 * omega / epsilon + epsilon * abs(case.system.c1)
    places = [place for place in far_places(case, p) if place.upper * unit < -1.3 * turning]
    if not places:
        return None
    place = max(places)
    ends = {"lower": 1.3 * place.lower * unit, "upper": min(0.75 * place.upper * unit, -turning)}
    try:
        rough, other, coarse, fine = (
            asinh_grid.held(case.system, case.noise, p, phases=phases, steps=steps, above=1.0005 * place.rate, **ends)
            for phases, steps in HELD
        )
    except ValueError:
        return None
    changes = (other - rough) / 3, (fine - coarse) / 3
    return fine + sum(changes), sum(map(abs, changes))


def by_limit(case: Problem, p: float) -> tuple[float, float]:
    """Λ(p) at r₀ = 1, and how far that at r₀ may be from it."""
    system, noise = case.system, case.noise
    known = fourier_hermite.moment_lyapunov(
        omega=system.omega, epsilon=system.epsilon, c1=system.c1, log_R=system.log_impact_factor, p=p,
        alpha=1 / noise.tau0, sigma=noise.diffusion, harmonics=20, hermite=60,
    )  # fmt: skip
    return known, (noise.r0 - 1 + 1e-9) * float(scale_of(case).moment(p))


def outcome(seed: int) -> tuple[float, float] | str:
    """How far Λ(p) is from the other code's, as a share of it, and in what both leave open; or why there is none."""
    case, p = drawn(seed)
    try:
        found = moment_lyapunov(case, p, rtol=RTOL, budget=BUDGET)
    except FpsolveError as failure:
        return f"refused: {failure}"
    value, error = found.value[0], found.error_estimate[0]
    try:
        is_limit = case.noise.r0 - 1 < GAUSSIAN
        known, doubt = by_limit(case, p) if is_limit else by_differences(case, p, value)
        at_rest = None if is_limit else by_rest(case, p)
        if at_rest and at_rest[0] > known and at_rest[1] < WORST * at_rest[0]:
            known, doubt = at_rest
        elif not is_limit and (doubt > WORST * abs(known) or abs(value - known) > error + doubt):
            known, doubt = by_differences(case, p, value, GRIDS[1])
    except ValueError as failure:
        return f"no reference: {failure}"
    if doubt > WORST * abs(known):
        return f"no reference: {known:.6g} ± {doubt:.1g}, here {value:.6g}"
    return abs(value - known) / abs(known), abs(value - known) / (error + doubt)


def main(first: int = 0, last: int = 99) -> None:
    """Print a line for each set, and how many agree."""
    counts = {"agree": 0, "differ": 0, "refused": 0, "no reference": 0}
    for seed in range(first, last + 1):
        case, p = drawn(seed)
        started = time.thread_time()
        found = outcome(seed)
        seconds = time.thread_time() - started
        if isinstance(found, str):
            counts[found.partition(":")[0]] += 1
            told = found[:150]
        else:
            counts["agree" if found[1] < 1 else "differ"] += 1
            told = f"off by {found[0]:.1e}, {found[1]:.2f} of what both leave open"
        print(f"{seed:4d} r0 - 1 = {case.noise.r0 - 1:.2e} p = {p:6.3f} {seconds:5.1f} s {told}", flush=True)
    print(", ".join(f"{count} {word}" for word, count in counts.items()))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
