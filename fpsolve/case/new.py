"""Commented cases of each kind of system, for natural frequencies, damping ratios and a wall."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.errors import FpsolveError
from fpsolve.explain import nearest, shown

USUAL_ZETA = 0.01
"""The damping ratio where none is stated."""
RATIO = 1.6
"""Of the frequencies of two modes where only one is stated."""
MOST_MODES = 2
"""Largest number of modes."""
KINDS = "oscillator", "system", "parametric", "modes", "plane"
"""The words of `fpsolve new --kind`, and the names of the files in `templates`."""
SYNONYMS = {"vibro-impact": "oscillator", "equations": "system"}
"""What case files call them."""
COMMENT = re.compile(r"^(.*\S)  # ", re.MULTILINE)
"""A value and its comment, which are put into columns."""


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


def case_text(kind: str, modes: Modes, noise: str = "") -> str:
    """The text of a case of a kind of system, see `KINDS`.

    Args:
        kind: its word.
        modes: its frequencies, damping and wall.
        noise: its sections of noise; one to be replaced if none are stated.

    Raises:
        FpsolveError: there is no such kind, or it has no place for two modes, or for a wall.
    """
    name = SYNONYMS.get(kind, kind)
    if name not in KINDS:
        known = f"must be one of {', '.join(KINDS)};{nearest(kind, KINDS)} name one of these"
        raise FpsolveError(f"got --kind {shown(kind)}; {known}")
    if len(modes.omega) > 1 and name != "modes":
        raise FpsolveError(f"got two frequencies for --kind {kind}, which has one mode; write --kind modes")
    if modes.restitution not in (None, 1.0) and name == "modes":
        raise FpsolveError("got --restitution for --kind modes, which has no walls; leave it out, or take another kind")
    if name == "modes" and not modes.in_hertz:
        modes = replace(modes, omega=(1.0, RATIO), zeta=modes.zeta * 2)
    return _filled(
        name,
        modes,
        noise,
        first="An equation of your own: ẍ + 2ζω ẋ + ω² (1 + load) x = 0. Change it, see the page Your own equation.",
        title="Own equation",
        drift="-omega**2 * (1 + load) * x - 2*zeta*omega * v",
        names=["load"],
    )


def sum_text(modes: Modes, names: Sequence[str], noise_in: str, noise: str) -> str:
    """The text of a case of one mode under the sum of several noises, by their names, in its stiffness or damping."""
    drive = " + ".join(names)
    force = f" + ({drive}) * v" if noise_in == "damping" else f" - ({drive}) * x"
    return _filled(
        "system",
        modes,
        noise,
        first=f"An oscillator with the noise {drive} in its {noise_in}.",
        title=f"Oscillator with noise in its {noise_in}",
        drift=f"-omega**2 * x - 2*zeta*omega * v{force}",
        names=names,
    )


def _filled(name: str, modes: Modes, noise: str, **more: Any) -> str:
    """A template filled with numbers, and what each case ends with."""
    omega, zeta, time = modes.omega[0], modes.zeta[0], "s" if modes.in_hertz else "time"
    hertz = [each / (2 * math.pi) for each in modes.omega]
    own = f"{hertz[0]:.4g} Hz" if modes.in_hertz else f"ω = {omega:g}"
    in_hertz = f"ω = 2π f for f = {hertz[0]:.6g} Hz, in rad/s"
    facts = {
        **more,
        "omega": omega,
        "omegas": modes.omega,
        "zeta": zeta,
        "restitution": modes.restitution,
        "time": time,
        "in_hertz": modes.in_hertz,
        "about": f"{own}, {zeta:.4g} of critical damping",
        "of_omega": in_hertz if modes.in_hertz else "natural frequency, in rad/time",
        "frequencies": ", ".join(
            f"{f:.6g} Hz" if modes.in_hertz else f"ω = {each:g}" for f, each in zip(hertz, modes.omega, strict=True)
        ),
        "mass": [1.0] * len(hertz),
        "damping": [2 * zeta * omega for zeta, omega in zip(modes.zeta, modes.omega, strict=True)],
        "stiffness": [omega**2 for omega in modes.omega],
        "coupled": [[a * b * (1.0 if a == b else 0.5) for b in modes.omega] for a in modes.omega],
        "noise": noise.rstrip("\n"),
    }

    def of_noise(section: str, what: str, unit: str, rate: float, deviation: float) -> str:
        noise = {"section": section, "what": what, "unit": unit, "rate": rate, "deviation": deviation}
        return str(_template("noise").render(facts | noise))

    text = "\n".join(_template(each).render(facts, own=of_noise) for each in (name, "end"))
    return COMMENT.sub(lambda match: f"{match[1]:34}  # ", text) + "\n"


@cache
def _template(name: str) -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    folder = Path(__file__).with_name("templates")
    templates = Environment(loader=FileSystemLoader(folder), undefined=StrictUndefined, trim_blocks=True)
    templates.filters |= {"number": _number, "matrix": _matrix, "diagonal": _diagonal, "short": "{:g}".format}
    templates.globals |= {"exp": math.exp, "log": math.log}
    return templates.get_template(f"{name}.toml")


def _number(value: float) -> str:
    """With 12 digits, as TOML has it."""
    text = f"{value + 0.0:.12g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def _matrix(rows: Sequence[Sequence[float]]) -> str:
    return f"[[{'], ['.join(', '.join(map(_number, row)) for row in rows)}]]"


def _diagonal(values: Sequence[float]) -> str:
    return _matrix(np.diag(values).tolist())
