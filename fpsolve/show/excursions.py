"""How likely a path ever exceeds a level."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fpsolve.analysis.excursions import Excursion
from fpsolve.case.case import Case
from fpsolve.page.page import Sentence
from fpsolve.study.results import CurveResult


def show(case: Case, result: CurveResult) -> Iterator[Sentence]:
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
