"""Bounds of the probability of excursions that follow from a certificate.

**Theorem.** Let T be as in `verify`, between two positive numbers, p > 0 and ‖x(0)‖ = 1. If L(p) T ≤ 0 then, for every
A > 1,

    P(sup ‖x‖ ≥ A) ≤ c A^−p,    c ≥ T(start)/min T.

If L(p) T ≥ 0, λ < 0 and no jump is upwards, then P(sup ‖x‖ ≥ A) ≥ c A^−p, c ≤ T(start)/max T.

*Proof.* M = ‖x‖^p T is a supermartingale, or a submartingale, as in `verify` with λ± = 0. With τ the time at which ‖x‖
first reaches A, M(0) ≥ E M(min(t, τ)) ≥ A^p min T P(τ ≤ t) for every t. And as ‖x‖ = A at τ,
M(0) ≤ E M(min(t, τ)) ≤ A^p max T P(τ ≤ t) + E[M(t); τ > t]. In the last term M ≤ A^p max T tends to 0, since almost
every path decays.

It is used for T = R^{ps} u alone, W = 0 and β = 0. T(start) is its largest, or least, value over the noise, so that the
bounds hold for every law of the noise at the start. ‖x‖ is the length of the vector of the variables of the system, and
x(0) = (1, 0, …). With x = P y, φ and T of y, the function for x is |P e(φ)|^−p T, e = (cos φ, −sin φ).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.proofs.balls import above, ball, below, precision
from fpsolve.proofs.bounds import UPPER, Bounder, Trial
from fpsolve.proofs.certificate import MOMENT, Certificate
from fpsolve.proofs.statement import Statement, cylinder, exact_halves

if TYPE_CHECKING:
    from flint import arb


@precision()
def excursion_factor(certificate: Certificate, sense: int) -> float:
    """c of the upper (1) or of the lower bound (−1), rounded outward; NaN where none follows.

    Whether the certificate proves its bounds, their signs and that of λ are not looked at.
    """
    side = certificate.upper if sense == UPPER else certificate.lower
    basis = certificate.basis.basis
    if certificate.quantity != MOMENT or side is None or basis.is_core or any(side.values):
        return math.nan
    around, p = Around(certificate.statement), ball(certificate.p or "nan")
    if not p > 0 or (sense != UPPER and around.may_rise) or not around.starts_between_rays:
        return math.nan
    cosine, sine = np.array(certificate.cosine), np.array(certificate.sine)
    trial = Trial(cylinder(certificate.statement), p, certificate.mu, basis, cosine, sine)
    cells = basis.cover(cosine.shape[1]) or tuple(np.array([*pairwise(side.nodes)]).T)
    bounder = Bounder(trial, certificate.phases)
    lows, highs = bounder.function(*cells)
    if not np.all(lows > 0):
        return math.nan
    [(start, weight)] = around.weights(p, around.start)
    low, high = bounder.function_at(around.turn, *cells)
    count = certificate.phases
    turn = start.pi() / (2 * count)
    pieces = [around.weights(p, turn * _interval(2 * i, 2 * i + 2)) for i in range(count)]
    ends = lows.min(1) if sense == UPPER else highs.max(1)
    values = [each * ball(u) for some, u in zip(pieces, ends.tolist(), strict=True) for _, each in some]
    if sense == UPPER:
        least = min(map(below, values))
        return above(weight * ball(float(high.max())) / ball(least)) if least > 0 else math.nan
    return max(below(weight * ball(float(low.min())) / ball(max(map(above, values)))), 0.0)


def _interval(low: int, high: int) -> arb:
    """A ball that holds both and all between."""
    return ball(low).union(ball(high))


class Around:
    """What T of a statement has besides u on its way around: R^{ps} |P e(φ)|^−p.

    Attributes:
        start: φ of P⁻¹(1, 0), from 0 to π.
        turn: e^{2iφ} there.
        may_rise: whether a jump may be upwards.
        starts_between_rays: whether no jump is at φ = start.
    """

    def __init__(self, stated: Statement) -> None:
        from flint import acb

        motion, _, directions = exact_halves(stated)
        (a, b), (c, d) = ((1.0, 0.0), (0.0, 1.0)) if stated.motion is None else stated.motion.coordinates
        self._change = [[ball(a), ball(b)], [ball(c), ball(d)]]
        sign = 1.0 if a * d - b * c > 0 else -1.0
        self._logs = [ball(jump.log_factor) + ball(jump.factor).log() for jump in motion.jumps]
        self._falls = [direction * log for direction, log in zip(directions, self._logs, strict=True)]
        self._rays = [_angle(ball(jump.ray[0]), ball(jump.ray[1])) for jump in motion.jumps]
        self._rise = sum(self._falls, ball(0)) / ball(0).pi()
        first = acb(ball(d), ball(c)) * ball(sign)  # y₁ − i y₂ of y ~ (d, −c)
        self.start, self.turn = _angle(first.real, -first.imag), (first / abs(first)) ** 2
        self.may_rise = not all(log <= 0 for log in self._logs)

    @property
    def starts_between_rays(self) -> bool:
        return not any(ray.overlaps(self.start) for ray in self._rays)

    def weights(self, p: arb, phi: arb) -> Sequence[tuple[arb, arb]]:
        """φ and R^{ps} |P e(φ)|^−p for all φ of a ball in [0, π], on each side of the rays in it."""
        sums = [ball(0)]
        for ray, fall in zip(self._rays, self._falls, strict=True):
            if phi > ray:
                sums = [each + fall for each in sums]
            elif not phi < ray:
                sums = [each + some for each in sums for some in (ball(0), fall)]
        e = (phi.cos(), -phi.sin())
        square = sum(((row[0] * e[0] + row[1] * e[1]) ** 2 for row in self._change), ball(0))
        return [(phi, (p * (self._rise * phi - each - square.log() / 2)).exp()) for each in sums]


def _angle(x: arb, y: arb) -> arb:
    """φ of (cos φ, −sin φ) along a direction, from 0 to π."""
    from flint import acb

    if y > 0 or (y == 0 and x < 0):
        x, y = -x, -y
    return acb(x, -y).arg()
