"""λ and Λ(p) of an oscillator in weak noise by its spectral density alone, to first order in it.

For ẍ + 2ζω ẋ + ω²(1 + ξ) x = 0 averaging over the phase leaves of ln‖x‖ a Brownian motion:

    λ = −ζω + ω²S(2ω)/8,   Λ(p) = −ζω p + p(p + 2) ω²S(2ω)/16.

For noise in the damping, ẍ + (2ζω − ξ) ẋ + ω²x = 0,

    λ = −ζω + S(2ω)/8,   Λ(p) = −ζω p + p(p + 2) S(2ω)/16 + p² S(0)/8.

These are Eqs. (36)-(39) without walls.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from fpsolve.arrays import shown

Where = Literal["stiffness", "damping"]
PLACES = ("stiffness", "damping")


def weak_moment(p: float, omega: float, zeta: float, at_double: float, at_zero: float, noise_in: Where) -> float:
    """Λ(p) in weak noise, see above, in 1/time.

    Args:
        p: the moment.
        omega: natural frequency ω, in rad/time.
        zeta: damping ratio ζ.
        at_double, at_zero: S(2ω) and S(0) of the relative stiffness, in time, or of the damping, in 1/time.
        noise_in: "stiffness" or "damping".

    Raises:
        ValueError: `noise_in` is neither.
    """
    factor = omega**2 if checked_place(noise_in) == "stiffness" else 1.0
    mean_square = 0.0 if noise_in == "stiffness" else p * p * at_zero / 8
    return -zeta * omega * p + p * (p + 2) * factor * at_double / 16 + mean_square


def weak_exponent(omega: float, zeta: float, at_double: float, noise_in: Where) -> float:
    """λ in weak noise, see above and `weak_moment`, in 1/time."""
    factor = omega**2 if checked_place(noise_in) == "stiffness" else 1.0
    return -zeta * omega + factor * at_double / 8


def checked_place(noise_in: str) -> str:
    """The place of the noise. Raises `ValueError`."""
    if noise_in not in PLACES:
        raise ValueError(f"got noise_in = {shown(noise_in)}; must be one of {', '.join(PLACES)}")
    return noise_in


def frequencies_that_matter(omega: float, second: float | None, noise_in: Where) -> Mapping[str, float]:
    """ω at which S counts in weak noise, by their symbols: 2ω; of two modes 2ω₁, 2ω₂, ω₁ + ω₂, |ω₁ − ω₂|.

    Noise in the damping adds 0.

    Raises:
        ValueError: a frequency is not > 0, or `noise_in` is none.
    """
    for name, value in (("frequency", omega), ("second_frequency", second)):
        if value is not None and not 0 < value < float("inf"):
            raise ValueError(f"got {name} = {shown(value)}; must be > 0 and finite, in rad/time")
    zero = {"0": 0.0} if checked_place(noise_in) == "damping" else {}
    if second is None:
        return {"2ω": 2 * omega, **zero}
    difference = {"|ω₁ − ω₂|": abs(omega - second)} if omega != second else {}
    return {"2ω₁": 2 * omega, "2ω₂": 2 * second, "ω₁ + ω₂": omega + second, **difference, **zero}
