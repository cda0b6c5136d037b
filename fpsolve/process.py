"""What surrounds work: the signals that end it or have to wait, and outputs that cannot be written."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

ENDING = ("SIGHUP", "SIGTERM")
PROCESSORS = "FPSOLVE_PROCESSORS"
"""The environment variable that limits them."""


def processors() -> int:
    """How many processors this process may use."""
    try:
        count = len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        count = os.cpu_count() or 1
    limit = os.environ.get(PROCESSORS, "")
    return min(count, max(int(limit), 1)) if limit.isdecimal() else count


def limit_processors(count: int) -> None:
    """Use no more of them, in this process and those that it starts."""
    os.environ[PROCESSORS] = str(count)


@contextmanager
def ended_by_signals() -> Iterator[list[int]]:
    """In the body SIGHUP or SIGTERM raises KeyboardInterrupt, as Ctrl-C does; gives a list, with the one that came.

    Later ones change nothing, so that what the first ends can be written and said. A signal that is ignored, as SIGHUP
    under nohup, or that the caller handles is left alone; so are all outside of the main thread, which alone receives
    them.
    """
    received: list[int] = []

    def interrupt(number: int, _: Any) -> None:
        if not received:
            received.append(number)
            raise KeyboardInterrupt

    known = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()
    taken = [number for number in known if is_main and signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, interrupt)
    try:
        yield received
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def signals_held() -> Iterator[None]:
    """Signals that interrupt wait until the body has ended: an import of compiled modules may crash where one comes.

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
