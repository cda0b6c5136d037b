"""Inertial particles in a random flow: λ by spherical harmonics of (u + iv)/(x + iy) up to the degree 36."""

import math

from fpsolve.model import White
from tests.kit import rates
from tests.numbers.values import Row, exponent

FLOW = "x' = u; y' = v; u' = -u + xi1*x + (xi2 + xi3)*y; v' = -v + (xi2 - xi3)*x - xi1*y"


def particles(strength: float):
    return rates(FLOW, [White(s=math.sqrt(size * strength)) for size in (1, 1, 2)])


ROWS = [
    Row(particles(strength), exponent(rtol=1e-2), value, 1e-10, 4e-2, "inertial particles", slow=True)
    for strength, value in ((1.0, 0.3788781527), (0.1, 0.0743183683))
]
