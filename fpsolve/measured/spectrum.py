"""What was measured: a spectral density at some frequencies, or a record of values at equal steps of time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, Mask, is_whole, shown
from fpsolve.measured.weak import checked_choice, checked_positive

LARGEST = 1e100
"""Of any value, so that squares are numbers."""
MOST_AVERAGES = 1e12
"""Of periodograms: their errors are far below any other then."""
SHORTEST = 64
"""Samples of a record at least."""
SEGMENTS = 64
"""A record is cut into about so many parts, each twice covered, if nothing else is stated."""
SIDES = {"one": 0.5, "two": 1.0}
UNITS = {"Hz": 2 * math.pi, "rad/s": 1.0}


def _column(name: str, values: ArrayLike) -> FloatArray:
    found = np.asarray(values)
    if found.ndim != 1 or found.size == 0 or found.dtype.kind not in "iuf":
        raise ValueError(f"got {name} of shape {found.shape} and type {found.dtype}; must be one column of numbers")
    found = found.astype(float)
    _refuse_rows(
        ~(np.abs(found) <= LARGEST),
        found,
        f"{name} has the value {{value:g}} at row {{row}}; must be a number of at most {LARGEST:g}; remove the row",
    )
    return found


def _refuse_rows(wrong: Mask, values: FloatArray, told: str) -> None:
    """Raise `ValueError` where rows are wrong, with the number and the value of the first of them."""
    if np.any(wrong):
        i = int(np.argmax(wrong))
        raise ValueError(told.format(row=i + 1, value=values[i]))


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A measured spectral density S(ω) = ∫ C(t) cos ωt dt over −∞ < t < ∞, two-sided as `Noise.spectral_density`.

    The variance is ∫ S(ω) dω/(2π) over −∞ < ω < ∞.

    Attributes:
        frequencies: ω ≥ 0, in rad/time, increasing, shape (n,).
        density: S(ω) > 0, in ξ² time, shape (n,).
        relative_error: the standard error of each value over the value, shape (n,); None where it is not known.
        notes: what was assumed where it was read.
        is_formula: whether the values are those of a formula, and have no errors.
        read: what was read, and in which unit, in one line.

    Raises:
        ValueError: there are fewer than 5 values, one is no number, not positive, or the frequencies do not increase.
    """

    frequencies: FloatArray
    density: FloatArray
    relative_error: FloatArray | None = None
    notes: tuple[str, ...] = ()
    is_formula: bool = False
    read: str = ""

    def __post_init__(self) -> None:
        omega, density = _column("frequencies", self.frequencies), _column("density", self.density)
        if omega.size != density.size:
            raise ValueError(f"got {omega.size} frequencies and {density.size} values; there must be one for each")
        if omega.size < 5:
            raise ValueError(f"got {omega.size} frequencies; must be at least 5")
        for wrong, told in (
            (
                omega < 0,
                "the frequency in row {row} is negative; remove such rows, whose densities are those of positive "
                "frequencies, and state that the density is two-sided",
            ),
            (
                np.diff(omega, prepend=-math.inf) <= 0,
                "the frequency in row {row} is not above the one before; sort the rows, keep one of each",
            ),
            (
                density <= 0,
                "the density in row {row} is {value:g}; must be > 0; remove the row, or average more records",
            ),
        ):
            _refuse_rows(wrong, density, told)
        object.__setattr__(self, "frequencies", omega)
        object.__setattr__(self, "density", density)
        if self.relative_error is not None:
            error = np.broadcast_to(np.asarray(self.relative_error, dtype=float), omega.shape).copy()
            if not np.all((error > 0) & np.isfinite(error)):
                raise ValueError("a relative error is not > 0 and finite; state that of every value, or None")
            object.__setattr__(self, "relative_error", error)

    @classmethod
    def from_columns(
        cls,
        f: ArrayLike,
        G: ArrayLike,
        per: Literal["Hz", "rad/s"] = "Hz",
        sided: Literal["one", "two"] = "one",
        averages: float | ArrayLike | None = None,
    ) -> Spectrum:
        """A density G as files have it: G(f) = 2S(2πf) if one-sided per Hz, S(2πf) if two-sided per Hz.

        Per rad/s, where ∫ G dω is the variance, G(ω) = S(ω)/π if one-sided, S(ω)/(2π) if two-sided.

        Args:
            f: frequencies, ≥ 0, in the unit `per`, shape (n,).
            G: the density, in ξ²/Hz or ξ²/(rad/s), shape (n,). A value at f = 0, of the mean, does not count.
            per: "Hz" or "rad/s".
            sided: "one" or "two".
            averages: how many independent periodograms each value is the mean of: its relative standard error is one
                over the root of it. None if that is not known.

        Raises:
            ValueError: as for `Spectrum`, or `per`, `sided` or `averages` is none of these.
        """
        unit, share = UNITS[checked_choice("per", per, UNITS)], SIDES[checked_choice("sided", sided, SIDES)]
        omega, density = _column("f", f) * unit, _column("G", G) * share * (2 * math.pi / unit)
        first, error = int(omega[0] == 0), None
        if averages is not None:
            number = np.broadcast_to(np.asarray(averages, dtype=float), omega.shape)
            if not np.all((number >= 1) & (number <= MOST_AVERAGES)):
                raise ValueError(f"got averages = {shown(averages)}; must be from 1 to {MOST_AVERAGES:g}")
            error = number[first:] ** -0.5
        return cls(omega[first:], density[first:], error)

    def scaled(self, factor: float) -> Spectrum:
        """That of the signal times a factor, such as 1/g."""
        return replace(self, density=self.density * factor**2)


