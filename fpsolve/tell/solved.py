"""What was solved of a case: figures, tables, what the numbers mean, pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.results.table import Table
from fpsolve.solve.curve import CurveResult, SimulatedCurve
from fpsolve.solve.questions import BY_NAME
from fpsolve.tell import curves
from fpsolve.tell.blocks import Block, Drawing, Sentence
from fpsolve.tell.figures import main_figure, rate_figure
from fpsolve.tell.limits import EACH, PICTURES, ROWS_OVER_P
from fpsolve.tell.numbers import OF_CURVE, moment_grid
from fpsolve.tell.pictures import FIGURES
from fpsolve.tell.text import duration, plural
from fpsolve.tell.verdict import meaning, verdicts


def show(
    case: Case,
    results: Sequence[CurveResult],
    folder: Path,
    simulated: Sequence[SimulatedCurve] = (),
    table: Table | None = None,
    *,
    is_whole: bool = True,
) -> Iterator[Block]:
    """The verdict, the solved curves in one table, and a few one by one, beside those that are simulated.

    Args:
        table: the numbers of all curves, if these are known already.
        is_whole: whether also a few of several curves are told of one by one, and Λ(p) at each of many p.
    """
    table = Table(case, results) if table is None else table
    yield from verdicts(case, results, table)
    yield main_figure(case, results, simulated, table)
    yield rate_figure(case, results)
    samples = {each.curve.number: each for each in simulated}
    if len(results) > 1 or case.figure.x != "p":
        yield from curves.show(case, results, table)
    for place, result in enumerate(results if len(results) <= EACH else results[:PICTURES]):
        if not result.curve.is_possible:
            continue
        if len(results) == 1 or (is_whole and len(results) <= EACH):
            told, p = [*told_of(case, result)], result.moments.p
            has_indices = any(result.estimates.values())  # which has Λ(2), too
            if (
                case.figure.x == "p"
                and (is_whole or p.size <= ROWS_OVER_P)
                and (p != 2 if has_indices else p == p).any()
            ):
                told.append(moment_grid(case, result))
            yield from [Sentence("", result.curve.label), *told] if told else ()
        if place < PICTURES:
            yield from figures_of(case, result, folder, samples)


def told_of(case: Case, result: CurveResult) -> Iterator[Block]:
    """What is told of one curve, but for its verdict and Λ(p)."""
    yield from (block for tell in OF_CURVE for block in tell(case, result))
    yield from meaning(result)


def figures_of(
    case: Case, result: CurveResult, folder: Path, simulated: Mapping[int, SimulatedCurve]
) -> Iterator[Drawing]:
    """The figures of a curve, beside the simulations by the numbers of their curves."""
    for draw in FIGURES.values():
        yield from draw(case, result, folder, simulated.get(result.curve.number))


def write_figures(
    case: Case, results: Sequence[CurveResult], simulated: Sequence[SimulatedCurve], folder: Path, table: Table
) -> None:
    """Write all figures that have files: those of all curves together, and those of each."""
    main_figure(case, results, simulated, table).write(folder)
    rate_figure(case, results).write(folder)
    samples = {each.curve.number: each for each in simulated}
    of_first, of_others = (any(BY_NAME[name].asked(case, number) is not None for name in FIGURES) for number in (1, 2))
    for result in results if of_others else results[:1] if of_first else ():
        for figure in figures_of(case, result, folder, samples):
            figure.write(folder)


def last_line(folder: Path, what: str, seconds: float, known: str = "") -> Sentence:
    """Where the results are, what they are, how long they took, and what an earlier run had done."""
    return Sentence(f"written: {folder} ({what}, {duration(seconds)}{f'; {known}' if known else ''})")


def done_of(case: Case, done: int, failed: int = 0, fault: str = "not converged") -> str:
    """How many curves of a case are done: "3 curves", "2 of 3 curves, 1 not converged"."""
    count = f"{done} of {case.planned}" if done < case.planned else f"{done}"
    return f"{count} {plural('curve', case.planned)}{f', {failed} {fault}' if failed else ''}"


def known_of(case: Case, known: int) -> str:
    """How many of its curves an earlier run had done, if any."""
    return f"{known} of {case.planned} known from an earlier run" if known else ""
