"""How many functions of φ and of each noise there are, and which; and finer ones.

How fast the effect of a cell's modes falls with their degree is how fast the cell converges, and decides between a
higher degree and smaller cells.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Literal

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import MeshError
from fpsolve.fem.circle import CircleAxis
from fpsolve.fem.mesh import MAX_DEGREE, CylinderMesh, halved
from fpsolve.fem.noise_axes import CellAxis, NoiseAxis, PolynomialAxis, StateAxis
from fpsolve.fem.pairs import PairAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.model.frame import Frame
from fpsolve.model.noise import Noise

HALVING = 2 * math.log(2)
"""By how much more the logarithm of an effect falls with each degree in half a cell."""
MAX_POLYNOMIALS = 200
LEAST_DEGREE, SPLIT_DEGREE, MOST_DEGREE = 4, 6, 14
STILL = 3 / 7
"""Ratio of the effects of two and of four modes where no fall is seen: then thrice the first may be left."""
SPARE = 1.0
"""Degrees beyond what seems to be enough that a cell keeps where none should be made coarser."""
LITTLE = 1e-2
"""Share of the largest effect of an axis below which others are left as they are, while nothing is resolved."""
MOST_SHARED = 100
"""Functions of φ that are kept for the next problem."""
NO_LINES = np.zeros(0)


@lru_cache(maxsize=32)
def _shared(lines: bytes, degrees: bytes) -> PhaseAxis:
    """The functions of φ of some cells; a problem changes nothing in them."""
    return PhaseAxis(np.frombuffer(lines), np.frombuffer(degrees, dtype=int))


@dataclass(frozen=True, eq=False)
class ModeEffects:
    """How much of Λ each cell of one axis owes to its highest modes.

    Attributes:
        degrees: of the cells, shape (cells,).
        highest: the effects of the highest mode, of the two highest and so on up to four, shape (4, cells).
        slowest: the least share of the effect of two modes that is thought to be left.
    """

    degrees: Any
    highest: FloatArray
    slowest: float = 0.0

    @property
    def two(self) -> FloatArray:
        """Those of the two highest modes, shape (cells,)."""
        return self.highest[1]

    @property
    def of_cells(self) -> FloatArray:
        """Estimate of what each cell lacks, half way from the effect of two modes to what its slower fall predicts.

        Where e falls slowly, by r with two degrees, effects are its differences, (1/r − 1)e and (1/r² − 1)e of two and
        four modes: of their ratio q is r = q/(1 − q), and e is q/(1 − 2q) times the effect of two.
        """
        of_two = np.minimum(self.two / np.maximum(self.highest[3], 1e-300), STILL)
        return self.two * np.maximum(np.clip(np.sqrt(self._left_by_two), self.slowest, 1.0), of_two / (1 - 2 * of_two))

    @property
    def error(self) -> float:
        return float(np.sum(self.of_cells))

    @property
    def fall(self) -> FloatArray:
        """By how much the logarithm of the effect falls with each degree, shape (cells,)."""
        return np.maximum(-0.5 * np.log(np.maximum(self._left_by_two, 1e-300)), 0.3)

    @property
    def _left_by_two(self) -> FloatArray:
        """What two degrees leave of the effect, as it has fallen to that of two modes and, if more slowly, of one.

        In cells of few modes the effect of one tells nothing.
        """
        of_one, of_two = self.highest[:2] / np.maximum(self.highest[2:], 1e-300)
        return np.where(self.degrees >= SPLIT_DEGREE, np.maximum(of_one, of_two), of_two)

    def needed(self, tolerance: float) -> FloatArray:
        """The degree at which each cell would lack `tolerance`, shape (cells,)."""
        return self.degrees + np.log(np.maximum(self.of_cells, 1e-300) / tolerance) / self.fall


@dataclass(frozen=True, eq=False)
class PhaseCells:
    """Elements of φ.

    Attributes:
        lines: the vertices, shape (m + 1,).
        degrees: the degree in each cell, shape (m,).
    """

    lines: FloatArray
    degrees: Any

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(np.sum(self.degrees + 1))

    @property
    def facts(self) -> dict[str, Any]:
        """What a table says of it."""
        return {"phi_cells": self.lines.size - 1, "phi_degrees": [int(degree) for degree in self.degrees]}

    def axis(self) -> PhaseAxis:
        """The functions; many problems share small ones."""
        if self.size > MOST_SHARED:
            return PhaseAxis(self.lines, self.degrees)
        return _shared(self.lines.tobytes(), np.asarray(self.degrees, dtype=int).tobytes())

    def enriched(self) -> PhaseCells:
        """Two degrees more; where there are none left, cells are halved."""
        if np.max(self.degrees) + 2 > MAX_DEGREE:
            return self.doubled()
        return replace(self, degrees=self.degrees + 2)

    def doubled(self) -> PhaseCells:
        """Cells cut into two."""
        return PhaseCells(halved(self.lines), np.repeat(self.degrees, 2))


class NoisePart:
    """What a discretisation has for one noise.

    Attributes:
        kind: what the functions are.
        lines: the vertices of cells in z; none for others.
        degree: of cells; 0 for others.
        slope: s/p of the factor exp(s z) that goes with polynomials.
        dimension: of the state of the noise.
    """

    kind: ClassVar[Literal["polynomials", "cells", "states", "waves", "pairs"]]
    dimension: ClassVar[int] = 1
    lines: FloatArray
    degree: int
    slope: float

    @property
    def size(self) -> int:
        """Number of unknowns."""
        raise NotImplementedError

    def axis(self, noise: Noise, p: float) -> NoiseAxis:
        """The functions for one p. Raises `MeshError`."""
        raise NotImplementedError

    def enriched(self) -> NoisePart:
        """The next finer one."""
        return self

    def doubled(self) -> NoisePart:
        """About twice as many functions, where nothing is known yet."""
        return self

    def raised(self) -> NoisePart:
        """One function more in each cell, where what a cell lacks harms others."""
        return self

    def refined(self, effects: ModeEffects, share: float, may_coarsen: bool) -> NoisePart:
        """One that all together should lack no more than a share."""
        return self


@dataclass(frozen=True, eq=False)
class Polynomials(NoisePart):
    """Orthogonal polynomials of the noise.

    Attributes:
        count: their number.
        slope: s/p of the factor exp(s z) that goes with them.
    """

    count: int
    slope: float = 0.0

    kind, lines, degree = "polynomials", NO_LINES, 0

    @property
    def size(self) -> int:
        return self.count

    def axis(self, noise: Noise, p: float) -> PolynomialAxis:
        return PolynomialAxis(noise, self.count, self.slope * p)

    def enriched(self) -> Polynomials:
        return replace(self, count=self.count + max(3, self.count // 8))

    def doubled(self) -> Polynomials:
        return replace(self, count=min(2 * self.count, MAX_POLYNOMIALS))

    def raised(self) -> Polynomials:
        return replace(self, count=min(self.count + 2, MAX_POLYNOMIALS))

    def refined(self, effects: ModeEffects, share: float, may_coarsen: bool) -> Polynomials:
        needed = math.ceil(float(effects.needed(share)[0]) + 1.3)
        least = max(self.count // 2, 3) if may_coarsen else self.count
        return replace(self, count=max(least, min(needed, 3 * self.count // 2 + 3, MAX_POLYNOMIALS)))


@dataclass(frozen=True, eq=False)
class Cells(NoisePart):
    """Continuous elements on an interval of z.

    Attributes:
        lines: the vertices, shape (n + 1,).
        degrees: of the elements in each cell, shape (n,).
    """

    lines: FloatArray
    degrees: Any

    kind, slope = "cells", 0.0

    @classmethod
    def of_degree(cls, lines: FloatArray, degree: int) -> Cells:
        """With one degree in all of them."""
        return cls(lines, np.full(lines.size - 1, degree))

    @property
    def degree(self) -> int:  # type: ignore[override]
        return int(np.max(self.degrees))

    @property
    def size(self) -> int:
        return int(np.sum(self.degrees)) + 1

    def axis(self, noise: Noise, p: float) -> CellAxis:
        return CellAxis(noise, self.lines, self.degrees)

    def enriched(self) -> Cells:
        return self.doubled() if self.degree + 2 > MAX_DEGREE else replace(self, degrees=self.degrees + 2)

    def doubled(self) -> Cells:
        return Cells(halved(self.lines), np.repeat(self.degrees, 2))

    def raised(self) -> Cells:
        return replace(self, degrees=np.minimum(self.degrees + 1, MAX_DEGREE))

    def refined(self, effects: ModeEffects, share: float, may_coarsen: bool) -> Cells:
        return Cells(*_split(self.lines, effects, share, may_coarsen))

    def on(self, lines: FloatArray) -> Cells:
        """Those between other lines, each with the degree of the cell that its middle is in, or is next to."""
        middles = 0.5 * (lines[:-1] + lines[1:])
        own = np.clip(np.searchsorted(self.lines, middles) - 1, 0, self.degrees.size - 1)
        return Cells(lines, self.degrees[own])

    def reaching(self, below: bool, above: bool) -> Cells:
        """With one more cell at the ends whose effect exceeds its share."""
        lower, upper = [1.6 * self.lines[0]] if below else [], [1.6 * self.lines[-1]] if above else []
        return self.on(np.concatenate([lower, self.lines, upper]))


@dataclass(frozen=True, eq=False)
class States(NoisePart):
    """A value for each state of the noise: nothing is left to be refined.

    Attributes:
        count: their number.
    """

    count: int

    kind, lines, degree, slope = "states", NO_LINES, 0, 0.0
    dimension = 0

    @property
    def size(self) -> int:
        return self.count

    def axis(self, noise: Noise, p: float) -> StateAxis:
        return StateAxis(noise)


@dataclass(frozen=True, eq=False)
class Waves(Polynomials):
    """Waves of the angle of the noise, two for each of their numbers, and 1.

    Attributes:
        count: the highest number.
    """

    kind = "waves"  # type: ignore[assignment]

    @property
    def size(self) -> int:
        return 2 * self.count + 1

    def axis(self, noise: Noise, p: float) -> CircleAxis:  # type: ignore[override]
        return CircleAxis(noise, self.count)


@dataclass(frozen=True, eq=False)
class Pairs(Polynomials):
    """Products of two Hermite polynomials.

    Attributes:
        count: above their total degree.
        slope: g/p of the factors that they carry, see `pairs`.
    """

    kind = "pairs"  # type: ignore[assignment]
    dimension = 2

    @property
    def size(self) -> int:
        return self.count * (self.count + 1) // 2

    def axis(self, noise: Noise, p: float) -> PairAxis:  # type: ignore[override]
        return PairAxis(noise, self.count, self.slope * p)


def first_part(noise: Noise, digits: float) -> NoisePart:
    """A small one for so many digits, where no value of the noise is held."""
    if noise.basis == "waves":
        return Waves(round(digits / 2) + 4)
    if noise.basis == "pairs":
        return Pairs(round(digits / 2) + 3)
    return States(noise.reached.size) if noise.has_states else Polynomials(round(digits / 2) + 3)


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The functions of φ, and those of each noise.

    Attributes:
        phase: elements of φ.
        noises: a part for each noise.
    """

    phase: Any
    noises: tuple[NoisePart, ...]

    @classmethod
    def on(cls, mesh: CylinderMesh, noise: Noise, frame: Frame | None = None) -> Discretisation:
        """The elements of a mesh, which is cut off at the end of the noise's support, in the coordinates of a frame.

        Raises:
            MeshError: the mesh has lines where ξ is no diffusion by itself, or none where it is; or several noises
                have values.
        """
        if len(noise.parts) > 1:
            raise MeshError("a mesh is for one noise that is not white, but there are several; leave it out")
        if noise.is_diffusion != bool(mesh.z_lines.size):
            raise MeshError(
                "noise with states, with an angle or of a filter needs a mesh without z_lines, and other noise a mesh "
                "with z_lines; leave the mesh out, and one is chosen for each p"
            )
        lines = mesh.phi_lines if frame is None else frame.phase(mesh.phi_lines)
        phase = PhaseCells(lines, np.full(mesh.phi_lines.size - 1, mesh.phi_degree))
        if noise.basis == "waves":
            return cls(phase, (Waves(mesh.xi_degree),))
        if noise.basis == "pairs":
            return cls(phase, (Pairs(mesh.xi_degree),))
        if noise.has_states:
            return cls(phase, (States(noise.reached.size),))
        mesh = mesh.within(noise.half_width / noise.standard_deviation)
        return cls(phase, (Cells.of_degree(mesh.z_lines, mesh.xi_degree),))

    @property
    def noise(self) -> Any:
        """The part of the noise of a problem with one."""
        return self.noises[0]

    def with_noise(self, part: NoisePart) -> Discretisation:
        """The same with another part for the noise of a problem with one."""
        return replace(self, noises=(part,))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.phase.size * math.prod(part.size for part in self.noises)

    @cached_property
    def is_tilted(self) -> bool:
        """Whether the functions move with p."""
        return any(part.slope for part in self.noises)

    def enriched(self) -> Discretisation:
        """A finer one: two degrees more each way; where there are none left, cells are halved."""
        return Discretisation(self.phase.enriched(), tuple(part.enriched() for part in self.noises))

    def doubled(self, effects: Sequence[ModeEffects | None] = ()) -> Discretisation:
        """Twice as many functions along the axes that lack most by their effects; along all where nothing is known."""
        errors = [each.error if each else 0.0 for each in effects] or [1.0] * (1 + len(self.noises))
        of_phase, *of_noises = (error > LITTLE * max(errors) for error in errors)
        phase = self.phase.doubled() if of_phase else self.phase
        pairs = zip(self.noises, of_noises, strict=True)
        return Discretisation(phase, tuple(part.doubled() if is_coarse else part for part, is_coarse in pairs))

    def raised(self) -> Discretisation:
        """One more function each way, where what a cell lacks harms others."""
        phase = replace(self.phase, degrees=np.minimum(self.phase.degrees + 1, MAX_DEGREE))
        return Discretisation(phase, tuple(part.raised() for part in self.noises))

    def refined(self, effects: Sequence[ModeEffects | None], share: float, may_coarsen: bool) -> Discretisation:
        """One on which every cell should lack no more than its share; the effects are those of every axis."""
        of_phase, *of_noises = effects
        assert of_phase is not None
        phase = PhaseCells(*_split(self.phase.lines, of_phase, share, may_coarsen))
        pairs = zip(self.noises, of_noises, strict=True)
        noises = tuple(part if each is None else part.refined(each, share, may_coarsen) for part, each in pairs)
        return Discretisation(phase, noises)


def _split(lines: FloatArray, effects: ModeEffects, share: float, may_coarsen: bool) -> tuple[FloatArray, Any]:
    """Lines and a degree for each cell with which all together should lack no more than a share.

    A cell is halved where halves take fewer unknowns: in them the effects fall faster.
    """
    rate, needed = effects.fall, effects.needed(max(share, 1e-290) / math.sqrt(effects.degrees.size))
    if not may_coarsen:  # but for what is far more than enough
        needed = np.maximum(needed, np.minimum(effects.degrees, needed + SPARE))
    in_half = needed * rate / (rate + HALVING)
    is_split = (2 * in_half + 2 < needed + 1) & (effects.degrees >= SPLIT_DEGREE) & (needed > effects.degrees)
    is_split |= needed > MOST_DEGREE
    degrees = np.ceil(np.where(is_split, in_half, needed) + 0.2)
    degrees = np.clip(degrees, np.maximum(LEAST_DEGREE, effects.degrees - 4), effects.degrees + 4)
    middles = 0.5 * (lines[:-1] + lines[1:])
    degrees = np.repeat(np.minimum(degrees, MOST_DEGREE).astype(int), np.where(is_split, 2, 1))
    return np.sort(np.concatenate([lines, middles[is_split]])), degrees
