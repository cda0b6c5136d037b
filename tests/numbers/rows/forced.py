"""Stationary mean squares of forced states with delays: closed forms, spectra and a discretised segment."""

import math

import numpy as np
from scipy.integrate import quad_vec

from fpsolve.exponent import stationary_moments
from fpsolve.model import OrnsteinUhlenbeck, Poisson, Telegraph, White
from tests.kit import rates
from tests.numbers.second import segment
from tests.numbers.values import Quantity, Row
from tests.oracles.segments import written

ITO = White(s=1.0, interpretation="ito")


def moments_of(problem):
    return stationary_moments(problem, 1e-6)


def square(problem):
    found = moments_of(problem)
    return found.square[0, 0], found.errors[0, 0]


def mean(problem):
    found = moments_of(problem)
    return found.mean[0], found.errors[0, 0]


def covariance(problem):
    found = moments_of(problem)
    return found.covariance[0, 0], found.errors[0, 0]


def largest(problem):
    """tr E xxᵀ and all its entries with weights of their own, so that each of them is seen."""
    found = moments_of(problem)
    weights = np.add.outer(np.arange(1.0, len(found.mean) + 1), np.arange(len(found.mean)))
    return float(np.sum(weights * found.square)), float(np.sum(weights * found.errors[:-1, :-1]))


SQUARE, MEAN, COVARIANCE = Quantity("E x²", square), Quantity("E x", mean), Quantity("Var x", covariance)


def of_scalar(a, b, tau):
    """E x² of dx = (ax + b x(t − τ)) dt + dW (Küchler, Mensch 1992)."""
    q = complex(a * a - b * b) ** 0.5
    return ((q - b * np.sinh(q * tau)) / (2 * q * (-a - b * np.cosh(q * tau)))).real


def spectrum(n):
    """∫ H bbᵀ H* dω/2π, H = (iω − A − B e^(−iωτ))⁻¹, less that of (iω + 1)⁻¹, bbᵀ/2."""
    rng, tau, names = np.random.default_rng(n), 0.8, "xyzw"[:n]
    a, b = rng.standard_normal((2, n, n)) / n
    a -= 2.5 * np.eye(n)
    force, weights = rng.standard_normal(n), np.add.outer(np.arange(1.0, n + 1), np.arange(n))

    def value():
        def share(omega):
            h = np.linalg.solve(1j * omega * np.eye(n) - a - b * np.exp(-1j * omega * tau), force)
            return (np.outer(h, h.conj()).real - np.outer(force, force) / (1 + omega**2)) / math.pi

        found, _ = quad_vec(share, 0, 2000, epsabs=1e-10, limit=5000)
        return float(np.sum(weights * (found + 0.5 * np.outer(force, force))))

    text = zip(names, written([("", [(0.0, a), (tau, b)])], names, force, "xi"), strict=True)
    equations = "; ".join(f"{name}' = {each}" for name, each in text)
    return Row(
        lambda: rates(equations, ITO),
        Quantity("E xxᵀ", largest),
        value,
        2e-5,
        1e-8,
        f"spectrum of {n} variables",
        n > 2,
    )


def of_segment(size):
    noise = Telegraph(a=0.8, k=0.7)
    drift, load = [(0.0, np.array([[-1.0]])), (1.0, np.array([[0.4]]))], [(0.0, np.array([[0.5]]))]
    return segment(drift, [(load, noise)], size).stationary([1.0], noise.probabilities)[0, 0]


