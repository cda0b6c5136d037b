"""Where the error of Λ(p) comes from: the modes of each cell, the ends of a noise interval, rounding.

Without its highest modes, a projection Q, the pair (Λ, T, T*) would have the Rayleigh quotient Λ plus
⟨Q T*, (L − Λ) Q T⟩/⟨T*, T⟩, to leading order. Summed in absolute values over the unknowns of a cell, as signs may
cancel, that of the two highest modes tells the error with a degree less by two, that of the four highest with a degree
less by four, and how it falls tells what is left of it. It may fall unevenly; the slower one of two falls counts.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray, ReadOnly
from fpsolve.data import Quantity, Result, brief, dataset
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.fem.axis import ModeEffects, along
from fpsolve.messages import Message
from fpsolve.model.quantity import UNNAMED

if TYPE_CHECKING:
    import xarray

MEANINGLESS = 1e-2
"""An estimated error above this share of the scale of Λ(p) is no result."""


def digits(value: float, error: float, most: int = 17) -> str:
    """A number with the digits that its error leaves, at most so many significant ones; 0 where it leaves none."""
    if abs(value) <= error:
        return "0"
    count = 13
    if error > 0 and math.isfinite(value):
        count = max(math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1, 1)
    return f"{value:#.{min(count, most)}g}".rstrip(".")


@dataclass(frozen=True, repr=False)
class Estimate(Result):
    """A number, the estimate of its error, and what both are measured by; it is true, whatever the number.

    Attributes:
        error_estimate: half a unit in the last place of the value at least.
        scale: size of the terms that the number is the sum of, where they may cancel.
        meaning: what the number is, where its name may mislead.
        quantity: what it is called, and its unit.
    """

    value: float
    error_estimate: float
    scale: float
    meaning: str = ""
    quantity: Quantity = field(default=UNNAMED, compare=False)

    def __post_init__(self) -> None:
        if self.error_estimate < 0:
            raise ValueError(f"got {self.error_estimate} as the estimate of an error; must be >= 0")
        object.__setattr__(self, "error_estimate", max(self.error_estimate, 0.5 * math.ulp(self.value)))

    def __bool__(self) -> Literal[True]:
        return True

    @property
    def relative_error(self) -> float:
        """The error over the larger of |value| and the scale."""
        return self.error_estimate / max(abs(self.value), self.scale, sys.float_info.min)

    def __str__(self) -> str:
        return f"{digits(self.value, self.error_estimate)} ± {self.error_estimate:.0e}"

    def _said(self) -> str:
        unit = "" if self.quantity.unit in ("1", UNNAMED.unit) else f", in {self.quantity.unit}"
        return f"{self.quantity.symbol} = {self}{unit}"

    def to_xarray(self) -> xarray.Dataset:
        """The number and its error, without dimensions."""
        scale = Quantity("scale", "scale", "size of the terms of the sum", unit=self.quantity.unit)
        numbers = {self.quantity: self.value, self.quantity.error(): self.error_estimate, scale: self.scale}
        return dataset(self.quantity.words, "finite elements", numbers, {}, {}, meaning=self.meaning)


@dataclass(frozen=True, repr=False)
class Absent:
    """A quantity that does not exist; it is false.

    Attributes:
        reason: why.
    """

    reason: Message

    def __bool__(self) -> Literal[False]:
        return False

    def __str__(self) -> str:
        return f"none: {self.reason}"

    def __repr__(self) -> str:
        return brief(self, self.reason)

    def _repr_html_(self) -> str:
        """What a notebook shows: the whole reason."""
        return f"<p>{escape(str(self))}</p>"


class Moment(NamedTuple):
    """Λ(p) of one p as a record holds it: without its eigenfunctions."""

    value: float
    derivative: float
    derivative_error: float
    error: float
    residual: float

    @classmethod
    def of(cls, found: Any) -> Moment:
        """That of what is solved, without a pair."""
        return cls(found.value, found.derivative, math.nan, found.error, math.nan)


@dataclass(frozen=True, eq=False)
class InvariantClass(ReadOnly):
    """The growth of a block of variables, or on a ray that the phase never leaves, or of the distance from it.

    Attributes:
        name: what tables call it: "along the ray at phi = 1.5708", "x, v".
        phase: φ of the ray; None for a block of variables.
        variables: the names of those of the block; none for a ray.
        lyapunov_exponent: its λ.
        p: the moments, shape (n,).
        value, error_estimate: its Λ(p), shape (n,).
    """

    name: str
    phase: float | None
    variables: tuple[str, ...]
    lyapunov_exponent: Estimate
    p: FloatArray
    value: FloatArray
    error_estimate: FloatArray


@dataclass(frozen=True)
class Failure:
    """Why there is no Λ(p), or none to be trusted.

    Attributes:
        p: the moment; None where all of them are doubtful, or where another quantity is missing.
        reason: what happened, and what to do.
    """

    p: float | None
    reason: Message


@dataclass(frozen=True, eq=False)
class Solution:
    """Λ(p) with the parts of its error.

    Attributes:
        pair: the principal pair.
        unresolved: what is left of a correction by finer functions of directions, or shown by halved cells of φ.
        measured: what finer functions of each axis, or of all, change; none where the effects of the highest modes
            tell.
        start: the place where it was found, and its functions; None where these are just those of the pair.
    """

    pair: PrincipalPair
    unresolved: float = 0.0
    measured: tuple[float, ...] = ()
    start: Any = None

    @property
    def value(self) -> float:
        """Λ(p)."""
        return self.pair.value

    @property
    def derivative(self) -> float:
        """Λ′(p)."""
        return self.pair.derivative

    @cached_property
    def effects(self) -> tuple[ModeEffects | None, ...]:
        """Those of φ, and those of ξ if it has elements."""
        return mode_effects(self.pair)

    @cached_property
    def truncation(self) -> tuple[float, float]:
        """What the two ends of an interval of cells change in Λ, at most about: ½σ²P_s Σ |T_z T*| over φ."""
        if not (lines := self.pair.space.xi.lines).size:
            return 0.0, 0.0
        return _end_effect(self.pair, lines[[0, 1]]), _end_effect(self.pair, lines[[-1, -2]])

    @cached_property
    def error(self) -> float:
        """Estimate of the error of `value`: by functions that the space lacks, the ends of an interval, rounding."""
        of_axes = self.measured or [each.error for each in self.effects if each]
        return sum(of_axes) + sum(self.truncation) + self.pair.rounding + self.unresolved


def mode_effects(pair: PrincipalPair) -> tuple[ModeEffects | None, ...]:
    """The effects ⟨Q T*, (L − Λ) Q T⟩/⟨T*, T⟩ of the highest modes along every axis; None along one without cells.

    L − Λ is applied to the smoother function of both. T for p and T* for −2 − p solve the same equation but for the
    direction of time: that of the paths for p < −1 has layers where the paths for p > −1 leave.
    """
    operator, space = pair.generator.at(pair.p).shifted(pair.eigenvalue), pair.space
    both = np.reshape([pair.right, pair.left], (2, *space.shape))  # the smooth one first
    if pair.p < -1:
        both, operator = both[::-1], operator.T
    norm = abs(pair.left @ space.weighed(pair.right))
    count, found = len(space.axes), list[ModeEffects | None]()
    for k, axis in enumerate(space.axes):
        kept, are_highest, degrees = axis.highest
        if not degrees.size:
            found.append(None)
            continue
        others = tuple({*range(1, count + 1)} - {k + 1})
        nested = count * [None]
        nested[k] = axis.nested
        smooth, rough = np.compress(kept, along(nested, both), axis=k + 1)
        parts = rough * np.cumsum(operator.on(k, kept) @ (smooth * np.expand_dims(are_highest, others)), axis=0)
        shares = np.abs(parts).sum(axis=others) * np.cumsum(are_highest, axis=0)
        effects = np.zeros((4, degrees.size))
        np.add.at(effects.T, axis.cells[kept], shares.T / norm)
        highest = np.maximum.accumulate(effects)  # in those of more modes, parts of these may cancel
        found.append(ModeEffects(degrees, highest, axis.slowest if k else pair.generator.left_in_phase))
    return tuple(found)


def _end_effect(pair: PrincipalPair, lines: FloatArray) -> float:
    """That of the first of two lines; the slope is the largest between them, as no flux makes it 0 there."""
    space, xi = pair.space, pair.space.xi
    if xi.unit * abs(lines[0]) >= xi.noise.half_width * (1 - 1e-12):  # nothing is cut off, and P_s may be infinite
        return 0.0
    z = lines[0] + (lines[1] - lines[0]) * np.linspace(0, 1, 9)
    right, left = (xi.values_at(z) @ space.table(v).T for v in (pair.right, pair.left))
    slope = np.max(np.sum(np.abs(np.diff(right, axis=0) * left[0]), axis=1) / np.abs(np.diff(z)))
    norm = pair.left @ space.weighed(pair.right)
    return float(xi.rate(z[:1])[0] * xi.weight(z[:1])[0] * slope / abs(norm))
