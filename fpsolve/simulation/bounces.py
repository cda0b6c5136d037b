# mypy: allow-untyped-defs, allow-untyped-calls
"""The motion of a system with cubic terms, compiled: each bounce is found, as the motion depends on the amplitude.

Nothing here knows of phases, generators or eigenvalues: with x and u, the two variables in one unit, it is

    ẋ = ω u + f(x, u, ξ),   u̇ = −ω x + g(x, u, ξ),   u⁺ = R u⁻ at x = 0,

which for the oscillator of Eq. (3) is f = 0, g = (ε ξ + ε² (c₁ − c₂ x² − c₃ ω² u²)) u with ẋ = ω u its velocity. (x, u)
and (−x, −u) are alike. So with a wall at x = 0, where f = 0, a path passes it instead of bouncing, as its mirror image
does. Without a wall R = 1.

A step of length h draws the noise at its end and its mean over the step. Then the fourth-order Runge-Kutta rule
integrates the motion in the frame that rotates with ω (Lawson's method), so that the free flight is exact. An impact
is sought within the step, to the precision of floating point, and the rest of the step follows after the bounce.

State: as in `motions`, x and u.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.confinement import amplitude_frame
from fpsolve.model.plane import LinearMotion, affine
from fpsolve.simulation.compiled import compiled, inlined
from fpsolve.simulation.kernels import advance
from fpsolve.simulation.motions import drawn

_ANGLE, _GROWTH = 0.5, 0.125
"""A step with a larger ω h or |g| h is taken in parts: the first could hide impacts, the second costs accuracy."""
_MOST_PARTS = 10_000
ROUNDED = 1e-14
"""Of ω, below which a rate is 0."""


class CubicMotion(NamedTuple):
    """Besides the rotation the matrices A₀ and A₁ of A₀ + ξ A₁, row by row, and C with the products of degree 3.

    `sizes` are their norms. The noise is as in a `Driven`.
    """

    omega: float
    steady: FloatArray
    driven: FloatArray
    cubic: FloatArray
    sizes: FloatArray
    restitution: float
    step: Any
    rows: int | slice

    @staticmethod
    def move(m, h, y, xi, log_norm, push, tally, rng):
        """One step as that of a `Driven`; counts impacts."""
        mean, rise = np.empty(y.shape[1]), np.empty(y.shape[1])
        drawn(m.step, xi[m.rows], mean, rise, push, rng)
        tally[0] += move(m, h, y, mean, rise)


def motion_of(system: LinearMotion, step: Any, rows: int | slice = 0) -> tuple[CubicMotion, int]:
    """The motion of a system with its cubic terms under a noise, and which of its variables, 0 or 1, is x.

    x is the variable of the wall, or else the one whose rate grows with the other. u is the other one, and both are in
    the unit of the first variable, so that √(x² + u²) is the amplitude, see `LinearMotion.aspect`.
    """
    frame, steady, driven = amplitude_frame(system), np.zeros((2, 2)), np.zeros((2, 2))
    for term in system.terms:
        offset, slope = affine(term.g) or (math.nan, math.nan)
        matrix = system.epsilon**term.order * np.array(frame.term(term).matrix)
        steady, driven = steady + offset * matrix, driven + slope * matrix
    cubic = np.array(frame.cubic(system.cubic).matrix) if system.cubic else np.zeros((2, 4))
    first = int(math.cos(system.jumps[0].phase) ** 2 > 0.5 if system.jumps else steady[0, 1] < 0 < steady[1, 0])
    if first:
        steady, driven, cubic = (each[::-1, ::-1] for each in (steady, driven, cubic))
    omega = math.sqrt(max(0.0, -steady[0, 1] * steady[1, 0]))
    steady = steady - [[0.0, omega], [-omega, 0.0]]
    steady[np.abs(steady) <= ROUNDED * omega] = 0
    restitution = math.exp(sum(jump.log_factor for jump in system.jumps))
    sizes = np.array([np.linalg.norm(each) for each in (steady, driven, cubic)])
    return CubicMotion(omega, steady.ravel(), driven.ravel(), cubic.ravel(), sizes, restitution, step, rows), first


@inlined
def _force(m, xi, x, u):
    """What the equation has besides the rotation with ω."""
    a, b, c, square = m.steady, m.driven, m.cubic, u * u
    f = (a[0] + xi * b[0] + (c[0] * x + c[1] * u) * x + c[2] * square) * x + (a[1] + xi * b[1] + c[3] * square) * u
    g = (a[2] + xi * b[2] + (c[4] * x + c[5] * u) * x + c[6] * square) * x + (a[3] + xi * b[3] + c[7] * square) * u
    return f, g


@inlined
def _bound(m, xi, rise, x, u):
    """A bound of its rate in the step; where damping and drive cancel, their sizes still limit the step."""
    return m.sizes[0] + m.sizes[1] * (abs(xi) + abs(rise)) + m.sizes[2] * (x * x + u * u)


@inlined
def _runge_kutta(m, h, x, u, xi, rise):
    """One step of Lawson's fourth-order rule under noise of mean `xi` that rises by 2 `rise`."""
    half_cos, half_sin = math.cos(0.5 * m.omega * h), math.sin(0.5 * m.omega * h)
    cos, sin = half_cos * half_cos - half_sin * half_sin, 2 * half_cos * half_sin
    f1, g1 = _force(m, xi - rise, x, u)
    y, v = x + 0.5 * h * f1, u + 0.5 * h * g1
    y, v = half_cos * y + half_sin * v, half_cos * v - half_sin * y
    f2, g2 = _force(m, xi, y, v)
    y, free = half_cos * x + half_sin * u, half_cos * u - half_sin * x
    f3, g3 = _force(m, xi, y + 0.5 * h * f2, free + 0.5 * h * g2)
    f, g = half_cos * f3 + half_sin * g3, half_cos * g3 - half_sin * f3
    y, v = cos * x + sin * u + h * f, cos * u - sin * x + h * g
    f4, g4 = _force(m, xi + rise, y, v)
    y, v = x + h / 6 * f1, u + h / 6 * g1
    f2, g2 = h / 3 * (f2 + f3), h / 3 * (g2 + g3)
    f, g = half_cos * f2 + half_sin * g2 + h / 6 * f4, half_cos * g2 - half_sin * f2 + h / 6 * g4
    return cos * y + sin * v + f, cos * v - sin * y + g


