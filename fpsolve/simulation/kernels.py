"""All paths of a batch, compiled: their steps, their growth, their weights, and how they are drawn anew.

What moves them is a motion of `motions` and the `step` of the kind of noise. State: x, u and that of the noise of each
path, see `motions`, changed in place.
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
        xs, us, xis, logs, pushes = x[part], u[part], xi[..., part], log_norm[part], push[part]
        for step in range(1, steps + 1):
            crossed += _move(m, noise, h, xs, us, xis, logs, pushes, room, rng)  # type: ignore[no-untyped-call]
            if step % interval == 0 or step == steps:
                for i in range(xs.size):
                    norm = math.sqrt(xs[i] * xs[i] + us[i] * us[i])
                    logs[i] += math.log(norm)
                    xs[i] /= norm
                    us[i] /= norm
    return crossed


@compiled
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


@compiled
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


@compiled
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


@compiled
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
    x[:], u[:], xi[..., :], ancestors[:] = x[chosen], u[chosen], xi[..., chosen], ancestors[chosen]
    log_weights[:] = 0
    return largest + math.log(spacing)
