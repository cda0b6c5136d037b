"""Spaces: the products of the functions of φ, or of directions, and of each noise; and finer ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, reduce
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray, one
from fpsolve.errors import MeshError
from fpsolve.fem.axis import FunctionAxis, KroneckerSum, ModeEffects, along
from fpsolve.fem.circle import CircleAxis
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_axes import CellAxis, NoiseAxis, PolynomialAxis, StateAxis
from fpsolve.fem.pairs import PairAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.model.noise import Noise

MOST_BYTES = 1e9
"""Of the factors of a generator: with what else is held, and libraries, a process takes about 1.5 GB."""
LITTLE = 1e-2
"""Share of the largest effect of an axis below which others are left as they are, while nothing is resolved."""
BASES: dict[str, Callable[[Noise, int], NoiseAxis]] = {
    "polynomials": PolynomialAxis,
    "waves": CircleAxis,
    "pairs": PairAxis,
    "states": lambda noise, _: StateAxis(noise),
}
"""The functions of a noise by its `basis` and a number of them; those of "cells" follow from their interval."""


def first_axis(noise: Noise, digits: float) -> NoiseAxis:
    """Few functions of a noise, for so many digits; there are more where it has ends."""
    return BASES[noise.basis](noise, round(digits / 2) + (3 if math.isinf(noise.half_width) else 5))


class Space:
    """The products of the functions of several axes.

    Attributes:
        axes: that of φ, or of directions, and that of each noise.
        phi: the first one.
        noises: those of all noises.
        xi: the first of these.
        shape: the number of functions along each axis.
        size: the number of unknowns.
        turns: how often the domain fits on the full circle.
        is_tilted: whether the functions move with p.
        chain: the longest axis with a band, along which generators are eliminated; None where there is none.
        most_unknowns: so many that a process takes 1.5 GB: `LevelFactors` have three squares of a block for each band
            of functions, and terms eight for one function; otherwise as measured.
    """

    def __init__(self, axes: Sequence[Any]) -> None:
        self.axes = tuple(axes)
        self.phi, self.noises, self.xi = axes[0], self.axes[1:], axes[1]
        self.shape, self.turns = tuple(axis.size for axis in axes), self.phi.turns
        self.size, self.is_tilted = math.prod(self.shape), any(axis.slope for axis in axes)
        chains = [k for k, axis in enumerate(axes) if axis.band]
        self.chain = max(chains, key=self.shape.__getitem__, default=None)
        self.most_unknowns = self.phi.most_unknowns
        if self.chain is not None:
            count, band = self.shape[self.chain], axes[self.chain].band
            self.most_unknowns = int(count * math.sqrt(MOST_BYTES / 8 / (3 * band * count + 8)))

    @classmethod
    def on(cls, mesh: CylinderMesh, noise: Noise, phase: Callable[[FloatArray], FloatArray] = np.asarray) -> Space:
        """The elements of a mesh, which is cut off at the end of the noise's support, where ψ is a function of φ.

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
        lines = phase(mesh.phi_lines)
        phi = PhaseAxis(lines, np.full(lines.size - 1, mesh.phi_degree))
        if noise.is_diffusion:
            mesh = mesh.within(noise.half_width / noise.standard_deviation)
            return cls((phi, CellAxis(noise, mesh.z_lines, np.full(mesh.z_lines.size - 1, mesh.xi_degree))))
        return cls((phi, BASES[noise.basis](noise, mesh.xi_degree)))

    def with_axis(self, k: int, axis: FunctionAxis) -> Space:
        """The space with another axis in one place."""
        return Space((*self.axes[:k], axis, *self.axes[k + 1 :]))

    @cached_property
    def finer(self) -> Space:
        """A finer one each way, see each axis: two degrees more, or some polynomials, or half cells."""
        return Space(tuple(axis.enriched() for axis in self.axes))

    def doubled(self, effects: Sequence[ModeEffects | None] = ()) -> Space:
        """Twice as many functions along the axes that lack most by their effects; along all where nothing is known."""
        errors = [each.error if each else 0.0 for each in effects] or [1.0] * len(self.axes)
        are_coarse = [error > LITTLE * max(errors) for error in errors]
        return Space(tuple(axis.doubled() if each else axis for axis, each in zip(self.axes, are_coarse, strict=True)))

    def raised(self) -> Space:
        """One more function each way, where what a cell lacks harms others."""
        return Space(tuple(axis.raised() for axis in self.axes))

    def refined(self, effects: Sequence[ModeEffects | None], share: float) -> Space:
        """One on which every cell should lack no more than its share; the effects are those of every axis."""
        pairs = zip(self.axes, effects, strict=True)
        return Space(tuple(axis.refined(each, share) if each else axis for axis, each in pairs))

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
        return KroneckerSum([[axis.matrix(one) for axis in self.axes]])

    def weighed(self, coefficients: FloatArray) -> FloatArray:
        """∫ P_s w T for every test function w, T a function of the space."""
        weights = [None if axis.is_orthonormal else axis.matrix(one) for axis in self.axes]
        return along(weights, self.table(coefficients)).reshape(coefficients.shape)

    def table(self, coefficients: FloatArray) -> FloatArray:
        """Coefficients of a function by axes, shape `shape`."""
        return coefficients.reshape(self.shape)

    def carry(self, coefficients: FloatArray, old: Space) -> FloatArray:
        """Functions of another space, factors and all, projected on this one, shape (…, size)."""
        pairs = zip(self.axes, old.axes, strict=True)
        matrices = [None if new is was else new.projection(was) for new, was in pairs]
        tables = [along(matrices, old.table(each)) for each in np.atleast_2d(coefficients)]
        return np.reshape(tables, (*coefficients.shape[:-1], self.size))

    def on_grid(self, *functions: FloatArray) -> list[FloatArray]:
        """What the points of a grid stand for in an integral with the weights of all axes, but for a factor, and
        functions without their factors there."""
        _, measures, values = zip(*[axis.rule[:3] for axis in self.axes], strict=True)
        return [reduce(np.multiply.outer, measures), *(along(values, self.table(each)) for each in functions)]
