"""Whom to tell how it goes: phases of work, each with its progress, and what is found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Protocol

from fpsolve.case.case import Case
from fpsolve.study.results import CurveResult, SimulatedCurve

SETS, MOMENTS, NODES, POINTS, BOUNDS, PERCENT = "sets", "p", "nodes", "points", "bounds", "%"
"""What a phase counts."""


@dataclass(frozen=True)
class Phase:
    """A stretch of the work on a case.

    Attributes:
        case: its name.
        name: such as "solving".
        total: how many steps it has; None where nobody knows.
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


def unheeded(count: int = 1, *, failed: int = 0, known: bool = False) -> None:
    """Progress that nobody is told of."""


@dataclass(frozen=True)
class Watch:
    """Whom to tell how it goes; by default nobody.

    Attributes:
        bar: gives a phase what it shall call for its progress; a chart has two phases at a time.
        solved: takes a case and its curves once they are solved.
        simulated: takes a case, its simulated curves, and those that are solved too.
    """

    bar: Callable[[Phase], AbstractContextManager[Advance]] = lambda _: nullcontext(unheeded)
    solved: Callable[[Case, Sequence[CurveResult]], None] = lambda *_: None
    simulated: Callable[[Case, Sequence[SimulatedCurve], Sequence[CurveResult]], None] = lambda *_: None


NOBODY = Watch()
