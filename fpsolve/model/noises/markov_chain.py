"""Noise that jumps between states."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo
from scipy.sparse.csgraph import connected_components

from fpsolve.arrays import ROUNDED, FloatArray, real_array, real_number, shown
from fpsolve.model.noise import Noise
from fpsolve.model.noises.steps import ChainStep
from fpsolve.model.parameters import SIZE, stated_field
from fpsolve.model.plane import rows_of

Row = Annotated[tuple[float, ...], Field(strict=False)]


class Chain(Noise):
    """ξ(t) with values among some states, from one of which to another it jumps at given rates, whatever states them.

    Attributes:
        states: the values of ξ, shape (n,).
        rates: Q, shape (n, n), from state to state; the sum of every row is 0.
    """

    has_states: ClassVar[bool] = True
    left_in_phase: ClassVar[float] = 1.0
    may_tilt: ClassVar[bool] = False

    if TYPE_CHECKING:  # a field or a property

        @property
        @abstractmethod
        def states(self) -> Sequence[float]: ...
        @property
        @abstractmethod
        def rates(self) -> Sequence[Sequence[float]]: ...

    @property
    def probabilities(self) -> FloatArray:
        """π, the stationary probabilities: πQ = 0, shape (n,)."""
        equations = np.array(self.rates).T
        equations[-1] = 1.0  # in place of one that follows from the others
        return np.linalg.solve(equations, np.eye(len(equations))[-1])

    @property
    def mean(self) -> float:
        return float(self.probabilities @ self.states)

    @property
    def reached(self) -> FloatArray:
        return np.array(self.states)

    def misfit(self, xi: float) -> str:
        is_state = np.any(np.isclose(self.states, xi, rtol=1e-9, atol=0))
        return "" if is_state else f"; must be one of the states, {', '.join(f'{each:g}' for each in self.states)}"

    extremes = reached

    @property
    def standard_deviation(self) -> float:
        return math.sqrt(self.probabilities @ (np.array(self.states) - self.mean) ** 2)

    @property
    def correlation_time(self) -> float:
        """∫ C(t) dt/C(0) over t > 0."""
        return 0.5 * self.spectral_density(0.0) / self.standard_deviation**2

    def spectral_density(self, omega: float) -> float:
        """S(ω) = 2 Re π(ξ − ⟨ξ⟩)ᵀ (iω − Q + 1π)⁻¹ (ξ − ⟨ξ⟩), from C(t) = π(ξ − ⟨ξ⟩)ᵀ exp(Qt) (ξ − ⟨ξ⟩)."""
        weights, deviations = self.probabilities, np.array(self.states) - self.mean
        resolvent = (
            1j * omega * np.eye(deviations.size) - np.array(self.rates) + np.outer(np.ones_like(weights), weights)
        )
        return float(2 * np.real((weights * deviations) @ np.linalg.solve(resolvent, deviations)))

    @property
    def relaxation_time(self) -> float:
        """The time in which the chain forgets its state: −1/Re of the second eigenvalue of Q."""
        return -1 / float(np.sort(np.linalg.eigvals(np.array(self.rates)).real)[-2])

    def start(self, size: int, rng: np.random.Generator) -> FloatArray:
        return rng.choice(len(self.states), size, p=self.probabilities).astype(float)

    def step(self, h: float, bias: float = 0.0) -> tuple[object, ...]:
        """The jumps in any time, without a bias."""
        leaving = -np.diagonal(self.rates)
        reached = np.cumsum(np.maximum(self.rates, 0.0) / leaving[:, None], axis=1)
        reached = np.where(reached >= reached[:, -1:], 1.0, reached)
        return ChainStep(leaving, reached, np.array(self.states, dtype=float), np.zeros(leaving.size))

    @property
    def largest_step(self) -> float:
        """∞: no step is made."""
        return math.inf


@dataclass(frozen=True)
class MarkovChain(Chain):
    """ξ(t) jumps between given values, the states, at given rates.

    >>> MarkovChain.telegraph(amplitude=0.5, rate=1.0).correlation_time  # ξ = ±0.5, each state left at rate 1
    0.5

    Args:
        states: the values of ξ, shape (n,), n ≥ 2.
        rates: Q, shape (n, n): rates[i][j] ≥ 0 from state i to state j; the diagonal is minus the sum of its row, or 0,
            which then stands for it.

    Raises:
        ValueError: the shapes or signs are not as stated, all states have one value, or some state cannot be reached
            from another one.
    """

    states: Sequence[float]
    rates: Sequence[Sequence[float]]

    kind: ClassVar[str] = "markov-chain"
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "states": stated_field(Row, "the values of the noise", "states = [-0.5, 0.5]"),
        "rates": stated_field(
            Annotated[tuple[Row, ...], Field(strict=False)],
            "rates from each state to each",
            "rates = [[-1.0, 1.0], [1.0, -1.0]]",
        ),
    }

    def __post_init__(self) -> None:
        states, rates = np.zeros(2), np.zeros((2, 2))  # of one value, where what is given are no numbers
        with suppress(ValueError):
            states, rates = real_array(self.states, "states"), real_array(self.rates, "rates")
        if states.ndim != 1 or states.size < 2 or rates.shape != 2 * states.shape:
            raise ValueError(f"got {states.shape} states and {rates.shape} rates; must be (n,) and (n, n), n >= 2")
        if np.ptp(states) == 0:
            told = f"got the states {shown(self.states)} and rates {shown(self.rates)}"
            raise ValueError(f"{told}; must be finite numbers that differ, with finite rates")
        for name, each in (("states", states), ("rates", rates)):
            size = np.abs(each).max()
            if not SIZE["ge"] <= size <= SIZE["le"]:
                raise ValueError(f"got {name} of sizes up to {size:g}; must be from {SIZE['ge']:g} to {SIZE['le']:g}")
        jumps = rates - np.diag(np.diagonal(rates))
        leaving = jumps.sum(axis=1)
        stated = -np.diagonal(rates)
        if np.any(jumps < 0) or np.any((stated != 0) & (np.abs(stated - leaving) > ROUNDED * leaving.max())):
            raise ValueError(
                "rates from one state to another must be >= 0, and each diagonal entry 0 or minus the sum of its row"
            )
        if connected_components(jumps > 0, connection="strong")[0] > 1:
            raise ValueError("every state must be reachable from every other one; leave out those that are not")
        object.__setattr__(self, "states", tuple(states.tolist()))
        object.__setattr__(self, "rates", rows_of(jumps - np.diag(leaving)))

    @classmethod
    def telegraph(cls, amplitude: float, rate: float) -> MarkovChain:
        """ξ = ±amplitude, each state left at this rate."""
        size, rate = real_number(amplitude, "amplitude"), real_number(rate, "rate")
        return cls((-size, size), ((-rate, rate), (rate, -rate)))
