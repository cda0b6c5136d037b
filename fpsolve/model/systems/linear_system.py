"""Linear systems of two to four variables, as two coupled modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from fpsolve.model.systems.plane_system import PlaneSystem


@dataclass(frozen=True)
class LinearSystem(PlaneSystem):
    """ẋ = Σ ε^k g(ξ) A x for a state x of n = 2 to 4 numbers, from its coefficient matrices; see `PlaneSystem`.

    >>> from fpsolve.model import CoefficientMatrix
    >>> free = CoefficientMatrix(0, ((0, 1, 0), (-1, -0.2, 0.5), (0, -0.5, -1)))  # an oscillator with a voltage
    >>> LinearSystem([free]).dimension
    3

    Args:
        terms: one at least, all of the same n.
        jumps: stretches at rays, for n = 2 alone: a wall of more dimensions holds many directions, not one.
        epsilon, build, named: as in `PlaneSystem`.

    Raises:
        ValueError: as `PlaneSystem`, or the matrices differ in their size, or there are jumps beyond the plane.
    """

    kind: ClassVar[str] = "linear"
    dimensions: ClassVar[Sequence[int]] = (2, 3, 4)
