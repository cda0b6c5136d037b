"""Telegraph noise: the chain of two states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.noise import NoiseDerivative
from fpsolve.model.noises.markov_chain import Chain
from fpsolve.model.parameters import SIZE, parameter
from fpsolve.model.plane import rows_of

FLIP = ((-1.0, 1.0), (1.0, -1.0))
"""Rates of telegraph noise, in units of k."""


@strict_dataclass
class Telegraph(Chain):
    """Telegraph noise ξ = ±a, each value left at the rate k: its correlation is a² exp(−2k|t|).

    >>> Telegraph(a=0.5, k=1.0).spectral_density(0.0)  # S(ω) = 4ka²/(4k² + ω²)
    0.25

    Args:
        a: 1e-15 to 1e15, in the unit of ξ.
        k: 1e-15 to 1e15, in 1/time.

    Raises:
        ParameterError: a parameter is not a finite number in its range.
    """

    a: Annotated[float, parameter("amplitude", "a = 0.5", "$a$", "1/time", **SIZE)]
    k: Annotated[float, parameter("rate of leaving each value", "k = 1.0", "$k$", "1/time", **SIZE)]

    kind: ClassVar[str] = "telegraph"
    of_xi: ClassVar[Mapping[str, str]] = {"a": "{}"}

    @property
    def states(self) -> Sequence[float]:
        return -self.a, self.a

    @property
    def rates(self) -> Sequence[Sequence[float]]:
        return rows_of(self.k * np.array(FLIP))

    @property
    def probabilities(self) -> FloatArray:
        return np.array([0.5, 0.5])

    def derivative(self, name: str) -> NoiseDerivative:
        return NoiseDerivative(states=(-1.0, 1.0)) if name == "a" else NoiseDerivative(rates=FLIP)
