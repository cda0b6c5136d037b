"""Noise of strength 0: Λ(p) is p times the growth rate."""

import math

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.exponent import critical_impact_factor, impact_rate
from fpsolve.model import Bounded, Filter, Jump, MarkovChain, Poisson, SineWiener, White
from tests.kit import matrices, rates
from tests.numbers.values import Row, exponent, moment, number, slope_by, variance_rate

OU = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
NOISES = {
    "OU": OU,
    "chain": MarkovChain((-1.0, 0.0, 2.0), ((0, 1, 1), (1, 0, 1), (1, 1, 0))),
    "white": White(s=0.5),
    "Itô": White(s=0.5, interpretation="ito"),
    "impulses": Poisson(rate=1.0, sizes=(-1.0, 1.0)),
    "bounded": Bounded(mu=0.5, nu=2.0, sigma=0.5),
    "sine-Wiener": SineWiener(amplitude=1.0, sigma=1.0),
    "Eq. (7)": NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8),
    "tails": NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.2),
    "filter": Filter(omega=2.0, zeta=0.3, s=1.0, c0=1.0, c1=0.2),
}
DAMPED = [[0.0, 1.0], [-1.0, -0.2]]
FREE = {
    "damped": DAMPED,
    "undamped": [[0.0, 1.0], [-1.0, 0.0]],
    "saddle": [[0.0, 1.0], [1.0, -0.2]],
    "overdamped": [[0.0, 1.0], [-1.0, -3.0]],
    "critical": [[0.0, 1.0], [-1.0, -2.0]],
    "nilpotent": [[0.0, 1.0], [0.0, 0.0]],
    "growth alone": [[-0.1, 0.0], [0.0, -0.1]],
    "at rest": [[0.0, 0.0], [0.0, 0.0]],
    "three variables": np.random.default_rng(3).normal(size=(3, 3)) - np.eye(3),
    "four variables": np.random.default_rng(4).normal(size=(4, 4)) - np.eye(4),
}
TURNS = math.sqrt(0.99) / math.pi
"""Half-turns of the damped motion in a unit of time."""
WALL = [Jump(math.pi / 2, math.log(0.8))]


WALLED = rates("x' = v; v' = -x - 0.2*v - g*xi*x", White(s=0.5), [{"at": "x = 0", "restitution": "R"}], g=0.0, R=0.8)


def still(free, noise, **more):
    return matrices(free, np.zeros_like(free), noise, **more)


def grown(problem, rate: float, source: str, p=(2.0, -0.5), quantities=(), slow: bool = False):
    asked = [*((moment(each), rate * each) for each in p), (exponent(), rate), *quantities]
    return [
        Row(problem, quantity, value, 1e-12 * (1 + abs(rate)), 1e-8, f"no noise, {source}", slow)
        for quantity, value in asked
    ]


ROWS = [
    *(
        row
        for name, free in FREE.items()
        for noise in ("OU", "chain", "white")
        for p in [(2.0, 1.0, -0.5) if len(free) == 2 else (2.0, 1.0)]
        for row in grown(still(free, NOISES[noise]), float(np.linalg.eigvals(free).real.max()), f"{name}, {noise}", p)
    ),
    *(
        row
        for name, noise in NOISES.items()
        for row in grown(
            still(DAMPED, noise, jumps=WALL),
            -0.1 + TURNS * math.log(0.8),
            f"wall, {name}",
            quantities=(
                (variance_rate(), 0.0),
                (number(impact_rate), TURNS),
                (number(critical_impact_factor), math.exp(0.1 / TURNS)),
            ),
        )
    ),
    *(
        row
        for name in ("OU", "white", "chain", "filter")
        for row in grown(
            matrices(DAMPED, [np.zeros((2, 2))] * 2, [OU, NOISES[name]]), -0.1, f"twice, {name}", slow=name != "white"
        )
    ),
    *(
        Row(matrices(np.zeros((2, 2)), np.eye(2), noise), quantity, value, 1e-15, 1e-8, "E exp(p∫ξ)")
        for noise, square in ((NOISES["white"], 0.25), (OU, 1.0))
        for quantity, value in ((exponent(), 0.0), (moment(1.0), square / 2), (moment(2.0), 2 * square))
    ),
    *(
        Row(
            rates(f"x' = v; v' = -x - 0.2*v - g*xi*{load}", MarkovChain((0.5, 1.5), ((0, 1.0), (1.0, 0))), g=0.0),
            slope_by("system.g", 2.0),
            *(value, 1e-12, 1e-10, f"mean of the noise in {load} at g = 0"),
        )
        for load, value in (("x", 0.0), ("v", -1.0))
    ),
    *(
        Row(WALLED, slope_by("system.R", p), (p or 1.0) * TURNS / 0.8, 1e-10, 1e-8, "no noise, restitution of a wall")
        for p in (0.0, 2.0)
    ),
]
