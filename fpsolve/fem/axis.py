"""Axes, the functions along one direction each, and the operators on their products.

A function of (φ, ξ, …) has one coefficient for each choice of a function on every axis, the first axis slowest; an
operator f(φ)·g(ξ)·… is a Kronecker product of one matrix for each axis, others are sums Σ Φ_k ⊗ Ξ_k ⊗ … of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, reduce
from typing import Any, ClassVar, Self

import numpy as np
import scipy.sparse
from scipy.sparse import csc_matrix, identity, issparse

from fpsolve.arrays import Coefficient, FloatArray, IntArray, Mask, Matrix, dense, one
from fpsolve.fem.effects import ModeEffects, split
from fpsolve.fem.mesh import MAX_DEGREE, halved
from fpsolve.model.noise import NoiseDerivative

NO_LINES = np.zeros(0)
MAX_DENSE_UNKNOWNS = 600
"""Largest number of functions of an axis with cells whose matrices are arrays: of more they are sparse."""


class Axis:
    """What terms of a generator, error estimates and pictures ask of the functions along one direction.

    An axis is a frozen choice of functions. Its tables are made when they are first asked for, and are not pickled.

    Attributes:
        lines: the vertices of cells; none where the functions are of the whole axis.
        most_unknowns: of a space with this first axis and no chain, with which a process takes 1.5 GB.
        is_chain: whether each function is coupled to few next to it alone, as polynomials of noise are.
        slowest: the least share of the effect of the highest modes that two more may leave, see `ModeEffects`.
        slope: s/p of the factor exp(s z) that moves with p.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]
    lines = NO_LINES
    most_unknowns = 35_000
    is_chain = False
    slowest, slope = 0.0, 0.0

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, each.name) for each in fields(self))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        raise NotImplementedError

    @cached_property
    def cells(self) -> IntArray:
        """For each unknown the cell that it belongs to, −1 for none or two, shape (size,); by default for none."""
        return np.full(self.size, -1)

    @cached_property
    def modes(self) -> IntArray:
        """For each unknown the degree of its polynomial in a cell, shape (size,)."""
        return np.zeros(self.size, dtype=int)

    @property
    def nested(self) -> Matrix | None:
        """To coefficients of modes whose sums by degree are all functions of a lower one; None where they are that."""
        return None

    @property
    def unit(self) -> Matrix | None:
        """∫ u v; None where it is the identity, or for noise."""
        return None

    @cached_property
    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor of the axis, shape (size,); by default it is the first."""
        return np.eye(1, self.size)[0]

    @property
    def turns(self) -> int:
        """How often the axis fits on the full circle; 1 for noise."""
        return 1

    @property
    def facts(self) -> dict[str, Any]:
        """What a table says of it."""
        raise NotImplementedError

    def mass(self, g: Coefficient = one) -> Matrix:
        """∫ g u v in the weight of the axis."""
        raise NotImplementedError

    def generator(self) -> Matrix:
        """∫ v L u in the weight of the axis, L the generator of the process along it."""
        raise NotImplementedError

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> Matrix:
        """∂/∂θ of `mass(g)`, for None of `generator()`, where the noise changes and the functions of ξ do not."""
        raise NotImplementedError

    def matrix(self, g: Coefficient | None, change: NoiseDerivative | None = None) -> Matrix:
        """`mass(g)`, or `generator()` for None, made once; for a change of the noise `changed(change, g)`."""
        if (g, change) not in self._matrices:
            made = (self.generator() if g is None else self.mass(g)) if change is None else self.changed(change, g)
            self._matrices[g, change] = made
        return self._matrices[g, change]

    @cached_property
    def _matrices(self) -> dict[tuple[Coefficient | None, NoiseDerivative | None], Matrix]:
        return {}

    def projection(self, other: Any) -> Matrix:
        """The matrix that takes a function on another axis to its projection on this one, shape (size, other.size)."""
        raise NotImplementedError

    def new_in(self, coarse: Any) -> Mask:
        """Which functions one of lower degrees does not have, shape (size,)."""
        return np.asarray(self.modes > np.max(coarse.modes))

    def enriched(self) -> Self:
        """The next finer one."""
        return self

    def doubled(self) -> Self:
        """About twice as many functions, where nothing is known yet."""
        return self

    def raised(self) -> Self:
        """One function more in each cell, where what a cell lacks harms others."""
        return self

    def refined(self, effects: ModeEffects, share: float, may_coarsen: bool) -> Self:
        """One that all together should lack no more than a share."""
        return self


@dataclass(frozen=True, eq=False)
class DividedAxis(Axis):
    """Elements of a degree of their own in each cell.

    Attributes:
        lines: the vertices, shape (m + 1,).
        degrees: the degree in each cell, shape (m,).
    """

    lines: FloatArray = field()
    degrees: IntArray

    def stored(self, matrix: Matrix) -> Matrix:
        """A matrix as those of the axis are: an array where it is small."""
        return matrix if self.size > MAX_DENSE_UNKNOWNS else dense(matrix)

    def on(self, lines: FloatArray, degrees: IntArray) -> Self:
        """The axis with other cells."""
        return replace(self, lines=lines, degrees=degrees)

    def enriched(self) -> Self:
        """Two degrees more; where there are none left, cells are halved."""
        return self.doubled() if np.max(self.degrees) + 2 > MAX_DEGREE else self.on(self.lines, self.degrees + 2)

    def doubled(self) -> Self:
        return self.on(halved(self.lines), np.repeat(self.degrees, 2))

    def raised(self) -> Self:
        return self.on(self.lines, np.minimum(self.degrees + 1, MAX_DEGREE))

    def refined(self, effects: ModeEffects, share: float, may_coarsen: bool) -> Self:
        return self.on(*split(self.lines, effects, share, may_coarsen))


def along(factors: Sequence[Matrix | None], table: FloatArray) -> FloatArray:
    """A table with a matrix applied along each of its axes, from the last; None leaves an axis as it is."""
    if table.ndim == 2:
        first, last = factors
        table = table if last is None else np.asarray(table @ last.T)
        return table if first is None else first @ table
    for axis in range(len(factors) - 1, -1, -1):
        if (factor := factors[axis]) is not None:
            moved = np.moveaxis(table, axis, 0)
            image = factor @ moved.reshape(len(moved), -1)
            table = np.moveaxis(image.reshape(-1, *moved.shape[1:]), 0, axis)
    return table


@dataclass(frozen=True, eq=False)
class KroneckerSum:
    """Σ Φ_k ⊗ Ξ_k ⊗ …, the factors kept apart; vectors are those of functions on φ × ξ × …, the first axis slowest.

    Attributes:
        terms: for each term a square matrix for each axis, arrays or sparse.
        unit: ∫ u v of the first axis; None where it is the identity.
    """

    terms: Sequence[tuple[Matrix, ...]]
    unit: Matrix | None = None

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """The number of functions along each axis."""
        return tuple(factor.shape[0] for factor in self.terms[0])

    @property
    def size(self) -> int:
        """The number of all functions."""
        return math.prod(self.shape)

    def __matmul__(self, vector: FloatArray) -> FloatArray:
        table = vector.reshape(self.shape)
        if len(self.shape) == 2:  # by far the most products of a solve
            return np.ravel(sum(first @ (table @ last.T) for first, last in self.terms))
        return np.ravel(sum(along(term, table) for term in self.terms))

    def images(self, tables: FloatArray) -> FloatArray:
        """The images of several vectors, each as a table, shape (count, *shape)."""
        if len(self.shape) == 2 and not self.is_sparse:
            return np.asarray(sum(first @ (tables @ last.T) for first, last in self.terms))
        return np.stack([(self @ np.ravel(table)).reshape(self.shape) for table in tables])

    @property
    def T(self) -> KroneckerSum:
        """The transpose."""
        return KroneckerSum([tuple(factor.T for factor in term) for term in self.terms], self.unit)

    def __abs__(self) -> KroneckerSum:
        """A bound on the absolute values."""
        return KroneckerSum([tuple(abs(factor) for factor in term) for term in self.terms], self.unit)

    @cached_property
    def norm(self) -> float:
        """A bound on the largest sum of the absolute values of a column."""
        return float(sum(np.prod([abs(factor).sum(axis=0).max() for factor in term]) for term in self.terms))

    def shifted(self, shift: float) -> KroneckerSum:
        """The sum less `shift` · 1 ⊗ Ξ₀ ⊗ …, Ξ₀ ⊗ … being what the first term has beside its φ-matrix."""
        (phase, *noises), *others = self.terms
        unit = self.unit
        if unit is None:
            unit = identity(phase.shape[0], format="csr") if issparse(phase) else np.eye(phase.shape[0])
        return KroneckerSum([(phase - shift * unit, *noises), *others], self.unit)

    def on(self, axis: int, kept: Mask) -> KroneckerSum:
        """What it is on some functions of an axis, where a mask is true."""
        at = np.ix_(kept, kept)
        unit = self.unit if axis or self.unit is None else self.unit[at]
        terms = [tuple(each[at] if k == axis else each for k, each in enumerate(term)) for term in self.terms]
        return KroneckerSum(terms, unit)

    def with_last(self, axis: int) -> KroneckerSum:
        """The sum with another axis as the last one."""
        count = len(self.shape)
        if axis % count == count - 1:
            return self
        order = [*(k for k in range(count) if k != axis), axis]
        return KroneckerSum([tuple(term[k] for k in order) for term in self.terms])

    @cached_property
    def is_sparse(self) -> bool:
        return any(issparse(factor) for term in self.terms for factor in term)

    @cached_property
    def pairs(self) -> Sequence[tuple[Matrix, Matrix]]:
        """The terms with all factors but the last as one."""
        product = scipy.sparse.kron if self.is_sparse else np.kron
        return [(reduce(product, term[:-1]), term[-1]) for term in self.terms]

    @property
    def halves(self) -> tuple[int, int]:
        """The number of functions along the last axis, after that of all others."""
        last = self.shape[-1]
        return self.size // last, last

    def band(self, axis: int) -> int:
        """How many diagonals the matrices of an axis have on each side."""
        rows, columns = csc_matrix(sum(abs(csc_matrix(term[axis])) for term in self.terms)).nonzero()
        return int(np.max(np.abs(rows - columns), initial=0))

    def toarray(self) -> FloatArray:
        """The dense matrix, shape (size, size)."""
        m, n = self.halves
        befores, lasts = (np.stack([dense(pair[side]) for pair in self.pairs]) for side in (0, 1))
        products = befores.reshape(len(befores), -1).T @ lasts.reshape(len(lasts), -1)
        return products.reshape(m, m, n, n).transpose(0, 2, 1, 3).reshape(m * n, m * n)

    def tocsc(self) -> csc_matrix:
        """The sparse matrix."""
        return csc_matrix(sum(reduce(scipy.sparse.kron, term) for term in self.terms))
