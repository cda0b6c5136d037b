"""The coloured noise ξ(t), Eqs. (7)-(16): the non-Gaussian process and the Ornstein-Uhlenbeck process.

Both satisfy dξ = b(ξ) dt + σ dW with a stationary density P_s, and b = ½σ² (ln P_s)′, so that the noise
part of the generator is self-adjoint in P_s. The discretisation needs only what `Diffusion` names.
"""

from __future__ import annotations

import math
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from pydantic.dataclasses import dataclass

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoSuchExponent, Remedy
from fpsolve.model.faults import told_in_words
from fpsolve.model.parameters import DERIVED, SIZE, STRICT, parameter

Intensity = Annotated[float, parameter("noise intensity", "D0 = 0.1", "$D_0$", "1/time", **SIZE)]
CorrelationTime = Annotated[float, parameter("correlation time", "tau0 = 0.5", r"$\tau_0$", "time", **SIZE)]
Departure = Annotated[
    float,
    parameter(
        "departure from Gaussian noise; from 5/3 on the variance (10) is infinite", "r0 = 0.95", "$r_0$", ge=-1e6
    ),
]


class Noise(Protocol):
    """What solvers ask of a noise."""

    @property
    def mean(self) -> float:
        """Stationary mean of ξ."""

    @property
    def standard_deviation(self) -> float:
        """Stationary standard deviation of ξ: one noise unit, z = ξ/std."""

    @property
    def correlation_time(self) -> float:
        """About how long ξ remembers its value."""

    @property
    def moments(self) -> tuple[float, float]:
        """The p for which Λ(p) of a motion linear in ξ is finite, as a closed interval."""

    def spectral_density(self, omega: float) -> float:
        """S(ω) = ∫ C(t) cos ωt dt over all t, C the autocovariance."""


class Diffusion(Noise, Protocol):
    """A process dξ = ½σ² (ln P_s)′ dt + σ dW on an interval."""

    @property
    def diffusion(self) -> float:
        """σ, the coefficient of dW."""

    @property
    def half_width(self) -> float:
        """The support of ξ is (−half_width, half_width); ∞ where it is the whole line."""

    @property
    def end_exponent(self) -> float:
        """a in P_s ~ (half_width − |ξ|)^a at the ends of a bounded support; 0 on the whole line."""

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """ln P_s(ξ) of the stationary density; −∞ outside the support."""

    def density(self, xi: ArrayLike) -> FloatArray:
        """P_s(ξ); 0 outside the support."""


