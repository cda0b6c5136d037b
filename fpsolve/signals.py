"""Signals that end work, and signals that wait until it is whole."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

ENDING = ("SIGHUP", "SIGTERM")
"""Signals that end a run as Ctrl-C does."""
SIGNALLED = 128
"""Number to which that of a signal is added in an exit code."""
INTERRUPTED = 130
"""Exit code after Ctrl-C."""


@contextmanager
def ended_by_signals() -> Iterator[list[int]]:
    """SIGHUP and SIGTERM raise KeyboardInterrupt in the body, as Ctrl-C does; yields a list for the one that came.

    Those that follow change nothing, so that the first one's end can be written and reported. Signals that are ignored,
    as SIGHUP under nohup, and those that the caller handles are left alone.
    """
    received: list[int] = []

    def interrupt(number: int, _: Any) -> None:
        if not received:
            received.append(number)
            raise KeyboardInterrupt

    with _handled(ENDING, interrupt, lambda former: former is signal.SIG_DFL):
        yield received


@contextmanager
def signals_held() -> Iterator[None]:
    """Signals that Python handles wait until the body has ended: an import that may crash, files that belong together.

    Signals that are ignored are left alone.
    """
    held: list[int] = []
    try:
        with _handled(("SIGINT", *ENDING), lambda number, _: held.append(number), callable):
            yield
    finally:
        for number in held:
            signal.raise_signal(number)


@contextmanager
def _handled(
    names: Sequence[str], handler: Callable[[int, Any], None], is_replaced: Callable[[Any], bool]
) -> Iterator[None]:
    """Handle signals in the body; none outside of the main thread, which alone receives them.

    Args:
        names: of the signals; those that the system does not have are left out.
        handler: of them, in the body.
        is_replaced: whether a former handler gives way.
    """
    is_main = threading.current_thread() is threading.main_thread()
    known = [getattr(signal, name) for name in names if is_main and hasattr(signal, name)]
    former = {number: signal.getsignal(number) for number in known if is_replaced(signal.getsignal(number))}
    try:
        for number in former:
            signal.signal(number, handler)
        yield
    finally:
        for number, each in former.items():
            signal.signal(number, each)


def is_interrupt(failure: BaseException | None) -> bool:
    """Whether an exception is an interrupt, or the disguise that a class or a module gives to one in its import."""
    while failure is not None and not isinstance(failure, KeyboardInterrupt):
        failure = failure.__cause__ or failure.__context__
    return failure is not None


def end_process(code: int) -> NoReturn:
    """End this process; at once after a signal: Python makes another end of an interrupt that has passed `eval`."""
    if code > SIGNALLED:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
        os._exit(code)
    sys.exit(code)
