"""What a certificate states: the constants of the oscillator and its noise, and the series that a proof is about.

Parameters are exact decimals, all other numbers are floats taken as they are, so every coefficient of the
series follows in intervals.
"""

from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tests.oracles import certificate_series as cs


class Refused(Exception):
    """The claim does not follow; the message says why."""


class Model(NamedTuple):
    """Constants: of the phase, of the noise (b = slope·z, over 1 − z² if bounded), and what is bounded."""

    omega: Fraction
    mean: Fraction  # ε²c₁
    unit: object  # ε times the unit of the noise, an interval
    kappa: object  # ln R/π, an interval
    nu: Fraction
    slope: Fraction  # b′(0)
    bounded: bool
    moment: bool
    p: Fraction
    mu: float


class Trial(NamedTuple):
    """A basis, the gauge β and the series, in intervals, that (*) is about."""

    basis: object
    gauge: float
    residual: object  # D(Lβu − μu), or of λ: D times the drift of ρ + s ln R + f, less μ
    steep: object  # u_z or f_z
    divisor: object  # u or 1
    function: object  # u or f


class Side(NamedTuple):
    """One of the two proofs: its name and sign (1 for the upper bound), δ, the nodes, W there and in the tails."""

    name: str
    sign: int
    delta: float
    nodes: np.ndarray
    values: np.ndarray
    tails: np.ndarray | None


def require(condition, reason):
    """Refuse unless the condition holds."""
    if not condition:
        raise Refused(reason)


def decimal(value):
    """The exact value of a decimal as written; of a float, of the decimal that Python writes for it."""
    require(isinstance(value, str | int | float | Decimal) and not isinstance(value, bool), f"{value!r} is no number.")
    number = Decimal(repr(value) if isinstance(value, float) else value)
    require(number.is_finite() and abs(number.adjusted()) < 400, f"{value} is out of range.")
    return Fraction(number)


def binary(values):
    """Floats from numbers of JSON, all finite."""
    array = np.array(values, dtype=object)
    good = [isinstance(v, int | float | Decimal) and not isinstance(v, bool) for v in array.flat]
    require(all(good), "A number of the certificate is missing.")
    array = np.array([float(v) for v in array.flat]).reshape(array.shape)
    require(np.isfinite(array).all(), "A number of the certificate is not finite.")
    return array


def model_of(certificate):
    """The constants of a certificate."""
    quantity = certificate["quantity"]
    require(quantity in ("moment", "lyapunov_exponent"), f"No quantity is called {quantity!r}.")
    words = ("oscillator.impact", "noise.treatment")
    given = {k: v if k in words else decimal(v) for k, v in certificate["parameters"].items()}
    omega, eps = given["oscillator.omega"], given["oscillator.epsilon"]
    require(omega > 0, "omega must be positive: the phase must cross each impact forward.")
    nu, slope, bounded, square = _noise(given)
    require(Fraction(1, 10**80) < nu < 10**80, "The rate of the noise is out of range.")
    loss = eps**2 * (1 - given["oscillator.restitution"])
    return Model(
        omega=omega,
        mean=eps**2 * given["oscillator.c1"],
        unit=cs.exact(eps) * cs.IV.sqrt(cs.exact(square)),
        kappa=_log_factor(given["oscillator.impact"], loss) / cs.IV.pi,
        nu=nu,
        slope=slope,
        bounded=bounded,
        moment=quantity == "moment",
        p=decimal(certificate["p"]) if quantity == "moment" else Fraction(0),
        mu=float(binary(certificate["mu"])),
    )


def _log_factor(impact, loss):
    """ln R of an impact."""
    require(impact in ("delta", "restitution"), f"No impact is called {impact!r}.")
    require(impact == "delta" or loss < 1, "The impact leaves no positive factor.")
    return cs.exact(-loss) if impact == "delta" else cs.IV.log(cs.exact(1 - loss))


def _noise(given):
    """ν, b′(0), whether the noise is bounded, and the square of its unit."""
    if "noise.treatment" not in given:
        alpha, sigma = given["noise.alpha"], given["noise.sigma"]
        require(alpha > 0 and sigma > 0, "alpha and sigma must be positive.")
        return 2 * alpha, Fraction(1, 2), False, sigma**2 / (2 * alpha)
    d0, tau, r0 = given["noise.D0"], given["noise.tau0"], given["noise.r0"]
    treatment = given["noise.treatment"]
    require(d0 > 0 and tau > 0, "D0 and tau0 must be positive.")
    if treatment == "exact" and r0 < 1:
        return (1 - r0) / tau, 1 / (1 - r0), True, 2 * d0 / (tau * (1 - r0))
    require(treatment == "ou-reduction" or (treatment == "exact" and r0 == 1), f"No {treatment} noise with r0 {r0}.")
    require(r0 < Fraction(5, 3), "The reduction to OU noise needs r0 < 5/3.")
    tau1 = 2 * (2 - r0) / (5 - 3 * r0) * tau
    return 2 / tau1, Fraction(1, 2), False, d0 * tau1 / tau**2


