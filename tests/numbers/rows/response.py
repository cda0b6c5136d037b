"""Means of stationary responses with terms of degree 3: two other codes, and paths of tests.oracles."""

import math
from functools import cache

from fpsolve import OrnsteinUhlenbeck, Problem, VibroImpactOscillator, stationary_response
from tests.numbers.values import Quantity, Row

SMOOTH = {"omega": 1.0, "epsilon": 0.5, "restitution": 1.0, "c1": 0.4, "c2": 0.5, "c3": 0.2}
BOUNCING = {"omega": 1.0, "epsilon": 1.0, "restitution": 0.9, "c1": 0.3, "c2": 0.1, "c3": 0.1, "impact": "delta"}
NOISE = OrnsteinUhlenbeck(alpha=2.0, sigma=1.5)
solved = cache(stationary_response)


def oscillator(D0, tau0, **values):
    return Problem(VibroImpactOscillator(**values), OrnsteinUhlenbeck(alpha=1 / tau0, sigma=math.sqrt(2 * D0) / tau0))


def mean(name, rtol):
    def found(problem):
        estimate = solved(problem, rtol=rtol).means[name]
        return estimate.value, estimate.error_estimate

    return Quantity(f"mean {name}", found)


KNOWN = (
    (
        oscillator(0.1, 0.5, **SMOOTH),
        1e-4,
        "two other codes",
        {"amplitude_squared": (1.54568, 1e-5), "x_squared": (0.776597, 4e-6), "v_squared": (0.769092, 4e-6)},
    ),
    (
        oscillator(0.05, 0.5, **BOUNCING),
        1e-4,
        "two other codes with impacts",
        {"amplitude": (1.539962, 1e-6), "amplitude_squared": (2.510536, 1e-6)},
    ),
)
ROWS = [
    Row(problem, mean(name, rtol), value, doubt, 1.5 * rtol * value, f"{source}: {name}", True)
    for problem, rtol, source, values in KNOWN
    for name, (value, doubt) in values.items()
]
