"""Check a certificate: do its numbers prove that Λ(p), or λ, lies between the two bounds of its entry?

Between two jumps the state's logarithm ρ, its phase φ and the noise have the tilted generator L(p) = L_ξ + (h₀ +
ξh₁)∂φ + p(q₀ + ξq₁), Eqs. (17)-(19) of the paper's oscillator.  A jump multiplies the state by R, at a ray that the
phase passes forward or backward; writing T = e^{ps}T̃ with a sawtooth s that falls by ln R where a ray is passed
forward, rises by it where backward, and makes up for it in between, makes T̃ smooth and ∂φ to ∂φ + pκ.

**Theorem.**  The two bounds have proofs of their own, each with its δ, nodes, W and tails; μ and u are the same.
Let q be 1 for the upper bound, −1 for the lower, and T = e^{βz + qψ(z)} u(φ, z) > 0 with ψ′ = W, which is
continuous in the core.  With e = q(Lβu/u − μ), where Lβ has ∂z + β for ∂z, and B = b − β − u_z/u,

    (*)   ½W′ ≤ (δ − e)/ν + W B − ½qW²

at every point says q(LT − μT) ≤ δT there: e^{−qψ}Le^{qψ} adds ν(q(½W′ − W B) + ½W²) to Lβ.  At an end of the core
q times the slope of ln T may only fall as z rises, by W − κ + q u_z/u ≥ 0 at the right end where W jumps to κ: the
local time there then has the sign that the bound needs.  Upper: e^{pρ − (μ+δ)t}T is a local supermartingale, a
supermartingale because it is positive; T is bounded below where β + W ≥ 0 in the right tail and ≤ 0 in the left,
hence Λ ≤ μ + δ.  Lower: e^{pρ − (μ−δ)t}T is a submartingale where β − W ≤ 0 in the right tail and ≥ 0 in the left:
T and T_z are then bounded, and |ρ| ≤ C(t + ∫|ξ|dt) has all exponential moments, so that the martingale part has
mean 0; as T is bounded above and its start positive, Λ ≥ μ − δ.  (*) is needed at every point by itself, so neither e
nor B need be its extreme over φ.  For λ the same holds of ρ + s ln R + f + qψ, whose drift meets no squares: e =
q(drift of ρ + s ln R + f, less μ), B = b, no W².  Its martingale part has a bounded integrand, so that it is o(t),
and qψ is bounded on the side that counts, as W ≥ 0 in the right tail and ≤ 0 in the left.

**Tails.**  Beyond z_J the certificate holds u at z_J and W at κ, qβ + κ ≥ 0.  Let g be the least slope of b there:
b′(z_J), as b is convex for z > 0, or b′(0) where z_J < 0.  With t = z − z_J ≥ 0, b(z) ≥ b(z_J) + gt, and

    q(LT/T − μ) = q(n + tF₁u/u) − ν(κ(b(z_J) − β) − ½qκ²) − ν(qβ + κ)(b(z) − b(z_J))

with n = LβT/T − μ at z_J for κ = 0.  This is ≤ δ if qn ≤ δ + ν(κ(b(z_J) − β) − ½qκ²) and q(F₁u/u − νβg) ≤ νgκ; F₁ =
h₁(∂φ + p ln(R)/π) + pq₁ is the part of L that z multiplies.  Left of z_0 everything is mirrored: z, β, W, u_z and F₁
change their signs.

**Other noise.**  For z = cos θ with θ a Brownian motion, for a chain, and for white noise, where L has no noise but a
second-order term ½(h₁(∂φ + pκ) + pq₁)², T̃ = u is taken as it is, and (μ − δ)u ≤ Lu ≤ (μ + δ)u is checked.  White noise
does not move the phase at a ray, which it then passes one way; Itô's and Dynkin's formulas hold as coefficients are
bounded and T is smooth.

For p = 0 nothing is to be shown: T = 1 and Λ = 0.

**Ends of bounded noise.**  ±1 is reached when r0 < 0 (a < 1).  Near them the noise is a Bessel process of
dimension 1 + a > 1, reflected and without a local time, and ∫|b(z)|dt has a mean; so Itô's formula holds as inside
for any T that is smooth up to ±1, and only |z| < 1 has to be checked.

**Arithmetic.**  D(Lβu − μu), D = 1 − z² for bounded noise in a core and else 1, is a series whose coefficients
follow in intervals; `certificate_series` encloses it over boxes of phase and noise, `certificate_condition` has (*).
"""

