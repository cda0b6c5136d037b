"""What a curve F(u, v) = 0 in the unit square is made of: values of F, points, and branches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.messages import Message

TOLERANCE = 1e-10
"""|F| over its scale on a curve; a tenth of what the solves of F leave."""
SAME = 1e-3
"""Distance, in sides of the square, in which a curve that runs the same way is taken for one that is known."""
PIECES = 8
"""Into which the cubic between two points of a branch is divided."""


class Sample(NamedTuple):
    """F at a point.

    Attributes:
        at: (u, v).
        value: F.
        gradient: ∂F/∂(u, v), shape (2,).
        error: estimate of |error of F|.
        scale: the size of the terms of F before they cancel.
    """

    at: FloatArray
    value: float
    gradient: FloatArray
    error: float
    scale: float

    @property
    def is_zero(self) -> bool:
        return abs(self.value) <= max(TOLERANCE * self.scale, 0.1 * self.error)

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
class Point:
    """A point of a curve.

    Attributes:
        sample: F there.
        label: what is special about it; empty for an ordinary one.
    """

    sample: Sample
    label: str = ""


@dataclass(frozen=True, eq=False)
class Trace:
    """One branch of a curve.

    Attributes:
        points: along it, F > 0 on its left.
        closed: whether the last is followed by the first.
        obstacles: why it ends inside of the square, if it does.
    """

    points: tuple[Point, ...]
    closed: bool = False
    obstacles: tuple[Message, ...] = ()

    @property
    def at(self) -> FloatArray:
        """(u, v), shape (n, 2); of a closed one the first again at the end."""
        places = [point.sample.at for point in self.points]
        return np.array(places + places[:1] * self.closed)

    @cached_property
    def fine(self) -> FloatArray:
        """(u, v) on the cubics through the points with their tangents, `PIECES` from one to the next."""
        at = self.at
        tangents = np.array([point.sample.tangent for point in self.points])
        tangents = np.concatenate([tangents, tangents[:1]]) if self.closed else tangents
        shares = np.arange(PIECES)[:, None] / PIECES
        if len(at) == 1:
            return np.concatenate([at, at])
        pieces = [cubic(at[i], at[i + 1], tangents[i], tangents[i + 1], shares) for i in range(len(at) - 1)]
        return np.concatenate([*pieces, at[-1:]])

    def between(self, i: int, share: float) -> FloatArray:
        """About the point at a share of the way from the point i to the next."""
        one, other = self.points[i].sample, self.points[(i + 1) % len(self.points)].sample
        return cubic(one.at, other.at, one.tangent, other.tangent, share)

    def holds(self, sample: Sample, within: float = SAME) -> bool:
        """Whether it runs through a point of a curve, or near to it the same way; F > 0 left of both."""
        return bool(np.any((self._gaps(sample.at) < within) & (np.diff(self.fine, axis=0) @ sample.tangent >= 0)))

    def passes(self, at: FloatArray, within: float) -> bool:
        """Whether it passes a point, one way or the other."""
        return bool(np.any(self._gaps(at) < within))

    def _gaps(self, at: FloatArray) -> FloatArray:
        """Distances of a point from the pieces."""
        start, way = self.fine[:-1], np.diff(self.fine, axis=0)
        share = np.clip(np.sum((at - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-300), 0, 1)
        return np.asarray(np.linalg.norm(start + share[:, None] * way - at, axis=1))


def cubic(
    start: FloatArray, end: FloatArray, out: FloatArray, into: FloatArray, share: float | FloatArray
) -> FloatArray:
    """The cubic from a point to another with unit tangents there; shares beyond 1 continue it."""
    rise = end - start
    length = float(np.linalg.norm(rise))
    quadratic, third = 3 * rise - length * (2 * out + into), length * (out + into) - 2 * rise
    return np.asarray(start + share * (length * out + share * (quadratic + share * third)))
