"""Axes, the functions along one direction each, and their tensor product.

A function of (φ, ξ, …) has one coefficient for each choice of a function on every axis, the first axis slowest; an
operator f(φ)·g(ξ)·… is a Kronecker product of one matrix for each axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, reduce
from typing import Any

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.fem.kronecker import KroneckerSum, along


class Axis:
    """What terms of a generator, error estimates and pictures ask of the functions along one direction.

    Attributes:
        size: number of unknowns.
        cells: for each unknown the cell that it belongs to, -1 for none or two, shape (size,).
        modes: for each unknown the degree of its polynomial, shape (size,).
        constant: coefficients of the function 1, times the factor of the axis, shape (size,).
        nested: the matrix to coefficients of modes whose sums by degree are all functions of a lower degree; None where
            they are that already.
        turns: how often the axis fits on the full circle; 1 for noise.
        slowest: the least share of the effect of the highest modes that two more may leave, see `ModeEffects`.
    """

    size: int
    cells: Any
    modes: Any
    constant: FloatArray
    nested: Any = None
    turns, slowest = 1, 0.0

    def __init__(self) -> None:
        self._matrices: dict[Coefficient | None, Any] = {}

    def mass(self, g: Any = one) -> Any:
        """∫ g u v in the weight of the axis."""
        raise NotImplementedError

    def generator(self) -> Any:
        """∫ v L u in the weight of the axis, L the generator of the process along it."""
        raise NotImplementedError

    def matrix(self, g: Coefficient | None) -> Any:
        """`mass(g)`, or `generator()` for None, made once."""
        if g not in self._matrices:
            self._matrices[g] = self.generator() if g is None else self.mass(g)
        return self._matrices[g]

    def projection(self, other: Any) -> Any:
        """The matrix that takes a function on another axis to its projection on this one, shape (size, other.size)."""
        raise NotImplementedError


class TensorSpace:
    """The products of the functions of several axes: φ, and every noise.

    Attributes:
        axes: φ first.
        shape: their sizes.
    """

    def __init__(self, axes: Sequence[Any]) -> None:
        self.axes, self.shape = tuple(axes), tuple(axis.size for axis in axes)
        self.size = math.prod(self.shape)

    @property
    def phi(self) -> Any:
        """The phase."""
        return self.axes[0]

    @property
    def xi(self) -> Any:
        """The noise of a problem with one."""
        return self.axes[1]

    @property
    def turns(self) -> int:
        """How often the domain fits on the full circle."""
        return math.prod(axis.turns for axis in self.axes)

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
        return np.ravel(along([None, *self.mass.terms[0][1:]], self.table(coefficients)))

    def table(self, coefficients: FloatArray) -> FloatArray:
        """Coefficients of a function by axes, shape `shape`."""
        return coefficients.reshape(self.shape)

    def carry(self, coefficients: FloatArray, old: TensorSpace) -> FloatArray:
        """A function of another space, factor and all, projected on this one."""
        pairs = zip(self.axes, old.axes, strict=True)
        matrices = [None if new is was else new.projection(was) for new, was in pairs]
        return np.ravel(along(matrices, old.table(coefficients)))

    def evaluate(self, coefficients: FloatArray, *values: Any) -> FloatArray:
        """A function without its factor, from the values of the functions of each axis at points of it."""
        return along(values, self.table(coefficients))
