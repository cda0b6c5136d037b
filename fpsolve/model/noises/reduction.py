"""The noise of Eq. (7) by its parameters, and the Gaussian one that replaces it, Eqs. (12)-(14)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal, cast

from pydantic import Field
from pydantic.fields import FieldInfo

from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.faults import TableError, strict_dataclass
from fpsolve.model.kinds import noise_kind
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.model.noises.ornstein_uhlenbeck import GaussianNoise, Intensity, Memory
from fpsolve.model.parameters import Table, parameter, stated_field

Departure = Annotated[
    float,
    parameter(
        "departure from Gaussian noise; 1 is Gaussian, and from 5/3 on the variance (10) is infinite",
        "r0 = 0.95",
        "$r_0$",
        ge=-1e6,
    ),
]
NEAR_GAUSSIAN = 0.1
"""|r₀ − 1| up to which the reduction is made."""


def _treatment(usual: str) -> Mapping[str, FieldInfo]:
    meaning = "Eq. (7) itself, or the reduction of Eqs. (12)-(14)"
    return {"treatment": stated_field(Literal["ou-reduction", "exact"], meaning, 'treatment = "ou-reduction"', usual)}


@strict_dataclass
class TreatedNoise(Noise):
    """The noise of Eq. (7), taken as it stands or replaced by its reduction: a word, the treatment, tells which."""

    D0: Intensity
    tau0: Memory
    r0: Departure

    stated: ClassVar[Mapping[str, FieldInfo]] = _treatment("exact")

    @property
    def diffusion(self) -> float:
        """√(2D₀)/τ₀, which is σ₀ of Eq. (14)."""
        return math.sqrt(2 * self.D0) / self.tau0

    @property
    def _bracket(self) -> float:
        """5 − 3r₀ of Eqs. (10) and (12), which rounding makes 0 for an r₀ just below 5/3."""
        return 5 - 3 * self.r0

    @property
    def variance(self) -> float:
        """⟨ξ²⟩ of Eq. (10): 2D₀/(τ₀(5 − 3r₀)) for r₀ < 5/3, otherwise ∞."""
        return 2 * self.D0 / (self.tau0 * self._bracket) if self._bracket > 0 else math.inf

    @property
    def correlation_time(self) -> float:
        """τ₁ of Eq. (12), that of the reduced noise, for r₀ < 5/3, otherwise ∞."""
        return 2 * (2 - self.r0) / self._bracket * self.tau0 if self._bracket > 0 else math.inf

    @classmethod
    def from_table(cls, table: Table) -> TreatedNoise:
        if table.get("treatment", cls.words["treatment"]) != cls.words["treatment"]:
            raise TableError(f'got "exact" beside kind = "{cls.kind}"; remove one of the two', "treatment")
        return cls(**{name: value for name, value in table.items() if name != "treatment"})

    def at(self, values: Mapping[str, float | str]) -> TreatedNoise:
        """The noise with other values of D₀, τ₀, r₀ or of its treatment, "exact" or "ou-reduction"."""
        numbers = {**self.values, **values}
        if (treatment := numbers.pop("treatment")) not in ("exact", "ou-reduction"):
            raise ValueError(f'got {treatment!r} as a treatment of the noise; must be one of "exact", "ou-reduction"')
        return cast("TreatedNoise", noise_kind("non-gaussian" if treatment == "exact" else treatment)(**numbers))


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
    stated: ClassVar[Mapping[str, FieldInfo]] = _treatment("ou-reduction")
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
    def replaces(self) -> TreatedNoise:
        """The noise of Eq. (7)."""
        return self.at({"treatment": "exact"})

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
