"""Commented cases of each kind of system, for natural frequencies, damping ratios and a wall."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from fpsolve.case.messages import nearest, shown
from fpsolve.errors import FpsolveError

USUAL_ZETA = 0.01
"""The damping ratio where none is stated."""
RATIO = 1.6
"""Of the frequencies of two modes where only one is stated."""
MOST_MODES = 2


@dataclass(frozen=True)
class Modes:
    """What a new case is made of.

    Attributes:
        omega: natural frequencies, in rad/time, one or two.
        zeta: damping ratios, as many.
        restitution: speed after a bounce over that before; None where there is no wall.
        in_hertz: whether the frequencies were stated in Hz, so that the unit of time is the second.
    """

    omega: tuple[float, ...]
    zeta: tuple[float, ...]
    restitution: float | None = None
    in_hertz: bool = True


def modes_of(frequencies: Sequence[float], zeta: Sequence[float], restitution: float | None = None) -> Modes:
    """Modes by frequencies in Hz, or ω = 1 if none is stated, and damping ratios, 0.01 if none is stated.

    Raises:
        FpsolveError: a number is out of range, or there are not as many damping ratios as frequencies.
    """
    for name, values, low, high, remedy in (
        ("--frequency", frequencies, 1e-12, 1e12, "state it in Hz"),
        ("--damping-ratio", zeta, -1.0, 1.0, "state a share of critical damping: 0.01 is 1 %"),
        ("--restitution", [] if restitution is None else [restitution], 0.0, 1.0 + 1e-15, "1 means no wall"),
    ):
        for value in values:
            if not low < value < high:
                must = f"{low:g} < value {'<= 1' if name == '--restitution' else f'< {high:g}'}"
                raise FpsolveError(f"got {name} {shown(value)}; must be {must}; {remedy}")
    if len(frequencies) > MOST_MODES:
        raise FpsolveError(f"got {len(frequencies)} frequencies; must be one or two; choose those of the coupled modes")
    if len(zeta) not in (0, 1, max(len(frequencies), 1)):
        text = (
            f"got {len(zeta)} --damping-ratio for {len(frequencies)} --frequency; must be one for each, or one for all"
        )
        raise FpsolveError(f"{text}; leave one out")
    omega = tuple(2 * math.pi * each for each in frequencies) or (1.0,)
    ratios = tuple(zeta) if len(zeta) == len(omega) else (*zeta, USUAL_ZETA)[:1] * len(omega)
    return Modes(omega, ratios, restitution, in_hertz=bool(frequencies))


class Parts(NamedTuple):
    """The text of a case up to its noise, and the noise."""

    head: str
    noise: str


def case_text(kind: str, modes: Modes, noise: str = "") -> str:
    """The text of a case of a kind of system, see `TEMPLATES`.

    Args:
        kind: its word.
        modes: its frequencies, damping and wall.
        noise: its sections of noise; one to be replaced if none are stated.

    Raises:
        FpsolveError: there is no such kind, or it has no place for two modes, or for a wall.
    """
    make = TEMPLATES.get(SYNONYMS.get(kind, kind))
    if make is None:
        known = ", ".join(TEMPLATES)
        raise FpsolveError(
            f"got --kind {shown(kind)}; must be one of {known};{nearest(kind, TEMPLATES)} name one of these"
        )
    if len(modes.omega) > 1 and make is not _modes:
        raise FpsolveError(f"got two frequencies for --kind {kind}, which has one mode; write --kind modes")
    if modes.restitution not in (None, 1.0) and make is _modes:
        raise FpsolveError("got --restitution for --kind modes, which has no walls; leave it out, or take another kind")
    if make is _modes and not modes.in_hertz:
        modes = replace(modes, omega=(1.0, RATIO), zeta=modes.zeta * 2)
    head, own = make(modes)
    moments = _MOMENTS_OF_FOUR if len(modes.omega) > 1 else _MOMENTS
    return f"{head}{noise or own}{_UNITS if modes.in_hertz else ''}{moments}"


def sum_text(modes: Modes, names: Sequence[str], noise_in: str, noise: str) -> str:
    """The text of a case of one mode under the sum of several noises, by their names, in its stiffness or damping."""
    drive = " + ".join(names)
    force = f" + ({drive}) * v" if noise_in == "damping" else f" - ({drive}) * x"
    drift = f"-omega**2 * x - 2*zeta*omega * v{force}"
    about = f"# An oscillator with the noise {drive} in its {noise_in}.\n"
    return (
        f"{about}{_equation(modes, f'Oscillator with noise in its {noise_in}', drift, names)}{noise}{_UNITS}{_MOMENTS}"
    )


_UNITS = """
[units]
time = "s"                          # labels tables, figures and files
"""

_OUTPUT = """
[output]
# quantities = "all"                # or a list of names; if omitted Λ(p), λ, δ_p, and of walls N and R_c
"""
_MOMENTS = f"""
[moments]
p = {{ start = -2.0, stop = 4.0, num = 25 }}   # Λ(p) < 0 means that the moment of order p decays
{_OUTPUT}"""
_MOMENTS_OF_FOUR = f"""
[moments]
p = [1.0, 2.0]                      # Λ(p) < 0 means that the moment of order p decays
{_OUTPUT}"""


def _line(key: str, value: float | str, comment: str) -> str:
    text = f"{key} = {value if isinstance(value, str) else _number(value)}"
    return f"{text:34}  # {comment}\n"


def _number(value: float) -> str:
    """With 12 digits, as TOML has it."""
    text = f"{value:.12g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def _title(modes: Modes, words: str) -> str:
    omega, zeta = modes.omega[0], modes.zeta[0]
    own = f"{omega / (2 * math.pi):.4g} Hz" if modes.in_hertz else f"ω = {omega:g}"
    return f'title = "{words}: {own}, {zeta:.4g} of critical damping"\n'


def _unit(modes: Modes) -> str:
    return "s" if modes.in_hertz else "time"


def _of_omega(modes: Modes, i: int = 0) -> str:
    omega = modes.omega[i]
    if modes.in_hertz:
        return f"ω = 2π f for f = {omega / (2 * math.pi):.6g} Hz, in rad/s"
    return "natural frequency, in rad/time"


def _noise(section: str, what: str, unit: str, rate: float, deviation: float, time: str) -> str:
    """A noise to be replaced."""
    return (
        f"\n{f'[{section}]':34}  # {what}, to be replaced: `fpsolve noise` fits one to what was measured\n"
        + _line("kind", '"ornstein-uhlenbeck"', "or another, see the page Noises")
        + _line("alpha", rate, f"1 over the correlation time, in 1/{time}")
        + _line("standard_deviation", deviation, f"of ξ{unit}")
    )


def _oscillator(modes: Modes) -> Parts:
    omega, zeta, time, r = modes.omega[0], modes.zeta[0], _unit(modes), modes.restitution or 1.0
    return Parts(
        "# ẍ − (c1 + ξ) ẋ + ω² x = 0, Eq. (3), with a wall at x = 0: the noise ξ is in the damping.\n"
        + _title(modes, "Oscillator with noise in its damping")
        + "\n[oscillator]\n"
        + _line("omega", omega, _of_omega(modes))
        + _line("c1", -2 * zeta * omega, f"−2ζω/ε² for ζ = {zeta:g}, in 1/{time}; positive feeds energy in")
        + _line("restitution", r, "speed after a bounce over that before; 1 means no wall")
        + _line(
            "impact", '"restitution"', f'the bounce itself; "delta" would multiply the speed by {math.exp(r - 1):.4g}'
        )
        + _line("epsilon", 1.0, "1: noise, damping and loss are as stated"),
        _noise("noise", "of the damping", f", in 1/{time}", omega, 0.1 * omega, time),
    )


def _parametric(modes: Modes) -> Parts:
    omega, zeta, time, r = modes.omega[0], modes.zeta[0], _unit(modes), modes.restitution or 1.0
    return Parts(
        "# ẍ + 2·damping·ẋ + (stiffness + ξ) x = 0 with a wall at x = 0: the noise ξ is in the stiffness.\n"
        + _title(modes, "Oscillator with noise in its stiffness")
        + '\n[system]\nkind = "parametric"\n'
        + _line("stiffness", omega**2, f"ω², in 1/{time}²; {_of_omega(modes)}")
        + _line("damping", zeta * omega, f"ζω for ζ = {zeta:g}, in 1/{time}")
        + _line("restitution", r, "speed after a bounce over that before; 1 means no wall"),
        _noise("noise", "of the stiffness", f", in 1/{time}²", omega, 0.1 * omega**2, time),
    )


def _system(modes: Modes) -> Parts:
    drift = "-omega**2 * (1 + load) * x - 2*zeta*omega * v"
    return Parts(
        "# An equation of your own: ẍ + 2ζω ẋ + ω² (1 + load) x = 0. Change it, see the page Your own equation.\n"
        + _equation(modes, "Own equation", drift, ["load"]),
        _noise("noise.load", "of the relative stiffness", ", dimensionless", modes.omega[0], 0.1, _unit(modes)),
    )


def _equation(modes: Modes, title: str, drift: str, names: Sequence[str]) -> str:
    """Equations in x and v, with the rate of v."""
    omega, zeta, r = modes.omega[0], modes.zeta[0], modes.restitution
    wall = "" if r is None else f", R = {_number(r)}"
    walls = "" if r is None else 'walls = [{ at = "x = 0", restitution = "R" }]   # v after a bounce is −R v\n'
    return (
        _title(modes, title)
        + '\n[system]\nvariables = ["x", "v"]\n'
        + f'drift = ["v", "{drift}"]   # ẋ and v̇\n'
        + f"parameters = {{ omega = {_number(omega)}, zeta = {_number(zeta)}{wall} }}   # {_of_omega(modes)}\n"
        + "noises = { "
        + ", ".join(f'{name} = "noise.{name}"' for name in names)
        + " }\n"
        + walls
    )


def _plane(modes: Modes) -> Parts:
    omega, zeta, time, r = modes.omega[0], modes.zeta[0], _unit(modes), modes.restitution
    square, damping = _number(omega**2), _number(-2 * zeta * omega + 0.0)
    jump = (
        ""
        if r is None
        else f"jumps = [{{ phase = {math.pi / 2!r}, log_factor = {_number(math.log(r))} }}]   # ln R at x = 0\n"
    )
    return Parts(
        "# d(x, v)/dt = (A + ξ B)(x, v) by matrices; here ẍ + 2ζω ẋ + ω² (1 + ξ) x = 0.\n"
        + _title(modes, "System of two variables by matrices")
        + '\n[system]\nkind = "plane"\nterms = [\n'
        + f"    {{ matrix = [[0, 1], [-{square}, {damping}]] }},   # A; {_of_omega(modes)}\n"
        + f"    {{ order = 1, matrix = [[0, 0], [-{square}, 0]], noise = true }},   # B\n]\n"
        + jump,
        _noise("noise", "of the relative stiffness", ", dimensionless", omega, 0.1, time),
    )


def _modes(modes: Modes) -> Parts:
    omega, zeta, time, n = modes.omega, modes.zeta, _unit(modes), len(modes.omega)

    def diagonal(values: Sequence[float]) -> str:
        rows = [", ".join(_number(values[i]) if i == j else "0.0" for j in range(n)) for i in range(n)]
        return f"[[{'], ['.join(rows)}]]"

    own = ", ".join(f"{each / (2 * math.pi):.6g} Hz" if modes.in_hertz else f"ω = {each:g}" for each in omega)
    count = "Two modes" if n == 2 else "One mode"
    shares = [
        ", ".join(_number((1.0 if i == j else 0.5) * a * b) for j, b in enumerate(omega)) for i, a in enumerate(omega)
    ]
    coupled = f"[[{'], ['.join(shares)}]]"
    return Parts(
        "# M q̈ + C q̇ + (K + ξ K_ξ) q = 0 in modal coordinates, M = 1.\n"
        + f'title = "{count}: {own}"\n'
        + f'\n[system]\nkind = "modes"\nmass = {diagonal([1.0] * n)}\n'
        + f"damping = {diagonal([2 * z * w for z, w in zip(zeta, omega, strict=True)])}   # 2ζω, in 1/{time}\n"
        + f"stiffness = {diagonal([w * w for w in omega])}   # ω², in 1/{time}²\n"
        + f"stiffness_noise = {coupled}   # K_ξ: replace it by the geometric stiffness of your load\n",
        _noise("noise", "of the relative stiffness", ", dimensionless", omega[0], 0.1, time),
    )


TEMPLATES: Mapping[str, Callable[[Modes], Parts]] = {
    "oscillator": _oscillator,
    "system": _system,
    "parametric": _parametric,
    "modes": _modes,
    "plane": _plane,
}
"""By the word of `fpsolve new --kind`."""
SYNONYMS = {"vibro-impact": "oscillator", "equations": "system"}
"""What case files call them."""
