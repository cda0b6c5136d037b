"""What was measured: a spectral density at some frequencies, or a record of values at equal steps of time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import trapezoid
from scipy.ndimage import median_filter

from fpsolve.arrays import FloatArray, is_whole, shown

LARGEST = 1e100
"""Of any value, so that squares are numbers."""
MOST_AVERAGES = 1e12
"""Of periodograms: their errors are far below any other then."""
MOST_VARIANCE = 1.5
"""Of a density over that of its record, which has the other frequencies as well."""
SHORTEST = 64
"""Samples of a record at least."""
SEGMENTS = 64
"""A record is cut into about so many parts, each twice covered, if nothing else is stated."""
AROUND = 11
"""Steps of frequencies around one, itself among them, whose median is taken."""
SIDES = {"one": 0.5, "two": 1.0}
UNITS = {"Hz": 2 * math.pi, "rad/s": 1.0}


def _column(name: str, values: ArrayLike) -> FloatArray:
    found = np.asarray(values)
    if found.ndim != 1 or found.size == 0 or found.dtype.kind not in "iuf":
        raise ValueError(f"got {name} of shape {found.shape} and type {found.dtype}; must be one column of numbers")
    found = found.astype(float)
    if not np.all(np.isfinite(found)):
        i = int(np.flatnonzero(~np.isfinite(found))[0])
        raise ValueError(f"{name} has the value {found[i]} at row {i + 1}; remove rows that are no numbers")
    if np.max(np.abs(found)) > LARGEST:
        i = int(np.argmax(np.abs(found)))
        raise ValueError(f"{name} has the value {found[i]:g} at row {i + 1}; must be at most {LARGEST:g}; correct it")
    return found


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A measured spectral density S(ω) = ∫ C(t) cos ωt dt over −∞ < t < ∞, two-sided as `Noise.spectral_density`.

    The variance is ∫ S(ω) dω/(2π) over −∞ < ω < ∞.

    Attributes:
        frequencies: ω ≥ 0, in rad/time, increasing, shape (n,).
        density: S(ω) > 0, in ξ² time, shape (n,).
        relative_error: the standard error of each value over the value, shape (n,); None where it is not known.
        variance: of the record that it was made of; None where that is not known.
        notes: what was assumed where it was read.
        is_formula: whether the values are those of a formula, and have no errors.

    Raises:
        ValueError: there are fewer than 5 values, one is no number, not positive, or the frequencies do not increase;
            or the variance is not that of the density, as where one-sided values are taken for two-sided ones.
    """

    frequencies: FloatArray
    density: FloatArray
    relative_error: FloatArray | None = None
    variance: float | None = None
    notes: tuple[str, ...] = ()
    is_formula: bool = False

    def __post_init__(self) -> None:
        omega, density = _column("frequencies", self.frequencies), _column("density", self.density)
        if omega.size != density.size:
            raise ValueError(f"got {omega.size} frequencies and {density.size} values; there must be one for each")
        if omega.size < 5:
            raise ValueError(f"got {omega.size} frequencies; must be at least 5")
        if np.any(omega < 0):
            i = int(np.flatnonzero(omega < 0)[0])
            raise ValueError(
                f"the frequency in row {i + 1} is negative; remove such rows, whose densities are those of positive "
                "frequencies, and state that the density is two-sided"
            )
        if np.any(np.diff(omega) <= 0):
            i = int(np.flatnonzero(np.diff(omega) <= 0)[0]) + 1
            raise ValueError(
                f"the frequency in row {i + 1} is not above the one before; sort the rows, keep one of each"
            )
        if np.any(density <= 0):
            i = int(np.flatnonzero(density <= 0)[0])
            raise ValueError(
                f"the density in row {i + 1} is {density[i]:g}; must be > 0; remove the row, or average more records"
            )
        object.__setattr__(self, "frequencies", omega)
        object.__setattr__(self, "density", density)
        if self.relative_error is not None:
            error = np.broadcast_to(np.asarray(self.relative_error, dtype=float), omega.shape).copy()
            if not np.all((error > 0) & np.isfinite(error)):
                raise ValueError("a relative error is not > 0 and finite; state that of every value, or None")
            object.__setattr__(self, "relative_error", error)
        if self.variance is not None:
            self._refuse_wrong_sides(self.variance)

    def _refuse_wrong_sides(self, variance: float) -> None:
        if not 0 < variance < math.inf:
            raise ValueError(f"got variance = {shown(variance)}; must be a number > 0 and finite")
        ratio = self.covered_variance / variance
        factors = {2.0: "sided", 0.5: "sided", 2 * math.pi: "per", 1 / (2 * math.pi): "per"}
        factors |= {math.pi: "sided and per", 4 * math.pi: "sided and per", 1 / math.pi: "sided and per"}
        factors |= {0.25 / math.pi: "sided and per"}
        near = min([1.0, *factors], key=lambda each: abs(math.log(ratio / each)))
        if near != 1.0 and abs(math.log(ratio / near)) < 0.2:
            raise ValueError(
                f"the density has the variance {self.covered_variance:.4g}, but the record {variance:.4g}, some "
                f"{near:.3g} times as much; state another {factors[near]}"
            )
        if ratio > MOST_VARIANCE:
            raise ValueError(
                f"the density has the variance {self.covered_variance:.4g}, {ratio:.3g} times that of the record, "
                f"{variance:.4g}; correct the unit of one of them"
            )

    @property
    def covered_variance(self) -> float:
        """2∫ S(ω) dω/(2π) over the frequencies, by trapezia, in ξ²."""
        return float(trapezoid(self.density, self.frequencies)) / math.pi

    @classmethod
    def from_columns(
        cls,
        f: ArrayLike,
        G: ArrayLike,
        per: Literal["Hz", "rad/s"] = "Hz",
        sided: Literal["one", "two"] = "one",
        averages: float | ArrayLike | None = None,
        variance: float | None = None,
    ) -> Spectrum:
        """A density G as files have it: G(f) = 2S(2πf) if one-sided per Hz, S(2πf) if two-sided per Hz.

        Per rad/s, where ∫ G dω is the variance, G(ω) = S(ω)/π if one-sided, S(ω)/(2π) if two-sided.

        Args:
            f: frequencies, ≥ 0, in the unit `per`, shape (n,).
            G: the density, in ξ²/Hz or ξ²/(rad/s), shape (n,). A value at f = 0 is left out, which is the mean's.
            per: "Hz" or "rad/s".
            sided: "one" or "two".
            averages: how many independent periodograms each value is the mean of: its relative standard error is one
                over the root of it. None if that is not known.
            variance: of the record, with which the density is compared; None if it is not known.

        Raises:
            ValueError: as for `Spectrum`, or `per`, `sided` or `averages` is none of these.
        """
        for name, value, known in (("per", per, UNITS), ("sided", sided, SIDES)):
            if value not in known:
                raise ValueError(f"got {name} = {shown(value)}; must be one of {', '.join(known)}")
        omega = _column("f", f) * UNITS[per]
        density = _column("G", G) * SIDES[sided] * (2 * math.pi if per == "rad/s" else 1.0)
        error = None
        if averages is not None:
            number = np.broadcast_to(np.asarray(averages, dtype=float), omega.shape)
            if not np.all((number >= 1) & (number <= MOST_AVERAGES)):
                raise ValueError(f"got averages = {shown(averages)}; must be from 1 to {MOST_AVERAGES:g}")
            error = 1 / np.sqrt(number)
        kept = omega != 0
        if omega.size == density.size:
            omega, density, error = omega[kept], density[kept], None if error is None else error[kept]
        return cls(omega, density, error, variance)

    def scaled(self, factor: float) -> Spectrum:
        """That of the signal times a factor, such as one of `fpsolve.measured.of_support_acceleration`."""
        variance = None if self.variance is None else self.variance * factor**2
        return replace(self, density=self.density * factor**2, variance=variance)


