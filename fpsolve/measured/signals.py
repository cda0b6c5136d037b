"""What is measured, the units it may have in a file, and its conversion to a relative stiffness or to a damping."""

from __future__ import annotations

import re
from collections.abc import Mapping
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
TIMES = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "min": 60.0}
FREQUENCIES = {"hz": "Hz", "cycles/s": "Hz", "rad/s": "rad/s", "rad/sec": "rad/s"}
_RAISED = str.maketrans({"²": "^2", "³": "^3", "⁴": "^4", "·": "*", "−": "-"})
ENDINGS = {"/hz": "Hz", "/(rad/s)": "rad/s", "*s/rad": "rad/s"}
_SQUARE = re.compile(r"\((?P<round>.+)\)\^2|(?P<plain>[^/^()]+)\^2|1/(?P<inverse>[a-z]+)\^2")


class Density(NamedTuple):
    """The unit of a density: that of the signal, and "Hz" or "rad/s"; each is empty where it is not told."""

    signal: str
    per: str


def plain(unit: str) -> str:
    """A unit in small letters without spaces, with ^ for powers."""
    return re.sub(r"\s|\*\*", lambda found: "^" if found[0] == "**" else "", unit.translate(_RAISED)).lower()


def density_unit(unit: str) -> Density:
    """What a unit such as "(m/s²)²/Hz", "m²/s⁴/Hz", "g^2/Hz" or "1/Hz" says. Raises `ValueError`."""
    text = plain(unit)
    if not text:
        return Density("", "")
    ending = next((each for each in ENDINGS if text.endswith(each)), None)
    if ending is None:
        raise ValueError(f'has the unit "{unit}", which is none of a density; write one such as (m/s^2)^2/Hz')
    base, per = text.removesuffix(ending), ENDINGS[ending]
    if base in ("", "1", "-"):
        return Density("1", per)
    if base == "m^2/s^4":
        return Density("m/s^2", per)
    found = _SQUARE.fullmatch(base)
    if found is None:
        raise ValueError(f'has the unit "{unit}", whose first part is no square; write one such as (m/s^2)^2/Hz')
    return Density(found["round"] or found["plain"] or f"1/{found['inverse']}", per)


def factor_of(of: str, unit: str) -> float:
    """The unit of a file in that of a signal; 1 where the latter is not told. Raises `ValueError`."""
    signal = SIGNALS[of]
    known = plain(unit)
    if not known:
        return 1.0
    if known not in signal.units:
        raise ValueError(
            f'has the unit "{unit}", but {of} is in one of {", ".join(signal.units)}; convert it, or state what else '
            f"is measured: {', '.join(SIGNALS)}"
        )
    return signal.units[known]
