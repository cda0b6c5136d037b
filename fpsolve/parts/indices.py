"""The numbers of a curve that are no function of p: λ, δ_p, Λ″(0) and those of impacts, each a part of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from fpsolve.case.case import Case, Curve
from fpsolve.data import Quantity
from fpsolve.errors import NoSuchExponent
from fpsolve.exponent.error import Absent, Estimate, digits
from fpsolve.exponent.quantities import (
    CRITICAL_RESTITUTION,
    INDICES,
    MOMENT,
    OF_IMPACTS,
    STABILITY_INDEX,
    VARIANCE_RATE,
    Index,
)
from fpsolve.messages import Code, Message, message_of
from fpsolve.model.coordinates import infinite
from fpsolve.model.quantity import MEAN_SQUARE
from fpsolve.page.page import Block, Column, filled
from fpsolve.parts.intervals import INTERVAL, spreads_of
from fpsolve.parts.part import Job, Numerics, Part, Reason, Settings
from fpsolve.results.curve import CurveResult
from fpsolve.results.text import NUMBER_COLUMNS, interval, row_of


def index_of(found: Estimate | Absent, name: str, symbol: str) -> Estimate | Reason:
    """An index, or why there is none; of δ_p that is a limit, as Λ(p) may have a root far out."""
    if found:
        return found
    if name == STABILITY_INDEX.name:
        return Reason("impossible", found.reason, "stability index")
    return Reason("absent", found.reason, symbol)


def part_of(index: Index) -> Part:
    """The part of an index."""
    error, by_theory = index.error(), index.perturbation

    def settings(case: Case, number: int) -> Settings | None:
        return {} if index.name in case.asked else None

    def solve(job: Job, settings: Settings) -> Estimate | Reason:
        moments = job.found(MOMENT.name)
        try:
            found = index.solve(job.solver, moments.root if moments else None)
        except NoSuchExponent as failure:
            return Reason("impossible", failure.message, index.symbol)
        return index_of(found, index.name, index.symbol)

    def said(found: Estimate, curve: Curve, numerics: Numerics) -> Iterator[Message]:
        if found.relative_error > numerics.rtol:
            yield Message(
                Code.INDEX_RTOL_MISSED,
                symbol=index.symbol,
                value=found.value,
                error=found.error_estimate,
                size=found.relative_error,
                rtol=numerics.rtol,
                remedy=numerics.solver(curve.problem).method.missed,
            )

    def numbers(case: Case, result: CurveResult | None) -> Mapping[Quantity, Any]:
        if index.name not in case.asked:
            return {}
        found = result and result.estimates[index.name]
        theory: Mapping[str, float] = result.parts.get("theory", {}) if result and found else {}
        value = {index: found and found.value, error: found and found.error_estimate}
        return {**value, by_theory: theory.get(index.name)}

    return Part(
        index.name,
        settings,
        solve,
        Estimate,
        index.symbol,
        said=said,
        numbers=numbers,
    )


PARTS: tuple[Part, ...] = tuple(map(part_of, INDICES.values()))
"""A part for each index."""


def _solve_theory(job: Job, settings: Settings) -> dict[str, float]:
    return {name: index.theory(job.curve.problem) for name, index in INDICES.items()}


def asked(case: Case) -> list[Index]:
    """The indices that a case asks for."""
    return [index for name, index in INDICES.items() if name in case.asked]


def told_indices(case: Case) -> list[Index]:
    """The indices that a case asks for, without those of impacts where it names none, and not one ray has them."""
    has_impacts = len(case.system.jumps) == 1 or case.output.lists_quantities
    return [index for index in asked(case) if has_impacts or index.name not in OF_IMPACTS]


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


def _show(case: Case, result: CurveResult) -> Iterator[Block]:
    """λ, δ_p, Λ(2) and what else is asked for, that of impacts for each ray; not where a figure is over a parameter."""
    if case.figure.x != "p":
        return
    found_spreads, problem = spreads_of(case, result), result.curve.problem
    spreads, of_p, rows = found_spreads.indices, found_spreads.moments, list[list[str]]()
    for index in told_indices(case):
        found, spread = result.estimates[index.name], spreads.get(index.name)
        row, theory = row_of(index, found, case.units.time), index.theory(problem) if found else math.nan
        row[2] = index_text(index, result)
        row.append(f"{theory:.6g}, Eq. {index.closed_form}" if math.isfinite(theory) else "")
        rows.append([*row, interval(spread.low, spread.high) if spread else ""])
    if square := result.moment(2.0):
        [closed] = result.moments.perturbation[result.moments.p == 2]
        told, spread = f"{closed:.6g}, Eq. {MOMENT.closed_form}" * math.isfinite(closed), of_p.get(2.0)
        row = [*row_of(MEAN_SQUARE, square, case.units.time), told]
        rows.append([*row, interval(spread.low, spread.high) if spread else ""])
    if any(result.estimates.values()):
        yield filled("", [*NUMBER_COLUMNS, Column("perturbation theory", 3), Column(INTERVAL, 1)], rows)


THEORY: Part = Part(
    "theory",
    lambda case, _: {} if asked(case) else None,
    _solve_theory,
    dict[str, float],
    show=_show,
    uses_solver=False,
)
"""The indices by perturbation theory, which a record has so that tables need not make the problem of each curve.

All indices are shown beside them.
"""
