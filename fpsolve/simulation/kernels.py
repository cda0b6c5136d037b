# mypy: allow-untyped-defs, allow-untyped-calls
"""All paths of a batch, compiled: their steps, their growth, their weights, and how they are drawn anew.

Sums and assignments are loops: those of whole arrays take numba seconds to compile, most for words of their errors.

What moves them is one of the motions, and their state as there.
"""

from __future__ import annotations

import math

import numpy as np

from fpsolve.simulation.compiled import compiled
from fpsolve.simulation.motions import move

CHUNK = 128
"""Paths that are advanced together, so that they stay in the cache and the processor can take several at once."""
RENORMALISED = 4
"""Steps after which a path has the norm 1 again."""
_RESAMPLED = 0.5
"""The share of effective paths at which a population is drawn anew."""


@compiled
def _normalise(y, log_norm):
    """Bring all states to the norm 1."""
    norms = np.zeros(y.shape[1])
    for r in range(y.shape[0]):
        for i in range(norms.size):
            norms[i] += y[r, i] * y[r, i]
    for i in range(norms.size):
        norms[i] = math.sqrt(norms[i])
        log_norm[i] += math.log(norms[i])
    for r in range(y.shape[0]):
        for i in range(norms.size):
            y[r, i] /= norms[i]


@compiled
def advance(m, h, y, xi, log_norm, push, tally, steps, interval, rng):
    """Advance paths by `steps` steps of length h, in place.

    Args:
        m: a motion for steps of this h.
        y, xi: the state of the paths, and that of their noises.
        log_norm: ln ‖y‖ that has been taken out of the state; after every `interval` steps, and at the end, it takes in
            what the state has grown by, and the state has the norm 1 again; never if `interval` is 0.
        push: takes in ∫f(ξ) dt, see `draw`.
        tally: takes in what has happened, see `Driven`.
        rng: a `numpy.random.Generator`.
    """
    for first in range(0, log_norm.size, CHUNK):
        part = slice(first, min(first + CHUNK, log_norm.size))
        ys, xis, logs, pushes = y[:, part], xi[:, part], log_norm[part], push[part]
        for step in range(1, steps + 1):
            move(m, h, ys, xis, logs, pushes, tally, rng)
            if interval > 0 and (step % interval == 0 or step == steps):
                _normalise(ys, logs)


@compiled
def add_windows(log_norm, starts, number, p, log_sums, log_squares):
    """Add Σ w and Σ w² of the windows of 2ʲ slices that end with this number of slices to sums kept as logarithms."""
    for j in range(starts.shape[0]):
        if number % (1 << j) == 0:
            for k in range(p.size):
                largest, total, squares = -math.inf, 0.0, 0.0
                for i in range(log_norm.size):
                    largest = max(largest, p[k] * (log_norm[i] - starts[j, i]))
                for i in range(log_norm.size):
                    weight = math.exp(p[k] * (log_norm[i] - starts[j, i]) - largest)
                    total += weight
                    squares += weight * weight
                log_sums[j, k] = np.logaddexp(log_sums[j, k], largest + math.log(total))
                log_squares[j, k] = np.logaddexp(log_squares[j, k], 2 * largest + math.log(squares))
            for i in range(log_norm.size):
                starts[j, i] = log_norm[i]


@compiled
def advance_population(
    m, h, y, xi, log_norm, push, tally, log_weights, ancestors, exponents, steps, interval, log_z, rng
):
    """Advance a population by some steps; the weights are looked at after every `interval` steps."""
    done = 0
    p, bias, bonus = exponents
    while done < steps:
        count = min(interval, steps - done)
        for i in range(log_norm.size):
            log_norm[i], push[i] = 0.0, 0.0
        advance(m, h, y, xi, log_norm, push, tally, count, np.int64(RENORMALISED), rng)  # else compiled for this 4
        for i in range(log_norm.size):
            log_weights[i] += p * log_norm[i] + bias * push[i] + bonus * count
        log_z[0] += _resample(y, xi, log_weights, ancestors, rng)
        done += count


@compiled
def close_slice(log_weights, ancestors, log_z):
    """The growth of ln Z in a slice of a population, and how many paths of its beginning carry it; begins the next."""
    n = log_weights.size
    largest = _largest(log_weights)
    shares = np.zeros(n)
    for i in range(n):
        shares[ancestors[i]] += math.exp(log_weights[i] - largest)
    total, squares = 0.0, 0.0
    for i in range(n):
        total += shares[i]
        squares += shares[i] * shares[i]
        ancestors[i] = i
    now = log_z[0] + largest + math.log(total / n)
    growth = now - log_z[1]
    log_z[1] = now
    return growth, total**2 / squares


@compiled
def _resample(y, xi, log_weights, ancestors, rng):
    """Draw the paths anew if their weights differ too much, systematically; returns ln of the mean weight."""
    n = log_weights.size
    largest = _largest(log_weights)
    weights, total, squares = np.empty(n), 0.0, 0.0
    for i in range(n):
        weights[i] = math.exp(log_weights[i] - largest)
        total += weights[i]
        squares += weights[i] * weights[i]
    if total * total >= _RESAMPLED * n * squares:
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
    _choose(ancestors, chosen)
    for r in range(y.shape[0]):
        _choose(y[r], chosen)
    for r in range(xi.shape[0]):
        _choose(xi[r], chosen)
    for i in range(n):
        log_weights[i] = 0.0
    return largest + math.log(spacing)


@compiled
def _choose(values, chosen):
    """The values with these numbers, in place."""
    old = values.copy()
    for i in range(values.size):
        values[i] = old[chosen[i]]


@compiled
def _largest(values):
    largest = -math.inf
    for i in range(values.size):
        largest = max(largest, values[i])
    return largest
