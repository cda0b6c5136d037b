"""Numbers, units, counts and times as text, and how much is shown of one, of several and of many parameter sets.

Several sets have a row each in one table, up to `ROWS`; of more the extreme ones and some that failed have one. Up
to `EACH` sets are also described one by one, on a terminal where that is asked for: a table, sentences, and of the
first `PICTURES` pictures. Where the figure is over a parameter, parameter sets have a row each from the first one on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from fpsolve.data import Quantity
from fpsolve.exponent.error import Estimate, digits
from fpsolve.tell.blocks import Column

EACH = 10
"""Parameter sets that are described one by one."""
PICTURES = 3
"""Parameter sets that have pictures of their own in a report."""
ROWS = 50
"""Parameter sets, or values that are expected, that have a row each."""
EXTREMES = 2
"""Quantities whose extreme parameter sets have a row."""
FAILURES = 20
"""Failed parameter sets among many that have a row."""
MOMENTS = 3
"""The p whose Λ has a column beside that of other quantities."""
ROWS_OVER_P = 12
"""Λ(p) of a single parameter set that a terminal shows unasked."""
PROOFS = 4
"""Proven moments of which each is told."""
NAMED = 3
"""Parameter sets that are named of those that share a note."""
NOTES = 20
"""Notes of each severity."""
DIGITS = 7
"""Digits of a number in a sentence, or in a table of many parameter sets."""
NUMBER_COLUMNS = (
    Column("quantity", is_text=True), Column("symbol"), Column("value"), Column("± error"), Column("unit", 2)
)  # fmt: skip
"""Those of a table of different quantities."""


def short(estimate: Estimate) -> str:
    """A number with the digits that its error leaves, seven at most."""
    return digits(estimate.value, estimate.error_estimate, DIGITS)


def error_text(found: Estimate | None) -> str:
    """The estimate of an error with one digit; empty where there is no number."""
    return f"{found.error_estimate:.0e}" if found else ""


def row_of(about: Quantity, found: Estimate | None, time_unit: str) -> list[str]:
    """A row of a table with `NUMBER_COLUMNS`."""
    unit = about.timed(time_unit).unit
    value = digits(found.value, found.error_estimate) if found else ""
    return [about.words, about.symbol, value, error_text(found), "" if unit in ("1", "unknown") else unit]


def sampled(value: float, error: float) -> str:
    """A number with as many decimals as two digits of its standard error have."""
    if error <= 0:
        return f"{value:g}"
    decimals = 1 - math.floor(math.log10(error))
    return f"{value:.{decimals}f}" if 0 <= decimals <= 9 else f"{value:.3g}"


def interval(low: float, high: float) -> str:
    """An interval with three digits of its width: "-0.0123 to 0.0045"."""
    width = high - low
    if not 0 < width < math.inf:
        return f"{low:.6g} to {high:.6g}"
    decimals = 2 - math.floor(math.log10(width))
    return f"{low:.{decimals}f} to {high:.{decimals}f}" if 0 <= decimals <= 9 else f"{low:.4g} to {high:.4g}"


def percent(share: float) -> str:
    """A probability that is not rounded to certainty: "97 %", "> 99.9 %"."""
    if share > 0.999:
        return "> 99.9 %"
    return "< 0.1 %" if share < 0.001 else f"{100 * share:.3g} %"


def plural(word: str, count: int) -> str:
    return word if count == 1 else f"{word}{'es' if word.endswith('ch') else 's'}"


def duration(seconds: float) -> str:
    """A time for the eye: "4.2 s", "12 min 30 s", "2 h 5 min"."""
    if seconds < 99.95:
        return f"{seconds:.1f} s"
    minutes, hours = divmod(round(seconds), 60), divmod(round(seconds / 60), 60)
    return f"{minutes[0]} min {minutes[1]} s" if minutes[0] < 100 else f"{hours[0]} h {hours[1]} min"


def sign_of(value: float, error: float) -> float:
    """−1 or 1; 0 where the error leaves it open."""
    return math.copysign(1, value) if abs(value) > error else 0.0


def fate(what: str, rate: float, sign: float, time_unit: str) -> str:
    """What becomes of something that grows at a rate, and in which time."""
    if not sign:
        return f"{what} is at the border of stability, within the error"
    time = f"in a time of {float(f'{math.log(2) / abs(rate):.3g}'):g}" + (
        "" if time_unit == "time" else f" {time_unit}"
    )
    return f"{what} grows, doubling {time}" if sign > 0 else f"{what} decays, halving {time}"


def likely(what: str, below: float) -> str:
    """What probably becomes of something whose rate is below 0 with a probability."""
    fate, share = ("decays", below) if below >= 0.5 else ("grows", 1 - below)
    return f"{what} {fate} with a probability of {percent(share)}"


def units_in_words(unit: str, quantities: Iterable[Quantity]) -> str:
    """The unit of those that have one, where the unit of time has a name: "λ, N in 1/s"; else nothing."""
    timed = [each.symbol for each in quantities if each.unit != each.timed(unit).unit]
    return f"{', '.join(timed)} in 1/{unit}" if timed else ""
