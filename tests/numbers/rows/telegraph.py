"""Telegraph noise: moment equations of a chain of two states, and Fourier series of the phase."""

from fpsolve.model import Telegraph
from tests.kit import rates
from tests.numbers.by_problem import even_rows
from tests.numbers.second import spring as drift
from tests.numbers.values import Row, exponent, moments
from tests.oracles import phase_circle

STATES = [drift(1 + xi) for xi in (-0.5, 0.5)]
FLIP = [[-1.0, 1.0], [1.0, -1.0]]
MADE = phase_circle.chain(STATES, FLIP)


def spring(restitution: float = 1.0, a: float = 0.5, k: float = 1.0):
    walls = [{"at": "x = 0", "restitution": restitution}] if restitution < 1 else ()
    return rates("x' = v; v' = -x - 0.1*v - xi*x", Telegraph(a=a, k=k), walls)


ROWS = [
    *even_rows(spring(), "moment equations of a spring", 1e-9),
    Row(spring(), exponent(rtol=1e-11), -0.03297945668172, 1e-11, 1e-11, "Fourier series of the phase of a spring"),
    *moments(
        spring(0.9),
        {p: lambda p=p: phase_circle.moment_exponent(MADE, p, 20, 0.9) for p in (-1.0, 1.0, 2.0)},
        1e-10,
        1e-8,
        "Fourier series of the phase of a spring with a wall",
    ),
    Row(
        spring(0.9),
        exponent(rtol=1e-10),
        lambda: phase_circle.lyapunov_exponent(MADE, 20, 0.9),
        1e-10,
        1e-9,
        "Fourier series of the phase of a spring with a wall",
    ),
]
