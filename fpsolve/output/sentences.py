"""What the numbers of a curve mean, in one sentence, and what is known of its excursions."""

from __future__ import annotations

import math

from fpsolve.analysis.excursions import SYMBOL, Excursion
from fpsolve.case.case import Case
from fpsolve.exponent.error import digits
from fpsolve.model.quantity import ResponseQuantities
from fpsolve.parts.response import CurveResponse
from fpsolve.study.results import CurveResult

DIGITS = 4


def sentence(case: Case, result: CurveResult) -> str:
    """What λ, Λ(2), δ_p and the bounds of excursions mean together; empty where λ is not known.

    "Almost every path decays (λ = -0.03), but the second moment grows (Λ(2) = 0.05): rare large excursions, P(sup ‖x‖ ≥
    10) between 0.035 and 0.054."
    """
    exponent, index = result.lyapunov_exponent, result.stability_index
    if exponent is None:
        return ""
    value = f"λ = {digits(exponent.value, exponent.error_estimate, DIGITS)}"
    if abs(exponent.value) <= exponent.error_estimate:
        return f"Almost every path is at the border of stability, or near it ({value} within its error)."
    found = result.moments
    rows = zip(found.p.tolist(), found.value.tolist(), found.error_estimate.tolist(), strict=True)
    second = next(((each, error) for p, each, error in rows if p == 2 and abs(each) > error), None)
    if exponent.value > 0 and result.curve.problem.system.is_nonlinear:
        rest = " and settles into the stationary response" if result.response is not None else ""
        return f"Almost every path grows from rest ({value}){rest}."
    if exponent.value > 0:
        return f"Almost every path grows ({value}): it passes every level in the end."
    text, is_rare = f"Almost every path decays ({value})", second is not None and second[0] > 0
    if second is not None:
        verb = "but the second moment grows" if is_rare else "and so does the second moment"
        text += f", {verb} (Λ(2) = {digits(*second, DIGITS)})"
    elif index is not None and index.value > 0:
        text += f", but moments of orders p > {digits(index.value, index.error_estimate, DIGITS)} grow"
        is_rare = True
    text += ": rare large excursions" if is_rare else ""
    if result.excursion is not None and (told := _bounded(result.excursion, case.excursions.sentence_level)):
        return f"{text}{', ' if is_rare else '; '}{told}."
    if is_rare and index is not None and index.value > 0:
        return f"{text}, {SYMBOL} falls as A^-{digits(index.value, index.error_estimate, DIGITS)}."
    return f"{text}."


def shape_of_response(found: CurveResponse, about: ResponseQuantities) -> str:
    """Where the densities of a response are largest: what changes at δ_p = −1 and −2, the P-bifurcations."""
    both = about.joint_symbol
    if not found.has_hump:
        return f"ρ(A) and {both} are infinite at rest, as δ_p > -1."
    plane = "a crater around rest, as δ_p < -2" if found.has_crater else "is infinite there, as δ_p > -2"
    return f"ρ(A) has a hump away from rest, as δ_p < -1, and {both} {plane}."


def excursions(case: Case, result: CurveResult) -> str:
    """What is known of P(sup ‖x‖ ≥ A) for every level, with the start and the norm; empty where nothing is."""
    found = result.excursion
    told = [] if found is None else [text for level in case.excursions.levels if (text := _bounded(found, level))]
    if found is None or not told:
        return ""
    phi = "uniform φ₀" if isinstance(found.phi, str) else f"φ₀ = {found.phi:.6g}"
    start = f"{phi}, {'stationary noise' if isinstance(found.xi, str) else f'ξ₀ = {found.xi:.6g}'}"
    norm = f"‖x‖ is the length of ({', '.join(result.curve.problem.system.states)})"
    return f"Start with {start}: {', '.join(told)}; {norm}, and ‖x₀‖ = 1."


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
