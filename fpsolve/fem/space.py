"""Spaces: the products of the functions of φ, or of directions, and of each noise; and finer ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray, Matrix, one
from fpsolve.errors import MeshError
from fpsolve.fem.axis import Axis, KroneckerSum, along
from fpsolve.fem.circle import CircleAxis
from fpsolve.fem.effects import ModeEffects
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_axes import CellAxis, NoiseAxis, PolynomialAxis, StateAxis
from fpsolve.fem.pairs import PairAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.model.frame import ITSELF, Frame
from fpsolve.model.noise import Noise

MOST_BYTES = 1.2e9
"""Of the factors of a generator: with what else is held, and libraries, a process takes about 1.5 GB."""
LITTLE = 1e-2
"""Share of the largest effect of an axis below which others are left as they are, while nothing is resolved."""
FIRST: dict[str, Callable[[Noise, int], NoiseAxis]] = {
    "polynomials": lambda noise, count: PolynomialAxis(noise, count + 3),
    "waves": lambda noise, count: CircleAxis(noise, count + 4),
    "pairs": lambda noise, count: PairAxis(noise, count + 3),
    "states": lambda noise, count: StateAxis(noise),
}
"""The functions of a noise by its `basis` and a number of them; those of "cells" follow from their interval."""


def first_axis(noise: Noise, digits: float) -> NoiseAxis:
    """Few functions of a noise, for so many digits, where no value of the noise is held."""
    return FIRST[noise.basis](noise, round(digits / 2))


@dataclass(frozen=True, eq=False)
class Space:
    """The products of the functions of several axes.

    Attributes:
        axes: that of φ, or of directions, and that of each noise.
    """

    axes: tuple[Any, ...]

    @classmethod
    def on(cls, mesh: CylinderMesh, noise: Noise, frame: Frame = ITSELF) -> Space:
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
        lines = frame.phase(mesh.phi_lines)
        phi = PhaseAxis.of(lines, np.full(lines.size - 1, mesh.phi_degree))
        if noise.is_diffusion:
            mesh = mesh.within(noise.half_width / noise.standard_deviation)
            return cls((phi, CellAxis(noise, mesh.z_lines, np.full(mesh.z_lines.size - 1, mesh.xi_degree))))
        of_degree = {"waves": CircleAxis, "pairs": PairAxis}.get(noise.basis)
        return cls((phi, of_degree(noise, mesh.xi_degree) if of_degree else StateAxis(noise)))

    @property
    def phi(self) -> Any:
        """The phase, or directions."""
        return self.axes[0]

    @property
    def noises(self) -> tuple[Any, ...]:
        """The axes of all noises."""
        return self.axes[1:]

    @property
    def xi(self) -> Any:
        """The noise of a problem with one."""
        return self.axes[1]

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """The sizes of the axes."""
        return tuple(axis.size for axis in self.axes)

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return math.prod(self.shape)

    @cached_property
    def chain(self) -> int | None:
        """The longest axis that is a chain, along which generators are eliminated; None where there is none."""
        return max((k for k, axis in enumerate(self.axes) if axis.is_chain), key=lambda k: self.shape[k], default=None)

    @property
    def most_unknowns(self) -> int:
        """So many that a process takes 1.5 GB: three squares of a block for each level, otherwise as measured."""
        if self.chain is None:
            return int(self.phi.most_unknowns)
        return int(math.sqrt(MOST_BYTES / 24 * self.shape[self.chain]))

    @property
    def turns(self) -> int:
        """How often the domain fits on the full circle."""
        return math.prod(axis.turns for axis in self.axes)

    @cached_property
    def is_tilted(self) -> bool:
        """Whether the functions move with p."""
        return any(axis.slope for axis in self.axes)

    def at(self, p: float, noises: Iterable[Noise]) -> Space:
        """The space with the tilt for p; each axis has tables of its own."""
        return Space((self.phi, *(axis.of(noise, p) for axis, noise in zip(self.noises, noises, strict=True))))

    def with_axis(self, k: int, axis: Axis) -> Space:
        """The space with another axis in one place."""
        return Space((*self.axes[:k], axis, *self.axes[k + 1 :]))

    def enriched(self) -> Space:
        """A finer one: two degrees more each way; where there are none left, cells are halved."""
        return Space(tuple(axis.enriched() for axis in self.axes))

    def doubled(self, effects: Sequence[ModeEffects | None] = ()) -> Space:
        """Twice as many functions along the axes that lack most by their effects; along all where nothing is known."""
        errors = [each.error if each else 0.0 for each in effects] or [1.0] * len(self.axes)
        are_coarse = [error > LITTLE * max(errors) for error in errors]
        return Space(tuple(axis.doubled() if each else axis for axis, each in zip(self.axes, are_coarse, strict=True)))

    def raised(self) -> Space:
        """One more function each way, where what a cell lacks harms others."""
        return Space(tuple(axis.raised() for axis in self.axes))

    def refined(self, effects: Sequence[ModeEffects | None], share: float, may_coarsen: bool) -> Space:
        """One on which every cell should lack no more than its share; the effects are those of every axis."""
        pairs = zip(self.axes, effects, strict=True)
        return Space(tuple(axis.refined(each, share, may_coarsen) if each else axis for axis, each in pairs))

    @cached_property
    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor where there is a tilt, shape (size,)."""
        return self.product([axis.constant for axis in self.axes])

    def product(self, vectors: Sequence[FloatArray]) -> FloatArray:
        """Coefficients of the product of one function for each axis, shape (size,)."""
        return reduce(np.multiply.outer, vectors).ravel()

    @cached_property
    def mass(self) -> KroneckerSum:
        """∫ P_s w T."""
        return KroneckerSum([tuple(axis.matrix(one) for axis in self.axes)])

    def weighed(self, coefficients: FloatArray) -> FloatArray:
        """∫ P_s w T for every test function w, T a function of the space."""
        return along(self._weights, self.table(coefficients)).ravel()

    @cached_property
    def _weights(self) -> tuple[Matrix | None, ...]:
        """The factors of `mass`; None for that of φ where it is the identity."""
        return self.phi.unit, *(axis.matrix(one) for axis in self.noises)

    def table(self, coefficients: FloatArray) -> FloatArray:
        """Coefficients of a function by axes, shape `shape`."""
        return coefficients.reshape(self.shape)

    def carry(self, coefficients: FloatArray, old: Space) -> FloatArray:
        """Functions of another space, factors and all, projected on this one, shape (…, size)."""
        pairs = zip(self.axes, old.axes, strict=True)
        matrices = [None if new is was else new.projection(was) for new, was in pairs]
        tables = [along(matrices, old.table(each)) for each in np.atleast_2d(coefficients)]
        return np.reshape(tables, (*coefficients.shape[:-1], self.size))

    def on_grid(self, coefficients: FloatArray) -> FloatArray:
        """A function without its factor at all points of a grid, φ first."""
        return self.evaluate(coefficients, self.phi.inner_values, *(axis.values for axis in self.noises))

    @property
    def grid_measure(self) -> FloatArray:
        """∫ of the weight of the noises at the points of that grid, the same for each φ."""
        return np.asarray(reduce(np.multiply.outer, (axis.measure for axis in self.noises)))

    def evaluate(self, coefficients: FloatArray, *values: Matrix) -> FloatArray:
        """A function without its factor, from the values of the functions of each axis at points of it."""
        return along(values, self.table(coefficients))
