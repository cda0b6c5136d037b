"""What proofs take from a system and from a noise: coefficients as exact numbers, from the decimals of parameters."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class ExactMotion:
    """dφ/dt = ω + (damping + drive ξ) ½ sin 2φ and d ln‖x‖/dt = (damping + drive ξ) ½ (1 − cos 2φ), Eqs. (17)-(18).

    Where φ = π/2 mod π, ‖x‖ is multiplied by R = factor · e^{log_factor}.
    """

    omega: Fraction
    damping: Fraction
    drive: Fraction
    factor: Fraction
    log_factor: Fraction


@dataclass(frozen=True)
class ExactLaw:
    """dz = −ν b(z) dt + √ν dW, the noise in a unit of its own, z = ξ/unit.

    Attributes:
        nu: ν.
        slope: b′(0); b = slope z, or b = slope z/(1 − z²) of bounded noise, |z| < 1.
        squared_unit: that of the unit.
        is_bounded: whether the noise is.
    """

    nu: Fraction
    slope: Fraction
    squared_unit: Fraction
    is_bounded: bool


def gaussian_law(alpha: Fraction, squared_sigma: Fraction) -> ExactLaw:
    """The law of dξ = −α ξ dt + σ dW in units of its standard deviation."""
    return ExactLaw(2 * alpha, Fraction(1, 2), squared_sigma / (2 * alpha), is_bounded=False)
