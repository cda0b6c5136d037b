"""Walls: λ, Λ(p), the rate of impacts N, and the critical R and r, where noise is none, white, a telegraph or weak."""

import math
from collections.abc import Callable
from typing import Any

from scipy.special import hankel1

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.exponent import critical_impact_factor, critical_restitution, impact_rate
from fpsolve.model import Noise, Telegraph, White
from tests.kit import rates
from tests.numbers.values import Quantity, Row, exponent, moment


def of_impacts(name: str, solve: Callable[..., Any], **options: Any) -> Quantity:
    """A number that is 0 or has no meaning without a wall."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = solve(ExponentSolver(problem, **options))
        assert found, found
        return found.value, found.error_estimate

    return Quantity(name, solved)


def impacts(**options: Any) -> tuple[Quantity, Quantity]:
    """N and R_c."""
    return of_impacts("N", impact_rate, **options), of_impacts("R_c", critical_impact_factor, **options)


def walled(noise: Noise, restitution: float, text: str = "x' = v; v' = -x - 0.1*v - xi*x", **parameters: float):
    return rates(text, noise, walls=[{"at": "x = 0", "restitution": restitution}], **parameters)


WAVES = "transfer matrices, det(R^p Φ − 1) = 0, and Fourier waves of T R^(−pφ/π)"
GROWING = walled(White(s=0.5), 0.8, "x' = v; v' = -x + 0.1*v + xi*v")
PLACE = hankel1([1.8, 0.8], 16.0)
"""Of order c/D₀ and place 2ω/D₀ of white noise in the damping of intensity 2D₀ = 0.25."""
LOSSLESS, RATE = (PLACE[0] / PLACE[1]).real, -(PLACE[0] / PLACE[1]).imag / math.pi
BESIDE = walled(Telegraph(a=0.5, k=1.0), 0.9)
OFTEN = (-0.0659526129896 + 0.0329794566817) / math.log(0.9)
WEAK = OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)


def without_noise(growth: float) -> list[Row]:
    """Impacts follow the damped frequency: λ = c + (ω_d/π) ln R, ω_d² = ω² − c²."""
    frequency = math.sqrt(1 - growth**2)
    problem = walled(
        OrnsteinUhlenbeck(alpha=1.0, sigma=1e-5), math.exp(-0.2), "x' = v; v' = -x + 2*c*v + xi*x", c=growth
    )
    of_rate, factor = impacts(rtol=1e-9)
    values = [
        (exponent(rtol=1e-9), growth - 0.2 * frequency / math.pi),
        (of_rate, frequency / math.pi),
        (factor, math.exp(-growth * math.pi / frequency)),
    ]
    return [Row(problem, each, value, 1e-7 * abs(value), 1e-7, f"damped frequency {growth}") for each, value in values]


ROWS = [
    *(
        Row(walled(noise, factor), moment(p), value, 1e-12, 1e-6, f"{WAVES} {noise.kind} R {factor}")
        for noise, factor, p, value in (
            (Telegraph(a=0.5, k=0.5), 0.2, 20.0, -7.726127144527),
            (Telegraph(a=0.5, k=0.5), 0.1, 10.0, -5.850081182888),
            (Telegraph(a=0.2, k=0.3), 0.2, -2.0, 1.136476716839),
            (White(s=0.05), 0.2, 20.0, -11.1134497872118),
            (White(s=0.05), 0.3, 12.0, -5.1566178569916),
        )
    ),
    *(
        Row(GROWING, each, value, 1e-11, 1e-8, "Hankel functions")
        for each, value in zip(
            (exponent(), *impacts()),
            (LOSSLESS + RATE * math.log(0.8), RATE, math.exp(-LOSSLESS / RATE)),
            strict=True,
        )
    ),
    *(
        Row(BESIDE, each, value, 1e-11, 1e-9, "λ of a telegraph with a wall and without")
        for each, value in zip(
            (exponent(rtol=1e-11), *impacts(rtol=1e-11)),
            (-0.0659526129896, OFTEN, math.exp(0.0329794566817 / OFTEN)),
            strict=True,
        )
    ),
    *(row for growth in (0.25, -0.6, 0.95) for row in without_noise(growth)),
    *(
        Row(
            Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1e-4, impact=law), WEAK),
            of_impacts("r_c", critical_restitution),
            1 - math.pi * (WEAK.spectral_density(2.0) / 8 + 0.05),
            1e-7,
            1e-7,
            f"second order of a wall where R is 1 but for 2e-9 {law}",
        )
        for law in ("delta", "restitution")
    ),
]
