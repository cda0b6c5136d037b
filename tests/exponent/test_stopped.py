"""Λ(p) of four variables with a stop: simulations, systems without one that are alike in law, the oscillator."""

from dataclasses import replace

import numpy as np
import pytest

from fpsolve.exponent import ExponentSolver
from fpsolve.exponent.adapt import Budget, WholeProblem
from fpsolve.exponent.starts import Question
from fpsolve.exponent.stopped import StopStart, stop_start
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


@pytest.mark.slow
def test_an_elastic_stop_under_white_noise_in_the_coupling_changes_no_law():
    """|q₁| of the system without it: an impact turns the sign of dW, which remains white noise."""
    elastic = white_coupling(0.8, [{"at": "q1 = 0", "restitution": 1.0}])
    found, expected = (ExponentSolver(each, rtol=1e-3).solution(-1) for each in (elastic, white_coupling(0.8)))
    assert abs(found.pair.value - expected.pair.value) <= found.error + expected.error < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("noise", [TELEGRAPH, White(s=0.35)])
def test_a_mode_that_drives_another_has_the_exponents_of_the_oscillator_with_a_wall(noise):
    """Of the block by itself, and of both together by elements of the half sphere."""
    walls = [{"at": "q1 = 0", "restitution": 0.63}]
    rates = "v1", "-q1 - 0.1*v1 - 0.8*xi*q1", "v2", "-3.4*q2 - 0.9*v2 - 0.5*xi*q2 + 0.2*q1"
    whole = Problem(PlaneSystem.of_equations(NAMES, rates, walls=walls), noise)
    alone = ExponentSolver(Problem(PlaneSystem.of_equations(NAMES[:2], rates[:2], walls=walls), noise))
    expected = alone.pair(1.0).value
    assert whole.block_names == ("(q1, v1)", "(q2, v2)")
    assert ExponentSolver(whole.classes[0]).pair(1.0).value == pytest.approx(expected, rel=1e-7)
    by_elements = WholeProblem(whole, rtol=1e-4, budget=Budget(), tolerance=lambda p, value: 5e-5)
    found = by_elements.solution(1.0)
    assert abs(found.pair.value - expected) <= found.error < 5e-5


@pytest.mark.slow
def test_units_change_nothing_but_the_rate():
    """Time in 1/1000, and q₂ in 1/10: in these units the motion is solved in coordinates of its own."""
    rates = "v1", "-100*v1 - 1e6*(1 + xi)*q1 - 3e4*(1 + xi)*q2", "v2", "-160*v2 - 1e6*(2.56 + xi)*q2 - 3e6*(1 + xi)*q1"
    walls = [{"at": "q1 = 0", "restitution": 0.8}]
    scaled = Problem(PlaneSystem.of_equations(NAMES, rates, walls=walls), Telegraph(a=0.5, k=700.0))
    assert scaled.frame is not None
    found, expected = (ExponentSolver(each, rtol=1e-3).solution(2.0) for each in (scaled, coupled(0.8)))
    assert found.pair.value / 1000 == pytest.approx(expected.pair.value, rel=1e-9)
    assert abs(expected.pair.value + 0.15844) <= expected.error + 3 * 7e-5 < 1e-3  # by paths, ± 7e-5


@pytest.mark.slow
def test_two_codes_simulated_the_same():
    """λ and Λ(1) by paths and by a transfer operator, with three standard errors of these."""
    solver = ExponentSolver(coupled(0.8), rtol=1e-3)
    found = solver.estimate(1.0, solver.solution(1.0)), solver.lyapunov_exponent()
    for each, (value, error) in zip(found, ((-0.08109, 4e-5), (-0.082631, 2e-5)), strict=True):
        assert abs(each.value - value) <= 3 * error + each.error_estimate < 4e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "degrees", "least"),
    [("degree", (2, 6, 10), 2.5), ("first_degree", (2, 8, 12), 6), ("waves", (2, 6, 10), 4)],
)
def test_orders_of_convergence(name, degrees, least):
    """Of Λ(1) in η, in θ₁ and in θ₂ alone, against the highest degree, as powers of the degree."""
    problem = coupled(0.8)
    first = stop_start(Question(problem, 1.0, 1e-3, {}))
    coarse = replace(first.space.phi, first_degree=6, waves=2 if name == "degree" else 4)
    values, near = [], None
    for degree in degrees:
        near = StopStart(problem, first.space.with_axis(0, replace(coarse, **{name: degree}))).pair(1.0, near)
        values.append(near.value)
    errors = np.abs(np.array(values[:2]) - values[2])
    assert np.log(errors[0] / errors[1]) / np.log(degrees[1] / degrees[0]) > least
