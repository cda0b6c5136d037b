"""Λ(p) of four variables with a stop: simulations, systems without one that are alike in law, the oscillator, R."""

import pytest

from fpsolve.exponent import ExponentSolver
from fpsolve.model import PlaneSystem, Problem, Telegraph, White

NAMES = "q1", "v1", "q2", "v2"
TELEGRAPH = Telegraph(a=0.5, k=0.7)


def coupled(restitution, coupling=0.3, noise=TELEGRAPH):
    rates = (
        "v1",
        f"-0.1*v1 - (1 + xi)*q1 - {coupling}*(1 + xi)*q2",
        "v2",
        f"-0.16*v2 - (2.56 + xi)*q2 - {coupling}*(1 + xi)*q1",
    )
    walls = [{"at": "q1 = 0", "restitution": "R"}]
    return Problem(PlaneSystem.of_equations(NAMES, rates, {"R": restitution}, walls=walls), noise)


def white_coupling(strength, walls=()):
    rates = "v1", f"-0.1*v1 - q1 + {strength}*xi*q2", "v2", f"-0.16*v2 - 2.56*q2 + {strength}*xi*q1"
    return Problem(PlaneSystem.of_equations(NAMES, rates, walls=walls), White(0.7))


def test_an_elastic_stop_under_white_noise_in_the_coupling_changes_no_law():
    """|q₁| of the system without it: an impact turns the sign of dW, which remains white noise."""
    elastic = white_coupling(0.8, [{"at": "q1 = 0", "restitution": 1.0}])
    found, expected = ExponentSolver(elastic, rtol=1e-4).solution(-1), ExponentSolver(white_coupling(0.8)).solution(-1)
    assert abs(found.pair.value - expected.pair.value) <= found.error + expected.error < 1e-5


def test_an_uncoupled_mode_leaves_the_oscillator_with_a_wall():
    whole = coupled(0.8, 0)
    wall = [{"at": "q = 0", "restitution": 0.8}]
    rates = "v", "-0.1*v - (1 + xi)*q"
    alone = Problem(PlaneSystem.of_equations(("q", "v"), rates, walls=wall), TELEGRAPH)
    assert whole.block_names == ("(q1, v1)", "(q2, v2)")
    of_blocks = ExponentSolver(whole).classes
    for p in (1.0, -1.5):
        expected = ExponentSolver(alone).moments(p).value
        assert ExponentSolver(of_blocks[0].problem).moments(p).value == pytest.approx(expected, rel=1e-7)


@pytest.mark.slow
def test_two_codes_simulated_the_same():
    """λ, Λ(1) and Λ(2) by paths and by a transfer operator, with three standard errors of these."""
    solver = ExponentSolver(coupled(0.8), rtol=1e-4)
    found = [solver.estimate(p, solver.solution(p)) for p in (1.0, 2.0)]
    for each, (value, error) in zip(found, ((-0.08109, 4e-5), (-0.15844, 7e-5)), strict=True):
        assert abs(each.value - value) <= 3 * error
        assert each.error_estimate < 1e-5
