"""Check a certificate: do its numbers prove that Λ(p), or λ, lies between the two bounds of its entry?

Between two impacts the state's logarithm ρ, its phase φ and the noise have the tilted generator L(p) = L_ξ + (ω
+ (εξ + ε²c₁)h₁)∂φ + p(εξ + ε²c₁)q₁, Eqs. (17)-(19).  An impact multiplies the state by R; writing T = R^{ps}T̃
with a sawtooth s that rises by 1 from one impact to the next makes T̃ smooth and ∂φ to ∂φ + p ln(R)/π.

**Theorem.**  T = e^{βz ± ψ(z)} u(φ, z) > 0 with ψ′ = W.  With m = |Lβu/u − μ| and B = b − β − u_z/u,

    (*)   ½W′ ≤ (δ − m)/ν + W B − ½W²

gives LT ≤ (μ + δ)T for +ψ and LT ≥ (μ − δ)T for −ψ: e^{∓ψ}Le^{±ψ} adds ν(±(½W′ − W B) + ½W²) to Lβ, and W² may
count against the claim both times.  Where W jumps downward by at least |u_z/u|, the slope of ln T falls for +ψ
and rises for −ψ: the local time there has the sign that each bound needs.  So e^{ρp − (μ+δ)t}T is a
supermartingale; T of +ψ is bounded below, hence Λ ≤ μ + δ.  And e^{ρp − (μ−δ)t}T is a submartingale for −ψ, as
|ρ| ≤ C(1 + ∫|ξ|dt) has all exponential moments; that T is bounded above, hence Λ ≥ μ − δ.  Both tails need |W|
≥ |β| for this.  (*) is needed at every point by itself, so m need not be a maximum over φ.  For λ the same
holds of ρ + s ln R + f ± ψ, whose drift meets no squares and whose martingale part has a bounded integrand, so
that it is o(t).

**Tails.**  Beyond z_J the certificate holds u at z_J and W at κ ≥ |β|.  Let e = b(z_J) and g the least slope of b
there: b′(z_J), as b is convex for z > 0, or b′(0) where z_J < 0.  Then b(z) ≥ e + g(z − z_J), and the remaining
excess only helps (−ν(β ± κ) times it).  With t = z − z_J ≥ 0 the claims are n + t·r ∓ ν(κ(e + gt − β) ∓ ½κ²) ≤ δ,
≥ −δ; they follow from |n| ≤ δ + ν(κ(e − β) − ½κ²) and |r| ≤ νgκ.  Left of z_0 everything is mirrored.

For p = 0 nothing is to be shown: T = 1 and Λ = 0.

**Ends of bounded noise.**  ±1 is reached when r0 < 0 (a < 1).  Near them the noise is a Bessel process of
dimension 1 + a > 1, reflected and without a local time, so Itô's formula holds as inside: only |z| < 1 has to
be checked.

**Arithmetic.**  D(Lβu − μu), D = 1 − z² for bounded noise in a core and else 1, is a series whose coefficients
follow in intervals; `certificate_series` encloses it over boxes of phase and noise.  The comparisons at the end
are sums of few products of floats, each a dozen roundings (2⁻⁵³) from the truth, and must hold by 2⁻⁴⁴ of the
sum of all magnitudes in them.
"""

import json
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as cf

SLACK = 2.0**-44
LEVELS = ((1, 1), (2, 2), (4, 4))
"""(Times as many phases, parts of a cell), one after the other where a bound is too coarse."""
BOXES = 2**18  # at a time


def read(text):
    """An entry, or a list of them, from JSON, with all decimals as they stand."""
    return json.loads(text, parse_float=Decimal)


def check(entry):
    """An empty string when lower ≤ Λ(p) ≤ upper (or λ) follows from the certificate of an entry, else why not."""
    try:
        certificate = entry["certificate"]
        model = cf.model_of(certificate)
        _compare_claim(entry, certificate, model)
        if model.moment and model.p == 0:
            cf.require(abs(model.mu) <= model.delta, "The moment of order 0 has the exponent 0.")
            return ""
        trial, nodes, values = cf.read_trial(model, certificate)
        with np.errstate(all="ignore"):  # what overflows or is no number fails every comparison
            _check_tails(model, trial, nodes, values, certificate["tails"])
            _check_core(model, trial, nodes, values, int(certificate["phases"]))
    except cf.Refused as refusal:
        return str(refusal)
    except (KeyError, TypeError, ValueError, ArithmeticError, IndexError, AttributeError) as error:
        return f"The certificate cannot be read: {type(error).__name__}: {error}."
    return ""


