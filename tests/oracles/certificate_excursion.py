"""Check a bound of excursions: P(sup‖x‖ ≥ A) ≤ factor·A^−p, or ≥, for every A > 1, x(0) = (1, 0), any noise there.

**Theorem.**  With LT ≤ 0, T > 0, and T continuous but for the factor R^p at jumps, ‖y‖^p T(φ, z) is a supermartingale,
for which Markov's inequality holds at the time when ‖x‖ first reaches A: P ≤ (T/ρ^p at the start)/(A^p min T/ρ^p),
where ρ = ‖x‖/‖y‖ at a phase of y, x = P y.  With LT ≥ 0 it is a submartingale, bounded until then, which tends to 0 on
paths that decay; where no jump takes ‖x‖ upward it is A^p T/ρ^p at that time: P ≥ (T/ρ^p at the start)/(A^p max T/ρ^p).

Here T = e^{ps}u, s(φ) = κφ − Σ σ ln R over the rays before φ, and W must be 0.  The extremes of u over boxes of phase
and noise are those of `certificate_series`; e^{ps}/ρ^p follows in intervals for each cell of phases.
"""

import math
from fractions import Fraction

import numpy as np

from tests.oracles import certificate_checker as checker
from tests.oracles import certificate_condition as condition
from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as cf

CELLS, NUMBER = 64, 2048


def check(claim, exponent=None):
    """An empty string when a claim follows, a lower one with the entry of the Lyapunov exponent; else why not."""
    entry, is_upper = claim["moment"], claim["sense"] == "upper"
    if reason := checker.check(entry):
        return reason
    try:
        cf.require(claim["sense"] in ("upper", "lower"), "No such sense.")
        certificate = entry["certificate"]
        model = cf.model_of(certificate)
        cf.require(model.moment and model.p > 0, "An excursion needs p > 0.")
        sign = cf.decimal(entry["upper"]) <= 0 if is_upper else cf.decimal(entry["lower"]) >= 0
        cf.require(sign, "The sign of the moment is not proven.")
        cf.require(not any(certificate[claim["sense"]]["values"]), "W is not 0.")
        cf.require(certificate["basis"]["kind"] != "core", "A core has an unbounded trial function.")
        if not is_upper:
            cf.require(exponent is not None and not checker.check(exponent), "No Lyapunov exponent is proven.")
            cf.require(exponent["certificate"]["quantity"] == "lyapunov_exponent", "It is another number.")
            same = all(exponent["certificate"].get(k) == certificate.get(k) for k in ("parameters", "motion", "chain"))
            cf.require(same, "The Lyapunov exponent is of another system.")
            cf.require(cf.decimal(exponent["upper"]) < 0, "Almost every path must decay.")
            cf.require(all(log.b <= 0 for _, log, _ in model.jumps), "A jump is upward.")
        least, most, first, last = _extremes(model, cf.read_trial(model, certificate).function)
        claimed = cs.exact(cf.decimal(claim["factor"]))
        holds = claimed.a >= (last / least).b if is_upper else claimed.b <= (first / most).a
        cf.require(holds, "The factor does not follow.")
    except cf.Refused as refusal:
        return str(refusal)
    except (KeyError, TypeError, ValueError, ArithmeticError, IndexError, AttributeError) as error:
        return f"The claim cannot be read: {type(error).__name__}: {error}."
    return ""


def _extremes(model, u):
    """Below and above e^{ps}u/ρ^p everywhere, and at the start over all noise."""
    lows, highs = _over_noise(model, u)
    below, above = [], []
    for i in range(NUMBER):
        for phi in _parts(i):
            for weight in _weights(model, phi):
                below.append(weight * cs.exact(lows[i]))
                above.append(weight * cs.exact(highs[i]))
    least, most = min(x.a for x in below), max(x.b for x in above)
    cf.require(least > 0, "The trial function is not positive.")
    phi, turn = _start(model)
    (weight,) = _weights(model, phi)
    low, high = _over_noise(model, _at_phase(u, turn), 4)
    return least, most, weight * cs.exact(low.min()), weight * cs.exact(high.max())