@dataclass(frozen=True, eq=False)
class Record:
    """Values ξ(0), ξ(step), ξ(2 step), …; their mean does not count.

    Attributes:
        values: shape (n,), n ≥ 64.
        step: time between two of them.
        notes: what was assumed where it was read.

    Raises:
        ValueError: there are fewer values, one is no number, all are the same, or the step is not > 0.
    """

    values: FloatArray
    step: float
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        values = _column("values", self.values)
        if values.size < SHORTEST:
            raise ValueError(f"got {values.size} values; must be at least {SHORTEST}")
        if not float(np.std(values)) > 1e-12 * float(np.max(np.abs(values))):
            raise ValueError("all values are the same; a record must vary")
        if not 0 < self.step < math.inf:
            raise ValueError(f"got step = {shown(self.step)}; must be a time > 0 and finite")
        object.__setattr__(self, "values", values - np.mean(values))

    @property
    def duration(self) -> float:
        return self.step * self.values.size

    def scaled(self, factor: float) -> Record:
        """The signal times a factor."""
        return replace(self, values=self.values * factor)

    def segment_length(self, segment: int | None = None) -> int:
        """Samples of a segment; n/32 but at least 32, so that 63 segments overlap by half, if none is stated."""
        n = self.values.size
        if segment is None:
            return max(2 * (n // SEGMENTS), 32)
        if not is_whole(segment, 16, n):
            raise ValueError(f"got segment = {shown(segment)}; must be a whole number from 16 to {n}, in samples")
        return int(segment)

    def spectrum(self, segment: int | None = None) -> Spectrum:
        """Welch's estimate by `scipy.signal.welch`, Hann's window, segments that overlap by half.

        With K segments the variance of each value over its square is (1 + (K − 1)/(18K))/K, as the squared
        correlation of two segments that overlap by half is 1/36. Values at neighbouring frequencies are correlated.
        Those at ω = 0, at the next frequency, on which the mean acts, and at the highest one are left out.

        Args:
            segment: samples in each segment; see `segment_length`.
        """
        from scipy.signal import welch

        length = self.segment_length(segment)
        f, one_sided = welch(self.values, 1 / self.step, nperseg=length, noverlap=length // 2, detrend="constant")
        inside = slice(2, len(f) - 1)
        error = np.full(len(f), math.sqrt(welch_variance(self.values.size, length)))
        return Spectrum(2 * math.pi * f[inside], 0.5 * one_sided[inside], error[inside])


def welch_segments(n: int, length: int) -> int:
    """How many segments of a length, which overlap by half, n values have."""
    return (n - length) // (length - length // 2) + 1


def welch_variance(n: int, length: int) -> float:
    """The variance of a value of Welch's estimate over its square."""
    number = welch_segments(n, length)
    return (1 + (number - 1) / (18 * number)) / number


def bracketed(frequencies: FloatArray, omega: float) -> bool:
    """Whether there is a point near ω: two neighbours with ω between them and apart by a quarter of ω at most."""
    k = int(np.searchsorted(frequencies, omega))
    inside = 0 < k < frequencies.size
    return bool(inside and frequencies[k] - frequencies[k - 1] <= 0.25 * omega) or bool(
        np.any(np.abs(frequencies - omega) <= 1e-9 * omega)
    )


def gaps(spectrum: Spectrum) -> Sequence[tuple[float, float]]:
    """Where two neighbouring frequencies are farther apart than ten times the median of those around, in rad/time."""
    steps = np.diff(spectrum.frequencies)
    wide = np.flatnonzero(steps > 10 * median_filter(steps, AROUND, mode="nearest"))
    return [(float(spectrum.frequencies[i]), float(spectrum.frequencies[i + 1])) for i in wide]
