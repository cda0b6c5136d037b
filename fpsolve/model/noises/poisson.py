"""Impulses at the times of a Poisson process, each of which multiplies the state."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noises.steps import ChainStep
from fpsolve.model.noises.white import Memoryless
from fpsolve.model.parameters import SIZE, parameter
from fpsolve.model.plane import (
    Impulse,
    LinearMotion,
    ParameterDerivative,
)


def _sizes(sizes: tuple[float, ...]) -> tuple[float, ...]:
    if not sizes or not any(sizes):
        raise ValueError("one size at least must differ from 0")
    return sizes


def _weights(weights: tuple[float, ...]) -> tuple[float, ...]:
    if any(each < 0 for each in weights) or (weights and not sum(weights) > 0):
        raise ValueError("weights must be >= 0, and one of them > 0")
    return weights


@strict_dataclass
class Poisson(Memoryless):
    """Impulses ξ = Σ w_j δ(t − t_j), t_j a Poisson process, w_j independent: x of ẋ = (A₀ + ξA₁)x jumps by exp(w_j A₁).

    That is the limit of short pulses with the area w_j, whatever their form (S. I. Marcus, IEEE Trans. Inf. Theory 24,
    1978). The spectral density is rate ⟨w²⟩ at all frequencies, the mean rate ⟨w⟩.

    >>> Poisson(rate=2.0, sizes=(-0.5, 0.5)).spectral_density(1.0)
    0.5

    Args:
        rate: impulses in a unit of time, 1e-15 to 1e15.
        sizes: the w that an impulse may have, in the unit of ξ times time.
        weights: how likely each size is, ≥ 0, as shares of their sum; all alike if none are given.

    Raises:
        ParameterError: a number is out of its range, or there are not as many weights as sizes.
    """

    rate: Annotated[float, parameter("impulses in a unit of time", "rate = 1.0", r"$\nu$", "1/time", **SIZE)]
    sizes: Annotated[
        tuple[float, ...],
        parameter("sizes of the impulses", "sizes = [-1.0, 1.0]", "$w$", "1", strict=False),
        AfterValidator(_sizes),
    ]
    weights: Annotated[
        tuple[float, ...],
        parameter(
            "probabilities of the sizes up to a factor; all equal if omitted", "weights = [0.5, 0.5]", strict=False
        ),
        AfterValidator(_weights),
    ] = ()

    kind: ClassVar[str] = "poisson"

    def __post_init__(self) -> None:
        if self.weights and len(self.weights) != len(self.sizes):
            raise ValueError(f"got {len(self.weights)} weights for {len(self.sizes)} sizes; must be as many")

    @property
    def sense(self) -> str:
        return "Marcus's"

    @property
    def shares(self) -> FloatArray:
        """How likely each size is, shape (n,)."""
        weights = np.array(self.weights or np.ones(len(self.sizes)), dtype=float)
        return np.asarray(weights / weights.sum())

    @property
    def relaxation_time(self) -> float:
        """The mean time between impulses: some of them have to pass until the motion has forgotten its start."""
        return 1 / self.rate

    def spectral_density(self, omega: float) -> float:
        """S(ω) = rate ⟨w²⟩, of what differs from the mean."""
        return self.rate * float(self.shares @ np.square(self.sizes))

    def step(self, h: float, bias: float = 0.0) -> ChainStep:
        """The impulses in any time, without a bias, as jumps of a chain whose state is the size of the last one.

        √S is in the matrix that the noise drives.
        """
        sizes = np.array(self.sizes) / math.sqrt(self.spectral_density(0.0))
        reached = np.tile(np.append(np.cumsum(self.shares)[:-1], 1.0), (sizes.size, 1))
        return ChainStep(np.full(sizes.size, self.rate), reached, np.zeros(sizes.size), sizes)

    def motion(self, system: LinearMotion, name: str | None = None) -> LinearMotion:
        """The motion between impulses, and one impulse for each size, in their order, by which the simulation draws.

        Raises:
            ValueError: a coefficient is no a + bξ, or impulses multiply the state by more than numbers hold.
        """
        terms, driven = system.split_by_noise(system.terms, name)
        if float(np.max(np.abs(np.linalg.eigvals(driven)))) * max(map(abs, self.sizes)) > LARGEST:
            raise ValueError(f"an impulse multiplies the state by up to e^{LARGEST:g} or more; use smaller sizes")
        impulses = [*system.impulses]
        if driven.any():
            shares = zip(self.sizes, self.shares.tolist(), strict=True)
            impulses += [Impulse(self.rate * share, size * driven) for size, share in shares]
        return LinearMotion(terms, system.jumps, system.epsilon, diffusions=system.diffusions, impulses=impulses)

    def changed_motion(
        self, system: LinearMotion, changed: ParameterDerivative, by: str = "", name: str | None = None
    ) -> ParameterDerivative:
        drift, change = system.split_by_noise(changed.terms, name)
        by_rate, known = 1.0 / self.rate if by == "rate" else 0.0, self.motion(system, name).impulses
        impulses = [  # none of what is not driven
            Impulse(by_rate * each.rate, size * change) for each, size in zip(known, self.sizes, strict=False)
        ]
        return replace(changed, terms=tuple(drift), impulses=(*changed.impulses, *impulses))


LARGEST = 100.0
"""ln of what an impulse may multiply the state by."""