import json
from fractions import Fraction

import numpy as np

from tests.oracles import certificate_condition as condition
from tests.oracles import certificate_plain as plain
from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as cf


def read(text):
    """An entry, or a list of them, from JSON."""
    return json.loads(text)


def check(entry):
    """An empty string when lower ≤ Λ(p) ≤ upper (or λ) follows from the certificate of an entry, else why not."""
    try:
        certificate = entry["certificate"]
        model = cf.model_of(certificate)
        least, most = _compare_claim(entry, certificate, model)
        if model.moment and model.p == 0:
            cf.require(least <= 0 <= most, "The moment of order 0 has the exponent 0.")
            return ""
        trial = cf.read_trial(model, certificate)
        with np.errstate(all="ignore"):  # what overflows or is no number fails every comparison
            for name in ("upper", "lower"):
                if model.plain:
                    plain.check(model, trial, certificate, name)
                    continue
                side = cf.read_side(model, trial, certificate, name)
                if side.tails is not None:
                    _check_tail(model, trial, side, 1)
                    _check_tail(model, trial, side, -1)
                condition.check(model, trial, side, int(certificate["phases"]))
    except cf.Refused as refusal:
        return str(refusal)
    except (KeyError, TypeError, ValueError, ArithmeticError, IndexError, AttributeError) as error:
        return f"The certificate cannot be read: {type(error).__name__}: {error}."
    return ""


def _compare_claim(entry, certificate, model):
    """The entry claims no more than the two bounds, which are returned, of the same p."""
    if model.moment:
        cf.require(cf.number(entry["p"]) == model.p, "The certificate is of another p.")
    else:
        cf.require(entry.get("p") is None, "A Lyapunov exponent has no p.")
    below, above = (Fraction(delta) for delta in cf.deltas(certificate))
    least, most = Fraction(model.mu) - below, Fraction(model.mu) + above
    cf.require(cf.number(entry["lower"]) <= least, "lower is above mu - delta, which is all it proves.")
    cf.require(cf.number(entry["upper"]) >= most, "upper is below mu + delta, which is all it proves.")
    return least, most


def _check_tail(model, trial, side, toward):
    """The tail beyond z_J (toward 1), or beyond z_0 (toward −1) with z, β and W mirrored."""
    last = -1 if toward == 1 else 0
    end, value, constant = (float(x[last]) for x in (side.nodes, side.values, side.tails))
    beta, w, kappa = (cs.exact(toward * x) for x in (trial.gauge, value, constant))
    z, nu, name = cs.exact(end), cs.exact(model.nu), f"The {side.name} tail beyond {end:.6g}"
    cf.require(toward * constant >= -side.sign * toward * trial.gauge, f"{name} is flatter than the gauge allows.")
    b = cs.exact(model.slope) * z / (1 - z**2 if model.bounded else 1)
    slope = cs.exact(model.slope)
    if model.bounded and toward * end > 0:
        slope = slope * (1 + z**2) / (1 - z**2) ** 2
    divisor, steep = (trial.basis.at(a, end) for a in (trial.divisor, trial.steep))
    u = divisor if model.moment else trial.basis.at(trial.function, end)
    still, driven = cf.transport(model, u, divisor)
    gauge = cs.exact(trial.gauge)
    constant_part = nu * gauge * (gauge / 2 - b) - cs.exact(model.mu)
    n = still + driven * z + divisor * constant_part
    growth = driven - divisor * (nu * gauge * slope)
    square = kappa**2 * side.sign / 2 if model.moment else 0
    room = cs.exact(side.delta) + nu * (kappa * (b * toward - beta) - square)
    _require_positive(divisor, f"{name}: u is not positive.")
    _require_positive(divisor * (w - kappa) + steep * (side.sign * toward), f"{name}: W jumps by less than u's slope.")
    _require_positive(
        divisor * (nu * slope * kappa) - growth * (side.sign * toward), f"{name} grows too slowly with the noise."
    )
    _require_positive(divisor * room - n * side.sign, f"{name}: the bound fails at its foot.")


def _require_positive(a, reason):
    """Refuse unless a function of the phase is positive."""
    waves = cs.waves(a)
    number = max(1024, 32 * len(a[0]))
    for more in (1, 4, 16):
        bounds, values = cs.Phases(number * more, len(a[0])).bounds(waves)
        if (bounds > 0).all():
            return
        cf.require((values >= 0).all(), reason)
    raise cf.Refused(reason)
