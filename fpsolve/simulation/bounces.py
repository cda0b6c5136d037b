"""The motion of a system with cubic terms, compiled: each bounce is found, as the motion depends on the amplitude.

Nothing here knows of phases, generators or eigenvalues: with x and u, the two variables in one unit, it is

    ẋ = ω u + f(x, u, ξ),   u̇ = −ω x + g(x, u, ξ),   u⁺ = −R u⁻ at x = 0,

which for the oscillator of Eq. (3) is f = 0, g = (ε ξ + ε² (c₁ − c₂ x² − c₃ ω² u²)) u with ẋ = ω u its velocity. With a
wall x ≥ 0 and f = 0 at x = 0. Without one (x, u) and (−x, −u) are alike, and that with x ≥ 0 is kept.

A step of length h draws the noise at its end and its mean over the step. Then the fourth-order Runge-Kutta rule
integrates the motion in the frame that rotates with ω (Lawson's method), so that the free flight is exact. An impact
is sought within the step, to the precision of floating point, and the rest of the step follows after the bounce.

State: x, u and that of the noise of each path, see `motions`, changed in place. The coefficients are a `CubicMotion`,
and the `step` of a noise.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fpsolve.model.confinement import amplitude_frame
from fpsolve.model.plane import System, affine
from fpsolve.simulation.compiled import compiled, inlined
from fpsolve.simulation.kernels import CHUNK
from fpsolve.simulation.motions import drawn

_ANGLE, _GROWTH = 0.5, 0.125
"""A step with a larger ω h or |g| h is taken in parts: the first could hide impacts, the second costs accuracy."""
_MOST_PARTS = 10_000
ROUNDED = 1e-14
"""Of ω, below which a rate is 0."""
FREE = 1.0
"""The factor of u at x = 0 where there is nothing."""


class CubicMotion(NamedTuple):
    """Besides the rotation the matrices A₀ and A₁ of A₀ + ξ A₁, row by row, and C with the products of degree 3.

    `sizes` are their norms, and `bounce` is the factor of u at x = 0: −R at a wall, `FREE` without a wall.
    """

    omega: float
    steady: tuple[float, float, float, float]
    driven: tuple[float, float, float, float]
    cubic: tuple[float, float, float, float, float, float, float, float]
    sizes: tuple[float, float, float]
    bounce: float


def motion_of(system: System) -> tuple[CubicMotion, int]:
    """The motion of a system with its cubic terms, and which of its variables, 0 or 1, is x.

    x is the variable of the wall, or else the one whose rate grows with the other. u is the other one, and both are in
    the unit of the first variable, so that √(x² + u²) is the amplitude, see `System.aspect`.
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
    bounce = -math.exp(system.jumps[0].log_factor) if system.jumps else FREE
    sizes = [float(np.linalg.norm(each)) for each in (steady, driven, cubic)]
    rows: Any = [tuple(each.ravel().tolist()) for each in (steady, driven, cubic)]
    return CubicMotion(omega, rows[0], rows[1], rows[2], (sizes[0], sizes[1], sizes[2]), bounce), first


@inlined
def _force(m, xi, x, u):  # type: ignore[no-untyped-def]
    """What the equation has besides the rotation with ω."""
    a, b, c, square = m.steady, m.driven, m.cubic, u * u
    f = (a[0] + xi * b[0] + (c[0] * x + c[1] * u) * x + c[2] * square) * x + (a[1] + xi * b[1] + c[3] * square) * u
    g = (a[2] + xi * b[2] + (c[4] * x + c[5] * u) * x + c[6] * square) * x + (a[3] + xi * b[3] + c[7] * square) * u
    return f, g


@inlined
def _bound(m, xi, rise, x, u):  # type: ignore[no-untyped-def]
    """A bound of its rate in the step; where damping and drive cancel, their sizes still limit the step."""
    return m.sizes[0] + m.sizes[1] * (abs(xi) + abs(rise)) + m.sizes[2] * (x * x + u * u)


@inlined
def _runge_kutta(m, h, half_cos, half_sin, cos, sin, x, u, xi, rise):  # type: ignore[no-untyped-def]
    """One step of Lawson's fourth-order rule under noise of mean `xi` that rises by 2 `rise`; cosines of ωh/2, ωh."""
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
def _part(m, x, u, xi, rise, h, t, s):  # type: ignore[no-untyped-def]
    """The part from t to t + s of a step of length h."""
    half = 0.5 * m.omega * s
    mean = xi + rise * (2 * t + s - h) / h
    return _runge_kutta(
        m, s, math.cos(half), math.sin(half), math.cos(2 * half), math.sin(2 * half), x, u, mean, rise * s / h
    )


