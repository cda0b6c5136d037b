"""LU factors of a matrix: what all kinds of them have, and those of an array."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs, sgetrf, sgetrs

from fpsolve.arrays import FloatArray


class Factors(Protocol):
    """LU factors of a matrix A, which tell what they take before they are made."""

    @property
    def operations(self) -> float:
        """Number of operations that making them and four solutions take.

        An elimination in a large array is counted as it is, anything else by the time that it takes relative to that.
        """

    @property
    def gigabytes(self) -> float:
        """Memory that they need for a while."""

    def make(self) -> None:
        """Eliminate.

        Raises:
            SingularMatrix: they cannot be made without an exchange of rows that this kind does not make.
        """

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b."""


class ArrayFactors:
    """LAPACK's LU of an array of a `size`, in the precision of its numbers. A pivot that vanishes is made tiny."""

    def __init__(self, matrix: FloatArray) -> None:
        factorise, self._solve = (sgetrf, sgetrs) if matrix.dtype == np.float32 else (dgetrf, dgetrs)
        self.size = len(matrix)
        self._lu, self._pivots, info = factorise(matrix, overwrite_a=1)
        if info > 0:
            pivots = np.einsum("ii->i", self._lu)
            pivots[pivots == 0] = np.finfo(matrix.dtype).eps * np.max(np.abs(pivots))

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b; several b are columns."""
        return np.asarray(self._solve(self._lu, self._pivots, b, trans=transposed)[0])


def dense_operations(size: int) -> float:
    """Operations of an LU of a dense matrix."""
    return 2 / 3 * size**3
