"""Rays that stretch and that noise lets the phase pass both ways: T is singular where it turns."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fpsolve.analysis.sensitivity import sensitivities
from fpsolve.arrays import identity
from fpsolve.exponent.corners import corners
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.mesh import make_mesh
from fpsolve.model.noises.markov_chain import MarkovChain
from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.model.plane import CoefficientMatrix, Jump
from fpsolve.model.problem import Problem
from fpsolve.model.systems.plane_system import PlaneSystem
from tests.conftest import sampled
from tests.oracles import two_way_rays

ROTATION, STIFFNESS = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0))
FREE, DRIVEN = CoefficientMatrix(0, ROTATION), CoefficientMatrix(1, STIFFNESS, identity)
NOISE = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
SYSTEM = PlaneSystem([FREE, DRIVEN], [Jump(0.4, math.log(0.8))])
PROBLEM = Problem(SYSTEM, NOISE)
TURN = -math.sqrt(2) / math.cos(0.4) ** 2
"""z at which dφ/dt = 1 + ξ cos² φ is 0 at the ray, ξ = z/√2."""


@cache
def best(p):
    return ExponentSolver(PROBLEM, rtol=3e-8 if p > 0 else 1e-7).solution(p)


def waves(terms):
    """h and q of a system without and with the noise, as tuples."""
    return tuple(
        tuple(tuple(float(getattr(getattr(term, name), part)) for part in ("mean", "cosine", "sine")) for term in terms)
        for name in ("h", "q")
    )


def test_corners_lie_where_the_phase_turns_at_the_ray():
    [corner] = corners(PROBLEM, 1.0)
    assert (corner.phase, corner.factor) == (0.4, pytest.approx(0.8))
    assert corner.z == pytest.approx(TURN, abs=1e-12)


@pytest.mark.parametrize(
    "problem",
    [
        Problem(SYSTEM, MarkovChain.telegraph(2.0, 1.0)),
        Problem(replace(SYSTEM, jumps=[Jump(0.4, 0.0)]), NOISE),
        Problem(replace(SYSTEM, jumps=[Jump(math.pi / 2, -0.2)]), NOISE),  # dφ/dt = 1 there
        Problem(replace(SYSTEM, epsilon=0.1), NOISE),  # seventeen standard deviations away
    ],
)
def test_where_nothing_is_singular_there_is_no_corner(problem):
    assert corners(problem, 1.0) == []


def test_the_order_of_convergence():
    """Without a stretch |v| T T* is integrated over a length h, v ~ h: 2. At R^p = 2 nothing converges any more."""
    [corner] = corners(PROBLEM, 1.0)
    assert [replace(corner, factor=factor).order for factor in (1.0, 2.0, 0.0)] == pytest.approx([2, 0, 3])


@pytest.mark.parametrize(
    ("stiffness", "jumps", "noise", "size"),
    sampled(
        (STIFFNESS, [(0.4, math.log(0.8))], NOISE, (60, 120)),
        (((0.1, 0.3), (-1.2, 0.2)), [(1.1, -0.3), (2.7, 0.2)], OrnsteinUhlenbeck(alpha=1.5, sigma=1.1), (70, 140)),
    ),
)
def test_the_exponent_of_a_density_that_is_smooth(stiffness, jumps, noise, size):
    terms = [FREE, CoefficientMatrix(1, stiffness, identity)]
    expected, coarse = (
        two_way_rays.lyapunov_exponent(
            *waves(terms), jumps, alpha=noise.alpha, std=noise.standard_deviation, harmonics=k, polynomials=n
        )
        for k, n in (size, (2 * size[0] // 3, 2 * size[1] // 3))
    )
    assert abs(expected - coarse) < 1e-10
    for rtol in (1e-4, 1e-6):
        problem = Problem(PlaneSystem(terms, [Jump(*jump) for jump in jumps]), noise)
        found = ExponentSolver(problem, rtol=rtol).lyapunov_exponent()
        assert abs(found.value - expected) <= found.error_estimate + 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("distance", [1e-14, 1e-3])
def test_corners_that_are_close(distance):
    """At φ₀ and π − φ₀ the phase turns for the same noise: lines of ξ would be too close for numbers."""
    jumps = [(0.4, -0.2), (math.pi - 0.4 + distance, 0.15)]
    problem = Problem(replace(SYSTEM, jumps=[Jump(*jump) for jump in jumps]), NOISE)
    expected = two_way_rays.lyapunov_exponent(
        *waves(SYSTEM.terms), jumps, alpha=1.0, std=math.sqrt(0.5), harmonics=50, polynomials=100
    )
    found = ExponentSolver(problem, rtol=1e-7).lyapunov_exponent()
    assert abs(found.value - expected) <= found.error_estimate < 1e-7


@pytest.mark.slow
def test_moments_by_finite_volumes():
    """Of the first order: what is left is about as much as half the cells have brought."""
    p = 2.0
    near = ExponentSolver(PROBLEM, rtol=1e-6).solution(p)
    coarse, fine = (
        two_way_rays.moment_lyapunov(
            *waves(SYSTEM.terms),
            (0.4, math.log(0.8)),
            p,
            alpha=1.0,
            std=math.sqrt(0.5),
            phases=n,
            steps=n // 2,
            near=near.pair.value + 0.01,
        )
        for n in (200, 400)
    )
    assert abs(fine - near.pair.value) < 1.2 * abs(fine - coarse) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("p", [1.0, -1.0])
def test_the_error_is_within_its_estimate(p):
    for rtol in (1e-4, 1e-5):
        found = ExponentSolver(PROBLEM, rtol=rtol).solution(p)
        assert abs(found.pair.value - best(p).pair.value) <= found.error + best(p).error


@pytest.mark.parametrize("noise", sampled(*(NonGaussianNoise(D0=1.0, tau0=1.0, r0=r0) for r0 in (0.7, 0.95, 1.1))))
def test_other_noise_has_corners_too(noise):
    """A system stretched by an unstretched one: λ is affine in ln R, and for p = 0 nothing else is singular."""
    values = []
    for log in (-0.2, 0.1, 0.0):
        problem = Problem(replace(SYSTEM, jumps=[Jump(0.4, log)]), noise)
        assert bool(corners(problem, -0.5)) == (log != 0)
        found = ExponentSolver(problem, rtol=1e-6).lyapunov_exponent()
        values.append((found.value, found.error_estimate))
    (low, e1), (high, e2), (free, e3) = values
    assert low / 3 + 2 * high / 3 == pytest.approx(free, abs=e1 / 3 + 2 * e2 / 3 + e3)


@pytest.mark.parametrize("excess", sampled(0.03, 1e-6, 0.003, keep=2))
def test_corners_near_the_end_of_the_noise(excess):
    """There P_s ~ (distance to the end)^(1/6) is singular, and the phase runs backward only beyond the corner."""
    noise = NonGaussianNoise(D0=1.0, tau0=1.0, r0=-5.0)
    epsilon = (1 + excess) / noise.half_width / math.cos(0.4) ** 2
    problem = Problem(replace(SYSTEM, epsilon=epsilon), noise)
    assert len(corners(problem, 1.0)) == (excess > 1e-4)
    rough, fine = (ExponentSolver(problem, rtol=rtol).solution(1.0) for rtol in (1e-4, 1e-6))
    assert abs(rough.pair.value - fine.pair.value) <= rough.error + fine.error


@pytest.mark.parametrize("phase", sampled(-1e-12, 0.0, math.pi, 3 * math.pi / 4 - 2 * math.pi))
def test_cells_are_never_thin_by_rounding(phase):
    problem = Problem(replace(SYSTEM, jumps=[Jump(phase, math.log(0.8))]), NOISE)
    chosen = ExponentSolver(problem, rtol=1e-4).solution(1.0).pair.generator.chosen
    assert np.diff(chosen.noise.lines).min() > 1e-3
    assert np.diff(chosen.phase.lines).min() > 1e-6


@pytest.mark.slow
def test_a_mesh_of_ones_own():
    """The error is larger than what a higher degree changes."""
    problem = Problem(replace(SYSTEM, jumps=[Jump(3 * math.pi / 4, math.log(0.8))]), NOISE)
    given = make_mesh(phi_cells=8, phi_degree=8, xi_cells=16, xi_degree=8)
    found = ExponentSolver(problem, given).solution(1.0)
    best = ExponentSolver(problem, rtol=1e-6).solution(1.0)
    assert abs(found.pair.value - best.pair.value) <= found.error + best.error < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("p", [1.0, -1.0])
def test_the_power_at_a_corner(p):
    """T ~ |ξ − ξ₀|^s at the ray, s = ½ − (3/π) arcsin(R^p/2): H. P. McKean, J. Math. Kyoto Univ. 2, 1963."""
    pair = best(p).pair
    line = pair.space.phi
    trace = np.ravel(line.right_trace[line.vertices_at(0.4)] @ pair.space.table(pair.right))
    slopes = []
    for side in (-1, 1):
        near, far = pair.space.xi.values_at(TURN + side * np.array([0.02, 0.04])) @ trace
        slopes.append(math.log2(far / near))
    assert np.mean(slopes) == pytest.approx(0.5 - 3 / math.pi * math.asin(0.8**p / 2), abs=3e-3)


@pytest.mark.slow
def test_sensitivities():
    """∂Λ/∂ε is that of a difference, though the corner moves with ε."""
    [found] = sensitivities(PROBLEM, 1.0, rtol=1e-5).moments
    low, high = (ExponentSolver(Problem(replace(SYSTEM, epsilon=e), NOISE), rtol=1e-6) for e in (0.99, 1.01))
    slope = (high.solution(1.0).pair.value - low.solution(1.0).pair.value) / 0.02
    assert found["system.epsilon"].value == pytest.approx(slope, rel=1e-3)


@pytest.mark.slow
def test_a_discretisation_for_another_p_is_not_taken_where_there_is_a_corner():
    """At p = 12 the tilted density lies eleven standard deviations out, and polynomials do; at p = 1 they do not."""
    problem = Problem(replace(SYSTEM, epsilon=0.5), OrnsteinUhlenbeck(alpha=0.3, sigma=1.2))
    assert [len(corners(problem, p)) for p in (12.0, 1.0)] == [0, 1]
    solver = ExponentSolver(problem, rtol=1e-5)
    assert solver.solution(12.0).pair.generator.chosen.noise.kind == "polynomials"
    alone, after = ExponentSolver(problem, rtol=1e-5).solution(1.0), solver.solution(1.0)
    assert after.pair.generator.chosen.noise.kind == "cells"
    assert abs(after.pair.value - alone.pair.value) <= alone.error + after.error


def test_what_is_known_of_a_problem_close_by_is_not_taken():
    """Its corner lies elsewhere."""
    close = Problem(replace(SYSTEM, epsilon=1.05), NOISE)
    starts = {1.0: ExponentSolver(close, rtol=1e-4).solution(1.0)}
    found = ExponentSolver(PROBLEM, rtol=1e-4, starts=starts).solution(1.0).pair.generator.chosen
    assert np.min(np.abs(found.noise.lines - TURN)) < 1e-12
