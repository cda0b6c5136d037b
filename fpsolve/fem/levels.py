"""Block elimination of a Kronecker sum along one of its axes.

With the functions of the axis in levels, each coupled to its neighbours only, the matrix is block tridiagonal: D_k,
with U_k above and L_k below. From the last level on, of the functions that noise damps the most,

    P_k = D_k − U_k P_{k+1}⁻¹ L_k.

Of sparse matrices U_k may reach beyond the next level, where impacts take paths: F to the level j adds −F P_j⁻¹ L_{j−1}
to what leads to the level before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix, identity, issparse
from scipy.sparse.csgraph import connected_components, shortest_path

from fpsolve.arrays import FloatArray, IntArray, Matrix, dense
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.dense import ArrayFactors, dense_operations

LARGEST_GROWTH = 1e3
"""Largest entry of a P_k over the norm of the matrix, as rows of different levels are not exchanged."""
DENSE_SHARE = 0.1
"""Share of the entries of all blocks that do not vanish, from which on blocks are arrays."""
LEVEL_OPERATIONS = 6e5
"""Number of operations that take the time of the calls for a level of arrays, 20 µs."""
SPARSE_LEVEL_OPERATIONS = 1e7
"""Number of operations that take the time of the calls for a level of sparse matrices, 0.35 ms."""
ENTRY_OPERATIONS = 2000.0
"""Number of operations that take the time of making an entry of a sparse matrix and sorting it into levels, 70 ns."""
SHARE_OF_ELEMENTS = 0.35
"""Share of what one element is to the next that is no multiple of the rest, about."""
ALIKE = 1e-11
"""Largest difference of rows that are multiples of each other, over their size."""
ENTRY_BYTES = 40
"""Bytes of an entry of a sparse matrix, while it is sorted."""

Blocks = tuple[FloatArray, Matrix, Matrix]
"""D_k, U_k and L_k; the last two are empty for the last level. Sparse U_k are to all further levels."""


class LevelFactors:
    """LU factors by levels along an axis.

    Args:
        operator: the sum.
        groups: the functions of an axis in each level.
        axis: this axis.
        precision: of the factors.
    """

    def __init__(
        self, operator: KroneckerSum, groups: Sequence[IntArray], axis: int = -1, precision: type = float
    ) -> None:
        self._operator, self._axis, self._groups = operator.with_last(axis), axis, groups
        self._shape, self._precision = operator.shape, precision
        (m, _), entries, terms = self._operator.halves, operator.entries, len(operator.terms)
        sizes = [m * group.size for group in groups]
        self._parts = [slice(*pair) for pair in pairwise(np.cumsum([0, *sizes]).tolist())]
        squares, beside = sum(size**2 for size in sizes), sum(a * b for a, b in pairwise(sizes))
        is_filled = entries >= DENSE_SHARE * (squares + 2 * beside)
        self._is_dense = is_filled and not any(issparse(term[-1]) for term in self._operator.terms)
        share = 1.0 if precision is float else 0.5
        eliminated, between = sum(map(dense_operations, sizes)), sum(2 * a * b**2 for a, b in pairwise(sizes))
        operations = eliminated + (between if axis or self._is_dense else SHARE_OF_ELEMENTS * between)
        if self._is_dense:
            operations += sum(2 * a**2 * b for a, b in pairwise(sizes))
            self.operations = share * operations + LEVEL_OPERATIONS * len(sizes)
            self.gigabytes = 8e-9 * (share * squares + 2 * beside + terms * m**2 + 3 * max(sizes) ** 2)
        else:
            self.operations = share * operations + ENTRY_OPERATIONS * entries + SPARSE_LEVEL_OPERATIONS * len(sizes)
            self.gigabytes = 8e-9 * share * (squares + 5 * max(sizes) ** 2) + 1e-9 * ENTRY_BYTES * entries
            self.gigabytes += operator.pair_gigabytes

    def make(self) -> None:
        """Eliminate.

        Raises:
            SingularMatrix: a P_k is singular, of functions that noise moves only by way of those of another level.
        """
        most, self._pivots = LARGEST_GROWTH * self._operator.norm, list[ArrayFactors]()
        self._up, self._quotients = list[Matrix](), list[Matrix]()
        for rest, up, down in self._arrays() if self._is_dense else self._rows():
            if self._pivots:
                if self._is_dense:
                    quotient = self._pivots[-1].solve(down)
                    rest -= up @ quotient
                else:
                    up, down = self._fill(rest, up, down)
                self._up.append(up)
                self._quotients.append(quotient if self._is_dense else down)
            if not np.abs(rest).max() < most:
                raise SingularMatrix("the pivot of a level is singular")
            self._pivots.append(ArrayFactors(rest))
        for each in (self._pivots, self._up, self._quotients):
            each.reverse()

    def _arrays(self) -> Iterator[Blocks]:
        """The blocks as arrays in Fortran order, from the last level on."""
        m, _ = self._operator.halves
        befores = np.stack([dense(before).T.ravel() for before, _ in self._operator.pairs])
        lasts = np.stack([dense(last) for _, last in self._operator.pairs])

        def between(rows: IntArray, columns: IntArray) -> FloatArray:
            table = lasts[:, rows[:, None], columns].reshape(len(lasts), -1).T @ befores
            ordered = table.reshape(rows.size, columns.size, m, m).transpose(1, 2, 0, 3)
            return np.asarray(ordered.reshape(m * columns.size, m * rows.size).T, dtype=self._precision, order="F")

        after = self._groups[-1][:0]
        for group in reversed(self._groups):
            yield between(group, group), between(group, after), between(after, group)
            after = group

    def _rows(self) -> Iterator[Blocks]:
        """D_k as an array, U_k and L_k sparse, from the last level on."""
        order = np.concatenate(self._groups)
        terms = [(own[order][:, order], *others) for *others, own in self._operator.terms]
        matrix = KroneckerSum(terms).T.tocsc().T
        after = slice(0, 0)
        for part in reversed(self._parts):
            rows = matrix[part]
            own: FloatArray = np.asarray(rows[:, part].toarray(order="F"), dtype=self._precision, order="F")
            yield own, rows[:, part.stop :], matrix[after][:, part]
            after = part

    def _fill(self, rest: FloatArray, up: csr_matrix, down: csr_matrix) -> tuple[csr_matrix, csr_matrix]:
        """Take U_k P_{k+1}⁻¹ L_k from an array, and give back U_k, with what goes by way of further levels, and L_k."""
        size = down.shape[0]
        if self._axis:  # no function of a noise is to others a multiple of another one
            up, down = (each.astype(self._precision) for each in (up[:, :size], down))
            touched = np.unique(down.indices)
            rest.T[touched] -= (up @ self._pivots[-1].solve(down[:, touched].toarray(order="F"))).T
            return up, down
        (columns, of_columns), (rows, of_rows) = multiples(down.T), multiples(up[:, :size])
        up, down, of_columns, of_rows = (each.astype(self._precision) for each in (up, down, of_columns, of_rows))
        quotient = self._pivots[-1].solve(down[:, columns].toarray(order="F"))
        product = of_rows @ np.asarray(up[rows][:, :size] @ quotient)
        if up.shape[1] > size:
            rows, more = self._by_way(up)
            product[rows] += more[:, :size] @ quotient
            at = np.ones(rows.size, dtype=more.dtype), (rows, np.arange(rows.size))
            up = up + csr_matrix(at, (up.shape[0], rows.size)) @ csr_matrix(more)
        rest.T[:] -= of_columns @ product.T
        return up, down

    def _by_way(self, up: csr_matrix) -> tuple[IntArray, FloatArray]:
        """What goes by way of levels beyond the next one: rows of U_k, and what these get, to all further levels."""
        starts = np.cumsum([0, *(each.size for each in reversed(self._pivots))])
        rows = np.unique(up[:, starts[1] :].nonzero()[0])
        old = up[rows].toarray()
        table = old.copy()
        for k in range(len(self._pivots) - 1, 0, -1):
            before, own = slice(starts[k - 1], starts[k]), slice(starts[k], starts[k + 1])
            if (reached := np.any(table[:, own], axis=1)).any():
                onto = self._pivots[-1 - k].solve(table[reached, own].T, transposed=True)
                table[reached, before] -= np.asarray(onto.T @ self._quotients[-k])
        return rows, table - old

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b; several b are columns."""
        order, axis = np.concatenate(self._groups), self._axis % len(self._shape)
        table = np.moveaxis(b.reshape(*self._shape, *b.shape[1:]), axis, 0)
        rest = table[order].reshape(b.shape).astype(self._precision)
        for i in range(len(self._parts) - 1, -1, -1):
            own, beyond = self._parts[i], self._beyond(i)
            if not transposed:
                rest[own] = self._pivots[i].solve(rest[own] - self._up[i] @ rest[beyond] if beyond else rest[own])
            elif i:
                rest[self._parts[i - 1]] -= self._quotient(i, rest[own], True)
        for i, own in enumerate(self._parts):
            if transposed:
                rest[own] = self._pivots[i].solve(rest[own], transposed=True)
                if beyond := self._beyond(i):
                    rest[beyond] -= self._up[i].T @ rest[own]
            elif i:
                rest[own] -= self._quotient(i, rest[self._parts[i - 1]], False)
        found = np.empty(table.shape)
        found[order] = rest.reshape(table.shape)
        return np.moveaxis(found, 0, axis).reshape(b.shape)

    def _beyond(self, i: int) -> slice | None:
        """The unknowns to which U_i leads."""
        start = self._parts[i].stop
        return slice(start, start + self._up[i].shape[1]) if i < len(self._up) else None

    def _quotient(self, i: int, x: FloatArray, transposed: bool) -> FloatArray:
        """P_i⁻¹ L_(i−1) x, or the transpose; of sparse matrices only L is kept."""
        kept = self._quotients[i - 1]
        if self._is_dense:
            return np.asarray((kept.T if transposed else kept) @ x)
        pivot = self._pivots[i]
        return np.asarray(kept.T @ pivot.solve(x, transposed=True) if transposed else pivot.solve(kept @ x))


