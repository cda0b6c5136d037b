"""A wall is a point load, and only that: T = exp(pγ) u with γ′ = Σ ± ln R/π turns it into q + c h, without any jump."""

import math

import pytest

from fpsolve.arrays import identity
from fpsolve.exponent.eigen import rayleigh_iteration
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.generator import Generator
from fpsolve.model.noises.markov_chain import MarkovChain
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.model.noises.white import White
from fpsolve.model.plane import CoefficientMatrix, Harmonics, Jump
from fpsolve.model.problem import Problem
from fpsolve.model.systems.plane_system import PlaneSystem
from tests.conftest import FIG1, FIG1_NOISE

FREE = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2)))
DRIVEN = CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity)
DAMPED = CoefficientMatrix(1, ((0.0, 0.0), (0.0, -1.0)), identity)
BACK = CoefficientMatrix(0, ((0.0, -1.0), (1.0, -0.2)))
WALL = Jump(math.pi / 2, math.log(0.6))


def stretched(terms, noise, *jumps):
    return Problem(PlaneSystem(terms, jumps or [WALL]), noise)


@pytest.mark.parametrize(
    ("problem", "p", "way"),
    [
        (Problem(FIG1, FIG1_NOISE.ou_reduction()), 2.0, 1),
        (Problem(FIG1, FIG1_NOISE), 2.0, 1),
        (stretched([FREE, DRIVEN], OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)), 2.0, 1),
        (stretched([FREE, DRIVEN], OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)), -3.0, 1),
        (stretched([FREE, DRIVEN], OrnsteinUhlenbeck(alpha=0.3, sigma=1.2)), 1.0, 1),
        (stretched([FREE, DRIVEN], MarkovChain.telegraph(1.4, 0.7)), 1.0, 1),
        (stretched([FREE, DAMPED], White(s=0.5), WALL, Jump(0.0, 0.2)), 2.0, 1),
        (stretched([BACK, DRIVEN], White(s=0.5)), 2.0, -1),
    ],
    ids=["fig1", "Eq. (7)", "strong", "p < 0", "slow", "telegraph", "white, two walls", "backward"],
)
def test_a_wall_is_a_growth_with_the_phase(problem, p, way, monkeypatch):
    """On the same functions, without the wall: Λ(p) to 1e-10."""
    walled = ExponentSolver(problem, rtol=1e-10).solution(p)
    assert walled.error < 1e-8 * max(1.0, abs(walled.pair.value))
    c = way / math.pi * sum(jump.log_factor for jump in problem.system.jumps)
    own = Problem(PlaneSystem(problem.system.terms, (), problem.system.epsilon), problem.noise)
    growth = CoefficientMatrix.q.func

    def gauged(term):
        q, h = growth(term), term.h
        return Harmonics(q.mean + c * h.mean, q.cosine + c * h.cosine, q.sine + c * h.sine)

    monkeypatch.setattr(CoefficientMatrix, "q", property(gauged))
    free = Generator(own, walled.pair.generator.chosen)
    assert not free.problem.motion.jumps
    pencil, vectors = free.at(p), [free.space(p).constant] * 2
    factors = pencil.factorised(walled.pair.value + 1e-4)
    for _ in range(4):
        vectors = [factors.solve(pencil.space.weighed(each), transposed=k == 1) for k, each in enumerate(vectors)]
    found = rayleigh_iteration(pencil, *vectors)
    assert found.value == pytest.approx(walled.pair.value, abs=1e-10)
