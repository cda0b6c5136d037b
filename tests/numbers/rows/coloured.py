"""Noise of Eq. (7) and filtered noise: moments over polynomials of the noise, and Fourier series of the phase."""

from functools import cache, partial

import numpy as np

from fpsolve import NonGaussianNoise
from fpsolve.model import Filter, OrnsteinUhlenbeck
from tests.kit import matrices
from tests.numbers.rows.even import ACROSS, FAST, NODE, NODE_FILTER, NODE_NOISE, SADDLE
from tests.numbers.second import LOAD, even, slope_of, spring
from tests.numbers.values import Row, by, closed, closed_by, moment
from tests.oracles import planar

SLOW = (0.62, 0.71, 0.28, 1.0, 2.3)
LEANING = np.array([[0.0, 1.0], [-1.0, -1.4]]), np.array([[0.04, 0.9], [0.95, 0.1]])


@cache
def between(r0, tau0=0.7, D0=0.3):
    """Λ(2) of a spring under noise of Eq. (7) with r₀ ≤ 1."""
    if r0 == 1:
        return even(2, spring(), (LOAD, OrnsteinUhlenbeck(1 / tau0, (2 * D0) ** 0.5 / tau0)))
    law = planar.between_ends(D0, tau0, r0)
    return planar.moment_exponent(planar.Planar(spring(), ((LOAD, law),)), 2, 1)[0]


def eq_7(r0):
    return matrices(spring(), LOAD, NonGaussianNoise(0.3, 0.7, r0))


def at_end(h=0.001):
    """The slope by r₀ from below at 1, to the fourth order."""
    weights = 25, -48, 36, -16, 3
    return sum(w * between(1 - k * h) for k, w in enumerate(weights)) / (12 * h)


AT = {"r0": 0.5, "tau0": 0.7, "D0": 0.3}
ROWS = [
    *(
        Row(eq_7(r0), quantity, lambda r0=r0: between(r0), 1e-10, 1e-7, f"polynomials between ends, r₀ = {r0}")
        for r0 in (0.9, -2.0, 1.0)
        for quantity in (closed(2), moment(2))
    ),
    Row(eq_7(1 - 1e-11), closed(2), lambda: between(1), 1e-9, 1e-9, "Hermite polynomials next to r₀ = 1"),
    *(
        Row(eq_7(1.0), each, at_end, 1e-6, 1e-4, "one-sided differences at r₀ = 1")
        for each in (closed_by("noise.r0", 2), by("noise.r0", 2.0))
    ),
    *(
        Row(
            eq_7(0.5),
            make(f"noise.{name}", 2),
            partial(slope_of, between, name, 1e-2, **AT),
            1e-7,
            1e-4,
            "differences at r₀ = 0.5",
        )
        for name in ("r0", "tau0", "D0")
        for make in (closed_by, by)
    ),
    *(
        Row(
            lambda: matrices(*LEANING, Filter(*SLOW)),
            quantity,
            lambda: (
                planar.rightmost(
                    planar.Planar(LEANING[0], ((LEANING[1], planar.filtered(*SLOW)),))
                    .balanced()
                    .generator(4.0, 2, 32)[0],
                    near=1.87,
                )[0].real
            ),
            1e-6,
            1e-4,
            "32 functions of a strong slow filter",
            True,
        )
        for quantity in (closed(4), moment(4, rtol=1e-6))
    ),
    *(
        Row(
            matrices(SADDLE, ACROSS, FAST),
            closed(p),
            lambda p=p: even(p, SADDLE, *zip(ACROSS, FAST, strict=True), count=6),
            1e-9,
            1e-9,
            "a saddle whose |x|^(p − k)|v|^k is nearly an eigenfunction",
        )
        for p in (2, 4, 6)
    ),
    *(
        Row(matrices(NODE, NODE_NOISE, Filter(*NODE_FILTER)), closed(p), value, 1e-13, 1e-9, "a node under a filter")
        for p, value in ((2, 0.78527655968609), (4, 1.57063217231938))
    ),
]