def neighbours(operator: KroneckerSum, axis: int, levels: Sequence[IntArray] | None) -> list[IntArray]:
    """The functions of an axis in levels: those given, if there are none by their distance, for None by the band."""
    pattern = operator.patterns[axis]
    if levels is None:
        rows, columns = pattern.nonzero()
        band = max(int(np.max(np.abs(rows - columns), initial=0)), 1)
        return np.split(np.arange(operator.shape[axis]), range(band, operator.shape[axis], band))
    if levels:
        return list(levels)
    starts = np.unique(connected_components(pattern)[1], return_index=True)[1]
    distance = np.min(shortest_path(pattern + pattern.T, method="D", unweighted=True, indices=starts), axis=0)
    return [np.flatnonzero(distance == d) for d in range(int(distance.max()) + 1)]


def multiples(matrix: csr_matrix) -> tuple[IntArray, csr_matrix]:
    """Few rows, and S, such that matrix = S @ matrix[rows]: all others are their multiples, or 0.

    The penalty has such ones, as one jump of slopes couples all functions of two elements.
    """
    probes = matrix @ np.random.default_rng(0).standard_normal((matrix.shape[1], 2))
    filled = np.flatnonzero(probes[:, 0])
    ratio = probes[filled, 1] / probes[filled, 0]
    order = np.argsort(ratio)
    is_new = np.append(True, np.diff(ratio[order]) > ALIKE * np.abs(ratio[order][1:]))[: order.size]
    rows, group = filled[order[is_new]], np.cumsum(is_new) - 1
    sizes = probes[filled[order], 0] / probes[rows[group], 0]
    found = csr_matrix((sizes, (filled[order], group)), shape=(matrix.shape[0], rows.size))
    if abs(found @ matrix[rows] - matrix).max() <= ALIKE * abs(matrix).max():
        return rows, found
    return filled, identity(matrix.shape[0], format="csr")[:, filled]


def paired(groups: Sequence[IntArray]) -> list[IntArray]:
    """Two levels in one, the last two, and so on."""
    count = len(groups)
    return [np.concatenate(groups[max(end - 2, 0) : end]) for end in range(2 - count % 2, count + 1, 2)]
