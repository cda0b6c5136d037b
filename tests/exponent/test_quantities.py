"""The table of quantities is complete, its records solve what they say, and two of them are public functions."""

from typing import get_args

import pytest

import fpsolve
from fpsolve import OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.exponent import INDICES, QUANTITIES
from fpsolve.exponent.quantities import DrawnName, QuantityName
from tests.conftest import FIG1, FIG1_NOISE
from tests.oracles import perturbation

WEAK_NOISE = FIG1_NOISE.ou_reduction()


def test_every_name_of_a_case_has_a_record():
    assert tuple(QUANTITIES) == get_args(QuantityName)
    assert set(get_args(DrawnName)) < set(QUANTITIES)
    for name, quantity in QUANTITIES.items():
        assert quantity.name == name
        assert all((quantity.symbol, quantity.title, quantity.equation, quantity.closed_form, quantity.error_source))
    assert {"moment", *INDICES} == set(QUANTITIES)


@pytest.mark.parametrize("name", INDICES)
def test_every_index_is_solved_and_approximated(name, fig1_solver):
    theory = INDICES[name].theory(fig1_solver.problem)
    assert theory == pytest.approx(getattr(perturbation, name)(FIG1, WEAK_NOISE), rel=1e-12)
    for root in (None, -0.36):
        assert INDICES[name].solve(fig1_solver, root).value == pytest.approx(theory, rel=5e-3)


@pytest.mark.parametrize("solve", [fpsolve.lyapunov_exponent, fpsolve.stability_index])
def test_public_functions(solve, fig1_solver):
    problem = Problem(FIG1, WEAK_NOISE)
    found, again = solve(problem), solve(problem, rtol=1e-6)
    assert found.value == pytest.approx(INDICES[solve.__name__].solve(fig1_solver, None).value, rel=1e-7)
    assert abs(again.value - found.value) <= 2 * (again.error_estimate + found.error_estimate)
    for rtol in (-1.0, 1e-13, 1.0, float("nan")):
        with pytest.raises(ValueError, match=r"got rtol = .*; must be > 1e-13 and < 1; write, for example, 1e-8"):
            solve(problem, rtol=rtol)


def test_there_may_be_no_stability_index():
    oscillator = VibroImpactOscillator(omega=10.0, restitution=0.5, c1=-1.0, epsilon=0.1)
    assert not fpsolve.stability_index(Problem(oscillator, OrnsteinUhlenbeck(alpha=1.0, sigma=0.3)))
