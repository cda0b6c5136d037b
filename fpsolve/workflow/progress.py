"""Progress of the work on a case by phases: bars on a terminal, now and then a line in a file, or nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task
from rich.table import Column
from rich.text import Text

from fpsolve.budget import Meter, watched
from fpsolve.page.page import Block

SETS, MOMENTS, NODES, POINTS, BOUNDS, PERCENT, SOLVES = "sets", "p", "nodes", "points", "bounds", "%", "solves"
"""What a phase counts."""
LINE_SECONDS, LINE_SHARE = 10.0, 0.1
"""A line in a file comes after as long at least, and as far."""
KNOWN_SECONDS, KNOWN_SHARE, KNOWN_STEPS = 5.0, 0.05, 8
"""A time to go is shown after as long, as far, and as many steps: the first ones are slow, and processes start then."""
ROOMY, LONGEST_WAIT = 80, 50
"""Columns of a terminal from which on there is room for the name of the case, and more for a long bar."""


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


class Advance(Protocol):
    """What a phase calls as it goes on."""

    def __call__(self, count: int = 1, *, failed: int = 0, known: bool = False) -> None:
        """So many steps are done, of which some failed; `known` are those that an earlier run has done."""


def ignore(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
    """Progress that is not shown."""


@dataclass(frozen=True)
class Watch:
    """What is shown of the work on a case; by default nothing.

    Attributes:
        bar: gives a phase what it shall call for its progress; a chart has two phases at a time.
        shown: takes what was found once it is there; it is made when it is asked for.
        noted: takes what limits this.
        said: takes notes about files.
        has_report: whether report.html is written, too.
        is_whole: whether a few of several curves are also shown one by one, with Λ at each p.
    """

    bar: Callable[[Phase], AbstractContextManager[Advance]] = lambda _: nullcontext(ignore)
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
        is_roomy = self.console.width >= ROOMY
        self._display = Progress(
            _TextColumn(lambda task: f"{task.fields['phase'].case}, " * is_roomy + task.description),
            _TextColumn(lambda task: task.fields["waits"], "dim"),
            BarColumn(bar_width=20 if self.console.width >= ROOMY + LONGEST_WAIT else 4),
            _TextColumn(counted),
            _TextColumn(timed, "cyan"),
            console=self.console,
            transient=True,
            redirect_stdout=False,
            refresh_per_second=4,
            get_time=clock,
            disable=not self.is_live,
        )
        self._open = 0

    @contextmanager
    def bar(self, phase: Phase) -> Iterator[Advance]:
        """Shows a phase as long as the body lasts, and those before it."""
        display = self._display
        fields: dict[str, Any] = {"phase": phase, "known": 0, "failed": 0, "marks": [(0.0, 0.0)], "waits": ""}
        number = display.add_task(phase.name, total=phase.total, **fields)
        task = display.tasks[-1]
        printed, printed_at = 0, self.clock()

        def advance(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
            nonlocal printed, printed_at
            earlier = count if known else 0
            sums = {"known": task.fields["known"] + earlier, "failed": task.fields["failed"] + failed}
            display.update(number, advance=count, **sums)
            printed += earlier
            marks, own = task.fields["marks"], task.completed - task.fields["known"]
            if own > 1.01 * marks[-1][1]:
                marks.append((task.elapsed or 0.0, own))
            if self.is_live or not phase.total or not phase.unit or task.completed >= phase.total:
                return
            is_far = task.completed - printed >= LINE_SHARE * phase.total
            if is_far and self.clock() - printed_at >= LINE_SECONDS:
                left = "" if seconds_left(task) is None else f", {timed(task)}"
                print(f"{phase.case}, {phase.name}: {counted(task)}{left}", file=self.console.file, flush=True)
                printed, printed_at = int(task.completed), self.clock()

        def wait(meter: Meter) -> None:
            nonlocal printed_at
            if not meter.number:
                return
            text = waiting(meter)
            display.update(number, waits=text)
            if not self.is_live and phase.total and self.clock() - printed_at >= LINE_SECONDS:
                print(f"{phase.case}, {phase.name}: {text}", file=self.console.file, flush=True)
                printed_at = self.clock()

        if self.is_live and not self._open:
            display.start()
        self._open += 1
        try:
            with watched(wait):
                yield advance
        finally:
            display.update(number, waits="")
            display.stop_task(number)
            display.update(number, total=task.completed or 1, completed=task.completed or not phase.unit)
            self._open -= 1
            if self.is_live and not self._open:
                display.stop()


def waiting(meter: Meter) -> str:
    """Which number is solved, and what is left for it and the others: "Λ″(0), 3 of 5, 12,400 unknowns, 80 s left"."""
    of = f", {meter.begun} of {meter.planned}" * (meter.planned > 1)
    return f"{meter.number}{of}, {meter.unknowns:,} unknowns, {max(meter.seconds - meter.spent, 0):.0f} s left"


def counted(task: Task) -> str:
    """How far a phase is: "12 of 400 sets, 3 failed"."""
    phase: Phase = task.fields["phase"]
    if not phase.unit:
        return ""
    if phase.unit == PERCENT:
        return f"{task.completed / phase.total:.0%}" if phase.total else ""
    failed, total = task.fields["failed"], "" if phase.total is None else f" of {phase.total}"
    return f"{int(task.completed)}{total} {phase.unit}{f', {failed} failed' if failed else ''}"


def seconds_left(task: Task) -> float | None:
    """Seconds to go, by the rate of the later half of the steps that this run has done; None until that is known."""
    total, known = task.fields["phase"].total, task.fields["known"]
    own, elapsed = task.completed - known, task.elapsed or 0.0
    if total is None or task.stop_time is not None or task.completed >= total:
        return None
    if elapsed < KNOWN_SECONDS or own < max(KNOWN_STEPS, KNOWN_SHARE * (total - known)):
        return None
    then, before = max(mark for mark in task.fields["marks"] if mark[1] <= own / 2)
    return (elapsed - then) * (total - task.completed) / (own - before)


def timed(task: Task) -> str:
    """The time to go, "0:12:30 left"; where that is unknown, or after the end, the time that a phase has taken."""
    left = seconds_left(task)
    minutes, seconds = divmod(round(task.elapsed or 0.0 if left is None else left), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{seconds:02}{'' if left is None else ' left'}"


class _TextColumn(ProgressColumn):
    """A text about each phase, which is not broken."""

    def __init__(self, text: Callable[[Task], str], style: str = "") -> None:
        super().__init__(Column(no_wrap=True))
        self.text, self.style = text, style

    def render(self, task: Task) -> Text:
        return Text(self.text(task), style=self.style)
