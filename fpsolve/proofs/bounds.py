"""What a trial function leaves over on cells of z, bounded in balls: the numbers that (*) of `factor` needs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import Balls, above, ball, balls, below, raised
from fpsolve.proofs.basis import Basis, Whole, drift_mismatch, held, mismatch, padded
from fpsolve.proofs.cells import Cells, Modes
from fpsolve.proofs.factor import End
from fpsolve.proofs.phases import Phases
from fpsolve.proofs.statement import Cylinder


@dataclass(frozen=True)
class Trial:
    """A function on the cylinder, and the number near which Λ(p), or λ, is to be proven.

    Attributes:
        noise: Eq. (19).
        p: the moment; None where f of λ is tried.
        mu: μ.
        cosine, sine: u = Σ (cosine_km cos 2kφ + sine_km sin 2kφ) B_m(z), floats that are taken as exact, k = 0 … K.
    """

    noise: Cylinder
    p: Any
    mu: float
    basis: Basis
    cosine: FloatArray
    sine: FloatArray

    @cached_property
    def _u(self) -> Balls:
        """Coefficients of e^{2ikφ}."""
        from flint import acb

        real, imag = balls(self.cosine), balls(-self.sine)
        half, mirrored = ((real + sign * acb(0, 1) * imag) / 2 for sign in (1, -1))
        return np.concatenate([mirrored[:0:-1], half[:1] + mirrored[:1], half[1:]])

    @cached_property
    def values(self) -> Balls:
        """u."""
        return self.basis.values(self._u)

    @cached_property
    def slope(self) -> Balls:
        """u_z."""
        return self.basis.slope(self._u)

    @cached_property
    def mismatch(self) -> Balls:
        """D (Lu − μu), or D (q + κh + L(0) f − μ)."""
        if self.p is None:
            return drift_mismatch(self.basis, self._u, self.noise, ball(self.mu))
        return mismatch(self.basis, self._u, self.noise, self.p, ball(self.mu))

    @cached_property
    def held(self) -> tuple[Balls, Balls]:
        """What n u and n_z u of `factor` are made of, or n and n_z."""
        return held(self.basis, self._u, self.noise, self.p, ball(self.mu))

    @property
    def waves(self) -> int:
        """K."""
        return len(self.cosine) - 1


Range = tuple[FloatArray, FloatArray]
Pair = tuple[float, float]


@dataclass(frozen=True)
class Bounds:
    """Of a trial on cells of z, a pair of arrays of shape (cells,) below and above each.

    Attributes:
        mismatch: around Lu/u − μ; infinite where u > 0 is not certain.
        inward: around B; for λ around b.
    """

    mismatch: Range
    inward: Range

    @property
    def is_positive(self) -> NDArray[np.bool_]:
        """Where u > 0 is certain."""
        return np.isfinite(self.mismatch[0]) & np.isfinite(self.mismatch[1])

    def above(self, sense: int) -> FloatArray:
        """Above e of `factor`."""
        return self.mismatch[1] if sense > 0 else -self.mismatch[0]


@dataclass(frozen=True)
class HeldBounds:
    """Where u may be held, each below and above, on the right or mirrored onto it.

    Attributes:
        steep: around u_z/u; for λ around f_z.
        mismatch, growth: around n and n_z of `factor`.
        drift, slope: below b and b′.
    """

    steep: Pair
    mismatch: Pair
    growth: Pair
    drift: float
    slope: float

    def end(self, sense: int) -> End:
        """What counts for the upper or the lower bound."""
        drop, mismatch, growth = (-self.steep[0], self.mismatch[1], self.growth[1])
        if sense < 0:
            drop, mismatch, growth = (self.steep[1], -self.mismatch[0], -self.growth[0])
        return End(drop, mismatch, growth, self.drift, self.slope)


class Bounder:
    """Bounds a trial on cells.

    Args:
        phases: how many cells of φ.
    """

    def __init__(self, trial: Trial, phases: int) -> None:
        self.trial, self._phases = trial, Phases(phases, trial.waves + 1)

    def bounds(self, low: FloatArray, high: FloatArray) -> Bounds:
        """On cells [low, high]."""
        trial = self.trial
        cells = Cells(trial.basis, low, high)
        divisor = self._divisor(cells)
        mismatch = self._range(cells.modes(trial.mismatch), divisor)
        if trial.noise.is_bounded and not isinstance(trial.basis, Whole):
            mismatch = _divided(mismatch, low, high)
        bend = np.zeros((2, 1))
        if trial.p is not None:
            bend = trial.basis.gauge + np.array(self._range(cells.modes(trial.slope), divisor))
        drift = [[bound(trial.noise.drift(z)) for z in balls(each)] for bound, each in ((below, low), (above, high))]
        slack = 8 * 2.0**-53 * (np.abs(np.array(drift)) + np.abs(bend[::-1]))
        inward = np.array(drift) - bend[::-1]
        return Bounds(mismatch, (inward[0] - slack[0], inward[1] + slack[1]))

    def held(self, z: FloatArray, sign: int) -> list[HeldBounds]:
        """Where u may be held, on the right or, with sign −1, on the left."""
        noise, cells, at = self.trial.noise, Cells(self.trial.basis, z, z), balls(z)
        divisor = self._divisor(cells)
        drifts = (noise.drift(at), noise.drift_slope(at))
        ranges = [self._range(cells.modes(self.trial.slope), divisor)]
        for part, drift in zip(self.trial.held, drifts, strict=True):
            modes = cells.modes(part)
            if self.trial.p is not None:
                values = cells.modes(padded(self.trial.values, waves=1))
                modes = modes.minus(noise.nu * ball(self.trial.basis.gauge) * drift, values)
            ranges.append(self._range(modes, divisor))
        steep, mismatch, growth = (list(zip(*(each.tolist() for each in pair), strict=True)) for pair in ranges)
        return [
            HeldBounds(
                _mirrored(steep[j], sign),
                mismatch[j],
                _mirrored(growth[j], sign),
                below(sign * drifts[0][j]),
                below(drifts[1][j]),
            )
            for j in range(len(z))
        ]

    def _divisor(self, cells: Cells) -> Range:
        """Around u on every cell of φ and z; 1 for λ, where nothing is divided by f."""
        if self.trial.p is None:
            return np.ones((1, 1)), np.ones((1, 1))
        return self._phases.bounds(cells.modes(self.trial.values))

    def _range(self, part: Modes, divisor: Range) -> Range:
        """Around part/u on every cell of z."""
        (low, high), (least, most) = self._phases.bounds(part), divisor
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = [
                np.where(least > 0, each / np.where(sign * each > 0, least, most), sign * np.inf)
                for each, sign in ((low, -1), (high, 1))
            ]
        least_ratio, most_ratio = ratios[0].min(0), ratios[1].max(0)
        return least_ratio - raised(np.abs(least_ratio)) * 2.0**-51, most_ratio + raised(np.abs(most_ratio)) * 2.0**-51


def _divided(bounds: Range, left: FloatArray, right: FloatArray) -> Range:
    """Bounds of D times a mismatch on cells as those of the mismatch, D = 1 − z² > 0."""
    farthest = np.maximum(np.abs(left), np.abs(right))
    nearest = np.where(left * right > 0, np.minimum(np.abs(left), np.abs(right)), 0.0)
    least = np.array([below(1 - ball(each) ** 2) for each in farthest.tolist()])
    most = np.array([above(1 - ball(each) ** 2) for each in nearest.tolist()])
    low, high = (each / np.where(sign * each > 0, least, most) for each, sign in zip(bounds, (-1, 1), strict=True))
    return low - 2.0**-51 * raised(np.abs(low)), high + 2.0**-51 * raised(np.abs(high))


def _mirrored(pair: Pair, sign: int) -> Pair:
    """Bounds of a number that changes its sign with z."""
    return pair if sign > 0 else (-pair[1], -pair[0])
