"""From the largest mismatch to the mean one: the factor e^{±ψ(z)} of the trial function, W = ψ′.

Let u > 0, z be noise and β the gauge of u. The upper bound has q = 1 and T = e^{ψ}u, the lower one q = −1 and
T = e^{−ψ}u, each with a ψ of its own. With e = q (Lu/u − μ) and B = b(z) − β − u_z/u

    q (LT/T − μ) = e + ν (½ W′ + ½ q W² − W B),

so that LT ≤ (μ + δ) T, or LT ≥ (μ − δ) T, as soon as

    ½ W′ ≤ (δ − e)/ν + W B − ½ q W².                                                                            (*)

Outward from W = 0 where the noise mostly is, W may grow like e^{z²/2}, so that δ need hardly exceed the mean of e under
the law of the noise in the moment, and is far below its maximum. Where W jumps downward, ψ has a concave kink and −ψ a
convex one, which only helps: the local time at the kink enters with the sign of the inequality (Itô-Tanaka).

Where u serves only between two ends, it is held there: T = e^{βz ± ψ} u(φ, end) beyond. At the right end the slope of
ln T loses r = u_z/u, so that its kink is concave for q = 1 if W drops by max(−r) at least, and convex for q = −1 if W
drops by max r at least. Beyond, W is a constant κ ≥ max(0, −qβ), which keeps T from 0 for q = 1 and bounded for
q = −1, with

    0 ≤ (δ − q n)/ν + κ (b − β) − ½ q κ²,      n(φ, z) = (F₀ + z F₁ + ½ νβ² − νβ b(z) − μ) u/u,

which holds beyond an end if it holds there and νκ b′ ≥ max(q n_z) there: b′ does not decrease, for bounded noise with
z ≥ 0, and with it the slope of the right side grows by (κ + qβ) Δb′ ≥ 0. The left end is mirrored onto the right one,
z → −z, β → −β, W → −W.

The drift of ln‖x‖ + f ± ψ is bounded in the same way, with e = q (its drift − μ), without W² and with B = b, β = 0 and
r = f_z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray

UPPER, LOWER = 1, -1
"""q."""
MOST = 1e6
"""More than W needs to be anywhere; for q = −1 it would grow beyond all bounds."""


@dataclass(frozen=True)
class End:
    """What is known where u is held at the right end, or mirrored onto it.

    Attributes:
        drop: above what W must drop by.
        mismatch: above q n at the end.
        growth: above q n_z there.
        drift, slope: below b and b′.
    """

    drop: float
    mismatch: float
    growth: float
    drift: float
    slope: float


@dataclass(frozen=True)
class Side:
    """Cells from the middle outward, on the right; the left is mirrored onto it.

    Attributes:
        nodes: z at the ends of cells, increasing from the middle on; one more than cells.
        mismatch: above e on each cell.
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
    """ν, and which bound is sought.

    Attributes:
        nu_above, nu_below: floats beside ν.
        sense: q.
        is_moment: whether W² counts: for the drift of ln‖x‖ it does not.
    """

    nu_above: float
    nu_below: float
    sense: int
    is_moment: bool

    @property
    def square(self) -> int:
        """q in front of W², or 0."""
        return self.sense if self.is_moment else 0

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
        value = _step(values[-1], width, rates.over_nu(delta - side.mismatch[j]), inward, rates.square)
        if value is None:
            return None
        values.append(value)
        end = None if side.ends is None else side.ends.get(j + 1)
        if end is not None:
            tail = _tail(side, rates, delta, j + 1, value, end)
            if tail is not None:
                return Factor(np.array(values), tail)
    return Factor(np.array(values), None) if side.ends is None else None


def _step(value: float, width: float, room: float, inward: float, q: int) -> float | None:
    """W at the end of a cell from W at its beginning, so that (*) holds at both and between.

    For q = −1 its right side is convex; where that matters, −½ q W² ≥ 0 is left out.
    """
    if not math.isfinite(room):
        return None
    found = value + 2 * width * (room + _pull(value, inward, q))
    if q < 0 and (inward < 0 or found < value):
        q = 0
        found = value + 2 * width * (room + value * inward)
    if _pull(found, inward, q) < _pull(value, inward, q):
        linear, rest = 1 - 2 * width * inward, value + 2 * width * room
        square = linear**2 + 4 * width * q * rest
        if rest < 0 or square < 0 or (linear <= 0 and not q):
            return None
        found = min(found, 2 * rest / (linear + math.sqrt(square)))
    if found < 0 or not math.isfinite(found):
        return None
    growth = found - value
    safe = value + growth * (1 - 1e-12 if growth > 0 else 1 + 1e-12)
    return min(safe, MOST)


def _pull(value: float, inward: float, q: int) -> float:
    """W B − ½ q W²."""
    return value * inward - q * value**2 / 2


def _tail(side: Side, rates: Rates, delta: float, j: int, value: float, end: End) -> float | None:
    """κ beyond a node, if there is one."""
    pull, most = end.drift - side.beta, (value - end.drop) * (1 - 1e-12)
    least = max(-rates.sense * side.beta, max(end.growth, 0.0) / (rates.nu_below * end.slope)) * (1 + 1e-12)
    kappa = min(most, max(pull, least)) if rates.square > 0 else most
    if kappa < least or pull <= 0 or side.nodes[j] < 0:
        return None
    room = rates.over_nu(delta - end.mismatch) * (1 - 1e-12 if delta > end.mismatch else 1 + 1e-12)
    return kappa if room + (1 - 1e-12) * _pull(kappa, pull, rates.square) > 0 else None
