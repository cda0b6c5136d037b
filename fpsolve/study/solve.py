"""Solving the curves of a case, alone or in batches, and comparing them with what the case expects.

Batches are of neighbours, but each set begins anew, so that its numbers follow from its parameters alone. (To start
from a neighbour's mesh saves half of the time of one p in strong noise, and nothing of several p, or in weak noise.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from time import process_time
from typing import Any, TypeVar

import numpy as np

from fpsolve.budget import begin
from fpsolve.case.case import Case, Curve
from fpsolve.case.refusals import obstacle
from fpsolve.case.sections import Varied
from fpsolve.exponent.error import Failure, Moment
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.quantities import INDICES
from fpsolve.messages import Code, Message, Severity, message_of
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT
from fpsolve.parts.every import BY_NAME, PARTS
from fpsolve.parts.moments import CLASSES, Moments, unfinished
from fpsolve.parts.moments import PART as MOMENTS
from fpsolve.parts.part import Entry, Job, Numerics, Part, Reason, Settings, attempt
from fpsolve.results.curve import NO_MOMENTS, CurveResult

Kept = TypeVar("Kept")
Asked = Mapping[str, Settings]
"""What is asked of the parts of a curve, by their names."""
BATCHES = 256
"""About so many batches has a case."""
MOST_SETS = 64
"""Largest number of sets of a batch."""


@dataclass(frozen=True, eq=False)
class Solved:
    """A parameter set once it is solved.

    Attributes:
        result: the numbers and messages.
        entries: what became of the parts that were solved now, by their names.
        pictures: what is drawn of it, by the names of parts.
    """

    result: CurveResult
    entries: Mapping[str, Entry]
    pictures: Mapping[str, Any]


def everything(case: Case, number: int = 1) -> Asked:
    """What a case asks for, of the curve with a number."""
    asked = {part.name: part.settings(case, number) for part in PARTS if part.solve}
    return {name: settings for name, settings in asked.items() if settings is not None}


def solve_curve(
    curve: Curve,
    asked: Asked,
    numerics: Numerics,
    progress: Callable[[], None] = lambda: None,
    entries: Mapping[str, Entry] | None = None,
    begun: Mapping[float, Moment] | None = None,
    keep: Callable[[Job], None] = lambda _: None,
) -> Solved:
    """Solve one parameter set, part after part; why something is missing is in its `failures`, `warnings` or `notes`.

    Args:
        curve: the parameter set.
        asked: what is asked of its parts.
        numerics: how it is solved.
        progress: called after each moment.
        entries: of the parts that are known, which are not solved again.
        begun: Λ(p) that an interrupted run knew, by p.
        keep: takes the job as it grows, every `SOON` seconds at most, and when the work is interrupted.
    """
    job = Job(curve, numerics, entries, begun, progress, keep)
    solved, planned = dict[str, Entry](), [part for part in PARTS if part.symbol and part.name in asked]
    job.meter.planned = len(asked[MOMENTS.name]["p"]) + len(planned)
    try:
        with job.meter.running():
            if MOMENTS.name not in job.entries:  # moments of even order take little
                attempt(lambda: [job.solver.method.even(p) for p in asked[MOMENTS.name]["p"]], MOMENTS.symbol)
            first = [BY_NAME[LYAPUNOV_EXPONENT.name]] if choose(curve.problem).is_dear(0.0) else []
            for part in dict.fromkeys((*first, *PARTS)):
                is_known = part.name in job.entries
                if part.solve is None or part.name not in asked or (is_known and not part.is_drawn):
                    continue
                if part is not MOMENTS:
                    begin(part.symbol)
                started = process_time()
                found = attempt(partial(part.solve, job, asked[part.name]), part.symbol)
                if is_known:  # it was drawn again, and its numbers stay as they are
                    continue
                is_missing = isinstance(found, Reason)
                seconds = process_time() - started
                job.entries[part.name] = solved[part.name] = Entry(
                    None if is_missing else found, found if is_missing else None, seconds
                )
                if part is MOMENTS and is_missing:  # nor will there be anything else
                    break
                job.grow()
    except KeyboardInterrupt:
        job.keep()
        raise
    return Solved(result_of(curve, asked, numerics, job.entries), solved, job.pictures)


def result_of(
    curve: Curve,
    asked: Asked,
    numerics: Numerics,
    entries: Mapping[str, Entry],
    begun: Mapping[float, Moment] | None = None,
) -> CurveResult:
    """What the entries of the parts of a curve say together.

    Args:
        curve, asked, numerics: as for `solve_curve`.
        entries: those that are known, by name.
        begun: Λ(p), by p, where others are still being solved.
    """
    if (entry := entries.get(MOMENTS.name)) and entry.reason:
        return failed(curve, entry.reason.message)
    known = {name: entry.found for name, entry in entries.items() if name in asked and entry.found is not None}
    wanted = {p: begun[p] for p in asked.get(MOMENTS.name, {}).get("p", ()) if begun and p in begun}
    moments: Moments = known.get(MOMENTS.name) or (unfinished(curve.problem, wanted) if wanted else Moments(NO_MOMENTS))
    said: dict[Severity, list[Message]] = {each: [] for each in Severity}
    reasons = list[tuple[Part, Reason]]()
    for part in PARTS:
        if part.name in known:
            for message in part.said(known[part.name], curve, numerics):
                said[message.severity].append(message)
        elif (entry := entries.get(part.name)) and entry.reason and part.name in asked and part.symbol:
            reasons.append((part, entry.reason))
    for message in missing(reasons, moments.failures):
        if numerics.is_stated or not message.tells_of(Code.NOT_ONE_RAY):
            said[message.severity].append(message)
    is_whole = all(name in entries or BY_NAME[name].is_drawn for name in asked)
    failures = moments.failures or tuple(Failure(None, message) for message in said[Severity.FAILURE])
    return CurveResult(
        curve=curve,
        moments=moments.columns,
        estimates={name: known.get(name) for name in INDICES},
        discretisation=known.get("discretisation") or None,
        warnings=tuple(said[Severity.WARNING]),
        notes=tuple(said[Severity.NOTE]),
        failures=failures if is_whole else (*failures, Failure(None, Message(Code.UNFINISHED))),
        classes=known.get(CLASSES.name, ()),
        parts={name: found for name, found in known.items() if name not in _OWN},
        seconds=sum(entry.seconds for name, entry in entries.items() if name in asked),
    )


_OWN = {MOMENTS.name, *INDICES, CLASSES.name, "discretisation"}
"""Names of parts that have attributes of their own in a result."""


def missing(reasons: Sequence[tuple[Part, Reason]], failures: Sequence[Failure]) -> Iterator[Message]:
    """What is said of numbers that are missing, of indices with one reason together.

    Args:
        reasons: by the parts.
        failures: the p at which Λ(p) failed, which others may follow from.
    """
    unsolved = {each.reason: Message(Code.NO_MOMENT, p=each.p) for each in failures if each.p is not None}
    codes = {"absent": Code.INDEX_ABSENT, "impossible": Code.INDEX_MISSING}
    failing = Code.INDEX_MISSING if failures else Code.INDEX_FAILED
    groups = dict[tuple[Code, Message, str], list[str]]()
    for part, reason in reasons:
        message, code = reason.message, codes.get(reason.kind, failing)
        if part.name in _OWN:
            message = unsolved.get(message, message) if reason.kind == "failed" else message
        elif message.severity is not Severity.FAILURE:
            yield message
            continue
        group = "" if part.name in _OWN else part.name
        groups.setdefault((code, message, group), []).append(reason.symbol)
    for (code, message, _), symbols in groups.items():
        yield Message(code, symbols=symbols, reason=message)


@dataclass(frozen=True, eq=False)
class Order:
    """A parameter set to be solved; who solves it makes its curve, so that little is sent.

    Attributes:
        number, varied: of the curve.
        line: where it stands in a file of sets, for the message of one that cannot be solved.
        asked: what of it.
        entries: of the parts that are known.
        begun: Λ(p) that an interrupted run knew, by p.
    """

    number: int
    varied: Varied
    asked: Asked
    line: str = ""
    entries: Mapping[str, Entry] = field(default_factory=dict)
    begun: Mapping[float, Moment] = field(default_factory=dict)


def solve_batch(
    batch: Sequence[Order],
    problem: Problem,
    numerics: Numerics,
    keep: Callable[[Order, Curve, Solved], Kept],
    progress: Callable[[], None] = lambda: None,
    grow: Callable[[Order, Job], None] = lambda *_: None,
) -> list[Kept]:
    """The task: solves some sets, and hands each to `keep` before the next is begun.

    Args:
        batch: the sets.
        problem: that of the case, without what is varied.
        numerics: how they are solved.
        keep: takes an order, its curve and what was found, and returns what the caller needs to know; it pickles.
        progress: called after each moment; only where the task stays in this process.
        grow: takes the work on a set that is not finished.
    """
    kept = list[Kept]()
    for order in batch:
        curve = Curve(problem, order.varied, order.number)
        found = solved(curve, order, numerics, progress, partial(grow, order))
        kept.append(keep(order, curve, found))
    return kept


def batches(case: Case, order: Callable[[int, Varied], Order | None]) -> Iterator[tuple[Order, ...]]:
    """All batches of a case, without the sets of which nothing is wanted; the first sets come one by one.

    So whoever begins sees soon how long they take.

    Args:
        case: whose sets these are.
        order: gives the order of a set from the number of its curve and what is varied.
    """
    size = min(max(case.planned // BATCHES, 1), MOST_SETS)  # from the case alone
    starts = [*range(min(size, case.planned)), *range(size, case.planned, size), case.planned]
    for start, stop in pairwise(starts):
        if found := tuple(filter(None, map(order, range(start + 1, stop + 1), case.vary.sets[start:stop]))):
            yield found


def solved(
    curve: Curve,
    order: Order,
    numerics: Numerics,
    progress: Callable[[], None] = lambda: None,
    grow: Callable[[Job], None] = lambda _: None,
) -> Solved:
    """What is wanted of a set; where that cannot be found, a result that says why.

    That of a set which contradicts itself, or overflows, as those of a small case are refused for, is not kept.
    """
    p = np.array(order.asked[MOMENTS.name]["p"])
    if reason := obstacle(curve.base, curve.varied, p, with_moments=False):
        return Solved(failed(curve, f"{order.line}{reason}"), {}, {})
    found = attempt(
        lambda: solve_curve(curve, order.asked, numerics, progress, order.entries, order.begun, grow), curve.label
    )
    return Solved(failed(curve, found.message), {}, {}) if isinstance(found, Reason) else found


def failed(curve: Curve, reason: str) -> CurveResult:
    """The result of a curve of which nothing was found."""
    return CurveResult(curve, NO_MOMENTS, dict.fromkeys(INDICES), failures=(Failure(None, message_of(reason)),))
