"""Signals that end work, and an import that they wait for."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread

INTERRUPTED, TERMINATED = 130, 143
"""Exit codes after Ctrl-C and after SIGTERM."""


@contextmanager
def sigterm_interrupts() -> Iterator[list[int]]:
    """The first SIGTERM raises KeyboardInterrupt in the body, as Ctrl-C does; yields a list of those that came.

    Those that follow change nothing, so that the first one's end can be written and reported. A handler of the caller
    stays.
    """
    received: list[int] = []

    def interrupt(number: int, _: object) -> None:
        received.append(number)
        if len(received) == 1:
            raise KeyboardInterrupt

    if is_usual := signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, interrupt)
    try:
        yield received
    finally:
        if is_usual:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def signals_held() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until the body has ended: an import that would crash in one of thirty interrupts.

    Those that Python does not handle are left alone, and all outside of the main thread, which alone receives them.
    """
    held: list[int] = []
    is_main = current_thread() is main_thread()
    former = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM) if is_main}
    handled = {number: handler for number, handler in former.items() if callable(handler)}
    for each in handled:
        signal.signal(each, lambda number, _: held.append(number))
    try:
        yield
    finally:
        for number, handler in handled.items():
            signal.signal(number, handler)
        for came in held:
            signal.raise_signal(came)


def is_interrupt(failure: BaseException | None) -> bool:
    """Whether an exception is an interrupt, or the disguise that a class or a module gives to one in its import."""
    while failure is not None and not isinstance(failure, KeyboardInterrupt):
        failure = failure.__cause__ or failure.__context__
    return failure is not None
