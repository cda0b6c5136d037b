"""The zero of an increasing function of which each value costs a solve: Newton's method in a bracket.

A step that leaves the bracket leads to an end that was not tried, or halves the bracket, as does one that is not half
as long as the last but one. Where the function has no value the search goes halfway back to where it has one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

MOST_RETREATS = 3
"""Largest number of points without a value from which a search goes back."""
ROUNDING = 1e-13
"""Step that is rounding, relative to the larger of 1 and |x|."""


class Missing(Exception):
    """The function has no value at a point, its argument; the cause is why."""


class NoRoot(Exception):
    """The values have one sign up to a point, and beyond it there is no other, or it is not known.

    Attributes:
        is_negative: whether they are negative, so that the zero would be above the point.
        last: the point.
        missing: the first point beyond it that has no value; None where it is the end.
    """

    def __init__(self, last: float, missing: Missing | None, *, is_negative: bool) -> None:
        super().__init__(last)
        self.last, self.missing, self.is_negative = last, missing, is_negative


class Value(NamedTuple):
    """A function at a point.

    Attributes:
        value, slope: the function and its derivative.
        exact: |value| up to which it counts as 0.
        close: |value| up to which it does where the step is not half as long as the last one.
    """

    value: float
    slope: float
    exact: float
    close: float = 0.0


def increasing_root(
    function: Callable[[float], Value],
    start: float,
    ends: tuple[float, float],
    known: tuple[float, ...] = (),
    reach: float = math.inf,
) -> float:
    """Where an increasing function is 0: the last point at which it was taken.

    Args:
        function: its value at a point; raises `Missing` where there is none.
        start: the first point.
        ends: the zero is looked for between these, which are finite.
        known: those of them at which the value is known to have its sign; they are not tried.
        reach: |x| up to which a step may lead; from further out it leads to twice |x| at most.

    Raises:
        NoRoot: the values have one sign up to an end, or as far as there are any.
        Missing: there is no value at the start, or between two points at which they have both signs.
    """
    (low, high), steps = ends, [ends[1] - ends[0]] * 2
    tried, signed, missing = set(known), set(known), list[Missing]()
    x = min(max(start, low), high)
    while True:
        tried.add(x)
        try:
            value, slope, exact, close = function(x)
        except Missing as failure:
            if len(sides := signed & {low, high}) != 1:
                raise
            missing.append(failure)
            [inner] = sides
            if len(missing) > MOST_RETREATS:
                raise NoRoot(inner, missing[0], is_negative=inner == low) from None
            low, high = (low, x) if inner == low else (x, high)
            x = 0.5 * (inner + x)
            continue
        signed.add(x)
        step, least = -value / slope if slope else math.inf, ROUNDING * max(1.0, abs(x))
        is_rounding = abs(step) <= least or 0 < high - low <= 10 * least
        if abs(value) <= exact or is_rounding or (abs(value) <= close and abs(step) > 0.5 * steps[-1]):
            return x
        low, high = (x, high) if value < 0 else (low, x)
        if low == high:
            raise NoRoot(x, None, is_negative=value < 0)
        farthest = max(reach, 2 * abs(x))
        new = min(max(x + step, -farthest), farthest)
        if not low < new < high:
            if missing and not {low, high} <= signed:
                raise NoRoot(x, missing[0], is_negative=value < 0)
            new = next((end for end in (low, high) if end not in tried), 0.5 * (low + high))
        elif abs(new - x) > 0.5 * steps[-2]:
            new = 0.5 * (low + high)
        steps.append(abs(new - x))
        x = new
