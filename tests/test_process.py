"""Processors, signals that end work, and those that wait."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from fpsolve import process
from fpsolve.errors import FpsolveError
from fpsolve.process import PROCESSORS, ended_by_signals, limit_processors, processors, signals_held


@pytest.fixture
def _four_processors(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2, 5}, raising=False)
    monkeypatch.setattr(process, "_limits", [])
    monkeypatch.delenv(PROCESSORS, raising=False)


@pytest.mark.usefixtures("_four_processors")
def test_the_least_limit_of_processors_counts(monkeypatch):
    assert processors() == 4
    monkeypatch.setenv(PROCESSORS, " 3 ")
    assert processors() == 3
    limit_processors(2)
    assert processors() == 2
    limit_processors(9)
    assert processors() == 3
    monkeypatch.setenv(PROCESSORS, "")
    assert processors() == 4


@pytest.mark.usefixtures("_four_processors")
def test_without_affinities_all_processors_count(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processors() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processors() == 1


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system has no affinities")
def test_a_process_that_is_bound_to_one_processor_uses_one():
    code = "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nfrom fpsolve.process import *"
    command = [sys.executable, "-c", f"{code}; print(processors())"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip() == "1"


@pytest.mark.usefixtures("_four_processors")
@pytest.mark.parametrize("text", ["0", "00", "-1", "two", "1.5", "²"])
def test_a_limit_that_is_no_number_is_refused(monkeypatch, text):
    monkeypatch.setenv(PROCESSORS, text)
    with pytest.raises(FpsolveError, match=f'^FPSOLVE_PROCESSORS, .*got "{text}"; must be a whole number >= 1; set it'):
        processors()


@pytest.mark.parametrize("count", [0, -1, 1.0, True, "2"])
def test_a_bad_limit_is_refused(count):
    with pytest.raises(ValueError, match=f"got count = {count!r}; must be a whole number >= 1"):
        limit_processors(count)


@pytest.fixture
def _interrupts():
    """SIGINT interrupts, also where the tests run in the background."""
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, former)


@pytest.mark.usefixtures("_interrupts")
def test_only_the_first_signal_that_ends_interrupts():
    with ended_by_signals() as received:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert received == [signal.SIGTERM]


@pytest.mark.usefixtures("_interrupts")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_an_interrupt_that_is_lost_comes_again(name, capsys):
    """Python prints what is raised as an object is freed, and goes on."""

    class Freed:
        def __del__(self):
            signal.raise_signal(getattr(signal, name))

    def free_and_wait():
        Freed()
        time.sleep(20)

    with ended_by_signals() as received, pytest.raises(KeyboardInterrupt):
        free_and_wait()
    assert received == ([signal.SIGTERM] if name == "SIGTERM" else [])
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_held_signal_comes_after_the_body(name):
    number, calls = getattr(signal, name), []
    former = signal.signal(number, lambda *_: calls.append("handled"))
    try:
        with signals_held():
            signal.raise_signal(number)
            calls.append("body")
        assert calls == ["body", "handled"]
        signal.raise_signal(number)
        assert calls == ["body", "handled", "handled"]
    finally:
        signal.signal(number, former)


def test_ignored_signals_and_other_threads_are_left_alone():
    former = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    found = []

    def look():
        with signals_held():
            found.extend(signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM))

    try:
        before = signal.getsignal(signal.SIGINT)
        thread = threading.Thread(target=look)
        thread.start()
        thread.join()
        assert found == [before, signal.SIG_IGN]
        with signals_held():
            assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, former)
