"""What a certificate is about, straight from the definitions, slowly and with the digits that mpmath works with."""

import math
from fractions import Fraction

import mpmath
import numpy as np
from numpy.polynomial import chebyshev, hermite_e

OSCILLATOR = {
    "oscillator.omega": "1.3",
    "oscillator.restitution": "0.75",
    "oscillator.c1": "-0.1",
    "oscillator.epsilon": "0.5",
    "oscillator.impact": "restitution",
}
EXACT = {**OSCILLATOR, "noise.D0": "0.4", "noise.tau0": "0.6", "noise.r0": "0.7", "noise.treatment": "exact"}
PLAIN = {**OSCILLATOR, "noise.alpha": "1.7", "noise.sigma": "0.9"}


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


def noise_of(v):
    """(drift, σ², unit) of z = ξ/unit, from Eqs. (7) and (12)-(15)."""
    if "noise.alpha" in v:
        alpha, sigma = v["noise.alpha"], v["noise.sigma"]
    else:
        d0, tau, r0 = v["noise.D0"], v["noise.tau0"], v["noise.r0"]
        sigma = mpmath.sqrt(2 * d0) / tau
        if v["noise.treatment"] == "exact":
            unit = mpmath.sqrt(2 * d0 / (tau * (1 - r0)))
            return lambda z: -z / tau / (1 + tau / d0 * (r0 - 1) * (z * unit) ** 2 / 2), (sigma / unit) ** 2, unit
        alpha = 1 / (2 * (2 - r0) / (5 - 3 * r0) * tau)
    unit = sigma / mpmath.sqrt(2 * alpha)
    return lambda z: -alpha * z, (sigma / unit) ** 2, unit


def applied(certificate, phi, z, function=trial, extra=lambda y: 0):
    """(L(p)T − μT)/(R^{ps}e^{βz}) of T = R^{ps}e^{βz + ψ}u, or for λ: the drift of ρ + s ln R + f + ψ less μ.

    From Eqs. (17)-(18).  `function` is u or f, `extra` is ψ, which must vanish at z.
    """
    words = ("oscillator.impact", "noise.treatment")
    v = {k: x if k in words else mpmath.mpf(x) for k, x in certificate["parameters"].items()}
    eps, c1, beta = v["oscillator.epsilon"], v["oscillator.c1"], mpmath.mpf(certificate["basis"].get("gauge", 0))
    loss = eps**2 * (1 - v["oscillator.restitution"])
    log_r = -loss if v["oscillator.impact"] == "delta" else mpmath.log(1 - loss)
    drift, diffusion, unit = noise_of(v)
    p, push = certificate["p"] and mpmath.mpf(certificate["p"]), eps * z * unit + eps**2 * c1

    def whole(x, y):
        if p is None:
            return x / mpmath.pi * log_r + function(certificate, x, y) + extra(y)
        return mpmath.exp(p * log_r * x / mpmath.pi + beta * y + extra(y)) * function(certificate, x, y)

    value = diffusion / 2 * mpmath.diff(whole, (phi, z), (0, 2)) + drift(z) * mpmath.diff(whole, (phi, z), (0, 1))
    value += (v["oscillator.omega"] + push * mpmath.sin(2 * phi) / 2) * mpmath.diff(whole, (phi, z), (1, 0))
    rate, mu = push * (1 - mpmath.cos(2 * phi)) / 2, mpmath.mpf(certificate["mu"])
    if p is None:
        return value + rate - mu
    return (value + (p * rate - mu) * whole(phi, z)) * mpmath.exp(-p * log_r * phi / mpmath.pi - beta * z)
