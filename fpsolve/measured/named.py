"""Spectral densities by their names: of waves, of wind and of earthquakes, as codes and textbooks have them.

Densities G below are one-sided: ∫ G df over f > 0, or ∫ G dω over ω > 0, is the variance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.measured.spectrum import Spectrum
from fpsolve.measured.weak import checked_choice

POINTS = 400
"""Frequencies of a spectrum, equally spaced in the logarithm."""
BELOW, ABOVE = 10.0, 20.0
"""How far these reach below and above the peak and the frequency that is wanted, as a factor."""
LEAST = 1e-6
"""Share of the largest density below which values are left out."""


def _jonswap(omega: FloatArray, Hs: float, Tp: float, gamma: float) -> FloatArray:
    own = 2 * math.pi / Tp
    width = np.where(omega <= own, 0.07, 0.09)
    base = 5 / 16 * Hs**2 * own**4 * omega**-5 * np.exp(-1.25 * (omega / own) ** -4)
    peak = gamma ** np.exp(-0.5 * ((omega - own) / (width * own)) ** 2)
    return (1 - 0.287 * math.log(gamma)) * base * peak


def _kanai_tajimi(omega: FloatArray, S0: float, omega_g: float, zeta_g: float) -> FloatArray:
    r = (omega / omega_g) ** 2
    damped = 4 * zeta_g**2 * r
    return 2 * S0 * (1 + damped) / ((1 - r) ** 2 + damped)


def _wind(
    omega: FloatArray, sigma: float, L: float, U: float, spread: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """4σ²(L/U)/spread(n) per Hz, n = fL/U."""
    return 4 * sigma**2 * (L / U) / spread(omega * L / (2 * math.pi * U)) / (2 * math.pi)


class Named(NamedTuple):
    """A family of spectral densities.

    Attributes:
        words: what it is, with its formula and source.
        unit: of the signal.
        parameters: by name what each is with its unit.
        density: G(ω), one-sided per rad/s, of ω > 0 and the parameters.
        peak: the frequency ω that it is spread around.
        usual: values of parameters that may be left out.
    """

    words: str
    unit: str
    parameters: Mapping[str, str]
    density: Callable[..., FloatArray]
    peak: Callable[[Mapping[str, float]], float]
    usual: Mapping[str, float] = {}


_WAVES = {"Hs": "significant wave height, in m", "Tp": "peak period, in s"}
_WIND = {"sigma": "standard deviation of the speed, in m/s", "L": "length scale, in m", "U": "mean speed, in m/s"}
NAMED: Mapping[str, Named] = {
    "jonswap": Named(
        "elevation of the sea, (1 − 0.287 ln γ) G_PM(ω) γ^exp(−((ω − ω_p)/(σω_p))²/2), σ = 0.07 for ω ≤ ω_p and 0.09 "
        "above (Hasselmann et al. 1973, in the form of DNV-RP-C205, 3.5.5)",
        "m",
        {**_WAVES, "gamma": "peakedness γ, 1 to 7, 3.3 if omitted"},
        _jonswap,
        lambda known: 2 * math.pi / known["Tp"],
        {"gamma": 3.3},
    ),
    "pierson-moskowitz": Named(
        "elevation of the sea, G_PM(ω) = (5/16) Hs² ω_p⁴ ω⁻⁵ exp(−(5/4)(ω/ω_p)⁻⁴), ω_p = 2π/Tp (Pierson and Moskowitz "
        "1964, in the form of DNV-RP-C205, 3.5.5)",
        "m",
        _WAVES,
        partial(_jonswap, gamma=1.0),
        lambda known: 2 * math.pi / known["Tp"],
    ),
    "von-karman": Named(
        "speed of the wind along its mean, G(f) = 4σ²(L/U)/(1 + 70.8 (fL/U)²)^(5/6) (von Kármán 1948, in the form of "
        "ESDU 85020)",
        "m/s",
        _WIND,
        partial(_wind, spread=lambda n: (1 + 70.8 * n**2) ** (5 / 6)),
        lambda known: 2 * math.pi * known["U"] / known["L"] / math.sqrt(70.8),
    ),
    "kaimal": Named(
        "speed of the wind along its mean, G(f) = 4σ²(L/U)/(1 + 6fL/U)^(5/3) (Kaimal et al. 1972, in the form of IEC "
        "61400-1)",
        "m/s",
        _WIND,
        partial(_wind, spread=lambda n: (1 + 6 * n) ** (5 / 3)),
        lambda known: 2 * math.pi * known["U"] / known["L"] / 6,
    ),
    "kanai-tajimi": Named(
        "acceleration of the ground, G(ω) = 2S₀(1 + 4ζ_g²r²)/((1 − r²)² + 4ζ_g²r²), r = ω/ω_g (Kanai 1957, Tajimi "
        "1960)",
        "m/s^2",
        {
            "S0": "two-sided density of the rock per rad/s, in m²/s³",
            "omega_g": "frequency of the ground, in rad/s, 15.6 if omitted",
            "zeta_g": "damping of the ground, a share of critical damping, 0.6 if omitted",
        },
        _kanai_tajimi,
        lambda known: known["omega_g"],
        {"omega_g": 15.6, "zeta_g": 0.6},
    ),
}
"""By the word of `fpsolve noise --named`."""


def parameters_of(text: str) -> dict[str, float]:
    """The numbers of a text such as "Hs=2,Tp=9". Raises `ValueError`."""
    found = dict[str, float]()
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise ValueError(f'got "{part}"; write each parameter with a number, such as Hs=2,Tp=9') from None
    return found


def _known(name: str, parameters: Mapping[str, float]) -> tuple[Named, Mapping[str, float]]:
    """A family and its parameters, those that are usual among them. Raises `ValueError`, see `named_density`."""
    family = NAMED[checked_choice("named", name, NAMED)]
    known = {**family.usual, **parameters}
    about = "; ".join(f"{key}: {words}" for key, words in family.parameters.items())
    for told, wrong in (("lacks", family.parameters.keys() - known), ("has no", known.keys() - family.parameters)):
        if wrong:
            raise ValueError(f"{name} {told} {', '.join(sorted(wrong))}; its parameters are {about}")
    for key, value in known.items():
        if not 0 < value < math.inf or (key == "gamma" and not 1 <= value <= 7):
            text = "from 1 to 7" if key == "gamma" else "> 0 and finite"
            raise ValueError(f"got {key} = {value:g}; must be {text} ({family.parameters[key]})")
    return family, known


def named_density(name: str, omega: ArrayLike, **parameters: float) -> FloatArray:
    """S(ω) = ∫ C(t) cos ωt dt of a family, in the square of its unit times s: πG(ω), see `NAMED`.

    Args:
        name: of the family.
        omega: ω > 0, in rad/s.
        parameters: of the family; those that have usual values may be left out.

    Raises:
        ValueError: there is no such family, or a parameter is missing, unknown, or not > 0 and finite.
    """
    family, known = _known(name, parameters)
    return math.pi * family.density(np.asarray(omega, dtype=float), **known)


def named_spectrum(name: str, near: float, **parameters: float) -> Spectrum:
    """The spectrum of a family around its peak and a frequency, see `named_density`.

    Args:
        name: of the family.
        near: a frequency that matters, in rad/s.
        parameters: of the family.
    """
    family, known = _known(name, parameters)
    peak = family.peak(known)
    omega = np.union1d(np.geomspace(min(peak, near) / BELOW, max(peak, near) * ABOVE, POINTS), near)
    density = named_density(name, omega, **known)
    inside = density > LEAST * density.max()
    about = ", ".join(f"{key} = {value:g}" for key, value in known.items())
    return Spectrum(omega[inside], density[inside], is_formula=True, read=about)
