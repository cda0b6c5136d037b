"""One variable, ẋ = −ax + bξx: closed forms, and the largest eigenvalue of the noise's own generator."""

import math
from functools import partial

import numpy as np

from fpsolve import OrnsteinUhlenbeck
from fpsolve.model import Bounded, Poisson, SineWiener, Telegraph, White
from tests.kit import rates
from tests.numbers.values import Row, exponent, index, moment, slope_by
from tests.oracles import kronecker

A, B, STEP = 0.1, 0.8, 1e-3


def scalar(noise, unit: float = 1.0):
    """With the unit of time of ẋ = −ax."""
    return rates("x' = -a*x + b*xi*x", noise, a=A * unit, b=B * unit)


def turning(amplitude: float, nu: float, sigma: float, is_sine: bool):
    generator, xi = kronecker.turning(amplitude, nu, sigma, 24, is_sine)
    return lambda p: float(np.max(np.linalg.eigvals(generator + p * B * xi).real))


GAUSS = OrnsteinUhlenbeck(1.5, 0.6)
TILTED = [
    (White(s=0.5), lambda p: 0.5 * (p * B * 0.5) ** 2),
    (White(s=0.5, interpretation="ito"), lambda p: 0.5 * p * (p - 1) * (B * 0.5) ** 2),
    (GAUSS, lambda p: 0.5 * (p * B * 0.6 / 1.5) ** 2),
    (Telegraph(0.5, 1.0), lambda p: math.hypot(1.0, 0.5 * p * B) - 1.0),
    (Poisson(2.0, (-0.5, 0.8)), lambda p: math.exp(-0.5 * p * B) + math.exp(0.8 * p * B) - 2),
    (SineWiener(0.5, 1.0), turning(0.5, 0.0, 1.0, True)),
    (Bounded(0.5, 1.0, 0.7), turning(0.5, 1.0, 0.7, False)),
]


def slope(tilted) -> float:
    return (8 * (tilted(STEP) - tilted(-STEP)) - tilted(2 * STEP) + tilted(-2 * STEP)) / (12 * STEP)


def root(tilted) -> float:
    """δ_p, by bisection of Λ(p)/p."""
    low, high = -19.0, 20.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if tilted(middle) / middle < A else (low, middle)
    return low


ROWS = [
    *(
        Row(scalar(noise), quantity, value, 1e-11, 1e-8, f"one variable under {noise.kind} {k}")
        for k, (noise, tilted) in enumerate(TILTED)
        for quantity, value in (
            *((moment(p), tilted(p) - A * p) for p in (-1.0, 0.3, 1.0, 2.0, 3.7)),
            (exponent(), slope(tilted) - A),
            (index(), partial(root, tilted)),
        )
    ),
    *(
        Row(scalar(GAUSS), slope_by(key, 2.0), value, 1e-12, 1e-9, "a parabola of one variable")
        for key, value in {
            "system.a": -2,
            "system.b": 4 * B * 0.16,
            "noise.alpha": -4 * B**2 * 0.16 / 1.5,
            "noise.sigma": 4 * B**2 * 0.6 / 2.25,
        }.items()
    ),
    *(
        Row(
            scalar(OrnsteinUhlenbeck(1.5 * unit, 0.6 * math.sqrt(unit)), unit),
            moment(3.7),
            unit * (TILTED[2][1](3.7) - 3.7 * A),
            *(1e-13 * unit, 1e-8 * unit, f"one variable in units of {unit:g}"),
        )
        for unit in (4.0**-12, 4.0**12)
    ),
]
