"""Systems whose phase never leaves a ray: the larger of two scalar problems, in closed form."""

import math

import numpy as np

from fpsolve import OrnsteinUhlenbeck
from fpsolve.model import Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.values import Row, exponent, index, moments, slope_by

NOISES = {"OU": OrnsteinUhlenbeck(alpha=1.0, sigma=0.7), "white": White(0.7), "telegraph": Telegraph(a=0.5, k=1.0)}
C, S = math.cos(0.7), math.sin(0.7)
TURNED = np.array([[C, -S], [S, C]])


def scalar(noise: str, p: float, growth: float, strength: float) -> float:
    """Λ(p) of ȧ = (growth + strength ξ) a: from the Gaussian ∫ξ dt, or the two states."""
    if noise == "telegraph":
        return p * growth - 1 + math.sqrt(1 + (0.5 * p * strength) ** 2)
    return p * growth + 0.5 * (p * strength * 0.7) ** 2


SYSTEMS = {
    "triangular": ([[-0.3, 0.0], [0.5, -1.0]], [[0.4, 0.0], [0.2, -1.0]]),
    "the other way": ([[-1.0, 0.0], [0.5, -0.3]], [[-0.2, 0.0], [0.2, 0.4]]),
    "diagonal": ([[-0.3, 0.0], [0.0, -0.1]], [[0.4, 0.0], [0.0, 1.0]]),
}
DRIVEN = rates("x' = -a*x + 0.4*xi*x + c*y; y' = 0.5*x - b*y - xi*y", NOISES["white"], a=0.3, b=1.0, c=0.0)


ROWS = [
    *(
        row
        for name, (free, driven) in SYSTEMS.items()
        for noise, law in NOISES.items()
        for turn in (np.eye(2), TURNED)
        for problem in [matrices(turn @ free @ turn.T, turn @ driven @ turn.T, law)]
        for row in (
            *moments(
                problem,
                {p: max(scalar(noise, p, free[k][k], driven[k][k]) for k in (0, 1)) for p in (0.5, 1.0, 2.0, 3.5)},
                *(1e-14, 1e-8, f"ray, {name}, {noise}"),
            ),
            Row(problem, exponent(), max(free[0][0], free[1][1]), 1e-14, 1e-8, f"ray, {name}, {noise}"),
        )
    ),
    *moments(
        matrices(-0.1 * np.eye(2), np.eye(2), NOISES["OU"]),
        {p: scalar("OU", p, -0.1, 1.0) for p in (-2.0, 2.0)},
        *(1e-14, 1e-8, "one number for all rays"),
    ),
    Row(matrices(*SYSTEMS["diagonal"], NOISES["white"]), index(), 0.1 / 0.245, 1e-8, 1e-8, "larger of two parabolas"),
    *(
        Row(DRIVEN, slope_by(key, p), value, 1e-9, 1e-8, "larger of two parabolas")
        for p, values in ((1.0, (-1.0, 0.0, 0.16 * 0.7)), (4.0, (0.0, -4.0, 16 * 0.7)), (0.0, (-1.0, 0.0, 0.0)))
        for key, value in zip(("system.a", "system.b", "noise.s"), values, strict=True)
    ),
]
