"""From the largest mismatch to the mean one: the factor e^{±ψ(z)} of the trial function, W = ψ′.

Let u > 0 and |Lu/u − μ| ≤ m(z) where z is noise and β the gauge of u. Then T = e^{ψ}u has

    LT/T = Lu/u + ν (½ W′ + ½ W² − W B),      B = b(z) − β − u_z/u,

so that LT ≤ (μ + δ) T, and with e^{−ψ} instead of e^{ψ} also LT ≥ (μ − δ) T, as soon as

    ½ W′ ≤ (δ − m)/ν + W B − ½ W².                                                                              (*)

Outward from W = 0 where the noise mostly is, W may grow like e^{z²/2}, so that δ need hardly exceed the mean of m under
the law of the noise in the moment, and is far below its maximum. Where W jumps downward, ψ has a concave kink and −ψ a
convex one, which only helps: the local time at the kink enters with the sign of the inequality (Itô-Tanaka).

Where u serves only between two ends, it is held there: T = e^{βz ± ψ} u(φ, end) beyond. Its slope jumps by −u_z/u at
the right end, so that W must drop by max|u_z/u| at least; beyond, W is a constant κ ≥ |β| (mirrored on the left), with

    0 ≤ (δ − |n|)/ν + κ (b − β) − ½ κ²,      n(φ, z) = (F₀ + z F₁ + ½ νβ² − νβ b(z) − μ) u/u,

which holds beyond an end z ≥ 0 if it holds there and νκ b′ ≥ max|n_z| there: b′ increases with z > 0, where both sides
grow by νκ Δb′ and by ν|β| Δb′ at most.

The drift of ln‖x‖ + f + ψ is bounded in the same way, without W² and with B = b: ½ W′ ≤ (δ − m)/ν + W b.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray


@dataclass(frozen=True)
class End:
    """What is known where u is held, by absolute values.

    Attributes:
        slope: above max|u_z/u|, or |f_z|.
        mismatch: above max|n| at the end.
        growth: above max|n_z|.
        drift, bend: below b and b′, of the right end or mirrored onto it.
    """

    slope: float
    mismatch: float
    growth: float
    drift: float
    bend: float


@dataclass(frozen=True)
class Side:
    """Cells from the middle outward, on the right; the left is mirrored onto it.

    Attributes:
        nodes: z at the ends of cells, increasing from the middle on; one more than cells.
        mismatch: m, above |Lu/u − μ| on each cell.
        inward: below B on each cell.
        beta: β.
        ends: what is known at the nodes where u may be held; None where u serves to the end of the support.
    """

    nodes: FloatArray
    mismatch: FloatArray
    inward: FloatArray
    beta: float
    ends: dict[int, End] | None


@dataclass(frozen=True)
class Rates:
    """ν, and whether W² counts: for moments it does, for the drift of ln‖x‖ not.

    Attributes:
        nu_above, nu_below: floats beside ν.
    """

    nu_above: float
    nu_below: float
    is_moment: bool

    def over_nu(self, amount: float) -> float:
        """Below amount/ν."""
        return amount / (self.nu_above if amount > 0 else self.nu_below)


@dataclass(frozen=True)
class Factor:
    """W ≥ 0 at nodes from the middle outward, linear between them, and the constant κ beyond, if there is a beyond."""

    values: FloatArray
    tail: float | None


def march(side: Side, rates: Rates, delta: float) -> Factor | None:
    """The largest W from 0 on that (*) allows, to where the tail is safe; None where there is none for this δ."""
    values = [0.0]
    for j, inward in enumerate(side.inward):
        width = side.nodes[j + 1] - side.nodes[j]
        room = rates.over_nu(delta - side.mismatch[j])
        value = _step(values[-1], width, room, inward, rates.is_moment)
        if value is None:
            return None
        values.append(value)
        end = None if side.ends is None else side.ends.get(j + 1)
        if end is not None:
            tail = _tail(side, rates, delta, j + 1, value, end)
            if tail is not None:
                return Factor(np.array(values), tail)
    return Factor(np.array(values), None) if side.ends is None else None


def _step(value: float, width: float, room: float, inward: float, is_moment: bool) -> float | None:
    """W at the end of a cell from W at its beginning; (*) then holds at both, and between, as its right is concave."""
    if not math.isfinite(room):
        return None
    q, safe = (1.0 if is_moment else 0.0), 1 - 1e-12
    found = value + 2 * width * (room + value * inward - q * value**2 / 2)
    if found * inward - q * found**2 / 2 < value * inward - q * value**2 / 2:
        linear, rest = 1 - 2 * width * inward, value + 2 * width * room
        square = linear**2 + 4 * width * q * rest
        if rest < 0 or square < 0:
            return None
        found = 2 * rest / (linear + math.sqrt(square)) if linear > 0 or q else math.inf
        found = min(found, value + 2 * width * (room + value * inward - q * value**2 / 2))
    if found < 0 or not math.isfinite(found):
        return None
    growth = found - value
    return min(value + (growth * safe if growth > 0 else growth * (2 - safe)), max(inward, value) if q else math.inf)


def _tail(side: Side, rates: Rates, delta: float, j: int, value: float, end: End) -> float | None:
    """κ beyond a node, if there is one."""
    q, pull = (1.0 if rates.is_moment else 0.0), end.drift - side.beta
    most = (value - end.slope) * (1 - 1e-12)
    least = max(abs(side.beta), end.growth / (rates.nu_below * end.bend)) * (1 + 1e-12)
    kappa = min(most, max(pull, least)) if q else most
    if kappa < least or pull <= 0 or side.nodes[j] < 0:
        return None
    holds = rates.over_nu(delta - end.mismatch) * (1 + 1e-12) + kappa * pull - q * kappa**2 / 2 > 0
    return kappa if holds else None
