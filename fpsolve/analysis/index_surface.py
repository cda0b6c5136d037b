"""δ_p over one or two parameters from few solves: a surface on which p is where Λ(p) = 0.

The eigenfunctions at δ_p(θ), and their derivatives along it, are the basis. L(p; θ) in it is a sum of products of
functions of θ and of p. Newton's method finds the root of Λ(p)/p, which increases, in the small pencil:

    δ = p − Λ(p)/(Λ′(p) − Λ(p)/p),

whose error is that of Λ(p)/p over its slope. Next to δ_p = 0, where both roots of Λ meet, p stays away from 0, and the
last step goes on from there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fpsolve.analysis.surface import Surface, Values
from fpsolve.arrays import FloatArray
from fpsolve.exponent.basis import form
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.function import nonzero_root
from fpsolve.exponent.solver import solver_of
from fpsolve.fem.generator import Generator
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import STABILITY_INDEX, Quantity

NEXT_TO_ZERO = 1e-4
"""The least |p| of an operator; what the step from there leaves is about its square."""
SETTLED = 1e-2
"""Square of the step of Newton's method with which it ends, over rtol and the larger of |p| and 1."""
STEPS = 8
"""Number of these steps."""
BEYOND = 0.25, 0.1
"""How far the p of operators go beyond those of nodes: over the difference of these, and over the largest |p| or 1."""


class IndexSurface(Surface):
    """δ_p over one or two parameters, callable on arrays.

    Args:
        problem, ranges, options: as for `Surface`; |error| ≤ rtol·max(|δ_p|, 1).

    Raises:
        ValueError: see `Surface`.
        NotConverged: there is no such surface, or no δ_p in the middle or at a corner.
    """

    def __init__(self, problem: Problem, ranges: Mapping[str, Any], **options: Any) -> None:
        self._low = self._high = 0.0
        super().__init__(problem, ranges, 1.0, **options)

    @property
    def quantity(self) -> Quantity:
        """What F is."""
        return STABILITY_INDEX

    def _first(self, places: Sequence[FloatArray]) -> PrincipalPair:
        self.p, self._operands = math.nan, len(self.axes) + 1
        found = [nonzero_root(solver_of(self._problem(at), None, self.rtol, self._budget)) for at in places]
        if not all(found):
            raise self._none()
        roots = [each.value for each in found if each]
        self._reach(min(roots), max(roots))
        self._frame = self._problem(places[0])
        return solver_of(self._frame, None, self.rtol, self._budget).whole.solution(float(_away(roots[0]))).pair

    def _reach(self, low: float, high: float) -> None:
        """Let the operators have these p."""
        beyond = BEYOND[0] * (high - low) + BEYOND[1] * max(abs(low), abs(high), 1.0)
        self._low, self._high = low - beyond, high + beyond

    def _choose(self, pair: PrincipalPair) -> None:
        super()._choose(pair)
        self._off += NEXT_TO_ZERO**2

    def _is_settled(self, p: Any, root: Any) -> Any:
        """Whether a step of Newton's method from p to a root is the last one."""
        ends = (root - p) ** 2 <= SETTLED * self.rtol * np.maximum(1, np.abs(p))
        return ends | ((np.abs(p) <= 1.000001 * NEXT_TO_ZERO) & (np.abs(root) <= 2 * NEXT_TO_ZERO))

    def _scale(self, at: FloatArray) -> float:
        return 1.0

    def _order(self, place: FloatArray) -> float:
        return float(self._low + place[-1] * (self._high - self._low))

    def _place(self, at: FloatArray, pair: PrincipalPair) -> FloatArray:
        return np.append(at, (pair.p - self._low) / (self._high - self._low))

    def _value(self, pair: PrincipalPair) -> float:
        return pair.p + pair.value / self._unit(pair)

    def _unit(self, pair: PrincipalPair) -> float:
        return pair.value / pair.p - pair.derivative

    def _pair(self, generator: Generator, start: Any) -> PrincipalPair | None:
        p = start.p if isinstance(start, PrincipalPair) else start[0].p
        for _ in range(STEPS):
            pair = start = principal_pair(generator, p, start=start)
            root = self._value(pair)
            if self._is_settled(p, root):
                break
            p = float(_away(root))
        if self._is_settled(p, root) and self._low <= root <= self._high:
            return pair
        self._reach(min(self._low, root), max(self._high, root))
        self._choose(pair)
        self._take(self._chosen)
        return None

    def _directions(self, place: FloatArray, pair: PrincipalPair) -> list[FloatArray]:
        by_p = self._rows(place[None], len(self.axes))[0] / (self._high - self._low)
        norm = float(pair.left @ pair.space.weighed(pair.right)) * self._unit(pair)
        changes = ((row, self._changes(row, pair.right, pair.eigenvalue)) for row in super()._directions(place, pair))
        return [row + float(pair.left @ change) / norm * by_p for row, change in changes]

    def _continued(
        self, at: FloatArray, value: FloatArray, x: FloatArray | None, y: FloatArray | None
    ) -> tuple[Values, FloatArray]:
        """The pairs at the roots, by Newton's method from some on; F is NaN where it fails."""
        count, width = len(at), self._high - self._low
        place = np.column_stack([at, np.zeros(count)])
        none, pairs = np.zeros(count), np.zeros((2, count, len(self._right)))
        if x is not None and y is not None:
            pairs[:] = x, y
        found = Values(none + math.nan, np.zeros((count, 0)), pairs[0], pairs[1], place, none.copy(), none.copy())
        go_on, share, root = np.arange(count), np.ones(count), value
        for _ in range(STEPS):
            p = np.clip(_away(root), self._low, self._high)
            place[go_on, -1] = (p - self._low) / width
            start = (None, None) if x is None else (found.x[go_on], found.y[go_on])
            of, part = super()._continued(place[go_on], value, *start)
            by_a, by_g = self._pencils(self._rows(place[go_on], len(self.axes)) / width)
            unit = of.value / p - form(of.y, by_a, of.x) + of.value * form(of.y, by_g, of.x)
            root, share[go_on] = p + of.value / unit, np.minimum(share[go_on], part)
            found.x[go_on], found.y[go_on], found.eigenvalue[go_on], found.unit[go_on] = of.x, of.y, of.value, unit
            ends = self._is_settled(p, root) & (self._low <= root) & (root <= self._high)
            found.value[go_on[ends]] = root[ends]
            goes_on = ~ends & np.isfinite(root)
            go_on, root = go_on[goes_on], root[goes_on]
            if not go_on.size:
                break
        return found, share


def _away(p: Any) -> Any:
    """p, or the nearest one that is not next to 0."""
    return np.where(np.abs(p) < NEXT_TO_ZERO, np.copysign(NEXT_TO_ZERO, p), p)
