"""The numbers of one curve as a terminal and a report say them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from fpsolve.analysis.excursions import Excursion
from fpsolve.analysis.spreads import Spread
from fpsolve.case.case import Case
from fpsolve.exponent.error import Estimate, digits
from fpsolve.exponent.quantities import (
    CRITICAL_RESTITUTION,
    INDICES,
    MOMENT,
    OF_IMPACTS,
    STABILITY_INDEX,
    VARIANCE_RATE,
    Index,
)
from fpsolve.messages import Code, message_of
from fpsolve.model.coordinates import infinite
from fpsolve.model.quantity import MEAN_SQUARE, ResponseQuantities
from fpsolve.solve.curve import CurveResponse, CurveResult
from fpsolve.solve.intervals import INTERVAL, spreads_of
from fpsolve.tell.blocks import Block, Column, Grid, Sentence, filled
from fpsolve.tell.text import NUMBER_COLUMNS, interval, percent, row_of, units_in_words


def told_indices(case: Case) -> list[Index]:
    """The indices that a case asks for, without those of impacts where it names none, and not one ray has them."""
    has_impacts = len(case.system.jumps) == 1 or case.output.lists_quantities
    return [index for name, index in INDICES.items() if name in case.asked and (has_impacts or name not in OF_IMPACTS)]


def index_text(index: Index, result: CurveResult, most: int = 17) -> str:
    """An index of a curve with its digits, or that there is none, or that it was not found out."""
    estimate = result.estimates[index.name]
    if estimate is not None:
        return digits(estimate.value, estimate.error_estimate, most)
    told = map(message_of, (*(failure.reason for failure in result.failures), *result.warnings))
    unsolved = {Code.INDEX_FAILED, Code.INDEX_MISSING} if result.failures else {Code.INDEX_FAILED}
    if any(each.code in unsolved and index.symbol in each.data["symbols"] for each in told):
        return "not solved"
    if index in (STABILITY_INDEX, VARIANCE_RATE) and infinite(result.curve.problem, 1.0, index.symbol):
        return "not computed"
    return "none" if index == CRITICAL_RESTITUTION else "none found"


def indices(case: Case, result: CurveResult) -> Iterator[Block]:
    """λ, δ_p, Λ(2) and what else is asked for, that of impacts for each ray; not where a figure is over a parameter."""
    if case.figure.x != "p":
        return
    found_spreads, problem = spreads_of(case, result), result.curve.problem
    told: list[tuple[Any, Estimate | None, float, Spread | None]] = [
        (index, found, index.theory(problem) if found else math.nan, found_spreads.indices.get(index.name))
        for index in told_indices(case)
        for found in [result.estimates[index.name]]
    ]
    if square := result.moment(2.0):
        [closed] = result.moments.perturbation[result.moments.p == 2]
        told.append((MEAN_SQUARE, square, closed, found_spreads.moments.get(2.0)))
    rows = list[list[str]]()
    for about, found, theory, spread in told:
        row = row_of(about, found, case.units.time)
        row[2] = row[2] or index_text(about, result)
        row.append(f"{theory:.6g}, Eq. {about.closed_form}" if math.isfinite(theory) else "")
        rows.append([*row, interval(spread.low, spread.high) if spread else ""])
    if any(result.estimates.values()):
        yield filled("", [*NUMBER_COLUMNS, Column("perturbation theory", 3), Column(INTERVAL, 1)], rows)


def excursions(case: Case, result: CurveResult) -> Iterator[Sentence]:
    """What is known of P(sup ‖x‖ ≥ A) for every level, with the start and the norm."""
    found = result.excursion
    told = [] if found is None else [text for level in case.excursions.levels if (text := _bounded(found, level))]
    if found is None or not told:
        return
    phi = "uniform φ₀" if isinstance(found.phi, str) else f"φ₀ = {found.phi:.6g}"
    start = f"{phi}, {'stationary noise' if isinstance(found.xi, str) else f'ξ₀ = {found.xi:.6g}'}"
    norm = f"‖x‖ is the length of ({', '.join(result.curve.problem.linear.states)})"
    yield Sentence(f"Start with {start}: {', '.join(told)}; {norm}, and ‖x₀‖ = 1.")


def bounds_text(found: Excursion, level: float) -> str:
    """The bounds for one level: "0.035-0.054"; empty where there are none."""
    if found.is_certain:
        return "1"
    low, high = map(float, found.bounds(level))
    return f"{_rounded(low, -1)}-{_rounded(high, 1)}" if low > 0 or high < 1 else ""


def _bounded(found: Excursion, level: float) -> str:
    symbol = f"P(sup ‖x‖ ≥ {level:g})"
    if found.is_certain:
        return f"{symbol} = 1"
    low, high = map(float, found.bounds(level))
    if low > 0 or high < 1:
        return f"{symbol} between {_rounded(low, -1)} and {_rounded(high, 1)}"
    many = float(found.expected_upcrossings(level))
    return f"{symbol} below about {many:.3g}, for large levels" if many < 1 else ""


def _rounded(bound: float, side: int) -> str:
    """A probability with three digits, rounded down or up."""
    if not 0 < bound < 1:
        return f"{bound:g}"
    step = 10.0 ** (math.floor(math.log10(bound)) - 2)
    return f"{(math.floor if side < 0 else math.ceil)(bound / step) * step:.3g}"


def response(case: Case, result: CurveResult) -> Iterator[Block]:
    """The means and the impacts with their errors, and where the densities are largest."""
    found, about = result.response, case.problem.linear.response
    if found is None:
        return
    rows = [row_of(about.numbers[name], each, case.units.time) for name, each in found.numbers.items()]
    yield filled(f"Stationary response{result.curve.of}", NUMBER_COLUMNS, rows)
    if found.balance is not None:
        yield Sentence(shape(found, about))


def shape(found: CurveResponse, about: ResponseQuantities) -> str:
    """Where the densities of a response are largest: what changes at δ_p = −1 and −2, the P-bifurcations."""
    both = about.joint_symbol
    if not found.has_hump:
        return f"ρ(A) and {both} are infinite at rest, as δ_p > -1."
    plane = "a crater around rest, as δ_p < -2" if found.has_crater else "is infinite there, as δ_p > -2"
    return f"ρ(A) has a hump away from rest, as δ_p < -1, and {both} {plane}."


STAR = "* for the noise reduced by Eqs. (12)-(14)"
"""The remark on perturbation theory of another noise than that which is solved."""


def moment_grid(case: Case, result: CurveResult) -> Grid:
    """Λ(p) at each p, with its error, its interval, and perturbation theory."""
    found, spreads = result.moments, spreads_of(case, result).moments
    is_reduced = result.curve.noise.approximates_spectrum
    has_theory = any(map(math.isfinite, found.perturbation))
    columns = [Column("p"), Column(MOMENT.symbol), Column("± error")]
    columns += [Column(INTERVAL), Column("P(Λ < 0)")] * bool(spreads)
    theory = Column(f"perturbation, Eq. {MOMENT.closed_form}{'*' if is_reduced else ''}", 1)
    columns += [theory, Column("difference", 2)] * has_theory
    remarks = STAR * (is_reduced and has_theory), units_in_words(case.units.time, [MOMENT])
    grid = Grid("", columns, remark="; ".join(filter(None, remarks)))
    for p, value, error, closed in zip(found.p, found.value, found.error_estimate, found.perturbation, strict=True):
        spread = spreads.get(float(p))
        uncertain = ["", ""] if spread is None else [interval(spread.low, spread.high), percent(spread.below)]
        compared = [f"{closed + 0.0:.6g}", f"{value - closed + 0.0:.2e}"] * has_theory
        shown = f"{error:.0e}" if error else "0"
        grid.rows.append([f"{p + 0.0:g}", digits(value, error), shown, *uncertain * bool(spreads), *compared])
    return grid


OF_CURVE: tuple[Callable[[Case, CurveResult], Iterator[Block]], ...] = indices, excursions, response
"""What is told of each of a few curves, in this order."""
