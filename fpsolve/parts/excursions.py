"""How far ‖x‖ may rise above its start: [excursions], its numbers, and what is said of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fpsolve.analysis.excursions import SYMBOL, Excursion, check_start, solve_excursion
from fpsolve.case.case import Case
from fpsolve.case.sections import EXCURSIONS
from fpsolve.errors import FpsolveError
from fpsolve.page.page import Sentence
from fpsolve.parts.part import Job, Part, Settings
from fpsolve.results.curve import CurveResult
from fpsolve.results.table import pair


def _settings(case: Case, number: int) -> Settings | None:
    """The start; levels are looked up in what was found."""
    return {"phi": case.excursions.phi, "xi": case.excursions.xi} if EXCURSIONS in case.asked else None


def _solve(job: Job, settings: Settings) -> Excursion:
    try:
        check_start(job.curve.problem, settings["phi"], settings["xi"])
    except ValueError as error:  # of sets after the first one
        raise FpsolveError(str(error)) from None
    return solve_excursion(job.solver, phi=settings["phi"], xi=settings["xi"], root=job.root)


def _content(case: Case, result: CurveResult) -> Mapping[str, Any]:
    """The start, the bounds and the asymptotic number of upcrossings at all levels, and what these follow from."""
    found: Excursion | None = result.parts.get(EXCURSIONS)
    if EXCURSIONS not in case.asked or found is None:
        return {EXCURSIONS: None} if EXCURSIONS in case.asked else {}
    levels = np.array(case.excursions.levels)
    rows = zip(levels.tolist(), *(each.tolist() for each in found.bounds(levels)), strict=True)
    many = [None if math.isnan(each) else each for each in found.expected_upcrossings(levels).tolist()]
    content = {
        "start": {"phi": found.phi, "xi": found.xi},
        "is_certain": found.is_certain,
        **pair("stability_index", found.stability_index),
        **pair("lower", found.lower),
        **pair("upper", found.upper),
        **pair("upcrossings", found.upcrossings),
        "levels": [
            {"level": level, "least_probable": low, "most_probable": high, "upcrossings": count}
            for (level, low, high), count in zip(rows, many, strict=True)
        ],
    }
    return {EXCURSIONS: content}


def _show(case: Case, result: CurveResult) -> Iterator[Sentence]:
    """What is known of P(sup ‖x‖ ≥ A) for every level, with the start and the norm."""
    found = result.excursion
    told = [] if found is None else [text for level in case.excursions.levels if (text := _bounded(found, level))]
    if found is None or not told:
        return
    phi = "uniform φ₀" if isinstance(found.phi, str) else f"φ₀ = {found.phi:.6g}"
    start = f"{phi}, {'stationary noise' if isinstance(found.xi, str) else f'ξ₀ = {found.xi:.6g}'}"
    norm = f"‖x‖ is the length of ({', '.join(result.curve.problem.system.states)})"
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


PART: Part = Part(
    EXCURSIONS,
    _settings,
    _solve,
    Excursion,
    SYMBOL,
    said=lambda found, *_: found.notes,
    content=_content,
    show=_show,
)
