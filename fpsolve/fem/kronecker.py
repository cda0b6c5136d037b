"""Sums of Kronecker products Σ Φ_k ⊗ Ξ_k: operators whose coefficients are products f(φ)·g(ξ)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, identity, issparse

from fpsolve.arrays import FloatArray, dense


@dataclass(frozen=True, eq=False)
class KroneckerSum:
    """Σ Φ_k ⊗ Ξ_k, the factors kept apart; vectors are those of functions on φ × ξ, φ slowest.

    Attributes:
        terms: pairs of a φ-matrix, shape (m, m), and a ξ-matrix, shape (n, n): arrays, or sparse.
    """

    terms: Sequence[tuple[Any, Any]]

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n)."""
        return self.terms[0][0].shape[0], self.terms[0][1].shape[0]

    @property
    def size(self) -> int:
        """m·n."""
        m, n = self.shape
        return m * n

    def __matmul__(self, vector: FloatArray) -> FloatArray:
        table = vector.reshape(self.shape)
        return np.ravel(sum(phase @ (table @ noise.T) for phase, noise in self.terms))

    @property
    def T(self) -> KroneckerSum:
        """The transpose."""
        return KroneckerSum([(phase.T, noise.T) for phase, noise in self.terms])

    def __abs__(self) -> KroneckerSum:
        """A bound on the absolute values."""
        return KroneckerSum([(abs(phase), abs(noise)) for phase, noise in self.terms])

    def norm(self) -> float:
        """A bound on the largest sum of the absolute values of a column."""
        return float(sum(np.prod([abs(factor).sum(axis=0).max() for factor in term]) for term in self.terms))

    def shifted(self, shift: float) -> KroneckerSum:
        """The sum less `shift` · 1 ⊗ Ξ₀, Ξ₀ being the ξ-matrix of the first term."""
        (phase, noise), *others = self.terms
        return KroneckerSum([(phase - shift * _identity(phase), noise), *others])

    @cached_property
    def is_sparse(self) -> bool:
        return any(issparse(factor) for term in self.terms for factor in term)

    @cached_property
    def band(self) -> int:
        """How many diagonals the ξ-matrices have on each side; n − 1 for sparse ones."""
        if self.is_sparse:
            return self.shape[1] - 1
        rows, columns = np.nonzero(sum(abs(noise) for _, noise in self.terms))
        return int(np.max(np.abs(rows - columns), initial=0))

    def blocks(self, offset: int) -> FloatArray:
        """The φ-matrices between the functions i and i + offset of ξ, by the lesser of both; Fortran order each."""
        m, n = self.shape
        phases = np.stack([phase.T.ravel() for phase, _ in self.terms])
        noises = np.stack([np.diagonal(noise, offset) for _, noise in self.terms], axis=1)
        return (noises @ phases).reshape(n - abs(offset), m, m).transpose(0, 2, 1)

    def toarray(self) -> FloatArray:
        """The dense matrix, shape (m·n, m·n)."""
        m, n = self.shape
        phases, noises = (np.stack([dense(term[side]) for term in self.terms]) for side in (0, 1))
        products = phases.reshape(len(self.terms), -1).T @ noises.reshape(len(self.terms), -1)
        return products.reshape(m, m, n, n).transpose(0, 2, 1, 3).reshape(m * n, m * n)

    def tocsc(self) -> csc_matrix:
        """The sparse matrix, with an entry wherever some φ-matrix and some ξ-matrix have one; column by column of φ."""
        m, n = self.shape
        (phase, phases), (noise, noises) = (_on_one_pattern([term[side] for term in self.terms]) for side in (0, 1))
        counts, noise_counts = np.diff(phase.indptr), np.diff(noise.indptr)
        noise_columns = np.repeat(np.arange(n), noise_counts)
        orders = {count: np.argsort(np.tile(noise_columns, count), kind="stable") for count in set(counts.tolist())}
        rows, values = [], []
        for j, count in enumerate(counts.tolist()):
            entries = slice(phase.indptr[j], phase.indptr[j + 1])
            rows.append(np.add.outer(n * phase.indices[entries], noise.indices).ravel()[orders[count]])
            values.append((phases[:, entries].T @ noises).ravel()[orders[count]])
        starts = np.append(0, np.cumsum(np.outer(counts, noise_counts)))
        return csc_matrix((np.concatenate(values), np.concatenate(rows), starts), shape=(m * n, m * n))


def _on_one_pattern(matrices: Sequence[Any]) -> tuple[csc_matrix, FloatArray]:
    """Where any of some matrices has an entry, and the entries of each of them there, one row for each."""
    columnwise = [csc_matrix(matrix) for matrix in matrices]
    pattern = csc_matrix(sum(abs(matrix) for matrix in columnwise))
    pattern.sort_indices()
    columns = np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
    return pattern, np.stack([np.ravel(matrix[pattern.indices, columns]) for matrix in columnwise])


def _identity(like: Any) -> Any:
    size = like.shape[0]
    return identity(size, format="csr") if issparse(like) else np.eye(size)
