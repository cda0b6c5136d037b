# mypy: allow-untyped-defs, allow-untyped-calls
"""Linear motions of any number of variables, compiled: flows exp(A t)x, and the lines that they cross.

The exponential of a matrix is the sum of its series where it is small, and is taken in parts where it is not, so that
no part turns by more than 1. A jump at a line multiplies the state and leaves its direction alone, and so does a linear
flow with a factor. So a jump may be made at any time of the step in which the line is crossed: what counts is how often
it is.

Rows of arrays are not taken out of them where a path is moved, which takes numba longer than all else.

State: arrays of shape (variables, paths), changed in place.
"""

from __future__ import annotations

import math

import numpy as np

from fpsolve.simulation.compiled import compiled, inlined

_LIMIT = 1.0
"""The norm of Ω above which a step is taken in parts."""
_MOST_PARTS = 10_000
_REST = 1e-12
"""What is left of the series, as a share of the state."""
_HUGE = 1e100


@compiled
def load(y, i, state):
    """Take the state of one path out of those of all."""
    for r in range(state.size):
        state[r] = y[r, i]


@compiled
def store(y, i, state):
    """Put it back."""
    for r in range(state.size):
        y[r, i] = state[r]


@compiled
def image_of(matrix, state, image):
    """Put a matrix times a state into `image`."""
    for r in range(state.size):
        image[r] = 0.0
        for c in range(state.size):
            image[r] += matrix[r, c] * state[c]


@compiled
def multiplied(matrix, state, other):
    """Multiply a state by a matrix, in place; `other` is room for one more."""
    image_of(matrix, state, other)
    for r in range(state.size):
        state[r] = other[r]


@compiled
def tamed(state):
    """Bring a state that is about to overflow to the norm 1; returns the logarithm of what it had."""
    largest = 0.0
    for r in range(state.size):
        largest = max(largest, abs(state[r]))
    if 1 / _HUGE < largest < _HUGE or largest == 0:
        return 0.0
    for r in range(state.size):
        state[r] /= largest
    return math.log(largest)


@compiled
def _terms(size):
    """How many terms of the series of the exponential of a matrix of this norm count."""
    count, rest = 1, size
    while rest > _REST:
        count += 1
        rest *= size / count
    return count


@inlined
def _side(rays, j, x, u):
    """The distance from a line, with a sign."""
    return rays.across[j, 0] * x + rays.across[j, 1] * u


@inlined
def _crossings(rays, j, x, u, x1, u1):
    """How often a line is crossed from x to x₁, which is not far; against its way it counts −1."""
    before, after = _side(rays, j, x, u) >= 0, _side(rays, j, x1, u1) >= 0
    if before == after:
        return 0
    is_forward = after == (rays.along[j, 0] * x1 + rays.along[j, 1] * u1 >= 0)
    return 1 if is_forward == (rays.ways[j] > 0) else -1


@compiled
def crossed(rays, start, state, tally):
    """Count the lines that are crossed from one state to another, which is not far; returns the growth at them."""
    log = 0.0
    for j in range(rays.logs.size):
        count = _crossings(rays, j, start[0], start[1], state[0], state[1])
        log += count * rays.logs[j]
        tally[0] += count
    return log


@compiled
def flow(rays, matrix, t, size, state, tally, other, start):
    """exp(A t) x in place, ‖A‖ ≤ size, in parts; returns the growth of the norm beyond that of the state."""
    reach, log, n = abs(t) * size, 0.0, state.size
    if not reach < _LIMIT * _MOST_PARTS:
        return math.nan
    parts = 1 + int(reach / _LIMIT)
    s, terms = t / parts, _terms(reach / parts)
    for _ in range(parts):
        for r in range(n):
            start[r] = state[r]
        for k in range(terms, 0, -1):
            image_of(matrix, state, other)
            for r in range(n):
                state[r] = start[r] + s / k * other[r]
        log += crossed(rays, start, state, tally) + tamed(state)
    return log


@compiled
def step_driven(matrices, wall, h, y, mean, rise, log_norm, tally, rng):
    """Move paths by one step of length h, in place, in parts where it is large.

    Args:
        matrices, wall: of a `Driven`.
        y: the state.
        mean, rise: ξ in the step is mean + rise (2t/h − 1).
        log_norm: takes in what the norm has grown by beyond that of the state.
        tally: takes in how often lines were crossed, as its first number.
        rng: what other walls draw from.
    """
    start, sizes = np.empty(y.shape), np.zeros(mean.size)
    _step(matrices, wall, h, y, mean, rise, log_norm, tally, start, sizes, _LIMIT)
    xi, change = np.empty(1), np.empty(1)
    for i in range(mean.size):
        if sizes[i] < _LIMIT * _LIMIT:
            continue
        size = 0.0
        for r in range(y.shape[0]):
            for c in range(y.shape[0]):
                size += (abs(matrices[0, r, c]) + (abs(mean[i]) + abs(rise[i])) * abs(matrices[1, r, c])) ** 2
        if not h * math.sqrt(size) < _MOST_PARTS:
            log_norm[i] = math.nan
            continue
        parts, path = 1 + int(h * math.sqrt(size)), slice(i, i + 1)
        for part in range(parts):
            xi[0], change[0] = mean[i] + rise[i] * ((2 * part + 1) / parts - 1), rise[i] / parts
            _step(
                matrices, wall, h / parts, y[:, path], xi, change, log_norm[path], tally, start[:, path], sizes[path],
                math.inf,
            )  # fmt: skip
            log_norm[i] += tamed(y[:, i])


@compiled
def _step(matrices, rays, h, y, mean, rise, log_norm, tally, start, sizes, most):
    """One step of the paths whose ‖Ω‖ is below the most; where it started, and ‖Ω‖² of all, in the last arrays."""
    n, paths, lever = y.shape[0], y.shape[1], -h * h / 6
    omega, after = np.empty((n, n, paths)), np.empty((n, paths))
    for i in range(paths):
        sizes[i] = 0.0
    for r in range(n):
        for i in range(paths):
            start[r, i] = y[r, i]
        for c in range(n):
            steady, driven = h * matrices[0, r, c], h * matrices[1, r, c]
            turned, twice = lever * matrices[2, r, c], 0.6 * lever * lever / h * matrices[3, r, c]
            for i in range(paths):
                omega[r, c, i] = steady + mean[i] * driven + rise[i] * (turned + rise[i] * twice)
                sizes[i] += omega[r, c, i] * omega[r, c, i]
    largest = 0.0
    for i in range(paths):
        if sizes[i] < most * most:
            largest = max(largest, sizes[i])
        else:
            omega[:, :, i] = 0.0
    _summed(omega, _terms(math.sqrt(largest)), start, y, after)
    for j in range(rays.logs.size):
        for i in range(paths):
            count = _crossings(rays, j, start[0, i], start[1, i], y[0, i], y[1, i])
            log_norm[i] += count * rays.logs[j]
            tally[0] += count


@compiled
def _summed(omega, terms, start, now, after):
    """exp Ω of all paths times the start, by so many terms of its series; now is that in the beginning."""
    n, paths = start.shape
    for k in range(terms, 0, -1):
        for r in range(n):
            for i in range(paths):
                after[r, i] = omega[r, 0, i] * now[0, i]
            for c in range(1, n):
                for i in range(paths):
                    after[r, i] += omega[r, c, i] * now[c, i]
        for r in range(n):
            for i in range(paths):
                now[r, i] = start[r, i] + after[r, i] / k
