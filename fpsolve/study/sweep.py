"""The parameter sets of a case as tasks: batches of neighbours, each solved by itself, by whoever has time.

Each set begins anew, so that its numbers follow from its parameters alone. (To start from a neighbour's mesh saves half
of the time of one p in strong noise, and nothing of several p, or in weak noise.)
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from fpsolve.case.case import Case, Curve
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Failure
from fpsolve.exponent.quantities import INDICES
from fpsolve.messages import Code, Message, Remedy, message_of
from fpsolve.study.results import CurveResult, MomentColumns, Solved
from fpsolve.study.solve import Numerics, Wanted, solve_curve, solve_functions

Kept = TypeVar("Kept")
BATCHES, MOST_SETS = 256, 64
"""About so many batches has a case, unless these are larger than that."""


@dataclass(frozen=True, eq=False)
class Order:
    """A parameter set to be solved.

    Attributes:
        curve, wanted: which, and what of it.
        key: of its record.
        is_known: whether there is a record, so that only its eigenfunctions are to be drawn.
    """

    curve: Curve
    wanted: Wanted
    key: str = ""
    is_known: bool = False


def solve_batch(
    batch: Sequence[Order],
    numerics: Numerics,
    keep: Callable[[Order, Solved], Kept],
    progress: Callable[[], None] = lambda: None,
) -> list[Kept]:
    """The task: solves some sets, and hands each to `keep` before the next is begun.

    Args:
        keep: takes an order and what was found, and returns what the caller needs to know; it pickles.
        progress: called after each moment; only where the task stays in this process.
    """
    return [keep(order, solved(order, numerics, progress)) for order in batch]


def batch_size(planned: int) -> int:
    """Sets of a batch, from the case alone."""
    return min(max(planned // BATCHES, 1), MOST_SETS)


def batches(case: Case, order: Callable[[Curve], Order | None]) -> Iterator[tuple[Order, ...]]:
    """All batches of a case, without the sets of which nothing is wanted; the first sets come one by one.

    So whoever begins sees soon how long they take.
    """
    size = batch_size(case.planned)
    starts = [*range(min(size, case.planned)), *range(size, case.planned, size), case.planned]
    for start, stop in pairwise(starts):
        if found := tuple(filter(None, map(order, case.curves(start, stop)))):
            yield found


def solved(order: Order, numerics: Numerics, progress: Callable[[], None] = lambda: None) -> Solved:
    """What is wanted of a set; where that cannot be found, a result that says why, unless its numbers are known."""
    curve, wanted = order.curve, order.wanted
    if order.is_known:
        try:
            return Solved(None, *solve_functions(curve, wanted, numerics))
        except OSError:
            raise
        except Exception:  # its numbers stay as they are
            return Solved(None, (), None)
    try:
        return solve_curve(curve, wanted, numerics, progress)
    except FpsolveError as failure:
        return Solved(failed(curve, failure.message), (), None)
    except MemoryError:
        return Solved(failed(curve, Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)), (), None, True)
    except OSError:
        raise
    except Exception as failure:
        last = traceback.extract_tb(failure.__traceback__)[-1]
        said = {"kind": type(failure).__name__, "text": str(failure)}
        told = Message(Code.FAULT, **said, file=Path(last.filename).name, line=last.lineno)
        return Solved(failed(curve, told), (), None, True)


def failed(curve: Curve, reason: str) -> CurveResult:
    """A result without numbers."""
    nothing = np.zeros(0)
    failures = (Failure(None, message_of(reason)),)
    return CurveResult(curve, MomentColumns(*[nothing] * 7), dict.fromkeys(INDICES), failures=failures)


def lost(curve: Curve) -> CurveResult:
    """The result of a set on which its worker died."""
    return failed(curve, Message(Code.WORKER_DIED, remedy=Remedy.MEMORY))


def result_alone(order: Order, solved: Solved) -> CurveResult | None:
    """For a `solve_batch` that keeps nothing but the numbers."""
    return solved.result
