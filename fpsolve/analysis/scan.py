"""F at points of the unit square, and on a grid: row by row, each a task of its own, and where F changes its sign."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.budget import Countdown
from fpsolve.errors import FpsolveError
from fpsolve.messages import Message

TOLERANCE = 1e-10
"""|F| over its scale up to which it is 0, unless more is allowed."""
FINE = 13
"""Number of points along a cell of a scan at which its interpolation is looked at."""


class Sample(NamedTuple):
    """F at a point.

    Attributes:
        at: (u, v).
        value: F.
        gradient: ∂F/∂(u, v), shape (2,).
        error: estimate of |error of F|.
        scale: the size of the terms of F before they cancel.
        rtol: |F| over its scale up to which it is 0.
    """

    at: FloatArray
    value: float
    gradient: FloatArray
    error: float
    scale: float
    rtol: float = TOLERANCE

    @property
    def nothing(self) -> float:
        """|F| up to which it is 0."""
        return max(self.rtol * self.scale, 0.1 * self.error)

    @property
    def is_zero(self) -> bool:
        return abs(self.value) <= self.nothing

    @property
    def tangent(self) -> FloatArray:
        """Along the curve, F > 0 on its left, of length 1."""
        along = np.array([self.gradient[1], -self.gradient[0]])
        return np.asarray(along / np.linalg.norm(along))

    @property
    def width(self) -> float:
        """|error of F|/|∇F|: how far the curve may be off."""
        return (self.error + abs(self.value)) / float(np.linalg.norm(self.gradient))


Field = Callable[[FloatArray], Sample]
"""F; raises `FpsolveError` where there is none."""


@dataclass(frozen=True, eq=False)
class Scan:
    """F on a grid of the square.

    Attributes:
        nodes: of each direction, shape (n,).
        values: F, shape (n, n), u first; NaN where it does not exist.
        gradients: ∂F/∂(u, v), shape (n, n, 2).
        reasons: why F does not exist at some nodes, each once.
        seconds: of the processor, that it took.
        rtol: the error of F that was wanted, relative to its scale.
    """

    nodes: FloatArray
    values: FloatArray
    gradients: FloatArray
    reasons: tuple[Message, ...] = ()
    seconds: float = 0.0
    rtol: float = 0.0

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
        s, t = fine[:, None], fine[None, :]
        for i in range(self.nodes.size - 1):
            for j in range(self.nodes.size - 1):
                corner, size = self.nodes[[i, j]], self.nodes[[i + 1, j + 1]] - self.nodes[[i, j]]
                inside, shares, middle = self.between(i, j, s, t), fine, 0.5 * fine[1]
                if np.isnan(inside).any():
                    inside, shares, middle = self.values[i : i + 2, j : j + 2], fine[[0, -1]], 0.5
                signs = np.sign(inside)  # where one is 0, too
                for k, m in np.argwhere(abs(signs[1:] - signs[:-1]) > 0):
                    yield corner + size * np.array([shares[k] + middle, shares[m]])
                for k, m in np.argwhere(abs(signs[:, 1:] - signs[:, :-1]) > 0):
                    yield corner + size * np.array([shares[k], shares[m] + middle])


@dataclass(frozen=True)
class Row:
    """A row of a grid as a task: it begins anew, so that what it finds does not depend on who scans the others.

    Attributes:
        begin: gives F; a task for another process needs one that pickles.
        count: of the nodes of the grid, each way.
        number: of the row, from 0 on: it runs along v.
    """

    begin: Callable[[], Field]
    count: int
    number: int


@dataclass(frozen=True, eq=False)
class ScannedRow:
    """F on a row.

    Attributes:
        values: F, shape (n,); NaN where it does not exist.
        gradients: ∂F/∂(u, v), shape (n, 2).
        reasons: why F does not exist at some nodes, each once.
        seconds: of the processor.
    """

    values: FloatArray
    gradients: FloatArray
    reasons: tuple[Message, ...] = ()
    seconds: float = 0.0


def scan_row(row: Row) -> ScannedRow:
    """F on a row from one end to the other, so that each node is close to the one before."""
    whole, field, reasons = Countdown(math.inf), row.begin(), dict[Message, None]()
    values, gradients = np.full(row.count, np.nan), np.full((row.count, 2), np.nan)
    shares = np.linspace(0, 1, row.count)
    for k in range(row.count):
        try:
            with whole.running():
                sample = field(shares[[row.number, k]])
            values[k], gradients[k] = sample.value, sample.gradient
        except FpsolveError as failure:
            reasons.setdefault(failure.message)
    return ScannedRow(values, gradients, tuple(reasons), whole.spent)


def scanned(rows: Sequence[Row], found: Iterator[ScannedRow], progress: Callable[[], None] = lambda: None) -> Scan:
    """The scan of all rows of a grid, from what is found on them, in their order; no more of that is taken.

    `progress` is called for each node.
    """
    count, seconds = len(rows), 0.0
    values, gradients, reasons = np.empty((count, count)), np.empty((count, count, 2)), dict[Message, None]()
    for row in rows:
        result = next(found)
        values[row.number], gradients[row.number] = result.values, result.gradients
        reasons.update(dict.fromkeys(result.reasons))
        seconds += result.seconds
        for _ in range(count):
            progress()
    return Scan(np.linspace(0, 1, count), values, gradients, tuple(reasons), seconds)


def _hermite(x: FloatArray, end: int) -> tuple[FloatArray, FloatArray]:
    """The cubics on [0, 1] that have the value, or the slope, 1 at one end, and 0 else."""
    y = 1 - x if end else x
    hold, rise = (1 + 2 * y) * (1 - y) ** 2, y * (1 - y) ** 2
    return hold, -rise if end else rise