def _compare_claim(entry, certificate, model):
    """The entry claims no more than μ ± δ, of the same p."""
    if model.moment:
        cf.require(cf.decimal(entry["p"]) == model.p, "The certificate is of another p.")
    else:
        cf.require(entry.get("p") is None and certificate.get("p") is None, "A Lyapunov exponent has no p.")
    mu, delta = Fraction(model.mu), Fraction(model.delta)
    cf.require(cf.decimal(entry["lower"]) <= mu - delta, "lower is above mu - delta, which is all it proves.")
    cf.require(cf.decimal(entry["upper"]) >= mu + delta, "upper is below mu + delta, which is all it proves.")


def _check_tails(model, trial, nodes, values, tails):
    """What keeps the two tails of a core."""
    if tails is None:
        return
    tails = cf.binary(tails)
    cf.require(tails.shape == (2,), "A core has two tails.")
    _check_tail(model, trial, 1, nodes[-1], values[-1], tails[1])
    _check_tail(model, trial, -1, nodes[0], values[0], tails[0])


def _check_tail(model, trial, side, end, value, constant):
    """The tail beyond z_J (side 1), or beyond z_0 (side −1) with z, β and W mirrored."""
    beta, w, kappa = (cs.exact(side * float(x)) for x in (trial.gauge, value, constant))
    z, nu, name = cs.exact(end), cs.exact(model.nu), f"The tail beyond {end:.6g}"
    cf.require(side * constant >= abs(trial.gauge), f"{name} is flatter than the gauge allows.")
    b = cs.exact(model.slope) * z / (1 - z**2 if model.bounded else 1)
    slope = cs.exact(model.slope)
    if model.bounded and side * end > 0:
        slope = slope * (1 + z**2) / (1 - z**2) ** 2
    u, divisor, steep = (trial.basis.at(a, float(end)) for a in (trial.function, trial.divisor, trial.steep))
    v, turned = cf.transport(model, u, divisor)
    gauge = cs.exact(trial.gauge)
    constant_part = nu * gauge * (gauge / 2 - b) - cs.exact(model.mu)
    n = v * cs.exact(model.omega) + turned * (cs.exact(model.mean) + z * model.unit) + divisor * constant_part
    growth = turned * model.unit - divisor * (nu * gauge * slope)
    steepest, n, growth = (_largest(a, divisor, name) for a in (steep, n, growth))
    cf.require((w - kappa - steepest).a >= 0, f"{name}: W jumps by less than |u_z/u|.")
    cf.require((nu * slope * kappa - growth).a >= 0, f"{name} grows too slowly with the noise.")
    square = kappa**2 / 2 if model.moment else 0
    margin = cs.exact(model.delta) + nu * (kappa * (b * side - beta) - square) - n
    cf.require(margin.a >= 0, f"{name}: the bound fails at its foot.")


def _largest(top, bottom, name):
    """A bound on |top/bottom| over the phase, both of them held."""
    top, bottom = cs.held(cs.series(top)), cs.held(cs.series(bottom))
    harmonics = top.start.shape[2]
    grid = cs.Phases(max(1024, 32 * harmonics), harmonics)
    quotient = cs.ratio(grid.boxes(top), grid.boxes(bottom))
    cf.require(quotient.positive.all(), f"{name}: u is not positive.")
    return cs.exact((np.abs(quotient.middle) + quotient.spread).max() * (1 + SLACK))


class Parts(NamedTuple):
    """Parts of cells: their ends, the range of W, its slope and its value in the middle."""

    left: np.ndarray
    right: np.ndarray
    least: np.ndarray
    most: np.ndarray
    slope: np.ndarray
    middle: np.ndarray


def _divided(nodes, values, cells, parts):
    """Cells in equal parts.  W at an inner end is off by its rounding, and by that of the end times its slope."""
    fraction = np.arange(parts + 1) / parts
    z_l, z_r, w_l, w_r = (a[:, None] for a in (nodes[cells], nodes[cells + 1], values[cells], values[cells + 1]))
    z, w = z_l + (z_r - z_l) * fraction, w_l + (w_r - w_l) * fraction
    z[:, -1], w[:, -1] = z_r[:, 0], w_r[:, 0]
    slope = np.broadcast_to((w_r - w_l) / (z_r - z_l), (len(cells), parts))
    loose = 2.0**-50 * (np.abs(w_l) + np.abs(w_r) + np.abs(slope) * np.maximum(np.abs(z_l), np.abs(z_r)))
    loose = loose * (parts > 1)
    least, most = np.minimum(w[:, :-1], w[:, 1:]) - loose, np.maximum(w[:, :-1], w[:, 1:]) + loose
    middle = (w[:, :-1] + w[:, 1:]) / 2
    return Parts(*(a.ravel() for a in (z[:, :-1], z[:, 1:], least, most, slope, middle)))


