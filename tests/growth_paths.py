"""Paths of dx = [[−1, 0], [5, −1]]x dt + Jx ∘ dW beside the law of ln ‖x(t)‖/t: `python -m tests.growth_paths FILE`.

A step is half of the drift, the rotation by ΔW, and half of the drift: of weak order 2. It draws a million paths.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from fpsolve import PlaneSystem, Problem
from fpsolve.analysis import growth_law
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, White

TIMES = (2.0, 4.0, 8.0)
CHUNK = 8192
"""Paths that are moved together, so that they stay in the cache."""
RATES = np.linspace(-1.6, 1.2, 29)
SHEAR = Problem(
    PlaneSystem(
        [
            CoefficientMatrix(0, ((-1.0, 0.0), (5.0, -1.0))),
            CoefficientMatrix(1, ((0.0, -1.0), (1.0, 0.0)), identity),
        ]
    ),
    White(s=1.0),
)


def simulated(paths, seed, step):
    """ln ‖x(t)‖/t of paths from (1, 0) at the times, shape (times, paths)."""
    rng = np.random.default_rng(seed)
    parts = [_part(rng, min(CHUNK, paths - first), step) for first in range(0, paths, CHUNK)]
    return np.concatenate(parts, axis=1)


def _part(rng, paths, step):
    """Those of some paths; e^{−t} is taken out of them, and the halves of the drift between rotations are one."""
    x, v, found = np.ones(paths), np.zeros(paths), []
    v += 2.5 * step * x
    for n in range(1, round(TIMES[-1] / step) + 1):
        angle = math.sqrt(step) * rng.standard_normal(paths)
        cos, sin = np.cos(angle), np.sin(angle)
        x, v = cos * x - sin * v, sin * x + cos * v
        if any(abs(n * step - time) < 0.5 * step for time in TIMES):
            found.append(np.log(np.hypot(x, v + 2.5 * step * x)) / (n * step) - 1)
        v += 5 * step * x
    return np.array(found)


def compared(paths, rates=RATES):
    """For each time P(s_t ≥ s) with its error, and the share of paths with its standard deviation."""
    law = growth_law(SHEAR, TIMES, rates)
    for i, time in enumerate(TIMES):
        share = np.mean(paths[i] >= rates[:, None], axis=1)
        deviation = np.sqrt(law.above[i] * law.below[i] / paths.shape[1])
        yield time, law.above[i], law.probability_error[i], share, deviation


def draw(file, count=1_000_000):
    """The figure of the documentation, and what is furthest off, in standard deviations and errors."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.2, 4.6), layout="constrained", dpi=160)
    colours = ("#0072B2", "#D55E00", "#009E73")
    rows = compared(simulated(count, seed=0, step=0.01))
    for colour, (time, found, error, share, deviation) in zip(colours, rows, strict=True):
        for side, line, dots in ((1, found, share), (-1, 1 - found, 1 - share)):
            own = RATES >= -0.352 if side > 0 else RATES <= -0.352
            seen = own & (dots * count >= 10)
            label = f"$t$ = {time:g}" if side > 0 else None
            axes.semilogy(RATES[own], line[own], color=colour, label=label)
            axes.fill_between(
                RATES[own], np.maximum(line - error, 1e-7)[own], (line + error)[own], color=colour, alpha=0.25
            )
            axes.semilogy(RATES[seen], dots[seen], ".", color=colour)
        seen = np.minimum(found, 1 - found) * count >= 10
        apart = np.abs(share - found)[seen]
        sampled, rest = apart / deviation[seen], np.maximum(apart - 4 * deviation[seen], 0) / error[seen]
        print(f"t = {time:g}: {sampled.max():.1f} standard deviations; beyond 4 of them {rest.max():.2f} of the error")
    axes.set(
        xlabel=r"growth rate $s = \ln\|x(t)\|/t$ (1/time)",
        ylabel=r"$P(s_t\leq s)$ left, $P(s_t\geq s)$ right of $\lambda$",
    )
    axes.set_ylim(1e-6, 1)
    axes.plot([], [], ".", color="0.35", label=f"{count:,} paths")
    axes.legend(frameon=False)
    figure.savefig(file)


if __name__ == "__main__":
    draw(sys.argv[1] if len(sys.argv) > 1 else "growth.png")
