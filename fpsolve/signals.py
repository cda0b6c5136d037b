"""Signals that end work, and signals that wait until it is whole."""

from __future__ import annotations

import atexit
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import copy_context
from queue import SimpleQueue
from typing import Any, NoReturn, TypeVar

ENDING = ("SIGHUP", "SIGTERM")
"""Signals that end a run as Ctrl-C does."""
LOOK_SECONDS = 0.1
"""Seconds after which a main thread that waits for another one looks for signals, where the system does not wake it."""
SIGNALLED = 128
"""Number to which that of a signal is added in an exit code."""
INTERRUPTED = 130
"""Exit code after Ctrl-C."""
Result = TypeVar("Result")


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


_away: list[tuple[threading.Thread, SimpleQueue[Any]]] = []
"""The thread that long calls are made in, once there is one, and its calls: one that was left must not take others."""


def left_at_signals(function: Callable[[], Result]) -> Result:
    """What a long call of a library returns; a signal that ends work leaves it, as libraries obey none.

    It is made in a thread that nobody waits for then; it must release the lock of Python, and change nothing. Threads
    other than the main one, which alone receives signals, call it themselves.
    """
    if threading.current_thread() is not threading.main_thread():
        return function()
    found, failures, done, context = list[Result](), list[BaseException](), threading.Event(), copy_context()

    def call() -> None:
        try:
            found.append(context.run(function))
        except BaseException as failure:
            failures.append(failure)
        finally:
            done.set()

    if not (_away and _away[0][0].is_alive()):
        calls = SimpleQueue[Any]()
        thread = threading.Thread(target=_call_away, args=[calls], daemon=True)
        _away[:] = [(thread, calls)]
        thread.start()
        atexit.register(_end_thread, thread)
    _away[0][1].put(call)
    try:
        while not done.wait(LOOK_SECONDS):
            pass
    except BaseException:
        thread, calls = _away.pop()
        calls.put(None)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(SystemExit))
        raise
    if failures:
        raise failures.pop()
    return found.pop()


def _call_away(calls: SimpleQueue[Any]) -> None:
    while (call := calls.get()) is not None:
        if callable(call):
            call()
        del call  # what is no call ends here


def _end_thread(thread: threading.Thread) -> None:
    """End it before Python does, which would report what SuperLU leaves behind there."""
    if _away and _away[0][0] is thread:
        _away[0][1].put(None)
        thread.join()


def is_away() -> bool:
    """Whether this is the thread that long calls are made in."""
    return bool(_away) and _away[0][0] is threading.current_thread()


def end_away(thing: object) -> None:
    """Let a thing end in that thread, if nothing else holds it."""
    if _away:
        _away[0][1].put(thing)


def is_interrupt(failure: BaseException | None) -> bool:
    """Whether an exception is an interrupt, or the disguise that a class or a module gives to one in its import."""
    while failure is not None and not isinstance(failure, KeyboardInterrupt):
        failure = failure.__cause__ or failure.__context__
    return failure is not None


def end_process(code: int) -> NoReturn:
    """End this process; at once after a signal, as calls that are left would crash as their library is unloaded.

    Python would take its time, and make another end of an interrupt that has passed through `eval`.
    """
    if code > SIGNALLED:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
        os._exit(code)
    sys.exit(code)
