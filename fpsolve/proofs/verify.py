"""Whether a bound follows from a certificate.

**Theorem.** Let T > 0 be continuous on the cylinder but at rays, where T before a jump is R^p T after it, so that
T(φ⁻) = R^p T(φ⁺) where the phase passes forward and T(φ⁺) = R^p T(φ⁻) where backward, once differentiable in φ
elsewhere, twice in ξ but for finitely many ξ, where T_ξ is continuous, or jumps by a smooth function of φ (a kink),
and let λ₋ T ≤ L(p) T ≤ λ₊ T elsewhere. The ξ that are left out take no time.

Λ(p) = lim ln E‖x(t)‖^p/t, and the bounds hold for every start x(0) ≠ 0, of the upper and of the lower limit. Where the
phase never leaves a ray, and Λ(p) depends on the start, they hold for each of its values: close bounds show that there
is one. Other coordinates P⁻¹x have the same Λ(p) and λ, as ‖P⁻¹x‖/‖x‖ is between two positive numbers; rays, and the
way in which they are passed, are those of P⁻¹x.

*Upper bound.* Let T ≥ c > 0 and its kinks in ξ be concave. By Itô's and Tanaka's formulas M = e^{−λ₊ t} ‖x‖^p T(φ, ξ)
is a local supermartingale: at impacts ‖x‖^p gains R^p and T loses it, between them the drift of M is
e^{−λ₊ t} ‖x‖^p (L(p) T − λ₊ T) ≤ 0, and kinks add local times with a sign ≤ 0. As M ≥ 0, E M(t) ≤ M(0), which
is finite for every start, so that E‖x(t)‖^p ≤ e^{λ₊ t} M(0)/c and Λ(p) ≤ λ₊.

*Lower bound.* Let T ≤ C and its kinks be convex. M = e^{−λ₋ t} ‖x‖^p T is a local submartingale; on [0, t] it is at
most C e^{|λ₋| t} sup‖x‖^p, whose mean is finite: d ln‖x‖/dt and dφ/dt are at most linear in ξ, and so is the number
of impacts in [0, t] in sup|ξ|, as no ray is passed back; and sup|ξ| is bounded or has Gaussian tails. So
M(0) ≤ E M(t) ≤ C e^{−λ₋ t} E‖x(t)‖^p and Λ(p) ≥ λ₋.

*Ends of bounded noise*, |ξ| → half_width. The distance X from an end is, up to its scale and to bounded drifts, a
Bessel process of dimension 1 + a, a = 1/(1 − r₀) > 0. For r₀ ≥ 0 the ends are not reached and nothing is asked there.
For r₀ < 0 they are; as 1 + a > 1, X = X(0) + W(t) + (a/2) ∫ dt/X with a finite integral, so that Itô's formula has no
term at the end for T that is twice differentiable up to it (D. Revuz, M. Yor, Continuous martingales and Brownian
motion, chapter XI). LT may tend to −∞ there for the upper bound, to +∞ for the lower one, as b T_z does.

*The Lyapunov exponent.* Let f before a jump be f after it and ln R, |f| ≤ C (1 + |ξ|), f_ξ be bounded, and let
λ₋ ≤ q + L(0) f with convex kinks, q + L(0) f ≤ λ₊ with concave ones. Then ln‖x‖ + f − ∫ (q + L(0) f) dt less the local
times is a martingale whose bracket is at most C t, hence o(t), and so is f: λ₋ ≤ λ ≤ λ₊ for almost every path.

*What is verified* are inequalities from which those of the theorem follow for T = R^{ps} e^{βz ± ψ} u. Let u > 0, z be
noise, β the gauge of u and W = ψ′. The upper bound has q = 1 and T = e^{ψ}u, the lower one q = −1 and T = e^{−ψ}u, each
with a ψ of its own. With e = q (Lu/u − μ) and B = b(z) − β − u_z/u

    q (LT/T − μ) = e + ν (½ W′ + ½ q W² − W B),

so that LT ≤ (μ + δ) T, or LT ≥ (μ − δ) T, as soon as

    ½ W′ ≤ (δ − e)/ν + W B − ½ q W².                                                                            (*)

Outward from W = 0 where the noise mostly is, W may grow like e^{z²/2}, so that δ need hardly exceed the mean of e under
the law of the noise in the moment, and is far below its maximum. Where W jumps downward, ψ has a concave kink and −ψ a
convex one, which only helps: the local time at the kink enters with the sign of the inequality (Itô-Tanaka).

Where u serves only between two ends, T is frozen there: T = e^{βz ± ψ} u(φ, end) beyond. At the right end the slope of
ln T loses r = u_z/u, so that its kink is concave for q = 1 if W drops by max(−r) at least, and convex for q = −1 if W
drops by max r at least. Beyond, W is a constant κ ≥ max(0, −qβ), which keeps T from 0 for q = 1 and bounded for
q = −1, with

    0 ≤ (δ − q n)/ν + κ (b − β) − ½ q κ²,      n(φ, z) = (F₀ + z F₁ + ½ νβ² − νβ b(z) − μ) u/u,

which holds beyond an end if it holds there and νκ b′ ≥ max(q n_z) there: b′ does not decrease, for bounded noise with
z ≥ 0, and with it the slope of the right side grows by (κ + qβ) Δb′ ≥ 0. The left end is mirrored onto the right one,
z → −z, β → −β, W → −W.

*Other noise* has T = R^{ps} u without ψ, and Lu ≤ (μ + δ) u, Lu ≥ (μ − δ) u are verified, or the same of the drift of
ln‖x‖ + f. For z = cos θ, dθ = √ν dW, T is an even function of θ, so that the theorem holds with θ in the place of ξ.
For a chain T has a component for each state, the noise's part of LT is its matrix of rates, and Dynkin's formula stands
in the place of Itô's.

*White noise* has L = F₀ + ½ F₁², and T is one function of the phase. Every ray has h₁ = 0 and h₀ ≠ 0. Let v and w be
the coordinates of x across and along it: A₁ leaves it alone, so that dv = (av + bw) dt + cv ∘ dW with b ≠ 0. With
dE = E (a dt + c ∘ dW), v/E has the derivative bw/E: wherever v = 0, v/w changes its sign in the same sense, that of h₀.
So the phase passes each ray one way, finitely often in [0, t], and never back. With Φ the phase that counts its turns
and X the size of x without jumps, ‖x‖^p T is X^p e^{pκΦ} u(Φ) but for a constant factor, to which Itô's formula
applies. As dΦ has bounded coefficients, n jumps in [0, t] have a probability below C e^{−cn²}, and sup‖x‖^p has a
finite mean.

The drift of ln‖x‖ + f ± ψ is bounded in the same way, with e = q (its drift − μ), without W² and with B = b, β = 0 and
r = f_z.

Coefficients are in balls; floats are rounded outward.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fpsolve.proofs.balls import ball, precision
from fpsolve.proofs.bounds import LOWER, UPPER, Bounder, Bounds, Trial
from fpsolve.proofs.certificate import Certificate, SideRecord
from fpsolve.proofs.forms import FormCertificate
from fpsolve.proofs.statement import Cylinder, cylinder


@precision()
def objection(certificate: Certificate | FormCertificate) -> str:
    """Why the bounds of a certificate need not hold; empty where they are proven."""
    if isinstance(certificate, FormCertificate):
        return certificate.objection()
    sides = [(q, side) for q, side in ((UPPER, certificate.upper), (LOWER, certificate.lower)) if side is not None]
    if certificate.p == 0:  # Λ(0) = 0, as T = 1
        return "" if all(q * certificate.mu >= -side.delta for q, side in sides) else "Λ(0) = 0"
    trial = Trial(
        noise=cylinder(certificate.stated),
        p=None if certificate.p is None else ball(certificate.p),
        mu=certificate.mu,
        basis=certificate.basis.basis,
        cosine=np.array(certificate.cosine),
        sine=np.array(certificate.sine),
    )
    bounder = Bounder(trial, certificate.phases)
    if (covered := trial.basis.cover(len(certificate.cosine[0]))) is not None:
        return _plain_objection(bounder.bounds(*covered), certificate)
    for _, side in sides:
        misplaced = _misplaced(certificate, trial.noise, side)
        if misplaced:
            return misplaced
    cells = sorted({cell for _, side in sides for cell in pairwise(side.nodes)})
    low, high = np.array(cells).T
    bounds, places = bounder.bounds(low, high), {cell: j for j, cell in enumerate(cells)}
    if not np.all(bounds.is_positive):
        return f"u > 0 is not certain near z = {low[np.argmin(bounds.is_positive)]:.6g}"
    return "".join(
        _objection_within(bounds, places, trial, q, side) or _objection_beyond(bounder, q, side) for q, side in sides
    )


def _plain_objection(bounds: Bounds, certificate: Certificate) -> str:
    """Why LT ≤ (μ + δ) T or LT ≥ (μ − δ) T need not hold for T = u."""
    if not np.all(bounds.is_positive):
        return "u > 0 is not certain"
    for q, side in ((UPPER, certificate.upper), (LOWER, certificate.lower)):
        if side is not None and not np.max(bounds.above(q)) <= side.delta:
            return f"{'upper' if q > 0 else 'lower'} bound: the mismatch is greater than its delta; "
    return ""


def _misplaced(certificate: Certificate, noise: Cylinder, side: SideRecord) -> str:
    """Why the cells and the gauge are not what the theorem asks for."""
    first, last = side.nodes[0], side.nodes[-1]
    if side.tails is None:
        if (first, last) != (-1.0, 1.0):
            return "the cells do not cover the support"
        return "" if side.values[0] <= 0 <= side.values[-1] else "W points outward at an end of the support"
    if noise.is_bounded and not -1 < first <= 0 <= last < 1:
        return "the core must hold 0, and not reach the ends of the support"
    if certificate.p is None and certificate.basis.gauge != 0:
        return "the drift has no gauge"
    return ""


def _objection_within(
    bounds: Bounds, places: dict[tuple[float, float], int], trial: Trial, q: int, side: SideRecord
) -> str:
    """Why (*) need not hold on a cell.

    Its right side is W B − ½ q W² but for a constant. Over all W between two values and B between two others it is
    least, for W of one sign, where W B is, at one end of B; then at an end of W, or for q = −1 at W = −B.
    """
    square, excess = q if trial.p is not None else 0, bounds.above(q)
    for cell, values in zip(pairwise(side.nodes), pairwise(side.values), strict=True):
        j = places[cell]
        left, right, start, stop = map(ball, (*cell, *values))
        room = (ball(side.delta) - ball(float(excess[j]))) / trial.noise.nu
        inward = (float(bounds.inward[0][j]), float(bounds.inward[1][j]))
        least = [(w, inward[0] if w > 0 else inward[1]) for w in (*values, *[0.0] * (min(values) < 0 < max(values)))]
        if square < 0:
            least += [(-bound, bound) for bound in inward if min(values) < -bound < max(values)]
        pulls = (ball(w) * ball(b if w else 0.0) - square * (ball(w) * ball(w)) / 2 for w, b in least)
        if not all((stop - start) / (2 * (right - left)) <= room + pull for pull in pulls):
            return f"{'upper' if q > 0 else 'lower'} bound: the mismatch near z = {cell[0]:.6g} is not made up for; "
    return ""


def _objection_beyond(bounder: Bounder, q: int, side: SideRecord) -> str:
    """Why T may not be frozen at an end of the core, the left one mirrored onto the right one."""
    noise, square = bounder.trial.noise, q if bounder.trial.p is not None else 0
    for sign, j, tail in zip((-1, 1), (0, -1), side.tails or (), strict=False):
        (frozen,) = bounder.frozen(np.array([side.nodes[j]]), sign)
        drop, mismatch, growth, drift, slope = map(ball, (*frozen.above(q), frozen.drift, frozen.slope))
        beta, value, kappa = (ball(sign * each) for each in (bounder.trial.basis.gauge, side.values[j], tail))
        if not (
            kappa <= value - drop
            and kappa >= -q * beta
            and kappa >= 0  # as b and b′ are bounded from below
            and noise.nu * slope * kappa >= growth
            and (ball(side.delta) - mismatch) / noise.nu + kappa * (drift - beta) - square * (kappa * kappa) / 2 >= 0
        ):
            name = "upper" if q > 0 else "lower"
            return f"{name} bound: the trial function does not serve beyond z = {side.nodes[j]:.6g}; "
    return ""
