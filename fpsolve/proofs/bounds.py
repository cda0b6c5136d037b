"""What a trial function leaves over on cells of z, bounded in balls: the numbers that (*) of `factor` needs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

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


@dataclass(frozen=True)
class Bounds:
    """Of a trial on cells of z, each of shape (cells,).

    Attributes:
        mismatch: above |Lu/u − μ|; ∞ where u > 0 is not certain.
        steep_low, steep_high: around u_z/u; for λ around f_z.
        inward_low, inward_high: around B; for λ around b.
    """

    mismatch: FloatArray
    steep_low: FloatArray
    steep_high: FloatArray
    inward_low: FloatArray
    inward_high: FloatArray


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
        remainder = self._size(cells.modes(trial.mismatch), divisor)
        if trial.noise.is_bounded and not isinstance(trial.basis, Whole):
            cleared = [below(1 - ball(each) ** 2) for each in np.maximum(np.abs(low), np.abs(high)).tolist()]
            remainder = raised(remainder / np.array(cleared))
        steep = self._range(cells.modes(trial.slope), divisor)
        drift = [[bound(trial.noise.drift(z)) for z in balls(each)] for bound, each in ((below, low), (above, high))]
        bend = trial.basis.gauge + (np.array(steep) if trial.p is not None else np.zeros((2, 1)))
        inward = [np.array(b) - each for b, each in zip(drift, (bend[1], bend[0]), strict=True)]
        slack = 8 * 2.0**-53 * (np.abs(np.array(drift)) + np.abs(bend[::-1]))
        return Bounds(remainder, *steep, inward[0] - slack[0], inward[1] + slack[1])

    def ends(self, z: FloatArray, sign: int) -> list[End]:
        """Where u may be held, on the right or, with sign −1, on the left."""
        noise, cells, at = self.trial.noise, Cells(self.trial.basis, z, z), balls(z)
        divisor = self._divisor(cells)
        steep = np.abs(self._range(cells.modes(self.trial.slope), divisor)).max(0)
        drifts, sizes = (noise.drift(at), noise.drift_slope(at)), []
        for part, drift in zip(self.trial.held, drifts, strict=True):
            modes = cells.modes(part)
            if self.trial.p is not None:
                values = cells.modes(padded(self.trial.values, waves=1))
                modes = modes.minus(noise.nu * ball(self.trial.basis.gauge) * drift, values)
            sizes.append(self._size(modes, divisor))
        pulls = [[below(each) for each in (sign * drifts[0]).tolist()], [below(each) for each in drifts[1].tolist()]]
        return [End(*map(float, each)) for each in zip(steep, *sizes, *pulls, strict=True)]

    def _divisor(self, cells: Cells) -> Range:
        """Around u on every cell of φ and z; 1 for λ, where nothing is divided by f."""
        if self.trial.p is None:
            return np.ones((1, 1)), np.ones((1, 1))
        return self._phases.bounds(cells.modes(self.trial.values))

    def _size(self, part: Modes, divisor: Range) -> FloatArray:
        """Above |part|/u on every cell of z; ∞ where u > 0 is not certain."""
        low, high = self._range(part, divisor)
        return np.maximum(high, -low)

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
