"""Any linear motion of three or more variables, compiled: ẋ = A(ξ) x, as `motions` has it for the plane.

The steps are the same: Magnus's exponential of order 4 under a diffusion or white noise, exact times of jumps under a
chain, flows in turn under several noises. Only exp Ω x is not known in closed form: it is the sum of its series, where
Ω is small, and is taken in parts where it is not. There are no lines at which the norm grows.

State: x is the first variable of each path and u the others, shapes (paths,) and (n − 1, paths).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.simulation.compiled import compiled
from fpsolve.simulation.motions import drawn, picked
from fpsolve.simulation.several import integrate_all

_BLOCK = 128
"""Paths whose matrices are in the cache together."""
_LIMIT = 1.0
"""The norm of Ω above which a step is taken in parts."""
_MOST_PARTS = 10_000
_REST = 1e-12
"""What is left of the series, as a share of the state."""
_HUGE = 1e100


class DrivenSpace(NamedTuple):
    """A₀, A₁, [A₀, A₁] and [A₁, [A₁, A₀]], shape (4, n, n)."""

    matrices: FloatArray

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """One step as that of a `DrivenMotion`."""
        mean, rise = room[0, : x.size], room[1, : x.size]
        drawn(noise, xi, mean, rise, push, rng)
        return step_driven_space(m, h, x, u, mean, rise, log_norm)


class SwitchedSpace(NamedTuple):
    """A of each state, exp(A h), and what multiplies x on arrival, shapes (states, n, n), and ‖A‖, shape (states,)."""

    matrices: FloatArray
    whole: FloatArray
    arrivals: FloatArray
    sizes: FloatArray

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """One step, of the length h of `whole`, as that of a `SwitchedMotion`."""
        return step_switched_space(m, noise, h, x, u, xi, log_norm, rng)


class SplitSpace(NamedTuple):
    """The matrix of each noise, shape (noises, n, n), its norm, and exp(½A₀h), shape (n, n)."""

    matrices: FloatArray
    sizes: FloatArray
    half: FloatArray

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """One step, of the length h of `half`, as that of a `SplitMotion`."""
        integrals = np.empty((m.sizes.size, x.size))
        integrate_all(noise, xi, h, integrals, 0, room, push, rng)
        return step_split_space(m, x, u, integrals, log_norm, rng)


@compiled
def _terms(size):  # type: ignore[no-untyped-def]
    """How many terms of the series of the exponential of a matrix of this norm count."""
    count, rest = 1, size
    while rest > _REST:
        count += 1
        rest *= size / count
    return count


@compiled
def _load(x, u, i, state):  # type: ignore[no-untyped-def]
    state[0] = x[i]
    for k in range(u.shape[0]):
        state[1 + k] = u[k, i]


@compiled
def _store(x, u, i, state):  # type: ignore[no-untyped-def]
    x[i] = state[0]
    for k in range(u.shape[0]):
        u[k, i] = state[1 + k]


@compiled
def _multiplied(matrix, state, other):  # type: ignore[no-untyped-def]
    """Multiply a state by a matrix, in place; `other` is room for one more."""
    n = state.size
    for r in range(n):
        other[r] = 0.0
        for c in range(n):
            other[r] += matrix[r, c] * state[c]
    for r in range(n):
        state[r] = other[r]


@compiled
def _flow(matrix, t, size, state, other, begun):  # type: ignore[no-untyped-def]
    """exp(A t) x in place, ‖A‖ ≤ size, in parts; returns the growth of the norm beyond that of the state."""
    reach, log, n = abs(t) * size, 0.0, state.size
    if not reach < _LIMIT * _MOST_PARTS:
        return math.nan
    parts = 1 + int(reach / _LIMIT)
    s, terms = t / parts, _terms(reach / parts)
    for _ in range(parts):
        for r in range(n):
            begun[r] = state[r]
        for k in range(terms, 0, -1):
            for r in range(n):
                other[r] = 0.0
                for c in range(n):
                    other[r] += matrix[r, c] * state[c]
            for r in range(n):
                state[r] = begun[r] + s / k * other[r]
        log += _tamed(state)
    return log


@compiled
def _tamed(state):  # type: ignore[no-untyped-def]
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
def step_driven_space(m, h, x, u, mean, rise, log_norm):  # type: ignore[no-untyped-def]
    """Move paths by one step of length h, in place; returns 0, as there are no lines to cross.

    Args:
        m: a `DrivenSpace`.
        x, u: the state.
        mean, rise: ξ in the step is mean + rise (2t/h − 1).
        log_norm: takes in what the norm has grown by beyond that of the state.
    """
    n, lever = m.matrices.shape[1], -h * h / 6
    width = min(_BLOCK, x.size)
    omega, sizes = np.zeros((n, n, width)), np.empty(width)
    begun, now, after = np.zeros((n, width)), np.zeros((n, width)), np.empty((n, width))
    for first in range(0, x.size, width):
        part = slice(first, min(first + width, x.size))
        xs, us, means, rises, logs = x[part], u[:, part], mean[part], rise[part], log_norm[part]
        count = xs.size
        _copied(xs, begun[0], count)
        for k in range(n - 1):
            _copied(us[k], begun[1 + k], count)
        for i in range(width):
            sizes[i] = 0.0
        for r in range(n):
            _copied(begun[r], now[r], count)
            for c in range(n):
                steady, driven = h * m.matrices[0, r, c], h * m.matrices[1, r, c]
                turned, twice = lever * m.matrices[2, r, c], 0.6 * lever * lever / h * m.matrices[3, r, c]
                _entries(steady, driven, turned, twice, means, rises, omega[r, c], sizes)
        largest = 0.0
        for i in range(count):
            if sizes[i] < _LIMIT * _LIMIT:
                largest = max(largest, sizes[i])
        _summed(omega, _terms(math.sqrt(largest)), begun, now, after)
        for i in range(count):
            if not sizes[i] < _LIMIT * _LIMIT:
                logs[i] += _in_parts(m, h, begun[:, i], means[i], rises[i], now[:, i])
        _copied(now[0], xs, count)
        for k in range(n - 1):
            _copied(now[1 + k], us[k], count)
    return 0


@compiled
def _summed(omega, terms, begun, now, after):  # type: ignore[no-untyped-def]
    """exp Ω of all paths times what was begun with, by so many terms of its series; now is that in the beginning."""
    n = begun.shape[0]
    for k in range(terms, 0, -1):
        for r in range(n):
            row = omega[r]
            _first(row[0], now[0], row[1], now[1], row[2], now[2], after[r])
            for c in range(3, n):
                _more(row[c], now[c], after[r])
        for r in range(n):
            _next(begun[r], after[r], 1 / k, now[r])


@compiled
def _multiplied_all(matrix, states, products):  # type: ignore[no-untyped-def]
    """A matrix times the states of all paths."""
    n = matrix.shape[0]
    for r in range(n):
        for i in range(products.shape[1]):
            products[r, i] = 0.0
        for c in range(n):
            entry = matrix[r, c]
            for i in range(products.shape[1]):
                products[r, i] += entry * states[c, i]


@compiled
def _copied(values, into, count):  # type: ignore[no-untyped-def]
    for i in range(count):
        into[i] = values[i]


@compiled
def _entries(steady, driven, turned, twice, mean, rise, entry, sizes):  # type: ignore[no-untyped-def]
    """One entry of the Ω of all paths, and what it adds to ‖Ω‖²."""
    for i in range(mean.size):
        value = steady + mean[i] * driven + rise[i] * (turned + rise[i] * twice)
        entry[i] = value
        sizes[i] += value * value


@compiled
def _first(a, x, b, y, c, z, sums):  # type: ignore[no-untyped-def]
    for i in range(sums.size):
        sums[i] = a[i] * x[i] + b[i] * y[i] + c[i] * z[i]


@compiled
def _more(a, x, sums):  # type: ignore[no-untyped-def]
    for i in range(sums.size):
        sums[i] += a[i] * x[i]


@compiled
def _next(begun, added, factor, state):  # type: ignore[no-untyped-def]
    for i in range(state.size):
        state[i] = begun[i] + factor * added[i]


@compiled
def _in_parts(m, h, begun, mean, rise, end):  # type: ignore[no-untyped-def]
    """One step in parts that are small enough: sets the state at its end, returns its growth beyond that."""
    n = begun.size
    omega, state, other, room = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    largest = 0.0
    for xi in (mean - rise, mean + rise):
        size = 0.0
        for r in range(n):
            state[r] = begun[r]
            for c in range(n):
                size += (m.matrices[0, r, c] + xi * m.matrices[1, r, c]) ** 2
        largest = max(largest, size)
    size, log = h * math.sqrt(largest) / _LIMIT, 0.0
    if not size < _MOST_PARTS:
        end[:] = math.nan
        return math.nan
    parts = 1 + int(size)
    s, slope = h / parts, rise / parts
    b = -s * s / 6 * slope
    for part in range(parts):
        a = s * (mean + rise * ((2 * part + 1) / parts - 1))
        size = 0.0
        for r in range(n):
            for c in range(n):
                value = s * m.matrices[0, r, c] + a * m.matrices[1, r, c] + b * m.matrices[2, r, c]
                omega[r, c] = value + 0.6 * b * b / s * m.matrices[3, r, c]
                size += omega[r, c] * omega[r, c]
        log += _flow(omega, 1.0, math.sqrt(size), state, other, room)
    for r in range(n):
        end[r] = state[r]
    return log


@compiled
def step_switched_space(m, chain, h, x, u, states, log_norm, rng):  # type: ignore[no-untyped-def]
    """Move paths by a time h, in place, with all jumps of the noise in it; returns 0.

    Args:
        m, chain: a `SwitchedSpace` for this h and the `step` of a chain.
        x, u: the state.
        states: the number of that of the noise.
        log_norm: takes in what the norm has grown by beyond that of the state.
        rng: a `numpy.random.Generator`.
    """
    n = m.matrices.shape[1]
    state, other, begun = np.empty(n), np.empty(n), np.empty(n)
    for i in range(x.size):
        k, left = int(states[i]), h
        _load(x, u, i, state)
        while left > 0:
            stay = rng.standard_exponential() / chain.leaving[k]
            if stay >= h and left == h:
                _multiplied(m.whole[k], state, other)
            else:
                log_norm[i] += _flow(m.matrices[k], min(stay, left), m.sizes[k], state, other, begun)
            left -= stay
            if left > 0:
                k = picked(chain.reached[k], rng)
                _multiplied(m.arrivals[k], state, other)
        log_norm[i] += _tamed(state)
        _store(x, u, i, state)
        states[i] = k
    return 0


@compiled
def step_split_space(m, x, u, integrals, log_norm, rng):  # type: ignore[no-untyped-def]
    """Move paths by one step, in place; returns 0.

    Args:
        m: a `SplitSpace` for steps of this length.
        x, u: the state.
        integrals: ∫ξ dt of every noise over the step, shape (noises, paths).
        log_norm: takes in what the norm has grown by beyond that of the state.
        rng: a `numpy.random.Generator`.
    """
    n, count = m.half.shape[0], integrals.shape[0]
    width = min(_BLOCK, x.size)
    omega, sizes, is_forward = np.zeros((n, n, width)), np.zeros(width), np.zeros(width)
    begun, now, after = np.zeros((n, width)), np.zeros((n, width)), np.empty((n, width))
    state, other, room = np.empty(n), np.empty(n), np.empty(n)
    for first in range(0, x.size, width):
        part = slice(first, min(first + width, x.size))
        xs, us, logs, parts = x[part], u[:, part], log_norm[part], integrals[:, part]
        paths = xs.size
        _copied(xs, begun[0], paths)
        for k in range(n - 1):
            _copied(us[k], begun[1 + k], paths)
        _multiplied_all(m.half, begun, now)
        for i in range(paths):
            is_forward[i] = rng.random() < 0.5
        for j in range(count):
            k = count - 1 - j
            largest = 0.0
            for i in range(paths):
                one, other_one = parts[j, i] * is_forward[i], parts[k, i] * (1 - is_forward[i])
                sizes[i] = abs(one) * m.sizes[j] + abs(other_one) * m.sizes[k]
                if sizes[i] < _LIMIT:
                    largest = max(largest, sizes[i])
            for r in range(n):
                _copied(now[r], begun[r], width)
                for c in range(n):
                    _taken(m.matrices[j, r, c], parts[j], m.matrices[k, r, c], parts[k], is_forward, omega[r, c])
            _summed(omega, _terms(largest), begun, now, after)
            for i in range(paths):
                if not sizes[i] < _LIMIT:
                    of = j if is_forward[i] else k
                    for r in range(n):
                        state[r] = begun[r, i]
                    logs[i] += _flow(m.matrices[of], parts[of, i], m.sizes[of], state, other, room)
                    for r in range(n):
                        now[r, i] = state[r]
        _multiplied_all(m.half, now, after)
        for i in range(paths):
            for r in range(n):
                state[r] = after[r, i]
            logs[i] += _tamed(state)
            _store(xs, us, i, state)
    return 0


@compiled
def _taken(first, integrals, other, integrals_of_other, is_first, entry):  # type: ignore[no-untyped-def]
    """One entry of the Ω of all paths, each by the one noise or by the other."""
    for i in range(integrals.size):
        entry[i] = is_first[i] * integrals[i] * first + (1 - is_first[i]) * integrals_of_other[i] * other
