"""Many curves in one table, a row each; of more than fit the eye, those with the extreme values and the failed ones."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fpsolve.case.case import Case
from fpsolve.case.vary import written
from fpsolve.exponent.quantities import CRITICAL_RESTITUTION, LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX, Index
from fpsolve.model.quantity import moment_at
from fpsolve.output.screen import Column, Grid
from fpsolve.output.tables import asked
from fpsolve.study.results import CurveResult, Status
from fpsolve.theory.far import grows_far_out

MOST_TABLES, MOST_ROWS = 10, 50
"""Curves that have a table each, and that have a row each."""
MOST_FAILED, MOST_MOMENTS, MOST_EXTREMES = 20, 3, 2
"""Failed curves that are named among more, p whose Λ has a column, and quantities whose extremes are shown."""
DIGITS = 7
BEYOND_RTOL = "beyond rtol"
MAIN = (LYAPUNOV_EXPONENT, STABILITY_INDEX)
STAR = "* for the noise reduced by Eqs. (12)-(14)"


@dataclass(frozen=True)
class Shown:
    """A number of a curve that has a column.

    Attributes:
        heading: of the column.
        value: gives it, None where it is not there; None for perturbation theory, of which no extremes are sought.
        text: of it, also where it is not there.
        rank: as of a `Column`.
    """

    heading: str
    value: Callable[[CurveResult], float | None] | None
    text: Callable[[CurveResult], str]
    rank: int = 0


def curve_grid(case: Case, results: Sequence[CurveResult]) -> Grid:
    """A row for each curve: what varies, λ, δ_p, and what else is asked for, or over a parameter the closed forms.

    Of more than `MOST_ROWS` curves the extreme and the failed ones have one.
    """
    quantities = _quantities(case, is_exact=case.is_exact)
    is_digest = len(results) > MOST_ROWS
    chosen = _chosen(results, quantities) if is_digest else [("", result) for result in results]
    has_status = len(results) > MOST_TABLES or any(result.status for _, result in chosen)
    columns = [*varied_columns(case), *(Column(each.heading, each.rank) for each in quantities)]
    is_whole = all(_state(result) == "converged" for _, result in chosen)
    columns += [Column("status", 1 if is_whole else 0)] * has_status + [Column("which", is_text=True)] * is_digest
    is_starred = any("*" in each.heading for each in quantities)
    grid = Grid(case.headline, columns, remark=STAR if is_starred else "")
    for which, result in chosen:
        varied, numbers = map(written, result.curve.varied.values()), (each.text(result) for each in quantities)
        grid.rows.append([*varied, *numbers, *[_state(result)] * has_status, *[which] * is_digest])
    return grid


def counted(results: Sequence[CurveResult]) -> str:
    """How many curves have become what, which of them have a row, and where all numbers are."""
    counts = Counter((result.status, _state(result) == BEYOND_RTOL, _state(result)) for result in results)
    states = ", ".join(f"{count} {state}" for (*_, state), count in sorted(counts.items()))
    lacking = sum(bool(result.status) for result in results)
    is_short = len(results) > MOST_ROWS and lacking > MOST_FAILED
    shown = f"; of those that are not converged the first {MOST_FAILED} are shown" if is_short else ""
    return f"{len(results)} curves: {states}{shown}; all numbers are in curves.csv and results.nc"


def _state(result: CurveResult) -> str:
    """What became of a curve, for the eye; one that converged may be less precise than rtol asks for."""
    return BEYOND_RTOL if result.status == Status.CONVERGED and result.misses_rtol else result.status.name.lower()


def varied_columns(case: Case) -> list[Column]:
    """A column for each varied key, without its section."""
    return [Column(key.partition(".")[2]) for key in case.vary.keys]


def theory_heading(equation: str, *, is_exact: bool) -> str:
    """Heading of a column of perturbation theory, starred where it has another noise than some solution."""
    return f"Eq. {equation}{'*' if is_exact else ''}"


def index_text(index: Index, result: CurveResult, most: int) -> str:
    """An index of a curve with its digits, or that there is none."""
    estimate = result.estimates[index.name]
    if estimate is not None:
        return digits(estimate.value, estimate.error_estimate, most)
    return "none" if index == CRITICAL_RESTITUTION or grows_far_out(result.curve.problem) else "none found"


def digits(value: float, error: float, most: int = 13) -> str:
    """A number with the digits that its error leaves, at most so many significant ones; 0 where it leaves none."""
    if abs(value) <= error:
        return "0"
    count = most if error <= 0 else math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f"{value:#.{min(max(count, 1), most)}g}".rstrip(".")


def _quantities(case: Case, *, is_exact: bool) -> list[Shown]:
    """What has a column, the most important first: λ, δ_p, the other indices, then Λ at the p of a case if few."""
    ordered = sorted(asked(case), key=lambda index: index not in MAIN)
    if case.figure.x != "p":
        pairs = ((_index(each, 0), _theory(each, is_exact=is_exact)) for each in ordered if each in MAIN)
        return [each for pair in pairs for each in pair]
    found = [_index(each, rank + 1 if rank > 1 else 0) for rank, each in enumerate(ordered)]
    p = [float(each) for each in case.p if each] if MOMENT.name in case.output.quantities else []
    if len(p) > MOST_MOMENTS:
        p = [] if found else [p[0], p[-1]]
    return found + [_moment(each, 2 if found else 0) for each in p]


def _index(index: Index, rank: int) -> Shown:
    def value(result: CurveResult) -> float | None:
        estimate = result.estimates[index.name]
        return None if estimate is None else estimate.value

    def text(result: CurveResult) -> str:
        is_lost = result.estimates[index.name] is None and result.status != Status.CONVERGED
        return "" if is_lost else index_text(index, result, DIGITS)

    return Shown(index.symbol, value, text, rank)


def _theory(index: Index, *, is_exact: bool) -> Shown:
    """Its closed form."""
    heading = theory_heading(index.closed_form, is_exact=is_exact)
    return Shown(heading, None, lambda result: f"{index.theory(result.curve.problem):.6g}", rank=1)


def _moment(p: float, rank: int) -> Shown:
    def numbers(result: CurveResult) -> list[tuple[float, float]]:
        found = result.moments
        columns = (found.p.tolist(), found.value.tolist(), found.error_estimate.tolist())
        return [(value, error) for each, value, error in zip(*columns, strict=True) if each == p]

    return Shown(
        moment_at(p).symbol,
        lambda result: next((value for value, _ in numbers(result)), None),
        lambda result: next((digits(*pair, most=DIGITS) for pair in numbers(result)), ""),
        rank,
    )


def _chosen(results: Sequence[CurveResult], quantities: Sequence[Shown]) -> list[tuple[str, CurveResult]]:
    """The curves with the extreme values of the first quantities, and some that failed, each with the reason."""
    shown = [(each.heading, each.value) for each in quantities if each.value is not None]
    extremes: dict[tuple[str, str], tuple[float, CurveResult]] = {}
    failed: list[CurveResult] = []
    for result in results:
        if result.status and len(failed) < MOST_FAILED:
            failed.append(result)
        for heading, value_of in shown[:MOST_EXTREMES]:
            if (value := value_of(result)) is None:
                continue
            for word, sign in (("least", 1), ("largest", -1)):
                known = extremes.get((word, heading))
                if known is None or sign * value < sign * known[0]:
                    extremes[word, heading] = value, result
    reasons: dict[int, list[str]] = {}
    curves = {result.curve.number: result for result in failed}
    for (word, heading), (_, result) in extremes.items():
        curves[result.curve.number] = result
        reasons.setdefault(result.curve.number, []).append(f"{word} {heading}")
    return [(", ".join(reasons.get(number, [])), curves[number]) for number in sorted(curves)]