@inlined
def _part(m, x, u, xi, rise, h, t, s):
    """The part from t to t + s of a step of length h."""
    return _runge_kutta(m, s, x, u, xi + rise * (2 * t + s - h) / h, rise * s / h)


@compiled
def _impact(m, x, u, xi, rise, h, t, s, beyond):
    """The time from t to the impact, and u before it, by Newton's method inside a bracket; `beyond` is x at t + s."""
    low, high, at = 0.0, s, s * x / (x - beyond)
    u1 = u
    for _ in range(60):
        x1, u1 = _part(m, x, u, xi, rise, h, t, at)
        if x1 * beyond > 0:
            high = at
        else:
            low = at
        move = -x1 / (m.omega * u1)
        if abs(move) <= 1e-14 * h or high - low <= 1e-15 * h:
            break
        at = at + move if low < at + move < high else 0.5 * (low + high)
    return at, u1


@compiled
def move(m, h, y, mean, rise):
    """Move paths by one step of length h, in place, in parts that see each impact; returns how many there were.

    Args:
        m: a `CubicMotion`.
        y: x and u.
        mean, rise: ξ in the step is mean + rise (2t/h − 1).
    """
    impacts = 0
    for i in range(mean.size):
        t, x, u = 0.0, y[0, i], y[1, i]
        while t < h:
            s = max(min(_ANGLE / m.omega, _GROWTH / (_bound(m, mean[i], rise[i], x, u) + 1e-300)), h / _MOST_PARTS)
            s = min(s, h - t)
            x1, u1 = _part(m, x, u, mean[i], rise[i], h, t, s)
            if x * x1 < 0:
                s, u1 = _impact(m, x, u, mean[i], rise[i], h, t, s, x1)
                x1, u1, impacts = 0.0, m.restitution * u1, impacts + 1
            x, u, t = x1, u1, t + s
            if h - t < 1e-15 * h:
                t = h
        y[0, i], y[1, i] = x, u
    return impacts


@compiled
def advance_and_count(m, h, y, xi, log_norm, push, tally, steps, looks, reach, plane, radial, sums, rng):
    """Advance paths, and after every `steps` steps count the states with an amplitude below `reach`, if that is > 0."""
    scale = radial.size / reach if reach > 0 else 0.0
    for _ in range(looks):
        advance(m, h, y, xi, log_norm, push, tally, steps, np.int64(0), rng)
        if reach <= 0:
            continue
        for i in range(log_norm.size):
            x, u = abs(y[0, i]), math.copysign(y[1, i], y[0, i] * y[1, i])
            amplitude = math.sqrt(x * x + u * u)
            sums[0] += x
            sums[1] += x * x
            sums[2] += u * u
            sums[3] += amplitude
            sums[4] += 1
            if amplitude < reach:
                radial[int(amplitude * scale)] += 1
                plane[int(x * scale), int((u + reach) * scale)] += 1
