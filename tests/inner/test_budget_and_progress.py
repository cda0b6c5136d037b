"""Internals of budgets, which end a number and never change it, and of the progress that shows them."""

import io
import re
from functools import partial

import numpy as np
import pytest
from rich.console import Console

from fpsolve import ExponentSolver, NotConverged, Problem
from fpsolve.budget import Meter, begin, charge, timed, watched
from fpsolve.exponent import Budget, critical_restitution, impact_rate, solve_moments
from fpsolve.exponent.root import nonzero_root
from fpsolve.tell import Phase
from fpsolve.tell.progress import MOMENTS, SETS, Bars
from tests.conftest import FIG1, FIG1_NOISE, sampled


class Clock:
    """A time that passes as it is told, or by `tick` whenever it is asked for."""

    now, tick = 100.0, 0.0

    def __call__(self):
        self.now += self.tick
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture(autouse=True)
def processor(monkeypatch):
    found = Clock()
    monkeypatch.setattr("fpsolve.budget.time.thread_time", found)
    return found


NUMBERS = {
    "Λ(2)": lambda solver: solver.solution(2.0).pair.value,
    "λ": lambda solver: solver.lyapunov_exponent().value,
    "Λ″(0)": lambda solver: solver.variance_rate().value,
    "δ_p": lambda solver: nonzero_root(solver).value,
    "N": lambda solver: impact_rate(solver).value,
    "r_c": lambda solver: critical_restitution(solver).value,
}


@pytest.mark.parametrize("name", sampled(*NUMBERS, keep=3))
def test_budget_ends_a_number_and_never_changes_it(name, processor):
    processor.tick, begin, problem = 1.0, processor.now, Problem(FIG1, FIG1_NOISE)
    value = NUMBERS[name](ExponentSolver(problem, budget=Budget(seconds=1e6)))
    spent = processor.now - begin
    assert NUMBERS[name](ExponentSolver(problem, budget=Budget(seconds=spent))) == value
    with pytest.raises(
        NotConverged, match=r"needs some .* s of processor time; the limit is .* s \(try --set budget\.seconds=.*less$"
    ):
        NUMBERS[name](ExponentSolver(problem, budget=Budget(seconds=0.1 * spent)))


def test_budget_ends_a_curve_and_never_changes_it(processor):
    """Both ends and the middle of the p are nodes."""

    def solved(seconds):
        solver = ExponentSolver(Problem(FIG1, FIG1_NOISE), rtol=1e-5, budget=Budget(seconds=seconds))
        found = solve_moments(solver, np.linspace(-2, 2, 17))
        return {*found.value, *found.slope, *found.derivative_error}

    processor.tick, begin = 1.0, processor.now
    whole, spent = solved(1e6), processor.now - begin
    for share in (0.3, 0.6, 0.9):
        assert {each for each in solved(share * spent) if not np.isnan(each)} <= whole


def test_numbers_of_a_set_have_one_meter_and_its_watch_sees_which_is_solved(processor):
    seen, meter = [], Meter(5.0, planned=4)
    with watched(lambda each: seen.append((each.number, each.count, each.unknowns))), meter.running():
        begin("λ")
        with Meter(1.0).running() as inner:  # a part of it
            processor.now += 2.0
            charge(70)
        begin("Λ(2)")
        processor.now += 4.0
        refused = partial(pytest.raises, NotConverged)
        with refused(match=r" 10 s .* limit is 5 s \(try --set budget\.seconds=20\)"):  # two are left, of 2 s each as λ
            charge(80)
        begin("Λ(3)")
        with refused(match=r" 10 s "):  # as before
            charge(80)
    assert (inner, meter.spent, seen) == (meter, 6.0, [("λ", 1, 70)])


def test_work_that_would_not_end_in_time_at_the_pace_of_the_last_one_is_not_begun(processor):
    with Meter(5.0).running():
        with timed(70):
            processor.now += 1.0
        with pytest.raises(NotConverged):
            timed(281).__enter__()  # 4.01 s


SOLVING = Phase("case", "solving", 400, SETS)


def bars_of(clock, **options):
    return Bars(Console(file=io.StringIO(), **options), clock)


def test_file_gets_a_line_each_tenth_of_a_long_phase_and_none_of_a_short_one(clock):
    for seconds, expected in ((1.0, (240, 280, 320, 360)), (0.02, ())):
        bars = bars_of(clock)
        with bars.bar(SOLVING) as advance:
            advance(200, known=True)  # of an earlier run, which tell nothing of the time to go
            for number in range(200):
                clock.now += seconds
                advance(failed=number == 3)
        told = [f"case, solving: {n} of 400 sets, 1 failed" for n in expected]
        assert bars.console.file.getvalue().splitlines() == told


@pytest.mark.parametrize("width", [60, 80, 120])
def test_terminal_shows_a_phase_and_what_a_number_waits_for_in_lines_that_fit(clock, processor, width, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    lines = []
    for phase in (SOLVING, Phase("mathieu", "solving", 11, MOMENTS)):
        bars = bars_of(clock, width=width, force_terminal=True, color_system=None, legacy_windows=False)
        with bars.bar(phase) as advance, Meter(60.0, planned=5, count=2).running():
            begin("Λ″(0)")
            if phase == SOLVING:
                advance(100, known=True)
                for failed in (0, 3):
                    clock.now += 30.0
                    advance(15, failed=failed)
            else:
                processor.now += 39.0
                charge(12_400)
            bars._display.refresh()
        lines += re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", bars.console.file.getvalue()))
    assert any("130 of 400 sets, 3 failed" in line and "0:09:00" in line for line in lines)
    assert any("Λ″(0), 3 of 5, 12,400 unknowns, at most 21 s" in line for line in lines)
    assert max(map(len, lines)) <= width
