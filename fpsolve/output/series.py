"""Curves of a figure: their numbers, and which key of theirs a colour tells, which a line style."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.sections import Value, Varied

STYLES = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
"""Of lines, for up to so many combinations of keys."""


@dataclass(frozen=True, eq=False)
class Series:
    """One curve of a figure: finite elements at (x, y), a line of perturbation theory through (line_x, line_y).

    Attributes:
        varied: the parameters that tell it from the others.
        simulated: x, y and the standard errors of y from a simulation, shape (3, n).
        rare: which of the x have moments that rare paths carry, shape (n,).
        root: the stability index, which is marked on the zero line; None where there is none among the x.
        slope: λ, which is marked as the tangent at 0; None where it is not.
    """

    varied: Varied
    x: FloatArray
    y: FloatArray
    line_x: FloatArray = field(default_factory=lambda: np.zeros(0))
    line_y: FloatArray = field(default_factory=lambda: np.zeros(0))
    simulated: FloatArray | None = None
    rare: Any = False
    root: float | None = None
    slope: float | None = None

    @property
    def every(self) -> int:
        """Of so many x one has a marker."""
        return max(1, self.x.size // 25)

    @property
    def far(self) -> FloatArray:
        """x and y where rare paths carry the moment, shape (2, n)."""
        chosen = np.broadcast_to(self.rare, self.x.shape).astype(bool)
        return np.stack([self.x[chosen], self.y[chosen]])


@dataclass(frozen=True)
class Encoding:
    """What tells many curves from each other.

    Attributes:
        key: the one whose value a colour tells; None where it tells the number of the curve.
        colours: that value, or the number, of each curve.
        styles: for each curve what its line style tells; the same everywhere where it tells nothing.
        unencoded: the other keys, each with how many values it has.
    """

    key: str | None
    colours: FloatArray
    styles: tuple[tuple[tuple[str, Value], ...], ...]
    unencoded: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, varied: Sequence[Varied]) -> Encoding:
        """Of the parameters of some curves: a colour for the key with the most values, line styles for a few sets."""
        numbers, texts = numbers_of(varied), texts_of(varied)
        sets = len({tuple(each[key] for key in numbers) for each in varied})
        key = max(numbers, key=lambda name: numbers[name], default=None)
        if key is not None and numbers[key] < sets and np.prod([*numbers.values()]) != sets:
            key = None  # values side by side, none of which tells the curve
        if key is None:
            colours = np.arange(1.0, len(varied) + 1)
            return cls(None, colours, _among(varied, texts), ())
        others = [name for name in numbers if name != key] if numbers[key] < sets else []
        styles = _among(varied, [*others, *texts])
        is_encoded = len(set(styles)) <= len(STYLES)
        return cls(
            key,
            np.array([each[key] for each in varied], dtype=float),
            styles if is_encoded else _among(varied, texts),
            () if is_encoded else tuple((name, numbers[name]) for name in others),
        )


def numbers_of(varied: Sequence[Varied]) -> dict[str, int]:
    """The keys of numbers that have several values, and how many."""
    return {key: count for key, count in _counts(varied).items() if not isinstance(varied[0][key], str)}


def texts_of(varied: Sequence[Varied]) -> list[str]:
    """The keys of texts that have several values."""
    return [key for key in _counts(varied) if isinstance(varied[0][key], str)]


def _counts(varied: Sequence[Varied]) -> dict[str, int]:
    counts = {key: len({each[key] for each in varied}) for key in varied[0]}
    return {key: count for key, count in counts.items() if count > 1}


def _among(varied: Sequence[Varied], keys: Sequence[str]) -> tuple[tuple[tuple[str, Value], ...], ...]:
    """Of each curve the values of some keys."""
    return tuple(tuple((key, each[key]) for key in keys) for each in varied)
