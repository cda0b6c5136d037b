"""What was solved of a case: figures, tables, what the numbers mean, pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.model.quantity import RATE_FUNCTION
from fpsolve.output.figures import draw, draw_rates, draw_sensitivities
from fpsolve.page.page import Block, Drawing, Sentence
from fpsolve.show import curves, excursions, intervals, moments, plots, response
from fpsolve.show.eigenfunctions import directions_of, eigenfunctions_of
from fpsolve.show.limits import EACH, PICTURES
from fpsolve.show.text import duration, plural
from fpsolve.study.results import CurveResult, SimulatedCurve


def show(
    case: Case, results: Sequence[CurveResult], folder: Path, simulated: Sequence[SimulatedCurve] = ()
) -> Iterator[Block]:
    """The solved curves, one by one or in one table, beside those that are simulated."""
    over = "p" if case.figure.x == "p" else case.about(case.figure.x).words
    title = f"The {case.figure.quantity.words}, {case.figure.quantity.symbol}, over {over}"
    plot = partial(plots.of_moments, case, results)
    yield Drawing(title, partial(draw, case, results, simulated, folder), plot=plot)
    yield Drawing(f"The {RATE_FUNCTION.words}, {RATE_FUNCTION.symbol}", partial(draw_rates, case, results, folder))
    has_tables = len(results) <= EACH and case.figure.x == "p"
    if not has_tables:
        yield from curves.show(case, results)
    drawn = results[:PICTURES]
    eigenfunctions = eigenfunctions_of(case, [result.curve for result in drawn], folder)
    for place, result in enumerate(results if len(results) <= EACH else drawn):
        told: list[Block] = []
        if has_tables:
            told += moments.show_tables(case, result)
        if len(results) <= EACH:
            told += moments.show_meaning(case, result)
            told += excursions.show(case, result)
            told += intervals.show(case, result)
            told += response.show(case, result)
        if place < PICTURES:
            job = partial(draw_sensitivities, case, [result], folder)
            told.append(Drawing(f"Effect of the parameters{result.curve.of}", job))
            told += directions_of(case, result, folder)
            told += response.draw(case, result, simulated, folder)
            told += [each] if (each := eigenfunctions.get(result.curve.number)) else []
        if any(not isinstance(each, Drawing) for each in told):
            yield Sentence("", case.heading(result.curve) if has_tables else result.curve.label)
        yield from told


def last_line(folder: Path, what: str, seconds: float, known: str = "") -> Sentence:
    """Where the results are, what they are, how long they took, and what an earlier run had done."""
    return Sentence(f"written: {folder} ({what}, {duration(seconds)}{f'; {known}' if known else ''})")


def done_of(case: Case, done: int, failed: int = 0, fault: str = "not converged") -> str:
    """How many curves of a case are done: "3 curves", "2 of 3 curves, 1 not converged"."""
    count = f"{done} of {case.planned}" if done < case.planned else f"{done}"
    return f"{count} {plural('curve', case.planned)}{f', {failed} {fault}' if failed else ''}"


def known_of(case: Case, known: int, outdated: int) -> str:
    """How many of its curves an earlier run had done, and how many records another version has written, if any."""
    parts = [f"{known} of {case.planned} known from an earlier run"] * bool(known)
    parts += [f"{outdated} {plural('record', outdated)} of another version not used"] * bool(outdated)
    return "; ".join(parts)
