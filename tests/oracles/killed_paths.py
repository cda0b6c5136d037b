"""Lower bounds of Λ(p), p < 0, by simulation: paths whose noise leaves a slab far out on the damping side are killed.

In the slab, where ε|ξ| > 2ω, y = ẋ/(ωx) obeys ẏ = −ω(1 + y²) + ε ξ y and comes to rest at −1 < y < 0, where ln |x|
falls at the rate ω|y|, without an impact. The drift b of the noise is traded for a weight (Girsanov): without it, paths
carry exp(−∫ (b²/(2σ²) + b′/2) dt), and the factor √P_s at their ends does not grow. The paths are drawn anew in
proportion to their weights and |x|^p after every time unit, and what is left of their number is the mean growth.
"""

import numpy as np


def growth(oscillator, noise, p, slab, *, paths, time, transient, step=0.02, seed=0):
    """The rate at which E |x|^p of the paths in the slab grows, and its standard error from 16 batches of time."""
    rng = np.random.default_rng(seed)
    low, high = slab
    xi, y = rng.uniform(low, high, paths), np.full(paths, -0.1)
    steps, size, omega = round(1 / step), noise.diffusion * np.sqrt(step), oscillator.omega
    rates = []
    for _ in range(round(transient + time)):
        logs, alive = np.zeros(paths), np.ones(paths, dtype=bool)
        for _ in range(steps):
            xi = xi + size * rng.standard_normal(paths)
            alive &= (low < xi) & (xi < high)
            xi = np.clip(xi, low, high)
            logs -= _cost(noise, xi) * step
            rest = (oscillator.epsilon * xi - omega * y) * step  # ẏ = −ω + y (ε ξ − ω y), exact for a constant bracket
            y = y * np.exp(rest) - omega * step * np.expm1(rest) / rest
            logs += p * omega * y * step
        weights = np.where(alive, np.exp(logs), 0.0)
        rates.append(np.log(np.mean(weights)))
        positions = (rng.random() + np.arange(paths)) / paths
        chosen = np.minimum(np.searchsorted(np.cumsum(weights) / np.sum(weights), positions), paths - 1)
        xi, y = xi[chosen], y[chosen]
    batches = np.array_split(rates[round(transient) :], 16)
    means = np.array([np.mean(batch) for batch in batches])
    return float(np.mean(means)), float(np.std(means, ddof=1) / 4)


def _cost(noise, xi):
    """b²/(2σ²) + b′/2."""
    bracket = 1 + noise.curvature * xi**2
    slope = -(2 - bracket) / (noise.tau0 * bracket**2)
    return 0.5 * (noise.drift(xi) / noise.diffusion) ** 2 + 0.5 * slope
