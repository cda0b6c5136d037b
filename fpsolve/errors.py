"""What fpsolve raises. Bad parameters raise `model.faults.ParameterError`, a `ValueError`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fpsolve.messages import Message, escaped, message_of
from fpsolve.messages import Remedy as Remedy


class FpsolveError(Exception):
    """Base of every error that fpsolve raises on purpose; its text says what to do.

    >>> raise FpsolveError("nothing was solved", "state a larger budget")
    Traceback (most recent call last):
    fpsolve.errors.FpsolveError: nothing was solved; state a larger budget

    Attributes:
        message: the text, as data.
    """

    def __init__(self, reason: str, remedy: str | None = None) -> None:
        self.message = message_of(reason).advising(remedy) if remedy else message_of(reason)
        super().__init__(self.message)


class NoSuchExponent(FpsolveError):
    """Λ(p) does not exist for this noise and this p, as where it is infinite, or is not computed for such a system."""


class NoPerturbationTheory(FpsolveError):
    """Second-order perturbation theory does not apply to this motion or this noise."""


class NoHierarchy(FpsolveError):
    """The equations of the moments do not close for this problem, or for this p."""


class MeshError(FpsolveError):
    """A mesh that cannot carry the problem: not a tensor grid, or no line at an impact."""


class OutputError(FpsolveError):
    """A place where results cannot be written."""


class WorkersDied(FpsolveError):
    """Processes that solve have ended before their work."""


class NotConverged(FpsolveError):
    """A number is not resolved: the iteration did not settle, or a budget or the elements do not suffice.

    >>> moment_lyapunov(problem, 60.0, budget=Budget(unknowns=100))
    Traceback (most recent call last):
    fpsolve.errors.NotConverged: ...

    Attributes:
        reason: what happened, without what to do.
        partial: the best result that was reached, or None where there is none.
    """

    def __init__(self, reason: str, partial: object = None, remedy: str | None = None) -> None:
        super().__init__(reason, remedy)
        self.partial = partial

    @property
    def reason(self) -> Message:
        """What happened, without what to do."""
        return self.message.advising(None)

    def advising(self, remedy: str) -> NotConverged:
        """The same with another remedy."""
        return type(self)(self.reason, self.partial, remedy)


class NumericalFailure(ArithmeticError):
    """Numbers became too large, or are none."""


class SingularMatrix(NumericalFailure):
    """A matrix without LU factors, or one of which no iteration finds an eigenvalue."""


@dataclass(frozen=True)
class Fault:
    """One thing wrong with a file: which key, on which line, and the sentence that says how to mend it."""

    key: str
    line: int | None
    sentence: str


class CaseError(FpsolveError):
    """A case file that cannot be run; the text has one line for each fault of the file, at most `SHOWN` of them.

    >>> load_case("none.toml")
    Traceback (most recent call last):
    fpsolve.errors.CaseError: none.toml: no such file...
    """

    SHOWN = 50

    def __init__(self, file: str, faults: Sequence[Fault]) -> None:
        self.file, self.faults = file, tuple(faults)
        lines = [self._line(fault) for fault in self.faults[: self.SHOWN]]
        more = len(self.faults) - len(lines)
        super().__init__("\n".join(map(escaped, [*lines, f"{file}: and {more} more"] if more else lines)))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.file, self.faults)

    def _line(self, fault: Fault) -> str:
        place = self.file if fault.line is None else f"{self.file}:{fault.line}"
        return f"{place}: {fault.key}: {fault.sentence}" if fault.key else f"{place}: {fault.sentence}"