def deltas(certificate):
    """δ of the lower and of the upper proof."""
    found = [float(binary(certificate[name]["delta"])) for name in ("lower", "upper")]
    require(min(found) >= 0, "delta must not be negative.")
    return found


def read_trial(model, certificate):
    """The trial function with what follows from it."""
    about = certificate["basis"]
    require(about["kind"] in ("whole", "core"), f"No basis is called {about['kind']!r}.")
    whole = about["kind"] == "whole"
    floats = np.stack([binary(certificate["cosine"]), binary(certificate["sine"])])
    require(floats.ndim == 3 and 2 <= floats.shape[2] <= 150, "The coefficients are no table of 2 to 150 degrees.")
    if whole:
        require(model.bounded, "Only bounded noise has a whole interval.")
        gauge = float(binary(about.get("gauge", 0.0)))
        basis = cs.Chebyshev()
    else:
        centre, scale, gauge = (float(binary(about[name])) for name in ("centre", "scale", "gauge"))
        require(scale > 0, "The scale must be positive.")
        basis = cs.Hermite(centre, scale)
    require(gauge == 0 or (model.moment and not whole), "A gauge needs a moment and a core.")
    harmonics, degrees = floats.shape[1] + 2, floats.shape[2] + 6
    given = cs.intervals(floats, harmonics, degrees)
    return (_whole if whole else _core)(model, basis, gauge, given)


def read_side(model, trial, certificate, name):
    """The proof of the "upper" or of the "lower" bound."""
    given = certificate[name]
    nodes, values, tails = binary(given["nodes"]), binary(given["values"]), given["tails"]
    require(nodes.ndim == 1 and len(nodes) > 1 and nodes.shape == values.shape, "Nodes and values do not match.")
    require(np.all(np.diff(nodes) > 0), "The nodes do not rise.")
    require((tails is None) == isinstance(trial.basis, cs.Chebyshev), "A core has tails, the whole interval has none.")
    if tails is None:
        require(nodes[0] == -1 and nodes[-1] == 1, "The whole interval is [-1, 1].")
        require(values[0] <= 0 <= values[-1], "W pushes out at an end of the whole interval.")
    else:
        tails = binary(tails)
        require(tails.shape == (2,), "A core has two tails.")
        require(not model.bounded or (nodes[0] > -1 and nodes[-1] < 1), "The core leaves the range of the noise.")
        reach = np.abs(nodes[[0, -1]] - float(trial.basis.centre)) / float(trial.basis.scale)
        require((reach <= 29).all(), "The core reaches further than 29 scales.")
    sign = {"upper": 1, "lower": -1}[name]
    return Side(name, sign, float(binary(given["delta"])), nodes, values, tails)


def transport(model, function, divisor):
    """v = (∂φ + pκ)u and w = h₁v + p q₁u; for λ these of f, with 1 in the place of pu."""
    carrier = divisor * (cs.exact(model.p) if model.moment else 1)
    v = cs.phase_slope(function) + carrier * model.kappa
    return v, cs.times_h1(v) + cs.times_q1(carrier)


def _divisor(model, function):
    """u, or the constant 1 for λ."""
    one = function * 0
    one[(0,) * one.ndim] = cs.IV.mpf(1)
    return function if model.moment else one


def _between(model, basis, function, steep, second, gauge):
    """Lβu − μu without the drift −νb(∂z + β) of the noise, and u or 1."""
    divisor = _divisor(model, function)
    v, w = transport(model, function, divisor)
    beta, half = cs.exact(gauge), cs.exact(model.nu / 2)
    diffusion = (second + steep * (beta * 2) + function * beta**2) * half
    pushed = w * cs.exact(model.mean) + basis.times_z(w) * model.unit
    return diffusion + v * cs.exact(model.omega) + pushed - divisor * cs.exact(model.mu), divisor


def _core(model, basis, gauge, u):
    """The trial function in Hermite's polynomials."""
    steep = basis.slope(u)
    rest, divisor = _between(model, basis, u, steep, basis.slope(steep), gauge)
    drift = (steep + u * cs.exact(gauge)) * cs.exact(model.nu * model.slope)
    if model.bounded:
        drift = drift + basis.times_z(rest)
    return Trial(basis, gauge, rest - basis.times_z(drift), steep, divisor, u)


def _whole(model, basis, gauge, given):
    """The trial function on [−1, 1]: u_z/(1 − z²) = Σ c_m T_{m−1}."""
    quotient = cs.shifted(given, -1, -1)
    steep = quotient - basis.times_z(basis.times_z(quotient))
    u = basis.integral(steep)
    u[..., 0] = given[..., 0]
    rest, divisor = _between(model, basis, u, steep, basis.slope(steep), gauge)
    residual = rest - basis.times_z(quotient) * cs.exact(model.nu * model.slope)
    return Trial(basis, gauge, residual, steep, divisor, u)
