"""LU factors of an array."""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dgetrf, dgetrs

from fpsolve.arrays import FloatArray


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
