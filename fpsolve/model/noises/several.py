"""Several independent noises at once, each driving terms of its own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, shown
from fpsolve.model.noise import STAY, Noise
from fpsolve.model.plane import LinearMotion, ParameterDerivative, System, Xi

MOST_WITH_AXES = 2
"""Noises that have values at most: each of them is a dimension more."""


@dataclass(frozen=True)
class Noises(Noise):
    """Several independent noises, by the names that the terms of a system give them, see `CoefficientMatrix`.

    >>> from fpsolve import OrnsteinUhlenbeck
    >>> from fpsolve.model.noises.white import White
    >>> noises = Noises({"axial": OrnsteinUhlenbeck(alpha=1.0, sigma=0.3), "lateral": White(s=0.2)})
    >>> noises.valued.kind
    'ornstein-uhlenbeck'

    A function of the noises has one variable for each noise that has a value; white noise and impulses have none.

    Args:
        named: two or more noises, as a mapping from their names or as pairs (name, noise).

    Raises:
        TypeError: one of them is not a `Noise`, or consists of several noises itself.
        ValueError: there are fewer than two names, more than two of the noises are neither white nor impulses, or one
            has algebraic tails.
    """

    named: tuple[tuple[str, Noise], ...]

    may_tilt: ClassVar[bool] = False

    def __post_init__(self) -> None:
        given = self.named.items() if isinstance(self.named, Mapping) else self.named
        pairs = tuple((name, noise) for name, noise in given)
        object.__setattr__(self, "named", pairs)
        for name, noise in pairs:
            if not (isinstance(name, str) and isinstance(noise, Noise) and len(noise.parts) == 1):
                raise TypeError(f"got {shown(noise)} as the noise {shown(name)}; must be one noise with a name")
            if noise.has_algebraic_tails:
                raise ValueError(
                    f"the noise {name} has algebraic tails, and such noise must be the only noise; choose r0 <= 1, or "
                    "use this noise without others"
                )
        if len(dict(pairs)) < 2:
            raise ValueError(f"got {len(pairs)} noises; must be two or more with names that differ")
        valued = [name for name, noise in pairs if not noise.is_white]
        if len(valued) > MOST_WITH_AXES:
            raise ValueError(
                f"got the noises {', '.join(valued)}; at most {MOST_WITH_AXES} noises may be other than white "
                "and Poisson noise; make the others white, or leave them out"
            )

    @cached_property
    def parts(self) -> Mapping[str, Noise]:
        """The noises by their names."""
        return dict(self.named)

    @cached_property
    def valued(self) -> Noise:
        """The noise, or the noises, that have values; if all are white, the first of them, with the value 0."""
        valued = {name: noise for name, noise in self.named if not noise.is_white} or dict(self.named[:1])
        return self if len(valued) == len(self.named) else noises_of(valued)

    def combined(self, values: Sequence[ArrayLike]) -> Xi:
        return dict(zip(self.parts, np.meshgrid(*values, indexing="ij", sparse=True), strict=True))

    @property
    def extremes(self) -> Xi:
        return self.combined([np.asarray(noise.extremes) for noise in self.parts.values()])

    @property
    def _valued(self) -> Iterable[Noise]:
        return self.valued.parts.values()

    @property
    def is_white(self) -> bool:
        """Whether all of the noises are white noise or impulses."""
        return all(noise.is_white for _, noise in self.named)

    @property
    def has_states(self) -> bool:
        """Whether all `valued` noises jump between states."""
        return all(noise.has_states for noise in self._valued)

    @property
    def is_diffusion(self) -> bool:
        """Whether only one noise has values, and is a diffusion by itself."""
        return self.valued is not self and self.valued.is_diffusion

    @property
    def is_random(self) -> bool:
        return any(noise.is_random for _, noise in self.named)

    @property
    def approximates_spectrum(self) -> bool:
        """Whether the `spectral_density` of one of the noises is that of a simpler process which replaces it."""
        return any(noise.approximates_spectrum for _, noise in self.named)

    @property
    def variables(self) -> int:
        return sum(noise.variables for noise in self._valued)

    def misfit(self, xi: float) -> str:
        return f", but several noises have values; {STAY}"

    @property
    def standard_deviation(self) -> float:
        """The largest standard deviation of the `valued` noises."""
        return max(noise.standard_deviation for noise in self._valued)

    @property
    def correlation_time(self) -> float:
        """The longest correlation time of the noises."""
        return max(noise.correlation_time for _, noise in self.named)

    def spectral_density(self, omega: float) -> float:
        """Raises `NotImplementedError`, as each noise has its own spectral density, see `parts`."""
        raise NotImplementedError("several noises have a spectral density each, see `parts`")

    @property
    def is_bounded(self) -> bool:
        return all(noise.is_bounded for noise in self._valued)

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """The initial values of all noises, one below the other, shape (rows, size)."""
        return np.vstack([noise.start(size, rng) for _, noise in self.named])

    @property
    def is_simulated(self) -> bool:
        return all(noise.is_simulated for _, noise in self.named)

    @property
    def largest_step(self) -> float:
        return min(noise.largest_step for _, noise in self.named)

    def motion(self, system: LinearMotion, name: str | None = None) -> LinearMotion:
        """The motion besides the white noises, and what all white noises add, each in its own `sense`."""
        for own, noise in self._white:
            system = noise.motion(system, own)
        return system

    def driving(self, system: System) -> Noise:
        first = system.noise_sections[0].removeprefix("noise.")
        known = {name: noise for name, noise in self.named if name in system.linear().driven_by}
        return noises_of(known or {first: self.parts[first]})

    def changed_motion(
        self, system: LinearMotion, changed: ParameterDerivative, by: str = "", name: str | None = None
    ) -> ParameterDerivative:
        part, _, parameter = by.rpartition(".")
        for own, noise in self._white:
            changed = noise.changed_motion(system, changed, parameter if part == own else "", own)
        return changed

    @property
    def _white(self) -> list[tuple[str, Noise]]:
        """The white noises with their names."""
        return [(name, noise) for name, noise in self.named if noise.is_white]


def noises_of(named: Mapping[str, Noise]) -> Noise:
    """A noise of a mapping from names: `Noises`, or the only one. Raises as `Noises`."""
    return next(iter(named.values())) if len(named) == 1 else Noises(tuple(named.items()))
