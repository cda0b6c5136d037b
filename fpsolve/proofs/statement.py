"""What a proof is about: an oscillator and its noise by their decimals, and Eq. (19) in balls.

The phase is gauged: T = R^{p s(φ)} u, where the sawtooth s rises by one from one impact to the next, makes u continuous
with dφ/dt > 0 at the impacts. With z the noise in a unit of its own and κ = ln R/π, R^{-ps} L(p) R^{ps} is

    L = ν (½ ∂zz − b(z) ∂z) + F₀ + z F₁,      F = h(φ) (∂φ + pκ) + p q(φ),

h₀ = ω + ε² c₁ ½ sin 2φ, q₀ = ε² c₁ ½ (1 − cos 2φ), and h₁, q₁ the same functions times ε and the unit of the noise.
For the Ornstein-Uhlenbeck process, Eqs. (13)-(15), the unit is its standard deviation, ν = 2α₀ and b = z/2. For Eq. (7)
with r₀ < 1 it is the end of the support, ν = (1 − r₀)/τ₀ and b = a z/(1 − z²) with a = 1/(1 − r₀).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.model.exact import ExactLaw, ExactMotion
from fpsolve.model.kinds import kind_classes
from fpsolve.model.noise import Noise
from fpsolve.model.parameters import Parametrised
from fpsolve.model.plane import System
from fpsolve.model.problem import Problem
from fpsolve.proofs.balls import Balls, ball

if TYPE_CHECKING:
    from flint import arb

DECIMAL = re.compile(r"-?(\d{1,400}(\.\d{0,1100})?|\.\d{1,1100})([eE][-+]?\d{1,3})?", re.ASCII)
"""A number; words such as "exact" are none."""
Parameters = Mapping[str, str]
"""Numbers as decimals, and words, by the keys of a case file."""


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


def linear_values(problem: Problem) -> Mapping[str, float | str]:
    """The values of the parameters on which the linear problem depends, by their keys."""
    inert = {f"{half.section}.{name}" for half in problem.halves for name in half.inert}
    return {key: value for key, value in problem.values.items() if key not in inert}


def parameters_of(problem: Problem) -> Parameters:
    """The shortest decimals that are read as the numbers of a problem.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
        TypeError: no proof is known for such a system with such a noise.
    """
    stated = {key: str(value) for key, value in linear_values(problem).items()}
    if _exact(problem.system, problem.noise, stated) is None:
        system, noise = (type(half).__name__ for half in problem.halves)
        raise TypeError(
            f"got {system} with {noise}; proofs are for a VibroImpactOscillator with OrnsteinUhlenbeck or "
            "NonGaussianNoise"
        )
    return stated


def exact_halves(stated: Parameters) -> tuple[ExactMotion, ExactLaw]:
    """What is stated, in exact numbers.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
        ValueError: these are no parameters of a system and a noise for which a proof is known, or out of range.
    """
    system, noise = _kinds(stated)
    expected = _keys(system) | _keys(noise)
    if set(stated) != expected:
        raise ValueError(f"parameters must be {', '.join(sorted(expected))}")
    for name, word in noise.words.items():
        found = stated[f"{noise.section}.{name}"]
        if found != word:
            words = [each.words[name] for each in kind_classes("noises") if _keys(each) == _keys(noise)]
            raise ValueError(f"got {noise.section}.{name} = {found[:40]!r}; must be {' or '.join(map(repr, words))}")
    for half in (system, noise):
        decimals = {name: text for name, text in _named(half, stated).items() if name not in half.words}
        numbers = [name for name in decimals if half.fields()[name].annotation is float]
        half(**decimals | {name: float(check_decimal(decimals[name])) for name in numbers})
    exact = _exact(system, noise, stated)
    if exact is None:
        raise ValueError(f"no proof is known for {system.__name__} with {noise.__name__}")
    return exact


def _exact(
    system: System | type[System], noise: Noise | type[Noise], stated: Parameters
) -> tuple[ExactMotion, ExactLaw] | None:
    motion, law = system.exact_motion(_named(system, stated)), noise.exact_law(_named(noise, stated))
    return None if motion is None or law is None else (motion, law)


def check_decimal(text: str) -> str:
    """The text, if it is a decimal number. Raises `ValueError`."""
    if not DECIMAL.fullmatch(text):
        raise ValueError(f"got {text[:40]!r}; must be a decimal number such as '0.95'")
    return text


def inert_keys(stated: Parameters) -> set[str]:
    """The keys of other parameters of such a system and such a noise, on which no exponent depends."""
    return {f"{half.section}.{name}" for half in _kinds(stated) for name in half.inert}


def _kinds(stated: Parameters) -> tuple[type[System], type[Noise]]:
    """The first system and noise that have most of these keys and fewest others, and whose words are stated."""

    def fit(kind: type[Parametrised]) -> tuple[int, int, int]:
        words = [stated.get(f"{kind.section}.{name}") == word for name, word in kind.words.items()]
        keys, known = _keys(kind), len(_keys(kind) & set(stated))
        return known, known and known - len(keys), sum(words)

    return max(kind_classes("systems"), key=fit), max(kind_classes("noises"), key=fit)


def _keys(kind: type[Parametrised]) -> set[str]:
    """The keys of the parameters on which the linear problem depends."""
    return {f"{kind.section}.{name}" for name in (*kind.fields(), *kind.words) if name not in kind.inert}


def _named(half: Parametrised | type[Parametrised], stated: Parameters) -> Mapping[str, str]:
    """What is stated for a system or a noise, by names without their section."""
    return {key.partition(".")[2]: text for key, text in stated.items() if key.partition(".")[0] == half.section}


def cylinder(stated: Parameters) -> Cylinder:
    """Eq. (19) for parameters.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
    """
    motion, law = exact_halves(stated)
    unit, zero = ball(law.squared_unit).sqrt(), ball(0)
    omega, still, driven = ball(motion.omega), ball(motion.damping) / 2, ball(motion.drive) * unit / 2
    return Cylinder(
        h=(_wave(omega, zero, still), _wave(zero, zero, driven)),
        q=(_wave(still, -still, zero), _wave(driven, -driven, zero)),
        kappa=(ball(motion.log_factor) + ball(motion.factor).log()) / zero.pi(),
        nu=ball(law.nu),
        slope=ball(law.slope),
        is_bounded=law.is_bounded,
        unit=unit,
    )