@dataclass(frozen=True, eq=False)
class Record:
    """Values ξ(0), ξ(step), ξ(2 step), …; their mean does not count.

    Attributes:
        values: shape (n,), n ≥ 64.
        step: time between two of them.
        notes: what was assumed where it was read.
        read: what was read, and in which unit, in one line.

    Raises:
        ValueError: there are fewer values, one is no number, all are the same, or the step is not > 0.
    """

    values: FloatArray
    step: float
    notes: tuple[str, ...] = ()
    read: str = ""

    def __post_init__(self) -> None:
        values = _column("values", self.values)
        if values.size < SHORTEST:
            raise ValueError(f"got {values.size} values; must be at least {SHORTEST}")
        if not np.std(values) > 1e-12 * np.max(np.abs(values)):
            raise ValueError("all values are the same; a record must vary")
        checked_positive("step", self.step)
        object.__setattr__(self, "values", values - np.mean(values))

    @property
    def duration(self) -> float:
        return self.step * self.values.size

    def scaled(self, factor: float) -> Record:
        """The signal times a factor."""
        return replace(self, values=self.values * factor)

    @property
    def usual_segment(self) -> int:
        """Samples of a segment if nothing else is stated: n/32 but at least 32, so that 63 overlap by half."""
        return max(2 * (self.values.size // SEGMENTS), 32)

    def spectrum(self, segment: int | None = None) -> Spectrum:
        """Welch's estimate, of segments that overlap by half, see `Segments`.

        With K segments the variance of each value over its square is (1 + (K − 1)/(18K))/K, as the squared
        correlation of two segments that overlap by half is 1/36. Values at neighbouring frequencies are correlated.

        Args:
            segment: samples in each segment; `usual_segment` if None.
        """
        length = self.usual_segment if segment is None else segment
        if not is_whole(length, 16, self.values.size):
            raise ValueError(
                f"got segment = {shown(segment)}; must be a whole number from 16 to {self.values.size}, in samples"
            )
        segments = Segments(length, self.step)
        rows = segments.periodograms(self.values)
        number = len(rows)
        error = math.sqrt((1 + (number - 1) / (18 * number)) / number)
        omega = 2 * math.pi / (length * self.step) * np.arange(length, dtype=float)[segments.inside]
        return Spectrum(omega, rows.mean(axis=0), np.array(error))


class Segments(NamedTuple):
    """Segments of a record that overlap by half.

    Periodograms leave out ω = 0 and the next frequency, on which the mean acts, and the highest one.

    Attributes:
        length: samples of each, n.
        step: time between two samples.
    """

    length: int
    step: float

    @property
    def hop(self) -> int:
        """Samples from the beginning of one to that of the next."""
        return self.length - self.length // 2

    @property
    def window(self) -> FloatArray:
        """Hann's, with the sum of squares 1, shape (n,)."""
        window = np.hanning(self.length + 1)[:-1]
        return window / np.linalg.norm(window)

    @property
    def inside(self) -> slice:
        """The frequencies of the periodograms among those of a transform."""
        return slice(2, self.length // 2)

    def periodograms(self, values: FloatArray) -> FloatArray:
        """Of each segment of these values, one a row, shape (k, m)."""
        rows = sliding_window_view(values, self.length)[:: self.hop]
        return np.asarray(self.step * abs(np.fft.rfft(self.window * rows)[:, self.inside]) ** 2, dtype=float)
