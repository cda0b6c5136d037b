"""LU factors of a Kronecker sum: of one array, by levels along the noise, or by SuperLU."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache, partial, reduce
from itertools import pairwise
from threading import RLock

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csc_matrix, identity, kron
from scipy.sparse.linalg import SuperLU, splu
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray, IntArray, dense
from fpsolve.budget import timed
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import FEW_UNKNOWNS, KroneckerSum

LARGEST_GROWTH = 1e3
"""Largest entry of a P_k over the norm of the matrix, as rows of different levels are not exchanged."""

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


def factorised(operator: KroneckerSum, noise: int | None) -> Factors:
    """LU factors of a sum. A pivot that vanishes is made tiny: next to an eigenvalue that is what is wanted.

    Args:
        operator: the sum.
        noise: the axis whose functions are coupled to their neighbours alone; None where there is none.

    Raises:
        OverBudget: the seconds of a number have passed.
    """
    with timed(operator.size):
        if operator.size <= FEW_UNKNOWNS:
            return ArrayFactors(operator.toarray())
        if noise is not None:
            with suppress(SingularMatrix):
                return LevelFactors(operator, noise)
        return SparseFactors(operator)


def sparse_lu(matrix: csc_matrix, *, permc_spec: str = "MMD_AT_PLUS_A", **options: object) -> SuperLU:
    """SuperLU's factors, ordered for a symmetric pattern if nothing else is named. Raises `SingularMatrix`."""
    try:
        return splu(matrix, permc_spec=permc_spec, **options)
    except RuntimeError as failure:
        raise SingularMatrix(*failure.args) from failure


class ArrayFactors:
    """LAPACK's LU of an array. A pivot that vanishes is made tiny."""

    def __init__(self, matrix: FloatArray) -> None:
        self._lu, self._pivots, info = dgetrf(matrix, overwrite_a=1)
        if info > 0:
            pivots = np.einsum("ii->i", self._lu)
            pivots[pivots == 0] = np.finfo(float).eps * np.max(np.abs(pivots))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b; several b are columns."""
        return dgetrs(self._lu, self._pivots, b, trans=transposed)[0]


class SparseFactors:
    """SuperLU, pivoting only where it must.

    The unknowns are ordered for a symmetric pattern: half the time and the fill-in. Where all functions of an axis are
    coupled, the others alone are ordered, which takes half of the time once more.
    """

    def __init__(self, operator: KroneckerSum) -> None:
        patterns = [sum(abs(csc_matrix(each)) for each in axis) for axis in zip(*operator.terms, strict=True)]
        coupled = [k for k, each in enumerate(patterns) if each.nnz > 0.5 * each.shape[0] ** 2]
        order, rule = np.arange(operator.size).reshape(operator.shape), "MMD_AT_PLUS_A"
        if coupled:
            rule = "NATURAL"
            graph = reduce(kron, [np.eye(1) if k in coupled else each for k, each in enumerate(patterns)])
            nodes = np.argsort(sparse_lu(csc_matrix(graph + 2 * graph.sum() * identity(graph.shape[0]))).perm_c)
            order = np.moveaxis(order, coupled, range(-len(coupled), 0)).reshape(nodes.size, -1)[nodes]
        self._order = order.ravel()
        matrix = operator.tocsc()[self._order][:, self._order]
        factorise = partial(sparse_lu, permc_spec=rule, diag_pivot_thresh=0.01)
        try:
            self._lu = factorise(matrix)
        except SingularMatrix:  # the shift is the eigenvalue to the last bit
            self._lu = factorise(matrix + 1e-15 * abs(matrix).max() * identity(matrix.shape[0], format="csc"))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b."""
        found = np.empty_like(b)
        found[self._order] = self._lu.solve(b[self._order], trans="T" if transposed else "N")
        return found


class LevelFactors:
    """LU factors by levels along an axis, of functions that are coupled to those of the next levels only.

    The matrix is block tridiagonal: D_k, with U_k above and L_k below. From the last level on, of the functions that
    noise damps the most,

        P_k = D_k − U_k P_{k+1}⁻¹ L_k.

    Args:
        operator: the sum.
        axis: its functions are in the levels, in each as many as its matrices have diagonals on one side.

    Raises:
        SingularMatrix: a P_k is singular, of functions that noise moves only by way of those of another level.
    """

    def __init__(self, operator: KroneckerSum, axis: int) -> None:
        self._shape, self._axis = operator.shape, axis
        terms = list(map(list, operator.terms))
        lasts = np.stack([dense(term.pop(axis)) for term in terms])
        count, most = len(lasts[0]), LARGEST_GROWTH * operator.norm
        m, (rows, columns) = operator.size // count, np.nonzero(np.any(lasts, axis=0))
        befores = np.empty((len(terms), m**2))
        for before, others in zip(befores, terms, strict=True):
            before[:] = reduce(np.kron, map(dense, others)).T.ravel()  # type: ignore[arg-type]
        band = max(1, int(np.max(np.abs(rows - columns), initial=0)))
        groups = np.split(np.arange(count), range(count % band or band, count, band))
        ends = m * np.cumsum([0, *(group.size for group in groups)])
        self._parts = [slice(*pair) for pair in pairwise(ends.tolist())]

        def between(rows: IntArray, columns: IntArray) -> FloatArray:
            table = lasts[:, rows[:, None], columns].reshape(len(lasts), -1).T @ befores
            ordered = table.reshape(rows.size, columns.size, m, m).transpose(1, 2, 0, 3)
            return np.asarray(ordered.reshape(m * columns.size, m * rows.size).T, order="F")

        self._up = [between(group, after) for group, after in pairwise(groups)]
        self._pivots, self._quotients = list[ArrayFactors](), list[FloatArray]()
        for k in range(len(groups) - 1, -1, -1):
            rest = between(groups[k], groups[k])
            if self._pivots:
                self._quotients.insert(0, self._pivots[0].solve(between(groups[k + 1], groups[k])))
                rest -= self._up[k] @ self._quotients[0]
            if not np.abs(rest).max() < most:
                raise SingularMatrix("the pivot of a level is singular")
            self._pivots.insert(0, ArrayFactors(rest))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b; several b are columns."""
        table = np.moveaxis(b.reshape(*self._shape, *b.shape[1:]), self._axis, 0)
        rest = table.reshape(b.shape).copy()
        upward, downward = (self._quotients, self._up) if transposed else (self._up, self._quotients)
        for k in range(len(self._parts) - 1, -1, -1):
            own, last = self._parts[k], self._parts[k - 1]
            if not transposed:
                rest[own] = self._pivots[k].solve(rest[own])
            if k:
                rest[last] -= upward[k - 1].T @ rest[own] if transposed else upward[k - 1] @ rest[own]
        for k, own in enumerate(self._parts):
            if k:
                known = rest[self._parts[k - 1]]
                rest[own] -= downward[k - 1].T @ known if transposed else downward[k - 1] @ known
            if transposed:
                rest[own] = self._pivots[k].solve(rest[own], transposed=True)
        return np.moveaxis(rest.reshape(table.shape), 0, self._axis).reshape(b.shape)


Factors = ArrayFactors | SparseFactors | LevelFactors
"""LU factors of a matrix A; `solve` gives x of A x = b, or of Aᵀx = b."""
