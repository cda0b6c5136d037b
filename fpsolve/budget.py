"""What a number may cost: seconds of a processor, asked before each factorisation.

A number does not depend on its budget. Whether it is given may, on a slower machine.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar

from fpsolve.errors import NotConverged
from fpsolve.messages import Code, Message, Remedy

Solve = TypeVar("Solve", bound=Callable[..., Any])
_running: ContextVar[tuple[Countdown, ...]] = ContextVar("running", default=())
_watch: ContextVar[Callable[[Countdown], object] | None] = ContextVar("watch", default=None)


class OverBudget(Exception):
    """A countdown has ended; it passes all that may go on without one."""

    def __init__(self, countdown: Countdown, reason: Message) -> None:
        super().__init__(reason)
        self.countdown, self.reason = countdown, reason


@dataclass(eq=False)
class Countdown:
    """What is left for a number, or for several of them, while this is `running`.

    Attributes:
        seconds: of a processor.
        name: of the number, such as "Λ″(0)"; empty for several.
        unknowns: of the factorisation that is under way.
        before: seconds of earlier runs.
        since: when it began to run; None where it does not.
    """

    seconds: float
    name: str = ""
    unknowns: int = 0
    before: float = 0.0
    since: float | None = None

    @property
    def spent(self) -> float:
        """Seconds of the processor so far."""
        return self.before + (0.0 if self.since is None else time.thread_time() - self.since)

    @contextmanager
    def running(self) -> Iterator[Countdown]:
        """Count in the body, where `charge` raises `OverBudget` for this countdown."""
        token, self.since = _running.set((*_running.get(), self)), time.thread_time()
        try:
            yield self
        finally:
            self.before, self.since = self.spent, None
            _running.reset(token)


def under_way() -> Countdown | None:
    """That of the number which is being solved; those that it takes are parts of it and have none of their own."""
    return next((each for each in _running.get() if each.name), None)


@contextmanager
def counted(countdown: Countdown) -> Iterator[None]:
    """What the body solves is the number of a countdown, or a part of the one that is under way.

    Raises:
        NotConverged: the budget does not suffice.
    """
    if under_way():
        yield
        return
    try:
        with countdown.running():
            yield
    except OverBudget as failure:
        if failure.countdown is not countdown:
            raise
        told = Message(Code.NUMBER_SPENT, symbol=countdown.name, reason=failure.reason)
        raise NotConverged(told, remedy=Remedy.BUDGET) from None


def one_number(name: str) -> Callable[[Solve], Solve]:
    """What a function of something with a `budget` solves is one number, see `counted`; its p is "{:g}" in the name."""

    def decorated(function: Solve) -> Solve:
        @wraps(function)
        def solve(solver: Any, *args: Any, **kwargs: Any) -> Any:
            with counted(solver.budget.countdown(name.format(*args))):
                return function(solver, *args, **kwargs)

        return solve  # type: ignore[return-value]

    return decorated


@contextmanager
def watched(watch: Callable[[Countdown], object]) -> Iterator[None]:
    """In the body `watch` is called before each factorisation, with the countdown of the number that waits for it."""
    token = _watch.set(watch)
    try:
        yield
    finally:
        _watch.reset(token)


def charge(unknowns: int) -> None:
    """Ask whether a factorisation of so many unknowns may begin. Raises `OverBudget`."""
    running = _running.get()
    for each in running:
        if each.spent > each.seconds:
            raise OverBudget(each, Message(Code.SECONDS_SPENT, seconds=each.spent, most=each.seconds))
        each.unknowns = unknowns
    if running and (watch := _watch.get()):
        watch(under_way() or running[0])
