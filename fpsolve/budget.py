"""What the numbers of a parameter set may cost together: seconds of a processor, asked before each factorisation.

A number does not depend on these seconds. Whether it is given may, on a slower machine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from fpsolve.errors import NotConverged
from fpsolve.messages import Code, Message, Remedy

_meter: ContextVar[Meter | None] = ContextVar("meter", default=None)
_watch: ContextVar[Callable[[Meter], object] | None] = ContextVar("watch", default=None)


class OverBudget(NotConverged):
    """The seconds of a meter have passed; no number goes on without what it ends, see `unless_over_budget`."""

    def advising(self, remedy: str) -> OverBudget:
        """Itself: its remedy is a larger budget."""
        return self


@dataclass(eq=False)
class Meter:
    """The seconds of a processor that some numbers take, while this is `running`.

    Attributes:
        seconds: that they may take together.
        planned: how many numbers there are.
        count: which of them is being solved, from 1 on.
        number: the symbol of the one that is being solved.
        unknowns: of the factorisation that is under way.
        at_begin: seconds that had passed when that number began.
        needed: about what all numbers take, once they are more than there is; the same for each that is left out.
        pace: seconds for each unknown of the last work that was `timed`.
    """

    seconds: float
    planned: int = 0
    count: int = 0
    number: str = ""
    unknowns: int = 0
    at_begin: float = 0.0
    needed: float = 0.0
    pace: float = 0.0
    _before: float = 0.0
    _since: float | None = None

    @property
    def spent(self) -> float:
        """Seconds of the processor so far."""
        return self._before + (0.0 if self._since is None else time.thread_time() - self._since)

    @contextmanager
    def running(self) -> Iterator[Meter]:
        """Count in the body, where `charge` asks it; within another meter that one counts."""
        if other := _meter.get():
            yield other
            return
        token, self._since = _meter.set(self), time.thread_time()
        try:
            yield self
        finally:
            self._before, self._since = self.spent, None
            _meter.reset(token)

    def refuse(self, seconds: float) -> None:
        """Raise `OverBudget` if so many seconds are more than there are.

        It tells about how many all numbers take, if those that are left take as long as those that are done.
        """
        if seconds > self.seconds:
            own, done = seconds - self.at_begin, self.count - 1
            each = self.at_begin / done if done > 0 else own
            self.needed = self.needed or self.at_begin + max(own, each) + max(self.planned - self.count, 0) * each
            raise OverBudget(Message(Code.SECONDS_SPENT, seconds=self.needed, most=self.seconds), remedy=Remedy.BUDGET)


def begin(symbol: str) -> None:
    """Let the meter know which number comes next."""
    if meter := _meter.get():
        meter.number, meter.count, meter.at_begin = symbol, meter.count + 1, meter.spent


@contextmanager
def unless_over_budget(instead: Exception | None = None) -> Iterator[None]:
    """What is not resolved in the body is done without, but for what a budget has ended: no number depends on that.

    Raises:
        OverBudget: it was ended.
        Exception: `instead`, if it is given, where the body is not resolved.
    """
    try:
        yield
    except OverBudget:
        raise
    except NotConverged as failure:
        if instead is not None:
            raise instead from failure


@contextmanager
def watched(watch: Callable[[Meter], object]) -> Iterator[None]:
    """In the body `watch` is called with the meter before each factorisation."""
    token = _watch.set(watch)
    try:
        yield
    finally:
        _watch.reset(token)


def charge(unknowns: int) -> None:
    """Ask whether work on so many unknowns may begin. Raises `OverBudget`."""
    if meter := _meter.get():
        meter.refuse(meter.spent)
        meter.unknowns = unknowns
        if watch := _watch.get():
            watch(meter)


@contextmanager
def timed(unknowns: int) -> Iterator[None]:
    """Work on so many unknowns, whose seconds for each of them grow from one such work to the next.

    Raises:
        OverBudget: it would take longer than there is, at the pace of the last one.
    """
    charge(unknowns)
    meter = _meter.get() or Meter(math.inf)
    before = meter.spent
    meter.refuse(before + meter.pace * unknowns)
    yield
    meter.pace = (meter.spent - before) / unknowns
