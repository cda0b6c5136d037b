"""What a proof is about: a system and its noise, by their decimals or by their matrices and rates, and L(p) in balls.

The motion ẋ = (A₀ + ξ A₁) x has in x = ‖x‖ (cos φ, −sin φ) the phase speed h₀ + ξ h₁, h = e′ᵀA e, and the growth rate
q₀ + ξ q₁, q = eᵀA e, of ln ‖x‖. At a ray the speed has one sign σ for all ξ, and x⁺ = R x⁻. The phase is gauged:
T = e^{p s(φ)} u, where the sawtooth s falls by σ ln R at each ray and rises by κ = Σ σ ln R/π per radian between them,
makes u continuous. With z the noise in a unit of its own, e^{-ps} L(p) e^{ps} is

    L = ν (½ ∂zz − b(z) ∂z) + F₀ + z F₁,      F = h(φ) (∂φ + pκ) + p q(φ),

h₁ and q₁ times that unit. For Eq. (18), h₀ = ω + ε² c₁ ½ sin 2φ, q₀ = ε² c₁ ½ (1 − cos 2φ), and h₁, q₁ are the same
functions times ε, without ω.
For the Ornstein-Uhlenbeck process, Eqs. (13)-(15), the unit is its standard deviation, ν = 2α₀ and b = z/2. For Eq. (7)
with r₀ < 1 it is the end of the support, ν = (1 − r₀)/τ₀ and b = a z/(1 − z²) with a = 1/(1 − r₀). For the sine-Wiener
process it is the amplitude, z = cos θ and the noise has ½ σ² ∂θθ; for a chain it is 1 and the noise has the matrix of
its rates, u a component for each state. White noise has L = F₀ + ½ F₁² in the sense of Stratonovich, its unit is s.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.model.exact import BasisKind, ExactLaw, ExactMotion
from fpsolve.model.kinds import is_ours, kind_classes
from fpsolve.model.noise import Noise
from fpsolve.model.parameters import Parametrised
from fpsolve.model.plane import System
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.proofs.balls import Balls, ball, each
from fpsolve.proofs.records import ChainRecord, LinearRecord, MotionRecord, Record

if TYPE_CHECKING:
    from flint import arb

DECIMAL = re.compile(r"-?(\d{1,400}(\.\d{0,1100})?|\.\d{1,1100})([eE][-+]?\d{1,3})?", re.ASCII)
"""A number; words such as "exact" are none."""
Parameters = Mapping[str, str]
"""Numbers as decimals, and words, by the keys of a case file."""


@dataclass(frozen=True)
class Statement:
    """A system and a noise.

    Attributes:
        parameters: of the system if it has no motion here, and of the noise if it has no chain; else they are labels.
        motion: the system by its matrices.
        chain: the noise by its rates.
        linear: both by their matrices, of more than two variables.
    """

    parameters: Parameters
    motion: MotionRecord | None = None
    chain: ChainRecord | None = None
    linear: LinearRecord | None = None

    @property
    def records(self) -> tuple[Record | None, ...]:
        """What tells the problem besides parameters."""
        return self.motion, self.chain, self.linear

    @property
    def labels(self) -> list[str]:
        """The keys of the parameters that are labels."""
        if self.linear:
            return [*self.parameters]
        told = [half.section for half, own in ((System, self.motion), (Noise, self.chain)) if own is not None]
        return [key for key in self.parameters if _section(key) in told]


@dataclass(frozen=True)
class Cylinder:
    """L(p) between jumps, gauged, in balls.

    Attributes:
        h, q: phase speed and growth rate, h₀ and h₁, q₀ and q₁, each by its coefficients of e^{2idφ}, d = −1, 0, 1.
        kappa: κ.
        nu, slope: ν and b′(0).
        unit: of ξ, so that ξ = unit · z.
        bases: what functions of z may be made of.
        states, rates: of a chain, shapes (n,) and (n, n); None of other noise.
        is_white: whether the noise is white, L = F₀ + ½ F₁².
    """

    h: tuple[Balls, Balls]
    q: tuple[Balls, Balls]
    kappa: arb
    nu: arb
    slope: arb
    unit: arb
    bases: tuple[BasisKind, ...]
    states: Balls | None = None
    rates: Balls | None = None
    is_white: bool = False

    @property
    def is_bounded(self) -> bool:
        """Whether b = b′(0) z/(1 − z²), |z| < 1."""
        return "whole" in self.bases

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
    inert = {f"{section}.{name}" for section, half in problem.sections.items() for name in half.inert}
    return {key: value for key, value in problem.values.items() if key not in inert}


def statement_of(problem: Problem, stated: Parameters | None = None) -> Statement:
    """A problem by its decimals, else by its matrices and rates as floats.

    Those of a derived class are not told by its parameters, as it may make something else of them.

    Args:
        stated: its parameters as decimals; None for the shortest that are read as its numbers.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
        TypeError: no proof is known for such a system with such a noise.
        ValueError: the speed of the phase at the ray of a jump has no one sign.
    """
    checked_problem(problem)
    if stated is None:
        stated = {key: str(value) for key, value in linear_values(problem).items()}
    system, noise = problem.system, problem.noise
    if system.stop is not None:
        raise TypeError("got a wall of more than two variables, where moments obey no closed equations; remove it")
    if problem.dimension > 2:
        return Statement(stated, linear=LinearRecord.of(problem))
    if len(noise.parts) > 1:
        raise TypeError(f"got the noises {' and '.join(noise.parts)} at once; proofs are for one noise")
    is_told = is_ours(system) and system.exact_motion(_named(system, stated)) is not None
    is_law_told = is_ours(noise) and noise.exact_law(_named(noise, stated)) is not None
    motion, chain = None if is_told else MotionRecord.of(system), None if is_law_told else ChainRecord.of(noise)
    found = Statement(stated, motion, chain)
    exact_halves(found)
    return found


def exact_halves(stated: Statement) -> tuple[ExactMotion, ExactLaw, list[int]]:
    """What is stated, in exact numbers and in the sense of Stratonovich, with σ of each jump.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
        ValueError: these are no parameters of a system and a noise for which a proof is known, or out of range; or the
            speed of the phase at the ray of a jump has no one sign.
    """
    parameters = _plain(stated.parameters)
    system, noise = _kinds(parameters)
    expected = set[str]()
    for half, record in ((system, stated.motion), (noise, stated.chain)):
        section = System.section if half is system else Noise.section
        labels, told = ({key for key in parameters if _section(key) == each} for each in (section, half.section))
        if record is not None and told and told == _keys(half):
            names = ", ".join(sorted(told))
            raise ValueError(f"parameters {names} tell a {half.__name__}, but another {section} is stated; rename one")
        expected |= _keys(half) if record is None else labels
    if set(parameters) != expected:
        raise ValueError(f"parameters must be {', '.join(sorted(expected))}")
    motion = _exact_motion(system, parameters) if stated.motion is None else stated.motion.exact
    law = _exact_law(noise, parameters) if stated.chain is None else stated.chain.exact
    motion = law.in_stratonovich(motion)
    directions = [law.passing(*motion.speeds(jump)) for jump in motion.jumps]
    for jump, direction in zip(motion.jumps, directions, strict=True):
        if not direction:
            ray = ", ".join(f"{float(each):g}" for each in jump.ray)
            raise ValueError(
                f"got a jump at the ray of ({ray}), where the speed of the phase has no one sign; proofs are for jumps "
                "at rays over which no noise moves the phase"
            )
    return motion, law, directions


def _exact_motion(system: type[System], stated: Parameters) -> ExactMotion:
    named = _checked(system, stated)
    motion = system.exact_motion(named)
    if motion is None:
        raise ValueError(f"no proof is known for {system.__name__} by its parameters")
    return motion


def _exact_law(noise: type[Noise], stated: Parameters) -> ExactLaw:
    for name, word in noise.words.items():
        found = stated[f"{noise.section}.{name}"]
        if found != word:
            words = [each.words[name] for each in kind_classes("noises") if _keys(each) == _keys(noise)]
            raise ValueError(f"got {noise.section}.{name} = {found[:40]!r}; must be {' or '.join(map(repr, words))}")
    law = noise.exact_law(_checked(noise, stated))
    if law is None:
        raise ValueError(f"no proof is known for {noise.__name__} by its parameters")
    return law


def _checked(half: type[Parametrised], stated: Parameters) -> Parameters:
    """What is stated for a system or a noise, if its numbers are in range."""
    named = _named(half, stated)
    decimals = {name: text for name, text in named.items() if name not in half.words}
    numbers = [name for name in decimals if half.fields()[name].annotation is float]
    half(**decimals | {name: float(check_decimal(decimals[name])) for name in numbers})
    return named


def check_decimal(text: str) -> str:
    """The text, if it is a decimal number. Raises `ValueError`."""
    if not DECIMAL.fullmatch(text):
        raise ValueError(f"got {text[:40]!r}; must be a decimal number such as '0.95'")
    return text


def inert_keys(stated: Parameters) -> set[str]:
    """The keys of other parameters of such a system and such a noise, on which no exponent depends."""
    with suppress(ValueError):  # of several noises, none of which has such keys
        return {f"{half.section}.{name}" for half in _kinds(_plain(stated)) for name in half.inert}
    return set()


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


def _section(key: str) -> str:
    return key.partition(".")[0]


def _named(half: Parametrised | type[Parametrised], stated: Parameters) -> Mapping[str, str]:
    """What is stated for a system or a noise, by names without their section."""
    return {key.rpartition(".")[2]: text for key, text in stated.items() if _section(key) == half.section}


def _plain(stated: Parameters) -> Parameters:
    """The same without the name of a noise, as of "noise.axial.alpha". Raises `ValueError` where there are two."""
    found = {f"{_section(key)}.{key.rpartition('.')[2]}": text for key, text in stated.items()}
    if len(found) < len(stated):
        raise ValueError(f"parameters {', '.join(sorted(stated))} are of several noises")
    return found


def cylinder(stated: Statement) -> Cylinder:
    """L(p) for a statement.

    Raises:
        NoSuchExponent: no bound can be proven for these parameters.
    """
    motion, law, directions = exact_halves(stated)
    unit, kappa = ball(law.squared_unit).sqrt(), ball(0)
    for jump, direction in zip(motion.jumps, directions, strict=True):
        kappa += direction * (ball(jump.log_factor) + ball(jump.factor).log()) / kappa.pi()
    still, driven = _polar(each(ball, motion.still)), _polar(each(ball, motion.driven) * unit)
    return Cylinder(
        h=(still[0], driven[0]),
        q=(still[1], driven[1]),
        kappa=kappa,
        nu=ball(law.nu),
        slope=ball(law.slope),
        unit=unit,
        bases=law.bases,
        states=None if law.states is None else each(ball, law.states),
        is_white=bool(law.white),
        rates=None if law.rates is None else each(ball, law.rates),
    )


def _polar(a: Balls) -> tuple[Balls, Balls]:
    """h and q of a matrix of real balls."""
    (first, second), (third, fourth) = a / 2
    turning = _wave(second - third, -second - third, fourth - first)
    return turning, _wave(first + fourth, first - fourth, -second - third)
