"""White noise: no state of its own, but diffusion of what it drives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Annotated, ClassVar

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noise import STAY
from fpsolve.model.noises.markov_chain import Chain
from fpsolve.model.noises.steps import WhiteStep
from fpsolve.model.parameters import SIZE, parameter
from fpsolve.model.plane import (
    CoefficientMatrix,
    LinearMotion,
    ParameterDerivative,
    is_driven,
)


class Interpretation(StrEnum):
    """The meaning of ξ dt = s dW where it multiplies the state.

    STRATONOVICH: the limit of noise that remembers its value for ever shorter times.
    ITO: the limit of independent kicks; ½ Σ A² less in the drift, A the matrix that s dW multiplies.
    """

    STRATONOVICH = "stratonovich"
    ITO = "ito"


class Memoryless(Chain):
    """Noise that has no value, see `is_white`: to solvers a chain that rests in its only state, ξ = 0."""

    is_white: ClassVar[bool] = True
    states: ClassVar[Sequence[float]] = (0.0,)
    rates: ClassVar[Sequence[Sequence[float]]] = ((0.0,),)

    @property
    def standard_deviation(self) -> float:
        return math.inf

    @property
    def correlation_time(self) -> float:
        return 0.0

    relaxation_time = correlation_time

    def misfit(self, xi: float) -> str:
        return f", but white noise has no value at a time; {STAY}"

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        """0: it has no value."""
        return np.zeros(size)


@strict_dataclass
class White(Memoryless):
    """White noise ξ dt = s dW, of the spectral density S = s² at all frequencies.

    A system ẋ = (A₀ + ξ A₁) x is dx = A₀x dt + s A₁x ∘ dW, or in Itô's sense with s A₁x dW, which is the former with
    A₀ − ½s²A₁² in place of A₀.

    >>> White(s=0.5).spectral_density(0.0)
    0.25

    Args:
        s: 1e-15 to 1e15, in the unit of ξ times time^(1/2).
        interpretation: one of `Interpretation`, or its name.

    Raises:
        ParameterError: s is not a finite number in its range.
    """

    s: Annotated[
        float,
        parameter("intensity of white noise; S = s² at all frequencies", "s = 0.5", "$s$", "1/time^(1/2)", **SIZE),
    ]
    interpretation: Annotated[
        Interpretation, parameter("sense of the stochastic integral", 'interpretation = "stratonovich"', strict=False)
    ] = Interpretation.STRATONOVICH

    kind: ClassVar[str] = "white"
    of_xi: ClassVar[Mapping[str, str]] = {"s": "{}time^(1/2)"}

    @property
    def sense(self) -> str:
        return "Itô's" if self.interpretation == Interpretation.ITO else "Stratonovich's"

    def spectral_density(self, omega: float) -> float:
        """S(ω) = s²."""
        return self.s**2

    def step(self, h: float, bias: float = 0.0) -> WhiteStep:
        """One step of dW, without a bias; s is in the matrix that the noise drives."""
        return WhiteStep(1 / math.sqrt(h), math.sqrt(3 / h))

    def motion(self, system: LinearMotion, name: str | None = None) -> LinearMotion:
        """The drift in the sense of Stratonovich, and s A of the term that the noise drives, as one matrix.

        Raises:
            ValueError: a coefficient is no a + bξ.
        """
        drift, driven = system.split_by_noise(system.terms, name)
        orders = [term.order for term in system.terms if is_driven(term.g) and name in (None, term.noise)]
        diffusions = [_term(system, self.s * driven, min(orders))] if driven.any() else []
        if self.interpretation == Interpretation.ITO and diffusions:
            drift.append(_term(system, -0.5 * self.s**2 * driven @ driven, 2 * min(orders)))
        diffusions = [*system.diffusions, *diffusions]
        return LinearMotion(drift, system.jumps, system.epsilon, diffusions=diffusions, impulses=system.impulses)

    def changed_motion(
        self, system: LinearMotion, changed: ParameterDerivative, by: str = "", name: str | None = None
    ) -> ParameterDerivative:
        _, driven = system.split_by_noise(system.terms, name)
        drift, change = system.split_by_noise(changed.terms, name)
        by_s = 1.0 if by == "s" else 0.0
        if self.interpretation == Interpretation.ITO:
            square = change @ driven + driven @ change
            drift.append(_term(system, -0.5 * self.s**2 * square - by_s * self.s * driven @ driven, 0))
        moved = (_term(system, by_s * driven + self.s * change, 0),) if driven.any() else ()
        return replace(changed, terms=tuple(drift), diffusions=changed.diffusions + moved)


def _term(system: LinearMotion, matrix: FloatArray, order: int) -> CoefficientMatrix:
    return CoefficientMatrix(order, matrix / system.epsilon**order)
