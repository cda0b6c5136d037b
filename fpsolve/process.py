"""What surrounds work: its processors, the signals that end it or have to wait, and outputs that cannot be written."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any

from fpsolve.errors import FpsolveError

PROCESSORS = "FPSOLVE_PROCESSORS"
"""The variable of the environment that limits how many processors a process and its children use."""
ENDING = ("SIGHUP", "SIGTERM")
REPEAT_SECONDS = 0.02
"""After which an interrupt that Python lost comes again."""
_limits: list[int] = []


def processors() -> int:
    """How many processors this process may use: those that the system gives it, or fewer if there is a limit.

    Raises:
        FpsolveError: the limit of the environment is no whole number from 1 on.
    """
    given = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min([given, *_limits, *_limit_of_environment()])


def limit_processors(count: int) -> None:
    """From now on this process uses at most so many processors. Raises `ValueError` if `count` is not ≥ 1."""
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ValueError(f"got count = {count!r}; must be a whole number >= 1")
    _limits[:] = [count]


def _limit_of_environment() -> list[int]:
    text = os.environ.get(PROCESSORS, "").strip()
    if not text:
        return []
    try:
        limit = int(text)
    except ValueError:
        limit = 0
    if limit < 1:
        known = "must be a whole number >= 1; set it to one, or unset it"
        raise FpsolveError(f'{PROCESSORS}, in the environment: got "{text}"; {known}')
    return [limit]


@contextmanager
def ended_by_signals() -> Iterator[list[int]]:
    """In the body SIGHUP or SIGTERM raises KeyboardInterrupt, as Ctrl-C does; gives a list, with the one that came.

    Later ones change nothing, so that what the first ends can be written and said. A signal that is ignored, as SIGHUP
    under nohup, or that the caller handles is left alone; so are all outside of the main thread, which alone receives
    them.
    """
    received: list[int] = []
    lost: list[int] = []

    def interrupt(number: int, _: Any) -> None:
        if not received or lost:
            received[:] = received or [number]
            lost.clear()
            raise KeyboardInterrupt

    known = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()
    taken = [number for number in known if is_main and signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, interrupt)
    try:
        with _interrupts_repeated(received, lost) if is_main else nullcontext():
            yield received
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def _interrupts_repeated(received: Sequence[int], lost: list[int]) -> Iterator[None]:
    """An interrupt of the body that Python loses, as in what runs when an object is freed, comes once more.

    Args:
        received: the signal that ends the body; empty after Ctrl-C.
        lost: what was received is put there, so that it may interrupt again.
    """
    former, timers = sys.unraisablehook, list[threading.Timer]()

    def repeat(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            former(unraisable)
            return
        lost.extend(received)
        timers.append(threading.Timer(REPEAT_SECONDS, _signal_main, (*received, signal.SIGINT)[:1]))
        timers[-1].daemon = True
        timers[-1].start()

    sys.unraisablehook = repeat
    try:
        yield
    finally:
        sys.unraisablehook = former
        for timer in timers:
            timer.cancel()
            timer.join()  # what it has sent already still meets the handlers of the body


def _signal_main(number: int) -> None:
    """A signal for the main thread, also if it waits."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:  # on Windows
        signal.raise_signal(number)


@contextmanager
def signals_held() -> Iterator[None]:
    """Signals that interrupt wait until the body has ended: an import that may crash, or files that belong together.

    Those that Python does not handle are left alone; so are all outside of the main thread, which alone receives them.
    """
    is_main = threading.current_thread() is threading.main_thread()
    known = [getattr(signal, name) for name in ("SIGINT", *ENDING) if is_main and hasattr(signal, name)]
    handlers = {number: signal.getsignal(number) for number in known if callable(signal.getsignal(number))}
    held: list[int] = []
    try:
        for number in handlers:
            signal.signal(number, lambda number, _: held.append(number))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in held:
            signal.raise_signal(number)


def flush_output() -> None:
    """Write what waits in the standard output. Raises OSError where it cannot be written."""
    if sys.stdout is not None:  # as it is where the output is closed
        sys.stdout.flush()


def drop_blocked_output() -> None:
    """Drop what waits in the standard output or errors and cannot be written, so that Python need not at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
