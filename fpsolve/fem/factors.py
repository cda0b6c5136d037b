"""LU factors of a Kronecker sum, of the kind that takes the fewest operations."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, lru_cache
from threading import RLock

import numpy as np
from scipy.sparse import csc_matrix, identity
from scipy.sparse.csgraph import reverse_cuthill_mckee
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.budget import charge
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.dense import ArrayFactors, Factors, dense_operations
from fpsolve.fem.levels import ENTRY_BYTES, ENTRY_OPERATIONS, LevelFactors, neighbours, paired
from fpsolve.fem.refined import RefinedFactors
from fpsolve.fem.rings import Ring, RingFactors
from fpsolve.fem.wave_factors import WaveFactors
from fpsolve.superlu import sparse_lu

FEW_UNKNOWNS = 350
"""Largest number of unknowns of one dense matrix that is taken without counting what others take."""
LONG = 1e10
"""Number of operations, 0.35 s, from which on a factorisation may be rough."""
FRONT_OPERATIONS = 5.0
"""Number of operations that take the time of SuperLU for an unknown and the square of the width of a front, 0.18 ns."""
CELL_OPERATIONS = 6e3
"""Number of operations that take the time of SuperLU for an entry of a matrix of cells of φ and ξ, 0.2 µs."""
CELL_BYTES = 90.0
"""Bytes of SuperLU for such an entry."""
FRONT_BYTES = 24.0
"""Bytes of an unknown times the width of a front in SuperLU."""

_limited = RLock()


@contextmanager
def one_thread() -> Iterator[None]:
    """Keeps BLAS in the body from threads, which for the small blocks of an LU cost three times what they save.

    The limit is of the whole process: where bodies of several threads overlap, the first one sets it and lifts it.
    """
    if not _limited.acquire(blocking=False):
        yield
        return
    try:
        with _pools(len(sys.modules)).limit(limits=1):
            yield
    finally:
        _limited.release()


@lru_cache(maxsize=1)
def _pools(modules: int) -> ThreadpoolController:
    """Those of the libraries that are loaded with so many modules: a later one may bring another."""
    return ThreadpoolController()


Levels = Sequence[Sequence[IntArray] | None]
"""For each axis the functions that are eliminated together, see `Axis`."""


def factorised(
    operator: KroneckerSum,
    levels: Levels = (),
    *,
    is_full: bool = False,
    is_of_waves: bool = False,
    ring: Ring | None = None,
) -> Factors:
    """LU factors of a sum. A pivot that vanishes is made tiny: next to an eigenvalue that is what is wanted.

    Args:
        operator: the sum.
        levels: for each axis the functions that are eliminated together, see `Axis`; nothing where none are.
        is_full: whether most functions of the first axis are coupled, so that no order of elimination spares anything.
        is_of_waves: whether the first axis is of waves of φ.
        ring: the cells of the first axis, where only their end values couple them.

    Raises:
        OverBudget: what it takes is more than a number may still cost.
    """
    *others, last = candidates(operator, levels, is_full, ring, is_of_waves)
    for kind in others:
        try:
            return _factorise(kind, operator)
        except SingularMatrix:
            continue
    return _factorise(last, operator)


def _factorise(kind: Factors, operator: KroneckerSum) -> Factors:
    charge(kind.operations, kind.gigabytes, operator.size)
    kind.make()
    return kind


def candidates(
    operator: KroneckerSum, levels: Levels, is_full: bool, ring: Ring | None, is_of_waves: bool = False
) -> list[Factors]:
    """All kinds that there may be, by their operations: of a small matrix one dense array alone."""
    if operator.size <= FEW_UNKNOWNS and not operator.is_sparse:
        return [DenseFactors(operator)]
    found: list[Factors] = list(_ordered(operator, levels, is_full, ring))
    if is_of_waves and WaveFactors.may_take(operator):
        found.append(WaveFactors(operator))
    found.sort(key=lambda each: each.operations)
    is_of_cells = len(operator.shape) == 2 and (not levels or levels[-1] is None)
    whole = DenseFactors(operator) if is_full else SparseFactors(operator, is_of_cells=is_of_cells)
    if found and found[0].operations < ENTRY_OPERATIONS * operator.entries:  # so many are all that is sure of SuperLU
        return [*found, whole]
    return sorted([*found, whole], key=lambda each: each.operations)


def _ordered(operator: KroneckerSum, levels: Levels, is_full: bool, ring: Ring | None) -> Iterator[Factors]:
    """What goes cell by cell, or level by level along any axis, of directions refined, and in single precision, too.

    A level of directions that paths cross has pivots that may be small; those of the functions of a filter are too
    small for single precision.
    """
    if ring is not None and len(operator.shape) == 2 and len(ring.number) > 2:
        yield RefinedFactors(operator, RingFactors(operator, ring))
    for axis, own in enumerate(levels or [None] * len(operator.shape)):
        if axis or own is not None:
            groups = neighbours(operator, axis, own)
            for each in [groups, paired(groups)][: len(groups) - 1]:
                by_levels = LevelFactors(operator, each, axis)
                yield RefinedFactors(operator, by_levels) if is_full else by_levels
                if is_full and by_levels.operations > LONG:
                    yield RefinedFactors(operator, LevelFactors(operator, each, axis, np.float32))


class DenseFactors:
    """LU factors of all unknowns as one array."""

    def __init__(self, operator: KroneckerSum) -> None:
        self._operator = operator
        self.operations, self.gigabytes = dense_operations(operator.size), 16e-9 * operator.size**2

    def make(self) -> None:
        """Eliminate."""
        self._lu = ArrayFactors(self._operator.toarray())
        self.solve = self._lu.solve


class SparseFactors:
    """SuperLU, ordered for a symmetric pattern and pivoting only where it must: half the time and the fill-in.

    It is about as good as an elimination along the axis that makes narrow fronts, but fills in little of cells of a
    plane.
    """

    def __init__(self, operator: KroneckerSum, *, is_of_cells: bool = False) -> None:
        self._operator, self._is_of_cells = operator, is_of_cells

    @cached_property
    def operations(self) -> float:
        if self._is_of_cells:
            return CELL_OPERATIONS * self._operator.entries
        return FRONT_OPERATIONS * self._operator.size * self._width**2 + ENTRY_OPERATIONS * self._operator.entries

    @cached_property
    def gigabytes(self) -> float:
        operator = self._operator
        if self._is_of_cells:
            return 1e-9 * CELL_BYTES * operator.entries
        numbers = FRONT_BYTES * operator.size * self._width + ENTRY_BYTES * operator.entries
        return 1e-9 * numbers + operator.pair_gigabytes

    @cached_property
    def _width(self) -> int:
        """Of the narrowest fronts."""
        operator = self._operator
        return min(bandwidth(each) * operator.size // each.shape[0] for each in operator.patterns)

    def make(self) -> None:
        """Eliminate."""
        matrix = self._operator.tocsc()
        try:
            self._lu = sparse_lu(matrix, diag_pivot_thresh=0.01)
        except SingularMatrix:  # the shift is the eigenvalue to the last bit
            shifted = matrix + 1e-15 * abs(matrix).max() * identity(matrix.shape[0], format="csc")
            self._lu = sparse_lu(shifted, diag_pivot_thresh=0.01)

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b."""
        return np.asarray(self._lu.solve(b, trans="T" if transposed else "N"))


def bandwidth(pattern: csc_matrix) -> int:
    """How far apart coupled functions are in the order of Cuthill and McKee."""
    order = reverse_cuthill_mckee((pattern + pattern.T).tocsr(), symmetric_mode=True)
    place = np.argsort(order)
    rows, columns = pattern.nonzero()
    return int(np.max(np.abs(place[rows] - place[columns]), initial=0)) + 1
