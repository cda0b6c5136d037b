"""A question: one thing that a case may ask for of each parameter set; and what becomes of it."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import le
from pathlib import Path
from time import monotonic
from types import GenericAlias
from typing import Any, Generic, Literal, TypeVar

import numpy as np

from fpsolve.budget import Meter
from fpsolve.case.case import Case, ParameterSet
from fpsolve.data import Quantity
from fpsolve.errors import FpsolveError, MeshError
from fpsolve.exponent.elements import GivenMesh
from fpsolve.exponent.method import Budget
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.faults import shown
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import MOMENT
from fpsolve.signals import is_interrupt
from fpsolve.solve.set_result import MomentColumns, Number, SetResult

Settings = Mapping[str, Any]
"""What is asked by a question, as JSON can hold it: with the set and the `Numerics` it decides its numbers."""
Asked = Mapping[str, Settings]
"""What is asked of a parameter set, by the names of questions."""
Limit = tuple[float, float]
"""Unknowns and seconds of a budget."""
Numbers = Mapping[Quantity, Number]
"""Those of a parameter set by their quantities, and their errors by those of these; None where there is none."""
Found = TypeVar("Found")
SOON = 1.0
"""Seconds after which what is known of a parameter set is kept."""
UNFINISHED = Message(Code.UNFINISHED)
"""What is said where some is not known yet."""


@dataclass(frozen=True, eq=False)
class Numerics:
    """How all parameter sets of a case are solved.

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

    @property
    def limit(self) -> Limit:
        """The limits of the budget."""
        return self.budget.unknowns or math.inf, self.budget.seconds

    def settles(self, limit: Limit | None) -> bool:
        """Whether what was found within a limit need not be sought again."""
        return limit is None or all(map(le, self.limit, limit))

    def solver(self, problem: Problem) -> ExponentSolver:
        """What solves Λ(p) of a problem."""
        return ExponentSolver(problem, self.mesh, rtol=self.rtol, budget=self.budget)


def refuse_mesh(case: Case) -> None:
    """Refuse a mesh that cannot be read or made, has too many unknowns, or does not serve the first parameter set.

    Raises:
        CaseError: it does not.
    """
    stated = case.mesh.model_dump(exclude_none=True)
    try:
        with np.errstate(all="ignore"):
            method = Numerics.of(case).solver(next(case.sets()).problem).method if stated else None
            if isinstance(method, GivenMesh):
                space, most = method.generators[0].chosen, case.budget.most(method.generators[0].chosen)
                if space.size > most:
                    raise MeshError(
                        f"makes {space.size} unknowns; must be at most budget.unknowns = {most}; use fewer cells or "
                        f"lower degrees, or budget.unknowns = {space.size}"
                    )
    except (MeshError, OSError, ValueError) as failure:
        place, value = (("mesh", "file"), case.mesh.file) if case.mesh.file else (("mesh",), stated)
        raise case.refusal(f"got {shown(value)}; {failure}", *place) from None


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
class Entry(Generic[Found]):
    """What became of a question.

    Attributes:
        found: what was found; None where nothing was.
        reason: why nothing was.
        seconds: how long the processor took.
        limit: unknowns and seconds of a budget within which no more is to be found; None where no budget matters.
    """

    found: Found | None
    reason: Reason | None = None
    seconds: float = 0.0
    limit: Limit | None = None


def attempt(solve: Callable[[], Found], symbol: str) -> Found | Reason:
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


def idle(*_: object, **__: object) -> None:
    """What is called where nobody wants to know."""


@dataclass(eq=False)
class Job:
    """The work on one parameter set: what is asked of it, and what is known of it by now.

    Attributes:
        parameter_set: the parameter set.
        asked: what is asked of it, by the names of questions.
        numerics: how it is solved.
        line: where it stands in a file of sets, for the message of one that cannot be solved.
        entries: what became of them, by their names; those that are there are not solved again.
        rows: Λ(p) by p, see `MomentColumns`; those that are there are not solved again.
        new: the entries that were solved now.
        largest: the p of the largest size that an earlier run has solved by elements, and what it was solved on.
        pictures: what is drawn and not recorded, by the names of questions.
        progress: called after each moment.
        keep: takes the job now and then, see `SOON`.
    """

    parameter_set: ParameterSet
    asked: Asked
    numerics: Numerics
    line: str = ""
    entries: dict[str, Entry[Any]] = field(default_factory=dict)
    rows: dict[float, Sequence[float]] = field(default_factory=dict)
    new: dict[str, Entry[Any]] = field(default_factory=dict)
    largest: tuple[float, dict[str, object]] | None = None
    pictures: dict[str, Any] = field(default_factory=dict)
    progress: Callable[[], None] = idle
    keep: Callable[[Job], None] = idle
    _kept_at: float = field(default_factory=monotonic)

    @cached_property
    def meter(self) -> Meter:
        """Of all numbers of the parameter set."""
        return self.numerics.budget.meter()

    @cached_property
    def solver(self) -> ExponentSolver:
        """The solver of Λ(p), which all questions share."""
        return self.numerics.solver(self.parameter_set.problem)

    @property
    def columns(self) -> MomentColumns:
        """Λ(p) at the p that are asked for and known."""
        rows = [(p, *self.rows[p]) for p in self.asked[MOMENT.name]["p"] if p in self.rows]
        return MomentColumns(*np.array(rows).reshape(-1, 7).T)

    @property
    def is_whole(self) -> bool:
        """Whether all is known; without Λ(p) there is nothing else."""
        moments = self.entries.get(MOMENT.name)
        return self.asked.keys() <= self.entries.keys() or (moments is not None and moments.reason is not None)

    def found(self, name: str) -> Any:
        """What was found; None where that is nothing."""
        return entry.found if (entry := self.entries.get(name)) else None

    def add(self, name: str, entry: Entry[Any]) -> None:
        """Take what became of a question."""
        self.entries[name] = self.new[name] = entry
        self.grow()

    def advance(self) -> None:
        """Report a moment, and keep what is known."""
        self.progress()
        self.grow()

    def grow(self) -> None:
        """Keep what is known, if that was not done just now."""
        if monotonic() - self._kept_at >= SOON:
            self.keep(self)
            self._kept_at = monotonic()


@dataclass(frozen=True, eq=False)
class Question:
    """One thing that a case may ask for of each parameter set.

    Attributes:
        name: in a record and among the `parts` of a result.
        asked: what a case asks of it for the parameter set with a number; None where it asks for nothing.
        solve: finds it, or gives the `Reason` why there is none; None where it follows from others. Raises
            `FpsolveError`.
        kind: the type of what is found, which a record holds.
        symbol: what messages call it; empty where nobody is told why there is none.
        said: the messages about what was found.
        lacks: why some of what is asked for is not there.
        numbers: those of a set that a case asks for, by their quantities; of none, the quantities without numbers.
        draws: whether files show it of which no record holds the numbers, so that it is solved again for them.
    """

    name: str
    asked: Callable[[Case, int], Settings | None] = lambda *_: None
    solve: Callable[[Job, Settings], Any] | None = None
    kind: Any = None
    symbol: str = ""
    said: Callable[[Any, ParameterSet, Numerics], Iterable[Message]] = lambda *_: ()
    lacks: Callable[[Any, Settings], Iterable[Message]] = lambda *_: ()
    numbers: Callable[[Case, SetResult | None], Numbers] = lambda *_: {}
    draws: bool = False

    @property
    def entry(self) -> GenericAlias:
        """The form of its `Entry`."""
        return GenericAlias(Entry, (self.kind,))
