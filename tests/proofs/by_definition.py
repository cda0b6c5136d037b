"""What a certificate is about, straight from the definitions, slowly and with the digits that mpmath works with."""

import math
from fractions import Fraction

import mpmath
import numpy as np
from numpy.polynomial import chebyshev, hermite_e


def law(kind, unit, nu, slope):
    """A noise as a certificate states it."""
    return {"kind": kind, "unit": unit, "nu": nu, "slope": slope, "states": [], "rates": []}


def bounded(d0, tau, r0):
    """That of Eq. (7)."""
    return law("bounded", math.sqrt(2 * d0 / (tau * (1 - r0))), (1 - r0) / tau, 1 / (1 - r0))


def gaussian(alpha, sigma):
    """That of Eq. (15)."""
    return law("gaussian", sigma / math.sqrt(2 * alpha), 2 * alpha, 0.5)


OSCILLATOR = {
    "still": [[0.0, 1.3], [-1.3, 0.5**2 * -0.1]],
    "driven": [[0.0, 0.0], [0.0, 0.5]],
    "jumps": [{"ray": [0.0, -1.0], "log_factor": math.log(1 - 0.5**2 * (1 - 0.75))}],
    "coordinates": [[1.0, 0.0], [0.0, 1.0]],
}
"""That of Eq. (3) with ω = 1.3, r = 0.75, c₁ = −0.1 and ε = 0.5."""
EXACT = {**OSCILLATOR, "noise": bounded(0.4, 0.6, 0.7)}
REDUCED = {**OSCILLATOR, "noise": gaussian((5 - 3 * 0.7) / (2 * (2 - 0.7) * 0.6), math.sqrt(2 * 0.4) / 0.6)}
REACHED = {**OSCILLATOR, "noise": bounded(0.4, 0.6, -1.5)}
PLAIN = {**OSCILLATOR, "noise": gaussian(1.7, 0.9)}


def polynomial(powers, z):
    """Σ powers[i] zⁱ."""
    value = mpmath.mpf(0)
    for c in reversed(powers):
        value = value * z + mpmath.mpf(Fraction(c).numerator) / Fraction(c).denominator
    return value


def element(basis, m, z):
    """B_m(z) as a certificate defines it."""
    if basis["kind"] == "core":
        y = (z - mpmath.mpf(basis["centre"])) / mpmath.mpf(basis["scale"])
        powers = hermite_e.herme2poly(np.eye(m + 1)[m])
        return polynomial(list(powers), y) / mpmath.sqrt(mpmath.factorial(m))
    if m == 0:
        return mpmath.mpf(1)
    powers = [Fraction(int(c)) for c in chebyshev.cheb2poly(np.eye(m)[m - 1])]
    powers = [*powers, 0, 0]
    slope = [c - (powers[i - 2] if i > 1 else 0) for i, c in enumerate(powers)]
    integral = [Fraction(0), *(c / (i + 1) for i, c in enumerate(slope))]
    for i, c in enumerate(integral):  # the mean of z^i with the weight 1/(π√(1 − z²)) is the term in T_0
        integral[0] -= c * Fraction(math.comb(i, i // 2), 2**i) if i % 2 == 0 and i else 0
    return polynomial(integral, z)


def trial(certificate, phi, z):
    """u(φ, z) as a certificate defines it."""
    total = mpmath.mpf(0)
    for k, (row, other) in enumerate(zip(certificate["cosine"], certificate["sine"], strict=True)):
        for m, (a, b) in enumerate(zip(row, other, strict=True)):
            wave = mpmath.mpf(a) * mpmath.cos(2 * k * phi) + mpmath.mpf(b) * mpmath.sin(2 * k * phi)
            total += wave * element(certificate["basis"], m, z)
    return total


def applied(certificate, phi, z, function=trial, extra=lambda y: 0):
    """(L(p)T − μT)/(R^{ps}e^{βz}) of T = R^{ps}e^{βz + ψ}u, or for λ: the drift of ρ + s ln R + f + ψ less μ.

    From ẋ = (A₀ + unit z A₁) x, x = ‖x‖ (cos φ, −sin φ), with a wall that the phase passes forward.  `function` is u
    or f, `extra` is ψ, which must vanish at z.
    """
    stated, beta = certificate["stated"], mpmath.mpf(certificate["basis"].get("gauge", 0))
    noise = {name: mpmath.mpf(stated["noise"][name]) for name in ("unit", "nu", "slope")}
    log_r = sum(mpmath.mpf(jump["log_factor"]) for jump in stated["jumps"])
    drift = -noise["nu"] * noise["slope"] * z / (1 - z**2 if stated["noise"]["kind"] == "bounded" else 1)
    p = None if certificate["p"] is None else mpmath.mpf(certificate["p"])
    a = mpmath.matrix(stated["still"]) + z * noise["unit"] * mpmath.matrix(stated["driven"])
    e, turned = mpmath.matrix([mpmath.cos(phi), -mpmath.sin(phi)]), mpmath.matrix([-mpmath.sin(phi), -mpmath.cos(phi)])
    speed, rate = ((side.T * a * e)[0] for side in (turned, e))

    def whole(x, y):
        if p is None:
            return x / mpmath.pi * log_r + function(certificate, x, y) + extra(y)
        return mpmath.exp(p * log_r * x / mpmath.pi + beta * y + extra(y)) * function(certificate, x, y)

    value = noise["nu"] / 2 * mpmath.diff(whole, (phi, z), (0, 2)) + drift * mpmath.diff(whole, (phi, z), (0, 1))
    value += speed * mpmath.diff(whole, (phi, z), (1, 0))
    mu = mpmath.mpf(certificate["mu"])
    if p is None:
        return value + rate - mu
    return (value + (p * rate - mu) * whole(phi, z)) * mpmath.exp(-p * log_r * phi / mpmath.pi - beta * z)
