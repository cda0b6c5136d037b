"""Noise that jumps between states."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo
from scipy.sparse.csgraph import connected_components

from fpsolve.arrays import ROUNDED, FloatArray, real_array, real_number, shown
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.model.noises.steps import ChainStep
from fpsolve.model.parameters import SIZE, stated_field
from fpsolve.model.plane import rows_of
from fpsolve.model.quantity import Quantity

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

    Its parameters are the states, such as state_1, and the rates > 0, such as rate_1_2 from state 1 to state 2.

    >>> MarkovChain((-0.5, 0.5), ((-1.0, 1.0), (1.0, -1.0))).correlation_time
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

    @cached_property
    def _table(self) -> FloatArray:
        """The states as a column, and right of it the rates."""
        return np.column_stack([self.states, self.rates])

    @cached_property
    def values(self) -> Mapping[str, float | str]:
        entries = np.ndenumerate(self._table.tolist())
        return {f"rate_{i + 1}_{j}" if j else f"state_{i + 1}": each for (i, j), each in entries if not j or each > 0}

    @property
    def of_xi(self) -> Mapping[str, str]:
        return {name: "{}" for name in self.values if name.startswith("state")}

    def quantity_of(self, name: str) -> Quantity:
        key, (_, *at) = f"{self.section}.{name}", name.split("_")
        words, sign = ("rate from state {} to state {}", "q") if at[1:] else ("state {} of the noise", r"\xi")
        return Quantity(key, key, words.format(*at), f"${sign}_{{{','.join(at)}}}$", "1/time")

    def _with(self, values: Mapping[str, float | str]) -> MarkovChain:
        table = self._table.copy()
        for name, value in values.items():
            table[_place(name)] = real_number(value, name)
        np.fill_diagonal(table[:, 1:], 0.0)  # which follows
        return MarkovChain(table[:, 0].tolist(), table[:, 1:].tolist())

    def derivative(self, name: str) -> NoiseDerivative:
        unit = np.zeros_like(self._table)
        unit[_place(name)] = 1.0
        states, jumps = unit[:, 0], unit[:, 1:]
        return NoiseDerivative(states=tuple(states.tolist()), rates=rows_of(jumps - np.diag(jumps.sum(axis=1))))


def _place(name: str) -> tuple[int, int]:
    """Where a parameter is in the table: state_1 at (0, 0), rate_1_2 at (0, 2)."""
    i, j = [*map(int, name.split("_")[1:]), 0][:2]
    return i - 1, j
