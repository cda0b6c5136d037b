# mypy: allow-untyped-defs, allow-untyped-calls
"""Linear motions of three or more variables with a wall at rest for one of them, compiled: each impact is found.

In the coordinates of a `Stop` the first variable is q ≥ 0, the second q̇, and an impact is q̇⁺ = −R q̇⁻ where q = 0.
While ξ is held q(t) is a power series, and its first zero is found from below: where |g″| ≤ M no zero of g is passed by
steps of 2g/(s + √(s² + 2Mg)), s = max(0, −g′), which are Newton's near a zero. Chattering is over where the geometric
series of its flights, 2q̇/(|q̈|(1 − R)), is short beside all other times. Then q rests until q̈ > 0, and the others move
alone.

Under a chain ξ is held between its jumps: nothing is left out. Under a diffusion it is held over each half of a step,
at mean ∓ ⅔ rise, which has the mean and the first moment of the line that `motions` takes, and the order 4 (S. Blanes
and P. C. Moan, Appl. Numer. Math. 56, 2006); q̇ is the rate of q in both. Under white noise a part of a step is halved,
by the law of ΔW and ∫W dt of its halves, until it cannot reach the wall, or the noise does little to q̇.

State: as in `flows`. The wall is a `Floor`.
"""

from __future__ import annotations

import math

import numpy as np

from fpsolve.simulation.compiled import compiled
from fpsolve.simulation.flows import load, store, tamed

_SHORT = 1e-6
"""‖A‖ times the length of all further flights, at which chattering is over."""
_MOST_TERMS, _MOST_PARTS, _MOST_STEPS = 24, 10_000, 200
_LEAST = 1e-17
"""Share of the state below which further terms of a series are left out."""
_NEAR = 1e-15
"""Share of the terms of a series below which its sum is 0; share of its range that is no step."""
_RESOLVED, _FINEST, _WIDE, _MOST_SPLIT = 10.0, 0.1, 4.0, 40
"""Of a part of a step of white noise that may reach the wall: q̇ over what the noise does to it, that over the speed of
a fast impact from which on it does no harm, how many times of it are reckoned with, and how often a step is halved at
most. What is halved follows from the state before it alone: by its impacts those that are missed would stay missed."""
_RELEASED = 1e-4
"""Share of a part after which a mass that has left the wall may be there again."""


@compiled
def step_to_floor(matrices, wall, h, y, mean, rise, log_norm, tally, rng):
    """Move paths by one step of length h, in place, as `step_driven` does; only A₀ and A₁ of the matrices are used."""
    n, parts = y.shape[0], np.empty((_MOST_SPLIT + 2, 3))
    matrix, state = np.empty((n, n)), np.empty(n)
    for i in range(y.shape[1]):
        load(y, i, state)
        parts[0], top = (h, mean[i] * h, -rise[i] * h / 6), 0
        while top >= 0:
            s, w, area = parts[top]
            kick, force, least = 0.0, 0.0, 0.0
            for c in range(n):
                kick += (c > 0) * matrices[1, 1, c] * state[c]
                force += matrices[0, 1, c] * state[c]
                least += wall.fast[c] * abs(state[c])
            kick, speed = abs(kick) * math.sqrt(s) * wall.is_white, abs(state[1])
            is_near = abs(state[0]) < s * (speed + abs(force) * s + _WIDE * kick)
            if is_near and speed < _RESOLVED * kick and kick > _FINEST * least and top < _MOST_SPLIT:
                z, more = math.sqrt(s) / 4 * rng.standard_normal(), math.sqrt(s / 12) * rng.standard_normal()
                first = 0.5 * s, 0.5 * w + 1.5 * area + z, 0.25 * area - 0.5 * z + 0.5 * more
                parts[top] = 0.5 * s, w - first[1], first[2] - more
                top += 1
                parts[top] = first
                continue
            top -= 1
            for side in (0.5, -0.5):
                value, size = (w + 8 * side * area) / s, 0.0
                for r in range(n):
                    for c in range(n):
                        matrix[r, c] = matrices[0, r, c] + value * matrices[1, r, c]
                        size += matrix[r, c] ** 2
                flow_to_floor(wall, matrix, 0.5 * s, math.sqrt(size), state, tally)
        log_norm[i] += tamed(state)
        store(y, i, state)


@compiled
def flow_to_floor(wall, matrix, t, size, state, tally):
    """exp(A t) y in place with impacts, ‖A‖ ≤ size; counts the fast ones, and the time at rest. Returns 0."""
    n, is_released, series = state.size, False, np.empty((_MOST_TERMS + 1, state.size + 1))
    state[0] = abs(state[0])  # the start is on either side
    if not t * size < _MOST_PARTS:
        state[:] = math.nan
    while t > 0 and t * size < _MOST_PARTS:
        d, is_there = min(t, 1 / size), state[0] == 0
        is_held = is_there and state[1] == 0 and not is_released and _force(matrix, state) <= 0
        terms = _expand(matrix, state, d, is_held, series)
        for k in range(terms):  # the sum that is positive until something happens
            series[k, n] = -_force(matrix, series[k]) if is_held else series[k + is_there, 0]
        begin = _RELEASED if is_there and state[1] == 0 and not is_held else 0.0
        at = _first_zero(series[:, n], terms, begin)
        for r in range(n):
            state[r] = 0.0
            for k in range(terms - 1, -1, -1):
                state[r] = state[r] * at + series[k, r]
        is_released = is_held and at < 1
        if is_held:
            tally[1] += at * d
        elif at < 1:
            least = 0.0
            for r in range(2, n):
                least += wall.fast[r] * abs(state[r])
            tally[0] += abs(state[1]) > least
            state[0], state[1] = 0.0, wall.restitution * abs(state[1])
            force = _force(matrix, state)
            if force < 0 and 2 * state[1] * size <= -_SHORT * force * (1 - wall.restitution):
                state[1] = 0.0
        t -= at * d
        state[0] = max(state[0], 0.0)
    return 0.0


@compiled
def _force(matrix, state):
    """q̈ of a state, or of a term of its series."""
    total = 0.0
    for c in range(matrix.shape[0]):
        total += matrix[1, c] * state[c]
    return total


@compiled
def _expand(matrix, state, d, is_held, series):
    """The terms (A d)ᵏ y/k! of y(d τ), q held or not; returns how many count."""
    n, least, last, k = state.size, 0.0, math.inf, 0
    for r in range(n):
        series[0, r] = state[r]
        least += _LEAST * abs(state[r])
    while last > least and k < _MOST_TERMS:
        k, last = k + 1, 0.0
        for r in range(2 if is_held else 0, n):
            total = 0.0
            for c in range(n):
                total += matrix[r, c] * series[k - 1, c]
            series[k, r] = total * (d / k)
            last += abs(series[k, r])
        if is_held:
            series[k, 0] = series[k, 1] = 0.0
    return k


@compiled
def _first_zero(series, terms, begin):
    """The first τ from `begin` on at which a power series is 0, 1 where it is positive up to 1."""
    bend, size, at = 0.0, 0.0, begin
    for k in range(terms):
        bend += k * (k - 1) * abs(series[k])
        size += abs(series[k])
    for _ in range(_MOST_STEPS):
        value, slope = 0.0, 0.0
        for k in range(terms - 1, -1, -1):
            slope = slope * at + value
            value = value * at + series[k]
        fall = max(0.0, -slope)
        step = 2 * value / (fall + math.sqrt(fall * fall + 2 * bend * max(value, 0.0)))
        if not (value > _NEAR * size and step > _NEAR):
            return at
        at += step
        if at >= 1:
            return 1.0
    return at
