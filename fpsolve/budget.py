"""What a number may cost: counted in operations before each factorisation, in seconds and in memory.

Costs follow from the sizes of matrices alone, at a fixed speed of a processor. So a number does not depend on its
budget, and whether it is given does not depend on what else the machine does.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

from fpsolve.errors import NotConverged
from fpsolve.messages import Code, Message, Remedy

SECONDS_PER_OPERATION = 3.5e-11
"""Seconds of a processor that an operation of an elimination in a large array counts for."""
OVERHEAD_OPERATIONS = 2e7
"""Operations that take the time of what goes with a factorisation, 0.7 ms."""
SOLVE_OPERATIONS = 4e10
"""Operations that take the time of some forty solves with factors of one gigabyte, 1.4 s."""
SMALL = 0.002
"""Gigabytes that are not worth to ask what the process has already."""
UNKNOWN_MACHINE = 8.0
"""Gigabytes of memory of a machine that does not tell."""
Solve = TypeVar("Solve", bound=Callable[..., Any])
_running: ContextVar[tuple[Countdown, ...]] = ContextVar("running", default=())
_watch: ContextVar[Callable[[Countdown], object] | None] = ContextVar("watch", default=None)
_processes = [1]
"""How many share the memory of the machine."""


class OverBudget(Exception):
    """The next factorisation needs more than is left of a countdown; it passes all that may go on without one."""

    def __init__(self, countdown: Countdown, reason: Message) -> None:
        super().__init__(reason)
        self.countdown, self.reason = countdown, reason


@dataclass(eq=False)
class Countdown:
    """What is left for a number, or for several of them, while this is `running`.

    Attributes:
        seconds: of a processor, as foreseen.
        memory: of the process, in gigabytes.
        name: of the number, such as "Λ″(0)"; empty for several.
        spent: seconds so far, with the factorisation that is under way.
        unknowns: of this factorisation.
        peak: the most memory that was foreseen.
    """

    seconds: float
    memory: float = math.inf
    name: str = ""
    spent: float = 0.0
    unknowns: int = 0
    peak: float = 0.0

    @contextmanager
    def running(self) -> Iterator[Countdown]:
        """Count in the body, where `charge` raises `OverBudget` for this countdown."""
        token = _running.set((*_running.get(), self))
        try:
            yield self
        finally:
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


def charge(operations: float, gigabytes: float = 0.0, unknowns: int = 0) -> None:
    """Count what comes next for every number under way, a factorisation if it has unknowns.

    Args:
        operations: how many there are, of a time that an elimination in a large array takes for one.
        gigabytes: memory that they need.
        unknowns: those of a factorisation.

    Raises:
        OverBudget: it is too much for one of them.
    """
    if not (running := _running.get()):
        return
    if unknowns:
        operations += OVERHEAD_OPERATIONS + SOLVE_OPERATIONS * gigabytes
    seconds = SECONDS_PER_OPERATION * operations
    peak = gigabytes + (resident() if gigabytes > SMALL else 0.0)
    for each in running:
        if peak > each.memory:
            raise OverBudget(each, Message(Code.MEMORY_SPENT, size=peak, most=each.memory))
        if each.spent + seconds > each.seconds:
            raise OverBudget(each, Message(Code.SECONDS_SPENT, seconds=each.spent + seconds, most=each.seconds))
    for each in running:
        each.spent, each.peak, each.unknowns = each.spent + seconds, max(each.peak, peak), unknowns or each.unknowns
    if unknowns and (watch := _watch.get()):
        watch(under_way() or running[0])


def resident() -> float:
    """Gigabytes of memory that this process has now; of its largest size where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e9
    except (OSError, ValueError):
        try:
            import resource
        except ImportError:  # on Windows
            return 0.2
        return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1e9


def half_the_memory() -> float:
    """Gigabytes: half of the memory of this machine, or the share of it that a worker has."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    except (AttributeError, OSError, ValueError):
        total = UNKNOWN_MACHINE
    return 0.5 * total / _processes[0]


def share_memory(processes: int) -> None:
    """Let this process have the memory of one of so many."""
    _processes[0] = processes
