"""The curves of a case: one parameter set for each combination of the varied values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

from fpsolve.case.sections import NoiseSection, Value, Varied, flat
from fpsolve.case.vary import RECORDS, assignments
from fpsolve.model.noise import Noise
from fpsolve.model.problem import Problem
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator


@dataclass(frozen=True)
class Curve:
    """One parameter set of a case.

    Attributes:
        oscillator, noise: what the solver takes.
        parameters: every parameter by its dotted key, such as "noise.D0".
        varied: those of them that [vary] names.
        number: its place among the curves of its case, from 1 on.
    """

    oscillator: VibroImpactOscillator
    noise: Noise
    parameters: Varied
    varied: Varied
    number: int = 1

    @property
    def problem(self) -> Problem:
        """What is solved."""
        return Problem(self.oscillator, self.noise)

    @property
    def key(self) -> tuple[tuple[str, Value], ...]:
        """What tells it from the other curves of its case."""
        return tuple(self.varied.items())

    @property
    def label(self) -> str:
        """The same for the eye: "noise.D0 = 0.1, noise.r0 = 0.9"."""
        return assignments(self.varied, "g")

    @property
    def suffix(self) -> str:
        """What the names of its files end in: nothing for the first curve, "-2" for the second."""
        return "" if self.number == 1 else f"-{self.number}"

    @property
    def is_exact(self) -> bool:
        """Whether the noise is Eq. (7) as it stands; perturbation theory then has its reduction only."""
        return self.parameters["noise.treatment"] == "exact"


def make_curve(oscillator: VibroImpactOscillator, noise: NoiseSection, varied: Varied, number: int = 1) -> Curve:
    """The curve on which some parameters are replaced, by their dotted keys."""
    parameters = {**_stated(oscillator, noise), **varied}
    return Curve(
        oscillator=_oscillator(*(parameters[key] for key in OSCILLATOR)),
        noise=_noise(*(parameters[key] for key in NOISE)).process(),
        parameters=parameters,
        varied=varied,
        number=number,
    )


OSCILLATOR, NOISE = (tuple(key for key in RECORDS if key.startswith(section)) for section in ("oscillator.", "noise."))
"""The dotted keys of either half of a problem, in the order of its fields."""


@lru_cache(maxsize=4)
def _stated(oscillator: VibroImpactOscillator, noise: NoiseSection) -> dict[str, Value]:
    """Every parameter of a case by its dotted key."""
    system = asdict(oscillator) | {"impact": oscillator.impact.value}
    stated: dict[str, Value] = flat({"oscillator": system, "noise": noise.model_dump()})
    return stated


@lru_cache(maxsize=1024)
def _oscillator(*values: Any) -> VibroImpactOscillator:
    """The oscillator with these parameters; curves that vary the noise alone share it."""
    return VibroImpactOscillator(**_named(OSCILLATOR, values))


@lru_cache(maxsize=1024)
def _noise(*values: Any) -> NoiseSection:
    """The noise with these parameters; curves that vary the oscillator alone share it."""
    return NoiseSection(**_named(NOISE, values))


def _named(keys: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    """Values by the names of their fields."""
    return {key.partition(".")[2]: value for key, value in zip(keys, values, strict=True)}
