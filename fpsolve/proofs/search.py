"""From a trial function to bounds: the cells, the place where u is held, and the least δ for which W exists."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import above, below
from fpsolve.proofs.basis import Core
from fpsolve.proofs.bounds import Bounder, Bounds, Trial
from fpsolve.proofs.factor import Factor, Rates, Side, march

CELLS, REACH, HELD_FROM, CANDIDATES = 480, 10.0, 3.5, 24
SLACK = 1e-6
"""Of the mismatch, relative, so that another machine's rounding does not matter."""


@dataclass(frozen=True)
class Found:
    """W and δ.

    Attributes:
        nodes, values: W at nodes from left to right.
        tails: the constants beyond both ends, or nothing.
        delta: δ.
    """

    nodes: FloatArray
    values: FloatArray
    tails: tuple[float, float] | None
    delta: float


def rates_of(trial: Trial) -> Rates:
    """ν and b′(0) as floats."""
    noise = trial.noise
    return Rates(above(noise.nu), below(noise.nu), trial.p is not None)


def nodes_for(trial: Trial) -> FloatArray:
    """Ends of cells: equal ones on the core, or in the angle on the whole support."""
    if not isinstance(trial.basis, Core):
        nodes = np.sin(np.linspace(-math.pi / 2, math.pi / 2, CELLS + 1))
        nodes[0], nodes[-1] = -1.0, 1.0
        return nodes
    low, high = trial.basis.centre + REACH * trial.basis.scale * np.array([-1.0, 1.0])
    if trial.noise.is_bounded:
        low, high = max(low, -0.999), min(high, 0.999)
    return np.linspace(low, high, CELLS + 1)


def search(trial: Trial, phases: int) -> Found | None:
    """The least δ for a trial, to 1 %; None where there is none."""
    nodes, bounder = nodes_for(trial), Bounder(trial, phases)
    found = bounder.bounds(nodes[:-1], nodes[1:])
    if not np.any(np.isfinite(found.mismatch)):
        return None
    middle = _middle(found)
    sides = _sides(trial, bounder, nodes, found, middle)
    rates = rates_of(trial)
    least = max(float(np.min(found.mismatch)), 1e-18)
    high = least
    while not _both(sides, rates, high):
        high *= 10
        if not high < 1e6:
            return None
    low = high / 10
    while high > 1.01 * low:
        middle_delta = math.sqrt(low * high)
        if _both(sides, rates, middle_delta):
            high = middle_delta
        else:
            low = middle_delta
    both = _both(sides, rates, high)
    return None if both is None else _joined(sides, *both, high)


def _middle(found: Bounds) -> int:
    """The node where B changes its sign and u is sure to be positive."""
    inward = np.maximum(np.abs(found.inward_low), np.abs(found.inward_high))
    return int(np.argmin(np.where(np.isfinite(found.mismatch), inward, np.inf)))


def _sides(trial: Trial, bounder: Bounder, nodes: FloatArray, found: Bounds, middle: int) -> tuple[Side, Side]:
    """The left, mirrored, and the right."""
    mismatch = found.mismatch * (1 + SLACK)
    beta = trial.basis.gauge if trial.p is not None else 0.0
    left = (-nodes[middle::-1], mismatch[:middle][::-1], -found.inward_high[:middle][::-1], -beta)
    right = (nodes[middle:], mismatch[middle:], found.inward_low[middle:], beta)
    return _side(trial, bounder, *left, -1), _side(trial, bounder, *right, 1)


def _side(
    trial: Trial, bounder: Bounder, nodes: FloatArray, mismatch: FloatArray, inward: FloatArray, beta: float, sign: int
) -> Side:
    good = np.isfinite(mismatch)
    inward = inward - SLACK * 1e-3 * (1 + np.abs(inward))
    ends = None
    if isinstance(trial.basis, Core):
        last = len(good) if good.all() else int(np.argmin(good))
        nodes, mismatch, inward = nodes[: last + 1], mismatch[:last], inward[:last]
        far = np.abs(nodes - sign * trial.basis.centre) > HELD_FROM * trial.basis.scale
        chosen = np.flatnonzero(far)
        chosen = np.unique(chosen[np.linspace(0, len(chosen) - 1, CANDIDATES).astype(int)]) if len(chosen) else chosen
        known = bounder.ends(sign * nodes[chosen], sign) if len(chosen) else []
        ends = {int(j): end for j, end in zip(chosen, known, strict=True) if math.isfinite(end.mismatch)}
    return Side(nodes, mismatch, inward, beta, ends)


def _both(sides: tuple[Side, Side], rates: Rates, delta: float) -> tuple[Factor, Factor] | None:
    """Both halves of W."""
    left = march(sides[0], rates, delta)
    right = march(sides[1], rates, delta) if left is not None else None
    return (left, right) if left is not None and right is not None else None


def _joined(sides: tuple[Side, Side], left: Factor, right: Factor, delta: float) -> Found:
    """One function from left to right."""
    count = len(left.values)
    nodes = np.concatenate([-sides[0].nodes[:count][:0:-1], sides[1].nodes[: len(right.values)]])
    values = np.concatenate([-left.values[:0:-1], right.values])
    tails = None if left.tail is None or right.tail is None else (-left.tail, right.tail)
    return Found(nodes, values, tails, delta * (1 + 1e-9))
