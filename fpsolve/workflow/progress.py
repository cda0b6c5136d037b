"""Progress of the work on a case by phases: bars on a terminal, now and then a line in a file, or nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from fpsolve.case.case import Case
from fpsolve.study.results import CurveResult, SimulatedCurve

if TYPE_CHECKING:
    from rich.console import Console

SETS, MOMENTS, NODES, POINTS, BOUNDS, PERCENT = "sets", "p", "nodes", "points", "bounds", "%"
"""What a phase counts."""
LINE_SECONDS, LINE_SHARE = 10.0, 0.1
"""A line in a file comes after as long at least, and as far."""
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
        solved: takes a case and its curves once they are solved.
        simulated: takes a case, its simulated curves, and those that are solved too.
    """

    bar: Callable[[Phase], AbstractContextManager[Advance]] = lambda _: nullcontext(ignore)
    solved: Callable[[Case, Sequence[CurveResult]], None] = lambda *_: None
    simulated: Callable[[Case, Sequence[SimulatedCurve], Sequence[CurveResult]], None] = lambda *_: None


SILENT = Watch()


@dataclass
class State:
    """How far a phase is.

    Attributes:
        phase: which.
        clock: gives the time in seconds.
        done, known, failed: steps that are done, those of an earlier run among them, and those that failed.
        start, end: when it began, and when it ended, if it has.
        printed, printed_at: how many steps were done as the last line was printed, and when that was.
    """

    phase: Phase
    clock: Callable[[], float] = time.monotonic
    done: int = 0
    known: int = 0
    failed: int = 0
    end: float | None = None
    printed: int = 0
    start: float = field(init=False)
    printed_at: float = field(init=False)

    def __post_init__(self) -> None:
        self.start = self.printed_at = self.clock()

    def advance(self, count: int = 1, *, failed: int = 0, known: bool = False) -> None:
        self.done += count
        self.failed += failed
        if known:
            self.known += count
            self.printed += count

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

    @property
    def left(self) -> float | None:
        """Seconds to go, by the rate of the steps that this run has done; None as long as there is none."""
        total, own = self.phase.total, self.done - self.known
        if total is None or own <= 0 or self.end is not None:
            return None
        return (self.clock() - self.start) * (total - self.done) / own

    @property
    def remaining(self) -> str:
        """The time to go, "0:12:30 left"; where that is unknown, or after the end, the time that it has taken."""
        left, taken = self.left, (self.clock() if self.end is None else self.end) - self.start
        minutes, seconds = divmod(round(taken if left is None else left), 60)
        return f"{minutes // 60}:{minutes % 60:02}:{seconds:02}{'' if left is None else ' left'}"

    @property
    def is_due(self) -> bool:
        """Whether it is time for a line in a file."""
        total, now = self.phase.total, self.clock()
        if not total or not self.phase.unit or self.done >= total or now - self.printed_at < LINE_SECONDS:
            return False
        return self.done - self.printed >= LINE_SHARE * total

    def line(self) -> str:
        """A line for a file, of a phase with a total; the next one is due later."""
        self.printed_at, self.printed = self.clock(), self.done
        return f"{self.phase.case}, {self.phase.name}: {self.count}{'' if self.left is None else f', {self.remaining}'}"


class Bars:
    """The phases of one case, also those that are over, in one display.

    Args:
        console: of the standard error, if not stated.
        clock: gives the time in seconds.
    """

    def __init__(self, console: Console | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn
        from rich.table import Column

        def text(content: str, style: str = "none") -> TextColumn:
            return TextColumn(content, style=style, markup=False, table_column=Column(no_wrap=True))

        self.console, self.clock = console or Console(stderr=True), clock
        self.is_live = self.console.is_terminal and not self.console.is_dumb_terminal
        is_roomy = self.console.width >= ROOMY
        self._display = Progress(
            text("{task.fields[phase].case}, {task.fields[phase].name}" if is_roomy else "{task.fields[phase].name}"),
            BarColumn(bar_width=20 if is_roomy else 4),
            text("{task.fields[state].count}"),
            text("{task.fields[state].remaining}", "cyan"),
            console=self.console,
            transient=True,
            redirect_stdout=False,
            refresh_per_second=4,
        )
        self._open = 0

    @contextmanager
    def bar(self, phase: Phase) -> Iterator[Advance]:
        """Shows a phase as long as the body lasts, and those before it."""
        state = State(phase, self.clock)
        task = self._display.add_task("", total=phase.total, state=state, phase=phase) if self.is_live else None

        def advance(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
            state.advance(count, failed=failed, known=known)
            if task is not None:
                self._display.update(task, completed=state.done)
            elif state.is_due:
                print(state.line(), file=self.console.file, flush=True)

        if self.is_live and not self._open:
            self._display.start()
        self._open += 1
        try:
            yield advance
        finally:
            state.end = self.clock()
            if task is not None:
                self._display.update(task, total=max(state.done, 1), completed=max(state.done, 1))
            self._open -= 1
            if self.is_live and not self._open:
                self._display.stop()
