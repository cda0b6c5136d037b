"""Signals that end work, and those that wait."""

import signal
import threading
import time

import pytest

from fpsolve.signals import ended_by_signals, signals_held


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
