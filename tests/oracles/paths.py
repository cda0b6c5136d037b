"""Paths of ẋ = A(ξ)x with a wall, and how far they rise: a simulation that shares no code with fpsolve.

Between two switches of a chain a path moves by the exact exponential of its matrix; a diffusing noise is held at its
middle over short steps. Impacts, and maxima of ‖x‖ within a step, are sought in it.

`python -m tests.oracles.paths` gives the means of an oscillator with cubes, by Runge and Kutta's rule in NumPy, that
cases/systems/duffing.toml and a test of slow tails expect.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SHARE = 1e-4
"""A path ends where it may still exceed its maximum with this probability only, up to a factor."""


@njit(cache=False)
def _flow(a, t, x, v):
    """exp(At) applied to (x, v)."""
    mean, half = 0.5 * (a[0, 0] + a[1, 1]), 0.5 * (a[0, 0] - a[1, 1])
    d = half * half + a[0, 1] * a[1, 0]
    root = math.sqrt(abs(d))
    if root * t < 1e-8:
        c, s = 1.0, t
    elif d < 0:
        c, s = math.cos(root * t), math.sin(root * t) / root
    else:
        c, s = math.cosh(root * t), math.sinh(root * t) / root
    size = math.exp(mean * t)
    return size * (c * x + s * (half * x + a[0, 1] * v)), size * (c * v + s * (a[1, 0] * x - half * v))


@njit(cache=False)
def _growth(a, x, v):
    """d ln ‖x‖/dt."""
    return (x * (a[0, 0] * x + a[0, 1] * v) + v * (a[1, 0] * x + a[1, 1] * v)) / (x * x + v * v)


@njit(cache=False)
def _moved(a, t, x, v, log_size, highest, levels, counts):
    """A path after a time without an impact; (x, v) has the length 1, and its logarithm is kept apart."""
    new_x, new_v = _flow(a, t, x, v)
    first, last = _growth(a, x, v), _growth(a, new_x, new_v)
    length = math.sqrt(new_x * new_x + new_v * new_v)
    end = log_size + math.log(length)
    top = max(log_size, end)
    if first > 0 > last:  # a maximum within, where the growth is 0
        low, high = 0.0, t
        for _ in range(40):
            middle = 0.5 * (low + high)
            mx, mv = _flow(a, middle, x, v)
            if _growth(a, mx, mv) > 0:
                low = middle
            else:
                high = middle
        mx, mv = _flow(a, low, x, v)
        top = max(top, log_size + 0.5 * math.log(mx * mx + mv * mv))
    for i in range(levels.size):
        if log_size < levels[i] <= top:
            counts[i] += 1
    return new_x / length, new_v / length, end, max(highest, top)


@njit(cache=False)
def _stepped(a, t, log_factor, side, x, v, log_size, highest, levels, counts):
    """The same with impacts at x = 0, where ‖x‖ is multiplied by R; `side` is the sign of x, also at an impact."""
    while t > 0:
        new_x, _ = _flow(a, t, x, v)
        if log_factor == 0.0 or new_x * side > 0:
            x, v, log_size, highest = _moved(a, t, x, v, log_size, highest, levels, counts)
            break
        low, high = 0.0, t
        for _ in range(50):
            middle = 0.5 * (low + high)
            mx, _ = _flow(a, middle, x, v)
            if mx * side > 0:
                low = middle
            else:
                high = middle
        x, v, log_size, highest = _moved(a, low, x, v, log_size, highest, levels, counts)
        log_size += log_factor
        t, side = t - high, -side
        x = side * 1e-15
    return side, x, v, log_size, highest


@njit(cache=False)
def _of_chain(matrices, rates, starts, x, v, log_factor, levels, least, longest, rng):
    tops, totals = np.empty(starts.size), np.zeros(levels.size)
    squares, counts = np.zeros(levels.size), np.zeros(levels.size)
    for n in range(starts.size):
        state, side, log_size, highest = starts[n], 1.0 if x > 0 else -1.0, 0.0, 0.0
        counts[:] = 0
        a, b = x, v
        while log_size > highest + least:
            left = rng.exponential(-1 / rates[state, state])
            while left > 0 and log_size > highest + least:
                step = min(left, longest)
                side, a, b, log_size, highest = _stepped(
                    matrices[state], step, log_factor, side, a, b, log_size, highest, levels, counts
                )
                left -= step
            draw = rng.random() * -rates[state, state]
            for other in range(rates.shape[0]):
                if other != state:
                    draw -= rates[state, other]
                    if draw < 0:
                        state = other
                        break
        tops[n] = highest
        totals += counts
        squares += counts**2
    return tops, totals, squares


def chain_paths(matrices, rates, probabilities, delta, levels, *, paths, factor=1.0, start=(1.0, 0.0), seed=1):
    """The largest ln ‖x‖ of paths under a chain; of the counts of upcrossings of some levels mean and standard error.

    Args:
        matrices: A for each state, shape (n, 2, 2).
        rates, probabilities: of the chain, whose start is drawn.
        delta: about δ_p, which says when a path is over.
        levels: A.
        paths: how many.
        factor: R at x = 0.
        start: a unit vector.
    """
    rng = np.random.default_rng(seed)
    starts = rng.choice(len(probabilities), size=paths, p=probabilities)
    matrices = np.array(matrices, dtype=float)
    fastest = max(np.linalg.norm(each, 2) for each in matrices)
    least, logs = math.log(SHARE) / delta, np.log(np.array(levels, dtype=float))
    begun = starts, *map(float, start)
    tops, totals, squares = _of_chain(
        matrices, np.array(rates, dtype=float), *begun, math.log(factor), logs, least, 0.5 / fastest, rng
    )
    mean = totals / paths
    return tops, mean, np.sqrt((squares / paths - mean**2) / paths)


def cubic_means(omega, zeta, k, c, d, alpha, sigma, *, paths, time, step, seed, settling=200.0):
    """E x², E ẋ² and E a⁴ of ẍ + ω²x = 2ζωẋ − kx³ − cx²ẋ − dẋ³ − ξx under Ornstein-Uhlenbeck noise.

    With their standard errors, from the averages of each path over a time after `settling`.
    """
    rng = np.random.default_rng(seed)
    decay = math.exp(-alpha * step)
    xi = sigma / math.sqrt(2 * alpha) * rng.standard_normal(paths)
    kick = sigma * math.sqrt((1 - decay**2) / (2 * alpha))
    phase = rng.uniform(0, 2 * math.pi, paths)
    x, v = np.cos(phase), omega * np.sin(phase)

    def rates(x, v, xi):
        return v, 2 * zeta * omega * v - x * (omega**2 + xi + k * x**2 + c * x * v) - d * v**3

    sums, count = np.zeros((3, paths)), 0
    for n in range(round((settling + time) / step)):
        end = decay * xi + kick * rng.standard_normal(paths)
        x1, v1 = rates(x, v, xi)
        x2, v2 = rates(x + step / 2 * x1, v + step / 2 * v1, (xi + end) / 2)
        x3, v3 = rates(x + step / 2 * x2, v + step / 2 * v2, (xi + end) / 2)
        x4, v4 = rates(x + step * x3, v + step * v3, end)
        x, v, xi = x + step / 6 * (x1 + 2 * x2 + 2 * x3 + x4), v + step / 6 * (v1 + 2 * v2 + 2 * v3 + v4), end
        if n * step >= settling:
            sums += x**2, v**2, (x**2 + (v / omega) ** 2) ** 2
            count += 1
    averages = sums / count
    return averages.mean(axis=1), averages.std(axis=1, ddof=1) / math.sqrt(paths)


if __name__ == "__main__":
    for step in (0.05, 0.025):
        print(step, *cubic_means(1.0, 0.02, 0.3, 0.2, 0.0, 2.0, 1.5, paths=20_000, time=1000.0, step=step, seed=1))
    print(*cubic_means(1.0, 0.05, 0.0, 0.0, 1.0, 2.0, 1.5, paths=20_000, time=600.0, step=0.05, seed=3))
