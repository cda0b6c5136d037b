"""Odd parameter sets, strong and slow noise, heavy impacts, p from −8 to 30, against a continued fraction in the phase.

The noise is that of Eq. (7) for r₀ < 1, or its reduction for r₀ up to 1.6.
"""

import numpy as np
import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget
from tests.conftest import sampled
from tests.oracles import phase_fraction

SIZES = ((12, 20), (24, 36), (36, 48), (54, 60))
"""Harmonics and polynomials of the reference, raised until it settles."""


def problem(seed):
    """A set, and p."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    oscillator = VibroImpactOscillator(
        omega=between(0.05, 50), restitution=rng.uniform(0.05, 1), c1=rng.uniform(-0.5, 0.5), epsilon=between(0.02, 3)
    )
    noise = NonGaussianNoise(D0=between(0.01, 2), tau0=between(1e-3, 1e3), r0=rng.uniform(0, 1.6))
    is_exact = noise.r0 < 1 and rng.random() < 0.7
    return Problem(oscillator, noise if is_exact else noise.ou_reduction()), rng.uniform(-8, 30)


def reference(case, p, start, tilt, scale):
    """Λ(p) and how far it may be off; the doubt is infinite where it does not settle."""
    found = []
    for harmonics, polynomials in SIZES:
        found.append(
            phase_fraction.moment_lyapunov(
                case.system, case.noise, p, start, harmonics=harmonics, polynomials=polynomials, tilt=tilt
            )
        )
        steps = np.abs(np.diff(found[-3:]))
        if len(found) > 2 and np.max(steps) < 1e-9 * scale:
            return found[-1], float(np.max(steps)) + 1e-14 * harmonics * case.system.omega
    return found[-1], np.inf


@pytest.mark.parametrize("sets", sampled(8, 20))
def test_odd_sets_are_right_to_their_error(sets):
    compared = solved = 0
    for seed in range(sets):
        case, p = problem(seed)
        solver = ExponentSolver(case, budget=Budget(unknowns=15_000))
        try:
            found = solver.solution(p)
        except NotConverged:
            continue
        solved += 1
        value, scale = found.pair.value, max(abs(found.pair.value), solver.scale(p))
        known, doubt = reference(case, p, value * (1 + 1e-6), found.pair.space.xi.tilt, scale)
        if np.isfinite(doubt):
            compared += 1
            assert abs(value - known) <= found.error + 3 * doubt, seed
    assert solved >= 0.85 * sets
    assert compared >= 0.75 * sets
