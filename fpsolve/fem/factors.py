"""LU factors of a Kronecker sum, of the kind that its own factors make the cheapest."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, partial
from itertools import pairwise
from threading import RLock
from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dgemm
from scipy.sparse import csc_matrix, identity
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee, shortest_path
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.budget import SOLVE_SECONDS, charge
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.dense import DenseFactors, Factors
from fpsolve.fem.refined import RefinedFactors
from fpsolve.fem.rings import Ring, RingFactors, ring_gigabytes, ring_seconds
from fpsolve.signals import left_at_signals
from fpsolve.superlu import sparse_lu

MAX_DENSE_UNKNOWNS = 350
"""Below it one dense matrix is the fastest."""
MAX_BLOCK, MAX_BAND = 400, 6
"""Functions in a level, and diagonals on each side, up to which elimination by them is faster than SuperLU."""
MAX_THICK_BLOCK = 2000
"""The same with two noises, where SuperLU fills in more; then the last noise is the one with the most functions."""
MAX_LEVEL = 0.2
"""Share of the functions of the last axis that one level may have."""
LONG = 0.5
"""Seconds of a factorisation from which on it runs where it can be left."""
PLANE_SECONDS, PLANE_BYTES = 3e-7, 90.0
"""Of SuperLU for two axes, for an entry of the matrix."""
FRONT_SECONDS, FRONT_BYTES = 2.5e-10, 24.0
"""The same for more, for an unknown times the square of the width of a front, and times this width."""
SECONDS_PER_OPERATION = 5e-11
"""Of large dense matrices."""
SECONDS_PER_LEVEL = 2e-3
SECONDS_PER_ENTRY, BYTES_PER_ENTRY = 1e-7, 40
"""Of a sparse matrix that is made and put in another order."""
ROUGH_COST = 5e9
"""Operations of an elimination from which on single precision, with its refinements, is faster."""
LARGEST_GROWTH = 1e3
"""Of the entries, by the norm of all, in an elimination that does not exchange rows of different levels."""


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
        with _pools().limit(limits=1):
            yield
    finally:
        _limited.release()


@cache
def _pools() -> ThreadpoolController:
    return ThreadpoolController()


Levels = Sequence[Sequence[IntArray] | None]
"""For each axis the functions that are eliminated together, see `Axis`."""


class Plan(NamedTuple):
    """What makes factors, and what it takes: seconds of a processor and gigabytes, all that it needs for a while."""

    seconds: float
    gigabytes: float
    factorise: Callable[[], Factors]


def factorised(
    operator: KroneckerSum,
    levels: Levels = (),
    *,
    is_full: bool = False,
    ring: Ring | None = None,
) -> Factors:
    """LU factors of a sum. A pivot that vanishes is made tiny: next to an eigenvalue that is what is wanted.

    Args:
        operator: the sum.
        levels: for each axis the functions that are eliminated together, see `Axis`; nothing where none are.
        is_full: whether most functions of the first axis are coupled, so that no order of elimination spares anything.
        ring: the cells of the first axis, where only their end values couple them.

    Raises:
        OverBudget: what it takes is more than a number may still cost.
    """
    *others, last = plans(operator, levels, is_full=is_full, ring=ring)
    for plan in others:
        with suppress(SingularMatrix):
            return _made(plan, operator)
    return _made(last, operator)


def _made(plan: Plan, operator: KroneckerSum) -> Factors:
    charge(plan.seconds, plan.gigabytes, operator.size)
    return left_at_signals(plan.factorise) if plan.seconds > LONG else plan.factorise()


def plans(
    operator: KroneckerSum,
    levels: Levels = (),
    *,
    is_full: bool = False,
    ring: Ring | None = None,
) -> list[Plan]:
    """What factors of a sum there may be, the best ones first, each in the place of those that cannot be made."""
    if operator.size <= MAX_DENSE_UNKNOWNS and not operator.is_sparse:
        return [_dense(operator)]
    m, n = operator.halves
    if is_full:
        return _of_full(operator, levels)
    if len(operator.shape) == 2 and (not levels or levels[-1] is None):
        return _of_plane(operator, ring)
    if operator.is_sparse:
        return [_sparse(operator)]
    if len(operator.shape) == 3 and operator.shape[1] > n:
        swapped = KroneckerSum([(phase, last, first) for phase, first, last in operator.terms])
        inner = plans(swapped, levels and (levels[0], levels[2], levels[1]))
        return [each._replace(factorise=partial(SwappedFactors, operator.shape, each.factorise)) for each in inner]
    own = levels[-1] if levels else None
    if own is None and m <= MAX_THICK_BLOCK and operator.band <= MAX_BAND < n:
        return [_by_blocks(operator)]
    found, sparse = list[Plan](), _sparse(operator)
    if own is not None and m <= MAX_THICK_BLOCK:
        own = own or levels_of(operator)
        if max(level.size for level in own) <= MAX_LEVEL * n:
            found = [_by_levels(operator, along_last(operator, each), math.inf)[1] for each in (own, paired(own))]
    return [*(plan for plan in found if m <= MAX_BLOCK or plan.seconds < sparse.seconds), sparse]


def _of_plane(operator: KroneckerSum, ring: Ring | None) -> list[Plan]:
    """Of the phase and one noise: by blocks or cell by cell, what should take less time with four solves, or sparse."""
    (m, n), band = operator.shape, max(operator.band, 1)
    found = []
    if m <= MAX_BLOCK and band <= MAX_BAND and 2 * band < n:
        found.append(_by_blocks(operator))
    if ring is not None and len(ring.number) > 2 and band <= MAX_BAND:
        found.append(
            Plan(
                5e-4 + 2 * ring_seconds(operator, ring),
                ring_gigabytes(operator, ring),
                lambda: RefinedFactors(operator, RingFactors(operator, ring)),
            )
        )
    return [*sorted(found, key=lambda plan: plan.seconds), _sparse(operator)]


def _of_full(operator: KroneckerSum, levels: Levels) -> list[Plan]:
    """By levels of the first axis or of the last one, by blocks, or dense: what takes the fewest operations."""
    (m, n), band = operator.halves, operator.band
    found = [(_dense_cost(operator.size), _dense(operator))]
    if n > 2 and levels and levels[-1] is not None:
        found.append(_by_levels(operator, along_last(operator, levels[-1] or levels_of(operator))))
    elif 2 * band < n:
        cost = n * (_dense_cost(m) + 2 * band * (1 + band) * m**3)
        if cost > ROUGH_COST:
            groups = np.split(np.arange(n), range(max(band, 1), n, max(band, 1)))
            found.append(_by_levels(operator, along_last(operator, groups)))
        else:
            found.append((cost, _by_blocks(operator)))
    if levels and levels[0] is not None:
        found.append(_by_levels(operator, along_first(operator, levels[0])))
    return [plan for _, plan in sorted(found, key=lambda choice: choice[0])]


def _dense(operator: KroneckerSum) -> Plan:
    size = operator.size
    return Plan(SECONDS_PER_OPERATION * _dense_cost(size), 16e-9 * size**2, lambda: DenseFactors(operator.toarray()))


def _by_blocks(operator: KroneckerSum) -> Plan:
    """Of the factors there are 1 + 2 band blocks for each function, and the lower ones twice for a while."""
    (m, n), band = operator.halves, max(operator.band, 1)
    cube = 7e-11 if m <= MAX_BLOCK else 3.5e-11  # large blocks are faster
    seconds = n * (2.1e-5 + 5.6e-6 * band**2 + cube * (1 + band) ** 2 * m**3)
    gigabytes = 8e-9 * m**2 * (n * (1 + 3 * band) + 2 * len(operator.terms))
    return Plan(seconds, gigabytes, lambda: BlockFactors(operator.with_dense_first()))


def _sparse(operator: KroneckerSum) -> Plan:
    seconds, gigabytes = sparse_cost(operator)
    return Plan(seconds, gigabytes, lambda: SparseFactors(operator))


def _by_levels(
    operator: KroneckerSum, levels: Sequence[IntArray], rough_cost: float = ROUGH_COST
) -> tuple[float, Plan]:
    """Operations of an elimination by levels, in single precision from a number of them on."""
    sizes, entries = [level.size for level in levels], operator.entries
    cost = sum(_dense_cost(size) for size in sizes) + sum(2 * a**2 * b for a, b in pairwise(reversed(sizes)))
    share = 1.0 if cost < rough_cost else 0.5
    seconds = share * SECONDS_PER_OPERATION * cost + SECONDS_PER_ENTRY * entries + SECONDS_PER_LEVEL * len(sizes)
    numbers = share * (sum(size**2 for size in sizes) + 5 * max(sizes) ** 2)
    gigabytes = 1e-9 * (8 * numbers + BYTES_PER_ENTRY * entries) + pair_gigabytes(operator)
    if cost < rough_cost:
        return cost, Plan(seconds, gigabytes, lambda: LevelFactors(operator, levels))
    rough = partial(LevelFactors, operator, levels, np.float32)
    solves = 4 * SOLVE_SECONDS * gigabytes  # each of which is refined
    return cost, Plan(seconds + solves, gigabytes, lambda: RefinedFactors(operator, rough()))


def sparse_cost(operator: KroneckerSum) -> tuple[float, float]:
    """Seconds and gigabytes of SuperLU.

    Of two axes it fills in little. Of more it is as good as an elimination along the axis that makes narrow fronts.
    """
    size, entries = operator.size, operator.entries
    if len(operator.shape) == 2:
        return PLANE_SECONDS * entries, 1e-9 * PLANE_BYTES * entries
    width = min(bandwidth(each) * size // each.shape[0] for each in operator.patterns)
    gigabytes = 1e-9 * (FRONT_BYTES * size * width + BYTES_PER_ENTRY * entries) + pair_gigabytes(operator)
    return FRONT_SECONDS * size * width**2 + SECONDS_PER_ENTRY * entries, gigabytes


def pair_gigabytes(operator: KroneckerSum) -> float:
    """What `pairs` takes of more than two axes, as arrays and as sparse matrices."""
    is_of_arrays = len(operator.shape) > 2 and not operator.is_sparse
    return 12e-9 * operator.halves[0] ** 2 * len(operator.terms) * is_of_arrays


def bandwidth(pattern: csc_matrix) -> int:
    """How far apart coupled functions are in the order of Cuthill and McKee."""
    order = reverse_cuthill_mckee((pattern + pattern.T).tocsr(), symmetric_mode=True)
    place = np.argsort(order)
    rows, columns = pattern.nonzero()
    return int(np.max(np.abs(place[rows] - place[columns]), initial=0)) + 1


def _dense_cost(size: int) -> float:
    """Operations of an LU of a dense matrix."""
    return 2 / 3 * size**3


class BlockFactors:
    """Block elimination over the functions of the last axis, from the last, where noise relaxes fastest, on.

    `solve` takes several right sides, too, as columns.
    """

    def __init__(self, operator: KroneckerSum) -> None:
        self._shape, band = operator.halves, operator.band
        self._steps: list[tuple[DenseFactors, list[tuple[int, FloatArray, FloatArray]]]] = []
        blocks = {offset: operator.blocks(offset) for offset in range(-band, band + 1)}
        for i in range(self._shape[1] - 1, -1, -1):
            pivot = DenseFactors(blocks[0][i])
            others = range(i - 1, max(i - band, 0) - 1, -1)
            right = [blocks[j - i][j] for j in others]
            left = [pivot.right_quotient(blocks[i - j][j]) for j in others]
            for j, quotient in zip(others, left, strict=True):
                for k, row in zip(others, right, strict=True):
                    dgemm(-1.0, quotient, row, beta=1.0, c=blocks[k - j][min(j, k)], overwrite_c=1)
            self._steps.append((pivot, list(zip(others, right, left, strict=True))))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        rest = b.reshape(*self._shape, *b.shape[1:]).swapaxes(0, 1).copy()
        for i, (pivot, others) in zip(range(len(rest) - 1, -1, -1), self._steps, strict=True):
            if transposed:
                rest[i] = pivot.solve(rest[i], transposed=True)
            for j, right, left in others:
                rest[j] -= right.T @ rest[i] if transposed else left @ rest[i]
        for i, (pivot, others) in enumerate(reversed(self._steps)):
            for j, right, left in others:
                rest[i] -= left.T @ rest[j] if transposed else right @ rest[j]
            if not transposed:
                rest[i] = pivot.solve(rest[i])
        return rest.swapaxes(0, 1).reshape(b.shape)


class SwappedFactors:
    """Those of a sum of three factors with the two last ones exchanged."""

    def __init__(self, shape: tuple[int, ...], factorise: Callable[[], Factors]) -> None:
        self._shape, self._inner = shape, factorise()

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        phase, first, last = self._shape
        swapped = b.reshape(phase, first, last).transpose(0, 2, 1).ravel()
        found = self._inner.solve(swapped, transposed=transposed)
        return found.reshape(phase, last, first).transpose(0, 2, 1).ravel()


class LevelFactors:
    """Block elimination over levels, from the last on: the matrix only couples neighbours.

    Args:
        operator: the sum.
        levels: the unknowns of each level.
        precision: of the factors.

    Raises:
        SingularMatrix: that of one level alone is: functions of what noise moves only by way of others.
    """

    def __init__(self, operator: KroneckerSum, levels: Sequence[IntArray], precision: type = float) -> None:
        self._order = np.concatenate(levels)
        ends = np.cumsum([0, *(level.size for level in levels)])
        self._parts = [slice(*pair) for pair in pairwise(ends.tolist())]
        matrix = operator.tocsc()[:, self._order].tocsr()[self._order]
        rows = [matrix[part] for part in self._parts]
        self._up = [row[:, part] for row, part in zip(rows, self._parts[1:], strict=False)]
        self._down = [row[:, part] for row, part in zip(rows[1:], self._parts, strict=False)]
        self._pivots: list[DenseFactors] = []
        for i in range(len(rows) - 1, -1, -1):
            rest = rows[i][:, self._parts[i]].astype(precision).toarray(order="F")
            if self._pivots:
                touched = np.unique(self._down[i].indices)
                below = self._down[i][:, touched].astype(precision).toarray(order="F")
                rest[:, touched] -= self._up[i].astype(precision).toarray() @ self._pivots[-1].solve(below)
            if not np.abs(rest).max() < LARGEST_GROWTH * operator.norm:
                raise SingularMatrix("the pivot of a level is singular")
            self._pivots.append(DenseFactors(rest))
        self._pivots.reverse()

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        up, down = self._up, self._down
        if transposed:
            up, down = ([each.T for each in side] for side in (down, up))
        sorted_b = b[self._order]
        rest = [sorted_b[part] for part in self._parts]
        for i in range(len(rest) - 1, 0, -1):
            rest[i - 1] -= up[i - 1] @ self._pivots[i].solve(rest[i], transposed=transposed)
        for i, pivot in enumerate(self._pivots):
            if i:
                rest[i] -= down[i - 1] @ rest[i - 1]
            rest[i] = pivot.solve(rest[i], transposed=transposed)
        found = np.empty_like(b)
        found[self._order] = np.concatenate(rest)
        return found


def along_first(operator: KroneckerSum, levels: Sequence[IntArray]) -> list[IntArray]:
    """The unknowns of levels of the first axis."""
    others = operator.size // operator.shape[0]
    return [np.add.outer(others * level, np.arange(others)).ravel() for level in levels]


def along_last(operator: KroneckerSum, levels: Sequence[IntArray]) -> list[IntArray]:
    """The unknowns of levels of the last axis."""
    m, n = operator.halves
    return [np.add.outer(level, n * np.arange(m)).ravel() for level in levels]


def levels_of(operator: KroneckerSum) -> list[IntArray]:
    """The functions of the last axis by how many of its couplings lead to the first one, or one of each part."""
    pattern = operator.patterns[-1]
    starts = np.unique(connected_components(pattern)[1], return_index=True)[1]
    distance = np.min(shortest_path(pattern + pattern.T, method="D", unweighted=True, indices=starts), axis=0)
    return [np.flatnonzero(distance == d) for d in range(int(distance.max()) + 1)]


def paired(levels: Sequence[IntArray]) -> list[IntArray]:
    """Two levels in one, the last two, and so on."""
    count = len(levels)
    return [np.concatenate(levels[max(end - 2, 0) : end]) for end in range(2 - count % 2, count + 1, 2)]


class SparseFactors:
    """SuperLU, ordered for a symmetric pattern and pivoting only where it must: half the time and the fill-in."""

    def __init__(self, operator: KroneckerSum) -> None:
        matrix = operator.tocsc()
        try:
            self._lu = sparse_lu(matrix, diag_pivot_thresh=0.01)
        except SingularMatrix:  # the shift is the eigenvalue to the last bit
            shifted = matrix + 1e-15 * abs(matrix).max() * identity(operator.size, format="csc")
            self._lu = sparse_lu(shifted, diag_pivot_thresh=0.01)

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        return np.asarray(self._lu.solve(b, trans="T" if transposed else "N"))