@told_in_words
@dataclass(frozen=True, config=STRICT)
class OrnsteinUhlenbeck:
    """Ornstein-Uhlenbeck noise dξ = −α₀ ξ dt + σ₀ dW, Eq. (15).

    Args:
        alpha: relaxation rate α₀, 1e-32 to 1e32, in 1/time.
        sigma: coefficient of the Wiener process, σ₀, 1e-32 to 1e32, in time^(-3/2).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    alpha: Annotated[float, parameter("relaxation rate", "", r"$\alpha_0$", "1/time", **DERIVED)]
    sigma: Annotated[float, parameter("intensity of its white noise", "", r"$\sigma_0$", "1/time^(3/2)", **DERIVED)]

    mean, half_width, end_exponent, moments = 0.0, math.inf, 0.0, (-math.inf, math.inf)

    @property
    def diffusion(self) -> float:
        return self.sigma

    @property
    def standard_deviation(self) -> float:
        """σ₀/√(2α₀)."""
        return self.sigma / math.sqrt(2 * self.alpha)

    @property
    def correlation_time(self) -> float:
        """1/α₀."""
        return 1 / self.alpha

    def drift(self, xi: ArrayLike) -> FloatArray:
        """−α₀ ξ."""
        return -self.alpha * np.asarray(xi, dtype=float)

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """Logarithm of the Gaussian density with variance σ₀²/(2α₀)."""
        z = np.asarray(xi, dtype=float) / self.standard_deviation
        return -0.5 * z**2 - math.log(math.sqrt(2 * math.pi) * self.standard_deviation)

    def density(self, xi: ArrayLike) -> FloatArray:
        """Gaussian density with variance σ₀²/(2α₀)."""
        return np.exp(self.log_density(xi))

    def spectral_density(self, omega: float) -> float:
        """S(ω) = σ₀²/(α₀² + ω²), Eq. (16)."""
        return self.sigma**2 / (self.alpha**2 + omega**2)


@told_in_words
@dataclass(frozen=True, config=STRICT)
class NonGaussianNoise:
    """Non-Gaussian coloured noise dξ = −V′(ξ)/τ₀ dt + (√(2D₀)/τ₀) dW, Eqs. (7)-(8).

    r₀ = 1 is the Ornstein-Uhlenbeck process; r₀ < 1 has bounded support, r₀ > 1 algebraic tails.

    Args:
        D0: noise intensity D₀, 1e-15 to 1e15, in 1/time.
        tau0: correlation time τ₀, 1e-15 to 1e15.
        r0: departure from the Gaussian noise, −1e6 ≤ r₀ < 3 (beyond, Eq. (9) cannot be normalised).

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    D0: Intensity
    tau0: CorrelationTime
    r0: Annotated[Departure, Field(lt=3)]

    @property
    def curvature(self) -> float:
        """b in 1 + b ξ², the bracket of Eqs. (8)-(9): b = τ₀(r₀ − 1)/(2D₀)."""
        return self.tau0 * (self.r0 - 1) / (2 * self.D0)

    mean = 0.0

    @property
    def diffusion(self) -> float:
        """√(2D₀)/τ₀, which is σ₀ of Eq. (14)."""
        return math.sqrt(2 * self.D0) / self.tau0

    @property
    def variance(self) -> float:
        """⟨ξ²⟩ of Eq. (10): 2D₀/(τ₀(5 − 3r₀)) for r₀ < 5/3, otherwise ∞."""
        return 2 * self.D0 / (self.tau0 * self._bracket) if self._bracket > 0 else math.inf

    @property
    def _bracket(self) -> float:
        """5 − 3r₀ of Eqs. (10) and (12), which rounding makes 0 for an r₀ just below 5/3."""
        return 5 - 3 * self.r0

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

    def potential(self, xi: ArrayLike) -> FloatArray:
        """V(ξ) of Eq. (8); its limit ξ²/2 for r₀ = 1; NaN outside the support."""
        square = np.asarray(xi, dtype=float) ** 2
        if self.r0 == 1:
            return square / 2
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.D0 / (self.tau0 * (self.r0 - 1)) * np.log1p(self.curvature * square)

    def drift(self, xi: ArrayLike) -> FloatArray:
        """−V′(ξ)/τ₀ = −(ξ/τ₀)/(1 + τ₀(r₀ − 1)ξ²/(2D₀)), Eq. (11) before its approximation."""
        xi = np.asarray(xi, dtype=float)
        return -xi / self.tau0 / (1 + self.curvature * xi**2)

    def log_density(self, xi: ArrayLike) -> FloatArray:
        """ln P_s(ξ) of Eq. (9) with the exponent −1/(r₀ − 1), normalised in closed form; −∞ outside the support."""
        from scipy.special import xlog1py  # takes a tenth of a second to import

        xi = np.asarray(xi, dtype=float)
        if self.r0 == 1:
            return self.ou_reduction().log_density(xi)
        bracket = self.curvature * xi**2
        with np.errstate(invalid="ignore", divide="ignore"):
            power = xlog1py(-1 / (self.r0 - 1), bracket)
        return np.where(bracket > -1, power, -math.inf) - self._log_normalisation

    def density(self, xi: ArrayLike) -> FloatArray:
        """P_s(ξ) of Eq. (9); 0 outside the support."""
        return np.exp(self.log_density(xi))

    @property
    def _log_normalisation(self) -> float:
        """ln Z of Eq. (9): Z = B(a + 1, ½)/√|b| for r₀ < 1 and B(a − ½, ½)/√b for r₀ > 1, with a = 1/|r₀ − 1|."""
        from scipy.special import betaln

        a = 1 / abs(self.r0 - 1)
        return float(betaln(a + 1 if self.r0 < 1 else a - 0.5, 0.5)) - 0.5 * math.log(abs(self.curvature))

    @property
    def correlation_time(self) -> float:
        """τ₁ of Eq. (12), that of the reduced noise, for r₀ < 5/3, otherwise ∞."""
        return 2 * (2 - self.r0) / self._bracket * self.tau0 if self._bracket > 0 else math.inf

    @property
    def moments(self) -> tuple[float, float]:
        """[−1, 0] for the algebraic tails of r₀ > 1, else all."""
        return (-1.0, 0.0) if self.r0 > 1 else (-math.inf, math.inf)

    def spectral_density(self, omega: float) -> float:
        """S(ω) of the reduced noise, Eq. (16); that of Eq. (7) itself has no closed form."""
        return self.ou_reduction().spectral_density(omega)

    def ou_reduction(self) -> OrnsteinUhlenbeck:
        """The Ornstein-Uhlenbeck process of Eqs. (12)-(14): α₀ = 1/τ₁, σ₀ = √(2D₀)/τ₀.

        Raises:
            ValueError: r₀ ≥ 5/3, where ⟨ξ²⟩ is infinite and Eq. (11) has no meaning.
        """
        if self._bracket <= 0:
            raise ValueError(
                f"r0 = {self.r0} has no Ornstein-Uhlenbeck reduction: Eqs. (11)-(12) need r0 < 5/3, "
                "where the variance (10) is finite"
            )
        return OrnsteinUhlenbeck(alpha=1 / self.correlation_time, sigma=self.diffusion)


ColouredNoise = OrnsteinUhlenbeck | NonGaussianNoise
"""The paper's noise, reduced or not."""


def relaxation_time(noise: Diffusion) -> float:
    """2⟨ξ²⟩/σ², the time in which ξ forgets its value: 1/α₀ for the Ornstein-Uhlenbeck process."""
    return 2 * (noise.standard_deviation / noise.diffusion) ** 2


def has_algebraic_tails(noise: Noise) -> bool:
    """Whether P_s falls like a power of ξ only, so that not all moments are finite."""
    return math.isfinite(noise.moments[1])


def check_existence(noise: Noise, p: float) -> None:
    """Refuse a p for which E‖x‖^p is infinite.

    Raises:
        NoSuchExponent: p is not among the `moments` of the noise.
    """
    low, high = noise.moments
    if not low <= p <= high:
        raise NoSuchExponent(
            f"Λ({p:g}) is infinite: for r0 > 1 the noise has algebraic tails, and a truncated domain would only "
            f"hide it; choose p in [{low:g}, {high:g}], r0 <= 1, {Remedy.REDUCTION}"
        )
