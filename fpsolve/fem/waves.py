"""Functions of the phase φ where nothing strikes at a ray: the waves of 2φ."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray, IntArray, one
from fpsolve.fem.effects import ModeEffects
from fpsolve.fem.phase import PhaseAxis
from fpsolve.model.plane import CoefficientMatrix, Harmonics

MORE_POINTS = 16
"""Number of equidistant points of π beyond four for each wave."""
MOST_WAVES = 200
"""Largest number of waves: beyond, none are added."""


@dataclass(frozen=True, eq=False)
class WaveAxis(PhaseAxis):
    """1/√π and √(2/π) cos 2kφ, √(2/π) sin 2kφ, k ≤ n, on the half circle: one cell, with no jump at its ends.

    Attributes:
        degrees: n, shape (1,).
    """

    is_of_waves = True

    @staticmethod
    def of(lines: FloatArray, degrees: IntArray) -> WaveAxis:
        return WaveAxis(lines, np.asarray(degrees, dtype=int))

    @property
    def ring(self) -> None:
        """None, as each wave is coupled to others."""

    @property
    def count(self) -> int:
        """n."""
        return int(self.degrees[0])

    @cached_property
    def size(self) -> int:
        return 2 * self.count + 1

    @property
    def facts(self) -> dict[str, Any]:
        return {"phi_waves": self.count}

    def doubled(self) -> WaveAxis:
        return self._of_count(2 * self.count)

    def enriched(self) -> WaveAxis:
        return self._of_count(self.count + max(2, self.count // 8))

    def raised(self) -> WaveAxis:
        return self._of_count(self.count + 1)

    def refined(self, effects: ModeEffects, share: float, may_coarsen: bool) -> WaveAxis:
        needed = math.ceil(float(effects.needed(share)[0]) + 0.2)
        return self._of_count(max(self.count // 2 if may_coarsen else self.count, min(needed, 3 * self.count // 2 + 2)))

    def _of_count(self, count: int) -> WaveAxis:
        return self.of(self.lines, np.array([min(max(count, 1), MOST_WAVES)]))

    @cached_property
    def cells(self) -> IntArray:
        return np.zeros(self.size, dtype=int)

    @cached_property
    def modes(self) -> IntArray:
        return (np.arange(self.size) + 1) // 2

    @cached_property
    def _grid(self) -> FloatArray:
        count = 4 * self.count + MORE_POINTS
        return self.lines[0] + math.pi / count * np.arange(count)[None]

    @cached_property
    def weights(self) -> FloatArray:
        return np.full(self.points.size, math.pi / self.points.size)

    @cached_property
    def constant(self) -> FloatArray:
        return math.sqrt(math.pi) * np.eye(1, self.size)[0]

    @cached_property
    def identity(self) -> FloatArray:
        return np.eye(self.size)

    def at(self, phi: FloatArray, inside: FloatArray | None = None) -> FloatArray:
        return self._waves_at(phi)[0]

    def _waves_at(self, phi: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and slopes at any φ, shape (len(φ), size)."""
        waves = math.sqrt(2 / math.pi) * np.exp(2j * np.outer(phi, self.modes))
        waves[:, 0] = 1 / math.sqrt(math.pi)
        is_cosine = np.arange(self.size) % 2 == 1
        is_cosine[0] = True
        values = np.where(is_cosine, waves.real, waves.imag)
        return values, 2 * self.modes * np.where(is_cosine, -waves.imag, waves.real)

    @cached_property
    def values(self) -> FloatArray:
        return self._waves_at(self.points)[0]

    @cached_property
    def inner_values(self) -> FloatArray:
        return self.values

    def finer_rule(self, parts: int) -> tuple[FloatArray, FloatArray]:
        count = parts * self.points.size
        return self.lines[0] + math.pi / count * np.arange(count), np.full(count, math.pi / count)

    def _trace(self, side: int) -> FloatArray:
        """Values at the seam, as if there were none."""
        return self.at(self.lines[:1])

    def mass(self, f: Any = one) -> FloatArray:
        return self.identity if f == one else self._form(f(self.points), 0, 0)

    def convection(self, f: Harmonics) -> FloatArray:
        return self._form(f(self.points), 0, 1)

    def diffusion(self, a: CoefficientMatrix, b: CoefficientMatrix) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Those of `PhaseAxis.diffusion`, without its loads at vertices."""
        phi = self.points
        ha, qa, hb, qb, slope = a.h(phi), a.q(phi), b.h(phi), b.q(phi), a.h.slope(phi)
        return (
            -self._form(ha * hb, 1, 1) - self._form(slope * hb, 0, 1),
            self._form(qa * hb, 0, 1) - self._form(ha * qb, 1, 0) - self._form(slope * qb, 0, 0),
            self._form(qa * qb, 0, 0),
        )

    def _form(self, f: FloatArray, test: int, trial: int) -> FloatArray:
        """∫ f v u, with slopes in place of values where 1 stands for 0."""
        tables = self._waves_at(self.points)
        found = tables[test].T @ ((f * self.weights)[:, None] * tables[trial])
        found[np.abs(found) < 1e-13 * np.max(np.abs(found), initial=0.0)] = 0.0
        return found
