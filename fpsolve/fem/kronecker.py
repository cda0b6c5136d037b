"""Sums of Kronecker products Σ Φ_k ⊗ Ξ_k: operators whose coefficients are products f(φ)·g(ξ)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, kron

from fpsolve.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class KroneckerSum:
    """Σ Φ_k ⊗ Ξ_k, the factors kept apart.

    Attributes:
        terms: pairs of a φ-matrix, shape (m, m), and a ξ-matrix, shape (n, n).
    """

    terms: tuple[tuple[csr_matrix, csr_matrix], ...]

    @classmethod
    def of(cls, phase: Any, noise: Any) -> KroneckerSum:
        """One product."""
        return cls(((csr_matrix(phase), csr_matrix(noise)),))

    def __add__(self, other: KroneckerSum) -> KroneckerSum:
        return KroneckerSum(self.terms + other.terms)

    def __rmul__(self, factor: float) -> KroneckerSum:
        return KroneckerSum(tuple((factor * phase, noise) for phase, noise in self.terms) if factor else ())

    def toarray(self) -> FloatArray:
        """The dense matrix, shape (m·n, m·n), φ slowest."""
        return np.asarray(sum(kron(phase, noise).toarray() for phase, noise in self.terms), dtype=float)


class KroneckerPattern:
    """The common sparsity pattern of several sums, on which each is one array of entries.

    Linear combinations of the sums are then those of arrays, and the pattern is sorted once.
    """

    def __init__(self, sums: Sequence[KroneckerSum]) -> None:
        terms = [term for total in sums for term in total.terms]
        self._phase, self._noise = (_places([term[side] for term in terms]) for side in (0, 1))
        n = terms[0][1].shape[0]
        size = terms[0][0].shape[0] * n
        row, column = (
            (phase[:, None] * n + noise).ravel() for phase, noise in zip(self._phase, self._noise, strict=True)
        )
        numbers = coo_matrix((np.arange(row.size), (row, column)), shape=(size, size)).tocsc()
        self._order, self._indices, self._indptr = numbers.data, numbers.indices, numbers.indptr
        self._shape = numbers.shape

    def entries(self, total: KroneckerSum) -> FloatArray:
        """The entries of a sum, in the order that `matrix` takes."""
        if not total.terms:
            return np.zeros(self._order.size)
        phase = np.stack([np.asarray(phase[self._phase]).ravel() for phase, _ in total.terms])
        noise = np.stack([np.asarray(noise[self._noise]).ravel() for _, noise in total.terms])
        return (phase.T @ noise).ravel()[self._order]

    def matrix(self, entries: FloatArray) -> csc_matrix:
        """The matrix with these entries; all matrices of a pattern share their indices."""
        return csc_matrix((entries, self._indices, self._indptr), shape=self._shape)


def _places(matrices: Sequence[csr_matrix]) -> tuple[Any, Any]:
    """Rows and columns, by columns, of all that is not zero in some matrices."""
    pattern = sum((abs(matrix) for matrix in matrices[1:]), start=abs(matrices[0]))
    column, row = pattern.T.nonzero()
    return row, column
