"""Signals that end work, and those that wait."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextvars import ContextVar

import pytest

from fpsolve.signals import ended_by_signals, is_interrupt, left_at_signals, signals_held
from fpsolve.workflow.folders import saying_if_interrupted
from tests.conftest import heed_signals, sampled

SECONDS = 2.0
"""In which every run ends."""


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


@pytest.mark.usefixtures("_interrupts")
def test_a_call_that_obeys_no_signal_is_left():
    """A held lock takes the place of a library."""
    held, started, before = threading.Lock(), time.monotonic(), threading.enumerate()
    held.acquire()
    threading.Timer(0.2, lambda: signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        left_at_signals(lambda: held.acquire(timeout=60))
    assert time.monotonic() - started < SECONDS
    left = [each for each in threading.enumerate() if each not in before]
    held.release()
    for each in left:
        each.join(timeout=10)
    assert not any(each.is_alive() for each in left)  # or it would take the calls of the next one


def test_what_is_called_in_another_thread_is_as_here():
    name = ContextVar("name", default="")
    name.set("here")
    assert left_at_signals(lambda: (name.get(), threading.current_thread().name)) != ("here", "MainThread")
    assert left_at_signals(name.get) == "here"
    with pytest.raises(ZeroDivisionError):
        left_at_signals(lambda: 1 / 0)
    found = []
    thread = threading.Thread(target=lambda: found.append(left_at_signals(threading.current_thread)))
    thread.start()
    thread.join()
    assert found == [thread]


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


LONG = """
import threading, time
import numpy as np
import fpsolve.cli, fpsolve.__main__
from fpsolve.fem.factors import factorised
from fpsolve.fem.axis import KroneckerSum

def run():
    rng = np.random.default_rng(1)
    operator = KroneckerSum([(rng.standard_normal((80, 80)), rng.standard_normal((100, 100)))])
    print("begun", flush=True)
    try:
        factorised(operator, is_full=True)
    except KeyboardInterrupt:
        print("kept", flush=True)
        return 130
    return 0

fpsolve.cli.main = run
fpsolve.__main__.main()
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_an_interrupt_leaves_a_long_factorisation():
    """Of 8,000 unknowns, some 20 s; before, LAPACK went on to its end. What runs on is no harm as the process ends."""
    command = [sys.executable, "-c", LONG]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=heed_signals) as process:
        assert process.stdout.readline() == "begun\n"
        time.sleep(1.5)
        process.send_signal(signal.SIGINT)
        started = time.monotonic()
        out, _ = process.communicate(timeout=60)
    assert time.monotonic() - started < SECONDS
    assert (process.returncode, out) == (130, "kept\n")


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
