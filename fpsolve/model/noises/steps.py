"""How paths of noises go on: the numbers of one step, with a function that numba compiles.

`draw(step, xi, xi_mean, xi_end, push, rng)` draws, for a step that begins at `xi`, the mean of ξ over the step into
`xi_mean` and its end into `xi_end`, all of the shape (n,), and where there may be a bias it adds ∫f(ξ) dt to `push`.
Where noise is told by several rows, `xi` has them too: `draw` moves all rows but the first, ξ, which its caller sets to
`xi_end`. ζ is normal.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from fpsolve.arrays import FloatArray


class ChainStep(NamedTuple):
    """The law of the jumps, which come after exponential times: no step is made.

    Attributes:
        leaving: the rate at which each state is left, shape (n,).
        reached: the probability that a state is followed by one of the first j + 1, shape (n, n).
        values: ξ in each state, shape (n,).
        sizes: what comes on top of ∫ξ dt where a state is reached, shape (n,).
    """

    leaving: FloatArray
    reached: FloatArray
    values: FloatArray
    sizes: FloatArray


class WhiteStep(NamedTuple):
    """dW/dt in a step: its mean ΔW/h and the slope of the line with the same ∫W dt, both exactly.

    Attributes:
        mean, rise: their standard deviations 1/√h, and √3/√h of half the difference of the ends of the line.
    """

    mean: float
    rise: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):
        """One step; its beginning is drawn anew, too."""
        for i in range(xi.size):
            xi_mean[i] = step.mean * rng.standard_normal()
        for i in range(xi.size):
            xi_end[i] = step.rise * rng.standard_normal()
            xi[i] = -xi_end[i]


class LinearStep(NamedTuple):
    """The exact transition: ξ₁ = decay ξ₀ + kick ζ₁ + end₀ and ξ̄ = mean ξ₀ + mean₁ ζ₁ + mean₂ ζ₂ + mean₀."""

    rate: float
    decay: float
    kick: float
    end0: float
    mean: float
    mean1: float
    mean2: float
    mean0: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):
        """One step."""
        for i in range(xi.size):
            xi_end[i] = rng.standard_normal()
        for i in range(xi.size):
            xi_mean[i] = rng.standard_normal()
        for i in range(xi.size):
            first, start = xi_end[i], xi[i]
            xi_end[i] = step.decay * start + step.kick * first + step.end0
            xi_mean[i] = step.mean * start + step.mean1 * first + step.mean2 * xi_mean[i] + step.mean0
            push[i] -= step.rate * xi_mean[i]


def linear_step(alpha: float, sigma: float, h: float, bias: float) -> LinearStep:
    """The exact step of dξ = (−αξ + σ²b) dt + σ dW of length h."""
    rest, rate = sigma**2 * bias / alpha, alpha * h
    flow, kicks = transition([[-rate, 0.0], [1.0, 0.0]])
    (decay, mean), ((kick, _), (mean1, mean2)) = flow[:, 0].tolist(), (sigma * math.sqrt(h) * kicks).tolist()
    return LinearStep(rate, decay, kick, rest * (1 - decay), mean, mean1, mean2, rest * (1 - mean))


def transition(drift: Sequence[Sequence[float]]) -> tuple[FloatArray, FloatArray]:
    """exp(A) and a root of the covariance at s = 1 of dx = A x ds + e₁ dW, x = 0 at s = 0; a matrix exponential.

    Covariances of what follows x₁ by itself, as its integrals do, are of the size 1 where A is of this size or smaller.
    """
    a = np.array(drift)
    first = np.outer(unit := np.eye(len(a))[0], unit)
    whole = expm(np.block([[-a, first], [np.zeros_like(a), a.T]]))
    flow = whole[len(a) :, len(a) :].T.copy()
    return flow, np.linalg.cholesky(flow @ whole[: len(a), len(a) :])


class FilterStep(NamedTuple):
    """The exact transition of a filter, u = y and w = y′ over their standard deviations, with the mean of ξ.

    (w₁, u₁, ū) = flow (w₀, u₀) + kicks (ζ₁, ζ₂, ζ₃),   ξ̄ = of_u ū + rise (u₁ − u₀),   ξ = of_u u + of_w w,

    with flow of the shape (3, 2) and kicks a triangle.
    """

    flow: FloatArray
    kicks: FloatArray
    of_u: float
    of_w: float
    rise: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):
        """One step; the rows of `xi` are ξ, u and w."""
        flow, kicks = step.flow, step.kicks
        for i in range(xi_end.size):
            u, w = xi[1, i], xi[2, i]
            first, second, third = rng.standard_normal(), rng.standard_normal(), rng.standard_normal()
            w_end = flow[0, 0] * w + flow[0, 1] * u + kicks[0, 0] * first
            u_end = flow[1, 0] * w + flow[1, 1] * u + kicks[1, 0] * first + kicks[1, 1] * second
            mean = flow[2, 0] * w + flow[2, 1] * u + kicks[2, 0] * first + kicks[2, 1] * second + kicks[2, 2] * third
            xi[1, i], xi[2, i] = u_end, w_end
            xi_mean[i] = step.of_u * mean + step.rise * (u_end - u)
            xi_end[i] = step.of_u * u_end + step.of_w * w_end


class AngleStep(NamedTuple):
    """θ₁ = θ₀ + turn + kick ζ₁ and, of weak order 2, ξ̄ = A fade cos θ̄.

    θ̄ = ½(θ₀ + θ₁) + spread ζ₂ is the mean of θ over the step, and fade that of cos(θ − θ̄).
    """

    amplitude: float
    turn: float
    kick: float
    spread: float
    fade: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):
        """One step; the rows of `xi` are ξ and θ."""
        for i in range(xi_end.size):
            start = xi[1, i]
            end = start + step.turn + step.kick * rng.standard_normal()
            middle = 0.5 * (start + end) + step.spread * rng.standard_normal()
            xi[1, i] = end % (2 * math.pi)
            xi_mean[i] = step.amplitude * step.fade * math.cos(middle)
            xi_end[i] = step.amplitude * math.cos(end)


class ImplicitStep(NamedTuple):
    """The implicit trapezoidal rule for Eq. (7), of weak order 2, which never leaves the support.

    ξ₁ + pull ξ₁/(1 + cξ₁²) = ξ₀ − pull ξ₀/(1 + cξ₀²) + kick ζ + end₀ with pull = h/2τ₀, and
    ξ̄ = (ξ₀ + ξ₁)/2.
    """

    kick: float
    end0: float
    pull: float
    curvature: float

    @staticmethod
    def draw(step, xi, xi_mean, xi_end, push, rng):
        """The root a ≥ 0 of (y − a)(1 + s a²) = pull a in units of 1/√|c|, s the sign of c, by Newton's method."""
        for i in range(xi.size):
            xi_end[i] = rng.standard_normal()
        unit = math.sqrt(abs(step.curvature))
        sign = 1.0 if step.curvature > 0 else -1.0
        pull = step.pull
        for i in range(xi.size):
            start = unit * xi[i]
            before = start - pull * start / (1 + sign * start * start)
            target = before + unit * (step.kick * xi_end[i] + step.end0)
            y = abs(target)
            if sign < 0:  # inside the support from the first guess on: the smaller root of (y − a)(1 − a) = k
                edge = min(y, 1.0)
                k = pull * edge / (1 + edge)
                a = 0.5 * (y + 1 - math.sqrt((y - 1) * (y - 1) + 4 * k))
            else:
                a = y * (1 + y * y) / (1 + pull + y * y)
            for _ in range(5):
                square = 1 + sign * a * a
                a += ((y - a) * square - pull * a) / (square + pull - 2 * sign * a * (y - a))
            if sign < 0:
                a = min(max(a, 0.0), 1 - 1e-15)
            end = math.copysign(a, target)
            push[i] += (before - start + end - target) / unit
            xi_end[i] = end / unit
            xi_mean[i] = 0.5 * (xi[i] + xi_end[i])
