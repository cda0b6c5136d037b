"""What fpsolve raises. Bad parameters raise `model.faults.ParameterError`, a `ValueError`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Remedy(StrEnum):
    """What to do about a failure, as it ends a message; those who work with case files are told in their own words."""

    MESH = "use more cells or a wider noise interval, or let the mesh be chosen"
    CELLS = "use more cells in a given mesh, or a smaller rtol where it is chosen"
    REACH = "use a mesh that reaches there, or let it be chosen"
    BUDGET = "use a larger rtol or a larger budget"
    MESH_FILE = "make one with `write_mesh`"
    REDUCTION = "or the Ornstein-Uhlenbeck reduction of the noise"
    NO_REDUCTION = "the unreduced noise keeps Eq. (7)"
    FOLDER = "choose another folder"


class FpsolveError(Exception):
    """Base of every error that fpsolve raises on purpose; its text says what to do."""


class NoSuchExponent(FpsolveError):
    """Λ(p) does not exist for this noise and this p: it is infinite."""


class NoPerturbationTheory(FpsolveError):
    """Second-order perturbation theory does not apply to this motion or this noise."""


class MeshError(FpsolveError):
    """A mesh that cannot carry the problem: not a tensor grid, or no line at an impact."""


class OutputError(FpsolveError):
    """A place where results cannot be written."""


class NotConverged(FpsolveError):
    """The eigenvalue iteration did not settle.

    Attributes:
        reason: what happened.
        partial: the best result that was reached, or None where there is none.
    """

    def __init__(self, reason: str, partial: Any = None, remedy: str = "") -> None:
        super().__init__(f"{reason}; {remedy}" if remedy else reason)
        self.reason, self.partial = reason, partial


@dataclass(frozen=True)
class Fault:
    """One thing wrong with a file: which key, on which line, and the sentence that says how to mend it."""

    key: str
    line: int | None
    sentence: str


class CaseError(FpsolveError):
    """A case file that cannot be run; the text has one line for each fault of the file, at most `SHOWN` of them."""

    SHOWN = 50

    def __init__(self, file: str, faults: Sequence[Fault]) -> None:
        self.file, self.faults = file, tuple(faults)
        lines = [self._line(fault) for fault in self.faults[: self.SHOWN]]
        more = len(self.faults) - len(lines)
        super().__init__("\n".join([*lines, f"{file}: and {more} more"] if more else lines))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.file, self.faults)

    def _line(self, fault: Fault) -> str:
        place = self.file if fault.line is None else f"{self.file}:{fault.line}"
        return f"{place}: {fault.key}: {fault.sentence}" if fault.key else f"{place}: {fault.sentence}"
