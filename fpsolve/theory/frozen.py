"""Where slow noise carries the p-th moment: the growth rate of paths that hold the noise at one value."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpsolve.arrays import FloatArray, IntArray
from fpsolve.model.coordinates import framed
from fpsolve.model.plane import squared_frequency
from fpsolve.model.problem import Problem

SAMPLES = 601
"""Number of values of a noise on each side, and of amplitudes of its swings."""
FREQUENCIES = np.linspace(0, 2, 41)
"""Frequencies at which the noise of a filter may swing, over that of the filter."""
SWING_POINTS = 32
"""Number of points of half a turn of a swing."""
LARGEST_P = 25.0
"""Largest p whose places are certainly among those that are looked at."""
CENTER_ERROR = 0.1
"""Error of the centre of a tilted density, in standard deviations."""
ZOOM = 41
"""Number of points between two that are farther apart."""


def eigenvalues_at(problem: Problem, xi: ArrayLike) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Growth rates of ln ‖x‖ at ξ, that of the faster mode first, and whether the phase turns.

    Where A(ξ) has real eigenvalues they are the rates; where the phase turns, their common real part and the jumps,
    each once in half a turn.
    """
    a = framed(problem).motion.matrix_at(xi)
    half, square = 0.5 * (a[..., 0, 0] + a[..., 1, 1]), squared_frequency(a)
    root, turns = np.sqrt(np.abs(square)), square > 0
    turning = half + root / math.pi * sum(jump.log_factor for jump in problem.linear.jumps)
    larger = half + np.copysign(root, half)  # in size; the other one from the determinant, without cancellation
    determinant = a[..., 0, 0] * a[..., 1, 1] - a[..., 0, 1] * a[..., 1, 0]
    other = np.divide(determinant, larger, out=np.zeros_like(larger), where=larger != 0)
    faster, slower = np.maximum(larger, other), np.minimum(larger, other)
    return np.where(turns, turning, faster), np.where(turns, turning, slower), turns


def maxima(rate: FloatArray) -> IntArray:
    """Where a value is larger than those beside it."""
    return np.flatnonzero((rate[1:-1] > rate[:-2]) & (rate[1:-1] >= rate[2:])) + 1


def steady_places(problem: Problem, p: float) -> tuple[FloatArray, FloatArray]:
    """z at which paths that hold slow Gaussian noise grow the fastest, the best first, and the rates pG − ξ²/2S(0)."""
    noise = problem.valued
    unit, spectrum = noise.standard_deviation, noise.spectral_density(0.0)
    reach = 2 * abs(p) * _noise_strength(problem) * spectrum
    xi = reach * np.linspace(-1, 1, 2 * SAMPLES - 1)
    rate = p * eigenvalues_at(problem, xi)[0] - (xi**2 / (2 * spectrum) if spectrum else 0.0)
    at = maxima(rate)
    at = at[np.argsort(-rate[at])] if at.size else np.array([SAMPLES - 1])
    return xi[at] / unit, rate[at]


def swing(problem: Problem, p: float) -> tuple[float, float]:
    """Amplitude in z and growth rate of paths on which noise of a filter swings as ξ = a cos ωt, at the best a and ω.

    The rate is p⟨G⟩ − a²/4S(ω), the mean over a turn of ωt; where S is larger than at 0 it may exceed that of
    `steady_places`.
    """
    noise: Any = problem.valued
    peak = noise.omega * math.sqrt(max(1 - 2 * noise.zeta**2, 0.0))
    spectrum = max(noise.spectral_density(each) for each in (peak, *(noise.omega * FREQUENCIES)))
    a = 4 * abs(p) * _noise_strength(problem) * spectrum * np.linspace(0, 1, SAMPLES)
    xi = a[:, None] * np.cos(math.pi * (np.arange(SWING_POINTS) + 0.5) / SWING_POINTS)
    rate = p * np.mean(eigenvalues_at(problem, xi)[0], axis=1) - a**2 / (4 * spectrum)
    best = int(np.argmax(rate))
    return float(a[best]) / noise.standard_deviation, float(rate[best])


