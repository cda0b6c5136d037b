"""What a measured signal is multiplied by to become ξ of a system; a spectral density by the square of it.

A mass on a spring whose relative stiffness varies obeys ẍ + 2ζω ẋ + ω²(1 + ξ) x = 0. `ParametricOscillator` has ω²ξ in
its place, in 1/time².
"""

from __future__ import annotations

import math

from fpsolve.arrays import shown

GRAVITY = 9.80665
"""In m/s²."""


def _positive(name: str, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
        raise ValueError(f"got {name} = {shown(value)}; must be a number > 0 and finite")
    return float(value)


def of_relative_stiffness(omega: float) -> float:
    """ω², by which a relative stiffness, dimensionless, becomes the ξ of `ParametricOscillator`, in 1/time².

    Args:
        omega: natural frequency, in rad/time.

    Raises:
        ValueError: it is not > 0 and finite.
    """
    return _positive("omega", omega) ** 2


def of_support_acceleration(gravity: float = GRAVITY) -> float:
    """1/g, by which the vertical acceleration of the support of a pendulum becomes a relative stiffness.

    A pendulum of length ℓ whose support has the acceleration a upward obeys ϑ̈ + 2ζω ϑ̇ + ((g + a)/ℓ) ϑ = 0, so that
    ω² = g/ℓ and ξ = a/g; the ξ of `ParametricOscillator` is a/ℓ = ω²a/g.

    Args:
        gravity: g, in the unit of the acceleration; that of m/s² if omitted.

    Raises:
        ValueError: it is not > 0 and finite.
    """
    return 1 / _positive("gravity", gravity)


def of_stability_height(metacentric_height: float) -> float:
    """1/GM, by which a variation ΔGM of the metacentric height of a ship becomes a relative stiffness of its roll.

    Roll obeys ϑ̈ + 2ζω ϑ̇ + ω²(GM + ΔGM)/GM ϑ = 0, so that ξ = ΔGM/GM.

    Args:
        metacentric_height: GM, in the unit of ΔGM.

    Raises:
        ValueError: it is not > 0 and finite.
    """
    return 1 / _positive("metacentric_height", metacentric_height)
