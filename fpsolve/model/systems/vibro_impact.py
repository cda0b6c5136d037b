"""The vibro-impact oscillator: Eqs. (3)-(6) and the coefficients of the polar form, Eqs. (17)-(18)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import model_validator

from fpsolve.arrays import identity
from fpsolve.messages import Code, Message
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.parameters import ANY_SIGN, SIZE, parameter
from fpsolve.model.plane import (
    CoefficientMatrix,
    CubicTerms,
    Jump,
    LinearMotion,
    ParameterDerivative,
    System,
)
from fpsolve.model.quantity import OSCILLATOR_RESPONSE


class ImpactLaw(StrEnum):
    """How the amplitude changes at an impact.

    DELTA: R = exp(−ε²(1 − r)), the limit of the smoothed δ(cos φ) of Eqs. (17)-(18).
    RESTITUTION: R = 1 − ε²(1 − r), the bounce of Eq. (3) with the loss scaled as in Eq. (6).
    """

    DELTA = "delta"
    RESTITUTION = "restitution"


DAMPING = ((0.0, 0.0), (0.0, 1.0))
"""A of the force on the velocity alone, which damps or drives: h₁ = ½ sin 2φ and q₁ = ½(1 − cos 2φ), Eq. (18)."""


@strict_dataclass
class VibroImpactOscillator(System):
    """Rayleigh-Van der Pol oscillator that bounces off a wall at x = 0, Eqs. (3) and (6).

    >>> VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1).values["restitution"]
    0.8

    Args:
        omega: natural frequency ω, 1e-15 to 1e15, in radians per unit time.
        restitution: coefficient of restitution, 0 < r ≤ 1; 1 is no loss.
        c1: linear damping coefficient, −1e15 to 1e15, in 1/time; positive feeds energy in.
        epsilon: ε of Eq. (6), 1e-12 to 1e6; 1 is the unscaled system (3).
        c2, c3: nonlinear damping coefficients, 0 to 1e15; the linear theory does not use them.
        impact: one of `ImpactLaw`, or its name.

    Raises:
        ParameterError: a parameter is not a finite number in its range, or the restitution law
            would reverse the velocity: 1 − ε²(1 − r) ≤ 0.
    """

    omega: Annotated[float, parameter("natural frequency", "omega = 1.0", r"$\omega$", "rad/time", **SIZE)]
    restitution: Annotated[
        float, parameter("coefficient of restitution; 1 means no loss", "restitution = 0.8", "$r$", gt=0, le=1)
    ]
    c1: Annotated[
        float,
        parameter("linear damping coefficient", "c1 = 0.1", "$c_1$", "1/time", name="damping coefficient", **ANY_SIGN),
    ]
    epsilon: Annotated[
        float,
        parameter(
            "small parameter of Eq. (6); 1 is the unscaled system", "epsilon = 0.1", r"$\varepsilon$", ge=1e-12, le=1e6
        ),
    ]
    c2: Annotated[
        float, parameter("nonlinear damping coefficient", "c2 = 0.0", "$c_2$", "1/(time length²)", ge=0, le=1e15)
    ] = 0.0
    c3: Annotated[
        float, parameter("nonlinear damping coefficient", "c3 = 0.0", "$c_3$", "time/length²", ge=0, le=1e15)
    ] = 0.0
    impact: Annotated[ImpactLaw, parameter("impact law", 'impact = "delta"', strict=False)] = ImpactLaw.DELTA

    kind: ClassVar[str] = "vibro-impact"
    section: ClassVar[str] = "oscillator"
    noise_unit: ClassVar[str] = "1/time"
    inert: ClassVar[Sequence[str]] = ("c2", "c3")

    @model_validator(mode="after")
    def _restitution_law_keeps_the_direction(self) -> Self:
        if self.impact == ImpactLaw.RESTITUTION and self._loss >= 1:
            raise ValueError(
                f"the restitution law needs 1 - epsilon^2 (1 - restitution) > 0, but it is {1 - self._loss:.6g}; "
                'use a smaller epsilon, a larger restitution, or impact = "delta"'
            )
        return self

    @property
    def _loss(self) -> float:
        return self.epsilon**2 * (1 - self.restitution)

    @property
    def log_impact_factor(self) -> float:
        """ln R, the jump of the log-amplitude ρ at one impact."""
        return -self._loss if self.impact == ImpactLaw.DELTA else math.log1p(-self._loss)

    def impact_factor(self, p: float = 1.0) -> float:
        """R^p: the eigenfunction obeys T(φ⁻, ξ) = R^p T(φ⁺, ξ) at φ = π/2 and 3π/2."""
        return math.exp(p * self.log_impact_factor)

    def linear(self) -> LinearMotion:
        """In (x, ẋ/ω) free oscillation dφ = ω dt, noise ε ξ (h₁, q₁), damping ε² c₁ (h₁, q₁), Eqs. (17)-(18); impacts.

        These are where cos φ = 0; to the order ε² both laws lose 1 − r. Of degree 3 is −ε²(c₂x² + c₃ẋ²) ẋ.
        """
        square = self.epsilon**2
        bent = (0.0, -square * self.c2, 0.0, -square * self.c3 * self.omega**2)
        return LinearMotion(
            (
                CoefficientMatrix(0, ((0.0, self.omega), (-self.omega, 0.0))),
                CoefficientMatrix(1, DAMPING, identity),
                CoefficientMatrix(2, ((0.0, 0.0), (0.0, self.c1))),
            ),
            (Jump(math.pi / 2, self.log_impact_factor, -self._loss),),
            self.epsilon,
            cubic=CubicTerms(((0.0, 0.0, 0.0, 0.0), bent)) if any(bent) else None,
            second_unit=self.omega,
            quantities=OSCILLATOR_RESPONSE,
        )

    @property
    def remarks(self) -> Sequence[Message]:
        """A remark on the delta law where the bounce of Eq. (3) cannot be: 1 − ε²(1 − r) ≤ 0."""
        left = 1 - self._loss
        return () if left > 0 else (Message(Code.IMPOSSIBLE_BOUNCE, left=left, factor=self.impact_factor()),)

    def derivative(self, name: str) -> ParameterDerivative:
        """∂/∂θ of the terms and of ln R, θ = ω, r, c₁ or ε."""
        bounce = 1.0 if self.impact == ImpactLaw.DELTA else 1 / (1 - self._loss)
        match name:
            case "omega":
                return ParameterDerivative(terms=(CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0))),))
            case "c1":
                return ParameterDerivative(terms=(CoefficientMatrix(2, DAMPING),))
            case "restitution":
                return ParameterDerivative(jumps=(self.epsilon**2 * bounce,))
        slope = -2 * self.epsilon * (1 - self.restitution) * bounce
        return ParameterDerivative(terms=self.by_epsilon(), jumps=(slope,))

    def restitution_at(self, log_factor: float) -> tuple[str, float, float]:
        """r, the value for which this law, with this ε, has a given ln R, and dr/d ln R; it may be out of its range."""
        is_delta, square = self.impact == ImpactLaw.DELTA, self.epsilon**2
        with np.errstate(over="ignore"):
            loss, slope = (-log_factor, 1.0) if is_delta else (-float(np.expm1(log_factor)), float(np.exp(log_factor)))
        return "r", 1 - loss / square, slope / square
