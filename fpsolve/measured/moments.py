"""Noise of Eq. (7) with bounded tails from a record, by its moments and its quadratic variation.

With b = 1 − r₀ > 0 the stationary density (9) is that of (1 − ξ²/h²)^(1/b), with

    kurtosis κ = 3(2a + 3)/(2a + 5), a = 1/b,   so that a = (5κ − 9)/(2(3 − κ)),   r₀ = 1 − 1/a,
    variance V = 2(D₀/τ₀)/(5 − 3r₀),   and E(dξ)² = 2D₀/τ₀² dt, the quadratic variation.

τ₀ is D₀/τ₀ over D₀/τ₀². Of a record with the step Δ, q(Δ) = E(ξ(t + Δ) − ξ(t))²/(2Δ) is D₀/τ₀² + O(Δ), and
(8q(Δ) − 6q(2Δ) + q(4Δ))/3 is it up to O(Δ³). What a sensor adds to the record as noise of its own spoils this.
"""

from __future__ import annotations

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.measured.fit import NoiseFit
from fpsolve.measured.spectrum import Record
from fpsolve.messages import Code, Message
from fpsolve.model import NonGaussianNoise

BLOCKS = 40
LEAST_TIMES = 20 * BLOCKS
LONGEST_STEP = 0.3
"""Of V/(D₀/τ₀²), after which C = V has fallen by its first slope: D₀/τ₀² is then wrong by a third of its cube."""


def non_gaussian_from_record(record: Record) -> NoiseFit:
    """`NonGaussianNoise` with r₀ < 1 from a record, with the standard errors of means over 40 blocks of it.

    Raises:
        ValueError: the kurtosis is not that of bounded tails, between 9/5 and 3, or the steps are too long.
    """
    x = record.values
    n = x.size // BLOCKS * BLOCKS
    columns = [x**2, x**4]
    for lag in (1, 2, 4):
        moved = np.zeros_like(x)
        moved[:-lag] = (x[lag:] - x[:-lag]) ** 2 / (2 * lag * record.step)
        columns.append(moved * x.size / (x.size - lag))
    blocks = np.array(columns)[:, :n].reshape(len(columns), BLOCKS, -1).mean(axis=2).T
    means = blocks.mean(axis=0)
    theta = _parameters(means)
    covariance_of_means = np.cov(blocks.T) / BLOCKS
    steps = 1e-5 * means
    slopes = np.array([(_parameters(means + h) - _parameters(means - h)) / (2 * h.max()) for h in np.diag(steps)]).T
    noise = NonGaussianNoise(D0=float(theta[0]), tau0=float(theta[1]), r0=float(theta[2]))
    decay = 2 * noise.tau0 / (5 - 3 * noise.r0)
    if record.step > LONGEST_STEP * decay:
        raise ValueError(
            f"the steps of the record are {record.step:.4g}, too long for its quadratic variation; they must be below "
            f"{LONGEST_STEP * decay:.4g}, {LONGEST_STEP:g} of V/(D0/tau0²); record at a higher rate, or fit "
            "another kind"
        )
    times = record.duration / noise.correlation_time
    messages = (Message(Code.SHORT_RECORD, times=times, least=LEAST_TIMES),) if times < LEAST_TIMES else ()
    return NoiseFit(
        parts=(noise,),
        parameters=dict(zip(("D0", "tau0", "r0"), theta.tolist(), strict=True)),
        covariance=slopes @ covariance_of_means @ slopes.T,
        misfit=(),
        spectrum=record.spectrum(),
        messages=messages,
    )


def _parameters(means: FloatArray) -> FloatArray:
    """D₀, τ₀ and r₀ of the means of ξ², ξ⁴, q(Δ), q(2Δ), q(4Δ)."""
    variance, fourth, q1, q2, q4 = means
    kurtosis = fourth / variance**2
    if not 9 / 5 < kurtosis < 3:
        raise ValueError(
            f"the kurtosis of the record is {kurtosis:.4g}; bounded noise of Eq. (7) has one between 1.8 and 3; fit "
            "another kind, such as ornstein-uhlenbeck for 3"
        )
    a = (5 * kurtosis - 9) / (2 * (3 - kurtosis))
    r0 = 1 - 1 / a
    rate = (8 * q1 - 6 * q2 + q4) / 3
    if not rate > 0:
        raise ValueError("the steps of the record are too long for its quadratic variation; record at a higher rate")
    strength = 0.5 * variance * (5 - 3 * r0)
    tau0 = strength / rate
    return np.array([strength * tau0, tau0, r0], dtype=float)
