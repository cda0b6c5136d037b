"""Numbers in other units and coordinates: they scale as a rate, whatever the variables are."""

import math
from functools import partial

import numpy as np

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, moment_lyapunov
from fpsolve.exponent import critical_impact_factor, impact_rate
from fpsolve.model import Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.by_problem import by_moments
from tests.numbers.second import even
from tests.numbers.values import Row, exponent, moment, number, slope_by, variance_rate


def spring(noise, k: float, b: float):
    return rates("x' = v; v' = -k*x - 2*b*v - xi*x", noise, k=k, b=b)


def row(problem, quantity, value, size: float, source: str, digits: float = 1e-8):
    """A value of about this size, known to its last digits and solved to so many."""
    return Row(problem, quantity, value, 1e-11 * size, digits * size, source)


def moved(seed: int):
    """White noise in any coordinates and any unit of time, and Λ(4)."""
    rng = np.random.default_rng(seed)
    drift, noise = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)) * 10 ** rng.uniform(-1.5, 2)
    right = even(4, drift, (noise, White(1.0)))
    basis, rate = np.diag([1.0, 10 ** rng.uniform(-7, 7)]) @ rng.normal(size=(2, 2)), 10 ** rng.uniform(-9, 12)
    inverse = np.linalg.inv(basis)
    return matrices(rate * basis @ drift @ inverse, math.sqrt(rate) * basis @ noise @ inverse, White(1.0)), rate * right


def overdamped(noise, rate: float):
    """In units in which it is slow, of order 1, or fast."""
    if isinstance(noise, Telegraph):
        scaled = Telegraph(a=0.8 * rate**2, k=rate)
    else:
        scaled = OrnsteinUhlenbeck(alpha=rate, sigma=0.8 * rate**2.5)
    return spring(scaled, 0.9 * rate**2, 10.0 * rate)


def resonator(rate: float):
    """At 1e7 a resonator of MHz in seconds."""
    return spring(OrnsteinUhlenbeck(alpha=rate, sigma=0.5 * rate**2.5), rate**2, 0.1 * rate)


def walled(rate: float):
    walls, noise = [{"at": "x = 0", "restitution": "R"}], OrnsteinUhlenbeck(alpha=rate, sigma=0.3 * rate**2.5)
    return rates("x' = v; v' = -k*x - 2*b*v - xi*x", noise, walls, k=rate**2, b=0.1 * rate, R=0.8)


def of_slow(quantity, unit: float) -> float:
    return unit * quantity.solved(walled(1.0))[0]


def triangular(coupling: float, noise, rate: float, basis):
    """Each y_i grows by itself, Λ_i(p) = a_i p + ½ b_i² S(0) p², and the second one drives the first."""
    made = White(1 / math.sqrt(rate)) if noise is White else OrnsteinUhlenbeck(rate, math.sqrt(rate))
    steady, driven = (np.diag(each) + coupling * np.eye(2, k=1) for each in ([-1.0, -0.5], [0.3, 0.6]))
    inverse = np.linalg.inv(basis)
    return matrices(rate * basis @ steady @ inverse, rate * basis @ driven @ inverse, made)


STIFF = [
    (900.0, 35.0, 600.0, 8, 383.0),
    (25e4, 1000.0, 1e5, 2, 1080.0),
    (0.2847996839106912, 1.033337807595426 / 2, 90.70639802418872, 12, 315.0),
    (-1e4, 10.0, 1e3, 2, 202.0),
]
"""k, b, s, p, and about Λ(p)."""
TRIANGULAR = [
    (noise, rate, np.array(basis), coupling)
    for rate, basis in (
        (1.0, [[1.0, 0.5], [-0.75, 1.0]]),
        (1e7, np.diag([1.0, 2.0**12])),
        (1e-8, np.diag([2.0**20, 1.0])),
    )
    for noise in (OrnsteinUhlenbeck, White)
    for coupling in (0.0, 0.7)
]
ALPHA, SIGMA, DAMPING = 4062377457933.0483, 4531886108703.288, 0.30232299121798145
LIMIT = spring(White(SIGMA / ALPHA), 1.0, DAMPING)
ROWS = [
    *(
        row(
            problem,
            moment(p),
            partial(by_moments, problem, p),
            size,
            f"moment equations of white noise, not beside a rotation {k:g}",
        )
        for k, b, s, p, size in STIFF
        for problem in [spring(White(s), k, b)]
    ),
    row(
        spring(White(1e5), 25e4, 1000.0),
        moment(3.0),
        2431.057834,
        2431.0,
        "two codes of white noise, not beside a rotation",
    ),
    row(spring(White(1e6), 0.0, 0.0), moment(2.0), 2e12 ** (1 / 3), 1e4, "Λ³ = 2s² of white noise alone"),
    *(
        row(
            problem,
            moment(4.0),
            value,
            max(abs(value), ExponentSolver(problem).method.scale(4.0)),
            f"moment equations in any coordinates {seed}",
        )
        for seed in range(12)
        for problem, value in [moved(seed)]
    ),
    *(
        row(
            overdamped(noise, rate),
            moment(2.0),
            lambda noise=noise, rate=rate: rate * by_moments(overdamped(noise, 1.0), 2, 40),
            rate,
            f"unit of time {rate:g} {noise.kind}",
            1e-6,
        )
        for noise in (Telegraph(a=1.0, k=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=1.0))
        for rate in (1e-3, 1.0, 30.0, 1e3, 1e6)
    ),
    row(
        resonator(1e7),
        moment(2.0),
        lambda: 1e7 * by_moments(resonator(1.0), 2, 40),
        1e7,
        "moment equations of a resonator of MHz",
    ),
    *(
        Row(
            triangular(coupling, noise, rate, basis),
            quantity,
            rate * value,
            1e-12 * rate,
            1e-8 * rate,
            f"rays in units of {rate:g} {noise.__name__} {coupling}",
        )
        for noise, rate, basis, coupling in TRIANGULAR
        for quantity, value in ((moment(3.0), -1.5 + 4.5 * 0.36), (exponent(), -0.5))
    ),
    *(
        Row(
            spring(OrnsteinUhlenbeck(ALPHA, SIGMA), 1.0, DAMPING),
            moment(p),
            lambda p=p: float(moment_lyapunov(LIMIT, p).value[0]),
            1e-9,
            1e-8,
            "white noise with the same S(0)",
        )
        for p in (-0.5, 1.0, 2.0, 4.0)
    ),
    *(
        Row(
            walled(rate),
            quantity,
            partial(of_slow, quantity, unit),
            1e-11 * unit,
            1e-7 * unit,
            f"wall in units of {rate:g}",
            slow=rate > 1,
        )
        for rate in (1e-7, 1e7 / 3)
        for quantity, unit in (
            *((each, rate) for each in (moment(-1.0), moment(2.0), exponent(), variance_rate(), number(impact_rate))),
            (number(critical_impact_factor), 1.0),
            (slope_by("system.R", 2.0), rate),
            (slope_by("noise.alpha", 2.0), 1.0),
        )
    ),
]