class FrozenNoise:
    """The growth rate F(z; p) of ‖x‖^p on paths that hold the noise at z, and where it is the largest.

    F = p G(ξ) − cost, see `Noise.holding_cost`. G is the growth rate of ln ‖x‖ with ξ frozen, the largest real part of
    an eigenvalue of A(ξ): for the paper's oscillator εξ/2 while it oscillates, |εξ| < 2ω, and what the impacts take,
    the rate of the faster real mode beyond. For p < −1 the paths that stay on the other real mode carry more:
    (p + 1)·slow − fast. Slow noise has its tilted density where F is largest, and more than one such place. Far out
    there is none: Gaussian noise is held at a cost ~ξ², bounded noise of Eq. (9) at one ~1/(distance to its end)², and
    the gain is at most linear in ξ.

    Args:
        problem: its noise must be a diffusion without algebraic tails.
        z: where ξ is held, increasing, shape (n,); without it points on both sides, denser near 0.
    """

    def __init__(self, problem: Problem, z: FloatArray | None = None) -> None:
        noise = problem.valued
        if not noise.is_diffusion:
            raise TypeError("there is no z to look for where ξ is no diffusion by itself")
        self.z, self._problem = _both_sides(problem) if z is None else z, problem
        self._xi = noise.standard_deviation * self.z
        self._faster, self._slower, self._turns = eigenvalues_at(problem, self._xi)
        self._holding = noise.holding_cost(self._xi)

    def rate(self, p: float) -> FloatArray:
        """F at `z`."""
        growth = p * self._faster
        if p < -1:
            growth = np.where(self._turns, growth, np.maximum(growth, (p + 1) * self._slower - self._faster))
        return growth - self._holding

    def peaks(self, p: float) -> tuple[FloatArray, FloatArray]:
        """z and F of the local maxima."""
        found = np.array([self._peak(p, int(k)) for k in maxima(self.rate(p))]).reshape(-1, 2)
        return found[:, 0], found[:, 1]

    def center(self, p: float) -> float:
        """About the mean z of the tilted density."""
        return self._peak(p, int(np.argmax(self.rate(p))))[0]

    def _peak(self, p: float, best: int) -> tuple[float, float]:
        """z and F of the maximum next to a number of `z`."""
        held = self
        while True:
            lower, upper = held.z[[max(best - 1, 0), min(best + 1, held.z.size - 1)]]
            if upper - lower <= CENTER_ERROR:
                return float(held.z[best]), float(held.rate(p)[best])
            held = FrozenNoise(self._problem, np.linspace(lower, upper, ZOOM))
            best = int(np.argmax(held.rate(p)))

    def rests(self, p: float, lower: float = -math.inf, upper: float = math.inf) -> bool:
        """Whether the phase does not turn at the largest F between two z."""
        rate = np.where((self.z >= lower) & (self.z <= upper), self.rate(p), -math.inf)
        return not self._turns[np.argmax(rate)]

    def tilt(self, z: float) -> float:
        """s for which P_s exp(2s z) is the largest at z: −½(ln P_s)′."""
        noise = self._problem.valued
        return -0.5 * float(np.interp(z, self.z, np.gradient(noise.log_density(self._xi), self.z)))


def _noise_strength(problem: Problem) -> float:
    """Σ ε^n max|q| max|g(ξ) − g(0)|/|ξ| over what the noise reaches; for the paper's oscillator ε."""
    system, total = framed(problem).motion, 0.0
    for term in system.terms:
        xi = problem.named_noise(term.noise).reached
        rise = np.abs(term.g(xi) - term.g(0.0)) / np.where(xi, np.abs(xi), np.inf)
        total += np.max(rise) * system.epsilon**term.order * float(abs(term.q.mean) + term.q.amplitude)
    return total


def _both_sides(problem: Problem) -> FloatArray:
    """Points z as far out as slow noise carries a moment, denser near 0."""
    noise = problem.valued
    unit = noise.standard_deviation
    furthest = 5 * LARGEST_P * unit * _noise_strength(problem) * noise.correlation_time
    end = min(max(furthest, 1.0), 0.999 * noise.half_width / unit)
    spread = max(np.log(end / 1e-2), 1.0)
    side = end * np.sinh(spread * np.linspace(0, 1, SAMPLES)) / np.sinh(spread)
    return np.concatenate([-side[:0:-1], side])


@lru_cache(8)
def frozen_noise(problem: Problem) -> FrozenNoise | None:
    """The `FrozenNoise` of a problem; None beyond the plane, where ξ is no diffusion, or has algebraic tails."""
    noise = problem.valued
    is_held = noise.is_diffusion and not noise.has_algebraic_tails
    return FrozenNoise(problem) if is_held and problem.dimension == 2 else None
