"""F at points of the unit square, and on a grid: row by row, each a task of its own, and where F changes its sign."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from time import thread_time
from typing import Any, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
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
    """

    nodes: FloatArray
    values: FloatArray
    gradients: FloatArray
    reasons: tuple[Message, ...] = ()
    seconds: float = 0.0

    def between(self, i: Any, j: Any, s: FloatArray, t: FloatArray) -> FloatArray:
        """F in the cells of the nodes (i, j) to (i + 1, j + 1), s and t in [0, 1], by bicubic interpolation.

        The mixed derivatives are those by which it is exact for all cubic F (A. Adini, 1960). All four are broadcast.
        """
        along, across = self.nodes[i + 1] - self.nodes[i], self.nodes[j + 1] - self.nodes[j]
        ends = (0, 0), (0, 1), (1, 0), (1, 1)
        values = {(a, b): self.values[i + a, j + b] for a, b in ends}
        by_s = {(a, b): along * self.gradients[i + a, j + b, 0] for a, b in ends}
        by_t = {(a, b): across * self.gradients[i + a, j + b, 1] for a, b in ends}
        flat = values[1, 1] - values[1, 0] - values[0, 1] + values[0, 0]
        in_s, in_t, total = _hermite(s), _hermite(t), np.zeros(1)
        for a, b in ends:
            (hold_s, rise_s), (hold_t, rise_t) = in_s[a], in_t[b]
            twist = by_t[1, b] - by_t[0, b] + by_s[a, 1] - by_s[a, 0] - flat
            total = total + (values[a, b] * hold_s + by_s[a, b] * rise_s) * hold_t
            total = total + (twist * rise_s + by_t[a, b] * hold_s) * rise_t
        return total

    def fine(self, shares: FloatArray) -> FloatArray:
        """F at shares of the sides of every cell, shape (cells, cells, shares, shares), in both u first."""
        cells = np.arange(self.nodes.size - 1)[:, None, None]
        return self.between(cells[:, None], cells, shares[:, None], shares)

    def seeds(self) -> Iterator[Sample]:
        """Points next to changes of sign, with about the gradient there, inside the cells.

        Of a cell beside a missing node that is on the edges between two nodes alone.
        """
        shares = np.linspace(0, 1, FINE)
        inside, whole = self.fine(shares), np.diff(self.nodes)
        for i, j in np.ndindex(inside.shape[:2]):
            values, gradients, steps = inside[i, j], np.stack(np.gradient(inside[i, j]), axis=-1), shares
            if np.isnan(values).any():
                corners = slice(i, i + 2), slice(j, j + 2)
                values, gradients, steps = self.values[corners], self.gradients[corners], shares[[0, -1]]
            for axis, (a, b) in enumerate(((1, 0), (0, 1))):
                changes = np.nonzero(np.abs(np.diff(np.sign(values), axis=axis)) > 0)  # where one is 0, too
                for u, v in zip(*changes, strict=True):
                    at = self.nodes[[i, j]] + whole[[i, j]] * 0.5 * (steps[[u, v]] + steps[[u + a, v + b]])
                    yield Sample(at, 0.0, gradients[u, v] + gradients[u + a, v + b], 0.0, 0.0)


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
    started, field, reasons = thread_time(), row.begin(), dict[Message, None]()
    values, gradients = np.full(row.count, np.nan), np.full((row.count, 2), np.nan)
    shares = np.linspace(0, 1, row.count)
    for k in range(row.count):
        try:
            sample = field(shares[[row.number, k]])
            values[k], gradients[k] = sample.value, sample.gradient
        except FpsolveError as failure:
            reasons.setdefault(failure.message)
    return ScannedRow(values, gradients, tuple(reasons), thread_time() - started)


def scanned(rows: Sequence[Row], found: Iterator[ScannedRow], progress: Callable[[], None] = lambda: None) -> Scan:
    """The scan of all rows of a grid, from what is found on them, in their order; no more of that is taken.

    `progress` is called for each node.
    """
    results = list[ScannedRow]()
    for result in islice(found, len(rows)):
        results.append(result)
        for _ in rows:
            progress()
    return Scan(
        np.linspace(0, 1, len(rows)),
        np.stack([each.values for each in results]),
        np.stack([each.gradients for each in results]),
        tuple(dict.fromkeys(chain.from_iterable(each.reasons for each in results))),
        sum(each.seconds for each in results),
    )


def _hermite(x: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """For both ends of [0, 1] the cubics that have the value, or the slope, 1 there, and 0 else."""
    y = 1 - x
    return [((1 + 2 * x) * y**2, x * y**2), ((1 + 2 * y) * x**2, -y * x**2)]
