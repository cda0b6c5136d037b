"""LU factors of a Kronecker sum whose first axis is a ring of cells, each coupled to its neighbours by its end values.

With A what acts within the cells, B the functions at both ends of every cell, Σ what takes end values to the cells next
to them, and Π what these do there, the matrix is A + BΠΣBᵀ, and

    (A + BΠΣBᵀ)⁻¹ = A⁻¹ − A⁻¹ B Π Θ Bᵀ A⁻¹,      Θ = Σ (1 − SΣ)⁻¹,      S = −BᵀA⁻¹BΠ.

A is eliminated in all cells at once, over the functions of the last axis. S says of a cell which values it has at its
ends if its neighbours have given ones; those of two neighbours make that of both together, until the ring is closed.
Where there are n functions of the last axis and c cells of k, that takes some c (n² k² + n³) operations, blocks of all
functions of the ring n (ck)³, a matrix of one cell after another c (nk)³.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, issparse

from fpsolve.arrays import FloatArray, IntArray, Matrix, dense
from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.dense import ArrayFactors
from fpsolve.fem.levels import LEVEL_OPERATIONS

LARGEST_GROWTH = 1e10
"""Largest entry of an inverse times the norm of the matrix, as rows of different cells are not exchanged."""
CELL_OPERATIONS = 4e4
"""Number of operations that take the time of a cell and level, beside its products, 1.4 µs."""
INVERSE_OPERATIONS = 40.0
"""Number of operations that take the time of a small inverse and its products over the third power of its side."""
ROUND_OPERATIONS = 2e6
"""Number of operations that take the time of the calls that join each second segment to the next one, 70 µs."""


@dataclass(frozen=True, eq=False)
class Ring:
    """The cells of an axis in their order.

    Attributes:
        number: the function of each mode of each cell; −1 where it has no such mode, shape (cells, modes).
        ends: what these are at the lower and at the upper end of the cell, shape (cells, modes, 2).
    """

    number: IntArray
    ends: FloatArray


@dataclass(frozen=True, eq=False)
class _Round:
    """What joins each second segment of a ring to the next one.

    With R_p and L_n the values that come to both from below and from above, L and R those that they have at their lower
    and upper end, and g such values that do not depend on these,

        R_a = H₁ R_p + H₂ L_n + v,      L_b = b₁₁ R_a + b₁₂ L_n + g_Lb,      v = M⁻¹ (a₂₂ g_Lb + g_Ra).

    Attributes:
        a12, a22, b11, b12, b21: blocks of the S of both, each of shape (pairs, n, n).
        inverse: M⁻¹ = (1 − a₂₂b₁₁)⁻¹.
        h1, h2: M⁻¹a₂₁ and M⁻¹a₂₂b₁₂.
    """

    a12: FloatArray
    a22: FloatArray
    b11: FloatArray
    b12: FloatArray
    b21: FloatArray
    inverse: FloatArray
    h1: FloatArray
    h2: FloatArray


class RingFactors:
    """Elimination within cells, and of the values between them.

    Args:
        operator: the sum of two factors, that of the last axis with few diagonals or not.
        ring: the cells of the first axis, two of them at least.
    """

    def __init__(self, operator: KroneckerSum, ring: Ring) -> None:
        self._operator, self._ring, (_, n) = operator, ring, operator.shape
        self._n, self._group = n, max(operator.band, 1)
        self._levels = -(-n // self._group)
        cells, modes = ring.number.shape
        side = modes * self._group
        within = cells * self._levels * (CELL_OPERATIONS + INVERSE_OPERATIONS * side**3 + 8 * side**2 * n)
        calls = LEVEL_OPERATIONS * self._levels + ROUND_OPERATIONS * math.log2(cells)
        self.operations = 2 * (calls + within + 2 / 3 * (18 * cells + 16) * n**3)
        self.gigabytes = 8e-9 * cells * (5 * n * self._group * modes**2 + n**2 * (modes + 30))

    def make(self) -> None:
        """Eliminate.

        Raises:
            SingularMatrix: a part of the matrix alone is.
        """
        operator = self._operator
        size, most = self._levels * self._group, LARGEST_GROWTH / operator.norm
        noises = np.zeros((len(operator.terms), size, size))
        for padded, (_, noise) in zip(noises, operator.terms, strict=True):
            padded[: self._n, : self._n] = dense(noise)
        inner, coupling = self._of_cells([phase for phase, _ in operator.terms])
        diagonal, upper, lower = self._blocks(inner, noises)
        ends = self._eliminate(diagonal, upper, lower, most)
        noises = noises[:, : self._n, : self._n]
        loads = coupling.reshape(len(noises), -1).T @ noises.reshape(len(noises), -1)
        self._loads = loads.reshape(*coupling.shape[1:], self._n, self._n)
        self._close(-(ends @ self._loads[:, None]), most)

    def _blocks(self, inner: FloatArray, noises: FloatArray) -> list[FloatArray]:
        """A on the diagonal, above and below it, by groups, each of shape (levels, cells, side, side)."""
        terms, cells, modes, _ = inner.shape
        flat = inner.reshape(terms, -1)
        parts = noises.reshape(terms, self._levels, self._group, self._levels, self._group)
        found = []
        for offset in (0, 1, -1):
            at = np.arange(self._levels - abs(offset))
            chosen = parts[:, at + max(-offset, 0), :, at + max(offset, 0), :]  # (levels, terms, group, group)
            products = flat.T @ chosen.transpose(1, 0, 2, 3).reshape(terms, -1)
            table = products.reshape(cells, modes, modes, at.size, self._group, self._group)
            side = modes * self._group
            found.append(np.ascontiguousarray(table.transpose(3, 0, 1, 4, 2, 5)).reshape(at.size, cells, side, side))
        missing = np.zeros((self._levels, cells, modes, self._group), dtype=bool)
        missing |= (self._ring.number < 0)[None, :, :, None]
        missing |= np.arange(self._levels * self._group).reshape(-1, 1, 1, self._group) >= self._n
        level, cell, place = np.nonzero(missing.reshape(self._levels, cells, -1))
        found[0][level, cell, place, place] = 1.0
        return found

    def _eliminate(self, diagonal: FloatArray, upper: FloatArray, lower: FloatArray, most: float) -> FloatArray:
        """BᵀA⁻¹B, shape (cells, 2, 2, n, n), from the last group on, where noise relaxes fastest."""
        cells, last = len(self._ring.number), self._levels - 1
        own = np.einsum("cke,gh->ckgeh", self._ring.ends, np.eye(self._group)).reshape(cells, -1, 2 * self._group)
        self._inverses, self._above, self._below = diagonal, upper, lower  # which they take the place of
        columns, images = own, list[FloatArray]()
        for i in range(last, -1, -1):
            self._inverses[i] = _inverse(diagonal[i], most)
            images.append(self._inverses[i] @ columns)
            if i:
                columns = np.concatenate([own, -upper[i - 1] @ images[-1]], axis=2)
                above = upper[i - 1] @ self._inverses[i]
                diagonal[i - 1] -= above @ lower[i - 1]
                self._above[i - 1], self._below[i - 1] = above, self._inverses[i] @ lower[i - 1]
        images.reverse()
        rows, image = [np.swapaxes(own, 1, 2) @ images[0]], images[0]
        for below, more in zip(self._below, images[1:], strict=True):
            image = -(below @ image)
            image[:, :, -more.shape[2] :] += more
            rows.append(np.swapaxes(own, 1, 2) @ image)
        table = np.stack(rows, axis=1).reshape(cells, self._levels, 2, self._group, self._levels, 2, self._group)
        size = self._levels * self._group
        return table.transpose(0, 2, 5, 1, 3, 4, 6).reshape(cells, 2, 2, size, size)[..., : self._n, : self._n]

    def _of_cells(self, phases: Sequence[Matrix]) -> tuple[FloatArray, FloatArray]:
        """Matrices in the cells, shape (terms, cells, modes, modes), and what is between them, (terms, cells, 2)."""
        number, ends = self._ring.number, self._ring.ends
        cells, modes = number.shape
        kept = number >= 0
        cell, mode = np.nonzero(kept)  # of each function, as these are counted in this order
        inner, coupling = np.zeros((len(phases), cells, modes, modes)), np.zeros((len(phases), cells, 2))
        first = number[:, 0]
        for each, phase in enumerate(phases):
            if issparse(phase):
                entries = coo_matrix(phase)
                own = cell[entries.row] == cell[entries.col]
                row, column = entries.row[own], entries.col[own]
                inner[each, cell[row], mode[row], mode[column]] = entries.data[own]
                phase = entries.tocsr()
            else:
                inner[each] = phase[number[:, :, None], number[:, None, :]] * (kept[:, :, None] & kept[:, None, :])
            for side, step in enumerate((-1, 1)):
                others = np.roll(np.arange(cells), -step)
                size = ends[:, 0, side] * ends[others, 0, 1 - side]
                coupling[each, :, side] = np.ravel(phase[first, first[others]]) / size
        return inner, coupling

    def _close(self, scattering: FloatArray, most: float) -> None:
        """Join neighbours until there is one segment, and close it; `scattering` has the shape (cells, 2, 2, n, n)."""
        self._rounds = list[_Round]()
        identity = np.eye(self._n)
        while len(scattering) > 1:
            pairs = len(scattering) // 2
            a, b = scattering[0 : 2 * pairs : 2], scattering[1 : 2 * pairs : 2]
            (a11, a12, a21, a22), (b11, b12, b21, b22) = (
                [each[:, i, j] for i, j in np.ndindex(2, 2)] for each in (a, b)
            )
            inverse = _inverse(identity - a22 @ b11, np.inf)
            h1, h2 = inverse @ a21, inverse @ (a22 @ b12)
            joined = np.stack(
                [a11 + a12 @ (b11 @ h1), a12 @ (b11 @ h2 + b12), b21 @ h1, b22 + b21 @ h2], axis=1
            ).reshape(pairs, 2, 2, self._n, self._n)
            self._rounds.append(_Round(a12, a22, b11, b12, b21, inverse, h1, h2))
            scattering = np.concatenate([joined, scattering[2 * pairs :]])
        whole = scattering[0].transpose(0, 2, 1, 3)[:, :, ::-1].reshape(2 * self._n, 2 * self._n)
        self._closed = ArrayFactors(np.eye(2 * self._n) - whole)

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b, as far as an elimination that does not exchange rows of cells rounds it."""
        table = self._spread(b.reshape(-1, self._n))
        inside = self._within(table, transposed)
        values = np.einsum("cke,ckn->cen", self._ring.ends, inside)
        if transposed:
            loads = np.swapaxes(self._loads, 2, 3)
            around = self._around_transposed(_times(loads, values))
        else:
            around = _times(self._loads, self._around(values))
        found = inside - self._within(np.einsum("cke,cen->ckn", self._ring.ends, around), transposed)
        kept = self._ring.number >= 0
        solution = np.empty((b.size // self._n, self._n))
        solution[self._ring.number[kept]] = found[kept]
        return solution.ravel()

    def _spread(self, table: FloatArray) -> FloatArray:
        """By cells and modes, shape (cells, modes, n)."""
        return np.where((self._ring.number >= 0)[:, :, None], table[self._ring.number], 0.0)

    def _within(self, table: FloatArray, transposed: bool) -> FloatArray:
        """A⁻¹ of a table by cells and modes."""
        cells, modes = self._ring.number.shape
        padded = np.zeros((cells, modes, self._levels, self._group))
        padded.reshape(cells, modes, -1)[:, :, : self._n] = table
        y = padded.transpose(2, 0, 1, 3).reshape(self._levels, cells, modes * self._group, 1).copy()
        last = self._levels - 1
        if transposed:
            for i in range(last, 0, -1):
                y[i - 1] -= np.swapaxes(self._below[i - 1], 1, 2) @ y[i]
                y[i] = np.swapaxes(self._inverses[i], 1, 2) @ y[i]
            y[0] = np.swapaxes(self._inverses[0], 1, 2) @ y[0]
            for i in range(last):
                y[i + 1] -= np.swapaxes(self._above[i], 1, 2) @ y[i]
        else:
            for i in range(last, 0, -1):
                y[i - 1] -= self._above[i - 1] @ y[i]
            y[0] = self._inverses[0] @ y[0]
            for i in range(1, last + 1):
                y[i] = self._inverses[i] @ y[i] - self._below[i - 1] @ y[i - 1]
        found = y.reshape(self._levels, cells, modes, self._group).transpose(1, 2, 0, 3)
        return found.reshape(cells, modes, -1)[:, :, : self._n]

    def _around(self, values: FloatArray) -> FloatArray:
        """Θ of values at both ends of every cell, shape (cells, 2, n)."""
        known = list[tuple[FloatArray, FloatArray]]()
        for at in self._rounds:
            a, b, rest = _halved(values)
            v = _times(at.inverse, _times(at.a22, b[:, 0]) + a[:, 1])
            lower = a[:, 0] + _times(at.a12, _times(at.b11, v) + b[:, 0])
            upper = b[:, 1] + _times(at.b21, v)
            known.append((v, b[:, 0]))
            values = np.concatenate([np.stack([lower, upper], axis=1), rest])
        come = self._closed.solve(values.ravel()).reshape(1, 2, self._n)[:, ::-1]
        for at, (v, g) in zip(reversed(self._rounds), reversed(known), strict=True):
            below, above = come[: len(v), 0], come[: len(v), 1]
            right = _times(at.h1, below) + _times(at.h2, above) + v
            left = _times(at.b11, right) + _times(at.b12, above) + g
            pairs = np.stack([np.stack([below, left], axis=1), np.stack([right, above], axis=1)], axis=1)
            come = np.concatenate([pairs.reshape(-1, 2, self._n), come[len(v) :]])
        return come

    def _around_transposed(self, come: FloatArray) -> FloatArray:
        """Θᵀ of the same shape."""
        known = list[tuple[FloatArray, FloatArray]]()
        for at in self._rounds:
            a, b, rest = _halved(come)
            left = a[:, 1]
            right = b[:, 0] + _times(at.b11, left, True)
            above = b[:, 1] + _times(at.b12, left, True) + _times(at.h2, right, True)
            below = a[:, 0] + _times(at.h1, right, True)
            known.append((right, left))
            come = np.concatenate([np.stack([below, above], axis=1), rest])
        values = self._closed.solve(come[:, ::-1].ravel(), transposed=True).reshape(1, 2, self._n)
        for at, (v, g) in zip(reversed(self._rounds), reversed(known), strict=True):
            lower, upper = values[: len(v), 0], values[: len(v), 1]
            moved = _times(at.a12, lower, True)
            z = _times(at.inverse, v + _times(at.b11, moved, True) + _times(at.b21, upper, True), True)
            first = np.stack([lower, z], axis=1)
            second = np.stack([g + moved + _times(at.a22, z, True), upper], axis=1)
            pairs = np.stack([first, second], axis=1)
            values = np.concatenate([pairs.reshape(-1, 2, self._n), values[len(v) :]])
        return values


def _inverse(matrices: FloatArray, most: float) -> FloatArray:
    """Their inverses. Raises `SingularMatrix` where one is larger than it may be."""
    try:
        found = np.asarray(np.linalg.inv(matrices), dtype=float)
    except np.linalg.LinAlgError as failure:
        raise SingularMatrix(*failure.args) from failure
    if not np.abs(found).max() < most:
        raise SingularMatrix("a part of a ring is singular")
    return found


def _times(matrices: FloatArray, vectors: FloatArray, transposed: bool = False) -> FloatArray:
    """Products of one matrix with one vector each."""
    return np.asarray(((np.swapaxes(matrices, -1, -2) if transposed else matrices) @ vectors[..., None])[..., 0])


def _halved(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The first and the second of each pair of segments, and what is left."""
    end = len(values) // 2 * 2
    return values[0:end:2], values[1:end:2], values[end:]
