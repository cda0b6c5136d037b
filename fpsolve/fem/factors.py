"""LU factors of a Kronecker sum, of the kind that its own factors make the cheapest."""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol

import numpy as np
from scipy.linalg.blas import dgemm, dtrsm
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import identity
from scipy.sparse.linalg import splu
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum

MAX_DENSE_UNKNOWNS = 350
"""Below it one dense matrix is the fastest."""
MAX_BLOCK, MAX_BAND = 400, 6
MAX_THICK_BLOCK = 2000
"""The same with two noises, where SuperLU fills in more; then the last noise is the one with the most functions."""


def one_thread() -> Any:
    """Keeps BLAS in the body from threads, which for the small blocks of an LU cost three times what they save."""
    return _pools().limit(limits=1)


@cache
def _pools() -> ThreadpoolController:
    return ThreadpoolController()


def sparse_lu(matrix: Any, **options: Any) -> Any:
    """SuperLU's factors, ordered for a symmetric pattern. Raises `SingularMatrix`."""
    try:
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", **options)
    except RuntimeError as failure:
        raise SingularMatrix(*failure.args) from failure


class Factors(Protocol):
    """Of a matrix A."""

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b."""


def factorised(operator: KroneckerSum) -> Factors:
    """LU factors of a sum. A pivot that vanishes is made tiny: next to an eigenvalue that is what is wanted."""
    if operator.size <= MAX_DENSE_UNKNOWNS and not operator.is_sparse:
        return DenseFactors(operator.toarray())
    m, n = operator.halves
    if not operator.is_sparse and len(operator.shape) == 3:
        if operator.shape[1] > n:
            return SwappedFactors(operator)
        if m <= MAX_THICK_BLOCK and operator.band <= MAX_BAND < n:
            return BlockFactors(operator)
    if not operator.is_sparse and m <= MAX_BLOCK and operator.band <= MAX_BAND < n:
        return BlockFactors(operator)
    return SparseFactors(operator)


class DenseFactors:
    """LAPACK's LU of an array."""

    def __init__(self, matrix: FloatArray) -> None:
        self._lu, self._pivots, info = dgetrf(matrix, overwrite_a=1)
        if info > 0:
            pivots = np.einsum("ii->i", self._lu)
            pivots[pivots == 0] = np.finfo(float).eps * np.max(np.abs(pivots))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        return np.asarray(dgetrs(self._lu, self._pivots, b, trans=transposed)[0])

    def right_quotient(self, b: FloatArray) -> FloatArray:
        """b A⁻¹."""
        half = dtrsm(1.0, self._lu, b, side=1)
        half = dtrsm(1.0, self._lu, half, side=1, lower=1, diag=1, overwrite_b=1)
        order = list(range(self._pivots.size))
        for i, j in enumerate(self._pivots.tolist()):
            order[i], order[j] = order[j], order[i]
        found = np.empty(half.T.shape)
        found[order] = half.T
        return found.T


class BlockFactors:
    """Block elimination over the functions of the last axis, from the last, where noise relaxes fastest, on."""

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
        rest = b.reshape(self._shape).T.copy()
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
        return rest.T.ravel()


class SwappedFactors:
    """Those of a sum of three factors with the two last ones exchanged."""

    def __init__(self, operator: KroneckerSum) -> None:
        self._shape = operator.shape
        self._inner = factorised(KroneckerSum([(phase, last, first) for phase, first, last in operator.terms]))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        phase, first, last = self._shape
        swapped = b.reshape(phase, first, last).transpose(0, 2, 1).ravel()
        found = self._inner.solve(swapped, transposed=transposed)
        return found.reshape(phase, last, first).transpose(0, 2, 1).ravel()


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
