"""Paths of ẍ + ω²x = 2ζωẋ − kx³ − cx²ẋ − dẋ³ − ξx under Ornstein-Uhlenbeck noise, by Runge and Kutta's rule in NumPy.

`python -m tests.oracles.cubic_paths` gives the means that cases/systems/duffing.toml and a test of slow tails expect.
"""

import math

import numpy as np


def means(omega, zeta, k, c, d, alpha, sigma, *, paths, time, step, seed, settling=200.0):
    """E x², E ẋ² and E a⁴ with their standard errors, from the averages of each path over a time after `settling`."""
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
        print(step, *means(1.0, 0.02, 0.3, 0.2, 0.0, 2.0, 1.5, paths=20_000, time=1000.0, step=step, seed=1))
    print(*means(1.0, 0.05, 0.0, 0.0, 1.0, 2.0, 1.5, paths=20_000, time=600.0, step=0.05, seed=3))
