"""Signals that end work, and those that wait."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from fpsolve.signals import ended_by_signals, is_interrupt, signals_held
from fpsolve.workflow.folders import saying_if_interrupted
from tests.conftest import heed_signals, sampled


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


def test_an_interrupt_is_known_in_disguise():
    """Python makes a RuntimeError of one within `__set_name__`; before, a traceback ended such a run."""

    class Interrupted:
        def __set_name__(self, owner, name):
            raise KeyboardInterrupt

    with pytest.raises((RuntimeError, KeyboardInterrupt)) as told:
        type("Owner", (), {"name": Interrupted()})
    assert is_interrupt(told.value)
    assert not is_interrupt(RuntimeError())
    with pytest.raises(KeyboardInterrupt, match="after 2"), saying_if_interrupted(lambda: " after 2 curves"):
        type("Owner", (), {"name": Interrupted()})
    with pytest.raises(RuntimeError, match="own"), saying_if_interrupted(lambda: " after 2 curves"):
        raise RuntimeError("its own")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("delay", sampled(0.02, 0.2, *(0.1 * k for k in range(3, 12)), keep=2))
def test_an_interrupt_of_the_first_second_says_no_more_than_that(delay, tmp_path):
    """While modules are imported, after Python itself and this package have begun; before, there was a traceback."""
    code = "from fpsolve.__main__ import main; print('begun', flush=True); main()"
    command = [sys.executable, "-c", code, "design", "--help"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, preexec_fn=heed_signals, cwd=tmp_path, **pipes) as process:
        assert process.stdout.readline() == "begun\n"
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert (process.returncode, said) in {(130, "interrupted\n"), (0, "")}