def _drift(model, z):
    """b at floats, infinite at the ends of bounded noise."""
    return float(model.slope) * z / ((1 - z) * (1 + z) if model.bounded else 1.0)


class Verdict(NamedTuple):
    """Of each part of a cell: it is proved; it is refuted at the middle of a box."""

    proved: np.ndarray
    refuted: np.ndarray


def _check_core(model, trial, nodes, values, phases):
    """(*) in every cell: coarse cells are divided, with more phases."""
    pieces = [cs.series(a) for a in (trial.residual, trial.steep, trial.divisor)]
    harmonics = len(pieces[0].sizes)
    phases = min(max(phases, 4 * harmonics), 4096)
    waiting = np.arange(len(nodes) - 1)
    for more, parts in LEVELS:
        grid = cs.Phases(phases * more, harmonics)
        step, left = max(1, BOXES // (phases * more * parts)), []
        for start in range(0, len(waiting), step):
            cells = waiting[start : start + step]
            verdict = _judge(model, trial, pieces, grid, _divided(nodes, values, cells, parts))
            for cell in cells[verdict.refuted.reshape(-1, parts).any(axis=1)]:
                raise cf.Refused(f"The condition fails between z = {nodes[cell]:.6g} and {nodes[cell + 1]:.6g}.")
            left.append(cells[~verdict.proved.reshape(-1, parts).all(axis=1)])
        waiting = np.concatenate(left)
        if not len(waiting):
            return
    cell = waiting[0]
    raise cf.Refused(f"The condition could not be shown between z = {nodes[cell]:.6g} and {nodes[cell + 1]:.6g}.")


def _judge(model, trial, pieces, grid, parts):
    """(*) in parts of cells, for all phases."""
    place = cs.cells(trial.basis, parts.left, parts.right)
    residual, steep, divisor = (grid.boxes(cs.expansion(trial.basis, s, place)) for s in pieces)
    mismatch, q = cs.ratio(residual, divisor), cs.ratio(steep, divisor)
    proved = (q.positive & _holds(model, trial, mismatch, q, parts)).all(axis=1)
    refuted = (q.positive & _fails(model, trial, mismatch, q, parts)).any(axis=1)
    return Verdict(proved, refuted | (divisor.value + divisor.rest < 0).any(axis=1))


def _factor(model, trial, z):
    """D at floats."""
    return (1 - z) * (1 + z) if model.bounded and isinstance(trial.basis, cs.Hermite) else np.ones_like(z)


def _holds(model, trial, mismatch, q, parts):
    """(*) in all of a box: W B − ½W² is linear in B and concave in W, so a corner of their ranges has the least.

    At z = ±1 b is infinite, so the last part of the whole interval needs W of the sign of z: then its other end has the
    least W b, but for that of W.
    """
    left, right, least, most, slope, _ = (a[:, None] for a in parts)
    m = (np.abs(mismatch.middle) + mismatch.spread) / np.minimum(
        _factor(model, trial, left), _factor(model, trial, right)
    )
    low, high = _drift(model, left), _drift(model, right)
    good = (np.isfinite(low) | (most <= 0)) & (np.isfinite(high) | (least >= 0))
    low, high = np.where(np.isfinite(low), low, high), np.where(np.isfinite(high), high, low)
    size = np.maximum(np.abs(low), np.abs(high))
    if model.moment:
        low, high = low - trial.gauge - (q.middle + q.spread), high - trial.gauge - (q.middle - q.spread)
        size = size + abs(trial.gauge) + np.abs(q.middle) + q.spread
    greatest, half = np.maximum(np.abs(least), np.abs(most)), 0.5 if model.moment else 0.0
    corners = [w * b - half * w**2 for w in (least, most) for b in (low, high)]
    margin = (model.delta - m) / float(model.nu) + np.minimum.reduce(corners) - slope / 2
    size = (model.delta + m) / float(model.nu) + greatest * size + greatest**2 + np.abs(slope)
    return good & np.isfinite(size) & (margin >= SLACK * size)


def _fails(model, trial, mismatch, q, parts):
    """Clearly not (*) in the middle of a box: then nothing finer would help."""
    z, w, slope = ((parts.left + parts.right)[:, None] / 2, parts.middle[:, None], parts.slope[:, None])
    excess = (model.delta - np.abs(mismatch.middle) / _factor(model, trial, z)) / float(model.nu)
    inward = _drift(model, z) - (trial.gauge + q.middle if model.moment else 0)
    square = w**2 / 2 if model.moment else 0 * w
    size = np.abs(excess) + np.abs(w * inward) + square + np.abs(slope)
    return excess + w * inward - square - slope / 2 < -1e-6 * size
