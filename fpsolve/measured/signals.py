"""What is measured, the units it may have in a file, and its conversion to a relative stiffness or to a damping."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fpsolve.measured.weak import Where


@dataclass(frozen=True)
class Signal:
    """A signal that may be measured.

    Attributes:
        words: what it is.
        units: by how they may be written, what a value is multiplied by.
        noise_in: where its noise is.
        unit: in which it is then.
    """

    words: str
    units: Mapping[str, float]
    noise_in: Where
    unit: str


SIGNALS: Mapping[str, Signal] = {
    "stiffness": Signal("relative stiffness", {"1": 1.0, "-": 1.0, "%": 0.01}, "stiffness", "1"),
    "damping": Signal("damping", {"1/s": 1.0, "1/ms": 1e3, "1/min": 1 / 60, "rad/s": 1.0}, "damping", "1/s"),
    "acceleration": Signal(
        "vertical acceleration of the support",
        {"m/s^2": 1.0, "cm/s^2": 0.01, "mm/s^2": 1e-3, "gal": 0.01, "g": 9.80665},
        "stiffness",
        "m/s²",
    ),
    "height": Signal("metacentric height", {"m": 1.0, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}, "stiffness", "m"),
}
"""By the word of `fpsolve noise --of`."""
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
FREQUENCIES = {"hz": "Hz", "cycle/s": "Hz", "rad/s": "rad/s"}
INVERSE_TIMES = ("1/s",)
"""Of frequencies, which may be in Hz or in rad/s."""
_RAISED = {**{ord(a): f"^{b}" for a, b in zip("⁰¹²³⁴⁵⁶⁷⁸⁹", range(10), strict=True)}, ord("⁻"): "^-", ord("−"): "-"}
_RAISED |= {ord("·"): "*", ord("µ"): "u", ord("μ"): "u", ord("{"): "", ord("}"): ""}
_SAME = {"sec": "s", "second": "s", "seconds": "s", "hertz": "hz", "cycles": "cycle", "radian": "rad", "radians": "rad"}
_SAME |= {"minute": "min", "minutes": "min", "hour": "h", "hours": "h", "metre": "m", "meter": "m", "meters": "m"}
_SAME |= {"day": "d", "days": "d", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns", "msec": "ms"}
_TOKENS = re.compile(r"\s*([a-z%]+|\^?\s*[+-]?\d+|[()/*.]|-)")
Powers = Mapping[str, int]
"""A unit as powers of symbols: m/s² is {"m": 1, "s": −2}, and what has no unit is {}."""


class Density(NamedTuple):
    """The unit of a density: that of the signal, and "Hz" or "rad/s"; each is None or empty where it is not told."""

    signal: Powers | None
    per: str


def powers(unit: str) -> Powers | None:
    """What a unit says, written as (m/s²)², m2 s-4, m^2/s^4 or m²·s⁻⁴; None where it cannot be read.

    A power is a whole number behind a symbol or a bracket, and / is of the next one alone, as in UDUNITS. Prefixes are
    no matter here: cm is a symbol of its own.
    """
    text = unit.translate(_RAISED).replace("^^", "^").replace("^-^", "^-").replace("**", "^").strip().lower()
    tokens, place = list[str](), 0
    while place < len(text):
        found = _TOKENS.match(text, place)
        if found is None:
            return None
        tokens.append(re.sub(r"[\^\s+]", "", found[1]))
        place = found.end()
    try:
        product, rest = _product(tokens)
    except (IndexError, ValueError):
        return None
    return None if rest else {symbol: power for symbol, power in product.items() if power}


def _product(tokens: list[str]) -> tuple[dict[str, int], list[str]]:
    """A product up to its closing bracket, and what follows that."""
    found, sign = dict[str, int](), 1
    while tokens and tokens[0] != ")":
        first, *tokens = tokens
        if first in "/*.-":
            sign = -1 if first == "/" else sign
            continue
        if first == "(":
            factor, tokens = _product(tokens)
            tokens = tokens[1:] if tokens[0] == ")" else tokens
        else:
            factor = {} if first.lstrip("-").isdigit() else {_SAME.get(first, first): 1}
        if tokens and tokens[0].lstrip("-").isdigit():
            sign *= int(tokens.pop(0))
        for symbol, power in factor.items():
            found[symbol] = found.get(symbol, 0) + sign * power
        sign = 1
    return found, tokens


def among(unit: str, known: Iterable[str]) -> str:
    """Which of some units this is; empty where it is none of them."""
    stated = powers(unit)
    return next((each for each in known if unit.strip() and stated is not None and powers(each) == stated), "")


def density_unit(unit: str) -> Density:
    """What a unit such as "(m/s²)²/Hz", "m2 s-4 Hz-1", "g^2/Hz", "m2 s" or "1/Hz" says. Raises `ValueError`.

    A density per s⁻¹ may be one per Hz or per rad/s, which is not told then.
    """
    if not unit.strip():
        return Density(None, "")
    whole, per = powers(unit), ""
    text = f'has the unit "{unit}", which is none of a density; write one such as (m/s^2)^2/Hz'
    if whole is None:
        raise ValueError(text)
    left = dict(whole)
    if left.get("hz") == -1:
        per = "Hz"
        del left["hz"]
    elif left.get("rad") == -1:
        per = "rad/s"
        del left["rad"]
        left["s"] = left.get("s", 0) - 1
    elif left.get("s", 0) % 2 == 1:
        left["s"] -= 1
    else:
        raise ValueError(text)
    if any(power % 2 for power in left.values()):
        raise ValueError(f'has the unit "{unit}", whose first part is no square; write one such as (m/s^2)^2/Hz')
    return Density({symbol: power // 2 for symbol, power in left.items() if power}, per)


def factor_of(of: str, unit: Powers | None, text: str) -> float:
    """The unit of a file in that of a signal; 1 where the file tells none. Raises `ValueError`."""
    signal = SIGNALS[of]
    if unit is None and not text.strip():
        return 1.0
    found = next((factor for each, factor in signal.units.items() if powers(each) == unit), None)
    if found is None:
        such = [name for name, each in SIGNALS.items() if unit in map(powers, each.units)]
        own = f"--of {' or '.join(such or SIGNALS)}"
        raise ValueError(
            f'has the unit "{text}", but {of} is in one of {", ".join(signal.units)}; state --unit, or {own}'
        )
    return found
