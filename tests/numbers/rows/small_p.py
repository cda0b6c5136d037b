"""Λ(p) next to p = 0, where its error falls with p; published bounds of Λ″(0) and of the least Λ."""

from functools import cache, partial

import numpy as np

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.exponent import second_derivative
from fpsolve.model import White
from tests.kit import matrices
from tests.numbers.values import Quantity, Row, moment, slope, slope_by, variance_rate

SHEAR = matrices([[-1.0, 0.0], [5.0, -1.0]], [[0.0, -1.0], [1.0, 0.0]], White(s=1.0))
"""dx = [[−1, 0], [5, −1]]x dt + Jx ∘ dW, of arXiv 2408.12556."""
UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
UNIFORM = matrices([[-0.1, 1.0], [-1.0, -0.1]], np.eye(2), UNIT)
"""ẋ = (J − 0.1 + ξ)x: ln ‖x(t)‖ = −0.1t + ∫ξ is normal."""


def least() -> Quantity:
    """The least Λ(p), by Newton's steps from p = 0.3."""

    def solved(problem: Problem) -> tuple[float, float]:
        solver, p = ExponentSolver(problem, rtol=1e-10), 0.3
        for _ in range(5):
            pair = solver.pair(p)
            p -= pair.derivative / second_derivative(pair)
        found = solver.method.row(p)
        return found.value, found.error

    return Quantity("min Λ", solved)


STRONG = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0), UNIT)
RAY = matrices([[-1.0, 1.0], [0.0, -2.0]], np.eye(2), UNIT)
THREE = matrices(*np.random.default_rng(7).uniform(-1, 1, (2, 3, 3)), White(s=1.0))


@cache
def series(problem: Problem):
    """A polynomial through Λ(p)/p at larger p."""
    solver, x = ExponentSolver(problem, rtol=1e-10), 0.3 * np.cos(np.pi * (np.arange(14) + 0.5) / 14)
    return np.polynomial.Chebyshev.fit(x, [solver.pair(p).value / p for p in x], 13)


def ratio(problem: Problem, p: float) -> float:
    return p * series(problem)(p)


def rise(problem: Problem, p: float) -> float:
    return series(problem)(p) + p * series(problem).deriv()(p)


def by_lambda(key: str) -> float:
    return 1e-9 * slope_by(key, 0.0).solved(STRONG)[0]


def linear(problem: Problem, p: float, **options) -> float:
    return p * ExponentSolver(problem, **options).lyapunov_exponent().value


TINY = (-2.2e-16, 1e-9, -1e-12, 5e-324, -1e-300, 3e-7, 0.0)
ROWS = [
    *(
        Row(UNIFORM, moment(p), -0.1 * p + 0.5 * p**2, p**2 + 5e-324, 1e-8 * abs(p) + 5e-324, "normal law")
        for p in TINY
    ),
    *(Row(UNIFORM, moment(p), -0.1 * p + 0.5 * p**2, 1e-15, 1e-8, "normal law") for p in (1e-3, -0.4)),
    *(Row(RAY, moment(p), p**2 / 2 - p, p**2, 1e-8 * abs(p), "normal law along a ray") for p in (-2.2e-16, 1e-9)),
    *(
        Row(
            problem,
            moment(p, **options),
            partial(linear, problem, p, **options),
            10 * p**2,
            most * abs(p),
            f"λp, {name}",
            slow,
        )
        for name, problem, options, most, slow in (
            ("white", SHEAR, {}, 1e-7, False),
            ("strong", STRONG, {}, 1e-7, False),
            ("three variables", THREE, {"rtol": 1e-2}, 0.1, True),
        )
        for p in (1e-9, -2.2e-16)
    ),
    *(
        Row(
            problem,
            of(p, rtol=1e-10),
            partial(value, problem, p),
            doubt,
            1e-7,
            f"polynomial through larger p {k}",
            slow,
        )
        for k, (problem, slow) in enumerate(((SHEAR, False), (STRONG, True)))
        for p in (-1.001e-3, -0.999e-3, -3e-4, 1e-5, 0.999e-3, 1.001e-3)
        for of, value, doubt in ((moment, ratio, 1e-13 * abs(p)), (slope, rise, 1e-8))
    ),
    *(
        Row(STRONG, slope_by(key, 1e-9), partial(by_lambda, key), 1e-15, 1e-15, "1e-9 ∂λ", slow=key != "noise.sigma")
        for key in ("noise.sigma", "oscillator.restitution")
    ),
    Row(SHEAR, variance_rate(rtol=1e-10), 0.6577880800662, 5e-14, 1e-9, "enclosure by a computer-assisted proof"),
    Row(SHEAR, least(), -0.0947751140996, 5e-14, 1e-9, "enclosure by a computer-assisted proof"),
]
