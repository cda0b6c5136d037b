"""Sums of Kronecker products Σ Φ_k ⊗ Ξ_k ⊗ …: operators whose coefficients are products f(φ)·g(ξ)·…"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np
import scipy.sparse
from scipy.sparse import csc_matrix, identity, issparse

from fpsolve.arrays import FloatArray, dense


def along(factors: Sequence[Any], table: FloatArray) -> FloatArray:
    """A table with a matrix applied along each of its axes, from the last; None leaves an axis as it is."""
    for axis in range(len(factors) - 1, -1, -1):
        factor = factors[axis]
        if factor is None:
            continue
        if table.ndim == 2:
            table = table @ factor.T if axis else factor @ table
        else:
            moved = np.moveaxis(table, axis, 0)
            image = factor @ moved.reshape(len(moved), -1)
            table = np.moveaxis(image.reshape(-1, *moved.shape[1:]), 0, axis)
    return table


@dataclass(frozen=True, eq=False)
class KroneckerSum:
    """Σ Φ_k ⊗ Ξ_k ⊗ …, the factors kept apart; vectors are those of functions on φ × ξ × …, the first axis slowest.

    Attributes:
        terms: for each term a square matrix for each axis, arrays or sparse.
    """

    terms: Sequence[tuple[Any, ...]]

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of functions along each axis."""
        return tuple(factor.shape[0] for factor in self.terms[0])

    @property
    def size(self) -> int:
        """The number of all functions."""
        return math.prod(self.shape)

    def __matmul__(self, vector: FloatArray) -> FloatArray:
        table = vector.reshape(self.shape)
        return np.ravel(sum(along(term, table) for term in self.terms))

    @property
    def T(self) -> KroneckerSum:
        """The transpose."""
        return KroneckerSum([tuple(factor.T for factor in term) for term in self.terms])

    def __abs__(self) -> KroneckerSum:
        """A bound on the absolute values."""
        return KroneckerSum([tuple(abs(factor) for factor in term) for term in self.terms])

    def norm(self) -> float:
        """A bound on the largest sum of the absolute values of a column."""
        return float(sum(np.prod([abs(factor).sum(axis=0).max() for factor in term]) for term in self.terms))

    def shifted(self, shift: float) -> KroneckerSum:
        """The sum less `shift` · 1 ⊗ Ξ₀ ⊗ …, Ξ₀ ⊗ … being what the first term has beside its φ-matrix."""
        (phase, *noises), *others = self.terms
        unit = identity(phase.shape[0], format="csr") if issparse(phase) else np.eye(phase.shape[0])
        return KroneckerSum([(phase - shift * unit, *noises), *others])

    @cached_property
    def is_sparse(self) -> bool:
        return any(issparse(factor) for term in self.terms for factor in term)

    @cached_property
    def pairs(self) -> Sequence[tuple[Any, Any]]:
        """The terms with all factors but the last as one."""
        product = scipy.sparse.kron if self.is_sparse else np.kron
        return [(reduce(product, term[:-1]), term[-1]) for term in self.terms]

    @property
    def halves(self) -> tuple[int, int]:
        """The number of functions along the last axis, after that of all others."""
        last = self.shape[-1]
        return self.size // last, last

    @cached_property
    def band(self) -> int:
        """How many diagonals the matrices of the last axis have on each side; all for sparse ones."""
        if self.is_sparse:
            return self.shape[-1] - 1
        rows, columns = np.nonzero(sum(abs(term[-1]) for term in self.terms))
        return int(np.max(np.abs(rows - columns), initial=0))

    def blocks(self, offset: int) -> FloatArray:
        """The matrices between the functions i and i + offset of the last axis, by the lesser; Fortran order each."""
        m, n = self.halves
        befores = np.stack([before.T.ravel() for before, _ in self.pairs])
        lasts = np.stack([np.diagonal(last, offset) for _, last in self.pairs], axis=1)
        return (lasts @ befores).reshape(n - abs(offset), m, m).transpose(0, 2, 1)

    def toarray(self) -> FloatArray:
        """The dense matrix, shape (size, size)."""
        m, n = self.halves
        befores, lasts = (np.stack([dense(pair[side]) for pair in self.pairs]) for side in (0, 1))
        products = befores.reshape(len(befores), -1).T @ lasts.reshape(len(lasts), -1)
        return products.reshape(m, m, n, n).transpose(0, 2, 1, 3).reshape(m * n, m * n)

    def tocsc(self) -> csc_matrix:
        """The sparse matrix, with an entry wherever factors of both sides may have one; column by column of φ."""
        m, n = self.halves
        (before, befores), (last, lasts) = (_on_one_pattern([pair[side] for pair in self.pairs]) for side in (0, 1))
        counts, last_counts = np.diff(before.indptr), np.diff(last.indptr)
        last_columns = np.repeat(np.arange(n), last_counts)
        orders = {count: np.argsort(np.tile(last_columns, count), kind="stable") for count in set(counts.tolist())}
        rows, values = [], []
        for j, count in enumerate(counts.tolist()):
            entries = slice(before.indptr[j], before.indptr[j + 1])
            rows.append(np.add.outer(n * before.indices[entries], last.indices).ravel()[orders[count]])
            values.append((befores[:, entries].T @ lasts).ravel()[orders[count]])
        starts = np.append(0, np.cumsum(np.outer(counts, last_counts)))
        return csc_matrix((np.concatenate(values), np.concatenate(rows), starts), shape=(m * n, m * n))


def _on_one_pattern(matrices: Sequence[Any]) -> tuple[csc_matrix, FloatArray]:
    """Where any of some matrices has an entry, and the entries of each of them there, one row for each."""
    columnwise = [csc_matrix(matrix) for matrix in matrices]
    pattern = csc_matrix(sum(abs(matrix) for matrix in columnwise))
    pattern.sort_indices()
    columns = np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
    return pattern, np.stack([np.ravel(matrix[pattern.indices, columns]) for matrix in columnwise])
