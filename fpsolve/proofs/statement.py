"""What a proof is about: an oscillator and its noise by their decimals, and Eq. (19) in balls.

The phase is gauged: T = R^{p s(φ)} u, where the sawtooth s rises by one from one impact to the next, makes u continuous
with dφ/dt > 0 at the impacts. With z the noise in a unit of its own and κ = ln R/π, R^{-ps} L(p) R^{ps} is

    L = ν (½ ∂zz − b(z) ∂z) + F₀ + z F₁,      F = h(φ) (∂φ + pκ) + p q(φ),

h₀ = ω + ε² c₁ ½ sin 2φ, q₀ = ε² c₁ ½ (1 − cos 2φ), and h₁, q₁ the same functions times ε and the unit of the noise.
For the Ornstein-Uhlenbeck process, Eqs. (13)-(15), the unit is its standard deviation, ν = 2α₀ and b = z/2. For Eq. (7)
with r₀ < 1 it is the end of the support, ν = (1 − r₀)/τ₀ and b = a z/(1 − z²) with a = 1/(1 − r₀).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.errors import NoSuchExponent
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import ImpactLaw, VibroImpactOscillator
from fpsolve.proofs.balls import Balls, ball

if TYPE_CHECKING:
    from flint import arb

EXACT, REDUCED = "exact", "ou-reduction"
OSCILLATOR = ("oscillator.omega", "oscillator.restitution", "oscillator.c1", "oscillator.epsilon")
IMPACT, TREATMENT = "oscillator.impact", "noise.treatment"
NOISE, DIRECT = ("noise.D0", "noise.tau0", "noise.r0"), ("noise.alpha", "noise.sigma")
Parameters = Mapping[str, str]
"""Numbers as decimals, and the two words, by the keys of a case file."""


@dataclass(frozen=True)
class Cylinder:
    """Eq. (19) between impacts, gauged, in balls.

    Attributes:
        h, q: phase speed and growth rate, h₀ and h₁, q₀ and q₁, each by its coefficients of e^{2idφ}, d = −1, 0, 1.
        kappa: κ = ln R/π.
        nu: ν.
        slope: b′(0), ½ or a.
        is_bounded: whether the noise is.
        unit: of ξ, so that ξ = unit · z.
    """

    h: tuple[Balls, Balls]
    q: tuple[Balls, Balls]
    kappa: arb
    nu: arb
    slope: arb
    is_bounded: bool
    unit: arb

    def drift(self, z: Any) -> Any:
        """b(z)."""
        return self.slope * z / (1 - z * z) if self.is_bounded else self.slope * z

    def drift_slope(self, z: Any) -> Any:
        """b′(z)."""
        return self.slope * (1 + z * z) / (1 - z * z) ** 2 if self.is_bounded else self.slope + 0 * z

    def bands(self, i: int, p: arb, waves: int) -> Balls:
        """F_i from mode k to mode k + d, shape (3, 2 waves + 1), d = −1, 0, 1 and k = −waves … waves."""
        from flint import acb

        turns = np.array([acb(0, 2 * k) + p * self.kappa for k in range(-waves, waves + 1)], dtype=object)
        return np.outer(self.h[i], turns) + p * self.q[i][:, None]

    def growth(self, i: int) -> Balls:
        """q_i + κ h_i, the derivative of F_i 1 by p, at the modes −1, 0, 1."""
        return self.q[i] + self.kappa * self.h[i]


def _wave(mean: arb, cosine: arb, sine: arb) -> Balls:
    """Coefficients of mean + cosine cos 2φ + sine sin 2φ."""
    from flint import acb

    return np.array([acb(cosine / 2, sine / 2), acb(mean), acb(cosine / 2, -sine / 2)], dtype=object)


def parameters_of(problem: Problem) -> Parameters:
    """The shortest decimals that are read as the numbers of a problem.

    Raises:
        TypeError: it is not the paper's oscillator with one of its noises.
    """
    motion, noise = problem.system, problem.noise
    if not isinstance(motion, VibroImpactOscillator) or not isinstance(noise, OrnsteinUhlenbeck | NonGaussianNoise):
        raise TypeError(
            f"got {type(motion).__name__} with {type(noise).__name__}; proofs are for a VibroImpactOscillator with "
            "OrnsteinUhlenbeck or NonGaussianNoise"
        )
    stated = {key: repr(getattr(motion, key.partition(".")[2])) for key in OSCILLATOR} | {IMPACT: str(motion.impact)}
    keys = NOISE if isinstance(noise, NonGaussianNoise) else DIRECT
    stated |= {key: repr(getattr(noise, key.partition(".")[2])) for key in keys}
    return stated | {TREATMENT: EXACT} if keys == NOISE else stated


def cylinder(stated: Parameters) -> Cylinder:
    """Eq. (19) for parameters.

    Raises:
        NoSuchExponent: r₀ > 1 for Eq. (7) as it stands.
    """
    omega, restitution, c1, epsilon = (ball(stated[key]) for key in OSCILLATOR)
    square = epsilon * epsilon
    loss = square * (1 - restitution)
    log_factor = -loss if stated[IMPACT] == ImpactLaw.DELTA else (1 - loss).log()
    nu, slope, unit, is_bounded = _noise(stated)
    still, driven = square * c1 / 2, epsilon * unit / 2
    zero = ball(0)
    return Cylinder(
        h=(_wave(omega, zero, still), _wave(zero, zero, driven)),
        q=(_wave(still, -still, zero), _wave(driven, -driven, zero)),
        kappa=log_factor / zero.pi(),
        nu=nu,
        slope=slope,
        is_bounded=is_bounded,
        unit=unit,
    )


def _noise(stated: Parameters) -> tuple[arb, arb, arb, bool]:
    """ν, b′(0), the unit, and whether the noise is bounded."""
    if DIRECT[0] in stated:
        alpha, sigma = (ball(stated[key]) for key in DIRECT)
        return 2 * alpha, ball("0.5"), sigma / (2 * alpha).sqrt(), False
    D0, tau0, r0 = (ball(stated[key]) for key in NOISE)
    departure = Fraction(stated[NOISE[2]])
    if stated[TREATMENT] == EXACT and departure != 1:
        if departure > 1:
            raise NoSuchExponent(Message(Code.NO_BOUND, key=NOISE[2], value=stated[NOISE[2]], remedy=Remedy.REDUCTION))
        return (1 - r0) / tau0, 1 / (1 - r0), (2 * D0 / (tau0 * (1 - r0))).sqrt(), True
    alpha = (5 - 3 * r0) / (2 * (2 - r0) * tau0)
    return 2 * alpha, ball("0.5"), (2 * D0).sqrt() / tau0 / (2 * alpha).sqrt(), False
