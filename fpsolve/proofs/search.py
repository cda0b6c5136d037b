"""From a trial function to bounds: the cells, the place where u is held, and the least δ for which W exists."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import above, below
from fpsolve.proofs.basis import Core
from fpsolve.proofs.bounds import Bounder, Bounds, HeldBounds, Trial
from fpsolve.proofs.factor import LOWER, UPPER, Factor, Rates, Side, march

CELLS, REACH, HELD_FROM, CANDIDATES = 480, 10.0, 3.5, 24
SLACK = 1e-6
"""Of the mismatch, relative, so that another machine's rounding does not matter."""


@dataclass(frozen=True)
class Found:
    """W and δ of one bound.

    Attributes:
        nodes, values: W at nodes from left to right.
        tails: the constants beyond both ends, or nothing.
        delta: δ.
    """

    nodes: FloatArray
    values: FloatArray
    tails: tuple[float, float] | None
    delta: float


@dataclass(frozen=True)
class Known:
    """What is known of a trial on all cells, and where u may be held.

    Attributes:
        nodes: ends of the cells.
        bounds: on them.
        middle: the node where W is 0.
        held: by the number of a node, on the left and on the right; None where u serves on the whole support.
    """

    nodes: FloatArray
    bounds: Bounds
    middle: int
    held: tuple[dict[int, HeldBounds], dict[int, HeldBounds]] | None


def search(trial: Trial, phases: int) -> tuple[Found | None, Found | None]:
    """The least δ of the upper and of the lower bound, to 1 %, each None where there is none."""
    nodes, bounder = nodes_for(trial), Bounder(trial, phases)
    bounds = bounder.bounds(nodes[:-1], nodes[1:])
    if not np.any(bounds.is_positive):
        return None, None
    inward = np.maximum(np.abs(bounds.inward[0]), np.abs(bounds.inward[1]))
    middle = int(np.argmin(np.where(bounds.is_positive, inward, np.inf)))
    held = _held(trial, bounder, nodes, bounds, middle) if isinstance(trial.basis, Core) else None
    known = Known(nodes, bounds, middle, held)
    return _least(trial, known, UPPER), _least(trial, known, LOWER)


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


def _held(
    trial: Trial, bounder: Bounder, nodes: FloatArray, bounds: Bounds, middle: int
) -> tuple[dict[int, HeldBounds], dict[int, HeldBounds]]:
    """Some nodes on either side, far enough out and with u > 0 up to there."""
    bad = np.flatnonzero(~bounds.is_positive)
    first = bad[bad < middle].max(initial=-1) + 1
    last = bad[bad >= middle].min(initial=len(nodes) - 1)
    far = np.abs(nodes - trial.basis.centre) > HELD_FROM * trial.basis.scale  # type: ignore[attr-defined]
    inside = np.flatnonzero(far & (np.arange(len(nodes)) >= first) & (np.arange(len(nodes)) <= last))
    found = []
    for sign, chosen in ((-1, inside[inside < middle]), (1, inside[inside > middle])):
        picked = np.unique(chosen[np.linspace(0, len(chosen) - 1, CANDIDATES).astype(int)]) if len(chosen) else chosen
        held = bounder.held(nodes[picked], sign) if len(picked) else []
        found.append(dict(zip(picked.tolist(), held, strict=True)))
    return found[0], found[1]


def _least(trial: Trial, known: Known, sense: int) -> Found | None:
    """The least δ of one bound."""
    noise = trial.noise
    rates = Rates(above(noise.nu), below(noise.nu), sense, trial.p is not None)
    sides = _sides(trial, known, sense)
    excess = known.bounds.above(sense)
    high = max(float(np.min(excess)), 1e-18)
    while not _both(sides, rates, high):
        high *= 10
        if not high < 1e6:
            return None
    low = high / 10
    while high > 1.01 * low:
        between = math.sqrt(low * high)
        if _both(sides, rates, between):
            high = between
        else:
            low = between
    both = _both(sides, rates, high)
    return None if both is None else _joined(sides, *both, high)


def _sides(trial: Trial, known: Known, sense: int) -> tuple[Side, Side]:
    """The left, mirrored, and the right."""
    middle, nodes = known.middle, known.nodes
    excess = known.bounds.above(sense)
    excess = excess + SLACK * np.abs(excess)
    beta = trial.basis.gauge if trial.p is not None else 0.0
    low, high = known.bounds.inward
    ends = (None, None) if known.held is None else [{j: h.end(sense) for j, h in side.items()} for side in known.held]
    left = None if ends[0] is None else {middle - j: end for j, end in ends[0].items()}
    right = None if ends[1] is None else {j - middle: end for j, end in ends[1].items()}
    return (
        Side(-nodes[middle::-1], excess[:middle][::-1], _cautious(-high[:middle][::-1]), -beta, left),
        Side(nodes[middle:], excess[middle:], _cautious(low[middle:]), beta, right),
    )


def _cautious(inward: FloatArray) -> FloatArray:
    return inward - SLACK * 1e-3 * (1 + np.abs(inward))


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
