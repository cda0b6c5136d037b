"""F on a grid of the unit square, row by row, each a task of its own, and where its interpolation changes its sign."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.curve import Field, Sample
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.messages import Message

FINE = 13
"""Points along a cell of a scan where its interpolation is looked at."""


@dataclass(frozen=True, eq=False)
class Scan:
    """F on a grid of the square.

    Attributes:
        nodes: of each direction, shape (n,).
        values: F, shape (n, n), u first; NaN where it does not exist.
        gradients: ∂F/∂(u, v), shape (n, n, 2).
        reasons: why F does not exist at some nodes, each once.
    """

    nodes: FloatArray
    values: FloatArray
    gradients: FloatArray
    reasons: tuple[Message, ...] = ()

    def between(self, i: int, j: int, s: FloatArray, t: FloatArray) -> FloatArray:
        """F in the cell of the nodes (i, j) to (i + 1, j + 1), s and t in [0, 1], by bicubic interpolation.

        The mixed derivatives are those by which it is exact for all cubic F (A. Adini, 1960).
        """
        size = self.nodes[i + 1] - self.nodes[i], self.nodes[j + 1] - self.nodes[j]
        values, slopes = self.values[i : i + 2, j : j + 2], self.gradients[i : i + 2, j : j + 2] * size
        flat = values[1, 1] - values[1, 0] - values[0, 1] + values[0, 0]
        total = np.zeros(np.broadcast_shapes(s.shape, t.shape))
        for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
            (hold_s, rise_s), (hold_t, rise_t) = _hermite(s, a), _hermite(t, b)
            twist = slopes[a, 1, 0] - slopes[a, 0, 0] + slopes[1, b, 1] - slopes[0, b, 1] - flat
            total = total + values[a, b] * hold_s * hold_t + twist * rise_s * rise_t
            total = total + slopes[a, b, 0] * rise_s * hold_t + slopes[a, b, 1] * hold_s * rise_t
        return total

    def __call__(self, at: FloatArray) -> Sample:
        """Interpolated F."""
        cell = np.clip(np.searchsorted(self.nodes, at, side="right") - 1, 0, self.nodes.size - 2)
        size, step = self.nodes[cell + 1] - self.nodes[cell], 1e-5
        s, t = ((at - self.nodes[cell]) / size)[:, None] + step * np.array([[0, 1, -1, 0, 0], [0, 0, 0, 1, -1]])
        value, right, left, up, down = self.between(int(cell[0]), int(cell[1]), s, t)
        gradient = np.array([right - left, up - down]) / (2 * step * size)
        return Sample(at, float(value), gradient, 0.0, float(np.nanmax(np.abs(self.values))))

    def seeds(self) -> Iterator[FloatArray]:
        """Points near which F changes its sign: inside the cells, or beside missing nodes on their edges."""
        fine = np.linspace(0, 1, FINE)
        s, t, half = fine[:, None], fine[None, :], 0.5 * fine[1]
        for i in range(self.nodes.size - 1):
            for j in range(self.nodes.size - 1):
                corner, size = self.nodes[[i, j]], self.nodes[[i + 1, j + 1]] - self.nodes[[i, j]]
                inside = self.between(i, j, s, t)
                if np.isnan(inside).any():
                    inside, middle = self.values[i : i + 2, j : j + 2], (np.array([0.0, 1.0]), 0.5)
                else:
                    middle = fine, half
                yield from (corner + size * place for place in _changes(inside, *middle))


@dataclass(frozen=True)
class Row:
    """A row of a grid as a task: it begins anew, so that what it finds does not depend on who scans the others.

    Attributes:
        begin: gives F; a task for another process needs one that pickles.
        count: of the nodes of the grid, each way.
        number: of the row, from 0 on.
        axis: along which it runs, 0 for u and 1 for v.
    """

    begin: Callable[[], Field]
    count: int
    number: int
    axis: int = 1

    @property
    def nodes(self) -> FloatArray:
        """(u, v) of its nodes in order, shape (count, 2)."""
        along = np.linspace(0, 1, self.count)
        across = np.full(self.count, along[self.number])
        return np.stack([along, across] if self.axis == 0 else [across, along], axis=1)


@dataclass(frozen=True, eq=False)
class ScannedRow:
    """F on a row.

    Attributes:
        values: F, shape (n,); NaN where it does not exist.
        gradients: ∂F/∂(u, v), shape (n, 2).
        reasons: why F does not exist at some nodes, each once.
    """

    values: FloatArray
    gradients: FloatArray
    reasons: tuple[Message, ...] = ()


def rows_of(begin: Callable[[], Field], count: int, axis: int = 1) -> list[Row]:
    """All rows of a grid of count × count nodes."""
    return [Row(begin, count, number, axis) for number in range(count)]


def scan_row(row: Row) -> ScannedRow:
    """F on a row from one end to the other, so that each node is close to the one before."""
    field, reasons = row.begin(), dict[Message, None]()
    values, gradients = np.full(row.count, np.nan), np.full((row.count, 2), np.nan)
    for k, at in enumerate(row.nodes):
        try:
            sample = field(at)
            values[k], gradients[k] = sample.value, sample.gradient
        except FpsolveError as failure:
            reasons.setdefault(failure.message)
    return ScannedRow(values, gradients, tuple(reasons))


def scanned(rows: Sequence[Row], found: Iterator[ScannedRow], progress: Callable[[], None] = lambda: None) -> Scan:
    """The scan of all rows of a grid, from what is found on them, in their order; no more of that is taken."""
    count = len(rows)
    values, gradients, reasons = np.empty((count, count)), np.empty((count, count, 2)), dict[Message, None]()
    for row in rows:
        result = next(found)
        place = (slice(None), row.number) if row.axis == 0 else row.number
        values[place], gradients[place] = result.values, result.gradients
        reasons.update(dict.fromkeys(result.reasons))
        for _ in range(count):
            progress()
    return Scan(np.linspace(0, 1, count), values, gradients, tuple(reasons))


def _changes(values: FloatArray, shares: FloatArray, half: float) -> Iterator[FloatArray]:
    """Half-way between neighbours in a table of F over shares of a cell that differ in sign, or of which one is 0."""
    signs = np.sign(values)
    for k, m in np.argwhere(abs(signs[1:] - signs[:-1]) > 0):
        yield np.array([shares[k] + half, shares[m]])
    for k, m in np.argwhere(abs(signs[:, 1:] - signs[:, :-1]) > 0):
        yield np.array([shares[k], shares[m] + half])


def _hermite(x: FloatArray, end: int) -> tuple[FloatArray, FloatArray]:
    """The cubics on [0, 1] that have the value, or the slope, 1 at one end, and 0 else."""
    y = 1 - x if end else x
    hold, rise = (1 + 2 * y) * (1 - y) ** 2, y * (1 - y) ** 2
    return hold, -rise if end else rise
