"""Systems whose phase never leaves a ray: Λ(p) for p > 0 is the larger of two scalar ones, known in closed form."""

import math

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.function import nonzero_root
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, Problem, White

NOISES = {
    "OU": OrnsteinUhlenbeck(alpha=1.0, sigma=0.7),
    "white": White(0.7),
    "telegraph": MarkovChain.telegraph(0.5, 1.0),
}


def scalar(noise, p, growth, strength):
    """Λ(p) of ȧ = (growth + strength ξ) a: from the Gaussian ∫ξ dt, or the two states."""
    if noise is NOISES["telegraph"]:
        return p * growth - 1 + math.sqrt(1 + (0.5 * p * strength) ** 2)
    return p * growth + 0.5 * (p * strength) ** 2 * noise.spectral_density(0.0)


def system(free, driven, jumps=()):
    return PlaneSystem([CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)], jumps)


SYSTEMS = {
    "triangular": (system(((-0.3, 0.0), (0.5, -1.0)), ((0.4, 0.0), (0.2, -1.0))), [(-0.3, 0.4), (-1.0, -1.0)]),
    "the other way": (system(((-1.0, 0.0), (0.5, -0.3)), ((-0.2, 0.0), (0.2, 0.4))), [(-1.0, -0.2), (-0.3, 0.4)]),
    "diagonal": (system(((-0.3, 0.0), (0.0, -0.1)), ((0.4, 0.0), (0.0, 1.0))), [(-0.3, 0.4), (-0.1, 1.0)]),
}


def turned(own, angle):
    """The same system in rotated coordinates."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    return PlaneSystem(
        [CoefficientMatrix(each.order, (turn @ np.array(each.matrix) @ turn.T).tolist(), each.g) for each in own.terms]
    )


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_moments_are_the_larger_of_two(name, noise):
    own, blocks = SYSTEMS[name]
    p = np.array([0.5, 1.0, 2.0, 3.5])
    expected = np.max([[scalar(noise, each, *block) for each in p] for block in blocks], axis=0)
    for problem in (Problem(own, noise), Problem(turned(own, 0.7), noise)):
        assert problem.invariant_ray is not None
        solver = ExponentSolver(problem)
        found = solver.moments(p)
        assert np.all(np.abs(found.value - expected) <= found.error_estimate + 1e-14)
        assert found.error_estimate.max() < 1e-8
        exponent = solver.lyapunov_exponent()
        assert abs(exponent.value - max(growth for growth, _ in blocks)) <= exponent.error_estimate + 1e-14 < 1e-8


def test_index():
    """Of −0.3p + 0.08·0.49p² and −0.1p + 0.5·0.49p² the latter is 0 at p = 0.1/0.245 first, where the other is < 0."""
    index = nonzero_root(ExponentSolver(Problem(SYSTEMS["diagonal"][0], NOISES["white"])))
    assert index.value == pytest.approx(0.1 / 0.245, rel=1e-8)


def test_one_number_for_all_rays():
    """ẋ = (−0.1 + ξ) x has no phase to speak of, and Λ(p) for negative p too."""
    both = system(((-0.1, 0.0), (0.0, -0.1)), ((1.0, 0.0), (0.0, 1.0)))
    found = moment_lyapunov(both, NOISES["OU"], [-2.0, 2.0])
    np.testing.assert_allclose(found.value, [scalar(NOISES["OU"], p, -0.1, 1.0) for p in (-2.0, 2.0)], atol=1e-9)


def test_refused():
    own, _ = SYSTEMS["triangular"]
    with pytest.raises(NoSuchExponent, match=r"never leaves the ray at 1\.5708, .* choose p > 0"):
        moment_lyapunov(own, NOISES["OU"], -0.5)
    with pytest.raises(NoSuchExponent, match="leave jumps out"):
        moment_lyapunov(PlaneSystem(own.terms, [Jump(0.3, -0.1)]), NOISES["OU"], 1.0)
    with pytest.raises(NotConverged, match="no positive eigenfunction"):
        ExponentSolver(Problem(own, NOISES["OU"])).pair(1.0)


def test_others_have_none():
    for free in (((0.0, 1.0), (-1.0, 0.0)), ((0.0, 1.0), (1.0, 0.0)), ((0.0, 1.0), (0.0, 0.0))):
        assert Problem(system(free, ((0.0, 0.0), (-1.0, 0.0))), NOISES["OU"]).invariant_ray is None