def _over_noise(model, u, number=NUMBER):
    """Below and above u in cells of phases around πi/number, for all noise."""
    found = []
    for sign in (1, -1):
        harmonics = u.shape[1]
        if model.noise.kind in ("chain", "white"):
            all_waves = [cs.waves(u[..., state] * sign) for state in range(u.shape[-1])]
        else:
            ends = -np.cos(np.pi * np.arange(CELLS + 1) / CELLS)
            ends[0], ends[-1] = -1.0, 1.0
            place = cs.cells(cs.Chebyshev(), ends[:-1], ends[1:])
            one = condition._weight(np.ones(CELLS))
            all_waves = [condition._sum([one], [cs.expansion(cs.Chebyshev(), cs.series(u * sign), place)])]
        bounds = [cs.Phases(number, harmonics).bounds(w)[0].min(axis=0) for w in all_waves]
        found.append(sign * np.min(bounds, axis=0))
    return found


def _parts(i):
    """The cell of phases around πi/NUMBER, in [0, π]."""
    pi, half = cs.IV.pi, Fraction(1, 2)
    low, high = ((cs.exact((i + s * half) / NUMBER) * pi) for s in (-1, 1))
    if i == 0:
        return cs.IV.mpf([0, high.b]), cs.IV.mpf([(low + pi).a, pi.b])
    return (cs.IV.mpf([low.a, high.b]),)


def _weights(model, phi):
    """e^{ps}/ρ^p for all phases of an interval in [0, π], on either side of the rays in it."""
    cosine, sine = cs.IV.cos(phi), cs.IV.sin(phi)
    sums = [cs.exact(0)]
    for ray, log_factor, direction in model.jumps:
        x, y = (cs.exact(v) for v in _upward(ray))
        beyond = sine * x + cosine * y  # a positive multiple of sin(φ − that of the ray)
        fall = log_factor * direction
        if beyond.a > 0:
            sums = [each + fall for each in sums]
        elif not beyond.b < 0:
            sums = [each + some for each in sums for some in (cs.exact(0), fall)]
    square = sum((cs.exact(row[0]) * cosine - cs.exact(row[1]) * sine) ** 2 for row in model.coordinates)
    p = cs.exact(model.p)
    return [cs.IV.exp(p * (model.kappa * phi - each - cs.IV.log(square) / 2)) for each in sums]


def _upward(ray):
    """The direction of a line whose phase is in [0, π)."""
    x, y = map(Fraction, ray)
    return (-x, -y) if y > 0 or (y == 0 and x < 0) else (x, y)


def _start(model):
    """The phase of P⁻¹(1, 0), in an interval, and cos 2φ and sin 2φ there, exact."""
    (a, b), (c, d) = (map(Fraction, row) for row in model.coordinates)
    sign = 1 if a * d > b * c else -1
    x, y = _upward((sign * d, -sign * c))
    for ray, _, _ in model.jumps:
        cf.require(ray[0] * y != ray[1] * x, "The start is on the ray of a jump.")
    near = math.atan2(float(-y), float(x))
    phi = cs.IV.mpf([max(near - 1e-12, 0.0), near + 1e-12])
    beyond = [cs.IV.sin(end) * cs.exact(x) + cs.IV.cos(end) * cs.exact(y) for end in (phi.a, phi.b)]
    cf.require((beyond[0].b < 0 or y == 0) and beyond[1].a > 0, "The phase of the start is not found.")
    size = x * x + y * y
    return phi, (cs.exact((x * x - y * y) / size), cs.exact(-2 * x * y / size))


def _at_phase(u, turn):
    """A series at one phase, as one with a constant harmonic only."""
    cosine, sine = cs.exact(1), cs.exact(0)
    total = u[:, :1] * 0
    for k in range(u.shape[1]):
        total[0, 0] = total[0, 0] + u[0, k] * cosine + u[1, k] * sine
        cosine, sine = cosine * turn[0] - sine * turn[1], sine * turn[0] + cosine * turn[1]
    return total
