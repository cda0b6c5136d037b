"""Spectral densities that have names: by their sources in another form in 30 digits, and their variances."""

import math

import mpmath
from scipy.integrate import quad

from fpsolve.measured import named_density
from tests.numbers.values import Quantity, Row

WAVES, WIND = {"Hs": 2.0, "Tp": 9.0}, {"sigma": 1.5, "L": 120.0, "U": 11.0}
STATED = {
    "jonswap": WAVES,
    "pierson-moskowitz": WAVES,
    "von-karman": WIND,
    "kaimal": WIND,
    "kanai-tajimi": {"S0": 0.01},
}


def one_sided_per_hertz(name, f):
    """G(f) of the sources, by other arrangements of their formulas."""
    f = mpmath.mpf(f)
    if name in ("jonswap", "pierson-moskowitz"):
        hs, fp, gamma = mpmath.mpf(2), 1 / mpmath.mpf(9), mpmath.mpf("3.3" if name == "jonswap" else 1)
        sigma = mpmath.mpf("0.07") if f <= fp else mpmath.mpf("0.09")
        base = mpmath.mpf(5) / 16 * hs**2 / fp * (fp / f) ** 5 * mpmath.exp(-mpmath.mpf("1.25") * (fp / f) ** 4)
        b = mpmath.exp(-((f / fp - 1) ** 2) / (2 * sigma**2))
        return (1 - mpmath.mpf("0.287") * mpmath.log(gamma)) * base * gamma**b
    if name == "kanai-tajimi":
        w, own, zeta = 2 * mpmath.pi * f, mpmath.mpf("15.6"), mpmath.mpf("0.6")
        gain = abs((own**2 + 2j * zeta * own * w) / (own**2 - w**2 + 2j * zeta * own * w)) ** 2
        return 2 * mpmath.pi * 2 * mpmath.mpf("0.01") * gain
    n = f * 120 / 11
    shape = (1 + 6 * n) ** (-mpmath.mpf(5) / 3)
    shape = shape if name == "kaimal" else (1 + mpmath.mpf("70.8") * n**2) ** (-mpmath.mpf(5) / 6)
    return 4 * mpmath.mpf("1.5") ** 2 * (n / f) * shape


def density(name: str, f: str) -> Row:
    """S(2πf) = G(f)/2."""
    with mpmath.workdps(30):
        right = float(one_sided_per_hertz(name, f) / 2)
    found = Quantity(f"S({f} Hz)", lambda _: (float(named_density(name, 2 * math.pi * float(f), **STATED[name])), 0.0))
    return Row(dict, found, right, 1e-10 * right, 0.0, f"{name} in 30 digits")


def variance(name: str, right: float, share: float) -> Row:
    """∫ S dω/π over ω > 0."""

    def over_logarithms(x):
        return math.exp(x) * float(named_density(name, math.exp(x), **STATED[name])) / math.pi

    def solved(_):
        return quad(over_logarithms, -25, 25, limit=500, points=[math.log(2 * math.pi / 9)])[0], 0.0

    return Row(dict, Quantity("variance", solved), right, share * right, 0.0, name)


ROWS = [
    *[density(name, f) for name in STATED for f in ("0.06", "0.111", "0.12", "0.3", "2.5")],
    variance("pierson-moskowitz", (2.0 / 4) ** 2, 1e-9),  # m₀ = (Hs/4)²
    variance("jonswap", (2.0 / 4) ** 2, 0.02),  # as its factor 1 − 0.287 ln γ is a fit
    variance("von-karman", 1.5**2, 2e-3),
    variance("kaimal", 1.5**2, 1e-7),
]
