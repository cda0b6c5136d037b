"""A wall is a point load, and only that: T = exp(pγ) u with γ′ = Σ ± ln R/π makes u continuous, and q into q + γ′ h."""

import math
from dataclasses import dataclass
from functools import cached_property

import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.exponent.eigen import rayleigh_iteration
from fpsolve.fem import Generator
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, White
from fpsolve.model.plane import Harmonics, LinearMotion
from tests.conftest import FIG1, FIG1_NOISE

FREE = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2)))
DRIVEN = CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity)
DAMPED = CoefficientMatrix(1, ((0.0, 0.0), (0.0, -1.0)), identity)
BACK = CoefficientMatrix(0, ((0.0, -1.0), (1.0, -0.2)))
WALL = Jump(math.pi / 2, math.log(0.6))
SAME = 1e-11
"""Share of the scale of Λ(p) within which both agree: the functions are the same, what is left is rounding."""


@dataclass(frozen=True)
class Gauged(CoefficientMatrix):
    """A term with q + γ′ h in place of q."""

    rise: float = 0.0

    @cached_property
    def q(self) -> Harmonics:
        q, h = CoefficientMatrix(0, self.matrix).q, self.h
        return Harmonics(*(a + self.rise * b for a, b in ((q.mean, h.mean), (q.cosine, h.cosine), (q.sine, h.sine))))


class WithoutJumps(Problem):
    """The problem of u."""

    @property
    def rise(self) -> float:
        own = Problem(self.system, self.noise)
        senses = [math.copysign(1.0, v) for v in own.wall_speeds(own.motion)]
        return sum(sense * jump.log_factor for sense, jump in zip(senses, own.motion.jumps, strict=True)) / math.pi

    def gauged(self, terms):
        return [Gauged(each.order, each.matrix, each.g, each.noise, self.rise) for each in terms]

    @cached_property
    def motion(self):
        return LinearMotion(self.system.epsilon, tuple(self.gauged(Problem(self.system, self.noise).motion.terms)))

    @cached_property
    def diffusions(self):
        return self.gauged(Problem(self.system, self.noise).diffusions)


def walled(noise, *terms, jumps=(WALL,)):
    return Problem(PlaneSystem(terms or [FREE, DRIVEN], jumps), noise)


@pytest.mark.parametrize(
    ("problem", "p"),
    [
        *[
            pytest.param(walled(noise), p, id=f"{name}, {strength}")
            for name, noises in {
                "OU": [OrnsteinUhlenbeck(alpha=1.0, sigma=sigma) for sigma in (0.2, 1.0, 1.6)],
                "Eq. (7)": [NonGaussianNoise(D0=D0, tau0=0.8, r0=0.8) for D0 in (0.02, 0.3, 1.0)],
                "telegraph": [MarkovChain.telegraph(a, 0.7) for a in (0.2, 0.8, 1.4)],
                "white": [White(s=s) for s in (0.2, 0.7, 1.5)],
            }.items()
            for strength, noise, p in zip(("weak", "medium", "strong"), noises, (2.0, -0.5, 1.0), strict=True)
        ],
        pytest.param(Problem(FIG1, FIG1_NOISE), 2.0, id="the paper's oscillator"),
        pytest.param(walled(OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)), -3.0, id="p < -1"),
        pytest.param(walled(OrnsteinUhlenbeck(alpha=0.3, sigma=1.2)), 1.0, id="slow", marks=pytest.mark.slow),
        pytest.param(walled(White(s=0.5), FREE, DAMPED, jumps=(WALL, Jump(0.0, 0.2))), 2.0, id="two walls"),
        pytest.param(walled(White(s=0.5), BACK, DRIVEN), 2.0, id="backward, white"),
        pytest.param(walled(OrnsteinUhlenbeck(alpha=1.0, sigma=0.5), BACK, DRIVEN), 2.0, id="backward, OU"),
    ],
)
def test_a_wall_is_a_growth_with_the_phase(problem, p):
    """Λ(p) with the point load, and with q + γ′ h and no jump on the same functions."""
    solver = ExponentSolver(problem, rtol=1e-10)
    found = solver.solution(p)
    free = Generator(WithoutJumps(problem.system, problem.noise), found.pair.generator.chosen)
    assert not free.problem.motion.jumps
    pencil, vectors = free.at(p), [free.space(p).constant] * 2
    factors = pencil.factorised(found.pair.value + 1e-4)
    for _ in range(4):
        vectors = [factors.solve(pencil.space.weighed(each), transposed=k == 1) for k, each in enumerate(vectors)]
    value = rayleigh_iteration(pencil, *vectors).value
    scale = max(solver.scale(p), abs(found.pair.value))
    assert value == pytest.approx(found.pair.value, abs=SAME * scale, rel=0)
