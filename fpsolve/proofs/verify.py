"""Whether a bound follows from a certificate.

**Theorem.** Let T > 0 be continuous on the cylinder but for T(φ⁻) = R^p T(φ⁺) at impacts, once differentiable in φ
between them, twice in ξ but for finitely many ξ, where T_ξ is continuous, or jumps by a smooth function of φ (a kink),
and let λ₋ T ≤ L(p) T ≤ λ₊ T elsewhere. The ξ that are left out take no time.

*Upper bound.* Let T ≥ c > 0 and its kinks in ξ be concave. By Itô's and Tanaka's formulas M = e^{−λ₊ t} ‖x‖^p T(φ, ξ)
is a local supermartingale: at impacts ‖x‖^p gains R^p and T loses it, between them the drift of M is
e^{−λ₊ t} ‖x‖^p (L(p) T − λ₊ T) ≤ 0, and kinks add local times with a sign ≤ 0. As M ≥ 0, E M(t) ≤ M(0), which
is finite for every start, so that E‖x(t)‖^p ≤ e^{λ₊ t} M(0)/c and Λ(p) ≤ λ₊.

*Lower bound.* Let T ≤ C and its kinks be convex. M = e^{−λ₋ t} ‖x‖^p T is a local submartingale; on [0, t] it is at
most C e^{|λ₋| t} sup‖x‖^p, whose mean is finite as d ln‖x‖/dt and dφ/dt, and with it the number of impacts in [0, t],
are at most linear in ξ, bounded or Gaussian. So M(0) ≤ E M(t) ≤ C e^{−λ₋ t} E‖x(t)‖^p and Λ(p) ≥ λ₋.

*Ends of bounded noise*, |ξ| → half_width. The distance X from an end is, up to its scale and to bounded drifts, a
Bessel process of dimension 1 + a, a = 1/(1 − r₀) > 0. For r₀ ≥ 0 the ends are not reached and nothing is asked there.
For r₀ < 0 they are; as 1 + a > 1, X = X(0) + W(t) + (a/2) ∫ dt/X with a finite integral, so that Itô's formula has no
term at the end for T that is twice differentiable up to it (D. Revuz, M. Yor, Continuous martingales and Brownian
motion, chapter XI). LT may tend to −∞ there for the upper bound, to +∞ for the lower one, as b T_z does.

*The Lyapunov exponent.* Let f(φ⁻) = f(φ⁺) + ln R at impacts, |f| ≤ C (1 + |ξ|), f_ξ be bounded, and let
λ₋ ≤ q + L(0) f with convex kinks, q + L(0) f ≤ λ₊ with concave ones. Then ln‖x‖ + f − ∫ (q + L(0) f) dt less the local
times is a martingale whose bracket is at most C t, hence o(t), and so is f: λ₋ ≤ λ ≤ λ₊ for almost every path.

What is verified are the inequalities of `factor`, from which those of the theorem follow for T = R^{ps} e^{βz ± ψ} u,
the upper and the lower bound each with a ψ of its own.
Coefficients are in balls; floats are rounded outward.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.proofs.balls import ball, in_balls
from fpsolve.proofs.bounds import Bounder, Bounds, Trial
from fpsolve.proofs.certificate import MOMENT, Certificate, SideRecord
from fpsolve.proofs.factor import LOWER, UPPER, End
from fpsolve.proofs.statement import Cylinder, cylinder

if TYPE_CHECKING:
    from flint import arb


@in_balls
def objection(certificate: Certificate) -> str:
    """Why the bounds of a certificate need not hold; empty where they are proven."""
    sides = [(q, side) for q, side in ((UPPER, certificate.upper), (LOWER, certificate.lower)) if side is not None]
    if certificate.p is not None and Fraction(certificate.p) == 0:  # Λ(0) = 0, as T = 1
        return "" if all(q * Fraction(certificate.mu) + Fraction(side.delta) >= 0 for q, side in sides) else "Λ(0) = 0"
    trial = trial_of(certificate)
    for _, side in sides:
        misplaced = _misplaced(certificate, trial.noise, side)
        if misplaced:
            return misplaced
    bounder = Bounder(trial, certificate.phases)
    cells = sorted({cell for _, side in sides for cell in pairwise(side.nodes)})
    low, high = np.array(cells).T
    found, places = bounder.bounds(low, high), {cell: j for j, cell in enumerate(cells)}
    if not np.all(found.is_positive):
        return f"u > 0 is not certain near z = {low[np.argmin(found.is_positive)]:.6g}"
    return "".join(_objection(certificate, bounder, q, side, found, places) for q, side in sides)


def trial_of(certificate: Certificate) -> Trial:
    """The trial function of a certificate."""
    return Trial(
        noise=cylinder(certificate.parameters),
        p=None if certificate.p is None else ball(certificate.p),
        mu=certificate.mu,
        basis=certificate.basis.basis,
        cosine=np.array(certificate.cosine),
        sine=np.array(certificate.sine),
    )


def _misplaced(certificate: Certificate, noise: Cylinder, side: SideRecord) -> str:
    """Why the cells and the gauge are not what the theorem asks for."""
    first, last = side.nodes[0], side.nodes[-1]
    if side.tails is None:
        if (first, last) != (-1.0, 1.0):
            return "the cells do not cover the support"
        return "" if side.values[0] <= 0 <= side.values[-1] else "W points outward at an end of the support"
    if noise.is_bounded and not -1 < first <= 0 <= last < 1:
        return "the core must hold 0, and not reach the ends of the support"
    if certificate.quantity != MOMENT and certificate.basis.gauge != 0:
        return "the drift has no gauge"
    return ""


def _objection(
    certificate: Certificate, bounder: Bounder, q: int, side: SideRecord, found: Bounds, places: Mapping[Any, int]
) -> str:
    """Why one of the bounds need not hold."""
    noise, square = bounder.trial.noise, q if certificate.quantity == MOMENT else 0
    excess, name = found.above(q), "upper" if q > 0 else "lower"
    for cell, values in zip(pairwise(side.nodes), pairwise(side.values), strict=True):
        j = places[cell]
        left, right, start, stop = map(ball, (*cell, *values))
        room = (ball(side.delta) - ball(float(excess[j]))) / noise.nu
        inward = (float(found.inward[0][j]), float(found.inward[1][j]))
        if not all((stop - start) / (2 * (right - left)) <= room + pull for pull in _pulls(values, inward, square)):
            return f"{name} bound: the mismatch near z = {cell[0]:.6g} is not made up for; "
    for sign, j in ((-1, 0), (1, -1)):
        if side.tails is None:
            break
        (held,) = bounder.held(np.array([side.nodes[j]]), sign)
        tail = (sign * certificate.basis.gauge, sign * side.values[j], sign * side.tails[j], side.delta)
        if not _holds_beyond(noise, held.end(q), q, square, *map(ball, tail)):
            return f"{name} bound: the trial function does not serve beyond z = {side.nodes[j]:.6g}; "
    return ""


def _pulls(values: tuple[float, float], inward: tuple[float, float], square: int) -> Iterator[arb]:
    """Numbers of which one is below W B − ½ q W² for all W between two values and B between two others.

    For W of one sign it is least where W B is, at one end of B; then at an end of W, or for q = −1 at W = −B.
    """
    places = [*values, 0.0] if values[0] * values[1] < 0 else list(values)
    for value in places:
        yield _pull(value, inward[0] if value > 0 else inward[1], square)
    for bound in inward if square < 0 else ():
        if min(values) < -bound < max(values):
            yield _pull(-bound, bound, square)


def _pull(value: float, inward: float, square: int) -> arb:
    """W B − ½ q W²."""
    w = ball(value)
    return w if value == 0 else w * ball(inward) - square * (w * w) / 2


def _holds_beyond(
    noise: Cylinder, end: End, q: int, square: int, beta: arb, value: arb, kappa: arb, delta: arb
) -> bool:
    """Whether u may be held at the right end, mirrored onto it if it is the left one."""
    drop, mismatch, growth, drift, slope = map(ball, asdict(end).values())
    return bool(
        kappa <= value - drop
        and kappa >= -q * beta
        and kappa >= 0  # as b and b′ are bounded from below
        and noise.nu * slope * kappa >= growth
        and (delta - mismatch) / noise.nu + kappa * (drift - beta) - square * (kappa * kappa) / 2 >= 0
    )
