"""A part: one thing that a case may ask for of each curve; and what becomes of it."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from time import monotonic
from typing import Any, Literal

from fpsolve.case.case import Case, Curve
from fpsolve.data import Quantity
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Moment
from fpsolve.exponent.method import Budget
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import STABILITY_INDEX
from fpsolve.page.page import Block, Drawing
from fpsolve.results.curve import CurveResult, SimulatedCurve
from fpsolve.results.table import Row
from fpsolve.signals import is_interrupt

Settings = Mapping[str, Any]
"""What is asked of a part, as JSON can hold it: with the curve and the `Numerics` it decides its numbers."""
SOON = 1.0
"""Seconds after which what is known of a curve is kept."""


@dataclass(frozen=True, eq=False)
class Numerics:
    """How all curves of a case are solved.

    Attributes:
        rtol, budget, mesh: as for `moment_lyapunov`.
        is_stated: whether a case names what it wants, so that what there is not is told of.
    """

    rtol: float
    budget: Budget
    mesh: CylinderMesh | None
    is_stated: bool = True

    @classmethod
    def of(cls, case: Case) -> Numerics:
        return cls(case.rtol, case.budget, case.cylinder_mesh(), case.output.lists_quantities)

    def solver(self, problem: Problem) -> ExponentSolver:
        """What solves Λ(p) of a problem."""
        return ExponentSolver(problem, self.mesh, rtol=self.rtol, budget=self.budget)


@dataclass(frozen=True)
class Reason:
    """Why a number is missing.

    Attributes:
        kind: whether it is known that there is none, or that there is none of this kind of problem, or solving failed.
        message: why.
        symbol: what the number is called.
    """

    kind: Literal["absent", "impossible", "failed"]
    message: Message
    symbol: str


@dataclass(frozen=True, eq=False)
class Entry:
    """What became of a part of a curve.

    Attributes:
        found: what was found; None where nothing was.
        reason: why nothing was.
        seconds: how long the processor took.
    """

    found: Any
    reason: Reason | None = None
    seconds: float = 0.0


def attempt(solve: Callable[[], Any], symbol: str) -> Any:
    """What is solved, or the `Reason` why it is missing, which takes nothing else with it."""
    try:
        return solve()
    except FpsolveError as failure:
        message = failure.message
    except MemoryError:
        message = Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)
    except OSError:
        raise
    except Exception as failure:
        message = fault(failure)
    return Reason("failed", message, symbol)


def fault(failure: Exception) -> Message:
    """What is said of a fault of fpsolve. Raises `KeyboardInterrupt` where it is an interrupt in disguise."""
    if is_interrupt(failure):
        raise KeyboardInterrupt from failure
    last = traceback.extract_tb(failure.__traceback__)[-1]
    said = {"kind": type(failure).__name__, "text": str(failure)}
    return Message(Code.FAULT, **said, file=Path(last.filename).name, line=last.lineno)


class Job:
    """The work on one curve: what it is solved with, and what its parts have found by now.

    Args:
        curve: the parameter set.
        numerics: how it is solved.
        entries: of the parts that are known, by name.
        begun: Λ(p) that an interrupted run knew, by p.
        progress: called after each moment.
        keep: takes the job now and then, see `SOON`.

    Attributes:
        pictures: what is drawn and not recorded, by the names of parts.
        meter: of all numbers of the curve.
    """

    def __init__(
        self,
        curve: Curve,
        numerics: Numerics,
        entries: Mapping[str, Entry] | None = None,
        begun: Mapping[float, Moment] | None = None,
        progress: Callable[[], None] = lambda: None,
        keep: Callable[[Job], None] = lambda _: None,
    ) -> None:
        self.curve, self.numerics = curve, numerics
        self.entries, self.begun = dict(entries or {}), dict(begun or {})
        self.pictures: dict[str, Any] = {}
        self.meter = numerics.budget.meter()
        self._progress, self._keep, self._kept_at = progress, keep, monotonic()

    @cached_property
    def solver(self) -> ExponentSolver:
        """The solver of Λ(p), which all parts share."""
        return self.numerics.solver(self.curve.problem)

    def found(self, name: str) -> Any:
        """What a part found; None where that is nothing."""
        return entry.found if (entry := self.entries.get(name)) else None

    @property
    def root(self) -> float | None:
        """δ_p, if it is known."""
        return None if (index := self.found(STABILITY_INDEX.name)) is None else float(index.value)

    def advance(self) -> None:
        """Report a moment, and keep what is known."""
        self._progress()
        self.grow()

    def grow(self) -> None:
        """Keep what is known, if that was not done just now."""
        if monotonic() - self._kept_at >= SOON:
            self.keep()

    def keep(self) -> None:
        """Keep what is known."""
        self._keep(self)
        self._kept_at = monotonic()


def _nothing(*_: Any) -> tuple[()]:
    return ()


def _no_row(*_: Any) -> Row:
    return {}


@dataclass(frozen=True, eq=False)
class Part:
    """One thing that a case may ask for of each curve.

    Attributes:
        name: in a record and among the `parts` of a result.
        settings: what a case asks of it for the curve with a number; None where it asks for nothing.
        solve: finds it, or gives the `Reason` why there is none; None where it follows from other parts. Raises
            `FpsolveError`.
        kind: the type of what is found, which a record holds.
        symbol: what messages call it; empty where nobody is told why there is none.
        said: the messages about what was found.
        columns: the columns of tables that a case asks for.
        row: the numbers of a curve in these columns.
        content: what summary.json has of it beyond the tables; None where it is not asked for.
        files: writes into a folder the files that a curve has beyond the tables.
        draw: writes into a folder what a curve has beyond a record, so that a further run solves it again.
        show: what a terminal and a report say of each of a few curves.
        figures: of a curve in a folder, beside its simulation if there is one.
        reasons: why some of it is missing.
        lacks: whether it lacks something that is asked for, as another part lacks it.
        uses_solver: whether rtol and the mesh of Λ(p) decide its numbers.
    """

    name: str
    settings: Callable[[Case, int], Settings | None] = lambda *_: None
    solve: Callable[[Job, Settings], Any] | None = None
    kind: Any = None
    symbol: str = ""
    said: Callable[[Any, Curve, Numerics], Iterable[Message]] = _nothing
    columns: Callable[[Case], Sequence[Quantity]] = _nothing
    row: Callable[[Case, CurveResult], Row] = _no_row
    content: Callable[[Case, CurveResult], Mapping[str, Any]] = _no_row
    files: Callable[[CurveResult, Path], None] | None = None
    draw: Callable[[Any, Curve, Path], None] | None = None
    show: Callable[[Case, CurveResult], Iterable[Block]] = _nothing
    figures: Callable[[Case, CurveResult, Path, SimulatedCurve | None], Iterable[Drawing]] | None = None
    reasons: Callable[[Any], Iterable[Message]] = _nothing
    lacks: Callable[[Any, Settings], bool] = lambda *_: False
    uses_solver: bool = True

    @property
    def is_drawn(self) -> bool:
        """Whether there is more than a record holds."""
        return self.draw is not None
