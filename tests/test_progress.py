"""Progress by phases: what is counted, the time to go, and what a file and a terminal see of it."""

import io
import re

import pytest
from rich.console import Console

from fpsolve.budget import charge
from fpsolve.exponent import Budget
from fpsolve.workflow import Phase
from fpsolve.workflow.progress import MOMENTS, PERCENT, POINTS, SETS, SILENT, Bars, counted, seconds_left

SOLVING = Phase("case", "solving", 400, SETS)


class Clock:
    """A time that passes as it is told."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture(autouse=True)
def processor(monkeypatch):
    """The time of the processor, which `spend` passes."""
    found = Clock()
    monkeypatch.setattr("fpsolve.budget.time.thread_time", found)
    return found


def console(width=80, **options):
    return Console(file=io.StringIO(), width=width, **options)


def test_the_time_to_go_follows_from_the_sets_of_this_run_alone(clock):
    bars = Bars(console(), clock)
    with bars.bar(SOLVING) as advance:
        [task] = bars._display.tasks
        advance(300, known=True)
        clock.now += 60.0
        assert seconds_left(task) is None
        advance(20)
        assert seconds_left(task) == pytest.approx(80 * 60.0 / 20)
        assert counted(task) == "320 of 400 sets"


@pytest.mark.parametrize("count", [100, 400, 4000])
@pytest.mark.parametrize("first", [0.0, 2.0, 5.0])
def test_the_first_time_to_go_is_near_the_true_one(clock, count, first):
    """Also where the first set takes longer than a hundred others, as code is compiled and processes start."""
    bars, each, shown = Bars(console(), clock), 0.05, []
    with bars.bar(Phase("case", "solving", count, SETS)) as advance:
        [task] = bars._display.tasks
        for number in range(count):
            clock.now += each + first * (number == 0)
            advance()
            left = seconds_left(task)
            if left is not None and number < count - 1:
                shown.append(left / (each * (count - 1 - number)))
    assert (min(shown) > 1 / 1.5 and max(shown) < 1.5) if shown else count * each + first <= 5.0
    assert len(task.fields["marks"]) < 1000


@pytest.mark.parametrize(
    ("phase", "done", "failed", "told"),
    [
        (SOLVING, 12, 3, "12 of 400 sets, 3 failed"),
        (Phase("case", "solving", 33, MOMENTS), 5, 0, "5 of 33 p"),
        (Phase("case", "simulation", 300, PERCENT), 60, 0, "20%"),
        (Phase("case", "lines", None, POINTS), 17, 0, "17 points"),
        (Phase("case", "figures"), 0, 0, ""),
    ],
)
def test_what_is_counted(phase, done, failed, told, clock):
    bars = Bars(console(), clock)
    with bars.bar(phase) as advance:
        [task] = bars._display.tasks
        if done:
            advance(done, failed=failed)
        clock.now += 10.0
        assert counted(task) == told
        if phase.total is None:
            assert seconds_left(task) is None


def test_a_file_gets_a_line_each_tenth_of_a_long_phase(clock):
    screen = console()
    with Bars(screen, clock).bar(SOLVING) as advance:
        advance(200, known=True)
        for number in range(200):
            clock.now += 1.0
            advance(failed=number == 3)
    lines = screen.file.getvalue().splitlines()
    assert lines == [
        f"case, solving: {n} of 400 sets, 1 failed, 0:0{(400 - n) // 60}:{(400 - n) % 60:02} left"
        for n in (240, 280, 320, 360)
    ]


def test_a_file_gets_no_line_of_a_short_phase(clock):
    screen = console()
    with Bars(screen, clock).bar(SOLVING) as advance:
        for _ in range(400):
            clock.now += 0.02
            advance()
    assert screen.file.getvalue() == ""


@pytest.mark.parametrize("width", [60, 80, 120])
def test_a_terminal_shows_all_phases_in_lines_that_fit(clock, width, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    screen = console(width, force_terminal=True, color_system=None, legacy_windows=False)
    bars = Bars(screen, clock)
    with bars.bar(SOLVING) as advance:
        advance(100, known=True)
        clock.now += 60.0
        advance(30, failed=3)
        bars._display.refresh()
    with bars.bar(Phase("case", "figures")):
        bars._display.refresh()
    lines = re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.file.getvalue()))
    assert any("130 of 400 sets, 3 failed" in line and "0:09:00 left" in line for line in lines)
    assert any("figures" in line for line in lines)
    assert max(map(len, lines)) <= width
    assert not any("…" in line for line in lines)
    assert "solving" in lines[-2] or "solving" in lines[-3]  # shown beside the figures


def test_two_phases_show_at_a_time(clock, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    screen = console(100, force_terminal=True)
    bars = Bars(screen, clock)
    with (
        bars.bar(Phase("case", "scan", 4, "nodes")) as progress,
        bars.bar(Phase("case", "lines", unit=POINTS)) as stepped,
    ):
        progress()
        stepped()
    assert "1 of 4 nodes" in screen.file.getvalue()
    assert "1 points" in screen.file.getvalue()


def test_a_dumb_terminal_is_like_a_file(clock, monkeypatch):
    monkeypatch.setenv("TERM", "dumb")
    screen = console(force_terminal=True)
    with Bars(screen, clock).bar(SOLVING) as advance:
        clock.now += 100.0
        advance(40)
    assert screen.file.getvalue() == "case, solving: 40 of 400 sets, 0:15:00 left\n"


def test_nothing_is_seen_of_silent_phases(capsys):
    with SILENT.bar(SOLVING) as advance:
        advance(400, failed=3, known=True)
    assert capsys.readouterr() == ("", "")


def spend(processor, number=3):
    """Some factorisations of Λ″(0)."""
    with Budget(seconds=60.0).countdown("Λ″(0)").running():
        for _ in range(number):
            processor.now += 13.0
            charge(12_400)


def test_a_file_is_told_what_a_long_number_waits_for(clock, processor):
    bars = Bars(console(), clock)
    with bars.bar(Phase("mathieu", "solving", 11, MOMENTS)):
        spend(processor)  # a short one is not told
        assert bars.console.file.getvalue() == ""
        clock.now += 12
        spend(processor, 3)
    assert bars.console.file.getvalue() == "mathieu, solving: Λ″(0), 12,400 unknowns, 13 s of 60 s\n"
    spend(processor)
    assert bars.console.file.getvalue().count("\n") == 1


@pytest.mark.parametrize("width", [60, 80, 120, 150])
def test_a_terminal_shows_what_a_number_waits_for(clock, width, processor):
    screen = console(width, force_terminal=True, color_system=None, legacy_windows=False)
    bars = Bars(screen, clock)
    with bars.bar(Phase("mathieu", "solving", 11, MOMENTS)):
        spend(processor)
        bars._display.refresh()
    shown = screen.file.getvalue()
    assert ("Λ″(0), 12,400 unknowns, 39 s of 60 s" in shown) == (width > 60)
    assert max(map(len, re.split(r"[\r\n]", shown))) <= width + 20
