"""What is kept of work that an interrupt has ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.signals import is_interrupt

AGAIN, ANEW = "run it again to go on", "run it again to start over"


@contextmanager
def saying_if_interrupted(what_is_kept: Callable[[], str], again: str = AGAIN) -> Iterator[None]:
    """An interrupt of the body, also one that a library has made another exception of, says what is kept."""
    try:
        yield
    except BaseException as failure:
        if isinstance(failure, FpsolveError) or not is_interrupt(failure):
            raise
        raise KeyboardInterrupt(f"interrupted{what_is_kept()}; {again}") from None


def kept(done: int, of: str, folder: Path | None = None, *, is_more: bool = False) -> str:
    """How much was done of what, and where that is, if it is kept, or a part of the next."""
    return f" after {done} {of}" + (f"; what was done is kept in {folder}" if (done or is_more) and folder else "")


def of_curves(case: Case) -> str:
    """What is counted of a case: "of 3 curves"."""
    return f"of {case.planned} curve{'s' if case.planned > 1 else ''}"
