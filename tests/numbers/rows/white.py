"""White noise: special functions, and what is known of single systems."""

import math

from fpsolve import ExponentSolver, Problem, VibroImpactOscillator
from fpsolve.exponent import critical_restitution
from fpsolve.model import Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.second import LOAD, spring
from tests.numbers.values import Quantity, Row, by, exponent, moment
from tests.oracles import closed_forms

WALL = [{"at": "x = 0", "restitution": "r"}]
TURNING = [[1.0, 0.0], [0.0, -1.0]], [[0.0, -1.0], [1.0, 0.0]]
GROWTH, SQUARE, INVERSE = closed_forms.saddle_and_turning()


def walled(noise, stiffness=1.0, damping=0.1, r=0.8):
    rate = "x' = v; v' = -stiffness*x - 2*damping*v - xi*x"
    return rates(rate, noise, WALL, stiffness=stiffness, damping=damping, r=r)


def critical(problem):
    found = critical_restitution(ExponentSolver(problem, rtol=1e-9))
    return found.value, found.error_estimate


def airy(stiffness, damping=0.0, s=1.0, r=1.0):
    return Row(
        walled(White(s), stiffness, damping, r) if r < 1 else matrices(spring(stiffness, damping), LOAD, White(s)),
        exponent(rtol=1e-9),
        closed_forms.white_stiffness(stiffness, s, damping, r),
        1e-10,
        1e-8,
        f"Airy functions of a spring, k = {stiffness}, R = {r}",
    )


ROWS = [
    *(airy(each) for each in (1.0, 0.25, -1.0, 0.0)),
    *(airy(each, 0.1, 0.5, 0.8) for each in (1.0, 0.0, -1.0)),
    *(
        Row(
            matrices(spring(0, 0), LOAD, White(s=0.7)),
            quantity,
            share * (size * 0.49) ** (1 / 3),
            1e-9,
            1e-7,
            "moments of a free mass",
        )
        for p, size in ((2.0, 2), (4.0, 42))
        for quantity, share in ((moment(p, rtol=1e-10), 1.0), (by("noise.s", p), 2 / 3 / 0.7))
    ),
    *(
        Row(
            matrices(*TURNING, White(1.0)),
            quantity,
            value,
            1e-12,
            1e-7,
            "Bessel and Mathieu functions of a saddle that turns",
        )
        for quantity, value in ((exponent(rtol=1e-10), GROWTH), (moment(2), SQUARE), (moment(-1), INVERSE))
    ),
    *(
        Row(
            walled(Telegraph(a=1e-9, k=1.0), 2.0, 0.3, 0.7),
            moment(p),
            p * (math.sqrt(1.91) / math.pi * math.log(0.7) - 0.3),
            1e-8,
            1e-7,
            "a spring without noise at its wall",
        )
        for p in (1.0, 3.0)
    ),
    Row(
        walled(White(s=1.0), damping=0.0, r=0.9),
        Quantity("R where λ = 0", critical),
        lambda: math.exp(
            closed_forms.white_stiffness(1.0, 1.0)
            / (closed_forms.white_stiffness(1.0, 1.0) - closed_forms.white_stiffness(1.0, 1.0, 0.0, math.e))
        ),
        1e-8,
        1e-6,
        "Airy functions of a spring",
    ),
    Row(
        walled(White(s=0.7), 1.3, 0.1, 0.8),
        by("system.r", 1e-7),
        (closed_forms.white_stiffness(1.3, 0.7, 0.1, math.e) - closed_forms.white_stiffness(1.3, 0.7, 0.1))
        * 1e-7
        / 0.8,
        1e-13,
        1e-12,
        "Airy functions of a spring: λ = λ₀ + N ln R",
    ),
    Row(
        Problem(VibroImpactOscillator(2.0, 0.9, 0.1, 0.1), White(0.6)),
        moment(2.0, rtol=1e-11),
        0.01 * (0.1 - 4 / math.pi * 0.1 + 0.36 / 4 + 0.75 * 0.36),
        3e-7,
        1e-9,
        "Eq. (37) with S = s², to the fourth order",
    ),
]