LOADED = "x' = v; v' = -x - 0.2*v - 0.3*{}*{} + {}*{}"
K = of_scalar(-1, -0.8, 1)
AT = 0.1 / (1 - 0.08 - 0.3)
ROWS = [
    *(
        Row(
            rates(f"x' = {a}*x + {b}*x(t - {tau}) + xi", ITO),
            SQUARE,
            of_scalar(a, b, tau),
            1e-14,
            1e-12,
            f"Küchler and Mensch, {a}, {b}, {tau}",
        )
        for a, b, tau in ((-1, 0.4, 1), (-1, -0.4, 1), (-0.2, -1, 1), (0.3, -1, 0.8), (-2, 1.9, 5), (-1, -0.9, 50))
    ),
    *(
        Row(
            rates(f"x' = -x - 0.8*x(t - 1) + 0.7*xi1*{past} + 0.5*xi2", [ITO, ITO]),
            SQUARE,
            0.25 * K / (1 - 0.49 * K),
            1e-13,
            1e-9,
            f"V = k(σ² + β²V), {past}",
        )
        for past in ("x", "x(t - 1)")
    ),
    Row(
        rates("x' = -3*x + xi*x(t - 0.7) + xi", Poisson(1.5, (-1.2, 1.2))),
        SQUARE,
        2.16 / (6 - 2.16),
        1e-13,
        1e-9,
        "impulses that force and multiply",
    ),
    Row(
        rates("x' = -x + 0.3*x(t - 1) + xi", OrnsteinUhlenbeck(alpha=1.5, sigma=0.8)),
        SQUARE,
        lambda: square(rates("x' = -x + 0.3*x(t - 1) + y; y' = -1.5*y + 0.8*xi", ITO))[0],
        1e-12,
        1e-9,
        "coloured noise as a variable",
    ),
    Row(
        rates("x' = -x + 0.3*x(t - 1) + xi*(0.4*x + 0.5)", White(s=1.0)),
        MEAN,
        AT,
        1e-13,
        1e-9,
        "(−1 + ½a² + c)m + ½ab = 0",
    ),
    Row(
        rates("x' = -x + 0.3*x(t - 1) + xi*(0.4*x + 0.5)", White(s=1.0)),
        COVARIANCE,
        of_scalar(-0.92, 0.3, 1) * (0.4 * AT + 0.5) ** 2 / (1 - 0.16 * of_scalar(-0.92, 0.3, 1)),
        1e-12,
        1e-9,
        "what unit noise makes, and the noise at the mean",
    ),
    *(
        Row(rates(LOADED.format(*text), noises), quantity, value, 1e-15, 1e-11, f"white noises, no delay: {text}")
        for text, noises, quantity, value in (
            (("xi", "x", 0.2, "xi"), White(s=1.0), SQUARE, 4 / 31),
            (("xi1", "x", 0.5, "xi2"), [White(s=1.0)] * 2, SQUARE, 0.25 / 0.31),
            (("xi", "v", 0.2, "xi"), White(s=1.0), MEAN, -0.03),
            (("xi", "v", 0.2, "xi"), White(s=1.0), SQUARE, 2 / 11 + 0.0009),
            (("xi", "v", 0.2, "xi"), ITO, MEAN, 0.0),
            (("xi", "v", 0.2, "xi"), ITO, SQUARE, 4 / 31),
        )
    ),
    *(spectrum(n) for n in (2, 3, 4)),
    Row(
        rates("x' = -x + 0.4*x(t - 1) + 0.5*xi1*x + xi2", [Telegraph(a=0.8, k=0.7), ITO]),
        SQUARE,
        lambda: of_segment(32),
        1e-6,
        1e-6,
        "segment under a telegraph that multiplies",
    ),
    *(
        Row(
            rates(f"x' = {unit}*v; v' = (-x - 0.3*{unit}*v + 0.2*x(t - 1) + 0.2*xi*x(t - 1) + xi)/{unit}", ITO),
            Quantity(
                "E xv and E v²",
                lambda problem, unit=unit: (float(moments_of(problem).square[1] @ [unit, unit**2]), 0.0),
            ),
            lambda: float(
                moments_of(rates("x' = v; v' = -x - 0.3*v + 0.2*x(t - 1) + 0.2*xi*x(t - 1) + xi", ITO)).square[1].sum()
            ),
            1e-9,
            0.0,
            f"other units, {unit}",
        )
        for unit in (1e-6, 1e3)
    ),
]
