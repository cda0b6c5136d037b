"""LU factors of a Kronecker sum: of one array, by levels along the noise, or by SuperLU."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache, partial, reduce
from threading import RLock
from typing import Any

import numpy as np
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csc_matrix, identity, kron
from scipy.sparse.linalg import SuperLU, splu
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray, dense
from fpsolve.budget import timed
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum

AT_ONCE = 200
"""Number of unknowns up to which LAPACK takes a matrix as a whole in less time than by levels."""
LARGEST_GROWTH = 1e3
"""Largest entry of an A_kk over the norm of the matrix, as rows of different levels are not exchanged."""

np.empty(
    2**22 - 2**10
)  # once 32 MB are freed, glibc keeps what arrays up to this size leave rather than maps each anew
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
        if operator.size <= AT_ONCE:
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

    def solve(self, b: FloatArray, *, transposed: bool = False, overwrites: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b, also in place of b; several b are columns."""
        return dgetrs(self._lu, self._pivots, b, trans=transposed, overwrite_b=overwrites)[0]


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
    """LU factors by levels along an axis, each function of which is coupled to a few next to it on both sides.

    In A_jk rows belong to the function j, and columns to k. From the last function on, which noise damps the most,

        A_ij ← A_ij − A_ik A_kk⁻¹ A_kj,      i, j < k.

    Args:
        operator: the sum.
        axis: its functions are the levels.

    Raises:
        SingularMatrix: an A_kk is singular, of functions that noise moves only by way of those of another level.
    """

    def __init__(self, operator: KroneckerSum, axis: int) -> None:
        self._shape, self._axis = operator.shape, axis
        terms = list(map(list, operator.terms))
        lasts = np.stack([dense(term.pop(axis)) for term in terms])
        rows, columns = np.nonzero(np.any(lasts, axis=0))
        band = int(np.max(np.abs(rows - columns), initial=0))
        others = np.stack([reduce(np.kron, map(dense, term)).T for term in terms])  # type: ignore[arg-type]
        blocks = {k: np.tensordot(lasts.diagonal(k, 1, 2).T, others, 1) for k in range(-band, band + 1)}

        def block(row: int, column: int) -> FloatArray:
            return blocks[column - row][min(row, column)].T

        self._steps = list[tuple[ArrayFactors, list[Any]]]()
        for k in reversed(range(len(lasts[0]))):
            pivot = ArrayFactors(block(k, k))
            before = [(j, block(j, k), block(k, j)) for j in range(max(k - band, 0), k)]
            for _, _, quotient in before:
                pivot.solve(quotient, overwrites=True)
            for i, up, _ in before:
                for j, _, quotient in before:
                    dgemm(-1.0, up, quotient, beta=1.0, c=block(i, j), overwrite_c=1)
            self._steps.append((pivot, before))
        if not np.abs(blocks[0]).max() < LARGEST_GROWTH * operator.norm:
            raise SingularMatrix("the pivot of a level is singular")

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b; several b are columns."""
        table = np.moveaxis(b.reshape(*self._shape, *b.shape[1:]), self._axis, 0)
        rest = table.reshape(len(self._steps), -1, *b.shape[1:]).copy()
        last = len(rest) - 1
        for k, (pivot, before) in enumerate(self._steps):
            own = rest[last - k]
            if not transposed:
                own[:] = pivot.solve(own)
            for j, up, quotient in before:
                rest[j] -= (quotient.T if transposed else up) @ own
        for own, (pivot, before) in zip(rest, reversed(self._steps), strict=True):
            for j, up, quotient in before:
                own -= (up.T if transposed else quotient) @ rest[j]
            if transposed:
                own[:] = pivot.solve(own, transposed=True)
        return np.moveaxis(rest.reshape(table.shape), 0, self._axis).reshape(b.shape)


Factors = ArrayFactors | SparseFactors | LevelFactors
"""LU factors of a matrix A; `solve` gives x of A x = b, or of Aᵀx = b."""
