"""Paths of ẋ = A(ξ)x under a telegraph with a wall, and how far they rise: shares no code with fpsolve.

Over short steps a path moves by the exact exponential of its matrix; between them the telegraph has its exact law.
"""

import math

import numpy as np
from scipy.linalg import expm

SHARE = 1e-4
"""A path ends where it may still exceed its maximum with this probability only, up to a factor."""


def chain_paths(matrices, rate, delta, levels, *, paths, factor=1.0, step=0.01, seed=1):
    """The largest ln ‖x‖ of paths from (1, 0); of the counts of upcrossings of some levels mean and standard error.

    Args:
        matrices: A for either state, which is left at a rate.
        delta: about δ_p, which says when a path is over.
        levels: A.
        factor: R at x = 0, where ‖x‖ is multiplied by it.
    """
    rng, flows = np.random.default_rng(seed), np.array([expm(step * np.array(each)) for each in matrices])
    logs, least, flips = np.log(levels)[:, None], math.log(SHARE) / delta, 0.5 * (1 - math.exp(-2 * rate * step))
    left, state, x = np.arange(paths), rng.integers(2, size=paths), np.tile([1.0, 0.0], (paths, 1))
    size, highest, counts = np.zeros(paths), np.zeros(paths), np.zeros((len(logs), paths))
    while left.size:
        moved = np.einsum("nij,nj->ni", flows[state[left]], x[left])
        length = np.linalg.norm(moved, axis=1)
        end = size[left] + np.log(length)
        counts[:, left] += (size[left] < logs) & (logs <= end)
        highest[left] = np.maximum(highest[left], end)
        size[left] = end + math.log(factor) * (moved[:, 0] * x[left, 0] < 0)
        x[left] = moved / length[:, None]
        state[left] ^= rng.random(left.size) < flips
        left = left[size[left] > highest[left] + least]
    return highest, counts.mean(axis=1), counts.std(axis=1) / math.sqrt(paths)
