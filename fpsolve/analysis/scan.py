"""F at points of the unit square, and on a grid: row by row, each a task of its own, and where F changes its sign."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from time import thread_time
from typing import Any, Literal, NamedTuple

import numpy as np
from contourpy import contour_generator

from fpsolve.arrays import FloatArray, ReadOnly
from fpsolve.errors import FpsolveError
from fpsolve.messages import Message

TOLERANCE = 1e-10
"""|F| over its scale up to which it is 0, unless more is allowed."""
FINE = 12
"""Number of pieces, each way, of a cell of a scan in which its interpolation is looked at."""


class Sample(NamedTuple):
    """F at a point of the unit square, or at parameters θ.

    Attributes:
        at: (u, v), or θ.
        value: F.
        gradient: the derivatives of F by these, of the same shape.
        error: estimate of |error of F|.
        scale: the size of the terms of F before they cancel.
        rtol: |F| over its scale up to which it is 0.
        label: what is special about a point of a curve; empty for an ordinary one.
    """

    at: FloatArray
    value: float
    gradient: FloatArray
    error: float
    scale: float
    rtol: float = TOLERANCE
    label: str = ""

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
        return along / np.linalg.norm(along)

    @property
    def width(self) -> float:
        """|error of F|/|∇F|: how far the curve may be off."""
        return (self.error + abs(self.value)) / float(np.linalg.norm(self.gradient))


Field = Callable[[FloatArray], Sample]
"""F; raises `FpsolveError` where there is none."""


@dataclass(frozen=True, eq=False)
class Scan(ReadOnly):
    """F on a grid of the square, or on a row of it.

    Attributes:
        nodes: of each direction, shape (n,).
        values: F, shape (n, n), u first, of a row (n,); NaN where it does not exist.
        gradients: ∂F/∂(u, v), shape (n, n, 2), of a row (n, 2).
        reasons: why F does not exist at some nodes, each once.
        seconds: of the processor, that it took.
    """

    nodes: FloatArray
    values: FloatArray
    gradients: FloatArray
    reasons: tuple[Message, ...] = ()
    seconds: float = 0.0

    def on(self, points: FloatArray) -> FloatArray:
        """F on the grid of these points of both sides, shape (n, n), u first, by cubics along u, and then along v.

        The mixed derivatives at the nodes are differences of the gradients; 0 beside missing ones.
        """

        from scipy.interpolate import BPoly  # 70 ms, of which only charts have need

        def along(values: FloatArray, slopes: FloatArray) -> FloatArray:
            return np.asarray(BPoly.from_derivatives(self.nodes, np.stack([values, slopes], axis=1))(points))

        by_u, by_v = np.moveaxis(self.gradients, 2, 0)
        order: Literal[1, 2] = 2 if self.nodes.size > 2 else 1
        twists = (np.gradient(each, self.nodes, axis=k, edge_order=order) for k, each in enumerate((by_v, by_u)))
        mixed = np.nan_to_num(0.5 * sum(twists))
        return along(along(self.values, by_u).T, along(by_v, mixed).T).T

    def seeds(self) -> Iterator[Sample]:
        """Points on the lines F = 0 of the interpolated F, each with a gradient that tells their direction.

        Where nodes are missing they are also those on the edges between two nodes.
        """
        finer = np.linspace(0, 1, FINE * (self.nodes.size - 1) + 1)
        values = np.ma.masked_invalid(self.on(finer))
        lines: Any = contour_generator(finer, finer, values.T, line_type="Separate").lines(0.0)
        for start, end in chain.from_iterable(map(pairwise, lines)):
            if (along := end - start).any():
                yield Sample(0.5 * (start + end), 0.0, np.array([-along[1], along[0]]), 0.0, 0.0)
        for axis in (0, 1) if np.isnan(self.values).any() else ():
            for one in np.argwhere(np.abs(np.diff(np.sign(self.values), axis=axis)) > 0):
                other = one + np.eye(2, dtype=int)[axis]
                (f, g), (slope, more) = ([of[*each] for each in (one, other)] for of in (self.values, self.gradients))
                yield Sample(
                    self.nodes[one] + f / (f - g) * (self.nodes[other] - self.nodes[one]), 0.0, slope + more, 0.0, 0.0
                )


@dataclass(frozen=True)
class Row:
    """A row of a grid as a task, with an F of its own, so that what it finds does not depend on who scans the others.

    Attributes:
        field: F; a task for another process needs one that pickles.
        count: of the nodes of the grid, each way.
        number: of the row, from 0 on: it runs along v.
    """

    field: Field
    count: int
    number: int


def scan_row(row: Row) -> Scan:
    """F on a row from one end to the other, so that each node is close to the one before."""
    started, reasons = thread_time(), dict[Message, None]()
    values, gradients = np.full(row.count, np.nan), np.full((row.count, 2), np.nan)
    shares = np.linspace(0, 1, row.count)
    for k in range(row.count):
        try:
            sample = row.field(shares[[row.number, k]])
            values[k], gradients[k] = sample.value, sample.gradient
        except FpsolveError as failure:
            reasons.setdefault(failure.message)
    return Scan(shares, values, gradients, tuple(reasons), thread_time() - started)


def scanned(count: int, found: Iterator[Scan], progress: Callable[[], None] = lambda: None) -> Scan:
    """The scan of a grid from so many rows in their order; no more of them is taken.

    `progress` is called for each node.
    """
    results = []
    for result in islice(found, count):
        results.append(result)
        for _ in range(count):
            progress()
    return Scan(
        np.linspace(0, 1, count),
        np.stack([each.values for each in results]),
        np.stack([each.gradients for each in results]),
        tuple(dict.fromkeys(chain.from_iterable(each.reasons for each in results))),
        sum(each.seconds for each in results),
    )
