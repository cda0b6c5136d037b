"""Impulses at random times: Fourier series of the phase, and the equations of the moments."""

from functools import partial

import numpy as np

from fpsolve.model import Poisson
from tests.kit import matrices, rates
from tests.numbers.by_problem import even_rows, matrices_of
from tests.numbers.values import Row, closed, exponent, moment, moments
from tests.oracles import phase_circle

EVEN = Poisson(rate=1.0, sizes=(-1.0, 1.0))
UNEVEN = Poisson(rate=0.7, sizes=(1.5, -0.3, 0.2), weights=(1.0, 2.0, 3.0))


def spring(noise: Poisson, walls=()):
    return rates("x' = v; v' = -x - 0.4*v - xi*x", noise, walls=walls)


def random_system(seed: int):
    rng = np.random.default_rng([31, seed])
    free, driven = rng.uniform(-1, 1, (2, 2, 2))
    turn = (1.0 + rng.random()) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    noise = Poisson(rate=rng.uniform(0.2, 3), sizes=tuple(rng.uniform(-1, 1, 3)), weights=tuple(rng.random(3)))
    return matrices(free + turn, driven, noise)


def by_circle(noise: Poisson, p: tuple[float, ...], factor: float, most: float, **wall):
    """Λ(p) and λ of the spring by Fourier series; a wall keeps a share of the speed."""
    problem = spring(noise, **wall)
    steady, driven = matrices_of(problem)
    made = phase_circle.impulses(steady, driven[""], noise.rate, noise.sizes, noise.shares)
    series = {each: partial(phase_circle.moment_exponent, made, each, 60, factor) for each in p}
    source = f"Fourier series of impulses {noise.sizes} R {factor}"
    rate = partial(phase_circle.lyapunov_exponent, made, 60, factor)
    return [*moments(problem, series, 1e-12, most, source), Row(problem, exponent(), rate, 1e-12, most, source)]


ROWS = [
    *by_circle(EVEN, (-0.5, 1.0), 1.0, 1e-8),
    *by_circle(UNEVEN, (-0.5, 1.0), 1.0, 1e-8),
    *by_circle(EVEN, (1.0, 2.0), 0.8, 3e-8, walls=[{"at": "x = 0", "restitution": 0.8}]),
    *(
        row
        for noise in (EVEN, UNEVEN)
        for quantity in (moment, closed)
        for row in even_rows(spring(noise), "impulses on a spring", 3e-8, quantity=quantity)
    ),
    *even_rows(spring(Poisson(rate=1.0, sizes=(-1e3, 1e3))), "impulses of 1000x, by which x is multiplied", 1e3),
    *(row for seed in range(4) for row in even_rows(random_system(seed), f"random system under impulses {seed}", 1e-6)),
]
