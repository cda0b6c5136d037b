"""Motions in the plane under one noise, whatever they do: they turn or rest, mix or hardly mix."""

import math

import numpy as np

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, SineWiener, Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.by_problem import even_rows
from tests.numbers.values import Row, moment, moments, variance_rate
from tests.oracles import moment_hierarchy


def random_chain(seed: int):
    """Two or three states, any matrices, noise in all of them, weak or strong, slow or fast; half of them turn."""
    rng = np.random.default_rng(seed)
    count, turn = int(rng.integers(2, 4)), seed % 2 * rng.uniform(0.5, 3)
    rate = 10 ** rng.uniform(-1, 1) * rng.uniform(0.1, 1, (count, count))
    np.fill_diagonal(rate, 0)
    free, driven = rng.uniform(-1, 1, (2, 2, 2)) * [[[0.3 if turn else 1.0]], [[rng.uniform(0.1, 1)]]]
    return matrices(
        free + turn * (np.eye(2, k=1) - np.eye(2, k=-1)), driven, MarkovChain(rng.uniform(-1, 1, count), rate)
    )


def elliptic():
    """A fast rotation; eigenfunctions of a wrong eigenvalue are of nearly one sign on a coarse mesh and a finer one."""
    free = np.array([[0.742, -3.334], [0.7, 1.684]])
    square = np.array([[-1.719, -0.581], [-1.235, -1.086]])
    cube = np.array([[-1.172, 1.896], [-1.741, 1.163]])
    chain = MarkovChain((-2.466, -1.282, -3.378), ((0, 3.053, 0), (0, 0, 1.328), (1.661, 0, 0)))
    terms = (
        CoefficientMatrix(0, free),
        CoefficientMatrix(0, square, np.square),
        CoefficientMatrix(3, cube, lambda xi: xi**3),
    )
    states = [free + xi**2 * square + 1.5**3 * xi**3 * cube for xi in chain.states]
    return Problem(PlaneSystem(terms, epsilon=1.5), chain), moment_hierarchy.moment_lyapunov(states, chain.rates, 4)


def kubo(noise):
    return rates("x' = -(1.3 + xi)*y; y' = (1.3 + xi)*x", noise)


ELLIPTIC, ELLIPTIC_4 = elliptic()
KICKS = [Jump(phase, math.log(factor)) for phase, factor in ((0.3, 0.9), (1.1, 0.7), (2.9, 1.2))]
KICKED = matrices([[0.0, 2.0], [-2.0, 0.0]], np.zeros((2, 2)), Telegraph(a=0.5, k=1.0), jumps=KICKS)
RAY = rates("x' = 0.3*x + v; v' = (xi - 0.5)*v", Telegraph(a=1.0, k=1.0))
CORNER = rates("x' = v; v' = 1.5*x - 0.1*v - xi*x", White(s=0.2))
SADDLE = rates(
    "x' = v; v' = 0.9145754572566481*x - 0.022172161308702646*v - xi*x",
    SineWiener(amplitude=1.8052320203283212, sigma=2.8552605157715485),
)
CHANGES = "rtol 1e-13, as one change of the mesh is too small for an error,"
ROWS = [
    *(
        row
        for seed in range(26)
        for row in even_rows(random_chain(seed), f"random chain {seed}", 1e-9, [2 + 2 * (seed // 2 % 2)], rtol=1e-11)
    ),
    *even_rows(
        rates("x' = 1.3*v; v' = -(1.3 + xi/1.3)*x - 0.2*v", OrnsteinUhlenbeck(alpha=1.0, sigma=0.6)),
        *("Hermite polynomials of a spring", 1e-9),
        count=40,
        rtol=1e-10,
    ),
    *(
        Row(
            rates("x' = v + xi*x; v' = xi*v - x", MarkovChain((0.4 * sign, -0.2 * sign), ((0, 1e-9), (1e-9, 0)))),
            moment(2.0),
            value,
            1e-8,
            1e-6,
            f"state that grows faster of two that hardly mix {sign}",
        )
        for sign, value in ((1, 0.8), (-1, 0.4))
    ),
    *moments(
        KICKED, {p: p * 2 * math.log(0.9 * 0.7 * 1.2) / math.pi for p in (-1, 2)}, 1e-14, 1e-9, "three kicks in a turn"
    ),
    *(Row(RAY, moment(1.0, rtol=rtol), 0.3, 0.0, rtol, "ray that all matrices keep") for rtol in (1e-6, 1e-8)),
    *(Row(ELLIPTIC, moment(4.0, rtol=rtol), ELLIPTIC_4, 1e-7, 1e-3, "fast elliptic rotation") for rtol in (1e-7, 1e-8)),
    *(
        row
        for noise, rate in (
            (White(s=0.5), 0.0),
            (White(s=0.5, interpretation="ito"), 0.125),
            (OrnsteinUhlenbeck(alpha=1.0, sigma=0.5), 0.0),
            (Telegraph(a=0.5, k=0.5), 0.0),
        )
        for row in moments(kubo(noise), {p: rate * p for p in (-1.5, 3)}, 0.0, 1e-8, f"Kubo's oscillator {noise.kind}")
    ),
    Row(SADDLE, variance_rate(), 0.3961547429919089, 0.0, 4e-7, f"{CHANGES} of a saddle"),
    *(
        Row(
            CORNER,
            moment(-1.0, rtol=rtol),
            -1.1690259121064,
            0.0,
            1e-3,
            "Fourier series of 281 functions",
            slow=rtol < 1e-6,
        )
        for rtol in (1e-5, 1e-8)
    ),
    *moments(
        rates("x' = 1304.5654004177877*v; v' = -xi*v", White(s=35.47186471641247, interpretation="ito")),
        {p: 0.5 * p * (p - 1) * 35.47186471641247**2 for p in (1.04268799533869, 2.4876484873472053)},
        *(0.0, 1e-11, "½p(p − 1)s², whose parts cancel beside p = 1"),
    ),
]
