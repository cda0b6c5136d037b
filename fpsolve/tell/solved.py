"""What was solved of a case: figures, tables, what the numbers mean, pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.results.table import Table
from fpsolve.solve.set_result import SetResult, SimulatedSet
from fpsolve.solve.sets import everything
from fpsolve.tell import sets
from fpsolve.tell.blocks import Block, Drawing, Sentence
from fpsolve.tell.figures import main_figure, rate_figure
from fpsolve.tell.numbers import excursions, meaning, moment_grid, response, summary_numbers, verdicts
from fpsolve.tell.pictures import FIGURES
from fpsolve.tell.text import EACH, PICTURES, ROWS_OVER_P, duration, plural


def show(
    case: Case,
    results: Sequence[SetResult],
    folder: Path,
    simulated: Sequence[SimulatedSet] = (),
    table: Table | None = None,
    *,
    is_whole: bool = True,
) -> Iterator[Block]:
    """The verdict, the solved parameter sets in one table, and a few one by one, beside those that are simulated.

    Args:
        table: the numbers of all parameter sets, if these are known already.
        is_whole: whether also a few of several parameter sets are told of one by one, and Λ(p) at each of many p.
    """
    table = Table(case, results) if table is None else table
    yield from verdicts(case, results, table)
    yield main_figure(case, results, simulated, table)
    yield rate_figure(case, results)
    samples = {each.parameter_set.number: each for each in simulated}
    if len(results) > 1 or case.figure.x != "p":
        yield from sets.show(case, results, table)
    is_each = len(results) == 1 or (is_whole and len(results) <= EACH)
    for place, result in enumerate(results if len(results) <= EACH else results[:PICTURES]):
        if not result.parameter_set.is_possible:
            continue
        parts = summary_numbers(case, result), excursions(case, result), response(case, result), meaning(result)
        told = [*chain(*parts)] if is_each else []
        if is_each and _has_grid(case, result, is_whole=is_whole):
            told.append(moment_grid(case, result))
        if told:
            yield from (Sentence("", result.parameter_set.label), *told)
        if place < PICTURES:
            yield from figures_of(case, result, folder, samples.get(result.parameter_set.number))


def _has_grid(case: Case, result: SetResult, *, is_whole: bool) -> bool:
    """Whether Λ(p) has a table: over p, of few p or where all is told; Λ(2) alone stands beside λ already."""
    p, has_summary_numbers = result.moments.p, any(result.estimates.values())
    is_more = (p != 2).any() if has_summary_numbers else p.size > 0
    return bool(case.figure.x == "p" and (is_whole or p.size <= ROWS_OVER_P) and is_more)


def figures_of(case: Case, result: SetResult, folder: Path, simulated: SimulatedSet | None) -> Iterator[Drawing]:
    """The figures of a parameter set, beside its simulation."""
    return chain.from_iterable(draw(case, result, folder, simulated) for draw in FIGURES.values())


def write_figures(
    case: Case, results: Sequence[SetResult], simulated: Sequence[SimulatedSet], folder: Path, table: Table
) -> None:
    """Write all figures that have files: those of all parameter sets together, and those of each."""
    main_figure(case, results, simulated, table).write(folder)
    rate_figure(case, results).write(folder)
    samples = {each.parameter_set.number: each for each in simulated}
    of_each = FIGURES.keys() & everything(case, 2)
    for result in results if of_each else results[:1]:
        for figure in figures_of(case, result, folder, samples.get(result.parameter_set.number)):
            figure.write(folder)


def last_line(folder: Path, what: str, seconds: float, known: str = "") -> Sentence:
    """Where the results are, what they are, how long they took, and what an earlier run had done."""
    return Sentence(f"written: {folder} ({what}, {duration(seconds)}{f'; {known}' if known else ''})")


def done_of(case: Case, done: int, failed: int = 0, fault: str = "not converged") -> str:
    """How many sets of a case are done: "3 parameter sets", "2 of 3 parameter sets, 1 not converged"."""
    count = f"{done} of {case.planned}" if done < case.planned else f"{done}"
    return f"{count} {plural('parameter set', case.planned)}{f', {failed} {fault}' if failed else ''}"


def known_of(case: Case, known: int) -> str:
    """How many of its parameter sets an earlier run had done, if any."""
    return f"{known} of {case.planned} known from an earlier run" if known else ""
