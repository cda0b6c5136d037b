"""The paper's coloured noise, Eqs. (7)-(10): the non-Gaussian process."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from pydantic.fields import FieldInfo
from scipy.special import betaln, hyp2f1, xlog1py

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import TableError, strict_dataclass
from fpsolve.model.kinds import kind_of
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.model.noises.ornstein_uhlenbeck import GaussianNoise, Intensity, Memory
from fpsolve.model.noises.steps import ImplicitStep, LinearStep, linear_step
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
_LARGE = 100.0
"""From it on four terms of a series of 1/x are exact to rounding."""


def treatment(usual: str) -> Mapping[str, FieldInfo]:
    meaning = "Eq. (7) itself, or the reduction of Eqs. (12)-(14)"
    return {"treatment": stated_field(Literal["ou-reduction", "exact"], meaning, 'treatment = "ou-reduction"', usual)}


@strict_dataclass
class TreatedNoise(Noise):
    """The noise of Eq. (7), taken as it stands or replaced by its reduction: a word, the treatment, tells which."""

    D0: Intensity
    tau0: Memory
    r0: Departure

    stated: ClassVar[Mapping[str, FieldInfo]] = treatment("exact")

    @property
    def diffusion(self) -> float:
        """√(2D₀)/τ₀, which is σ₀ of Eq. (14)."""
        return math.sqrt(2 * self.D0) / self.tau0

    @property
    def variance(self) -> float:
        """⟨ξ²⟩ of Eq. (10): 2D₀/(τ₀(5 − 3r₀)) for r₀ < 5/3, otherwise ∞; rounding may make the bracket 0."""
        bracket = 5 - 3 * self.r0
        return 2 * self.D0 / (self.tau0 * bracket) if bracket > 0 else math.inf

    @property
    def correlation_time(self) -> float:
        """τ₁ of Eq. (12), that of the reduced noise, for r₀ < 5/3, otherwise ∞."""
        bracket = 5 - 3 * self.r0
        return 2 * (2 - self.r0) / bracket * self.tau0 if bracket > 0 else math.inf

    @classmethod
    def from_table(cls, table: Table) -> TreatedNoise:
        if table.get("treatment", cls.words["treatment"]) != cls.words["treatment"]:
            raise TableError(f'got "exact" beside kind = "{cls.kind}"; remove one of the two', "treatment")
        return cls(**{name: value for name, value in table.items() if name != "treatment"})

    def _with(self, values: Mapping[str, float | str]) -> TreatedNoise:
        """The noise with other values of D₀, τ₀, r₀ or of its treatment, "exact" or "ou-reduction"."""
        numbers = {**self.values, **values}
        if (treatment := numbers.pop("treatment")) not in ("exact", "ou-reduction"):
            raise ValueError(f'got {treatment!r} as a treatment of the noise; must be one of "exact", "ou-reduction"')
        return cast("Any", kind_of("noise", "non-gaussian" if treatment == "exact" else str(treatment)))(**numbers)


@strict_dataclass
class NonGaussianNoise(TreatedNoise):
    """Non-Gaussian coloured noise dξ = −V′(ξ)/τ₀ dt + (√(2D₀)/τ₀) dW, Eqs. (7)-(8).

    r₀ = 1 is the Ornstein-Uhlenbeck process; r₀ < 1 has bounded support, r₀ > 1 algebraic tails.

    >>> print(f"{NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.9).half_width:.4f}")  # bounded, as r₀ < 1
    6.3246

    Args:
        D0: noise intensity D₀, 1e-15 to 1e15, in 1/time.
        tau0: correlation time τ₀, 1e-15 to 1e15.
        r0: departure from the Gaussian noise, −1e6 ≤ r₀ < 3 (beyond, Eq. (9) cannot be normalised).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    r0: Annotated[Departure, Field(lt=3)]

    kind: ClassVar[str] = "non-gaussian"
    of_xi: ClassVar[Mapping[str, str]] = {"D0": "{0}{0}time"}
    words: ClassVar[Mapping[str, str]] = {"treatment": "exact"}
    approximates_spectrum: ClassVar[bool] = True

    @property
    def curvature(self) -> float:
        """b in 1 + b ξ², the bracket of Eqs. (8)-(9): b = τ₀(r₀ − 1)/(2D₀)."""
        return self.tau0 * (self.r0 - 1) / (2 * self.D0)

    @property
    def standard_deviation(self) -> float:
        return math.sqrt(self.variance)

    @property
    def half_width(self) -> float:
        """√(2D₀/(τ₀(1 − r₀))) for r₀ < 1, otherwise ∞."""
        return 1 / math.sqrt(-self.curvature) if self.r0 < 1 else math.inf

    @property
    def end_exponent(self) -> float:
        return 1 / (1 - self.r0) if self.r0 < 1 else 0.0

    def drift(self, xi: ArrayLike) -> FloatArray:
        """−V′(ξ)/τ₀ = −(ξ/τ₀)/(1 + τ₀(r₀ − 1)ξ²/(2D₀)), Eq. (11) before its approximation."""
        xi = np.asarray(xi, dtype=float)
        return -xi / self.tau0 / (1 + self.curvature * xi**2)

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """ln P_s(ξ) of Eq. (9) with the exponent −1/(r₀ − 1), normalised in closed form; −∞ outside the support."""
        xi = np.asarray(xi, dtype=float)
        if self.r0 == 1:
            return self.ou_reduction().log_density(xi)
        bracket = self.curvature * xi**2
        with np.errstate(invalid="ignore", divide="ignore"):
            power = xlog1py(-1 / (self.r0 - 1), bracket)
        return np.where(bracket > -1, power, -math.inf) - self._log_normalisation

    @property
    def _log_normalisation(self) -> float:
        """ln Z of Eq. (9): Z = B(x, ½)/√|b| with x = a + 1 for r₀ < 1, a − ½ for r₀ > 1, and a = 1/|r₀ − 1|.

        For large x, where Γ functions would cancel, by ln Γ(x + ½) − ln Γ(x) = ½ ln x − 1/(8x) + 1/(192x³) − …
        """
        a, size = 1 / abs(self.r0 - 1), 0.5 * math.log(abs(self.curvature))
        x = a + 1 if self.r0 < 1 else a - 0.5
        if x < _LARGE:
            return float(betaln(x, 0.5)) - size
        square = 1 / x**2
        series = (-1 / 8 + square * (1 / 192 + square * (-1 / 640 + square * 17 / 14336))) / x
        return 0.5 * math.log(math.pi / x) - series - size

    @property
    def may_tilt(self) -> bool:
        """Whether exp(s ξ) has a mean."""
        return not self.has_algebraic_tails

    @property
    def has_algebraic_tails(self) -> bool:
        return self.r0 > 1

    def spectral_density(self, omega: float) -> float:
        """S(ω) of the reduced noise, Eq. (16); that of Eq. (7) itself has no closed form."""
        return self.ou_reduction().spectral_density(omega)

    def ou_reduction(self) -> GaussianNoise:
        """The Ornstein-Uhlenbeck process of Eqs. (12)-(14) that stands for this one.

        Raises:
            ValueError: r₀ ≥ 5/3, where ⟨ξ²⟩ is infinite and Eq. (11) has no meaning.
        """
        if math.isinf(self.variance):
            raise ValueError(
                f"r0 = {self.r0} has an infinite variance (10), and no Ornstein-Uhlenbeck reduction, Eqs. (11)-(12); "
                "choose r0 < 5/3"
            )
        return cast("GaussianNoise", self.at({"treatment": "ou-reduction"}))

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """Eq. (9) as a beta or a Student variable."""
        if self.r0 == 1:
            return self.standard_deviation * rng.standard_normal(size)
        a = 1 / abs(self.r0 - 1)
        if self.r0 < 1:
            return self.half_width * (2 * rng.beta(a + 1, a + 1, size) - 1)
        nu = 2 * a - 1
        return math.sqrt(2 * self.D0 * a / (self.tau0 * nu)) * rng.standard_t(nu, size)

    def step(self, h: float, bias: float = 0.0) -> ImplicitStep | LinearStep:
        if self.r0 == 1:
            return linear_step(1 / self.tau0, self.diffusion, h, bias)
        force = self.diffusion**2 * bias
        return ImplicitStep(self.diffusion * math.sqrt(h), force * h, h / (2 * self.tau0), self.curvature)

    @property
    def largest_step(self) -> float:
        """τ₀/20; near ends where P_s ~ d^a the scheme has the order (a + 1)/2 only, which for a < 3 asks for less."""
        share = 0.5 if self.r0 == 1 else 0.05
        if self.r0 < 1:
            a = self.end_exponent
            share = min(share, max(2e-3 * min(a, 1.0) ** 2, a * 1.25e-3 ** (2 / (a + 1))))
        return share * self.tau0

    @property
    def one_sided(self) -> Sequence[str]:
        """r₀ at 1: above, Λ is infinite, or another one."""
        return ("r0",) if self.r0 == 1 else ()

    def derivative(self, name: str) -> NoiseDerivative:
        """∂/∂θ of Eq. (9), ln P_s = −ln(1 + q)/(r₀ − 1) with q = (r₀ − 1)u and u = τ₀ξ²/(2D₀).

        By r₀ it is u² (ln(1 + q) − q/(1 + q))/q², a hypergeometric function, as a difference would cancel near q = 0.
        """

        def u(xi: FloatArray) -> FloatArray:
            return np.asarray(0.5 * self.tau0 / self.D0 * xi**2)

        def by_log_tau0(xi: FloatArray) -> FloatArray:
            return np.asarray(-u(xi) / (1 + (self.r0 - 1) * u(xi)))

        match name:
            case "D0":
                return NoiseDerivative(0.5 / self.D0, lambda xi: -by_log_tau0(xi) / self.D0)
            case "tau0":
                return NoiseDerivative(-1 / self.tau0, lambda xi: by_log_tau0(xi) / self.tau0)
        end_exponent = 1 / (1 - self.r0) ** 2 if math.isfinite(self.half_width) else 0.0

        def by_r0(xi: FloatArray) -> FloatArray:
            # of complex numbers, as hyp2f1 of large real ones loses digits, and is infinite in the end
            return np.asarray(0.5 * u(xi) ** 2 * hyp2f1(2, 2, 3, (1 - self.r0) * u(xi) + 0j).real)

        return NoiseDerivative(0.0, by_r0, end_exponent)
