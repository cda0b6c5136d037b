"""All that numba compiles: the motion, the loops over paths, and the step that the kind of noise states.

Nothing here knows of phases, generators or eigenvalues: the mass is at x ≥ 0, has the velocity ẋ = ω u and obeys
Eq. (3),

    ẋ = ω u,   u̇ = −ω x + g u,   g = ε ξ(t) + ε² (c₁ − c₂ x² − c₃ ω² u²),   u⁺ = −R u⁻ at x = 0.

A step of length h draws the noise at its end and its mean over the step. Then the fourth-order Runge-Kutta rule
integrates the motion in the frame that rotates with ω (Lawson's method), so that the free flight is exact. An impact
is sought within the step, to the precision of floating point, and the rest of the step follows after the bounce.

State: x, u and ξ of each path, arrays of shape (n,), changed in place. The coefficients are the `Motion` of a system
and the `step` of a noise.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from fpsolve.model import noises

_CHUNK = 256
"""Paths that are advanced together, so that they stay in the cache and the processor can take several at once."""
_ANGLE, _GROWTH = 0.5, 0.125
"""A step with a larger ω h or |g| h is taken in parts: the first could hide impacts, the second costs accuracy."""
_MOST_PARTS = 10_000
RENORMALISED = 4
"""Steps after which a path has the norm 1 again."""
_RESAMPLED = 0.5
"""The share of effective paths at which a population is drawn anew."""
TALLIES = np.dtype(
    [(name, float) for name in ("count", "excess", "squares", "products", "numbered", "effective", "first", "last")]
)
"""Of the slices of a population, d being the growth of ln Z beyond what is expected: how many; Σd; Σd²; Σd × the d
before; Σd × the number of the slice, from 0; Σ effective paths among those of a slice ago; the first and the last d."""
_FILES = sorted(Path(noises.__file__).parent.glob("*.py"))
_STEPS = hashlib.sha256(b"".join(path.read_bytes() for path in _FILES)).hexdigest()[:16]
_without_cache: Any = njit(nogil=True, error_model="numpy")
_with_cache: Any = njit(nogil=True, error_model="numpy", cache=True)
_inlined: Any = njit(nogil=True, error_model="numpy", inline="always")


def _compiled(function: Any) -> Any:
    """A compiled function, kept in numba's cache unless no folder for that can be written to.

    The cache sees when this file changes, but not when a step does, which therefore is part of the name.
    """
    function.__qualname__ += f"_{_STEPS}"
    try:
        return _with_cache(function)
    except RuntimeError:
        return _without_cache(function)


def _draw(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    """`draw` of the class of a step; this is what numba replaces by it."""
    raise NotImplementedError


@overload(_draw)
def _drawn_by_its_kind(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    return step.instance_class.draw


@_compiled
def draw(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    """The mean and the end of the noise in one step that begins at `xi`, see `Noise.step`."""
    _draw(step, xi, xi_mean, xi_end, push, rng)  # type: ignore[no-untyped-call]


@_inlined
def _gain(m, xi, x, u):  # type: ignore[no-untyped-def]
    """g of Eq. (3)."""
    return m.strength * xi + m.linear - m.cubic * x * x - m.rayleigh * u * u


@_inlined
def _largest_gain(m, xi, rise, x, u):  # type: ignore[no-untyped-def]
    """A bound of |g| in the step; where damping and drive cancel, their sizes still limit the step."""
    drive = abs(m.strength * xi + m.linear) + abs(m.strength * rise)
    return drive + m.cubic * x * x + m.rayleigh * u * u


@_inlined
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


@_inlined
def _part(m, x, u, xi, rise, h, t, s):  # type: ignore[no-untyped-def]
    """The part from t to t + s of a step of length h."""
    half = 0.5 * m.omega * s
    mean = xi + rise * (2 * t + s - h) / h
    return _runge_kutta(
        m, s, math.cos(half), math.sin(half), math.cos(2 * half), math.sin(2 * half), x, u, mean, rise * s / h
    )


@_compiled
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


@_compiled
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


@_compiled
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


@_compiled
def advance(m, noise, h, x, u, xi, log_norm, push, steps, interval, rng):  # type: ignore[no-untyped-def]
    """Advance paths by `steps` steps of length h, in place, and return the number of impacts.

    Args:
        m, noise: a `Motion` and the `step` of a noise of this h.
        x, u, xi: the state of the paths, shape (n,).
        log_norm: ln ‖(x, u)‖ that has been taken out of the state; after every `interval` steps, and at the end, it
            takes in what the state has grown by, and the state has the norm 1 again. With interval = 0 it is left.
        push: takes in ∫f(ξ) dt, see `draw`.
        rng: a `numpy.random.Generator`.
    """
    mean, end = np.empty(_CHUNK), np.empty(_CHUNK)
    x_end, u_end, is_plain = np.empty(_CHUNK), np.empty(_CHUNK), np.empty(_CHUNK, np.bool_)
    impacts = 0
    for first in range(0, x.size, _CHUNK):
        last = min(first + _CHUNK, x.size)
        xs, us, xis, pushes, n = x[first:last], u[first:last], xi[first:last], push[first:last], last - first
        for step in range(1, steps + 1):
            draw(noise, xis, mean[:n], end[:n], pushes, rng)
            for i in range(n):
                xis[i], end[i] = end[i], 0.5 * (end[i] - xis[i])
            impacts += move(m, h, xs, us, mean[:n], end[:n], x_end, u_end, is_plain)
            if interval > 0 and (step % interval == 0 or step == steps):
                for i in range(n):
                    norm = math.sqrt(xs[i] * xs[i] + us[i] * us[i])
                    log_norm[first + i] += math.log(norm)
                    xs[i] /= norm
                    us[i] /= norm
    return impacts


@_compiled
def add_windows(log_norm, starts, number, p, log_sums, log_squares):  # type: ignore[no-untyped-def]
    """Add Σ w and Σ w² of the windows of 2ʲ slices that end with this number of slices to sums kept as logarithms."""
    for j in range(starts.shape[0]):
        if number % (1 << j) == 0:
            for k in range(p.size):
                exponents = p[k] * (log_norm - starts[j])
                largest = exponents.max()
                weights = np.exp(exponents - largest)
                log_sums[j, k] = np.logaddexp(log_sums[j, k], largest + math.log(weights.sum()))
                square = (weights * weights).sum()
                log_squares[j, k] = np.logaddexp(log_squares[j, k], 2 * largest + math.log(square))
            starts[j] = log_norm


@_compiled
def advance_population(  # type: ignore[no-untyped-def]
    m, noise, h, x, u, xi, log_norm, push, log_weights, ancestors, exponents, steps, interval, log_z, rng
):
    """Advance a population by some steps; the weights are looked at after every `interval` steps."""
    done = 0
    p, bias, bonus = exponents
    while done < steps:
        count = min(interval, steps - done)
        log_norm[:], push[:] = 0, 0
        advance(m, noise, h, x, u, xi, log_norm, push, count, RENORMALISED, rng)
        log_weights += p * log_norm + bias * push + bonus * count
        log_z[0] += _resample(x, u, xi, log_weights, ancestors, rng)
        done += count


@_compiled
def close_slice(log_weights, ancestors, log_z, expected, tallies):  # type: ignore[no-untyped-def]
    """Add a slice of a population to its `TALLIES`, and begin the next one; returns the growth of ln Z in it."""
    n = log_weights.size
    largest = log_weights.max()
    shares = np.zeros(n)
    for i in range(n):
        shares[ancestors[i]] += math.exp(log_weights[i] - largest)
    now = log_z[0] + largest + math.log(shares.sum() / n)
    growth = now - log_z[1]
    excess, record = growth - expected, tallies[0]
    if record.count == 0:
        record.first = excess
    else:
        record.products += excess * record.last
    record.numbered += excess * record.count
    record.count += 1
    record.excess += excess
    record.squares += excess * excess
    record.effective += shares.sum() ** 2 / (shares * shares).sum()
    record.last = excess
    log_z[1] = now
    ancestors[:] = np.arange(n)
    return growth


@_compiled
def _resample(x, u, xi, log_weights, ancestors, rng):  # type: ignore[no-untyped-def]
    """Draw the paths anew if their weights differ too much, systematically; returns ln of the mean weight."""
    n = x.size
    largest = log_weights.max()
    weights = np.exp(log_weights - largest)
    total = weights.sum()
    if total * total >= _RESAMPLED * n * (weights * weights).sum():
        return 0.0
    chosen = np.empty(n, np.int64)
    spacing = total / n
    mark, reached, k = rng.random() * spacing, weights[0], 0
    for i in range(n):
        while reached < mark and k < n - 1:
            k += 1
            reached += weights[k]
        chosen[i] = k
        mark += spacing
    x[:], u[:], xi[:], ancestors[:] = x[chosen], u[chosen], xi[chosen], ancestors[chosen]
    log_weights[:] = 0
    return largest + math.log(spacing)


@_compiled
def advance_and_count(  # type: ignore[no-untyped-def]
    m, noise, h, x, u, xi, spare, steps, looks, reach, plane, radial, sums, rng
):
    """Advance paths, and after every `steps` steps count the states with an amplitude below `reach`, if that is > 0."""
    impacts = 0
    scale = radial.size / reach if reach > 0 else 0.0
    for _ in range(looks):
        impacts += advance(m, noise, h, x, u, xi, spare[0], spare[1], steps, 0, rng)
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
