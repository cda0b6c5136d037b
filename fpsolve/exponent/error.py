"""Where the error of Λ(p) comes from: a finer mesh, the modes of each cell, the ends of the noise interval.

The difference of Λ on a mesh and on the same mesh with higher degrees is the error of the first. The pair on the
second, (Λ, T, T*), tells where it comes from: without the modes above degree k in one cell the Rayleigh quotient
changes by exactly ⟨Q T*, (L − Λ) Q T⟩/⟨T*, T⟩, Q being the projection on those modes.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import NotConverged, Remedy
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.fields import xi_marginal
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_space import DiffusionSpace
from fpsolve.model.problem import Problem

MEANINGLESS = 1e-2
"""An estimated error above this share of the scale of Λ(p) is no result."""


@dataclass(frozen=True)
class Estimate:
    """A number, the estimate of its error, and what both are measured by.

    Attributes:
        scale: size of the terms that the number is the sum of, where they may cancel.
    """

    value: float
    error_estimate: float
    scale: float

    @property
    def relative_error(self) -> float:
        """The error over the larger of |value| and the scale."""
        return self.error_estimate / max(abs(self.value), self.scale, sys.float_info.min)


def checked(name: str, estimate: Estimate) -> Estimate:
    """An estimate whose error leaves it a meaning. Raises `NotConverged`."""
    if not estimate.relative_error <= MEANINGLESS:
        raise NotConverged(
            f"{name} = {estimate.value:.6g} has an estimated error of {estimate.error_estimate:.1g}, too much to "
            f"mean anything; {Remedy.MESH}",
            estimate,
        )
    return estimate


@dataclass(frozen=True, eq=False)
class Solution:
    """Λ(p) on a mesh and on a finer one.

    Attributes:
        pair: the principal pair on the mesh.
        finer: the one on the finer mesh, which measures the error of the first.
    """

    pair: PrincipalPair
    finer: PrincipalPair

    @cached_property
    def truncation(self) -> tuple[float, float]:
        """What the lower and the upper end of the noise interval may change in Λ."""
        return truncation(self.pair)

    @property
    def error(self) -> float:
        """Estimate of the error of `pair.value`: discretisation, truncation and rounding."""
        return abs(self.finer.value - self.pair.value) + sum(self.truncation) + self.pair.rounding


@dataclass(frozen=True, eq=False)
class Stage:
    """A discretisation and the finer one that measures its error."""

    coarse: Generator
    fine: Generator

    @classmethod
    def on(
        cls,
        problem: Problem,
        mesh: CylinderMesh,
        tilt: float = 0.0,
        widening: float = 1.0,
    ) -> Stage:
        """The stage of a mesh; its finer one has higher degrees, and an interval wider by a factor."""
        coarse, fine = (Generator(problem, each, tilt) for each in (mesh, mesh.enriched(widening)))
        return cls(coarse, fine)

    def release(self) -> None:
        """Give the memory of the matrices free until they are needed again."""
        self.coarse.release()
        self.fine.release()

    def solve(self, p: float, start: Sequence[PrincipalPair] = ()) -> Solution:
        """Both pairs at p, from known ones on the coarse mesh. Raises `NotConverged`."""
        pair = principal_pair(self.coarse, p, start=start)
        return Solution(pair, principal_pair(self.fine, p, start=pair))


def truncation(pair: PrincipalPair) -> tuple[float, float]:
    """Bounds on what the two ends of the noise interval change in Λ: ½σ² ∫ P_s |T_z| T* dφ / ∫ T T* there."""
    xi = pair.generator.space.xi
    if not isinstance(xi, DiffusionSpace):
        return 0.0, 0.0
    return _end_effect(pair, xi, 0), _end_effect(pair, xi, -1)


def _end_effect(pair: PrincipalPair, xi: DiffusionSpace, end: int) -> float:
    """½σ² P_s |∂T| T* at an end; the slope is the largest in the last cell, as no flux makes it 0 at the end itself."""
    space = pair.generator.space
    local = np.linspace(0, 1, 9) if end else np.linspace(1, 0, 9)
    points, values = xi.line.evaluation(local)
    rows = slice(-9, None) if end else slice(0, 9)
    right, left = (values[rows] @ space.table(v).T for v in (pair.right, pair.left))
    weighed = space.phi.mass() @ left[-1]
    product = right @ weighed
    slope = np.max(np.abs(np.diff(product) / np.diff(points[rows]))) + abs(xi.tilt * product[-1])
    norm = pair.left @ (pair.generator.mass @ pair.right)
    return float(xi.rate * xi.weight(points[rows][-1:])[0] * slope / abs(norm))


@dataclass(frozen=True)
class ModeEffects:
    """How much of Λ each cell of one direction owes to its modes above degree k, for several k.

    Attributes:
        degrees: k, decreasing, shape (n,), as float.
        effects: shape (cells, n).
    """

    degrees: FloatArray
    effects: FloatArray

    def above(self, degree: int) -> float:
        """What all cells together owe to modes above a degree."""
        return float(np.sum(self.effects[:, self.degrees <= degree][:, :1]))

    def needed(self, tolerance: float) -> FloatArray:
        """The degree at which each cell's effect would be `tolerance`, shape (cells,)."""
        logs = np.log(np.maximum(self.effects, 1e-300))
        rate = np.maximum((logs[:, -1] - logs[:, 0]) / max(self.degrees[0] - self.degrees[-1], 1), 0.2)
        return self.degrees[0] + (logs[:, 0] - math.log(tolerance)) / rate


def mode_effects(pair: PrincipalPair, axis: int) -> ModeEffects:
    """The effects along one of the axes of a pair's space: φ (0), or ξ (1) if that is a line."""
    generator, space = pair.generator, pair.generator.space
    line = space.axes[axis]
    operator, norm = generator.matrix(pair.p, shift=pair.value), pair.left @ (generator.mass @ pair.right)
    shape = (space.phi.size, space.xi.size)
    degrees = np.arange(line.degree - 1.0, max(line.degree - 5, 0), -1)
    effects = []
    for degree in degrees:
        inside = line.modes > degree
        mask = np.broadcast_to(inside[:, None] if axis == 0 else inside, shape).ravel()
        products = ((pair.left * mask) * (operator @ (pair.right * mask))).reshape(shape).sum(axis=1 - axis)
        effects.append(np.bincount(line.cells[inside], np.abs(products[inside]), minlength=line.lines.size - 1))
    return ModeEffects(degrees, np.stack(effects, axis=-1) / abs(norm))


def noise_marginal(pair: PrincipalPair) -> tuple[FloatArray, FloatArray]:
    """z and the ξ-marginal of the tilted density at points of each cell, times their distance."""
    at = pair.generator.space.xi.samples((np.arange(12) + 0.5) / 12)
    return at.xi / pair.generator.problem.noise.standard_deviation, np.abs(xi_marginal(pair, at)) * at.measure
