"""What is solved: a motion and the noise that drives it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from fpsolve.arrays import shown
from fpsolve.messages import Message
from fpsolve.model.expressions import TIME
from fpsolve.model.noise import Noise
from fpsolve.model.noises.several import noises_of
from fpsolve.model.parameters import DERIVED, Parameter, Parametrised, Words
from fpsolve.model.plane import LinearMotion, System, is_driven
from fpsolve.model.plane import ParameterDerivative as ParameterDerivative
from fpsolve.model.quantity import NOISE, Quantity


@dataclass(frozen=True)
class Problem:
    """A system and the noise that drives it; its parameters have keys such as "noise.D0".

    >>> oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-0.8, epsilon=0.1)
    >>> problem = Problem(oscillator, OrnsteinUhlenbeck(alpha=2.0, sigma=1.0))
    >>> problem.at({"noise.sigma": 2.0}).values["noise.sigma"]
    2.0

    Attributes:
        system: `VibroImpactOscillator`, or a `PlaneSystem`.
        noise: `OrnsteinUhlenbeck`, or `NonGaussianNoise` for Eq. (7) as it stands, or a `MarkovChain`; several noises
            as a mapping from the names that the terms have, or `Noises`.

    Raises:
        TypeError: one of them is something else.
        ValueError: white noise would drive the system in a way that has no meaning, see `White.motion`. Or the terms
            name other noises. Or a noise, or nothing, moves the phase over the ray of a jump. Or nothing is random, as
            under a harmonic load alone.
    """

    system: System
    noise: Noise

    def __post_init__(self) -> None:
        if isinstance(self.noise, Mapping):
            object.__setattr__(self, "noise", noises_of(self.noise))
        for half, kind, needed in ((self.system, "motion", System), (self.noise, "noise", Noise)):
            if not isinstance(half, needed):
                raise TypeError(f"got {shown(half)} as a {kind}; must be a system and a noise: Problem(system, noise)")
        linear = self.linear
        if linear.clock:
            object.__setattr__(self, "noise", noises_of({**self.noise.parts, TIME: linear.clock}))
        # beyond, squares leave the range of numbers
        sizes = [("coefficient", float(np.abs(term.matrix).max()), 0.0) for term in linear.terms]
        for name, size, least in (*sizes, *(("delay", delay, DERIVED["ge"]) for _, delay in linear.pasts)):
            if not least <= size <= DERIVED["le"]:
                must = f"must be from {least:g} to {DERIVED['le']:g}; take another unit of time, or of a variable"
                raise ValueError(f"got a {name} of {size:g} in the motion; {must}")
        wanted, given = self.system.noise_sections, self.noise.parts
        if len(wanted) > 1 or len(given) > 1:
            names = linear.driven_by
            if {*names} != {*given}:
                told = f"the terms name the noises {', '.join(map(shown, sorted(names)))}"
                stated = ", ".join(map(shown, given)) if len(given) > 1 else "one without a name"
                remedy = 'give one for each name, such as Problem(system, {"axial": ..., "lateral": ...})'
                raise ValueError(f"{told}, but the noises given are {stated}; {remedy}")
        self.noise.motion(linear)  # refuses what has no meaning
        for wall in linear.barriers:
            wall.refuse(linear, self.noise)
        if not self.noise.is_random:
            raise ValueError(
                "only the start of this noise is random, as of a harmonic load, so that Λ(p) is p times the largest "
                "real part of the Floquet exponents: compute these from the equation over one period, or add a random "
                "noise"
            )

    def __getstate__(self) -> dict[str, Any]:
        """What it is made of; the rest follows again."""
        return {each.name: vars(self)[each.name] for each in fields(self)}

    @cached_property
    def linear(self) -> LinearMotion:
        """The linear system, which solvers ask."""
        return self.system.linear()

    @cached_property
    def valued(self) -> Noise:
        """The noise, or of several those that have values; where all are white, the first of them."""
        return self.noise.valued

    def named_noise(self, name: str) -> Noise:
        """The noise that terms name so; with one noise that one, whatever its name."""
        return self.noise.parts.get(name, self.noise)

    @cached_property
    def dimension(self) -> int:
        """The number of variables of the state, with those of the past that move it."""
        return self.linear.dimension

    @property
    def is_driven(self) -> bool:
        """Whether a noise moves the state; one of strength 0 does not, and Λ(p) is p times the growth rate."""
        return any(is_driven(term.g) and np.any(term.matrix) for term in self.linear.terms)

    @property
    def sections(self) -> Mapping[str, Parametrised]:
        """The system and the noise by what the keys of their parameters begin with, such as "noise.axial"."""
        first = self.system.noise_sections[0]
        noises = {f"noise.{name}" if name else first: noise for name, noise in self.noise.parts.items()}
        return {self.system.section: self.system, **noises}

    @cached_property
    def values(self) -> Mapping[str, float | str]:
        """The values of all parameters, numbers and words, by their keys; `at` gives a problem with others."""
        halves = self.sections.items()
        return MappingProxyType(
            {f"{section}.{name}": value for section, half in halves for name, value in half.values.items()}
        )

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """All parameters by their keys, with symbol, words, unit and range; no two have one symbol."""
        found = dict[str, Parameter]()
        for section, half in self.sections.items():
            for name, value in half.values.items():
                key = f"{section}.{name}"
                quantity = replace(half.quantity_of(name), name=key, symbol=key)
                if isinstance(half, Noise) and name in half.of_xi:
                    if unit := half.about.unit:
                        unit = half.of_xi[name].format("" if unit == "1" else f"{unit}*").rstrip("*") or "1"
                    elif self.system.noise_unit == NOISE.unit:
                        unit = quantity.unit
                    quantity = replace(quantity, unit=unit or "unknown")
                found[key] = Parameter(value, quantity, type(half))
        signs = Counter(each.quantity.shown.strip("$") for each in found.values())
        for key, each in found.items():
            if signs[each.quantity.shown.strip("$")] > 1 and not key.startswith(f"{self.system.section}."):
                found[key] = each._replace(quantity=_of_noise(each.quantity))
        return found

    @property
    def differentiable(self) -> list[str]:
        """The keys of the parameters by which Λ can be differentiated."""
        return [f"{section}.{name}" for section, half in self.sections.items() for name in half.differentiable]

    @property
    def undifferentiable(self) -> Mapping[str, float]:
        """The other numbers on which Λ depends, by their keys: the system has an infinite derivative by each."""
        inert = {f"{section}.{name}" for section, half in self.sections.items() for name in half.inert}
        left = inert.union(self.differentiable)
        return {key: value for key, value in self.values.items() if not isinstance(value, str) and key not in left}

    @property
    def remarks(self) -> list[Message]:
        """Limits of the meaning of its parameters: of the noise, then of the system."""
        return [remark for half in (*self.noise.parts.values(), self.system) for remark in half.remarks]

    def at(self, values: Mapping[str, float | str]) -> Problem:
        """The problem with other values of some parameters, by their keys. Raises `ValueError`."""
        if not isinstance(values, Mapping):
            raise TypeError(f'got {shown(values)}; must be values by their keys, such as {{"noise.D0": 2.0}}')
        known = self.sections
        new = dict[str, dict[str, float | str]]()
        for key, value in values.items():
            section, _, name = key.rpartition(".")
            if section not in known:
                raise ValueError(f"got {key}; the parameters are {', '.join(self.values)}")
            new.setdefault(section, {})[name] = value
        halves = {
            key: _at(half, tuple(new[key].items()), half.about) if key in new else half for key, half in known.items()
        }
        noises = dict(zip(self.noise.parts, [*halves.values()][1:], strict=True))
        return Problem(cast("System", halves[self.system.section]), noises_of(cast("dict[str, Noise]", noises)))

    def derivative(self, key: str) -> ParameterDerivative:
        """∂/∂θ by one of the `differentiable` parameters. Raises `ValueError` for others."""
        if key not in self.differentiable:
            raise ValueError(f"got {key}; the parameters to differentiate by are {', '.join(self.differentiable)}")
        section, _, name = key.rpartition(".")
        part = dict(zip(self.sections, ["", *self.noise.parts], strict=True))[section]
        changed, by = ParameterDerivative(), ""
        if section == self.system.section:
            changed = self.system.derivative(name)
            part = TIME if changed.noise else part
        else:
            by = ".".join(filter(None, (part, name)))
            if not (own := self.named_noise(part)).is_white:
                changed = replace(changed, noise=own.derivative(name))
        moved, axes = self.noise.changed_motion(self.linear, changed, by), [*self.valued.parts]
        return replace(moved, theta=float(self.values[key]), part=axes.index(part) if part in axes else 0)

    def derivatives(self) -> Mapping[str, ParameterDerivative]:
        """∂/∂θ by all of the `differentiable` parameters, by their keys."""
        return {key: self.derivative(key) for key in self.differentiable}

    @property
    def noise_quantity(self) -> Quantity:
        """ξ, as the noise states it, or else in the unit that the system decides."""
        return self.valued.about.of(replace(NOISE, unit=self.system.noise_unit))


@lru_cache(1024)  # sets of a sweep share the halves that are alike, and what these know
def _at(half: Parametrised, values: tuple[tuple[str, float | str], ...], about: Words) -> Parametrised:
    """A system or a noise with other values of some parameters."""
    return half.at(dict(values)).called(about)


def _of_noise(quantity: Quantity) -> Quantity:
    """A parameter of a noise whose symbol another parameter has: with the name of the noise below it."""
    name = quantity.name.split(".")[1:-1]
    below = rf"\mathrm{{{name[0]}}}".replace("_", r"\_") if name else r"\xi"
    sign = quantity.latex.strip("$") or rf"\mathrm{{{quantity.shown}}}".replace("_", r"\_")
    return replace(quantity, latex=f"${{{sign}}}_{{{below}}}$")


def checked_problem(problem: object) -> Problem:
    """The problem that is given. Raises `TypeError` for anything else, such as a system alone."""
    if isinstance(problem, Problem):
        return problem
    remedy = "must be a Problem, made of a system and a noise: Problem(system, noise)"
    raise TypeError(f"got problem = {shown(problem)}; {remedy}")
