"""The regions into which lines of stability divide a frame, with their names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from fpsolve.analysis.stability import Boundary
from fpsolve.analysis.target import Target
from fpsolve.arrays import FloatArray, ReadOnly

FINE = 16
"""Number of pieces, each way, into which a cell of the coarsest scan is divided for a picture."""
_ORDINALS = {1.0: "first", 2.0: "second", 3.0: "third", 4.0: "fourth"}
P_BIFURCATIONS = {-1.0: "hump of the amplitude density", -2.0: "crater of the joint density"}
"""What the stationary response of the nonlinear oscillator shows where λ > 0 and δ_p is below a value.

Near a = 0 its amplitude density is a^(−δ_p − 1) and its joint density of (x, ẋ) is a^(−δ_p − 2).
"""


@dataclass(frozen=True, eq=False)
class Region:
    """Part of a frame, in one piece or in several.

    Attributes:
        name: "almost surely stable, second moment unstable".
        signs: that of F for each line, by its `Target` as it is written.
        share: of the frame.
        at: a point well inside, in shares of the sides of the frame.
    """

    name: str
    signs: dict[str, int]
    share: float
    at: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Regions(ReadOnly):
    """All of them.

    Attributes:
        each: from the largest to the smallest.
        index: which of them is where, on a fine grid of the frame, u first, shape (n, n); −1 where F does not exist.
    """

    each: tuple[Region, ...]
    index: FloatArray


def regions(lines: Sequence[Boundary]) -> Regions:
    """The regions of lines that were all sought in the frame, on a grid `FINE` times as fine as the coarsest scan."""
    scans = [line.scan for line in lines]
    points = FINE * min(scan.nodes.size - 1 for scan in scans)
    values = np.stack([scan.on((np.arange(points) + 0.5) / points) for scan in scans])
    signs, exists = np.where(values > 0, 1, -1), np.all(np.isfinite(values), axis=0)
    kinds = np.unique(signs[:, exists].T, axis=0)
    insides = [exists & np.all(signs == kind[:, None, None], axis=0) for kind in kinds]
    shares = [np.mean(inside) for inside in insides]
    index, each = np.full(exists.shape, -1), []
    for number, k in enumerate(np.argsort(shares)[::-1]):
        index[insides[k]] = number
        depth = distance_transform_edt(np.pad(insides[k], 1))[1:-1, 1:-1]
        deepest = np.array(np.unravel_index(int(np.argmax(depth)), depth.shape))
        u, v = ((deepest + 0.5) / exists.shape).tolist()
        name = name_of([line.target for line in lines], kinds[k].tolist())
        by_name = {str(line.target): int(sign) for line, sign in zip(lines, kinds[k], strict=True)}
        each.append(Region(name, by_name, float(shares[k]), (u, v)))
    return Regions(tuple(each), index)


def name_of(targets: Sequence[Target], signs: Sequence[int]) -> str:
    """What the signs of F mean: almost surely stable, second moment unstable, -2 < δ_p < -1.

    The bounds of δ_p are left out where λ < 0 says as much.
    """
    parts, below, above = [], -math.inf, math.inf
    pairs = sorted(zip(targets, signs, strict=True), key=lambda pair: (pair[0].kind == "moment", pair[0].order))
    for target, sign in pairs:
        if target.level:
            parts.append(target.side(sign))
        elif target.kind == "lyapunov_exponent":
            parts.append("almost surely " + ("unstable" if sign > 0 else "stable"))
            below = below if sign > 0 else 0.0
        elif target.kind == "moment":
            name = f"{_ORDINALS[target.p]} moment" if target.p in _ORDINALS else f"moment {target.p:g}"
            parts.append(f"{name} {'unstable' if sign > 0 else 'stable'}")
        elif sign > 0:
            above = min(above, target.value)
        else:
            below = max(below, target.value)
    low, high = (f"{below:g} < " if math.isfinite(below) else ""), (f" < {above:g}" if math.isfinite(above) else "")
    if (low or high) and below != 0:
        parts.append(f"{low}δ_p{high}" if high else f"δ_p > {below:g}")
    return ", ".join(parts)
