"""An oscillator whose stiffness is noise, with or without a wall."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from fpsolve.arrays import identity
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.parameters import ANY_SIGN, parameter
from fpsolve.model.plane import CoefficientMatrix, Jump, LinearMotion, ParameterDerivative, System


@strict_dataclass
class ParametricOscillator(System):
    """ẍ + 2·damping·ẋ + (stiffness + ξ) x = 0, and ẋ⁺ = −restitution·ẋ⁻ at a wall at x = 0.

    The state is (x, ẋ). Without noise it decays at the rate of the damping where stiffness > damping².

    >>> ParametricOscillator(stiffness=1.0, damping=0.1).terms[0].matrix
    ((0.0, 1.0), (-1.0, -0.2))

    Args:
        stiffness: −1e15 to 1e15, in 1/time²; 0 for a free particle, negative for an inverted pendulum.
        damping: −1e15 to 1e15, in 1/time.
        restitution: R, 0 < R ≤ 1; 1 is no wall, or one that takes nothing.

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    stiffness: Annotated[
        float,
        parameter("stiffness without noise", "stiffness = 1.0", r"$\kappa$", "1/time²", name="stiffness", **ANY_SIGN),
    ]
    damping: Annotated[
        float,
        parameter(
            "damping; the damping force is twice this times the velocity", "damping = 0.1", "$b$", "1/time", **ANY_SIGN
        ),
    ]
    restitution: Annotated[
        float, parameter("coefficient of restitution at x = 0; 1 means no wall", "restitution = 0.8", "$R$", gt=0, le=1)
    ] = 1.0

    kind: ClassVar[str] = "parametric"
    noise_unit: ClassVar[str] = "1/time²"

    def linear(self) -> LinearMotion:
        """Its terms without noise, of order 0, and ξ times x, of order 1; and the wall, passed at speed 1."""
        free = CoefficientMatrix(0, ((0.0, 1.0), (-self.stiffness, -2 * self.damping)))
        driven = CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity)
        return LinearMotion((free, driven), (Jump(math.pi / 2, math.log(self.restitution)),))

    def derivative(self, name: str) -> ParameterDerivative:
        match name:
            case "stiffness":
                return ParameterDerivative(terms=(CoefficientMatrix(0, ((0.0, 0.0), (-1.0, 0.0))),))
            case "damping":
                return ParameterDerivative(terms=(CoefficientMatrix(0, ((0.0, 0.0), (0.0, -2.0))),))
        return ParameterDerivative(jumps=(1 / self.restitution,))
