"""What tables have of each curve of a case: the quantities of the columns, and the row of a curve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN
from fpsolve.case.case import Case
from fpsolve.exponent.quantities import INDICES, Index
from fpsolve.model.quantity import MOMENT, OVER_P, RATE_FUNCTION, SECONDS, STATUS, Quantity
from fpsolve.results.table import Row
from fpsolve.study.results import CurveResult
from fpsolve.study.uncertain import spreads_of

ENDS = ("low", "high")
"""Of an interval."""
COUNTS = (
    Quantity("p_solved", "p solved", "number of p that are solved"),
    Quantity("p_failed", "p failed", "number of p that failed"),
)


def asked(case: Case) -> list[Index]:
    """The indices that a case asks for."""
    return [index for name, index in INDICES.items() if name in case.asked]


def uncertain(case: Case) -> list[Index]:
    """The indices whose intervals are asked for."""
    return [each for each in asked(case) if each.name in UNCERTAIN] if case.uncertain else []


def response_columns(case: Case) -> Mapping[str, Quantity]:
    """The numbers of the stationary response by their names, if a case asks for them."""
    return case.system.response.numbers if case.has_response else {}


def columns_of(case: Case) -> tuple[Quantity, ...]:
    """The columns, those over p first; those of perturbation theory have no error."""
    found: list[Quantity] = []
    if MOMENT.name in case.asked:
        found += OVER_P.values()
        if RATE_FUNCTION.name in case.asked:
            found.append(replace(RATE_FUNCTION, dims=MOMENT.dims, comment="at s = Λ′(p); its error is moment_error"))
        found += [MOMENT.end(each, LEVEL) for each in ENDS if case.uncertain]
    for index in asked(case):
        found += [index, index.error(), index.perturbation]
    for number in response_columns(case).values():
        found += [number, number.error()]
    found += [index.end(each, LEVEL) for index in uncertain(case) for each in ENDS]
    return (*found, *COUNTS, STATUS, SECONDS)


def row_of(case: Case, result: CurveResult, *, has_theory: bool = True) -> Row:
    """The numbers of a curve by the names of the columns, and its p.

    Args:
        case: which tells what is asked for.
        result: of the curve.
        has_theory: whether the indices of perturbation theory are there, for which the problem is made.
    """
    moments, spreads = result.moments, spreads_of(case, result)
    found: dict[str, Any] = {"p": moments.p}
    found |= {each.name: getattr(moments, name) for name, each in OVER_P.items()}
    found[RATE_FUNCTION.name] = moments.rate_function
    if case.uncertain:
        of_p = [spreads.moments.get(p) for p in moments.p.tolist()]
        for end in ENDS:
            found[f"{MOMENT.name}_{end}"] = np.array([getattr(each, end, math.nan) for each in of_p], dtype=float)
    for index in asked(case):
        found |= pair(index.name, result.estimates[index.name])
        if has_theory and result.estimates[index.name]:
            found[index.perturbation.name] = index.theory(result.curve.problem)
    settled = response_columns(case)
    for name, number in (result.response.numbers if result.response else {}).items():
        found |= pair(settled[name].name, number)
    for index in uncertain(case):
        found |= {f"{index.name}_{end}": getattr(spreads.indices.get(index.name), end, None) for end in ENDS}
    count = case.p.size if MOMENT.name in case.asked else 0
    solved = {"p_solved": moments.p.size, "p_failed": count - moments.p.size}
    return {**found, **solved, STATUS.name: result.status, SECONDS.name: round(result.seconds, 6)}


def pair(name: str, estimate: Any) -> dict[str, float | None]:
    """A number and its error by their names; None where there is none."""
    return {name: estimate and estimate.value, f"{name}_error": estimate and estimate.error_estimate}
