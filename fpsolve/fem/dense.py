"""LU factors of an array."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dgetrf, dgetrs, sgetrf, sgetrs

from fpsolve.arrays import FloatArray


class Factors(Protocol):
    """Of a matrix A."""

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b."""


class DenseFactors:
    """LAPACK's LU of an array, in the precision of its numbers."""

    def __init__(self, matrix: Any) -> None:
        factorise, self._solve = (sgetrf, sgetrs) if matrix.dtype == np.float32 else (dgetrf, dgetrs)
        self._lu, self._pivots, info = factorise(matrix, overwrite_a=1)
        if info > 0:
            pivots = np.einsum("ii->i", self._lu)
            pivots[pivots == 0] = np.finfo(matrix.dtype).eps * np.max(np.abs(pivots))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        return np.asarray(self._solve(self._lu, self._pivots, b, trans=transposed)[0])

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
