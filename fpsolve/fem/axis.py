"""Axes, the functions along one direction each, what tells that there should be more, and operators on their products.

A function of (φ, ξ, …) has one coefficient for each choice of a function on every axis, the first axis slowest; an
operator f(φ)·g(ξ)·… is a Kronecker product of one matrix for each axis, others are sums Σ Φ_k ⊗ Ξ_k ⊗ … of them.

How fast the effect of a cell's highest modes on Λ falls with their degree is how fast the cell converges, and decides
between a higher degree and smaller cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, reduce
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import scipy.sparse
from scipy.sparse import csc_matrix

from fpsolve.arrays import Coefficient, FloatArray, IntArray, Mask, Matrix, dense, one
from fpsolve.fem.element import halved, middles
from fpsolve.fem.mesh import MAX_DEGREE
from fpsolve.model.noise import NoiseDerivative

NO_LINES = np.zeros(0)
FEW_UNKNOWNS = 600
"""Largest number of functions of an axis with cells, or of a space, whose matrices are arrays: else they are sparse."""
HALVING = 2 * math.log(2)
"""Rate per degree by which the logarithm of an effect falls faster in half a cell."""
LEAST_DEGREE = 4
"""Lowest degree to which a cell is made coarser."""
SPLIT_DEGREE = 6
"""Lowest degree at which the highest modes tell whether halves of a cell take fewer functions."""
MOST_DEGREE = 14
"""Highest degree of a cell: beyond, it is halved."""
LEAST_FALL = 0.3
"""Least fall of the logarithm of an effect with each degree."""
NO_FALL = 3 / 7
"""Ratio of the effects of two and of four modes where no fall is seen: then thrice the first may be left."""


@dataclass(frozen=True, eq=False)
class ModeEffects:
    """How much of Λ each cell of one axis owes to its highest modes.

    Attributes:
        degrees: of the cells, shape (cells,).
        highest: the effects of the highest mode, of the two highest and so on up to four, shape (4, cells).
        slowest: two more modes are taken to leave this share of the effect of the highest two at least.
    """

    degrees: IntArray
    highest: FloatArray
    slowest: float = 0.0

    @property
    def of_cells(self) -> FloatArray:
        """Estimate of what each cell lacks, half way from the effect of two modes to what its slower fall predicts.

        Where e falls slowly, by r with two degrees, effects are its differences, (1/r − 1)e and (1/r² − 1)e of two and
        four modes: of their ratio q is r = q/(1 − q), and e is q/(1 − 2q) times the effect of two.
        """
        of_two = np.minimum(self.highest[1] / np.maximum(self.highest[3], 1e-300), NO_FALL)
        left = np.maximum(np.clip(np.sqrt(self._left_by_two), self.slowest, 1.0), of_two / (1 - 2 * of_two))
        return self.highest[1] * left

    @property
    def error(self) -> float:
        return float(np.sum(self.of_cells))

    @property
    def fall(self) -> FloatArray:
        """By how much the logarithm of the effect falls with each degree, shape (cells,)."""
        return np.maximum(-0.5 * np.log(np.maximum(self._left_by_two, 1e-300)), LEAST_FALL)

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


def split(lines: FloatArray, effects: ModeEffects, share: float) -> tuple[FloatArray, IntArray]:
    """Lines, and a degree for each cell, with which all n cells together should lack no more than a share.

    What cells lack has both signs, so that it is taken to add up like √n: each cell may lack a share of 1/√n. A cell is
    halved where its halves take fewer unknowns, as effects fall faster in them.
    """
    rate, needed = effects.fall, effects.needed(max(share, 1e-290) / math.sqrt(effects.degrees.size))
    in_half = needed * rate / (rate + HALVING)
    is_split = (2 * in_half + 2 < needed + 1) & (effects.degrees >= SPLIT_DEGREE) & (needed > effects.degrees)
    is_split |= needed > MOST_DEGREE
    degrees = np.ceil(np.where(is_split, in_half, needed))
    degrees = np.clip(degrees, np.maximum(LEAST_DEGREE, effects.degrees - 4), effects.degrees + 4)
    degrees = np.repeat(np.minimum(degrees, MOST_DEGREE).astype(int), np.where(is_split, 2, 1))
    return np.sort(np.concatenate([lines, middles(lines)[is_split]])), degrees


class Rule(NamedTuple):
    """The functions of an axis at the points of a quadrature rule, or at the states of a noise.

    Attributes:
        points: of what the functions are of, shape (n,) or (2, n).
        measure: ∫ of the weight of the axis there, shape (n,).
        values: without the factor of the axis, shape (n, size).
    """

    points: FloatArray
    measure: FloatArray
    values: Any


class FunctionAxis:
    """What terms of a generator, error estimates and pictures ask of the functions along one direction.

    An axis is a frozen choice of functions. Its tables are made when they are first asked for, and are not pickled.

    Attributes:
        lines: the vertices of cells; none where the functions are of the whole axis.
        most_unknowns: of a space with this first axis and no axis with a band, with which a process takes 1.5 GB.
        band: how many functions next to it on each side one is coupled to by ξ; 0 where there is no such order.
        slowest: two more modes are taken to leave this share of the effect of the highest two at least.
        slope: the tilt over p: s/p of the factor exp(s z) that every function carries.
        turns: 2 for φ on the half circle, of which T* is normalised on both; 1 otherwise.
        nested: the matrix to the coefficients of a hierarchical basis, in which the functions up to each degree span
            the space of that degree; None where the basis is one.
        is_orthonormal: whether ∫ u v of its functions is the identity.
        is_followed: whether pairs are followed from p = 0 on; signs of T and T*, not resolved enough, then decide less.
        has_adjoint: whether T* is a function: otherwise its signs alone need not be right.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]
    lines = NO_LINES
    most_unknowns = 35_000
    band = 0
    slowest, slope, turns = 0.0, 0.0, 1
    nested: Any = None
    is_orthonormal = False
    is_followed, has_adjoint = False, True

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

    @cached_property
    def highest(self) -> tuple[Mask, Mask, IntArray]:
        """Which functions are of the four highest modes of a cell, which of these of each of the four, and all degrees.

        Shapes (size,), (4, kept functions), from the highest mode on, and (cells,).
        """
        degrees = np.zeros(self.cells.max() + 2, dtype=int)  # the last is of no cell
        np.maximum.at(degrees, self.cells, self.modes)
        below = np.where(self.cells >= 0, degrees[self.cells] - self.modes, 4)
        return below < 4, below[below < 4] == np.arange(4)[:, None], degrees[:-1]

    @property
    def rule(self) -> Rule:
        """The functions at points of their own, at which signs are looked at."""
        raise NotImplementedError

    @cached_property
    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor of the axis, shape (size,); by default it is the first."""
        return np.eye(1, self.size)[0]

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

    def new_in(self, coarse: Any) -> Mask:
        """Which functions one of lower degrees does not have, shape (size,)."""
        return self.modes > np.max(coarse.modes)

    def enriched(self) -> Self:
        """The next finer one."""
        return self

    def doubled(self) -> Self:
        """About twice as many functions, where nothing is known yet."""
        return self

    def raised(self) -> Self:
        """One function more in each cell, where what a cell lacks harms others."""
        return self

    def refined(self, effects: ModeEffects, share: float) -> Self:
        """One that all together should lack no more than a share."""
        return self


@dataclass(frozen=True, eq=False)
class DividedAxis(FunctionAxis):
    """Elements of a degree of their own in each cell.

    Attributes:
        lines: the vertices, shape (m + 1,).
        degrees: the degree in each cell, shape (m,).
    """

    lines: FloatArray = field()
    degrees: IntArray

    def stored(self, matrix: Matrix) -> Matrix:
        """A matrix as those of the axis are: an array where it is small."""
        return matrix if self.size > FEW_UNKNOWNS else dense(matrix)

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

    def refined(self, effects: ModeEffects, share: float) -> Self:
        return self.on(*split(self.lines, effects, share))


def along(factors: Sequence[Matrix | None], tables: FloatArray) -> FloatArray:
    """Tables, in the last axes of an array, with a matrix applied along each axis; None leaves one as it is."""
    if tables.ndim == 2:  # by far the most products of a solve
        first, last = factors
        tables = tables if last is None else np.asarray(tables @ last.T)
        return tables if first is None else first @ tables
    for axis, factor in enumerate(factors, tables.ndim - len(factors)):
        if factor is not None:
            moved = tables.swapaxes(0, axis)
            image = factor @ moved.reshape(len(moved), -1)
            tables = image.reshape(-1, *moved.shape[1:]).swapaxes(0, axis)
    return tables


class KroneckerSum:
    """Σ Φ_k ⊗ Ξ_k ⊗ …, the factors kept apart.

    It multiplies vectors of functions on φ × ξ × …, the first axis slowest, or such tables, or a stack of either.

    Attributes:
        terms: for each term a square matrix for each axis, arrays or sparse.
        shape: the number of functions along each axis.
        size: the number of all functions.
    """

    def __init__(self, terms: Sequence[Sequence[Matrix]]) -> None:
        self.terms = terms
        self.shape = tuple(factor.shape[0] for factor in terms[0])
        self.size = math.prod(self.shape)

    def __matmul__(self, vectors: FloatArray) -> FloatArray:
        tables = vectors.reshape(self.shape if vectors.size == self.size else (-1, *self.shape))
        return np.reshape(sum(along(term, tables) for term in self.terms), vectors.shape)

    def each(self, function: Callable[[Matrix], Matrix]) -> KroneckerSum:
        """The sum with a function of every factor in place of it."""
        return KroneckerSum([tuple(map(function, term)) for term in self.terms])

    @property
    def T(self) -> KroneckerSum:
        """The transpose."""
        return self.each(np.transpose)

    def __abs__(self) -> KroneckerSum:
        """A bound on the absolute values."""
        return self.each(abs)

    @cached_property
    def norm(self) -> float:
        """A bound on the largest sum of the absolute values of a column."""
        return float(sum(math.prod(abs(factor).sum(axis=0).max() for factor in term) for term in self.terms))

    def on(self, axis: int, kept: Mask) -> KroneckerSum:
        """What it is on some functions of an axis, where a mask is true."""
        at = np.ix_(kept, kept)
        return KroneckerSum([[each[at] if k == axis else each for k, each in enumerate(term)] for term in self.terms])

    def toarray(self) -> FloatArray:
        """The dense matrix, shape (size, size), by columns."""
        first = np.stack([dense(phase) for phase, *_ in self.T.terms])
        others = np.stack([reduce(np.kron, map(dense, each)) for _, *each in self.T.terms])  # type: ignore[arg-type]
        found = np.tensordot(first, others, (0, 0)).swapaxes(1, 2)
        return found.reshape(self.size, self.size).T

    def tocsc(self) -> csc_matrix:
        """The sparse matrix."""
        return csc_matrix(sum(reduce(scipy.sparse.kron, term) for term in self.terms))
