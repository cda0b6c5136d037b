"""What one number may cost: foreseen by counting, in time and memory, and of no effect on what is found."""

import math

import pytest

from fpsolve import ExponentSolver, Problem
from fpsolve.analysis.excursions import solve_excursion
from fpsolve.analysis.sensitivity import Gradient
from fpsolve.budget import Countdown, charge, counted, under_way, watched
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget, critical_restitution, impact_rate
from fpsolve.exponent.root import nonzero_root
from tests.conftest import FIG1, FIG1_NOISE

PROBLEM = Problem(FIG1, FIG1_NOISE)
RATES = "v", "-x - 0.1*v - load*x - sway*v"
NUMBERS = {
    "Λ(2)": lambda solver: solver.solution(2.0).pair.value,
    "λ": lambda solver: solver.lyapunov_exponent().value,
    "Λ″(0)": lambda solver: solver.variance_rate().value,
    "δ_p": lambda solver: nonzero_root(solver).value,
    "N": lambda solver: impact_rate(solver).value,
    "r_c": lambda solver: critical_restitution(solver).value,
    "∂Λ(2)/∂θ": lambda solver: Gradient(solver, {"D0": PROBLEM.derivative("noise.D0")}).moment(2.0)["D0"].value,
    "∂Λ″(0)/∂θ": lambda solver: Gradient(solver, {"D0": PROBLEM.derivative("noise.D0")}).variance_rate()["D0"].value,
    "the bounds of P(sup ‖x‖ ≥ A)": lambda solver: solve_excursion(solver).upper.value,
}
"""By the names that messages have for them."""


def problem_of(name):
    """λ < 0 for excursions."""
    return PROBLEM.at({"oscillator.c1": -1.0}) if name.startswith("the bounds") else PROBLEM


class Ticks:
    """A time of the processor that passes by one second whenever it is asked for."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        self.now += 1.0
        return self.now


@pytest.fixture
def ticks(monkeypatch):
    found = Ticks()
    monkeypatch.setattr("fpsolve.budget.time.thread_time", found)
    return found


@pytest.mark.parametrize("name", NUMBERS)
def test_a_budget_ends_a_number_and_never_changes_it(name, ticks):
    """With what it has cost a number is the same to the last bit, with much less there is none, and it is said."""
    solve, problem, begin = NUMBERS[name], problem_of(name), ticks.now
    value = solve(ExponentSolver(problem, budget=Budget(seconds=1e6)))
    spent = ticks.now - begin
    assert solve(ExponentSolver(problem, budget=Budget(seconds=spent))) == value
    for share in (0.1, 0.02):
        with pytest.raises(NotConverged, match=r" did not converge: .* more than budget\.seconds = .*budget$"):
            solve(ExponentSolver(problem, budget=Budget(seconds=share * spent)))


def test_what_has_ended_the_exponent_is_not_spent_again_on_the_index(ticks):
    """δ_p begins with λ; before, it took as long once more, and ended alike."""
    solver = ExponentSolver(PROBLEM, budget=Budget(seconds=0.5))
    with pytest.raises(NotConverged, match=r"^λ did not converge"):
        solver.lyapunov_exponent()
    again = Countdown(math.inf)
    with again.running(), pytest.raises(NotConverged, match=r"^λ did not converge"):
        nonzero_root(solver)
    assert again.unknowns == 0


def test_parts_of_a_number_are_counted_with_it(monkeypatch):
    now, seen, inner = [0.0], [], Countdown(1.0, "inner")
    monkeypatch.setattr("fpsolve.budget.time.thread_time", lambda: now[0])
    with watched(lambda each: seen.append((each.name, each.unknowns, each.seconds))), Countdown(9.0).running() as line:
        with counted(Countdown(5.0, "outer")), counted(inner):
            now[0] += 2.0
            charge(70)
            assert under_way().name == "outer"
        now[0] += 6.0
        outer = Countdown(5.0, "outer", before=6.0)
        told = r"^outer did not converge: .* 6 s .* budget\.seconds = 5; use a"
        with pytest.raises(NotConverged, match=told), counted(outer), counted(inner):
            charge(80)
    assert inner.spent == 0
    assert line.spent == 8.0
    assert seen == [("outer", 70, 5.0)]
