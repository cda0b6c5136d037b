"""The nonlinear motion of the mass at its wall, compiled: each bounce is found, as the motion depends on the amplitude.

Nothing here knows of phases, generators or eigenvalues: the mass is at x ≥ 0, has the velocity ẋ = ω u and obeys
Eq. (3),

    ẋ = ω u,   u̇ = −ω x + g u,   g = ε ξ(t) + ε² (c₁ − c₂ x² − c₃ ω² u²),   u⁺ = −R u⁻ at x = 0.

A step of length h draws the noise at its end and its mean over the step. Then the fourth-order Runge-Kutta rule
integrates the motion in the frame that rotates with ω (Lawson's method), so that the free flight is exact. An impact
is sought within the step, to the precision of floating point, and the rest of the step follows after the bounce.

State: x, u and that of the noise of each path, see `motions`, changed in place. The coefficients are the `Motion` of an
oscillator and the `step` of a noise.
"""

from __future__ import annotations

import math

import numpy as np

from fpsolve.simulation.compiled import compiled, inlined
from fpsolve.simulation.kernels import CHUNK
from fpsolve.simulation.motions import drawn

_ANGLE, _GROWTH = 0.5, 0.125
"""A step with a larger ω h or |g| h is taken in parts: the first could hide impacts, the second costs accuracy."""
_MOST_PARTS = 10_000


@inlined
def _gain(m, xi, x, u):  # type: ignore[no-untyped-def]
    """g of Eq. (3)."""
    return m.strength * xi + m.linear - m.cubic * x * x - m.rayleigh * u * u


@inlined
def _largest_gain(m, xi, rise, x, u):  # type: ignore[no-untyped-def]
    """A bound of |g| in the step; where damping and drive cancel, their sizes still limit the step."""
    drive = abs(m.strength * xi + m.linear) + abs(m.strength * rise)
    return drive + m.cubic * x * x + m.rayleigh * u * u


@inlined
def _runge_kutta(m, h, half_cos, half_sin, cos, sin, x, u, xi, rise):  # type: ignore[no-untyped-def]
    """One step of Lawson's fourth-order rule under noise of mean `xi` that rises by 2 `rise`; cosines of ωh/2, ωh."""
    k1 = _gain(m, xi - rise, x, u) * u
    v = u + 0.5 * h * k1
    y, v = half_cos * x + half_sin * v, half_cos * v - half_sin * x
    k2 = _gain(m, xi, y, v) * v
    y, free = half_cos * x + half_sin * u, half_cos * u - half_sin * x
    v = free + 0.5 * h * k2
    k3 = _gain(m, xi, y, v) * v
    y, v = cos * x + sin * u + h * half_sin * k3, cos * u - sin * x + h * half_cos * k3
    k4 = _gain(m, xi + rise, y, v) * v
    v = u + h / 6 * k1
    k2 = h / 3 * (k2 + k3)
    return cos * x + sin * v + half_sin * k2, cos * v - sin * x + half_cos * k2 + h / 6 * k4


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
        gain = _largest_gain(m, xi, rise, x, u)
        s = max(min(longest, _ANGLE / m.omega, _GROWTH / (gain + 1e-300)), h / _MOST_PARTS)
        s = min(s, h - t)
        side = 1.0 if x > 0 or (x == 0 and u > 0) else -1.0
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
        m: a `Motion`.
        x, u: the state; m.bounce < 0 needs x ≥ 0.
        mean, rise: ξ in the step is mean + rise (2t/h − 1).
        x_end, u_end, is_plain: room for as many numbers, and as many booleans.
    """
    half = 0.5 * m.omega * h
    half_cos, half_sin, cos, sin = math.cos(half), math.sin(half), math.cos(2 * half), math.sin(2 * half)
    limit = _GROWTH / h if m.omega * h <= _ANGLE else 0.0
    impacts = 0
    for i in range(x.size):
        x_end[i], u_end[i] = _runge_kutta(m, h, half_cos, half_sin, cos, sin, x[i], u[i], mean[i], rise[i])
        gain = _largest_gain(m, mean[i], rise[i], x[i], u[i])
        is_plain[i] = (x_end[i] > 0) & (x[i] >= 0) & ((u[i] >= 0) | (u_end[i] <= 0)) & (gain < limit)
    for i in range(x.size):
        if is_plain[i]:
            x[i], u[i] = x_end[i], u_end[i]
        else:
            x[i], u[i], bounces = _flight(m, x[i], u[i], mean[i], rise[i], h)
            impacts += bounces
    return impacts


@compiled
def advance(m, noise, h, x, u, xi, push, steps, rng):  # type: ignore[no-untyped-def]
    """Advance paths by `steps` steps of length h, in place, and return the number of impacts.

    Args:
        m, noise: a `Motion` and the `step` of a noise of this h.
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
