"""Whether a bound follows from a certificate.

**Theorem.** Let T > 0 be continuous on the cylinder but for T(φ⁻) = R^p T(φ⁺) at impacts, once differentiable in φ
between them, twice in ξ but for kinks, and let λ₋ T ≤ L(p) T ≤ λ₊ T.

*Upper bound.* Let T ≥ c > 0 and its kinks in ξ be concave. By Itô's and Tanaka's formulas M = e^{−λ₊ t} ‖x‖^p T(φ, ξ)
is a local supermartingale: at impacts ‖x‖^p gains R^p and T loses it, between them the drift of M is
e^{−λ₊ t} ‖x‖^p (L(p) T − λ₊ T) ≤ 0, and kinks add local times with a sign ≤ 0. As M ≥ 0, E M(t) ≤ M(0), so that
E‖x(t)‖^p ≤ e^{λ₊ t} M(0)/c and Λ(p) ≤ λ₊.

*Lower bound.* Let T ≤ C and its kinks be convex. M = e^{−λ₋ t} ‖x‖^p T is a local submartingale; on [0, t] it is at
most C e^{|λ₋| t} sup‖x‖^p, whose mean is finite as d ln‖x‖/dt is at most linear in ξ, bounded or Gaussian. So
M(0) ≤ E M(t) ≤ C e^{−λ₋ t} E‖x(t)‖^p and Λ(p) ≥ λ₋.

*Ends of bounded noise*, |ξ| → half_width. The distance X from an end is, up to its scale and to bounded drifts, a
Bessel process of dimension 1 + a, a = 1/(1 − r₀) > 0. For r₀ ≥ 0 the ends are not reached and nothing is asked there.
For r₀ < 0 they are; as 1 + a > 1, X = X(0) + W(t) + (a/2) ∫ dt/X with a finite integral, so that Itô's formula has no
term at the end for T that is twice differentiable up to it (D. Revuz, M. Yor, Continuous martingales and Brownian
motion, chapter XI). LT may tend to −∞ there for the upper bound, to +∞ for the lower one, as b T_z does.

*The Lyapunov exponent.* Let f(φ⁻) = f(φ⁺) + ln R at impacts, |f| ≤ C (1 + |ξ|), f_ξ be bounded, and let
λ₋ ≤ q + L(0) f with convex kinks, q + L(0) f ≤ λ₊ with concave ones. Then ln‖x‖ + f − ∫ (q + L(0) f) dt less the local
times is a martingale whose bracket is at most C t, hence o(t), and so is f: λ₋ ≤ λ ≤ λ₊ for almost every path.

What is verified are the inequalities of `factor`, from which those of the theorem follow for T = R^{ps} e^{βz ± ψ} u.
Coefficients are in balls; floats are rounded outward.
"""

from __future__ import annotations

from dataclasses import asdict
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.proofs.balls import ball, in_balls
from fpsolve.proofs.bounds import Bounder, Bounds, Trial
from fpsolve.proofs.certificate import MOMENT, Certificate
from fpsolve.proofs.factor import End
from fpsolve.proofs.statement import Cylinder, cylinder

if TYPE_CHECKING:
    from flint import arb


@in_balls
def objection(certificate: Certificate) -> str:
    """Why Λ(p), or λ, need not be within delta of mu; empty where it is proven."""
    if certificate.p is not None and Fraction(certificate.p) == 0:  # Λ(0) = 0, as T = 1
        return "" if abs(certificate.mu) <= certificate.delta else "Λ(0) = 0"
    trial = trial_of(certificate)
    misplaced = _misplaced(certificate, trial.noise)
    if misplaced:
        return misplaced
    bounder = Bounder(trial, certificate.phases)
    nodes = np.array(certificate.nodes)
    found = bounder.bounds(nodes[:-1], nodes[1:])
    if not np.all(np.isfinite(found.mismatch)):
        return f"u > 0 is not certain near z = {nodes[np.argmax(~np.isfinite(found.mismatch))]:.6g}"
    for j in range(len(nodes) - 1):
        if not _holds(certificate, trial.noise, found, j):
            return f"the mismatch of {found.mismatch[j]:.3g} near z = {nodes[j]:.6g} is not made up for"
    return _objection_at_ends(certificate, trial, bounder)


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


def _holds(certificate: Certificate, noise: Cylinder, found: Bounds, j: int) -> bool:
    """(*) of `factor` on a cell: its right side is concave in W of one sign, so that it is least at an end or at 0."""
    (left, right), values = map(ball, certificate.nodes[j : j + 2]), certificate.values[j : j + 2]
    room = (ball(certificate.delta) - ball(float(found.mismatch[j]))) / noise.nu
    growth = (ball(values[1]) - ball(values[0])) / (2 * (right - left))
    ends = [*values, 0.0] if values[0] * values[1] < 0 else values
    return all(growth <= room + _pull(certificate, value, found, j) for value in ends)


def _pull(certificate: Certificate, value: float, found: Bounds, j: int) -> arb:
    """Below W B − ½ W² on a cell."""
    if value == 0:
        return ball(0)
    inward = found.inward_low[j] if value > 0 else found.inward_high[j]
    square = ball(value) * ball(value) / 2 if certificate.quantity == MOMENT else ball(0)
    return ball(value) * ball(float(inward)) - square


def _misplaced(certificate: Certificate, noise: Cylinder) -> str:
    """Why the cells and the gauge are not what the theorem asks for."""
    first, last = certificate.nodes[0], certificate.nodes[-1]
    if certificate.tails is None:
        return "" if (first, last) == (-1.0, 1.0) else "the cells do not cover the support"
    if noise.is_bounded and not -1 < first <= 0 <= last < 1:
        return "the core must hold 0, and not reach the ends of the support"
    if certificate.quantity != MOMENT and certificate.basis.gauge != 0:
        return "the drift has no gauge"
    return ""


def _objection_at_ends(certificate: Certificate, trial: Trial, bounder: Bounder) -> str:
    """Where u is held, and beyond."""
    nodes = certificate.nodes
    if certificate.tails is None:
        return ""
    for sign, j in ((-1, 0), (1, -1)):
        (end,) = bounder.ends(np.array([nodes[j]]), sign)
        held = (sign * certificate.basis.gauge, sign * certificate.values[j], sign * certificate.tails[j])
        if not _holds_beyond(certificate, trial.noise, end, *map(ball, held)):
            return f"the trial function does not serve beyond z = {nodes[j]:.6g}"
    return ""


def _holds_beyond(certificate: Certificate, noise: Cylinder, end: End, beta: arb, value: arb, kappa: arb) -> bool:
    """Whether u may be held at the right end, mirrored onto it if it is the left one."""
    slope, mismatch, growth, drift, bend = map(ball, asdict(end).values())
    square = kappa * kappa / 2 if certificate.quantity == MOMENT else 0
    return bool(
        value - kappa >= slope
        and kappa >= abs(beta)
        and noise.nu * bend * kappa >= growth
        and (ball(certificate.delta) - mismatch) / noise.nu + kappa * (drift - beta) - square >= 0
    )
