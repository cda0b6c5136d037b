"""The angle θ = νt + θ₀ that periodic coefficients are functions of: exact Floquet theory beside noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import Coefficient, FloatArray, identity
from fpsolve.model.expressions import TIME
from fpsolve.model.noise import Noise
from fpsolve.model.noises.bounded import NoiseOfAngle
from fpsolve.model.noises.several import Noises
from fpsolve.model.plane import Function, LinearMotion


@dataclass(frozen=True)
class Wave:
    """cos kθ, or sin kθ.

    Attributes:
        name: "cos" or "sin".
        multiple: k.
    """

    name: str
    multiple: int

    def __call__(self, theta: ArrayLike) -> FloatArray:
        return np.asarray((np.cos if self.name == "cos" else np.sin)(self.multiple * np.asarray(theta)))

    @property
    def __name__(self) -> str:
        return f"{self.name} {self.multiple}"

    def at(self, nu: float) -> str:
        """It as text, of the time."""
        return f"{self.name}({self.multiple * nu:.10g}t)"


@dataclass(frozen=True)
class Clock(NoiseOfAngle):
    """θ itself as a noise, θ₀ uniform, which a system with periodic coefficients brings along.

    Attributes:
        nu: ν, of which all frequencies are multiples.
        harmonics: the largest of these multiples.
    """

    nu: float = field(repr=False)
    harmonics: int = field(repr=False)

    kind: ClassVar[str] = "clock"
    sigma: ClassVar[float] = 0.0
    amplitude: ClassVar[float] = 1.0
    half_width: ClassVar[float] = math.pi

    def of_angle(self, theta: FloatArray) -> FloatArray:
        return np.asarray(theta, dtype=float)

    def mean_of(self, g: Coefficient) -> float:
        """0, that of all waves."""
        return 0.0


@dataclass(frozen=True)
class ClockWave(NoiseOfAngle):
    """A wave of a clock whose θ₀ is 0, for paths: of several the phases belong together."""

    clock: Clock
    wave: Wave

    kind: ClassVar[str] = "wave"
    sigma: ClassVar[float] = 0.0
    amplitude: ClassVar[float] = 1.0

    @property
    def nu(self) -> float:
        return self.wave.multiple * self.clock.nu

    @property
    def period(self) -> float:
        """That of the clock."""
        return self.clock.period

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        theta = np.full(size, 0.0 if self.wave.name == "cos" else -0.5 * math.pi)
        return np.array([self.of_angle(theta), theta])


class _ManyNoises(Noises):
    """Noises of paths, as many as there are."""

    def __post_init__(self) -> None:
        pass


def waves_apart(system: LinearMotion, noise: Noise) -> tuple[LinearMotion, Noise]:
    """A system with a clock, and all noises, with each wave as a noise that drives terms of its own."""
    noises, terms = {name: each for name, each in noise.parts.items() if name != TIME}, list(system.terms)
    for k, term in enumerate(terms):
        if term.noise == TIME and isinstance(term.g, Function) and isinstance(wave := term.g.f, Wave):
            noises[wave.__name__] = ClockWave(system.clock, wave)
            terms[k] = replace(term, g=identity, noise=wave.__name__)
    return replace(system, terms=tuple(terms)), _ManyNoises(tuple(noises.items()))
