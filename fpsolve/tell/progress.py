"""Progress of the work on a case by phases: bars on a terminal, now and then a line in a file, or nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from fpsolve.budget import Meter, watched
from fpsolve.solve.question import idle
from fpsolve.tell.blocks import Block

SETS, MOMENTS, NODES, POINTS, BOUNDS, PERCENT, SOLVES = "sets", "p", "nodes", "points", "bounds", "%", "solves"
"""What a phase counts."""
LINE_SECONDS, LINE_SHARE = 10.0, 0.1
"""A line in a file comes after as long at least, and as far."""
SPEED_SECONDS = 600.0
"""Of the last steps, from whose speed the time to go is estimated."""
ROOMY = 80
"""Columns of a terminal from which on there is room for the name of the case."""


@dataclass(frozen=True)
class Phase:
    """A part of the work on a case.

    Attributes:
        case: its name.
        name: such as "solving".
        total: how many steps it has; None where that is unknown.
        unit: what a step is; empty where the steps are not counted.
    """

    case: str
    name: str
    total: int | None = None
    unit: str = ""


Advance = Callable[..., None]
"""What a phase calls as it goes on: with how many steps are done, `failed` of them, `known` if by an earlier run."""


@dataclass(frozen=True)
class Watch:
    """Shows the work on a case; by default nothing.

    Attributes:
        bar: gives a phase what it shall call for its progress; a chart has two phases at a time.
        shown: takes what was found once it is there; it is made when it is asked for.
        noted: takes what limits this.
        said: takes notes about files.
        has_report: whether a report is written, too.
        is_whole: whether a few of several parameter sets are also shown one by one, with Λ at each p.
    """

    bar: Callable[[Phase], AbstractContextManager[Advance]] = lambda _: nullcontext(idle)
    shown: Callable[[Iterable[Block]], None] = lambda _: None
    noted: Callable[[Iterable[Block]], None] = lambda _: None
    said: Callable[[Iterable[Block]], None] = lambda _: None
    has_report: bool = False
    is_whole: bool = False


SILENT = Watch()


class Bars:
    """The phases of one case, also those that are over, in one display; in a file now and then a line.

    Args:
        console: of the standard error, if not stated.
        clock: gives the time in seconds.
    """

    def __init__(self, console: Console | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self.console, self.clock = console or Console(stderr=True), clock
        self.is_live = self.console.is_terminal and not self.console.is_dumb_terminal
        text = partial(TextColumn, markup=False)
        self._display = Progress(
            text("{task.fields[case]}{task.description}" if self.console.width >= ROOMY else "{task.description}"),
            text("{task.fields[waits]}", style="dim"),
            BarColumn(bar_width=4),
            text("{task.fields[counted]}"),
            TimeRemainingColumn(elapsed_when_finished=True),
            console=self.console,
            transient=True,
            redirect_stdout=False,
            speed_estimate_period=SPEED_SECONDS,
            get_time=clock,
        )

    @contextmanager
    def bar(self, phase: Phase) -> Iterator[Advance]:
        """Shows a phase as long as the body lasts, and those before it."""
        display, done, fails, printed, printed_at = self._display, 0, 0, 0, self.clock()
        number = display.add_task(phase.name, total=phase.total, case=f"{phase.case}, ", waits="", counted="")

        def tell(text: str) -> None:
            nonlocal printed, printed_at
            if not self.is_live and phase.total and self.clock() - printed_at >= LINE_SECONDS:
                print(f"{phase.case}, {phase.name}: {text}", file=self.console.file, flush=True)
                printed, printed_at = done, self.clock()

        def advance(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
            nonlocal done, fails, printed
            done, fails, printed = done + count, fails + failed, printed + count * known
            text = counted(phase, done, fails)
            display.update(number, completed=done, counted=text)
            if phase.total and LINE_SHARE * phase.total <= done - printed and done < phase.total:
                tell(text)

        def wait(meter: Meter) -> None:
            if meter.number:
                display.update(number, waits=waiting(meter))
                tell(waiting(meter))

        with display if self.is_live else nullcontext(), watched(wait):
            try:
                yield advance
            finally:
                display.update(number, waits="", total=1, completed=1)


def waiting(meter: Meter) -> str:
    """Which number is solved, and its longest time: "Λ″(0), 3 of 5, 12,400 unknowns, at most 80 s"."""
    of = f", {meter.count} of {meter.planned}" * (meter.planned > 1)
    return f"{meter.number}{of}, {meter.unknowns:,} unknowns, at most {max(meter.seconds - meter.spent, 0):.0f} s"


def counted(phase: Phase, done: int, failed: int) -> str:
    """How far a phase is: "12 of 400 sets, 3 failed"."""
    if not phase.unit:
        return ""
    if phase.unit == PERCENT:
        return f"{done / phase.total:.0%}" if phase.total else ""
    total = "" if phase.total is None else f" of {phase.total}"
    return f"{done}{total} {phase.unit}{f', {failed} failed' if failed else ''}"
