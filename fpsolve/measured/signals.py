"""What is measured, and the units that it may have in a file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from fpsolve.measured.weak import Where

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True)
class Signal:
    """A signal that may be measured.

    Attributes:
        words: what it is.
        noise_in: where its noise is.
        unit: in which its numbers are used.
    """

    words: str
    noise_in: Where
    unit: str


SIGNALS: Mapping[str, Signal] = {
    "stiffness": Signal("relative stiffness", "stiffness", "1"),
    "damping": Signal("damping", "damping", "1/s"),
    "acceleration": Signal("vertical acceleration of the support", "stiffness", "m/s^2"),
    "height": Signal("metacentric height", "stiffness", "m"),
}
"""By the word of `fpsolve noise --of`."""
UNITS = """milli- = 1e-3 = m-
micro- = 1e-6 = µ- = μ- = u-
nano- = 1e-9 = n-
centi- = 0.01 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
meter = [length] = m = metre
kilogram = [mass] = kg
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft
second = [time] = s = sec = Second
millis = 1e-3 * second
micros = 1e-6 * second
minute = 60 * second = min
hour = 60 * minute = h
day = 24 * hour = d
cycle = [cycle] = cycles
radian = [angle] = rad
hertz = cycle / second = Hz
standard_gravity = 9.80665 * meter / second ** 2 = g = G
gal = 0.01 * meter / second ** 2 = Gal
volt = [voltage] = V = Volt
percent = 0.01 = %"""
"""As pint reads them. A cycle and a radian are no numbers here, so that a density per Hz is none per rad/s."""
DENSITIES = {"Hz": "hertz", "rad/s": "radian/second", "": "1/second"}
"""What a density may be per: per 1/s tells nothing."""
LONGEST = 40
"""Letters of a unit."""
_POWERS = str.maketrans({each: f"^{digit}" for digit, each in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")} | {"⁻": "^-", "−": "-"})
_NO_UNIT = re.compile(r"\d\s*(\*\*|\^)|\d\d|\(\s*\d|[^\w\s/*^().·%+-]")
"""Such as a power of a number, which takes for ever."""


class Density(NamedTuple):
    """What a density in a unit is raised to and multiplied by, and what it is per: "Hz", "rad/s" or ""."""

    power: int
    factor: float
    per: str


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint  # 0.3 s

    found: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    found.load_definitions(UNITS.splitlines())
    return found


@cache
def quantity(unit: str) -> pint.Quantity[float]:
    """One of a unit, written as m/s², m s-2, (m/s^2)^2/Hz or g/sqrt(Hz); 1 and - are none. Raises `ValueError`."""
    text = re.sub(r"√(\w+)|sqrt\((\w+)\)", r"(\1\2)^0.5", unit.strip().strip("[]"))
    text = re.sub(r"\^+(-?)\^", r"^\1", re.sub(r"[{}]", "", text).translate(_POWERS))
    text = re.sub(r"(?<=[A-Za-z)])(-?\d)", r"^\1", text)
    try:
        if len(text) > LONGEST or _NO_UNIT.search(text):
            raise ValueError
        return _registry().Quantity(1.0, _registry().parse_units("" if text in ("-", "1") else text))
    except Exception:  # pint raises many kinds for what is no unit
        level = "; its values are levels L: convert them, G = 10^(L/10)" if "dB" in unit else ""
        raise ValueError(f'has the unit "{unit}", which is not known{level}') from None


def has_dimension(unit: str, *wanted: str) -> bool:
    """Whether a unit is one of the kinds of some others."""
    try:
        return bool(unit) and any(quantity(unit).is_compatible_with(quantity(each)) for each in wanted)
    except ValueError:
        return False


def factor_of(unit: str, wanted: str) -> float:
    """What a number in a unit is multiplied by to be in the wanted one. Raises `ValueError`."""
    if not quantity(unit).is_compatible_with(quantity(wanted)):
        remedy = f"--unit {wanted} and --scale, how many {wanted} one {unit} stands for, or another --of"
        raise ValueError(f'has the unit "{unit}", and not {wanted} or one like it; state {remedy}')
    return float(quantity(unit).to(quantity(wanted).units).magnitude)


def density_of_unit(unit: str, signal: str) -> Density:
    """What a unit such as (m/s²)²/Hz, m2 s-4 Hz-1, g²/Hz, m² s or g/√Hz says of a density. Raises `ValueError`."""
    for per, each in DENSITIES.items():
        wanted = quantity(signal) ** 2 / quantity(each)
        for power in (1, 2):
            found = quantity(unit) ** power
            if found.is_compatible_with(wanted):
                return Density(power, float(found.to(wanted.units).magnitude), per)
    raise ValueError(f'has the unit "{unit}", which is none of a density, such as {density_such_as(signal)}')


def density_such_as(signal: str) -> str:
    """The usual unit of a density."""
    return "1/Hz" if signal == "1" else f"({signal})^2/Hz" if "/" in signal else f"{signal}^2/Hz"
