"""The Gaussian noise that replaces that of Eq. (7), Eqs. (12)-(14)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

from pydantic import Field
from pydantic.fields import FieldInfo

from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noise import NoiseDerivative
from fpsolve.model.noises.non_gaussian import Departure, TreatedNoise, treatment
from fpsolve.model.noises.ornstein_uhlenbeck import GaussianNoise

NEAR_GAUSSIAN = 0.1
"""|r₀ − 1| up to which the reduction is made."""


@strict_dataclass
class ReducedNoise(TreatedNoise, GaussianNoise):
    """The Ornstein-Uhlenbeck process by which Eqs. (12)-(14) replace the noise of Eq. (7): α₀ = 1/τ₁, σ₀ = √(2D₀)/τ₀.

    Args:
        D0: noise intensity D₀, 1e-15 to 1e15, in 1/time.
        tau0: correlation time τ₀, 1e-15 to 1e15.
        r0: departure from the Gaussian noise, −1e6 ≤ r₀ < 5/3 (beyond, the variance (10) is infinite).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    r0: Annotated[Departure, Field(lt=math.nextafter(5 / 3, 0))]  # at which 5 - 3 r0 is 0 already

    kind: ClassVar[str] = "ou-reduction"
    stated: ClassVar[Mapping[str, FieldInfo]] = treatment("ou-reduction")
    words: ClassVar[Mapping[str, str]] = {"treatment": "ou-reduction"}

    @property
    def alpha(self) -> float:
        """α₀ = 1/τ₁."""
        return 1 / self.correlation_time

    @property
    def sigma(self) -> float:
        """σ₀."""
        return self.diffusion

    @property
    def remarks(self) -> Sequence[Message]:
        """A remark on the reduction (12)-(14), made for r₀ near 1: the variance that it gives, against Eq. (10)."""
        departure = abs(self.r0 - 1)
        if departure <= NEAR_GAUSSIAN * (1 + 1e-9):  # to rounding
            return ()
        variances = {"reduced": self.standard_deviation**2, "variance": self.variance}
        criterion = {"departure": departure, "most": NEAR_GAUSSIAN}
        return (Message(Code.FAR_FROM_GAUSSIAN, **criterion, **variances, remedy=Remedy.NO_REDUCTION),)

    def derivative(self, name: str) -> NoiseDerivative:
        """∂/∂θ by D₀, τ₀ or r₀ of α₀ = (5 − 3r₀)/(2(2 − r₀)τ₀) and σ₀."""
        match name:
            case "D0":
                return self.by_logarithms(0.5 / self.D0, 0.0)
            case "tau0":
                return self.by_logarithms(-1 / self.tau0, -1 / self.tau0)
        return self.by_logarithms(0.0, 1 / (2 - self.r0) - 3 / (5 - 3 * self.r0))
