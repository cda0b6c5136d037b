"""All paths of a batch, compiled: their steps, their growth, their weights, and how they are drawn anew.

Sums and assignments are loops: those of whole arrays take numba seconds to compile, most for words of their errors.

What moves them is a motion of `motions`, `several` or `spaces`, and the `step` of the kind of noise. State: x, u and
that of the noise of each path, see `motions` and `spaces`, changed in place.
"""

from __future__ import annotations

import math

import numpy as np
from numba.extending import overload

from fpsolve.simulation.compiled import compiled

CHUNK = 256
"""Paths that are advanced together, so that they stay in the cache and the processor can take several at once."""
RENORMALISED = 4
"""Steps after which a path has the norm 1 again."""
_RESAMPLED = 0.5
"""The share of effective paths at which a population is drawn anew."""
TALLIES = np.dtype(
    [(name, float) for name in ("count", "excess", "squares", "products", "numbered", "effective", "first", "last")]
)
"""Of the slices of a population, d being the growth of ln Z beyond what is expected: how many; Σd; Σd²; Σd × the d
before; Σd × the number of the slice, from 0; Σ effective paths among those of a slice ago; the first and the last d."""


def _move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
    """`move` of the class of a motion; this is what numba replaces by it."""
    raise NotImplementedError


@overload(_move)
def _moved_by_its_kind(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
    return m.instance_class.move


def _normalise(x, u, log_norm):  # type: ignore[no-untyped-def]
    """Bring all states to the norm 1; this is what numba replaces by the number of their variables."""
    raise NotImplementedError


@overload(_normalise)
def _normalised_by_shape(x, u, log_norm):  # type: ignore[no-untyped-def]
    def plane(x, u, log_norm):  # type: ignore[no-untyped-def]
        for i in range(x.size):
            norm = math.sqrt(x[i] * x[i] + u[i] * u[i])
            log_norm[i] += math.log(norm)
            x[i] /= norm
            u[i] /= norm

    def space(x, u, log_norm):  # type: ignore[no-untyped-def]
        norms = np.empty(x.size)
        for i in range(x.size):
            norms[i] = x[i] * x[i]
        for k in range(u.shape[0]):
            for i in range(x.size):
                norms[i] += u[k, i] * u[k, i]
        for i in range(x.size):
            norms[i] = math.sqrt(norms[i])
            log_norm[i] += math.log(norms[i])
            x[i] /= norms[i]
        for k in range(u.shape[0]):
            for i in range(x.size):
                u[k, i] /= norms[i]

    return plane if u.ndim == 1 else space


@compiled
def advance(m, noise, h, x, u, xi, log_norm, push, steps, interval, rng):  # type: ignore[no-untyped-def]
    """Advance paths by `steps` steps of length h, in place, and return how often they crossed lines of jumps.

    Args:
        m, noise: a motion and the `step` of a noise of this h.
        x, u, xi: the state of the paths, and that of their noise.
        log_norm: ln ‖(x, u)‖ that has been taken out of the state; after every `interval` steps, and at the end, it
            takes in what the state has grown by, and the state has the norm 1 again.
        push: takes in ∫f(ξ) dt, see `draw`.
        rng: a `numpy.random.Generator`.
    """
    room = np.empty((5, CHUNK))
    crossed = 0
    for first in range(0, x.size, CHUNK):
        part = slice(first, min(first + CHUNK, x.size))
        xs, us, xis, logs, pushes = x[part], u[..., part], xi[..., part], log_norm[part], push[part]
        for step in range(1, steps + 1):
            crossed += _move(m, noise, h, xs, us, xis, logs, pushes, room, rng)  # type: ignore[no-untyped-call]
            if step % interval == 0 or step == steps:
                _normalise(xs, us, logs)  # type: ignore[no-untyped-call]
    return crossed


@compiled
def add_windows(log_norm, starts, number, p, log_sums, log_squares):  # type: ignore[no-untyped-def]
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
def advance_population(  # type: ignore[no-untyped-def]
    m, noise, h, x, u, xi, log_norm, push, log_weights, ancestors, exponents, steps, interval, log_z, rng
):
    """Advance a population by some steps; the weights are looked at after every `interval` steps."""
    done = 0
    p, bias, bonus = exponents
    while done < steps:
        count = min(interval, steps - done)
        for i in range(x.size):
            log_norm[i], push[i] = 0.0, 0.0
        advance(m, noise, h, x, u, xi, log_norm, push, count, np.int64(RENORMALISED), rng)  # else compiled for this 4
        for i in range(x.size):
            log_weights[i] += p * log_norm[i] + bias * push[i] + bonus * count
        log_z[0] += _resample(x, u, xi, log_weights, ancestors, rng)
        done += count


@compiled
def close_slice(log_weights, ancestors, log_z, expected, tallies):  # type: ignore[no-untyped-def]
    """Add a slice of a population to its `TALLIES`, and begin the next one; returns the growth of ln Z in it."""
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
    excess, record = growth - expected, tallies[0]
    if record.count == 0:
        record.first = excess
    else:
        record.products += excess * record.last
    record.numbered += excess * record.count
    record.count += 1
    record.excess += excess
    record.squares += excess * excess
    record.effective += total**2 / squares
    record.last = excess
    log_z[1] = now
    return growth


@compiled
def _resample(x, u, xi, log_weights, ancestors, rng):  # type: ignore[no-untyped-def]
    """Draw the paths anew if their weights differ too much, systematically; returns ln of the mean weight."""
    n = x.size
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
    _choose(x, chosen)
    _choose(ancestors, chosen)
    for numbers in u.reshape(-1, n):
        _choose(numbers, chosen)
    for numbers in xi.reshape(-1, n):
        _choose(numbers, chosen)
    for i in range(n):
        log_weights[i] = 0.0
    return largest + math.log(spacing)


@compiled
def _choose(values, chosen):  # type: ignore[no-untyped-def]
    """The values with these numbers, in place."""
    old = values.copy()
    for i in range(values.size):
        values[i] = old[chosen[i]]


@compiled
def _largest(values):  # type: ignore[no-untyped-def]
    largest = -math.inf
    for i in range(values.size):
        largest = max(largest, values[i])
    return largest