@compiled
def _flight(m, x, u, xi, rise, h):  # type: ignore[no-untyped-def]
    """One step with its impacts, in parts short enough to see each of them; returns x, u and how many there were."""
    t, impacts = 0.0, 0
    longest = h
    if m.bounce < 0 and x == 0 and u < 0:  # on the wall and about to cross it
        u, impacts = m.bounce * u, 1
    while t < h:
        gain = _bound(m, xi, rise, x, u)
        s = max(min(longest, _ANGLE / m.omega, _GROWTH / (gain + 1e-300)), h / _MOST_PARTS)
        s = min(s, h - t)
        side = 0.0 if m.bounce == FREE else 1.0 if x > 0 or (x == 0 and u > 0) else -1.0
        x1, u1 = _part(m, x, u, xi, rise, h, t, s)
        if side * x1 < 0:
            s, u1 = _impact(m, x, u, xi, rise, h, t, s, x1)
            x1, u1, impacts = 0.0, m.bounce * u1, impacts + 1
        elif side * u < 0 and side * u1 > 0 and s > h / _MOST_PARTS:  # turned round: an impact was overlooked
            longest = 0.5 * s
            continue
        x, u, t = x1, u1, t + s
        if h - t < 1e-15 * h:
            t = h
    return x, u, impacts


@compiled
def _impact(m, x, u, xi, rise, h, t, s, beyond):  # type: ignore[no-untyped-def]
    """The time from t to the impact, and u before it, by Newton's method inside a bracket; `beyond` is x at t + s."""
    low, high = 0.0, s
    at = s * x / (x - beyond) if x != 0 else s
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
def move(m, h, x, u, mean, rise, x_end, u_end, is_plain):  # type: ignore[no-untyped-def]
    """Move paths by one step of length h, in place, and return the number of impacts.

    Args:
        m: a `CubicMotion`.
        x, u: the state; m.bounce < 0 needs x ≥ 0.
        mean, rise: ξ in the step is mean + rise (2t/h − 1).
        x_end, u_end, is_plain: room for as many numbers, and as many booleans.
    """
    half = 0.5 * m.omega * h
    half_cos, half_sin, cos, sin = math.cos(half), math.sin(half), math.cos(2 * half), math.sin(2 * half)
    limit = _GROWTH / h if m.omega * h <= _ANGLE else 0.0
    is_free, impacts = m.bounce == FREE, 0
    for i in range(x.size):
        x_end[i], u_end[i] = _runge_kutta(m, h, half_cos, half_sin, cos, sin, x[i], u[i], mean[i], rise[i])
        gain = _bound(m, mean[i], rise[i], x[i], u[i])
        is_between = (x_end[i] > 0) & (x[i] >= 0) & ((u[i] >= 0) | (u_end[i] <= 0))
        is_plain[i] = (is_between | is_free) & (gain < limit)
    for i in range(x.size):
        if is_plain[i]:
            x[i], u[i] = x_end[i], u_end[i]
        else:
            x[i], u[i], bounces = _flight(m, x[i], u[i], mean[i], rise[i], h)
            impacts += bounces
    if is_free:
        for i in range(x.size):
            side = -1.0 if x[i] < 0 else 1.0
            x[i], u[i] = side * x[i], side * u[i]
    return impacts


@compiled
def advance(m, noise, h, x, u, xi, push, steps, rng):  # type: ignore[no-untyped-def]
    """Advance paths by `steps` steps of length h, in place, and return the number of impacts.

    Args:
        m, noise: as for `move`, and the `step` of a noise of this h.
        x, u, xi: the state of the paths, and that of their noise.
        push: room for as many numbers.
        rng: a `numpy.random.Generator`.
    """
    mean, rise = np.empty(CHUNK), np.empty(CHUNK)
    x_end, u_end, is_plain = np.empty(CHUNK), np.empty(CHUNK), np.empty(CHUNK, np.bool_)
    impacts = 0
    for first in range(0, x.size, CHUNK):
        last = min(first + CHUNK, x.size)
        xs, us, xis, pushes, n = x[first:last], u[first:last], xi[..., first:last], push[first:last], last - first
        for _ in range(steps):
            drawn(noise, xis, mean[:n], rise[:n], pushes, rng)
            impacts += move(m, h, xs, us, mean[:n], rise[:n], x_end, u_end, is_plain)
    return impacts


@compiled
def advance_and_count(  # type: ignore[no-untyped-def]
    m, noise, h, x, u, xi, push, steps, looks, reach, plane, radial, sums, rng
):
    """Advance paths, and after every `steps` steps count the states with an amplitude below `reach`, if that is > 0."""
    impacts = 0
    scale = radial.size / reach if reach > 0 else 0.0
    for _ in range(looks):
        impacts += advance(m, noise, h, x, u, xi, push, steps, rng)
        if reach <= 0:
            continue
        for i in range(x.size):
            amplitude = math.sqrt(x[i] * x[i] + u[i] * u[i])
            sums[0] += x[i]
            sums[1] += x[i] * x[i]
            sums[2] += u[i] * u[i]
            sums[3] += amplitude
            sums[4] += 1
            if amplitude < reach:
                radial[int(amplitude * scale)] += 1
                plane[int(x[i] * scale), int((u[i] + reach) * scale)] += 1
    return impacts
