"""Λ(p), λ, δ_p and the other indices of a curve: tables with their errors, and what they mean."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from fpsolve.analysis.excursions import SYMBOL
from fpsolve.analysis.spreads import LEVEL
from fpsolve.case.case import Case
from fpsolve.data import Quantity
from fpsolve.exponent.error import digits
from fpsolve.exponent.quantities import (
    BY_JUMP,
    CRITICAL_IMPACT_FACTOR,
    CRITICAL_RESTITUTION,
    INDICES,
    MOMENT,
    STABILITY_INDEX,
    VARIANCE_RATE,
    Index,
)
from fpsolve.messages import Code, message_of
from fpsolve.page.page import Block, Column, Grid, Sentence, filled
from fpsolve.parts.intervals import spreads_of
from fpsolve.show.text import DIGITS, NUMBER_COLUMNS, fate, interval, percent, row_of, short, sign_of
from fpsolve.study.columns import asked
from fpsolve.study.results import CurveResult

STAR = "* for the noise reduced by Eqs. (12)-(14)"
"""The remark on perturbation theory of another noise than that which is solved."""
INTERVAL = f"{LEVEL:.0%} interval"
"""The heading of intervals."""


def show_tables(case: Case, result: CurveResult) -> Iterator[Block]:
    """Λ(p), and the indices."""
    if result.moments.p.size:
        yield moment_grid(case, result)
    if any(result.estimates.values()):
        yield index_grid(case, result)


def moment_grid(case: Case, result: CurveResult) -> Grid:
    """Λ(p) at each p, with its error, its interval, and perturbation theory."""
    found, spreads, is_reduced = result.moments, spreads_of(case, result).moments, result.curve.theory_reduces_noise
    has_theory = any(map(math.isfinite, found.perturbation))
    columns = [Column("p"), Column(MOMENT.symbol), Column("± error")]
    columns += [Column(INTERVAL), Column("P(Λ < 0)")] * bool(spreads)
    theory = Column(f"perturbation, Eq. {MOMENT.closed_form}{'*' if is_reduced else ''}", 1)
    columns += [theory, Column("difference", 2)] * has_theory
    remarks = STAR * (is_reduced and has_theory), units_in_words(case, [MOMENT])
    grid = Grid("", columns, remark="; ".join(filter(None, remarks)))
    for p, value, error, closed in zip(found.p, found.value, found.error_estimate, found.perturbation, strict=True):
        spread = spreads.get(float(p))
        uncertain = ["", ""] if spread is None else [interval(spread.low, spread.high), percent(spread.below)]
        compared = [f"{closed + 0.0:.6g}", f"{value - closed + 0.0:.2e}"] * has_theory
        shown = f"{error:.0e}" if error else "0"
        grid.rows.append([f"{p + 0.0:g}", digits(value, error), shown, *uncertain * bool(spreads), *compared])
    return grid


def index_grid(case: Case, result: CurveResult) -> Grid:
    """λ, δ_p and the other indices that are asked for, those of impacts for each ray that has them."""
    spreads, problem = spreads_of(case, result).indices, result.curve.problem
    rows: list[list[str]] = []
    for index in told_indices(case):
        found, spread = result.estimates[index.name], spreads.get(index.name)
        row, theory = row_of(index, found, case.units.time), index.theory(problem) if found else math.nan
        row[2] = index_text(index, result)
        row.append(f"{theory:.6g}, Eq. {index.closed_form}" if math.isfinite(theory) else "")
        rows.append([*row, interval(spread.low, spread.high) if spread else ""])
    for ray, of_ray in zip(problem.system.jumps, result.jumps, strict=False):
        for name, found in of_ray.items():
            about = replace(INDICES[name], words=f"{INDICES[name].words} at φ = {ray.phase:.6g}")
            rows += [[*row_of(about, found, case.units.time), "", ""]] if found else []
    return filled("", [*NUMBER_COLUMNS, Column("perturbation theory", 3), Column(INTERVAL, 1)], rows)


def told_indices(case: Case) -> list[Index]:
    """The indices that a case asks for, without those of impacts where it names none, and not one ray has them."""
    has_impacts = len(case.system.jumps) == 1 or case.output.lists_quantities
    return [index for index in asked(case) if has_impacts or index.name not in BY_JUMP]


def index_text(index: Index, result: CurveResult, most: int = 17) -> str:
    """An index of a curve with its digits, or that there is none, or that it was not found out."""
    estimate = result.estimates[index.name]
    if estimate is not None:
        return digits(estimate.value, estimate.error_estimate, most)
    told = map(message_of, (*(failure.reason for failure in result.failures), *result.warnings))
    unsolved = {Code.INDEX_FAILED, Code.INDEX_MISSING} if result.failures else {Code.INDEX_FAILED}
    if any(each.code in unsolved and index.symbol in each.data["symbols"] for each in told):
        return "not solved"
    if result.curve.problem.has_algebraic_tails and index in (STABILITY_INDEX, VARIANCE_RATE):
        return "not computed"
    return "none" if index == CRITICAL_RESTITUTION else "none found"


def units_in_words(case: Case, quantities: Iterable[Quantity]) -> str:
    """The unit of those that have one, where the case names its unit of time: "λ, N in 1/s"; else nothing."""
    unit = case.units.time
    timed = [each.symbol for each in quantities if each.unit != each.timed(unit).unit]
    return f"{', '.join(timed)} in 1/{unit}" if timed else ""


def show_meaning(case: Case, result: CurveResult) -> Iterator[Sentence]:
    """What λ, Λ(2), δ_p and R_c say, each that is there."""
    exponent, index, unit = result.lyapunov_exponent, result.stability_index, case.units.time
    path = 0.0 if exponent is None else sign_of(exponent.value, exponent.error_estimate)
    if exponent is not None:
        rest = ""
        if path > 0 and result.curve.problem.system.is_nonlinear:
            rest = " near rest" + (", and settles into the stationary response" if result.response else "")
        elif path > 0:
            rest = ", and passes every level in the end"
        yield Sentence(f"λ = {short(exponent)}{fate('almost every path', exponent.value, path, unit)}{rest}.")
    found = result.moments
    for p, value, error in zip(found.p.tolist(), found.value.tolist(), found.error_estimate.tolist(), strict=True):
        if p == 2:
            sign = sign_of(value, error)
            text = f"Λ(2) = {digits(value, error, DIGITS)}{fate('the mean square', value, sign, unit)}"
            if sign > 0 > path:
                text += (
                    ", carried by bursts of rare paths. A design that is judged by the mean square, by energy or by "
                    "fatigue is unstable, though one record most likely looks calm"
                )
            yield Sentence(f"{text}.")
    power = "" if index is None else digits(abs(index.value), index.error_estimate, 4)
    if index is not None and index.value > 0:
        yield Sentence(
            f"δ_p = {short(index)} > 0: moments of the orders 0 < p < δ_p decay, those of p > δ_p grow. The "
            f"probability that a path ever exceeds A times its start, {SYMBOL}, falls as A^-{power}."
        )
    elif index is not None:
        yield Sentence(
            f"δ_p = {short(index)} < 0: moments of the orders δ_p < p < 0 decay, as almost every path grows. The "
            f"probability that a path ever falls below a small share a of its start goes as a^{power}."
        )
    critical = result.estimates[CRITICAL_IMPACT_FACTOR.name]
    if critical is not None:
        loss = "more loss" if critical.value < 1 else "any loss"
        yield Sentence(
            f"R_c = {short(critical)}: with this factor of the speed at an impact λ would be 0; {loss} makes almost "
            "every path decay."
        )
