"""λ and Λ(p) of an oscillator in weak noise by its spectral density alone, to first order in it.

For ẍ + 2ζω ẋ + ω²(1 + ξ) x = 0 averaging over the phase leaves of ln‖x‖ a Brownian motion:

    λ = −ζω + ω²S(2ω)/8,   Λ(p) = −ζω p + p(p + 2) ω²S(2ω)/16.

There ξ is a relative stiffness. If the support of a pendulum has the acceleration a upward, it is a/g, as ω² = g/ℓ. For
a ship's roll it is ΔGM/GM. The ξ of `ParametricOscillator` is ω² times it. For noise in the damping,
ẍ + (2ζω − ξ) ẋ + ω²x = 0,

    λ = −ζω + S(2ω)/8,   Λ(p) = −ζω p + p(p + 2) S(2ω)/16 + p² S(0)/8.

These are Eqs. (36)-(39) without walls.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Literal

from fpsolve.arrays import real_number, shown

Where = Literal["stiffness", "damping"]
PLACES = ("stiffness", "damping")
GRAVITY = 9.80665
"""In m/s²."""


def weak_moment(p: float, omega: float, zeta: float, at_double: float, at_zero: float, noise_in: Where) -> float:
    """Λ(p) in weak noise, see above, in 1/time: of λ it is pλ + p²(λ + ζω)/2, with p² S(0)/8 of noise in the damping.

    Args:
        p: the moment.
        omega: natural frequency ω, in rad/time.
        zeta: damping ratio ζ.
        at_double, at_zero: S(2ω) and S(0) of the relative stiffness, in time, or of the damping, in 1/time.
        noise_in: "stiffness" or "damping".

    Raises:
        ValueError: `noise_in` is neither.
    """
    rate = weak_exponent(omega, zeta, at_double, noise_in)
    from_zero = at_zero / 8 if noise_in == "damping" else 0.0
    return p * rate + p * p * ((rate + zeta * omega) / 2 + from_zero)


def weak_exponent(omega: float, zeta: float, at_double: float, noise_in: Where) -> float:
    """λ in weak noise, see above and `weak_moment`, in 1/time."""
    factor = omega**2 if checked_choice("noise_in", noise_in, PLACES) == "stiffness" else 1.0
    return -zeta * omega + factor * at_double / 8


def checked_choice(name: str, value: str, known: Collection[str]) -> str:
    """A value that is among those that are known. Raises `ValueError`."""
    if value not in known:
        raise ValueError(f"got {name} = {shown(value)}; must be one of {', '.join(known)}")
    return value


def frequencies_that_matter(omega: float, second: float | None, noise_in: Where) -> Mapping[str, float]:
    """ω at which S counts in weak noise, by their symbols: 2ω; of two modes 2ω₁, 2ω₂, ω₁ + ω₂, |ω₁ − ω₂|.

    Noise in the damping adds 0.

    Raises:
        ValueError: a frequency is not > 0, or `noise_in` is none.
    """
    double = 2 * checked_positive("frequency", omega)
    if second is None:
        matter = {"2ω": double}
    else:
        matter = {"2ω₁": double, "2ω₂": 2 * checked_positive("second_frequency", second), "ω₁ + ω₂": omega + second}
        if omega != second:
            matter["|ω₁ − ω₂|"] = abs(omega - second)
    if checked_choice("noise_in", noise_in, PLACES) == "damping":
        matter["0"] = 0.0
    return matter


def checked_positive(name: str, value: float) -> float:
    """A number > 0. Raises `ValueError`."""
    if not real_number(value, name) > 0:
        raise ValueError(f"got {name} = {shown(value)}; must be a number > 0 and finite")
    return float(value)
