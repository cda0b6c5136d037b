"""Noise with algebraic tails, r₀ > 1: λ by other grids, and next to Gaussian noise."""

from functools import partial

import numpy as np

from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, lyapunov_exponent
from fpsolve.exponent import impact_rate
from tests.numbers.values import Row, exponent, number
from tests.oracles import asinh_grid


def tailed(D0, tau0, r0, epsilon, omega=1.0, restitution=1.0, c1=0.0):
    oscillator = VibroImpactOscillator(omega=omega, restitution=restitution, c1=c1, epsilon=epsilon)
    return Problem(oscillator, NonGaussianNoise(D0=D0, tau0=tau0, r0=r0))


def by_differences(problem, place: int, phases: int = 96, steps: int = 400) -> float:
    """λ, or N, on the other grid, extrapolated by both of its orders."""
    ends = 200 * problem.noise.standard_deviation
    coarse, fine, around = (
        np.array(asinh_grid.exponents(problem.system, problem.noise, phases=m, steps=n, lower=-ends, upper=ends))
        for m, n in ((phases, steps), (phases, 2 * steps), (2 * phases, steps))
    )
    return float((coarse + (fine - coarse) * 4 / 3 + (around - coarse) * 8 / 7)[place])


def drawn(seed: int):
    rng = np.random.default_rng(seed)
    return tailed(
        *np.exp(rng.uniform(np.log([0.2, 0.3]), np.log([2.0, 3.0]))),
        1 + np.exp(rng.uniform(np.log(0.02), np.log(0.3))),
        np.exp(rng.uniform(np.log(0.05), np.log(0.5))),
        restitution=rng.uniform(0.6, 1.0),
        c1=rng.uniform(-0.3, 0.3),
    )


HEAVY = tailed(0.5, 1.0, 1.1, 0.5)
HEAVIER = tailed(0.5, 0.4, 1.45, 0.6, c1=-0.3)


def near(departure: float):
    return tailed(0.5, 1.0, 1 + departure, 0.1, restitution=0.8)


ROWS = [
    Row(
        HEAVIER,
        exponent(rtol=1e-2),
        partial(by_differences, HEAVIER, 0, 48, 200),
        5e-6,
        1e-3,
        "finite differences of tails beyond an interval",
    ),
    *(
        Row(
            problem,
            quantity,
            partial(by_differences, problem, place),
            doubt,
            1e-7,
            f"finite differences {source}",
            True,
        )
        for source, problem, doubts in (
            ("of tails", HEAVY, (3e-10, 3e-10)),
            ("of a random set", drawn(1000), (1e-11, 1e-11)),
        )
        for place, (quantity, doubt) in enumerate(zip((exponent(), number(impact_rate)), doubts, strict=True))
    ),
    *(
        Row(
            near(departure),
            exponent(),
            lambda: lyapunov_exponent(near(0.0)).value,
            4e-3 * departure + 1e-13,
            1e-8,
            f"Gaussian noise, {departure:g} beside it",
        )
        for departure in (1e-12, 1e-7, 1e-4)
    ),
    *(
        Row(
            tailed(1.0, 0.5, 1.3, 0.7, restitution=0.8, c1=0.1),
            exponent(rtol=rtol),
            *(0.13917269, 9e-7, rtol, f"finite volumes between sinh-spaced points {rtol:g}", rtol < 1e-2),
        )
        for rtol in (1e-2, 1e-4, 1e-6)
    ),
]
