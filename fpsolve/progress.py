"""Progress by phases on the standard error: bars on a terminal, now and then a line in a file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task
from rich.table import Column
from rich.text import Text

from fpsolve.workflow.watch import PERCENT, Advance, Phase, unheeded

LINE_SECONDS, LINE_SHARE = 10.0, 0.1
"""A line in a file comes after as long at least, and as far."""
ROOMY = 80
"""Columns of a terminal from which on there is room for the name of the case."""
Clock = Callable[[], float]


@dataclass
class Stretch:
    """A phase under way.

    Attributes:
        phase: which.
        begun: when, by the clock.
        done, known, failed: steps that are done, those of an earlier run among them, and those that failed.
        ended: when, if it has.
        told_at, told: when the last line came, and after how many steps.
    """

    phase: Phase
    begun: float
    done: int = 0
    known: int = 0
    failed: int = 0
    ended: float | None = None
    told_at: float = field(init=False)
    told: int = 0

    def __post_init__(self) -> None:
        self.told_at = self.begun

    def advance(self, count: int, failed: int, *, known: bool) -> None:
        self.done += count
        self.failed += failed
        if known:
            self.known += count
            self.told += count

    def left(self, now: float) -> float | None:
        """Seconds to go, by the rate of the steps that this run has done; None as long as there is none."""
        total, own = self.phase.total, self.done - self.known
        if total is None or own <= 0 or self.ended is not None:
            return None
        return (now - self.begun) * (total - self.done) / own

    @property
    def count(self) -> str:
        """How far it is: "12 of 400 sets, 3 failed"."""
        total, unit = self.phase.total, self.phase.unit
        if not unit:
            return ""
        if unit == PERCENT:
            return f"{self.done / total:.0%}" if total else ""
        text = f"{self.done} {unit}" if total is None else f"{self.done} of {total} {unit}"
        return f"{text}, {self.failed} failed" if self.failed else text

    def line(self, now: float) -> str:
        """The same for a file, with the time to go."""
        left = self.left(now)
        return f"{self.phase.case}, {self.phase.name}: {self.count}{'' if left is None else f', {_clock(left)} left'}"

    def is_due(self, now: float) -> bool:
        """Whether it is time for a line in a file."""
        total = self.phase.total
        if not total or not self.phase.unit or self.done >= total or now - self.told_at < LINE_SECONDS:
            return False
        return self.done - self.told >= LINE_SHARE * total

    def tell(self, now: float) -> str:
        """The line; the next one comes later."""
        self.told_at, self.told = now, self.done
        return self.line(now)


class Bars:
    """The phases of one case, those that are over among them, in one display.

    Args:
        console: of the standard error, if not stated.
        clock: gives the time in seconds.
    """

    def __init__(self, console: Console | None = None, clock: Clock = time.monotonic) -> None:
        self.console, self.clock = console or Console(stderr=True), clock
        self.is_live = self.console.is_terminal and not self.console.is_dumb_terminal
        room = self.console.width
        columns = (
            _Name(is_short=room < ROOMY),
            BarColumn(bar_width=20 if room >= ROOMY else 4),
            _Count(),
            _Left(clock),
        )
        self._display = Progress(
            *columns, console=self.console, transient=True, redirect_stdout=False, refresh_per_second=4
        )
        self._open = 0

    @contextmanager
    def phase(self, phase: Phase) -> Iterator[Advance]:
        """Shows a phase as long as the body lasts, and those before it."""
        stretch = Stretch(phase, self.clock())
        task = self._display.add_task(phase.name, total=phase.total, stretch=stretch) if self.is_live else None

        def advance(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
            stretch.advance(count, failed, known=known)
            if task is not None:
                self._display.update(task, completed=stretch.done)
            elif stretch.is_due(self.clock()):
                self._print(stretch.tell(self.clock()))

        self._enter()
        try:
            yield advance
        finally:
            stretch.ended = self.clock()
            if task is not None:
                self._display.update(task, total=max(stretch.done, 1), completed=max(stretch.done, 1))
            self._leave()

    def _enter(self) -> None:
        if self.is_live and not self._open:
            self._display.start()
        self._open += 1

    def _leave(self) -> None:
        self._open -= 1
        if self.is_live and not self._open:
            self._display.stop()

    def _print(self, line: str) -> None:
        file: TextIO = self.console.file  # type: ignore[assignment]
        print(line, file=file, flush=True)


@contextmanager
def hidden(_: Phase) -> Iterator[Advance]:
    """A phase that is not shown."""
    yield unheeded


class _Name(ProgressColumn):
    """The case and the phase, or that alone."""

    def __init__(self, *, is_short: bool) -> None:
        super().__init__(Column(no_wrap=True))
        self.is_short = is_short

    def render(self, task: Task) -> Text:
        phase: Phase = task.fields["stretch"].phase
        return Text(phase.name if self.is_short else f"{phase.case}, {phase.name}")


class _Count(ProgressColumn):
    """How far it is."""

    def __init__(self) -> None:
        super().__init__(Column(no_wrap=True))

    def render(self, task: Task) -> Text:
        return Text(task.fields["stretch"].count)


class _Left(ProgressColumn):
    """The time to go, or, once it is over or nobody knows, that it has taken."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(Column(no_wrap=True))
        self.clock = clock

    def render(self, task: Task) -> Text:
        stretch: Stretch = task.fields["stretch"]
        now = self.clock() if stretch.ended is None else stretch.ended
        left = stretch.left(now)
        return Text(_clock(now - stretch.begun) if left is None else f"{_clock(left)} left", style="cyan")


def _clock(seconds: float) -> str:
    """Hours, minutes and seconds: "0:12:30"."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
